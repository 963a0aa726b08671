"""The tiles of a two-motor stage, visited by other people's libraries: where it stood at each, [mm] both."""

import csv
import json
import sys
import time
from pathlib import Path

what, file, *about = sys.argv[1:]
with Path(file).open(newline="", encoding="utf-8") as text:
    rows = [*csv.DictReader(line for line in text if not line.startswith("#"))]
tiles = [(float(row["x [mm]"]), float(row["y [mm]"])) for row in rows]
found = []


def until(met, seconds=20.0):
    begin = time.monotonic()
    while not met():
        if time.monotonic() - begin > seconds:
            raise SystemExit("waited in vain")
        time.sleep(0.01)


if what == "bluesky":
    from bluesky import RunEngine
    from bluesky.plans import list_scan
    from ophyd import EpicsMotor

    x, y = (EpicsMotor(f"{about[0]}:{name}", name=name, settle_time=0.1) for name in "xy")
    for motor in (x, y):
        motor.wait_for_connection(timeout=10)
    engine = RunEngine()
    engine.subscribe(lambda kind, told: kind == "event" and found.append([told["data"]["x"], told["data"]["y"]]))
    engine(list_scan([x, y], x, [tile[0] for tile in tiles], y, [tile[1] for tile in tiles]))
elif what == "grbl":
    from grbl_streamer import GrblStreamer

    events = []
    streamer = GrblStreamer(lambda name, *_: events.append(name))
    streamer.setup_logging()
    streamer.cnect(about[0])
    until(lambda: "on_boot" in events)
    streamer.poll_start()
    until(lambda: streamer.cmode == "Idle")
    for tile in tiles:
        streamer.send_immediately(f"G1 X{tile[0]} Y{tile[1]} F600")
        until(lambda tile=tile: streamer.cmode == "Idle" and abs(streamer.cmpos[0] - tile[0]) < 0.004
              and abs(streamer.cmpos[1] - tile[1]) < 0.004)  # fmt: skip
        found.append(streamer.cmpos[:2])
    streamer.poll_stop()
    streamer.disconnect()
elif what == "gcs":
    from pipython import GCSDevice, pitools
    from pipython.pidevice.interfaces.pisocket import PISocket

    with PISocket(host="127.0.0.1", port=int(about[0])) as gateway:
        device = GCSDevice(gateway=gateway)
        device.SVO(dict.fromkeys(device.axes, True))
        for tile in tiles:
            device.MOV(device.axes, tile)
            pitools.waitontarget(device, device.axes)
            found.append([device.qPOS()[axis] for axis in device.axes])
        device.SVO(dict.fromkeys(device.axes, False))
elif what == "zaber":
    from zaber_motion.ascii import Connection

    with Connection.open_tcp("127.0.0.1", int(about[0])) as connection:
        (device,) = connection.detect_devices(identify_devices=False)
        axes = [device.get_axis(number) for number in (1, 2)]
        steps, zero = float(about[1]), [float(place) for place in about[2:]]
        for tile in tiles:
            for axis, place, origin in zip(axes, tile, zero, strict=True):
                axis.move_absolute(round((place - origin) / steps), wait_until_idle=False)
            device.all_axes.wait_until_idle()
            found.append([axis.get_position() * steps + origin for axis, origin in zip(axes, zero, strict=True)])
print(json.dumps({"asked": tiles, "found": found}))
