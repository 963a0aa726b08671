"""canopen's BaseNode402 in its cyclic modes: positions, then velocities, one in each interpolation period, and none."""

import json
import math
import statistics
import sys
import time

import canopen
from canopen.profiles.p402 import BaseNode402

PERIOD = 0.1  # of the interpolation [s]: what keeps time here is a busy machine
MOST = 20.0


def until(met, what):
    begin = time.monotonic()
    while not met():
        if time.monotonic() - begin > MOST:
            raise SystemExit(f"waited in vain for {what}")
        time.sleep(0.005)


def follow(node, network, name, targets):
    """Send targets in time; gives where the drive was at each SYNC."""
    rpdo, found, begin = node.rpdo[1 if name == "Target position" else 2], [], time.monotonic()
    for number, target in enumerate(targets):
        rpdo[name].raw = target
        if name == "Target position":
            rpdo["Controlword"].raw = 0x0F
        else:
            rpdo["Modes of operation"].raw = 9
        rpdo.transmit()
        network.sync.transmit()
        found.append(node.tpdo[1]["Position actual value"].raw)
        time.sleep(max(begin + (number + 1) * PERIOD - time.monotonic(), 0.0))
    return found


def session(network, number, sheet):
    """What a master does that leads a drive by itself."""
    found = {}
    node = BaseNode402(number, sheet)
    node.TIMEOUT_SWITCH_STATE_SINGLE, node.TIMEOUT_SWITCH_STATE_FINAL, node.TIMEOUT_SWITCH_OP_MODE = 3.0, 12.0, 3.0
    node.TIMEOUT_CHECK_TPDO = node.sdo.RESPONSE_TIMEOUT = 3.0
    network.add_node(node)
    node.nmt.send_command(0x80)
    time.sleep(0.1)
    node.setup_402_state_machine()
    node.sdo[0x60C2][1].raw, node.sdo[0x60C2][2].raw = 1, -1
    node.nmt.send_command(0x01)
    time.sleep(0.1)
    found["modes"] = node.sdo[0x6502].raw
    node.op_mode = "CYCLIC SYNCHRONOUS POSITION"
    node.state = "OPERATION ENABLED"

    def follows():
        return bool(node.sdo[0x6041].raw & 0x1000)

    until(follows, "the mode")
    start = node.sdo[0x6064].raw
    until(lambda: node.tpdo[1]["Position actual value"].raw == start, "process data")
    targets = [start + round(10_000 * (1.0 - math.cos(math.pi * k / 20))) for k in range(1, 41)] + [start] * 3
    places = follow(node, network, "Target position", targets)
    found["behind"] = statistics.median(abs(place - target) for place, target in zip(places, targets, strict=True))
    found["way"] = max(places) - start
    until(lambda: not follows(), "the end of a stream that nobody goes on with")
    found |= {"state": node.state, "end": node.sdo[0x6064].raw - start}
    node.op_mode = "CYCLIC SYNCHRONOUS VELOCITY"
    until(follows, "the mode")
    follow(node, network, "Target velocity", [min(4_000 * k, 20_000) for k in range(1, 21)])
    found["velocity"] = node.sdo[0x606C].raw
    until(lambda: not follows(), "the end of a stream that nobody goes on with")
    until(lambda: abs(node.sdo[0x606C].raw) < 500, "rest")
    node.state = "SWITCH ON DISABLED"
    return found


if __name__ == "__main__":
    interface, channel, number, sheet = sys.argv[1:]
    network = canopen.Network()
    network.connect(interface=interface, channel=channel)
    try:
        print(json.dumps(session(network, int(number), sheet)))
    finally:
        network.disconnect()
