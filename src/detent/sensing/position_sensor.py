"""Encoder read once per sample: position on its counts, some samples late, and the velocity of their differences.

The velocity is the difference over some samples, through a first-order filter or not. Over one sample of period T a
count is a velocity of one count per T: the span and the filter trade this noise for delay, span T / 2 and the time
constant of the filter.
"""

import math

from detent.kernel.registers import Registers, f8, f8_array, i8, register
from detent.kernel.step import step

MEMORY = 64
"""Samples kept; delay and span together are shorter."""


class PositionSensorParams(Registers):
    """Graduation and evaluation."""

    period: f8 = register("time between two samples", unit="s")
    resolution: f8 = register("travel per count, which is read at the nearest; 0: the position itself", unit="m")
    delay: i8 = register("samples until a position is read", unit="count")
    span: i8 = register("samples that the velocity is a difference over, 1 or more", unit="count")
    smoothing: f8 = register("part of a new velocity that is taken over at a sample; 1: no filter", unit="1")


class PositionSensor(Registers):
    """What has been read."""

    count: i8 = register("count at the last sample, before the delay", unit="count")
    position: f8 = register("position read", unit="m")
    velocity: f8 = register("velocity of the positions read", unit="m/s")
    place: i8 = register("place of the last sample in the memory", unit="count")
    memory: f8_array = register("last positions", unit="m", length=MEMORY)


@step
def on_counts(p: PositionSensorParams, r: PositionSensor, position: float) -> float:
    """`position` [m] as the counts show it."""
    if p.resolution == 0.0:
        return position
    r.count = math.floor(position / p.resolution + 0.5)
    return r.count * p.resolution


@step
def read_position(p: PositionSensorParams, r: PositionSensor, position: float) -> None:
    """Sample with the scale at `position` [m]."""
    r.place = (r.place + 1) % MEMORY
    r.memory[r.place] = on_counts(p, r, position)
    r.position = r.memory[(r.place - p.delay) % MEMORY]
    before = r.memory[(r.place - p.delay - p.span) % MEMORY]
    r.velocity += p.smoothing * ((r.position - before) / (p.span * p.period) - r.velocity)


def stand_sensor(p: PositionSensorParams, r: PositionSensor, position: float) -> None:
    """As if the scale had stood at `position` [m] for long."""
    r.position = on_counts(p, r, position)
    r.velocity = 0.0
    r.memory[:] = [r.position] * MEMORY
