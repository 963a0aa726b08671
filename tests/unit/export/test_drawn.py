"""Random vectors of a small unit: what is in the file, and what the C draws."""

import struct

import pytest
from tests import firmware_steps
from tests.firmware_steps import Limits, State

from detent.export.code import drawn_text
from detent.export.drawn import (
    END,
    FUNCTION,
    MISUSE,
    STRETCH,
    TICKS,
    WIDE,
    Chance,
    drawn_from,
    drawn_vectors,
    rows_of,
)
from detent.export.unit import ControlUnit
from detent.kernel.image import add_bytes, begin_hash
from detent.kernel.loop import controls
from detent.kernel.registers import PLANT, Registers, i2, register
from detent.kernel.step import step
from detent.translate.values import Shape


class Wires(Registers):
    """Wires between controller and plant."""

    count: i2 = register("what the plant says", unit="count", by=PLANT)
    out: i2 = register("what the controller says", unit="count")


@step
def put_on(r: State, lines: Wires, at: int) -> None:
    """Begin somewhere."""
    r.count = at
    lines.out = 1


@controls(Limits)
@step
def control(p: Limits, r: State, lines: Wires) -> None:
    """Follow the wires."""
    r.count += 1 if lines.count > r.other else -1
    r.inner.small = measured(p, r, p.gain)
    lines.out = r.count


@step
def measured(p: Limits, r: State, gain: float) -> int:
    """A number."""
    r.angle = 0.5 * r.angle + gain
    return r.count % 5 if p.form else 0


@pytest.fixture
def chance():
    entries = {"t_control": control, "t_put_on": put_on}
    unit = ControlUnit("t", Limits, State, Wires, entries)
    params = Limits(form=1, shift=3, wide=5, gain=0.25)
    return Chance(unit, unit.translated(params), params)


def records(data: bytes):
    k = 9
    while data[k] != END:
        if data[k] == FUNCTION:
            yield FUNCTION, struct.unpack_from("<HI", data, k + 1)
            k += 7
        elif data[k] == MISUSE:
            yield MISUSE, struct.unpack_from("<I", data, k + 1)
            k += 5
        else:
            assert data[k] == STRETCH
            (n,) = struct.unpack_from("<H", data, k + 1)
            yield STRETCH, (n, data[k + 2 + n], struct.unpack_from("<Q", data, k + 3 + n)[0])
            k += 11 + n
    assert k == len(data) - 9


def test_the_file_holds_every_function_and_the_misuse(chance):
    data = drawn_vectors(chance, 130, 500)
    assert data[:5] == b"DTNR\1"
    found = list(records(data))
    assert [content for kind, content in found if kind == FUNCTION] == [(k, 130) for k in range(3)]
    assert [content for kind, content in found if kind == MISUSE] == [(500,)]
    stretches = [content for kind, content in found if kind == STRETCH]
    assert [n for n, _, _ in stretches] == [100, 30] * 3 + [TICKS, TICKS, 500 - 2 * TICKS]
    over_all = begin_hash()
    add_bytes(over_all, data[:-8])
    assert struct.unpack("<Q", data[-8:])[0] == over_all.number
    assert drawn_vectors(chance, 130, 500) == data
    assert list(records(drawn_vectors(chance, 0, 0))) == []


def test_other_parameters_give_other_vectors(chance):
    other = Limits(form=1, shift=3, wide=6, gain=0.5)
    unit = chance.unit
    assert drawn_vectors(Chance(unit, unit.translated(other), other), 5, 200) != drawn_vectors(chance, 5, 200)


def test_a_moment_is_found_again(chance):
    hashes = list(chance.calls(1, 7))
    after = [bytes(chance.files[root]) for root in "pcl"]
    chance.run(1, 7)
    assert [bytes(chance.files[root]) for root in "pcl"] == after
    assert chance.h.number == hashes[-1]
    row = next(one for one in chance.rows["c"] if one.path == "count")
    assert chance.bits(row, 0) == chance.files["c"].count % (1 << 64)
    chance.run(3, 250)
    assert chance.h.number == [value for _, value in chance.ticks(250)][-1]


def test_a_folded_option_is_not_drawn_and_stays_what_it_is(chance):
    assert "form" not in [row.path for row in chance.rows["p"]]
    for _ in chance.calls(0, 20):
        assert chance.files["p"].form == 1
    assert [row.path for row in chance.wires] == ["count"]


def test_integers_of_64_bits_stay_where_nothing_overflows():
    assert drawn_from(-(1 << 63), (1 << 63) - 1) == (-WIDE, WIDE)
    assert drawn_from(0, 255) == (0, 255)
    rows = {row.path: row for row, _ in rows_of(State(), "c", {}, Shape())}
    assert (rows["count"].lo, rows["count"].hi) == (-WIDE, WIDE)
    assert (rows["place"].lo, rows["place"].hi) == (0, firmware_steps.PLACES - 1)
    assert rows["memory"].length == firmware_steps.PLACES


def test_the_program_in_c_calls_every_function_and_draws_every_register(chance):
    text = drawn_text(chance)
    for f in chance.program.order:
        assert f"{f.cname}(a0" in text
    for row in chance.rows["c"]:
        assert f"&c_.{row.path}" in text
    assert "control(&p_, &c_, &l_);" in text
    assert "draw_whole((-1073741824), 1073741824, INT64_C(2147483649))" in text.replace("-INT64_C(", "-(")
