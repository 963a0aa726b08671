"""pipython: servo on, a move, the wait for the target, and a limit."""

import sys

from pipython import GCSDevice, GCSError, pitools
from pipython.pidevice.interfaces.pisocket import PISocket

stage = GCSDevice(gateway=PISocket(host="127.0.0.1", port=int(sys.argv[1])))
axis = stage.axes[0]
stage.SVO(axis, True)
stage.MOV(axis, 60.0)
pitools.waitontarget(stage, axis)
print(f"axis {axis} at {stage.qPOS(axis)[axis]:.1f} {stage.qPUN(axis)[axis]}")
try:
    stage.MOV(axis, 900.0)
except GCSError as refused:
    print(refused)
