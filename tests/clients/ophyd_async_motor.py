"""ophyd-async's Motor, over ca:// or pva://: a scan, a set with a timeout, a limit; and times of a read."""

import asyncio
import json
import sys
import time

from bluesky import RunEngine, plans
from ophyd_async.core import init_devices
from ophyd_async.epics.motor import Motor, MotorLimitsError

engine, found, events = RunEngine({}), {}, []
begin = time.monotonic()
with init_devices():
    motor = Motor(sys.argv[1], name="motor")
found["connected"] = time.monotonic() - begin
engine.subscribe(lambda kind, document: events.append(document["data"]) if kind == "event" else None)


def in_loop(work):
    return asyncio.run_coroutine_threadsafe(work, engine.loop).result(30)


async def moves():
    await motor.set(45.0, timeout=20)
    found["position"] = await motor.user_readback.get_value()
    found["unit"] = await motor.motor_egu.get_value()
    try:
        await motor.set(900.0)
    except MotorLimitsError as error:
        found["limit"] = type(error).__name__
    try:
        await motor.set(400.0, timeout=0.1)
    except TimeoutError as error:
        found["timeout"] = type(error).__name__
    await motor.stop(success=True)
    await asyncio.sleep(0.5)
    found["stopped"] = await motor.user_readback.get_value()
    found["round_trips"] = []  # [s]
    for _ in range(200):
        begin = time.perf_counter()
        await motor.user_readback.get_value()
        found["round_trips"].append(time.perf_counter() - begin)


in_loop(moves())
begin = time.monotonic()
engine(plans.scan([motor], motor, 30, 50, 21))
found |= {"points": len(events), "took": time.monotonic() - begin}
targets = [30 + k for k in range(21)]
found["worst"] = max(abs(one["motor"] - target) for one, target in zip(events, targets, strict=True))
print(json.dumps(found))
