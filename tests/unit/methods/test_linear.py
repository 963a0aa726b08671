"""The linear model as the methods bring it."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.cascade_rig import BY_HAND

import detent
from detent.errors import DetentError
from detent.methods.cascade.derive import CascadeFigures
from detent.methods.linear import LinearModel


def model_of(name: str) -> LinearModel:
    return detent.load(detent.example(name)).linear()


def test_the_margins_are_those_that_check_prints() -> None:
    axis = detent.load(detent.example("cascade.toml"), BY_HAND)
    figures, margins = CascadeFigures(axis.spec), axis.linear().margins
    for cut, told in (("velocity", figures.loop.velocity_loop), ("position", figures.loop.position_loop)):
        assert margins[cut].crossover == pytest.approx(told.crossover, rel=1e-6)
        assert margins[cut].phase == pytest.approx(told.phase, abs=1e-6)
    assert margins["command"].gain == pytest.approx(figures.loop.gain_margin, rel=1e-3)
    # Gains by hand: Ms on the resonance, where no margin of the position loop shows it.
    assert margins["command"].sensitivity == pytest.approx(2.22, abs=0.01)
    told = {row.name: row.value for row in axis.check().derived}
    assert told["Ms at the command"] == pytest.approx(margins["command"].sensitivity, rel=1e-6)
    assert told["frequency of Ms"] == pytest.approx(margins["command"].peak, rel=1e-5)
    assert margins["command"].peak == pytest.approx(344.0, abs=1.0)


@pytest.mark.parametrize("name", ["filtered_servo.toml", "rotary_table.toml", "turntable.toml"])
def test_every_linear_loop_closes_to_the_modes_of_its_method(name: str) -> None:
    axis = detent.load(detent.example(name))
    model = axis.linear()
    figures = {row.name: row for row in axis.check().derived}
    first = next(iter(model.loops.values()))
    assert model.settles
    assert 0.0 < first.closed().spectral_radius < 1.0
    if "gain margin" in figures:
        assert next(iter(model.margins.values())).gain == pytest.approx(figures["gain margin"].value, rel=1e-3)


def test_a_loop_beyond_its_gain_says_that_it_does_not_settle() -> None:
    axis = detent.load(detent.example("cascade.toml")).replace({"method.velocity_gain": 400.0})
    model = axis.linear()
    assert not model.settles
    assert "does not settle" in repr(model)
    assert "does not settle" not in repr(model_of("cascade.toml"))


def test_a_method_without_a_linear_loop_says_so() -> None:
    with pytest.raises(DetentError, match="phase servo: got an axis of the method phase_servo, whose law is no linear"):
        model_of("phase_servo.toml")


def test_a_cut_that_is_not_there_is_said_with_those_that_are() -> None:
    with pytest.raises(DetentError, match=r"cut 'velocty'; expected: command, velocity, position; try: did you mean"):
        model_of("cascade.toml").to_scipy("velocty")
    assert model_of("cascade.toml").to_scipy("velocity").dt == 0.25e-3


def test_the_bode_diagram_shows_gain_and_phase(tmp_path: Path) -> None:
    model = model_of("cascade.toml")
    figure: Any = model.bode(["position"], tmp_path / "bode.svg")
    gain, phase = figure.axes
    curve = gain.lines[0]
    f = np.asarray(curve.get_xdata())
    found = model["position"].response(f)
    assert curve.get_ydata() == pytest.approx(20 * np.log10(abs(found)), abs=1e-9)
    assert np.interp(1.0, f, phase.lines[0].get_ydata()) == pytest.approx(-90.0, abs=3.0)
    m = model.margins["position"]
    text = (tmp_path / "bode.svg").read_text(encoding="utf-8")
    assert f"position: {m.crossover:.3g} Hz, {math.degrees(m.phase):.0f}°" in text
    assert "mathdefault" not in text
