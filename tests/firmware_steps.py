"""Steps that firmware can be made of, and some that it cannot, each for one reason."""

import math
from typing import Any

from detent.kernel.loop import f8_signal
from detent.kernel.registers import Registers, block, f8, i1, i2, i8, i8_array, register, u1, u2
from detent.kernel.step import bounded

PLACES = 8
WEIGHTS = (3, -1, 4)
NEXT = (1, 2, 0, -5)
LAST, STRIDE, UNUSED = 255, 1, 1000
UNKNOWN: Any = object()


class Limits(Registers):
    """Parameters."""

    form: u1 = register("variant", unit="code", option=True)
    shift: u1 = register("bits", unit="bit", range=(0, 12))
    wide: i8 = register("any number", unit="count")
    gain: f8 = register("factor")


class Inner(Registers):
    """A block."""

    small: i1 = register("wraps", unit="count")
    word: u2 = register("wraps", unit="count")


class State(Registers):
    """Registers."""

    count: i8 = register("any number", unit="count")
    other: i8 = register("any number", unit="count")
    place: i8 = register("index", unit="count", range=(0, PLACES - 1))
    angle: f8 = register("any number", unit="rad")
    half: i2 = register("wraps", unit="count")
    inner: Inner = block("a block")
    memory: i8_array = register("values", unit="count", length=PLACES)


# ---- inside of the language


def arithmetic(p: Limits, r: State, a: int, b: int) -> None:
    """Every operator of integers."""
    r.count = a // b + a % b - (a >> 3) * (b & 0xFF) ^ (a | b)
    r.other = -a + (b << p.shift) + min(a, b, 7) - max(a, b) + abs(a - b)
    r.inner.small = r.half = a + b
    r.inner.word += a


def conditions(p: Limits, r: State, a: int, b: int) -> int:
    """Branches, chains, membership, truth values as numbers."""
    s = r.inner
    if 0 <= a < 10 and not (b in (1, 2, 5) or a == b):
        r.count += 1
    elif a < 0 or p.form:
        r.count -= (a > b) + (a >= b)
    else:
        s.word = 1 if a != b else 2
    return r.count if s.word else -b


def floats(p: Limits, r: State, a: int, b: int) -> float:
    """Float arithmetic, floor, truncation, square root."""
    x = a / 7.0 + p.gain * r.angle
    r.angle = min(max(x, -1e6), 1e6) - abs(x) / 3.0 + math.sqrt(1.0 * b * b)
    r.count = math.floor(x) + int(r.angle) + a
    r.other = round(x) + round(b / 2.0) + a
    return -x if a > b else float(b)


def loops(p: Limits, r: State, a: int, b: int) -> None:
    """Counted loops, a tuple of numbers, a loop with a bound, an index that a condition proves."""
    for k in range(PLACES):
        r.memory[k] += a - k
    for weight in WEIGHTS:
        r.count += weight * b
    halve(r)
    r.place = (r.place + 1) % PLACES
    r.memory[r.place] = r.count >> p.shift
    if 0 <= a < PLACES:
        r.other += r.memory[a] + NEXT[a & 3]


@bounded(64, "halves 64 bits")
def halve(r: State) -> None:
    """Down to nothing."""
    while r.count > 0:
        r.count //= 2


def effects(p: Limits, r: State, a: int, b: int) -> None:
    """Values from left to right around a call that writes; swaps; one value for two registers."""
    r.count = r.other + bump(r, a) + r.other * 2
    r.count, r.other = r.other, r.count
    r.half = r.inner.small = bump(r, b) + p.form


def bump(r: State, by: int) -> int:
    """Writes, and gives something."""
    r.other += by
    return r.other & 15


def always(r: State) -> int:
    """Writes, and always gives 1."""
    r.other += 1
    return 1


def kept_calls(p: Limits, r: State, a: int, b: int) -> None:
    """A call whose result is known is still made."""
    if always(r) and a > b:
        r.count = p.shift
    r.count += always(r) * 0


def signs(p: Limits, r: State, _a: int, _b: int) -> None:
    """Registers with a sign beside some without."""
    if p.form in (LAST, STRIDE):
        r.count = r.half * p.form
    elif r.inner.word > p.form:
        r.angle = r.half + STRIDE
    if p.form > 255:
        r.count = UNUSED
    r.inner.word = r.half & 7
    r.other = p.form >> p.shift


def lower_bits(p: Limits, r: State, a: int, b: int) -> None:
    """Registers that keep no more than the lower bits of what is worked out, of operands with a sign and without."""
    s = r.inner
    r.half = a * b - (r.count + 3) * -b
    s.word = s.word * 3 + (r.other - a)
    s.small = (a | b) + r.count
    r.other = (s.word | 5) + (s.word ^ a) - (r.count & 0x7FFF)
    if (s.word & 4 | s.word ^ 1) != 0 and r.count & p.form == 0:
        s.word = -(s.word & 0xFF0)
    r.memory[(r.count + a) & 7] = s.word & 3


