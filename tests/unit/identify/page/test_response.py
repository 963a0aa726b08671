"""The frequency response: where a log tells one, and what stands beside it."""

from dataclasses import replace

import numpy as np
import pytest
from tests.synthetic_responses import within
from tests.unit.identify.page.samples import constants, refused, rigid, trusted

from detent.identify.analyse import measure_response as response_module
from detent.identify.analyse.measure_response import FrequencyResponse, told_response
from detent.identify.fit.identification import Identification
from detent.identify.page.response import bode_charts, respond, response_figures

pytestmark = pytest.mark.compiled


def response_told(found: Identification) -> FrequencyResponse | None:
    run = found.runs[0]
    return told_response(found.logs[0], run.effort_name, is_open=run.reference is None)


def test_moves_in_a_closed_loop_tell_no_response() -> None:
    assert response_told(trusted()) is None


@pytest.mark.parametrize(
    ("response", "told"),
    [
        (rigid(), True),
        (rigid(lines=8), False),
        (rigid(coherence=0.5), False),
        (rigid(rough=3.0), False),
        (within(rigid(), 10.0, 25.0), False),
    ],
)
def test_a_response_is_told_by_coherent_lines_that_agree(
    response: object, told: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(response_module, "response_of", lambda *_: response)
    assert (response_told(trusted()) is response) is told


def test_a_rigid_axis_answers_by_its_mass() -> None:
    c = constants()
    (high,) = respond(c, np.array([100.0]))
    assert abs(high) == pytest.approx(1.0 / (2.0 * (2 * np.pi * 100.0) ** 2), rel=1e-4)
    late = np.degrees(np.angle(high)) % 360.0
    assert late == pytest.approx(180.0 - 360.0 * 100.0 * 1e-3 + np.degrees(4.5 / (2.0 * 2 * np.pi * 100.0)), abs=0.01)


def test_without_a_mass_there_is_no_response() -> None:
    c = constants()
    assert respond(replace(c, values=-c.values), np.array([1.0])) is None


def test_the_response_is_drawn_beside_the_rigid_axis_of_the_constants(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(response_module, "response_of", lambda *_: rigid())
    (figure,) = response_figures(trusted(), 0)
    assert "mean of 5 &lt;periods&gt;" in figure.caption
    magnitude, phase, coherence = figure.charts
    assert magnitude["yLabel"] == "magnitude [m/N]"
    assert [chart["log"] for chart in figure.charts] == ["xy", "x", "x"]
    for chart in (magnitude, phase):
        assert [one["label"] for one in chart["series"]] == ["recorded", "mass and viscous friction"]
    assert coherence["levels"] == [{"y": 0.8, "label": ""}]


def test_magnitudes_keep_their_digits_and_room_around_them() -> None:
    (magnitude, *_) = bode_charts(rigid(), None)
    (curve,) = magnitude["series"]
    size = np.abs(rigid().response)
    assert curve["y"] == pytest.approx(size.tolist(), rel=1e-3)
    assert magnitude["yRange"] == pytest.approx([size.min() / 2, 2 * size.max()])


def test_without_a_response_it_says_what_would_tell_one() -> None:
    (figure,) = response_figures(trusted(), 0)
    assert figure.drawing is not None
    assert "multisine" in figure.drawing
    assert response_figures(refused(), 0) == []
