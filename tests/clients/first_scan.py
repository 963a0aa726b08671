"""A first scan of a simulated stage: 21 points, and how far the read-back was from the set-point."""

import sys

from bluesky import RunEngine
from bluesky.plans import scan
from ophyd import EpicsMotor

motor = EpicsMotor(sys.argv[1], name="motor", settle_time=0.1)  # ophyd 1.11 loses a move that follows at once
motor.wait_for_connection(timeout=10)

events = []
engine = RunEngine()
engine.subscribe(lambda kind, document: events.append(document["data"]) if kind == "event" else None)
engine(scan([motor], motor, 30, 50, 21))

worst = max(abs(one["motor"] - one["motor_user_setpoint"]) for one in events)
print(f"{len(events)} events, the worst {worst:.4f} {motor.egu} from its set-point")
