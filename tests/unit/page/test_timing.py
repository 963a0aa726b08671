import re
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from detent.errors import DetentError
from detent.page import timing
from detent.page.timing import plot_timing
from detent.record.waveforms import Waveform, Waveforms, clock_waveform

TICK = 250_000
BEGIN, END = 85_992 * TICK, 86_032 * TICK


def words(name: str, values: list[int], *, every: int = 1, bits: int = 16, doc: str = "", unit: str = "") -> Waveform:
    times = BEGIN + every * TICK * np.arange(len(values), dtype=np.int64)
    return Waveform(name, bits, min(values) < 0, False, unit, doc, times, np.array(values))


def floats(name: str, values: list[float], unit: str = "A") -> Waveform:
    times = BEGIN + TICK * np.arange(len(values), dtype=np.int64)
    return Waveform(name, 64, True, True, unit, "", times, np.array(values, dtype=np.float64))


@pytest.fixture
def shown() -> Waveforms:
    ticks = range(85_992, 86_032)
    return Waveforms(
        BEGIN,
        END,
        (
            clock_waveform("clocks.ck1", 250e-9, ticks, high=(0.0, 0.25), doc="first clock: counts"),
            clock_waveform("clocks.ck2", 250e-9, ticks, high=(0.5, 0.75)),
            words("tracker.reference", [k % 16 for k in range(40)], unit="count"),
            words("tracker.msb", [k % 2 for k in range(5)], every=8, bits=1, doc="top bit"),
            words("speed", [-3, -1], every=20),
            floats("motor.current", [0.25, 0.5, -0.125, 0.0]),
            words("tracker.plus", [0, 1, 0], every=10, bits=1),
        ),
        "Carriage of a slide",
    )


def texts(path: Path) -> list[str]:
    return [
        re.sub(r"<[^>]+>", "", text).strip()
        for text in re.findall(r"<text.*?</text>", path.read_text(encoding="utf-8"), flags=re.DOTALL)
    ]


def drawn(waveforms: Waveforms, tmp_path: Path, **options) -> list[str]:
    plot_timing(waveforms, tmp_path / "a.svg", **options)
    return texts(tmp_path / "a.svg")


def png_size(path: Path) -> tuple[int, int]:
    head = path.read_bytes()[:24]
    return int.from_bytes(head[16:20], "big"), int.from_bytes(head[20:24], "big")


# -- what stands in the diagram ---------------------------------------------------------------------------------------
def test_names_headings_units_descriptions_and_values_are_there(shown, tmp_path):
    found = drawn(shown, tmp_path)
    for text in ("ck1", "ck2", "reference", "msb", "plus", "speed", "current [A]"):
        assert found.count(text) == 1, text
    for text in ("clocks", "tracker", "motor", "first clock: counts", "top bit", "Carriage of a slide"):
        assert found.count(text) == 1, text
    assert found.count("15") == 2  # every value of the counter that fits
    assert found.count("−3") == found.count("−1") == 1
    assert "0.5" in found
    assert "−0.125" in found


def test_signals_of_a_block_stand_together_in_the_order_of_the_blocks(shown):
    rows, headings, depth = timing._arrange(shown.signals)
    assert [row.signal.name for row in rows] == [
        "clocks.ck1", "clocks.ck2", "tracker.reference", "tracker.msb", "tracker.plus", "speed", "motor.current",
    ]  # fmt: skip
    assert [text for text, _, _ in headings] == ["clocks", "tracker", "motor"]
    places = sorted([(row.high, row.low) for row in rows], reverse=True)
    assert all(low > next_high for (_, low), (next_high, _) in pairwise(places))
    assert places[-1][1] > -depth
    by_name = {row.signal.name: row for row in rows}
    assert headings[1][1] > by_name["tracker.reference"].high
    assert by_name["clocks.ck1"].colour == by_name["clocks.ck2"].colour != by_name["tracker.msb"].colour


@pytest.mark.parametrize(
    ("begin", "end", "label", "last"),
    [
        (BEGIN, END, "t = 21.498 ms + … [µs]", "10"),
        (0, 400_000, "t, time since power-on [ns]", "400"),
        (1_500, 3_000_000_000 + 1_500, "t = 1.5 ns + … [ms]", "3.0"),
        (2 * 10**12, 2 * 10**12 + 1_000, "t = 2 s + … [ps]", "1000"),
        (10**12 + 1, 61 * 10**12, "t = 1.000000000001 s + … [s]", "50"),
    ],
)
def test_time_counts_from_the_begin_of_the_window_in_a_unit_that_fits(tmp_path, begin, end, label, last):
    signal = Waveform("a", 1, False, False, "", "", np.array([begin]), np.array([1]))
    found = drawn(Waveforms(begin, end, (signal,)), tmp_path)
    assert label in found
    assert last in found


def test_a_value_is_written_only_where_it_has_room(shown, tmp_path):
    found = drawn(replace(shown, signals=(words("a", [123456, 7], every=1, bits=32),)), tmp_path)
    assert "7" in found
    assert "123456" not in found


def test_a_dollar_sign_is_one(tmp_path):
    signal = Waveform("block.a$b$c", 1, False, False, "", "pays $2 or $3", np.array([0]), np.array([1]))
    found = drawn(Waveforms(0, 5000, (signal,), "from $1 to $2"), tmp_path)
    assert {"a$b$c", "pays $2 or $3", "from $1 to $2"} <= set(found)


