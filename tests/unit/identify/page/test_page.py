"""The page about an identification: the verdict in its first lines, every section, and nothing from elsewhere."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from markupsafe import Markup
from tests.page_reader import Reader, charts_of
from tests.places import DATA
from tests.unit.identify.page.samples import identified, partly, refused, rigid, trusted, unfitted

from detent.errors import DetentError
from detent.identify.analyse import measure_response as response_module
from detent.identify.fit.identification import Identification, identify
from detent.identify.identified import Identified
from detent.identify.page.compared import hold_out
from detent.identify.page.page import identify_page
from detent.logs.read_log import read_log
from detent.page.figure import Figure
from detent.page.frame import Page
from detent.page.render import render_page

pytestmark = pytest.mark.compiled

EMPS = DATA / "emps" / "DATA_EMPS.mat"

CHARTS = [
    "recorded-position", "recorded-effort", "held-position", "held-restarted", "held-free", "effort-both",
    "effort-left", "residual-sizes", "residual-memory", "friction-map",
]  # fmt: skip

SECTIONS = [
    "Constants", "Findings in the log", "Measured and simulated", "Force, measured and fitted",
    "Friction versus speed", "Model selection", "Correlation of the constants", "Frequency response",
]  # fmt: skip


def sections(page: Page) -> list[str]:
    return [section.title for section in page.sections if section.shown]


def figure_of(page: Page, title: str) -> Figure:
    return next(figure for figure in page.figures if figure.title.startswith(title))


def rows_of(page: Page, title: str) -> list[list[str]]:
    """Cells of a figure's table without their marks."""
    table = figure_of(page, title).table
    assert table is not None
    return [[Markup(cell.text).striptags() for cell, _ in table.cells(row)] for row in table.rows]  # noqa: S704 - read, not shown


def test_a_trusted_one_says_so_and_how_it_was_tested() -> None:
    page = identify_page(trusted())
    head, h = page.headline, next(h for h in identified().horizons if h.name == "1 s")
    assert (head.level, head.name, page.title) == ("good", "run <1>.csv", "run <1>.csv: trusted")
    assert f"{1e6 * h.rms:.0f} µm".replace(" ", "\u202f") in head.lead
    assert page.notes == []
    titles = [card.title for card in page.cards]
    assert titles == ["Mass", "Coulomb friction +", "Coulomb friction \u2212", "Viscous friction +",
                      "Viscous friction \u2212", "Off after 1 s"]  # fmt: skip
    assert page.cards[0].value.startswith("0.98")
    assert not any(card.bad for card in page.cards)
    assert page.settings["recording"] == "run <1>.csv"


def test_its_sections_and_charts_stand_in_their_order() -> None:
    assert sections(identify_page(trusted())) == SECTIONS
    assert sections(identify_page(partly())) == [*SECTIONS[:2], "What to record instead", *SECTIONS[2:]]
    assert [chart["id"] for chart in identify_page(trusted()).charts] == CHARTS


def test_a_partly_trusted_one_says_what_is_not_and_why() -> None:
    page = identify_page(partly())
    assert page.headline.level == "warn"
    assert "viscous friction in both directions" in page.headline.lead
    assert [card.title for card in page.cards if card.bad] == ["Viscous friction +", "Viscous friction \u2212"]
    doubted = [row for row in rows_of(page, "Model: ") if row[-1].startswith("✘")]
    assert len(doubted) == 2
    assert all("not determined by the data" in row[-1] for row in doubted)


def test_a_refused_one_says_what_to_record_at_once() -> None:
    page = identify_page(refused())
    assert page.headline.level == "bad"
    assert "too short" in page.headline.lead
    assert [note.level for note in page.notes] == ["error"]
    assert "record 10 s" in page.notes[0].text
    assert page.cards == []
    assert not any(row[-1].startswith("✔") for row in rows_of(page, "Model: "))
    assert figure_of(page, "Model: ").caption != figure_of(identify_page(partly()), "Model: ").caption


def test_one_without_constants_shows_the_log_and_what_to_record() -> None:
    page = identify_page(unfitted())
    assert sections(page) == ["Findings in the log", "What to record instead"]
    assert [chart["id"] for chart in page.charts] == CHARTS[:2]


