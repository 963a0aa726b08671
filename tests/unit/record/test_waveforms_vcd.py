import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.vcd_reader import load_vcd

import detent
from detent.errors import DetentError
from detent.record.waveforms import Waveform, Waveforms, clock_waveform, save_vcd

T = 250e-9
TICK = 250_000


def integers(name: str, bits: int, times: list[int], values: list[int], *, signed: bool = False) -> Waveform:
    return Waveform(name, bits, signed, False, "", "", np.array(times, dtype=np.int64), np.array(values))


def floats(name: str, times: list[int], values: list[float]) -> Waveform:
    return Waveform(name, 64, True, True, "A", "", np.array(times, dtype=np.int64), np.array(values, dtype=np.float64))


def make_waveforms() -> Waveforms:
    begin, end = 100 * TICK, 140 * TICK
    pulse = [begin, begin + 125_000, begin + 187_500, begin + 30 * TICK + 125_000, begin + 30 * TICK + 187_500]
    return Waveforms(
        begin,
        end,
        (
            clock_waveform("clocks.ck1", T, range(100, 140), high=(0.0, 0.25)),
            integers("tracker.reference", 11, [begin, begin + TICK, end - TICK], [2047, 0, 1024]),
            integers("tracker.pulses.plus", 1, pulse, [0, 1, 0, 1, 0]),
            integers("speed", 8, [begin, begin + TICK, begin + 2 * TICK], [-128, 127, -1], signed=True),
            integers("carriage.position", 64, [begin, begin + TICK], [-(2**63), 2**63 - 1], signed=True),
            floats(
                "motor.current", [begin, begin + TICK, begin + 2 * TICK, begin + 3 * TICK], [0.1, -2.5e-9, 0, 1e300]
            ),
            integers("gate", 1, [begin], [0]),
        ),
        "Carriage: of a slide",
    )


def assert_same(left: Waveform, right: Waveform) -> None:
    assert (left.name, left.bits, left.signed, left.is_float) == (right.name, right.bits, right.signed, right.is_float)
    np.testing.assert_array_equal(left.times, right.times)
    np.testing.assert_array_equal(left.values, right.values)


# -- there and back ---------------------------------------------------------------------------------------------------
def test_what_is_written_is_read_back(tmp_path):
    shown = make_waveforms()
    save_vcd(shown, tmp_path / "run.vcd")
    read = load_vcd(tmp_path / "run.vcd")
    assert (read.begin, read.end, read.title) == (shown.begin, shown.end, "Carriage_of_a_slide")
    assert {signal.name for signal in read.signals} == {signal.name for signal in shown.signals}
    for signal in shown.signals:
        assert_same(read[signal.name], signal)


@given(
    st.lists(
        st.tuples(
            st.booleans(),
            st.integers(2, 64),
            st.dictionaries(st.integers(1, 10**6), st.integers(-(2**63), 2**63 - 1), max_size=8),
            st.integers(-(2**63), 2**63 - 1),
        ),
        min_size=1,
        max_size=5,
    ),
    st.integers(0, 9 * 10**13),  # times steps, below 2**63
    st.sampled_from([1, 7, 10, 1000, 10**5]),
)
def test_any_words_are_read_back(tmp_path_factory, words, begin, step):
    signals: list[Waveform] = []
    for index, (signed, width, later, first) in enumerate(words):
        times = [begin * step, *((begin + moment) * step for moment in sorted(later))]
        raw = [first, *(later[moment] for moment in sorted(later))]
        # Wrapped to the width as a register does it, then without repetitions, as recorded waveforms are.
        bits = width if signed else min(width, 63)
        low = -(1 << (bits - 1)) if signed else 0
        wrapped = [low + (value - low) % (1 << bits) for value in raw]
        kept = [k for k in range(len(raw)) if k == 0 or wrapped[k] != wrapped[k - 1]]
        signals.append(
            integers(
                f"b{index % 2}.w{index}", bits, [times[k] for k in kept], [wrapped[k] for k in kept], signed=signed
            )
        )
    path = tmp_path_factory.mktemp("vcd") / "run.vcd"
    shown = Waveforms(begin * step, (begin + 10**6 + 1) * step, tuple(signals))
    save_vcd(shown, path)
    read = load_vcd(path)
    assert (read.begin, read.end, read.title) == (shown.begin, shown.end, "")
    for signal in signals:
        assert_same(read[signal.name], signal)


def test_a_float_keeps_16_digits_and_nan(tmp_path):
    values = [1 / 3, float("nan"), -2e-310, float("inf")]
    save_vcd(Waveforms(0, 9, (floats("a", [0, 1, 2, 3], values),)), tmp_path / "run.vcd")
    np.testing.assert_allclose(load_vcd(tmp_path / "run.vcd")["a"].values, values, rtol=1e-15)


