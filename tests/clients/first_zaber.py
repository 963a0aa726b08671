"""zaber-motion: a move in native units, and one that is refused."""

import sys

from zaber_motion.ascii import Connection
from zaber_motion.exceptions import CommandFailedException

with Connection.open_tcp("127.0.0.1", int(sys.argv[1])) as connection:
    (device,) = connection.detect_devices(identify_devices=False)
    axis = device.get_axis(1)
    axis.move_absolute(100_000)
    print("at", round(axis.get_position(), -2), "counts")
    try:
        axis.move_absolute(900_000)
    except CommandFailedException as refused:
        print(refused.details.response_data)
