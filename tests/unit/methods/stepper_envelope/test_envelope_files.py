import csv
import re
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from tests.stepper_rig import COARSE_FINE, MAX_HZ, RAMP, N, Rig, turn_envelopes

from detent.errors import DetentError
from detent.files.text import shown
from detent.methods.stepper_envelope.envelope_files import (
    EnvelopeTables,
    plot_envelope,
    write_envelope_csv,
    write_envelope_header,
)
from detent.planning.step_envelope import StepEnvelope, Zone, ZoneMap
from detent.record import trace_files

STEP = 5e-6
MEGAHERTZ = 1_000_000


def tables(steps: int = N, zones=COARSE_FINE, start: int = 0, turn: int = 6000, stop: int = 1500, **changes):
    """The coarse and fine zones of the specification, up to `turn` and back down to `stop`."""
    up, down = turn_envelopes(RAMP, ZoneMap(steps, MAX_HZ, zones), start, turn, stop)
    given = {"motor": "zoom_a", "axis": "microscope", "clock_hz": MEGAHERTZ, "reload": True, "travel_per_step": STEP}
    return EnvelopeTables(**(given | {"up": up, "down": down} | changes))


def columns(path: Path) -> dict[str, list[str]]:
    with path.open(newline="", encoding="utf-8") as stream:
        heading, *rows = csv.reader(stream)
    return dict(zip(heading, map(list, zip(*rows, strict=True)), strict=True))


@pytest.fixture(scope="module")
def written(tmp_path_factory) -> dict[str, list[str]]:
    path = tmp_path_factory.mktemp("csv") / "zoom.csv"
    write_envelope_csv(tables(first_position=-0.02), path)
    return columns(path)


# ---- CSV


def test_the_csv_file_has_a_row_per_step_and_units_in_its_heading(written):
    assert list(written) == [
        "step", "position [m]",
        "up.index", "up.zone_limit [Hz]", "up.permissible [Hz]", "up.period [tick]",
        "down.index", "down.zone_limit [Hz]", "down.permissible [Hz]", "down.period [tick]",
    ]  # fmt: skip
    assert written["step"] == [str(i) for i in range(N)]
    assert written["position [m]"][:3] == ["-0.02", "-0.019995", "-0.01999"]
    assert written["position [m]"][-1] == "0.019995"


@pytest.mark.parametrize("name", ["up", "down"])
def test_the_csv_file_holds_the_table_to_the_last_bit(written, name):
    table: StepEnvelope = getattr(tables(), name)
    assert list(map(int, written[f"{name}.index"])) == table.indices().tolist()
    assert list(map(float, written[f"{name}.permissible [Hz]"])) == table.permissible_hz().tolist()


def test_the_zone_limit_of_every_step_is_there_also_where_no_step_is_allowed(written):
    fine = {i for zone in COARSE_FINE for i in range(zone.begin, zone.end)}
    expected = [1000.0 if i in fine else 4000.0 for i in range(N)]
    assert list(map(float, written["up.zone_limit [Hz]"])) == expected
    assert list(map(float, written["down.zone_limit [Hz]"])) == expected


def test_a_sentinel_is_told_by_its_index(written):
    assert [i for i, index in enumerate(written["up.index"]) if index == "-1"] == [6000]
    assert [i for i, index in enumerate(written["down.index"]) if index == "-1"] == [1499]
    for name, row in (("up", 6000), ("down", 1499)):
        assert (written[f"{name}.permissible [Hz]"][row], written[f"{name}.period [tick]"][row]) == ("0.0", "0")


@pytest.mark.parametrize("reload", [False, True])
def test_the_periods_are_those_that_the_timer_loads(tmp_path, reload):
    rig = Rig(zones=COARSE_FINE, reload=reload)
    both = EnvelopeTables(
        motor="m", axis="a", up=rig.up, down=rig.down, clock_hz=rig.clock_hz, reload=reload, travel_per_step=STEP
    )
    write_envelope_csv(both, tmp_path / "m.csv")
    found = columns(tmp_path / "m.csv")
    up, down = rig.start(1).course(), rig.start(-1).course()
    assert (rig.clock_hz / np.array(found["up.period [tick]"], float)).tolist() == up.hz.tolist()
    assert (rig.clock_hz / np.array(found["down.period [tick]"], float))[::-1].tolist() == down.hz.tolist()


def test_directions_may_have_their_own_zones(tmp_path):
    slow_up = ZoneMap(1000, 2000.0, [Zone(100, 300, 500.0)], [1500.0])
    slow_down = ZoneMap(1000, 2000.0, [Zone(600, 900, 1500.0)], [500.0])
    up, down = StepEnvelope(RAMP, slow_up), StepEnvelope(RAMP, slow_down, -1)
    write_envelope_csv(tables(up=up, down=down), tmp_path / "m.csv")
    found = columns(tmp_path / "m.csv")
    assert [float(found[f"{name}.zone_limit [Hz]"][700]) for name in ("up", "down")] == [2000.0, 1500.0]
    assert [float(found[f"{name}.zone_limit [Hz]"][200]) for name in ("up", "down")] == [500.0, 2000.0]
    assert max(map(float, found["down.permissible [Hz]"][600:900])) == 1500.0


