import dataclasses
import re
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from detent.errors import DetentError
from detent.files.text import check_target, shown
from detent.page.draw import draw_figures
from detent.page.figure import Figure
from detent.page.plots import plot_signals
from detent.page.table import TextTable
from detent.page.timing import plot_timing
from detent.record.trace import Trace
from detent.record.waveforms import Waveform, Waveforms


@pytest.fixture
def trace() -> Trace:
    t = np.arange(0, 2, 1e-3)
    return Trace(
        columns={
            "t": t,
            "carriage.velocity": np.sin(t),
            "motor.current": np.cos(t),
            "carriage.velocity_ref": np.sin(t),
            "head.drive_cmd": (195 * np.sin(t)).astype(np.int16),
            "head.transition": np.sin(t) > 0.5,
        },
        units={
            "t": "s", "carriage.velocity": "m/s", "carriage.velocity_ref": "m/s", "motor.current": "A",
            "head.drive_cmd": "count",
        },
        attributes={"axis": "demo axis", "job": "LETTER.TXT", "seed": 1},
    )  # fmt: skip


def texts(path: Path) -> list[str]:
    return [
        re.sub(r"<[^>]+>", "", text).strip()
        for text in re.findall(r"<text.*?</text>", path.read_text(encoding="utf-8"), flags=re.DOTALL)
    ]


@pytest.mark.parametrize(("suffix", "magic"), [(".png", b"\x89PNG"), (".pdf", b"%PDF"), (".SVG", b"<?xml")])
def test_the_suffix_chooses_the_format(tmp_path: Path, trace: Trace, suffix: str, magic: bytes) -> None:
    path = tmp_path / f"run{suffix}"
    plot_signals(trace, ["motor.current"], path)
    assert path.read_bytes().startswith(magic)


def test_signals_share_a_plot_area_by_unit_and_carry_it(tmp_path: Path, trace: Trace) -> None:
    plot_signals(trace, ["*"], tmp_path / "run.svg")
    svg = (tmp_path / "run.svg").read_text(encoding="utf-8")
    assert len(set(re.findall(r'id="(axes_\d+)"', svg))) == 4
    words = texts(tmp_path / "run.svg")
    for text in ("[m/s]", "carriage.velocity", "carriage.velocity_ref", "[A]", "[count]", "time [s]", "on", "off"):
        assert text in words
    assert "demo axis · LETTER.TXT" in words


def test_a_dollar_sign_is_one(tmp_path: Path, trace: Trace) -> None:
    named = dataclasses.replace(trace, attributes={"axis": "from $1", "job": "to $2"})
    plot_signals(named, ["motor.current"], tmp_path / "run.svg")
    assert "from $1 · to $2" in texts(tmp_path / "run.svg")


def test_a_short_stretch_is_in_milliseconds(tmp_path: Path, trace: Trace) -> None:
    plot_signals(trace, ["motor.current"], tmp_path / "run.svg", (0.5, 0.7))
    words = texts(tmp_path / "run.svg")
    assert "time [ms]" in words
    assert "600" in words


def test_the_same_figure_gives_the_same_file(tmp_path: Path, trace: Trace) -> None:
    for suffix in (".svg", ".pdf", ".png"):
        for name in ("a", "b"):
            plot_signals(trace, ["motor.*", "head.*"], tmp_path / (name + suffix))
        assert (tmp_path / f"a{suffix}").read_bytes() == (tmp_path / f"b{suffix}").read_bytes()


def test_drawing_leaves_other_peoples_settings_alone(tmp_path: Path, trace: Trace) -> None:
    import matplotlib as mpl

    before = dict(mpl.rcParams)
    plot_signals(trace, ["motor.current"], tmp_path / "run.png")
    assert dict(mpl.rcParams) == before


@pytest.mark.parametrize(
    ("signals", "name", "t_range", "says"),
    [
        (["motor.curent"], "run.png", None, "did you mean 'motor.current'"),
        ([], "run.png", None, "no signal was asked for; name one of: carriage.velocity"),
        (["motor.current"], "run.png", (5.0, 6.0), "no rows from 5 s to 6 s"),
        (["motor.current"], "run.jpg", None, r"cannot be saved as '\.jpg'; use one of \.png, \.svg, \.pdf"),
        (["motor.current"], "nowhere/run.png", None, "cannot be written"),
    ],
)
def test_what_cannot_be_drawn_is_said(
    tmp_path: Path, trace: Trace, signals: list[str], name: str, t_range: tuple[float, float] | None, says: str
) -> None:
    with pytest.raises(DetentError, match=says):
        plot_signals(trace, signals, tmp_path / name, t_range)
    assert list(tmp_path.iterdir()) == []


def test_an_empty_trace_cannot_be_drawn(tmp_path: Path) -> None:
    with pytest.raises(DetentError, match="holds no rows"):
        plot_signals(Trace(columns={"t": np.empty(0), "x": np.empty(0)}), ["x"], tmp_path / "run.png")


@pytest.mark.parametrize(
    ("name", "says"), [("a.txt", r"cannot be saved as '\.txt'"), ("no/a.png", "no folder .*no.; make it")]
)
def test_a_target_can_be_refused_before_any_work(tmp_path: Path, name: str, says: str) -> None:
    assert check_target(tmp_path / "a.PNG") == tmp_path / "a.PNG"
    with pytest.raises(DetentError, match=says):
        check_target(tmp_path / name)


# ---- what a file says

EVIL = "a\x1b[2J\u202e\x9b $x^{$ \\frac{ & <b> \udcff 日 \0"  # steers a terminal, is mathematics, is no XML, no UTF-8


def draw_trace(path: Path) -> None:
    columns = {"t": np.arange(3.0), EVIL: np.arange(3.0), "b": np.arange(3.0)}
    plot_signals(
        Trace(columns=columns, units={EVIL: EVIL, "b": EVIL}, attributes={"axis": EVIL, "job": EVIL}), ["*"], path
    )


def draw_timing(path: Path) -> None:
    wave = Waveform("clocks.ck", 1, False, False, "", "", np.array([0, 5]), np.array([0, 1]))
    plot_timing(Waveforms(0, 10, (wave,), EVIL), path)


def draw_page(path: Path) -> None:
    draw_figures([Figure(title=EVIL, caption=EVIL, table=TextTable(EVIL, (EVIL, EVIL), [(EVIL, EVIL)]).on_page)], path)


@pytest.mark.parametrize("draw", [draw_trace, draw_timing, draw_page])
@pytest.mark.parametrize("kind", ["svg", "png", "pdf"])
def test_no_name_steers_or_breaks_a_picture(
    draw: Callable[[Path], None], kind: str, tmp_path: Path, tried: Callable[..., None]
) -> None:
    """Control codes reached the picture raw, an SVG was no XML, and a letter without a shape came to the terminal."""
    path = tmp_path / f"a.{kind}"
    draw(path)
    if kind == "svg":
        texts = [text.text or "" for text in ET.parse(path).iter("{http://www.w3.org/2000/svg}text")]  # noqa: S314
        assert any(text.startswith(shown(EVIL)[:20]) for text in texts)
    assert b"\x1b[2J" not in path.read_bytes()
    tried("text", "names, units and titles in pictures: PNG, SVG, PDF", "drawn, with escapes; no mathematics")