def test_a_long_description_is_cut(tmp_path):
    signal = Waveform("a", 1, False, False, "", "word " * 40, np.array([0]), np.array([1]))
    lines = [text for text in drawn(Waveforms(0, 5000, (signal,)), tmp_path) if text.startswith("word")]
    assert all(len(line) <= timing.DOC_WIDTH for line in lines)
    assert sum(map(len, lines)) > timing.DOC_WIDTH
    assert lines[-1].endswith("…")


@pytest.mark.parametrize(
    ("values", "labels"),
    [
        ([2.5], {"2.5"}),
        ([float("nan")], {"–"}),
        ([float("nan"), 2e-7, float("inf"), 1e-7], {"2e−07", "1e−07"}),
    ],
)
def test_a_float_that_is_constant_or_no_number_is_drawn(shown, tmp_path, values, labels):
    assert labels <= set(drawn(replace(shown, signals=(floats("a", values),)), tmp_path))


SCALE = timing._Scale(BEGIN, 10**6, "µs", 10.0)


# -- levels and lozenges ----------------------------------------------------------------------------------------------
def test_segments_are_the_stretches_of_equal_value(shown):
    segments = timing._segments(shown["tracker.plus"], SCALE)
    assert segments == [(0.0, 2.5, 0), (2.5, 5.0, 1), (5.0, 10.0, 0)]


def test_changes_too_close_to_be_seen_become_one_stretch_without_value():
    times = np.array([BEGIN, BEGIN + 5000, BEGIN + 10_000, BEGIN + 15_000, BEGIN + 20 * TICK])
    signal = Waveform("a", 8, False, False, "", "", times, np.array([1, 2, 3, 4, 5]))
    segments = timing._segments(signal, SCALE)
    assert segments == [(0.0, 0.015, None), (0.015, 5.0, 4), (5.0, 10.0, 5)]


def test_a_single_pulse_is_drawn_however_short():
    times = np.array([BEGIN, BEGIN + 10 * TICK, BEGIN + 10 * TICK + 1])
    signal = Waveform("a", 1, False, False, "", "", times, np.array([0, 1, 0]))
    assert [value for _, _, value in timing._segments(signal, SCALE)] == [0, 1, 0]


def test_a_window_with_far_too_many_changes_still_makes_a_small_file(shown, tmp_path):
    values = [k % 7 for k in range(50_000)]
    times = BEGIN + 200 * np.arange(len(values), dtype=np.int64)
    signals = (
        Waveform("a", 8, False, False, "", "", times, np.array(values)),
        Waveform("b", 1, False, False, "", "", times, np.array(values) % 2),
        Waveform("c", 64, True, True, "", "", times, np.array(values, dtype=np.float64)),
    )
    plot_timing(replace(shown, signals=signals), tmp_path / "a.svg")
    assert (tmp_path / "a.svg").stat().st_size < 300_000


# -- marks ------------------------------------------------------------------------------------------------------------
def test_marks_are_written_and_kept_apart(shown, tmp_path):
    marks = [(BEGIN + 20 * TICK, "+ pulse"), (BEGIN + 21 * TICK, "one count more"), (END, "end")]
    assert {"+ pulse", "one count more", "end"} <= set(drawn(shown, tmp_path, marks=marks))


# -- files ------------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(("suffix", "magic"), [(".png", b"\x89PNG"), (".pdf", b"%PDF"), (".svg", b"<?xml")])
def test_each_kind_of_file_is_written_and_the_same_each_time(shown, tmp_path, suffix, magic):
    for name in ("one", "two"):
        plot_timing(shown, tmp_path / f"{name}{suffix}")
    first = (tmp_path / f"one{suffix}").read_bytes()
    assert first.startswith(magic)
    assert first == (tmp_path / f"two{suffix}").read_bytes()


def test_the_height_grows_with_the_signals(tmp_path):
    sizes = []
    for count in (1, 24, 40):
        signals = tuple(words(f"block{k // 4}.s{k}", [0, 1], bits=1) for k in range(count))
        plot_timing(Waveforms(BEGIN, END, signals), tmp_path / "a.png")
        sizes.append(png_size(tmp_path / "a.png"))
    assert {width for width, _ in sizes} == {1650}
    row = 0.3 * 150
    assert sizes[1][1] - sizes[0][1] == pytest.approx((23 + 5) * row, abs=2)
    assert sizes[2][1] - sizes[1][1] == pytest.approx((16 + 4) * row, abs=2)


def test_none_and_too_many_signals_are_refused(shown, tmp_path):
    with pytest.raises(DetentError, match="got no signals; expected: 1 to 40"):
        plot_timing(replace(shown, signals=()), tmp_path / "a.png")
    many = tuple(words(f"s{k}", [0]) for k in range(41))
    with pytest.raises(DetentError, match=r"got 41 signals; expected: 1 to 40.*VCD"):
        plot_timing(replace(shown, signals=many), tmp_path / "a.png")
    assert not list(tmp_path.iterdir())


def test_a_target_that_cannot_be_written_is_refused(shown, tmp_path):
    with pytest.raises(DetentError, match=r"cannot be saved as '\.txt'"):
        plot_timing(shown, tmp_path / "a.txt")
    (tmp_path / "a.png").mkdir()
    with pytest.raises(DetentError, match="cannot be written"):
        plot_timing(shown, tmp_path / "a.png")
