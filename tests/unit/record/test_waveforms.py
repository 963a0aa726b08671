from dataclasses import FrozenInstanceError, replace
from typing import Any

import numpy as np
import pytest

from detent.errors import DetentError
from detent.kernel.registers import Registers, block, f8, i2, i4_array, register, u1, u2
from detent.record.waveforms import Phase, Waveform, Waveforms, clock_waveform, waveforms_from_rows

T = 250e-9


class Tracker(Registers):
    reference: u2 = register("reference counter", unit="count")
    msb: u1 = register("top bit")
    plus: u1 = register("+ pulse")
    switches: u1 = register("transistors that are on", unit="code")


class Motor(Registers):
    current: f8 = register("winding current", unit="A")
    speed: i2 = register("speed word", unit="count")
    history: i4_array = register("last words", length=4)


class Axis(Registers):
    tracker: Tracker = block("tracker")
    trackers: Tracker = block("another whose name begins alike")
    motor: Motor = block("motor")


LEAVES = {leaf.path: leaf for leaf in Axis.leaves()}


def make_rows(first_tick: int, **columns: list[Any]) -> np.ndarray:
    """Rows recorded after consecutive ticks; a column's name has __ for the dot."""
    paths = {name: name.replace("__", ".") for name in columns}
    length = len(next(iter(columns.values())))
    rows = np.zeros(
        length, dtype=[("tick", "<i8"), *((path, "<" + LEAVES[path].width.code) for path in paths.values())]
    )
    rows["tick"] = np.arange(first_tick, first_tick + length)
    for name, path in paths.items():
        rows[path] = columns[name]
    return rows


def one(column: str, values: list[Any], phase: Phase | None = None, *, first_tick: int = 1) -> Waveform:
    path = column.replace("__", ".")
    shown = waveforms_from_rows(
        make_rows(first_tick, **{column: values}), [LEAVES[path]], period=T, phases={path: phase} if phase else None
    )
    return shown[path]


def changes(signal: Waveform) -> list[tuple[int, Any]]:
    return list(zip(signal.times.tolist(), signal.values.tolist(), strict=True))


def flag(name: str, times: list[int], values: list[int]) -> Waveform:
    return Waveform(name, 1, False, False, "", "", np.array(times, dtype=np.int64), np.array(values, dtype=np.uint8))


# -- rows -------------------------------------------------------------------------------------------------------------
def test_a_row_describes_the_tick_before_its_number():
    shown = waveforms_from_rows(make_rows(11, tracker__msb=[0, 1, 1]), [LEAVES["tracker.msb"]], period=T)
    assert (shown.begin, shown.end) == (10 * 250_000, 13 * 250_000)
    assert changes(shown["tracker.msb"]) == [(2_500_000, 0), (2_750_000, 1)]


def test_only_changes_are_kept():
    assert changes(one("tracker__reference", [5, 5, 6, 6, 6, 5])) == [(0, 5), (500_000, 6), (1_250_000, 5)]


def test_a_register_changes_where_its_phase_says():
    assert changes(one("tracker__reference", [5, 6, 7], Phase(0.25))) == [(0, 5), (312_500, 6), (562_500, 7)]


def test_a_pulse_is_shown_in_its_part_of_the_tick_only():
    shown = one("tracker__plus", [0, 1, 0, 1], Phase(pulse=(0.5, 0.75)))
    assert changes(shown) == [(0, 0), (375_000, 1), (437_500, 0), (875_000, 1), (937_500, 0)]


def test_pulses_that_touch_become_one_and_the_fall_at_the_end_lies_outside():
    shown = one("tracker__plus", [0, 1, 1], Phase(pulse=(0.0, 1.0)))
    assert changes(shown) == [(0, 0), (250_000, 1)]


def test_a_pulse_from_the_beginning_of_the_first_tick_is_there_from_the_beginning():
    assert changes(one("tracker__plus", [1, 0], Phase(pulse=(0.0, 0.5)))) == [(0, 1), (125_000, 0)]


def test_a_word_shown_as_a_pulse_keeps_its_value():
    shown = one("motor__speed", [-7, 0], Phase(pulse=(0.5, 1.0)))
    assert changes(shown) == [(0, 0), (125_000, -7), (250_000, 0)]


def test_the_longest_prefix_decides_and_prefixes_end_at_dots():
    rows = make_rows(1, tracker__msb=[0, 1], tracker__plus=[0, 1], trackers__msb=[0, 1])
    shown = waveforms_from_rows(
        rows,
        [LEAVES[path] for path in ("tracker.msb", "tracker.plus", "trackers.msb")],
        period=T,
        phases={"tracker": Phase(0.25), "tracker.plus": Phase(0.5)},
    )
    assert [signal.times[1] for signal in shown.signals] == [312_500, 375_000, 250_000]


def test_widths_signs_units_and_descriptions_come_from_the_declaration():
    rows = make_rows(1, tracker__reference=[1, 0], motor__current=[0.5, -0.5], motor__speed=[-3, 3])
    shown = waveforms_from_rows(
        rows, [LEAVES[str(name)] for name in rows.dtype.names[1:]], period=T, title="carriage"
    )  # fmt: skip
    assert shown.title == "carriage"
    assert [(s.name, s.bits, s.signed, s.is_float, s.unit, s.doc, s.block) for s in shown.signals] == [
        ("tracker.reference", 16, False, False, "count", "reference counter", "tracker"),
        ("motor.current", 64, True, True, "A", "winding current", "motor"),
        ("motor.speed", 16, True, False, "count", "speed word", "motor"),
    ]