ACCEPTED = (arithmetic, conditions, floats, loops, effects, kept_calls, signs, lower_bits)


def folded(p: Limits, r: State) -> None:
    """One of two, by an option."""
    if p.form:
        r.count = 1
    else:
        bump(r, 1)


def along(r: State, values: f8_signal) -> None:
    """A signal, read inside its length."""
    if 0 <= r.count < len(values):
        r.angle = values[r.count]


# ---- outside


def tuple_result(r: State) -> tuple[int, int]:
    return r.count, r.other


def keyword(r: State) -> None:
    bump(r, by=1)


def a_list(r: State) -> None:
    r.count = [1, 2][0]


def generator(r: State) -> None:
    r.count = sum(k for k in range(3))


def attempt(r: State) -> None:
    try:
        r.count = 1
    finally:
        r.count = 2


def text(r: State) -> None:
    r.count = len(f"{r.count}")


def string(r: State) -> None:
    r.count = "a"


def recursion(r: State) -> None:
    recursion(r)


@bounded(1, "never")
def loop_else(r: State) -> None:
    while r.count > 0:
        r.count -= 1
        if r.other:
            break
    else:
        r.count = 7


def unbounded(r: State) -> None:
    while r.count > 0:
        r.count -= 1


def effect_in_or(r: State) -> None:
    if r.other > 3 or r.other + bump(r, 1) > r.other:
        r.count = 1


def effect_in_choice(r: State) -> None:
    r.count = bump(r, 1) if r.other else 0


def float_in_integer(r: State) -> None:
    r.count = r.angle


def float_modulo(r: State) -> None:
    r.angle = r.angle % 2.0


def power(r: State) -> None:
    r.count = r.count**2


def invert(r: State) -> None:
    r.count = ~r.count


def identity(r: State) -> None:
    r.count = 1 if r is None else 0


def no_step(r: State) -> None:
    r.count = hash(r.count)


def of_an_object(r: State) -> None:
    r.count = UNKNOWN


def library(r: State) -> None:
    r.angle = math.sin(r.angle)


def wild_index(r: State) -> None:
    r.count = r.memory[r.other]


def index_after_a_call(r: State) -> None:
    if 0 <= r.other < PLACES:
        bump(r, 1)
        r.count = r.memory[r.other]


def index_in_a_loop(r: State) -> None:
    if 0 <= r.other < PLACES:
        for _ in range(3):
            r.count = r.memory[r.other]
            r.other += 1


def index_by_an_alias(r: State) -> None:
    s = r
    if 0 <= r.other < PLACES:
        s.other = r.count
        r.count = r.memory[r.other]


def wild_shift(p: Limits, r: State) -> None:
    r.count = r.count << p.wide


def shift_back(p: Limits, r: State) -> None:
    r.count = r.count >> (p.shift - 1)


def signal_end(r: State, values: f8_signal) -> None:
    if 0 <= r.count <= len(values):
        r.angle = values[r.count]


def default(r: State, by: int = 1) -> None:
    r.count = by


def star(*r: State) -> None:
    r[0].count = 1


def annotation(r: State, by: str) -> None:
    r.count = by


def deleted(r: State) -> None:
    del r


def nested(r: State) -> None:
    def inner() -> None:
        r.count = 1

    inner()


def to_a_parameter(p: Limits) -> None:
    p.wide = 1


def uneven(r: State) -> None:
    a, b = r.count, r.other
    r.count, r.other = pair = a, b
    del pair


def stepped(r: State) -> None:
    for k in range(0, 8, 2):
        r.count = k


REFUSED = {
    tuple_result: "FW02", keyword: "FW02", a_list: "FW02", generator: "FW03", attempt: "FW02", text: "FW02",
    string: "FW02", recursion: "FW06", loop_else: "FW02", unbounded: "FW07", effect_in_or: "FW10",
    effect_in_choice: "FW10", float_in_integer: "FW02", float_modulo: "FW02", power: "FW02", invert: "FW02",
    identity: "FW02", no_step: "FW03", of_an_object: "FW02", library: "FW04", wild_index: "FW09",
    index_after_a_call: "FW09", index_in_a_loop: "FW09", index_by_an_alias: "FW09", wild_shift: "FW08",
    shift_back: "FW08", signal_end: "FW09", default: "FW02", star: "FW02", annotation: "FW02", deleted: "FW02",
    nested: "FW02", to_a_parameter: "FW02", uneven: "FW02", stepped: "FW02",
}  # fmt: skip
STEPS = (halve, bump, always)
