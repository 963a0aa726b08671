"""Figures that gains are compared by: against closed forms, and the push and the step as simulated."""

import math

import numpy as np
import pytest
from tests.acceptance.test_golden_bits import EXAMPLES

import detent
from detent.methods.cascade.derive import CascadeFigures
from detent.methods.cascade.tried import count_noise, loop_figures, responses

CASCADE = EXAMPLES / "cascade.toml"
PID = ("method.structure=pid", "method.proportional=9 kV/m", "method.integral=200 kV/(m*s)",
       "method.derivative=100 V*s/m")  # fmt: skip
ON_LOAD = ("method.feedback.position=load", "load_encoder.resolution=2 um", "load_encoder.delay=1")


@pytest.mark.parametrize("overrides", [(), ON_LOAD])
def test_noise_of_counts_is_that_of_the_response_around_the_unit_circle(overrides):
    """Command to what an encoder is off by: C (K_p z^-d + V) / (1 + L), the mean of its square over all frequencies."""
    spec = detent.load(CASCADE, list(overrides)).spec
    figures = CascadeFigures(spec)
    loop, m = figures.loop, spec.method
    f = (np.arange(200_000) + 0.5) / 200_000 * 0.5 / loop.period
    z = np.exp(2j * np.pi * f * loop.period)
    position, velocity, summed = loop.paths(f)
    law = m.velocity_gain + m.velocity_integral * summed
    closed = 1.0 / (1.0 + law * (m.position_gain * position + velocity))
    one, read = loop.position_sensor, loop.velocity_sensor
    place = law * m.position_gain * z ** -float(one.delay)
    speed = law * z ** -float(read.delay) * (1 - z ** -float(read.velocity_span)) / (read.velocity_span * loop.period)
    speed = speed * loop.velocity_share / (1 - (1 - loop.velocity_share) / z)
    if one is read:
        power = one.resolution**2 * np.mean(np.abs((place + speed) * closed) ** 2)
    else:
        power = sum(e.resolution**2 * np.mean(np.abs(p * closed) ** 2) for e, p in ((one, place), (read, speed)))
    assert count_noise(figures) == pytest.approx(math.sqrt(power / 12.0), rel=1e-6)


@pytest.mark.parametrize(("overrides", "stiffness"), [((), 5750 * 90.4), (PID, 200e3)])
def test_slowly_a_push_is_taken_by_the_integral_stiffness_and_twists_the_coupling(overrides, stiffness):
    spec = detent.load(CASCADE, list(overrides)).spec
    stiffness *= spec.effort_per_command
    told = dict(loop_figures(spec))
    assert told["integral stiffness"] == f"{stiffness / 1e6:.3g} MN/(m*s)"
    pushed = CascadeFigures(spec).loop.open_loop("load")
    twist = 1.0 / spec.mechanics.coupling.stiffness  # the encoder is on the motor
    assert abs(pushed.response(0.1)) == pytest.approx(math.hypot(twist, 0.2 * math.pi / stiffness), rel=2e-2)
    level, at = pushed.peak
    assert abs(pushed.response(0.9 * at)) < level > abs(pushed.response(1.1 * at))


@pytest.mark.compiled
def test_a_push_and_a_step_as_the_simulation_has_them():
    """The push deflects the load by less than its linear model has it: some 20 of 200 N go into friction."""
    spec = detent.load(CASCADE).spec
    push, step = responses(spec)
    assert push.name == "push of 200 N"
    assert "within 5 um after " in push.figures[push.name]
    system = CascadeFigures(spec).loop.open_loop("load")
    x, moved = np.zeros((len(system.a), 1)), []
    for _ in range(1600):
        moved.append(float((system.c @ x)[0, 0]))
        x = system.a @ x + 200.0 * system.b
    assert 0.85 * max(moved) < push.y.max() < 0.95 * max(moved)
    assert push.t[0] == pytest.approx(-0.02, abs=1e-3)
    assert step.share
    assert step.y[-1] == pytest.approx(1.0, abs=0.03)
    assert 1.0 <= step.y.max() < 1.1  # the overshoot that tune bounds, less what friction takes


@pytest.mark.compiled
def test_an_axis_that_turns_says_so():
    told = dict(loop_figures(detent.load(EXAMPLES / "turntable.toml").spec))
    assert told["integral stiffness"].endswith("N*m/(rad*s)")
    push, _ = responses(detent.load(EXAMPLES / "turntable.toml").spec)
    assert push.name == "push of 1 N*m"
