import re
from pathlib import Path

import numpy as np
import pytest
from tests.stepper_rig import COARSE_FINE, MAX_HZ, RAMP, N, turn_envelopes

from detent.errors import DetentError
from detent.methods.stepper_envelope import envelope_files
from detent.methods.stepper_envelope.envelope_files import EnvelopeTables, plot_envelope
from detent.planning.step_envelope import StepEnvelope, Zone, ZoneMap


def tables(steps: int = N, zones=COARSE_FINE, start: int = 0, turn: int = 6000, stop: int = 1500, **changes):
    up, down = turn_envelopes(RAMP, ZoneMap(steps, MAX_HZ, zones), start, turn, stop)
    given = {"motor": "Zoom A", "axis": "to $2", "clock_hz": 10**6, "reload": True, "travel_per_step": 5e-6}
    return EnvelopeTables(**(given | {"up": up, "down": down} | changes))


def texts(path: Path) -> list[str]:
    return [
        re.sub(r"<[^>]+>", "", text).strip()
        for text in re.findall(r"<text.*?</text>", path.read_text(encoding="utf-8"), flags=re.DOTALL)
    ]


def drawn(path: Path, given: EnvelopeTables) -> list[str]:
    plot_envelope(given, path)
    return texts(path)


@pytest.mark.parametrize(("suffix", "magic"), [(".png", b"\x89PNG"), (".pdf", b"%PDF"), (".SVG", b"<?xml")])
def test_the_suffix_chooses_the_format(tmp_path, suffix, magic):
    path = tmp_path / f"zoom{suffix}"
    plot_envelope(tables(), path)
    assert path.read_bytes().startswith(magic)


def test_extremes_limits_directions_and_both_scales_are_written(tmp_path):
    words = drawn(tmp_path / "zoom.svg", tables(first_position=-0.02))
    for text in (
        "How fast may every step be? Motor Zoom A, axis to $2", "start 0", "turn 6000", "stop 1500", "up →", "← down",
        "position [step]", "8000", "permissible step frequency [Hz]", "position [mm]", "−20", "20",
        "speed [mm/s], 5 µm a step", "faster than the zone allows", "permissible outside of the run",
    ):  # fmt: skip
        assert text in words, text
    # Five stretches in either direction: coarse, fine, coarse, fine, coarse.
    assert (words.count("4000 Hz"), words.count("1000 Hz")) == (6, 4)


def test_a_run_over_the_whole_travel_has_nothing_outside(tmp_path):
    words = drawn(tmp_path / "zoom.svg", tables(turn=N, stop=0))
    assert "start and stop 0" in words
    assert "turn 8000" in words
    assert "permissible outside of the run" not in words


def test_directions_that_do_not_meet_are_named_apart(tmp_path):
    zones = ZoneMap(N, MAX_HZ)
    apart = tables(up=StepEnvelope(RAMP, zones, 1, 3000, 5000), down=StepEnvelope(RAMP, zones, -1, 6000, 2000))
    words = drawn(tmp_path / "zoom.svg", apart)
    assert {"start 3000", "stop 5000", "start 6000", "stop 2000"} <= set(words)


def test_only_zones_with_room_have_their_limit_written(tmp_path):
    zones = (Zone(1000, 1010, 700.0), Zone(2000, 2300, 800.0), Zone(3000, 4000, 900.0))
    path = tmp_path / "zoom.svg"
    words = drawn(path, tables(zones=zones))
    assert [words.count(f"{hz} Hz") for hz in (700, 800, 900)] == [0, 2, 2]
    upright = re.findall(r"rotate\(-90[^>]*>([^<]*) Hz<", path.read_text(encoding="utf-8"))
    assert upright == ["800", "800"]


@pytest.mark.parametrize("given", [tables(1, (), 0, 1, 0), tables(3, (), 1, 2, 1), tables(10, (), 5, 5, 5)])
def test_the_shortest_travels_are_drawn_with_whole_steps(tmp_path, given):
    words = drawn(tmp_path / "zoom.svg", given)
    assert str(given.steps) in words
    assert "0.5" not in words[: words.index("position [step]")]


def test_a_long_travel_is_a_small_file(tmp_path):
    path = tmp_path / "zoom.svg"
    plot_envelope(tables(300_000, turn=300_000, stop=0), path)
    assert path.stat().st_size < 400_000


def test_values_that_repeat_are_drawn_once():
    hz = np.array([1.0, 2.0, 2.0, 2.0, 3.0, 1.0, 1.0])
    values, edges = envelope_files._corners(hz, 10)
    assert values.tolist() == [1.0, 2.0, 3.0, 1.0]
    assert edges.tolist() == [10, 11, 14, 15, 17]


def test_the_curve_is_the_table():
    """What is filled are the steps of the run, each at its permissible frequency; what is dashed are all others."""
    found: dict[str, list[tuple[np.ndarray, np.ndarray]]] = {}

    class Area:
        def stairs(self, values, edges, **look):
            kind = "dashed" if "linestyle" in look else "filled" if look.get("fill") else "line"
            found.setdefault(kind, []).append((np.asarray(values), np.asarray(edges)))

    given = tables()
    for table in (given.up, given.down):
        found.clear()
        assert envelope_files._draw_table(Area(), table, "red")
        whole = np.zeros(N)
        for values, edges in found["dashed"] + found["line"]:
            whole[edges[0] : edges[-1]] = np.repeat(values, np.diff(edges))
        assert whole.tolist() == (table.direction * table.permissible_hz()).tolist()
        ((_, edges),) = found["filled"]
        assert (edges[0], edges[-1]) == (min(table.start, table.stop), max(table.start, table.stop))


def test_the_same_envelope_gives_the_same_file(tmp_path):
    for name in ("a.svg", "b.svg"):
        plot_envelope(tables(), tmp_path / name)
    assert (tmp_path / "a.svg").read_bytes() == (tmp_path / "b.svg").read_bytes()


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("zoom.jpg", r"cannot be saved as '\.jpg'; use one of \.png, \.svg, \.pdf"),
        ("nowhere/zoom.png", "cannot be written"),
    ],
)
def test_what_cannot_be_written_is_said(tmp_path, name, says):
    with pytest.raises(DetentError, match=says):
        plot_envelope(tables(), tmp_path / name)
    assert list(tmp_path.iterdir()) == []
