"""zaber-motion: open, detect without identifying, home, move, stop, data that are refused."""

import json
import sys
import time

from zaber_motion.ascii import Connection
from zaber_motion.exceptions import CommandFailedException

with Connection.open_tcp("127.0.0.1", int(sys.argv[1])) as connection:
    (device,) = connection.detect_devices(identify_devices=False)
    axis, found = device.get_axis(1), {}

    def refusal_of(ask, *about, **more):
        try:
            ask(*about, **more)
        except CommandFailedException as error:
            return error.details.response_data
        return ""

    if "refused" in sys.argv:
        found |= {
            "home": refusal_of(axis.home),
            "move": refusal_of(axis.move_absolute, 1000),
            "stop": refusal_of(axis.stop),
        }
        print(json.dumps(found))
        sys.exit()
    axis.home()
    found["home"] = axis.get_position()
    axis.move_absolute(100_000)
    found |= {"position": axis.get_position(), "busy": axis.is_busy()}
    axis.move_relative(-1500)
    found["by"] = axis.get_position()
    found["beyond"] = refusal_of(axis.move_absolute, 10**9)
    found["nonsense"] = refusal_of(device.generic_command, "fly away")
    axis.move_absolute(300_000, wait_until_idle=False)
    time.sleep(0.2)
    found["under_way"] = axis.is_busy()
    axis.stop()
    found["stopped"] = axis.get_position()
    axis.move_velocity(20_000 * 1.6384)
    time.sleep(0.4)
    found["velocity_busy"] = axis.is_busy()
    axis.stop()
    found["after_velocity"] = axis.get_position()
    found["round_trips"] = []  # [s]
    for _ in range(200):
        begin = time.perf_counter()
        axis.get_position()
        found["round_trips"].append(time.perf_counter() - begin)
    found["checksums"] = connection.checksum_enabled
    print(json.dumps(found))
