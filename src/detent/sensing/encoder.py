"""Incremental encoder: two square waves, 90 degrees apart, with graduation jitter and missing pulses on request."""

import math

from detent.kernel.noise import NoiseSource, bell, uniform
from detent.kernel.registers import Registers, block, f8, i8, register, u1
from detent.kernel.step import hot_step

JITTER_LIMIT = 0.45
"""An edge never leaves its own quarter cycle, so edges cannot overtake one another."""


class EncoderParams(Registers):
    """Graduation and its faults."""

    edge_pitch: f8 = register("carriage travel per quadrature edge", unit="m")
    origin: f8 = register("carriage position of edge 0", unit="m")
    jitter: f8 = register("rms displacement of an edge, in quarter cycles")
    missing: f8 = register("probability that a pulse of channel A is missing")


class Encoder(Registers):
    """Where the disc stands between its edges."""

    edge: i8 = register("index of the last edge passed, from the left frame", unit="count")
    above: f8 = register("displacement of the next edge to the right, in quarter cycles")
    below: f8 = register("displacement of the next edge to the left, in quarter cycles")
    next_right: f8 = register("carriage position of the next edge to the right", unit="m")
    next_left: f8 = register("carriage position of the next edge to the left", unit="m")
    masked: u1 = register("1 while the present pulse of channel A is missing")
    channel_a: u1 = register("channel A level")
    channel_b: u1 = register("channel B level")
    noise: NoiseSource = block("jitter and missing pulses")


@hot_step
def place_right(p: EncoderParams, r: Encoder) -> None:
    """Position of the next edge to the right."""
    r.next_right = (r.edge + 1 + r.above) * p.edge_pitch + p.origin


@hot_step
def place_left(p: EncoderParams, r: Encoder) -> None:
    """Position of the next edge to the left."""
    r.next_left = (r.edge + r.below) * p.edge_pitch + p.origin


@hot_step
def set_channels(p: EncoderParams, r: Encoder) -> None:
    """Levels after an edge: A is high in quarters 0 and 1, B in quarters 1 and 2, so A leads moving right."""
    a = 1 - (r.edge >> 1 & 1)
    if p.missing > 0.0:
        if a == 0:
            r.masked = 0
        elif r.channel_a == 0 and r.masked == 0:
            r.masked = 1 if uniform(r.noise) < p.missing else 0
        a -= r.masked
    r.channel_a = a
    r.channel_b = r.edge + 1 >> 1 & 1


@hot_step
def fresh_jitter(p: EncoderParams, r: Encoder) -> float:
    """Displacement of an edge that comes into reach."""
    if p.jitter <= 0.0:
        return 0.0
    return min(max(p.jitter * bell(r.noise), -JITTER_LIMIT), JITTER_LIMIT)


@hot_step
def pass_right(p: EncoderParams, r: Encoder) -> None:
    """The carriage has passed the next edge to the right."""
    r.edge += 1
    r.below = r.above
    r.next_left = r.next_right
    r.above = fresh_jitter(p, r)
    place_right(p, r)
    set_channels(p, r)


@hot_step
def pass_left(p: EncoderParams, r: Encoder) -> None:
    """The carriage has passed the next edge to the left."""
    r.edge -= 1
    r.above = r.below
    r.next_right = r.next_left
    r.below = fresh_jitter(p, r)
    place_left(p, r)
    set_channels(p, r)


@hot_step
def follow(p: EncoderParams, r: Encoder, x: float) -> None:
    """The disc goes where the carriage is, `x` [m], past all edges on its way."""
    while x >= r.next_right:
        pass_right(p, r)
    while x < r.next_left:
        pass_left(p, r)


@hot_step
def is_one_edge(p: EncoderParams, r: Encoder, x: float) -> bool:
    """True when certainly no more than one edge, whatever its jitter, lies between the disc's place and `x` [m]."""
    place = x - p.origin
    return (r.edge - 1 + JITTER_LIMIT) * p.edge_pitch < place < (r.edge + 2 - JITTER_LIMIT) * p.edge_pitch


def stand_at(p: EncoderParams, r: Encoder, position: float, seed: int) -> None:
    """Power-on: the disc stands where the carriage stands; `position` in metres."""
    r.noise.state = seed
    r.edge = math.floor((position - p.origin) / p.edge_pitch)
    r.above = r.below = 0.0
    place_right(p, r)
    place_left(p, r)
    set_channels(p, r)
    follow(p, r, position)  # rounding may have put it beside its edge
