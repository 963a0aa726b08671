"""Evaluation of an encoder that is read once per sample: its position, some samples late, and the velocity of those.

The velocity is the difference over some samples, through a first-order filter or not. Over one sample of period T a
count is a velocity resolution per T: the span and the filter trade this noise for delay, span T / 2 and the time
constant of the filter.
"""

from detent.kernel.registers import Registers, f8, f8_array, i8, real, register, u1
from detent.kernel.single import alike
from detent.kernel.step import step

MEMORY = 64  # samples kept; delay and span together are shorter


class EncoderWord(Registers):
    """What an encoder shows when it is latched."""

    count: i8 = register("count", unit="count")
    place: f8 = register("of an ideal encoder, which has no counts: position", unit="m")
    lost: u1 = register("1 where the word is none: its check failed, or nothing came")


class PositionSensorParams(Registers):
    """Graduation and evaluation."""

    period: real = register("time between two samples", unit="s", range=(1e-6, 0.1))
    resolution: f8 = register("travel per count; 0: the encoder is an ideal one", unit="m")
    delay: i8 = register("samples until a position is read", unit="count", range=(0, MEMORY - 1))
    span: i8 = register("number of samples of the velocity difference, 1 or more", unit="count", range=(1, MEMORY - 1))
    smoothing: real = register("part of a new velocity that is taken over at a sample; 1: no filter", unit="1")
    unused: u1 = register(
        "places of the memory that are not used: all but a power of two, more than delay and span together",
        unit="count", range=(0, MEMORY - 1), option=True,
    )  # fmt: skip


class PositionSensor(Registers):
    """What has been read."""

    zero: f8 = register("position of count 0", unit="m")
    position: f8 = register("position read", unit="m")
    velocity: real = register("velocity of the positions read", unit="m/s")
    place: i8 = register("place of the last sample in the memory", unit="count", range=(0, MEMORY - 1))
    memory: f8_array = register("last positions", unit="m", length=MEMORY)


@step
def position_of(p: PositionSensorParams, r: PositionSensor, word: EncoderWord) -> float:
    """Position that a word stands for [m]."""
    return r.zero + (word.place if p.resolution == 0.0 else word.count * p.resolution)


@step
def shift_positions(r: PositionSensor, way: float) -> None:
    """What was read, and will be, lies elsewhere; nothing has moved."""
    r.zero += way
    r.position += way
    for k in range(MEMORY):
        r.memory[k] += way


@step
def read_word(p: PositionSensorParams, r: PositionSensor, word: EncoderWord) -> None:
    """Sample: take the word of the encoder; one that is none leaves the position where it was."""
    mask = MEMORY - 1 - p.unused
    last, r.place = r.memory[r.place], (r.place + 1) & mask
    r.memory[r.place] = last if word.lost else position_of(p, r, word)
    r.position = r.memory[(r.place - p.delay) & mask]
    before = r.memory[(r.place - p.delay - p.span) & mask]
    r.velocity += p.smoothing * (alike(r.velocity, r.position - before) / (p.span * p.period) - r.velocity)


@step
def stand_sensor(p: PositionSensorParams, r: PositionSensor, word: EncoderWord) -> None:
    """As if the encoder had shown this word for long."""
    r.position = position_of(p, r, word)
    r.velocity = 0.0
    for k in range(MEMORY - p.unused):
        r.memory[k] = r.position
