"""A first session with a drive: enabled, a profile position move by process data, off."""

import sys
import time

import canopen
from canopen.profiles.p402 import BaseNode402


def session(network, number, sheet):
    """Enable, move to 60 mm, which is 60000 counts, and let go."""
    drive = BaseNode402(number, sheet)
    drive.TIMEOUT_SWITCH_OP_MODE = drive.TIMEOUT_SWITCH_STATE_SINGLE = 3.0  # for a computer that is busy
    drive.TIMEOUT_SWITCH_STATE_FINAL = 12.0
    network.add_node(drive)
    drive.nmt.state = "PRE-OPERATIONAL"
    time.sleep(0.1)
    drive.setup_402_state_machine()
    drive.nmt.state = "OPERATIONAL"
    drive.op_mode = "PROFILED POSITION"
    drive.state = "OPERATION ENABLED"
    print(drive.state, "in mode", drive.op_mode)

    def status(bit):
        return drive.sdo["Statusword"].raw >> bit & 1

    drive.rpdo[1]["Target position"].raw = 60_000
    for word, bit, value in ((0x1F, 12, 1), (0x0F, 12, 0), (0x0F, 10, 1)):  # new, acknowledged; withdrawn; reached
        drive.rpdo[1]["Controlword"].raw = word
        drive.rpdo[1].transmit()
        while status(bit) != value:
            time.sleep(0.01)
    print("at", round(drive.sdo["Position actual value"].raw, -2), "counts")
    drive.state = "SWITCH ON DISABLED"
    print(drive.state)


if __name__ == "__main__":
    interface, channel, number, sheet, *filters = sys.argv[1:]
    network = canopen.Network()
    wanted = [{"can_id": int(one.strip(","), 16), "can_mask": 0x7FF} for one in filters]
    network.connect(interface=interface, channel=channel, can_filters=wanted or None)
    try:
        session(network, int(number), sheet)
    finally:
        network.disconnect()
