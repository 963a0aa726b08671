"""Recorded signals, in people's units, and the faults of it."""

from dataclasses import replace

import numpy as np
import pytest
from tests.unit.identify.page.samples import DROPPED, FLIPPED, identified, refused, trusted, unfitted

from detent.identify.page.page import recorded_charts, recording_figures, refused_figures
from detent.page.figure import Figure

pytestmark = pytest.mark.compiled


def figure_of(figures: list[Figure], title: str) -> Figure:
    return next(figure for figure in figures if figure.title == title)


def plain(row: object) -> list[str]:
    return [cell.striptags() if hasattr(cell, "striptags") else cell for cell in row]


def test_samples_that_are_not_used_are_shaded() -> None:
    run = identified().runs[0]
    usable = np.ones(len(run.t), dtype=bool)
    usable[1000:1501:2] = False
    place, effort = recorded_charts(replace(run, usable=usable))
    (band,) = place["bands"]
    assert band["label"] == "not used"
    (span,) = band["spans"]
    assert span == pytest.approx([1000 * run.step, 1501 * run.step])
    assert place["yLabel"] == "position [mm]"
    assert effort["yLabel"] == "force [N]"
    assert place["series"][0]["y"][0] == pytest.approx(run.position[0] * 1e3, abs=0.01)


def test_a_recording_without_reference_has_one_curve() -> None:
    place, _ = recorded_charts(replace(identified().runs[0], reference=None))
    assert [one["label"] for one in place["series"]] == ["position"]


def test_findings_have_rows_action_and_advice_the_worst_first() -> None:
    table = figure_of(recording_figures(unfitted(), 0, simulated=False), "Faults").table
    assert table is not None
    flipped, dropped = (plain(row) for row in table.rows)
    assert flipped[:3] == ["error", "all rows", "force"]
    assert dropped == ["warning", "rows 17-19, 40", "all", f"dropped rows: {DROPPED.text}", "unchanged",
                       DROPPED.advice]  # fmt: skip
    assert flipped[3].endswith(FLIPPED.text)


def test_a_log_without_faults_says_so_and_that_refusals_are_elsewhere() -> None:
    clean, doubted = (
        figure_of(recording_figures(found(), 0, simulated=True), "Faults") for found in (trusted, refused)
    )
    assert clean.table is None
    assert clean.drawing
    assert clean.drawing != doubted.drawing


def test_columns_and_guesses_are_told() -> None:
    figure = figure_of(recording_figures(trusted(), 0, simulated=True), "Columns")
    log = identified().logs[0]
    assert figure.table is not None
    assert [row[0] for row in figure.table.rows] == list(log.columns)
    assert figure.drawing is not None
    assert figure.drawing.count("<li>") == len(log.guesses) > 0


def test_several_logs_are_listed_and_the_drawn_one_is_named() -> None:
    found = unfitted()
    other = replace(found.logs[0], name="second.csv", findings=())
    figures = recording_figures(replace(found, logs=(found.logs[0], other), runs=found.runs * 2), 1, simulated=False)
    listed = figure_of(figures, "Recordings")
    assert listed.table is not None
    assert [row[0] for row in listed.table.rows] == ["run <1>.csv", "second.csv"]
    assert "second.csv" in listed.caption
    faults = figure_of(figures, "Faults").table
    assert faults is not None
    assert all(str(row[1]).startswith("run <1>.csv: ") for row in faults.rows)
    assert figure_of(figures, "Recorded signals").caption.startswith("second.csv")


def test_refusals_say_what_to_record_and_which_constants_they_cost() -> None:
    (figure,) = refused_figures(refused())
    assert figure.table is not None
    short, slow = (plain(row) for row in figure.table.rows)
    assert short == ["too short", "it moves for <0.3> s", "record 10 s", "all constants"]
    assert len(slow[3].split("; ")) == 2
    assert refused_figures(trusted()) == []