def test_rows_are_whole_beyond_a_piece_of_text(tmp_path, monkeypatch):
    write_envelope_csv(tables(), tmp_path / "one.csv")
    monkeypatch.setattr(trace_files, "CSV_ROWS", 7)
    write_envelope_csv(tables(), tmp_path / "many.csv")
    assert (tmp_path / "one.csv").read_bytes() == (tmp_path / "many.csv").read_bytes()


# ---- header, as text


def header(given: EnvelopeTables, path: Path) -> str:
    write_envelope_header(given, path)
    return path.read_text(encoding="utf-8")


def code_of(text: str) -> str:
    return re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL)


def array(text: str, name: str) -> list[int]:
    return [int(n) for n in re.search(rf"{name}\[[^]]+\]\w* ?\w* = {{([^}}]*)}}", text)[1].split(",")]


def entries(text: str, name: str) -> list[int]:
    """A table by its pages, as long as the travel."""
    pages = np.reshape(array(text, "zoom_a_page"), (-1, 256))
    return pages[array(text, name)].ravel()[: N + 1].tolist()


def test_the_header_holds_both_tables_and_the_words_of_the_control_unit(tmp_path):
    given = tables()
    text = header(given, tmp_path / "zoom.h")
    assert entries(text, "zoom_a_up") == given.up.entries.tolist()
    assert entries(text, "zoom_a_down") == given.down.entries.tolist()
    assert array(text, "zoom_a_ramp") == np.rint(1e6 / RAMP.hz).tolist()
    assert array(text, "zoom_a_limit") == [250, 1000]
    text = header(tables(reload=False), tmp_path / "zoom.h")
    assert array(text, "zoom_a_ramp") == np.rint(RAMP.hz).tolist()
    assert array(text, "zoom_a_limit") == [4000, 1000]


def test_words_that_need_it_are_wider(tmp_path):
    assert "uint16_t zoom_a_ramp" in header(tables(clock_hz=26_000_000), tmp_path / "a.h")
    text = header(tables(clock_hz=72_000_000), tmp_path / "b.h")
    assert "int32_t zoom_a_ramp" in text
    assert array(text, "zoom_a_ramp")[0] == 180_000
    assert re.search(r"ramp and limits\s+(\* +)?920\n", text)


def test_the_opening_comment_says_what_the_numbers_mean(tmp_path):
    text = header(tables(first_position=-0.02), tmp_path / "zoom.h")
    for fact in (
        'motor "zoom_a", axis "microscope"', "8000 steps of 5 um: 40 mm; boundary 0 lies at -20 mm",
        "Up      leaves 0, stops at 6000", "Down    leaves 6000, stops at 1500",
        "Ramp    228 entries, 400 Hz to 4000 Hz", "Limits  4000 Hz, 1000 Hz",
        "Words   periods [tick] of a timer at 1000000 Hz",
        "Memory  pages of tables 11264 bytes (entry by entry 32004), their order 64, ramp and limits 460",
    ):  # fmt: skip
        assert fact in text
    assert max(map(len, text.splitlines())) <= 120


def test_every_name_begins_with_the_motors(tmp_path):
    code = code_of(header(tables(), tmp_path / "zoom.h"))
    assert re.findall(r"#include (.*)", code) == ["<stdint.h>", "<avr/pgmspace.h>"]
    named = {
        *re.findall(r"#(?:define|ifndef) (\w+)", code),
        *re.findall(r"static (?:inline|const) \w+ (\w+)", code),
        *re.findall(r"^} (\w+);", code, flags=re.MULTILINE),
    }
    assert len(named) == 66
    assert all(name.startswith(("zoom_a_", "ZOOM_A_")) for name in named)
    assert re.search(r"\b(double|float|malloc)\b|\d\.\d", code) is None


@pytest.mark.parametrize(
    "name", ["a */ int x; /*", "a *//*/ b", "line\nbreak \r\u2028 \u202e bidi", "??/", "x" * 300, "\udcff"]
)
def test_no_name_ends_the_comment(tmp_path, name):
    text = header(tables(motor="m", axis=name), tmp_path / "m.h")
    plain = header(tables(motor="m", axis="plain"), tmp_path / "m.h")
    assert code_of(text) == code_of(plain)
    assert "??" not in text
    _, _, comment = text.partition("\n")  # behind the line that says who wrote it
    assert comment.index("*/") > comment.index("An entry of a table")
    assert all(line.startswith(" *") for line in comment[: comment.index("*/")].splitlines()[1:-1])


def test_no_name_steers_the_figure(tmp_path):
    name = "a\x1b[2J\u202e $x^{$ \\frac{ <b> \udcff 日"
    plot_envelope(tables(motor="m", axis=name), tmp_path / "m.svg")
    drawn = ET.parse(tmp_path / "m.svg")  # noqa: S314 - our own
    assert any(shown(name) in (text.text or "") for text in drawn.iter("{http://www.w3.org/2000/svg}text"))


# ---- errors


@pytest.mark.parametrize("write", [write_envelope_csv, write_envelope_header])
def test_a_file_that_cannot_be_written_is_an_error(tmp_path, write):
    with pytest.raises(DetentError, match=r"cannot be written \(No such file"):
        write(tables(), tmp_path / "nowhere" / "zoom.x")
    (tmp_path / "zoom.x").write_text("kept until the new one is whole")
    write(tables(), tmp_path / "zoom.x", force=True)
    assert [path.name for path in tmp_path.iterdir()] == ["zoom.x"]
    assert "kept" not in (tmp_path / "zoom.x").read_text()
