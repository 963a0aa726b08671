"""canopen's BaseNode402: set up by SDO, enabled, moved by process data, homed, run, stopped, off."""

import json
import sys
import time

import canopen
from canopen.profiles.p402 import BaseNode402

MOST = 20.0


def until(met, what):
    begin = time.monotonic()
    while not met():
        if time.monotonic() - begin > MOST:
            raise SystemExit(f"waited in vain for {what}")
        time.sleep(0.005)


def patient(node):
    """The library gives a drive 0.4 s a step, of a processor that others use as well."""
    node.TIMEOUT_SWITCH_STATE_SINGLE, node.TIMEOUT_SWITCH_STATE_FINAL, node.TIMEOUT_SWITCH_OP_MODE = 3.0, 12.0, 3.0
    node.TIMEOUT_CHECK_TPDO = 2.0
    return node


def session(network, number, sheet):
    """What a master does with a drive."""
    found = {}
    node = patient(BaseNode402(number, sheet))
    network.add_node(node)
    node.nmt.send_command(0x80)
    time.sleep(0.1)
    node.sdo[0x1017].raw = 100
    node.nmt.wait_for_heartbeat(5)
    node.setup_402_state_machine()
    node.nmt.send_command(0x01)
    time.sleep(0.1)
    found["device"] = node.sdo[0x1000].raw
    node.op_mode = "PROFILED POSITION"
    begin = time.monotonic()
    node.state = "OPERATION ENABLED"
    found |= {"enabled": node.state, "enabling_ms": (time.monotonic() - begin) * 1e3}
    rpdo = node.rpdo[1]

    def command(word, target=0):
        rpdo["Controlword"].raw, rpdo["Target position"].raw = word, target
        rpdo.transmit()

    def status(bit):
        return node.sdo[0x6041].raw >> bit & 1

    command(0x1F, 60_000)
    until(lambda: status(12), "the acknowledgement")
    command(0x0F, 60_000)
    until(lambda: not status(12), "its end")
    until(lambda: status(10), "the target")
    found["position"] = node.sdo[0x6064].raw
    command(0x5F, -2_000)
    until(lambda: status(12), "the acknowledgement")
    command(0x0F)
    until(lambda: status(10) and not status(12), "the target")
    found["by"] = node.sdo[0x6064].raw
    node.op_mode = "HOMING"
    node.controlword = 0x0F
    node.controlword = 0x1F
    until(lambda: status(12), "the reference")
    found["homed"] = node.sdo[0x6064].raw
    node.controlword = 0x0F
    node.op_mode = "PROFILED VELOCITY"
    node.sdo[0x60FF].raw = 40_000
    until(lambda: abs(node.sdo[0x606C].raw - 40_000) < 4_000, "the velocity")
    found["velocity"] = node.sdo[0x606C].raw
    node.state = "QUICK STOP ACTIVE"
    found["quick"] = node.state
    until(lambda: abs(node.sdo[0x606C].raw) < 500, "rest")
    node.state = "SWITCH ON DISABLED"
    found["off"] = node.state
    return found | {"round_trips": trips(node)}


def trips(node):
    """Times of a question and its answer [s]."""
    times = []
    for _ in range(200):
        begin = time.perf_counter()
        node.sdo[0x6064].raw
        times.append(time.perf_counter() - begin)
    return times


if __name__ == "__main__":
    interface, channel, number, sheet, *filters = sys.argv[1:]
    options = {"can_filters": [{"can_id": int(one, 16), "can_mask": 0x7FF} for one in filters]} if filters else {}
    network = canopen.Network()
    network.connect(interface=interface, channel=channel, **options)
    try:
        print(json.dumps(session(network, int(number), sheet)))
    finally:
        network.disconnect()