def test_two_writes_give_the_same_bytes(tmp_path):
    for name in ("one.vcd", "two.vcd"):
        save_vcd(make_waveforms(), tmp_path / name)
    assert (tmp_path / "one.vcd").read_bytes() == (tmp_path / "two.vcd").read_bytes()
    assert b"$date" not in (tmp_path / "one.vcd").read_bytes()


# -- what viewers see -------------------------------------------------------------------------------------------------
def test_blocks_are_nested_scopes_and_kinds_are_those_that_viewers_understand(tmp_path):
    save_vcd(make_waveforms(), tmp_path / "run.vcd")
    header = (tmp_path / "run.vcd").read_text(encoding="ascii").partition("$enddefinitions")[0]
    # What identifies a variable in the body is pyvcd's own affair.
    lines = [re.sub(r"^(\$var \S+ \d+) \S+", r"\1", line).removesuffix(" $end") for line in header.splitlines()]
    assert lines == [
        "$timescale 100 ps",
        f"$version detent {detent.__version__}",
        "$scope module Carriage_of_a_slide",
        "$var integer 8 speed",
        "$var wire 1 gate",
        "$scope module carriage",
        "$var integer 64 position",
        "$upscope",
        "$scope module clocks",
        "$var wire 1 ck1",
        "$upscope",
        "$scope module motor",
        "$var real 64 current",
        "$upscope",
        "$scope module tracker",
        "$var reg 11 reference",
        "$scope module pulses",
        "$var wire 1 plus",
        "$upscope",
        "$upscope",
        "$upscope",
    ]


def test_the_body_is_the_changes_of_all_signals_in_order_of_time(tmp_path):
    words = integers("b", 8, [2000, 4000, 5000], [-1, 2, -128], signed=True)
    save_vcd(Waveforms(2000, 9000, (integers("a", 1, [2000, 5000], [0, 1]), words)), tmp_path / "run.vcd")
    body = (tmp_path / "run.vcd").read_text(encoding="ascii").partition("$enddefinitions $end\n")[2]
    assert body.split("\n") == [
        "#2", "$dumpvars", "0!", 'b11111111 "', "$end", "#4", 'b10 "', "#5", "1!", 'b10000000 "', "#9", "",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("unit", "timescale"),
    [
        (1, "1 ps"),
        (10, "10 ps"),
        (300, "100 ps"),
        (1000, "1 ns"),
        (250_000, "10 ns"),
        (10**6, "1 us"),
        (10**9, "100 us"),
    ],
)
def test_time_is_counted_in_the_coarsest_unit_that_hits_every_change(tmp_path, unit, timescale):
    shown = Waveforms(3 * unit, 11 * unit, (integers("a", 1, [3 * unit, 4 * unit], [0, 1]),))
    save_vcd(shown, tmp_path / "run.vcd")
    assert f"$timescale {timescale} $end" in (tmp_path / "run.vcd").read_text(encoding="ascii")
    read = load_vcd(tmp_path / "run.vcd")
    assert (read.begin, read.end, read["a"].times.tolist()) == (3 * unit, 11 * unit, [3 * unit, 4 * unit])


@pytest.mark.parametrize(
    ("title", "scope"),
    [("", "detent"), ("2nd axis", "_2nd_axis"), ("Größe 5 µm", "Gr_e_5_m"), ("***", "detent"), ("a.b [c]", "a_b_c")],
)
def test_the_outermost_scope_is_the_title_in_letters_that_viewers_take(tmp_path, title, scope):
    save_vcd(Waveforms(0, 5, (integers("a", 1, [0], [0]),), title), tmp_path / "run.vcd")
    assert f"$scope module {scope} $end" in (tmp_path / "run.vcd").read_text(encoding="ascii")


# -- writing that fails -----------------------------------------------------------------------------------------------
def test_nothing_to_write_is_said(tmp_path):
    with pytest.raises(DetentError, match="there are no signals"):
        save_vcd(Waveforms(0, 5, ()), tmp_path / "run.vcd")
    assert not list(tmp_path.iterdir())


def test_a_folder_that_is_not_there_is_said(tmp_path):
    with pytest.raises(DetentError, match="cannot be written"):
        save_vcd(make_waveforms(), tmp_path / "no" / "run.vcd")


def test_a_file_appears_whole_and_leaves_nothing_beside_it(tmp_path):
    for _ in range(2):
        save_vcd(make_waveforms(), tmp_path / "run.vcd")
    assert list(tmp_path.iterdir()) == [tmp_path / "run.vcd"]
    assert load_vcd(tmp_path / "run.vcd").signals
