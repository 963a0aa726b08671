"""ophyd's EpicsMotor, by pyepics or by caproto: connect, move, limit, stop; scans; the pulse of a null move; jogs."""

import faulthandler
import json
import os
import sys
import threading
import time

import ophyd

ophyd.set_cl(sys.argv[2])
from bluesky import RunEngine, plans  # noqa: E402 - the layer is chosen first
from ophyd import EpicsMotor, EpicsSignal, EpicsSignalRO  # noqa: E402

faulthandler.dump_traceback_later(45)
name, _, what = sys.argv[1:4]
# ophyd 1.11 puts the status of a move away after it has told its end; a move that another thread begins in between, on
# a busy machine, is put away with it, and never ends. Time to settle lies between them.
motor = EpicsMotor(name, name="motor", settle_time=0.1 if what == "scans" else 0.0)
begin = time.monotonic()
motor.wait_for_connection(timeout=10)
found = {"connected": time.monotonic() - begin}


def scan():
    """A scan of 21 points; set-point, read-back, and whether the axis was where it should be."""
    engine, events = RunEngine({}), []
    engine.subscribe(lambda kind, document: events.append(document["data"]) if kind == "event" else None)
    begin = time.monotonic()
    engine(plans.scan([motor], motor, 30, 50, 21))
    errors = [abs(one["motor"] - one["motor_user_setpoint"]) for one in events]
    return {"points": len(events), "worst": max(errors), "took": time.monotonic() - begin}


def rest():
    while not motor.motor_done_move.get():
        time.sleep(0.01)
    time.sleep(0.2)


if what == "moves":
    found |= {"limits": motor.limits, "unit": motor.egu, "speed": motor.velocity.get()}
    status = motor.move(60.0, timeout=20)
    found |= {"position": motor.position, "success": status.success}
    try:
        motor.move(900.0)
    except ophyd.utils.LimitError as error:
        found["limit"] = type(error).__name__
    found["after_limit"] = motor.user_setpoint.get()
    begin = time.monotonic()
    motor.move(60.0, timeout=20)
    found["null"] = time.monotonic() - begin
    motor.user_setpoint.put(400.0, wait=False)
    time.sleep(0.3)
    found["moving"] = motor.moving
    motor.motor_stop.put(1)
    rest()
    found |= {"stopped": motor.position, "stop": motor.motor_stop.get(), "set_point": motor.user_setpoint.get()}
    motor.move(20.0, timeout=20)
    found["again"] = motor.position
elif what == "scans":
    found["first"] = scan()
    motor.motor_stop.put(1)  # when it stands: the next scan begins at once
    found["second"] = scan()
    motor.user_setpoint.put(300.0, wait=False)
    time.sleep(0.2)
    motor.motor_stop.put(1)
    rest()
    found["third"] = scan()
elif what == "pulse":
    seen, done = [], threading.Event()
    motor.motor_done_move.subscribe(lambda value, **_: seen.append(int(value)), run=False)
    motor.user_setpoint.put(motor.user_setpoint.get(), callback=lambda **_: (seen.append("complete"), done.set()))
    done.wait(10)
    time.sleep(0.1)
    found["seen"] = seen
elif what == "refused":
    from caproto.sync.client import ErrorResponseReceived, write  # which tells how a put ended

    try:
        write(name, 60.0, notify=True, timeout=5)
    except ErrorResponseReceived as error:
        found["put"] = type(error).__name__
    motor.user_setpoint.put(60.0, wait=False)
    time.sleep(0.5)
    found["set_point"] = motor.user_setpoint.get()
    # Read, not monitored: the first event of a monitor once held the first letter alone.
    selector = EpicsSignalRO(f"{name}:selector", string=True, auto_monitor=False)
    selector.wait_for_connection(timeout=10)
    found["selector"] = selector.get()
    motor.motor_stop.put(1, wait=True)
elif what == "jog":
    forward = EpicsSignal(f"{name}.JOGF")
    speed = EpicsSignal(f"{name}.JVEL")
    moving = EpicsSignalRO(f"{name}.MOVN")
    for one in (forward, speed, moving):
        one.wait_for_connection(timeout=10)
    speed.put(40.0, wait=True)
    begin, start = time.monotonic(), motor.position
    forward.put(1, wait=True)
    while moving.get() and time.monotonic() - begin < 5:
        time.sleep(0.01)
    found["once"] = time.monotonic() - begin
    time.sleep(0.3)
    found["once_way"] = motor.position - start
    begin, start = time.monotonic(), motor.position
    while time.monotonic() - begin < 1.5:
        forward.put(1, wait=True)
        time.sleep(0.05)
    found |= {"kept_moving": moving.get(), "kept_way": motor.position - start}
    forward.put(0, wait=True)
    rest()
    found["stopped"] = motor.position - start
print(json.dumps(found), flush=True)
os._exit(0)  # pyepics now and then crashes while Python shuts down (its issue 228)