@pytest.mark.parametrize(
    ("column", "values", "bits"),
    [
        ("tracker__msb", [0, 1], 1),
        ("tracker__msb", [0, 0], 1),
        ("tracker__msb", [0, 2], 8),
        ("tracker__switches", [0, 1], 8),  # a code by its unit, whatever it holds
        ("tracker__reference", [0, 1], 16),
    ],
)
def test_a_byte_without_unit_that_holds_0_and_1_is_a_flag(column, values, bits):
    assert one(column, values).bits == bits


def test_a_float_that_is_no_number_changes_once():
    shown = one("motor__current", [0.5, np.nan, np.nan, 0.25])
    assert shown.times.tolist() == [0, 250_000, 750_000]
    np.testing.assert_array_equal(shown.values, [0.5, np.nan, 0.25])


@pytest.mark.parametrize(
    ("period", "tick", "picoseconds"),
    [
        (250e-9, 4 * 10**10, 10**16),  # after 10 000 s a float of the time itself is 1 ps off
        (40e-6, 10**9, 4 * 10**16),
        (1 / 3e6, 3 * 10**6, 10**12),  # no whole number of picoseconds: rounded, never summed
        (1 / 3e6, 3 * 10**6 + 1, 10**12 + 333_333),
    ],
)
def test_times_are_multiples_of_the_period_however_long_the_run(period, tick, picoseconds):
    rows = make_rows(tick + 1, tracker__msb=[0, 1])
    assert waveforms_from_rows(rows, [LEAVES["tracker.msb"]], period=period).begin == picoseconds


@pytest.mark.parametrize("period", [0.0, -1e-6, 1e-13, float("nan"), float("inf")])
def test_a_period_that_is_no_time_is_refused(period):
    with pytest.raises(DetentError, match="period of a tick is"):
        waveforms_from_rows(make_rows(1, tracker__msb=[0]), [LEAVES["tracker.msb"]], period=period)


def test_a_pulse_too_short_for_a_picosecond_is_refused():
    with pytest.raises(DetentError, match="shorter than 1 ps"):
        one("tracker__plus", [1], Phase(pulse=(0.5, 0.500001)))


# -- phases and clocks ------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"changes_at": 1.0}, "changes_at is 1.0"),
        ({"changes_at": -0.1}, "changes_at is -0.1"),
        ({"changes_at": float("nan")}, "changes_at is nan"),
        ({"pulse": (0.5, 0.5)}, "0 <= from < to <= 1"),
        ({"pulse": (-0.1, 0.5)}, "0 <= from < to <= 1"),
        ({"pulse": (0.5, 1.1)}, "0 <= from < to <= 1"),
        ({"changes_at": 0.25, "pulse": (0.5, 0.75)}, "give one"),
    ],
)
def test_phases_outside_the_tick_are_refused(arguments, message):
    with pytest.raises(DetentError, match=message):
        Phase(**arguments)


def test_two_phase_clocks_lie_in_the_same_ticks_as_the_rows():
    rows = make_rows(8, tracker__msb=[0, 1])
    shown = waveforms_from_rows(rows, [LEAVES["tracker.msb"]], period=T)
    ck1 = clock_waveform("clocks.ck1", T, range(7, 9), high=(0.0, 0.25), doc="counts")
    ck2 = clock_waveform("clocks.ck2", T, range(7, 9), high=(0.5, 0.75))
    assert changes(ck1) == [(1_750_000, 1), (1_812_500, 0), (2_000_000, 1), (2_062_500, 0)]
    assert changes(ck2) == [(1_750_000, 0), (1_875_000, 1), (1_937_500, 0), (2_125_000, 1), (2_187_500, 0)]
    assert (ck1.bits, ck1.doc, ck1.block) == (1, "counts", "clocks")
    assert replace(shown, signals=(ck1, ck2, *shown.signals))["clocks.ck2"] is ck2


# -- the whole --------------------------------------------------------------------------------------------------------
def test_an_unknown_signal_is_answered_with_those_there_are():
    with pytest.raises(DetentError, match=r"no signal 'c'; expected: a, b"):
        Waveforms(0, 5, (flag("a", [0], [0]), flag("b", [0], [0])))["c"]


def test_waveforms_are_not_changed_by_accident():
    with pytest.raises(FrozenInstanceError):
        Waveforms(0, 5, ()).begin = 1  # pyright: ignore[reportAttributeAccessIssue]


# -- windows ----------------------------------------------------------------------------------------------------------
SHOWN = Waveforms(0, 100, (flag("a", [0, 10, 40], [0, 1, 0]), flag("b", [0], [1])), "demo")


@pytest.mark.parametrize(
    ("begin", "end", "expected"),
    [
        (20, 50, [(20, 1), (40, 0)]),
        (10, 40, [(10, 1)]),
        (9, 41, [(9, 0), (10, 1), (40, 0)]),
        (90, 500, [(90, 0)]),
        (-5, 11, [(0, 0), (10, 1)]),
    ],
)
def test_a_window_begins_with_the_value_that_holds(begin, end, expected):
    cut = SHOWN.window(begin, end)
    assert changes(cut["a"]) == expected
    assert changes(cut["b"]) == [(max(begin, 0), 1)]
    assert (cut.begin, cut.end, cut.title) == (max(begin, 0), min(end, 100), "demo")
    assert changes(SHOWN["a"]) == [(0, 0), (10, 1), (40, 0)]


@pytest.mark.parametrize(("begin", "end"), [(100, 120), (-20, 0), (50, 50), (60, 40)])
def test_a_window_with_nothing_in_it_is_refused(begin, end):
    with pytest.raises(DetentError, match="expected: within 0 ps to 100 ps"):
        SHOWN.window(begin, end)
