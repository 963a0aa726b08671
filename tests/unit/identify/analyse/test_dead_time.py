"""Dead times of simulated axes come back, and a recording that does not hold one says so."""

from functools import cache

import numpy as np
import pytest
from tests.cascade_rig import SAMPLE_TICKS, T_SAMPLE, Rig, make_params, set_friction
from tests.synthetic_responses import noisy_responses, record_cascade

from detent.errors import DetentError
from detent.identify.analyse.measure_response import measure_response
from detent.identify.analyse.resonances import fit_resonances
from detent.identify.analyse.sensors import find_dead_time
from detent.methods.cascade.system import set_count

pytestmark = pytest.mark.compiled


@cache
def record(delay=3, coulomb=0.5, resolution=1e-6, top=20.0):
    """A rigid axis under many sines that do not repeat: times, effort, position."""
    rng = np.random.default_rng(1)
    t = T_SAMPLE * np.arange(16_000)
    effort = sum(np.cos(2 * np.pi * f * t + rng.uniform(0, 6.3)) for f in rng.uniform(0.3, top, 30))
    p = make_params()
    p.plant.source.delay = delay
    set_count(p, resolution, 0.0)
    set_friction(p.plant.machine.load.friction, coulomb=coulomb, static=coulomb, viscous=4.0)
    names = ["plant.source.command", "controller.motor_sensor.position"]
    command = effort * 15 / np.abs(effort).max()
    rows = Rig(p).record(len(t) * SAMPLE_TICKS, names, SAMPLE_TICKS, command=command)
    return rows["t"], rows["plant.source.command"], rows["controller.motor_sensor.position"]


@pytest.mark.parametrize(
    "options",
    [{}, {"delay": 0}, {"delay": 7, "resolution": 1e-5}, {"coulomb": 2.0}, {"top": 60.0}],
    ids=lambda options: ",".join(options) or "plain",
)
def test_a_dead_time_comes_back(options):
    found = find_dead_time(*record(**options))
    delay = options.get("delay", 3)
    assert found.reason == ""
    assert found.to_dict()["whole"] == delay
    assert found.to_dict()["samples"] == pytest.approx(delay, abs=0.04)
    assert found.to_dict()["fraction"] == pytest.approx(found.to_dict()["samples"] - delay)
    assert abs(found.estimate.value - delay * T_SAMPLE) < 3 * found.estimate.error
    assert found.to_dict()["whole"] == delay


def test_a_fraction_of_a_sample():
    """Every fifth sample of a faster recording, taken between two efforts."""
    t, effort, position = record(delay=3, top=20.0)
    found = find_dead_time(t[::5], effort[::5], position[::5], hold=T_SAMPLE)
    assert found.to_dict()["samples"] == pytest.approx(3 / 5, abs=0.05)
    assert found.to_dict()["whole"] == 1


def test_an_effort_that_was_measured_as_it_acts_is_not_held():
    t, effort, position = record()
    held, at_once = (find_dead_time(t, effort, position, hold=hold) for hold in (T_SAMPLE, 0.0))
    assert at_once.estimate.value - held.estimate.value == pytest.approx(T_SAMPLE / 2)


def test_a_motion_that_is_not_of_this_effort_is_doubted():
    t, effort, position = record()
    found = find_dead_time(t, np.roll(effort[::-1], 3000), position)
    assert "% of the effort at best, less than 70%" in found.reason


def test_an_effort_after_its_motion_is_doubted():
    t, effort, position = record()
    found = find_dead_time(t[:-6], effort[:-6], position[6:])
    assert "the motion comes 1.5 ms before its effort, which is not causal" in found.reason


def test_recordings_too_short_are_refused():
    t, effort, position = record()
    with pytest.raises(
        DetentError, match="got 1000 times, 1000 efforts, 1000 positions; expected: as many of each, 1280"
    ):
        find_dead_time(t[:1000], effort[:1000], position[:1000])
    with pytest.raises(DetentError, match="15999 efforts"):
        find_dead_time(t, effort[1:], position)


def test_the_phase_of_a_response_gives_the_dead_time_beside_a_resonance():
    t, effort, position, _ = record_cascade(3, delay=4, resolution=1e-6)
    found = fit_resonances(measure_response(t, effort, position), hold=T_SAMPLE).estimates["delay"]
    assert abs(found.value / T_SAMPLE - 4) < 0.02
    assert abs(found.value - 4 * T_SAMPLE) < 3 * found.error


def test_the_response_of_the_load_alone_gives_none():
    responses, _, hold = noisy_responses(1)
    assert "delay" not in fit_resonances(load=responses[1], hold=hold).estimates
