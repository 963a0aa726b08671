"""pipython: servo, reference, move, the wait for the target, a limit, a stop."""

import json
import sys
import time

from pipython import GCSDevice, GCSError, pitools
from pipython.pidevice.interfaces.pisocket import PISocket

with PISocket(host="127.0.0.1", port=int(sys.argv[1])) as gateway:
    device = GCSDevice(gateway=gateway)
    axis = device.axes[0]
    found = {"identity": device.qIDN(), "axes": device.axes, "help": device.qHLP()}

    def error_of(ask, *about):
        try:
            ask(*about)
        except GCSError as error:
            return error.val
        return 0

    if "refused" in sys.argv:
        found |= {"servo": error_of(device.SVO, axis, True), "move": error_of(device.MOV, axis, 30.0)}
        found["stop"] = error_of(lambda: device.STP(noraise=True))
        print(json.dumps(found))
        sys.exit()
    found["without_servo"] = error_of(device.MOV, axis, 30.0)
    device.SVO(axis, True)
    device.FRF(axis)
    pitools.waitontarget(device, axis)
    found |= {"servo": device.qSVO()[axis], "referenced": device.qFRF()[axis]}
    device.MOV(axis, 60.0)
    found["under_way"] = device.qONT()[axis]
    pitools.waitontarget(device, axis)
    found |= {"position": device.qPOS()[axis], "target": device.qMOV()[axis], "on_target": device.qONT()[axis]}
    device.MVR(axis, -2.5)
    pitools.waitontarget(device, axis)
    found |= {"by": device.qPOS()[axis], "low": device.qTMN()[axis], "high": device.qTMX()[axis]}
    found["limit"] = error_of(device.MOV, axis, 1e6)
    found["too_fast"] = error_of(device.VEL, axis, 1e6)
    device.VEL(axis, 40.0)
    found["speed"] = device.qVEL()[axis]
    found["unknown"] = error_of(device.send, "XYZ 1 2")
    device.MOV(axis, 300.0)
    time.sleep(0.3)
    device.STP(noraise=True)
    begin = time.monotonic()
    while device.IsMoving(axis)[axis] and time.monotonic() - begin < 2.0:
        time.sleep(0.01)
    found |= {"stopped": device.qPOS()[axis], "moving": device.IsMoving(axis)[axis]}
    found["round_trips"] = []  # [s]
    for _ in range(200):
        begin = time.perf_counter()
        device.qPOS()
        found["round_trips"].append(time.perf_counter() - begin)
    print(json.dumps(found))
