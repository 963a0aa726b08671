"""A fault put on purpose between machine and wires: what then arrives of a word, in one of seven kinds.

A method says which of its words can be spoilt, and spoils them in a tick of its own that runs only while something is
injected; controller and machine know nothing of it. What comes at random comes from one seed, so that a session with
faults repeats itself.
"""

import math
from typing import NamedTuple

from detent.kernel.noise import NoiseSource, uniform
from detent.kernel.registers import Registers, block, f8, f8_array, i8, register, u1
from detent.kernel.step import step

OFF, STUCK, GARBAGE, WRONG, SLOW, DELAYED, INTERMITTENT = WORD_KINDS = tuple(range(1, 8))
BLOCKED, PUSH = 8, 9
KIND_NAMES = ("", "off", "stuck", "garbage", "wrong", "slow", "delayed", "intermittent", "blocked", "push")
TIMED = SLOW, DELAYED, INTERMITTENT  # their amount is a time
CHANNELS = 2  # words of a place at most
MEMORY = 256  # refreshes that a word can be delayed by, less one


class Place(NamedTuple):
    """Where a fault can be injected, and how much of it there is where nobody says."""

    number: int
    kinds: tuple[int, ...] = WORD_KINDS
    refresh: float = 1.0  # time between two values of its words [s]
    wrong: float = 0.0  # what a word is wrong by, in the unit below; 0 where it is turned round
    unit: str = ""  # of that
    scale: float = 1.0  # that over a count of the word
    time: float = 0.0  # of what is slow, delayed or intermittent [s]
    push: float = 0.0  # force, or torque
    push_unit: str = "N"


class Injection(Registers):
    """What is wrong at present, and what it remembers."""

    place: u1 = register("where; 0 nowhere", unit="code")
    kind: u1 = register("which of the kinds", unit="code")
    amount: f8 = register("what a word is wrong by, or a force", unit="count, N")
    every: i8 = register("refreshes: between two values, of a delay, or of what comes and goes", unit="count")
    since: i8 = register("refreshes since it began", unit="count")
    noise: NoiseSource = block("what garbage is made of")
    held: f8_array = register("value that is held", length=CHANNELS, unit="count")
    true: f8_array = register("value that the fault hides", length=CHANNELS, unit="count")
    ring: f8_array = register("values before, of a delay", length=CHANNELS * MEMORY, unit="count")


@step
def begin_injection(f: Injection, place: int, kind: int, amount: float) -> None:
    """Another fault takes the place of the present one; none where `place` is 0."""
    f.place, f.kind, f.amount, f.since = place, kind, amount, 0
    f.every = 1
    if kind in (SLOW, DELAYED, INTERMITTENT):
        f.every = max(1, round(min(amount, 1e9)))
    f.noise.state = 1


@step
def spoilt(f: Injection, k: int, value: float, settled: float, most: float) -> float:
    """What arrives of word `k`: `settled` is what it comes to where nothing moves, `most` its largest value.

    A word of levels, all of them high in `most`, is inverted where it is wrong; a number, `most` 0, is off by the
    amount. The caller counts `since` up before, once for all words.
    """
    n, kind = f.since - 1, f.kind
    if n == 0 or (kind == SLOW and n % f.every == 0):
        f.held[k] = settled
    f.ring[k * MEMORY + n % MEMORY] = value
    if kind in (STUCK, SLOW):
        return f.held[k]
    if kind == GARBAGE:
        noise = uniform(f.noise)
        return math.floor(noise * (most + 1.0)) if most > 0.0 else f.amount * (2.0 * noise - 1.0)
    if kind == WRONG:
        return most - value if most > 0.0 else value + f.amount
    if kind == DELAYED:
        return f.ring[k * MEMORY + (n - f.every) % MEMORY] if n >= f.every else f.held[k]
    if kind == OFF or (kind == INTERMITTENT and n // f.every % 2 == 0):
        return 0.0
    return value


@step
def spoilt_effort(f: Injection, k: int, value: float, largest: float) -> float:
    """What arrives of a command to an actuator: a wrong one is turned round, garbage is anything up to `largest`."""
    if f.kind == WRONG:
        return -value
    if f.kind == GARBAGE:
        return largest * (2.0 * uniform(f.noise) - 1.0)
    return spoilt(f, k, value, value, 0.0)