def test_correlated_constants_are_named() -> None:
    found = identified()
    assert found.constants is not None
    covariance = found.constants.covariance.copy()
    error = np.sqrt(np.diag(covariance))
    covariance[1, 3] = covariance[3, 1] = -0.97 * error[1] * error[3]
    covariance[0, 2] = covariance[2, 0] = 0.5 * error[0] * error[2]
    names = found.constants.names
    assert (names[1], names[3]) == ("coulomb.positive", "viscous.positive")
    title = "Correlation of the constants"
    alike, free = (
        figure_of(identify_page(replace(trusted(), constants=replace(found.constants, covariance=c))), title).drawing
        for c in (covariance, np.diag(error**2))
    )
    assert alike is not None
    assert free is not None
    (pair,) = re.findall(r"<li>(.*?)</li>", alike)
    assert "Coulomb friction in positive direction and viscous friction in positive direction (\u22120.97)" in pair
    assert "<li>" not in free


def test_an_unknown_constant_has_no_number() -> None:
    found = refused()
    wild = tuple(replace(e, low=-1e20, high=1e20) if e.name == "mass" else e for e in found.estimates)
    row = rows_of(identify_page(replace(found, estimates=wild)), "Model: ")[0]
    assert row[1] == "not known"
    assert row[3] == "\u2013"


def test_the_chosen_model_is_marked() -> None:
    page = identify_page(trusted())
    rung = identified().rung
    assert rung is not None
    assert figure_of(page, "Model: ").title == f"Model: {rung.text}"
    rows = rows_of(page, "Models, simplest first")
    (chosen,) = [row[0] for row in rows if row[-1].startswith("✔")]
    assert chosen.lower() == rung.text.lower()


def test_horizons_stand_in_figures() -> None:
    rows = rows_of(identify_page(trusted()), "Prediction error versus horizon")
    assert len(rows) == len(identified().horizons)
    assert [row[1] for row in rows] == [str(h.starts) for h in identified().horizons]


def test_the_worst_log_is_drawn() -> None:
    found = identified()
    other = replace(found.runs[0], position=found.runs[0].position * 1.2, reference=None)
    logs = (found.logs[0], replace(found.logs[0], name="other.csv"))
    twice = replace(found, runs=(found.runs[0], other), logs=logs, fit=None)
    held = hold_out(twice)
    worst = max((0, 1), key=lambda k: held[k].rms_restarted)
    assert figure_of(identify_page(twice), "Recorded signals").caption.startswith(logs[worst].name)


def test_titles_are_the_names_of_the_logs() -> None:
    assert identify_page(trusted()).headline.name == "run <1>.csv"
    three = replace(unfitted(), logs=unfitted().logs * 3, runs=unfitted().runs * 3)
    assert identify_page(three).headline.name == "run <1>.csv and 2 more"


@pytest.mark.parametrize("make", [trusted, partly, refused, unfitted])
def test_the_page_is_well_formed_and_fetches_nothing(make: object, monkeypatch: pytest.MonkeyPatch) -> None:
    assert callable(make)
    monkeypatch.setattr(response_module, "response_of", lambda *_: rigid())
    html = render_page(identify_page(make()))
    page = Reader(html)
    assert page.open == []
    assert page.fetched == []
    assert {chart["id"] for chart in charts_of(html)} <= set(page.ids)
    assert "run <1>.csv" in page.text
    assert "&lt;svg" not in html


def write(found: Identification, path: Path) -> Path:
    return Identified(found).report(path)


def test_the_same_identification_gives_the_same_bytes(tmp_path: Path) -> None:
    one, other = (write(trusted(), tmp_path / f"{name}.html").read_bytes() for name in ("a", "b"))
    assert one == other


def test_a_place_that_cannot_be_written_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(DetentError, match="cannot be written"):
        write(trusted(), tmp_path / "missing" / "r.html")


@pytest.mark.skipif(not EMPS.exists(), reason="the EMPS recording is not here")
def test_a_page_about_25_s_at_1_khz_stays_small(tmp_path: Path) -> None:
    found = identify([read_log(EMPS, options=["force=vir [35.15065 N]"])])
    path = write(found, tmp_path / "emps.html")
    assert path.stat().st_size < 1_000_000
    (position,) = (c for c in charts_of(path.read_text(encoding="utf-8")) if c["id"] == "held-position")
    assert position["x"][0] > 18.0
    assert position["x"][-1] > 24.8
