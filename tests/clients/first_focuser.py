"""alpyca: a focuser is found, moved, and asked for what it has not."""

import sys
import time

from alpaca.exceptions import NotImplementedException
from alpaca.focuser import Focuser
from alpaca.management import configureddevices

(found,) = configureddevices(sys.argv[1])
print(found["DeviceType"], found["DeviceNumber"], found["DeviceName"])
focuser = Focuser(sys.argv[1], 0)
focuser.Connected = True
focuser.Move(70_000)
while focuser.IsMoving:
    time.sleep(0.05)
print("at", round(focuser.Position, -2), "of", focuser.MaxStep)
try:
    print(focuser.Temperature)
except NotImplementedException as refused:
    print(refused.message)
focuser.Connected = False
