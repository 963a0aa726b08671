"""Register files that are drawn: inside their ranges, borders and neighbours often, the same stream everywhere."""

from collections import Counter
from itertools import pairwise

import numpy as np
import pytest

from detent.export.drawn import arrays, rows_of
from detent.kernel.draws import LARGE, Draws, add_image, draw, draw_into, draw_real, draw_whole, misuse, nudge
from detent.kernel.image import FNV_BASIS, FNV_PRIME, WHOLE, begin_hash
from detent.kernel.loop import controls
from detent.kernel.registers import PLANT, Registers, f8, i2, i4_array, i8, register, u1, u4
from detent.kernel.step import step


class Wires(Registers):
    """Registers of several widths."""

    level: u1 = register("a level", range=(0, 1))
    code: u1 = register("any code", unit="code")
    signed: i2 = register("any number", unit="count")
    count: u4 = register("any number", unit="count")
    wide: i8 = register("any number", unit="count")
    angle: f8 = register("an angle", unit="rad", range=(-1.0, 1.0))
    many: i4_array = register("numbers", unit="count", length=LARGE + 1, range=(-7, 7))


class WireParams(Registers):
    """Parameters."""

    by: i8 = register("what is added", unit="count")


@controls(WireParams)
@step
def control(p: WireParams, c: Wires, lines: Wires) -> None:
    """A tick: follow the lines."""
    c.wide += p.by + lines.level
    lines.angle = 0.5


def drawn(r: Registers, number: int = 1, mask: int = 0) -> Registers:
    d = Draws(state=number)
    draw_into(d, r, *arrays([row for row, _ in rows_of(r, "c", {})]), mask)
    return r


def test_the_stream_is_that_of_knuth():
    d = Draws(state=1)
    states = [1]
    for _ in range(3):
        states.append((states[-1] * 6364136223846793005 + 1442695040888963407) & WHOLE)
    assert [draw(d) for _ in range(3)] == [one >> 32 for one in states[1:]]


@pytest.mark.parametrize(("lo", "hi"), [(0, 0), (-3, 9), (0, (1 << 32) - 1), (-(1 << 30), 1 << 30)])
def test_integers_are_inside_and_borders_come_often(lo, hi):
    d = Draws(state=7)
    found = [draw_whole(d, lo, hi, hi - lo + 1) for _ in range(600)]
    assert all(lo <= one <= hi for one in found)
    counts = Counter(found)
    assert counts[lo] >= 40
    assert counts[hi] >= 40
    near = sum(abs(a - b) <= 2 for a, b in pairwise(found))
    assert near >= 60


def test_floats_are_inside_and_hold_what_was_given():
    d = Draws(state=3)
    found = [draw_real(d, -2.0, 3.0, 0.125) for _ in range(600)]
    assert all(-2.0 <= one <= 3.0 for one in found)
    assert {-2.0, 3.0, 0.0, 1.0, 0.125} <= set(found)
    assert sum(0.0 < abs(one) < 0.1 for one in found) > 10
    assert all(draw_real(d, -8192.0, 8192.0, 0.0) * 4096 % 1 == 0 for _ in range(600))


def test_a_file_is_drawn_inside_its_ranges_and_the_same_again():
    r = drawn(Wires())
    assert bytes(drawn(Wires())) == bytes(r)
    seen = [drawn(Wires(), number) for number in range(200)]
    assert {one.level for one in seen} == {0, 1}
    assert all(-1.0 <= one.angle <= 1.0 and all(-7 <= x <= 7 for x in one.many) for one in seen)
    assert all(sum(x != 0 for x in one.many) <= 8 for one in seen)  # of a large array, a few elements each time
    assert all(abs(one.wide) <= 1 << 30 for one in seen)
    assert {0, (1 << 32) - 1} <= {one.count for one in seen}


def test_a_mask_leaves_most_registers_as_they_were():
    same = [sum((one.code == 77, one.signed == 77, one.count == 77)) for one in (
        drawn(Wires(code=77, signed=77, count=77), number, 7) for number in range(60)
    )]  # fmt: skip
    assert 130 < sum(same) < 180


def test_wires_are_nudged_by_two_at_most_and_stay_inside():
    r, d = Wires(signed=-3, count=0, wide=5, angle=0.25, level=1), Draws(state=5)
    rows = arrays([row for row, _ in rows_of(r, "l", {}) if row.length == 0])[0]
    seen = [(r.signed, r.count, r.wide)]
    for _ in range(300):
        nudge(d, r, rows)
        seen.append((r.signed, r.count, r.wide))
        assert (r.level in (0, 1), r.angle) == (True, 0.25)
    steps = {b - a for one, other in pairwise(seen) for a, b in zip(one, other, strict=True)}
    assert steps == {-2, -1, 0, 1, 2}
    assert min(one[0] for one in seen) < 0
    assert all(one[1] >= 0 for one in seen)


def test_an_image_is_hashed_as_fnv_1a():
    r, h = Wires(code=5, signed=-1), begin_hash()
    add_image(h, r, np.array([1, 2, 3], np.int64))
    wanted = FNV_BASIS
    for byte in bytes(r)[1:4]:
        wanted = (wanted ^ byte) * FNV_PRIME & WHOLE
    assert h.number == wanted


@pytest.mark.parametrize("calm", [0, 1])
def test_misuse_ticks_the_controller_and_moves_its_wires(calm):
    p, c, lines, h = WireParams(by=1), Wires(), Wires(), begin_hash()
    wires = arrays([row for row, _ in rows_of(lines, "l", {}) if row.path in ("level", "signed")])
    low = np.zeros(300, np.uint8)
    picks = np.arange(8, dtype=np.int64)
    misuse(Draws(state=9), p, c, lines, *wires, picks, picks, h, low, calm)
    assert 300 <= c.wide <= 600
    assert lines.angle == 0.5
    assert (abs(lines.signed) < 600) == (calm == 1) or calm == 0
    assert len(set(low.tolist())) > 20
    assert low[-1] == h.number & 0xFF


def test_the_writer_of_a_row_is_told():
    class Lines(Registers):
        """Wires."""

        sensor: i8 = register("a word", unit="count", by=PLANT)

    assert [by for _, by in rows_of(Lines(), "l", {})] == [PLANT]
