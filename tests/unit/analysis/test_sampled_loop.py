"""Exact sampled model of the filtered servo (filtered-servo spec 3.7); its table of limits: tests/acceptance."""

import subprocess
import sys
from dataclasses import replace
from math import cos, exp, inf, log, pi, sin, sqrt

import numpy as np
import pytest

from detent.analysis.sampled_loop import SampledLoop
from detent.errors import DetentError

CONVENTIONAL = SampledLoop(gain=4000, sample_period=5e-3, scale=4)
FILTERED = replace(CONVENTIONAL, coefficient=0.25)
SMALL_MULTIPLIER = replace(CONVENTIONAL, scale=1)
DAMPED = replace(FILTERED, gain=5329, tau_m=56e-3)
ODD = SampledLoop(gain=900, sample_period=8e-3, scale=3, coefficient=0.4, tau_m=30e-3, position_gain=1.7)

# ------------------------------------------------------------------------------------------------- one window


def test_transition_without_damping_is_the_oscillator_about_what_the_speed_word_asks():
    omega = sqrt(4000)
    c, s = cos(omega * 5e-3), sin(omega * 5e-3)
    plant = np.array([[c, s / omega, c - 1], [-omega * s, c, -omega * s]])
    word = 0.25 * 4 * (plant[0] - [1, 0, 0]) + [0, 0, 0.75]
    assert FILTERED.transition() == pytest.approx(np.array([*plant, word]), rel=1e-12)


def test_command_input_without_damping():
    omega, ts = sqrt(4000), 5e-3
    c, s = cos(omega * ts), sin(omega * ts)
    plant = np.array([[1 - c, ts - s / omega], [omega * s, 1 - c]])
    assert FILTERED.command_input() == pytest.approx(np.array([*plant, 0.25 * 4 * plant[0]]), rel=1e-12)


def test_a_resting_axis_at_its_command_stays():
    for loop in (CONVENTIONAL, FILTERED, DAMPED, ODD):
        at_rest = np.array([1.0, 0.0, 0.0])
        assert loop.transition() @ at_rest + loop.command_input()[:, 0] == pytest.approx(at_rest, abs=1e-12)


def test_eigenvalues_are_those_of_the_transition():
    z = DAMPED.eigenvalues()
    assert np.prod(z) == pytest.approx(np.linalg.det(DAMPED.transition()))
    assert DAMPED.spectral_radius() == max(abs(z))


# ------------------------------------------------------------------------------------------------------ modes


def test_modes_of_the_default_axis():
    """Spec, trap 1: -8.2 ± j88.8 and -28.3 1/s."""
    poles = FILTERED.poles()
    assert poles.real == pytest.approx([-8.2, -8.2, -28.3], abs=0.05)
    assert poles.imag == pytest.approx([88.8, -88.8, 0], abs=0.05)


@pytest.mark.parametrize(
    ("loop", "settled_by"),
    [
        (FILTERED, 0.16),
        (SampledLoop(gain=4000, sample_period=1e-3, scale=20, coefficient=0.25), 0.026),
        (replace(CONVENTIONAL, coefficient=0.5), 0.060),
    ],
    ids=["default", "A·B of 5", "A of 1/2"],
)
def test_ring_out_after_a_stop(loop, settled_by):
    """Spec, trap 1, of an axis that counts, so of an error that stays below 2 counts: linearly, 1 to 2 counts."""
    moving = round(2 / loop.sample_period)
    response = loop.respond([1000.0] * moving + [0.0] * moving, points=10)
    t, error = response.t[10 * moving :] - 2, np.abs(response.following_error[10 * moving :])
    assert t[error > 2][-1] <= settled_by <= t[error > 1][-1]


def test_a_mode_that_alternates_has_half_the_sample_frequency():
    # Little speed feedback on a stiff loop: the plant makes almost half a turn in each window.
    loop = SampledLoop(gain=(0.98 * pi / 5e-3) ** 2, sample_period=5e-3, scale=0.05, tau_m=20e-3)
    alternating = [p for p in loop.poles() if p.imag == pytest.approx(pi / 5e-3)]
    negative = [z for z in loop.eigenvalues() if z.imag == 0 and z.real < 0]
    assert len(alternating) == len(negative) > 0
    assert sorted(p.real for p in alternating) == pytest.approx(sorted(log(-z.real) / 5e-3 for z in negative))


# ------------------------------------------------------------------------------------------- limit of the gain


def test_the_limit_does_not_depend_on_the_gain():
    for loop in (FILTERED, DAMPED):
        assert replace(loop, gain=1.0).stability_limit() == loop.stability_limit()


@pytest.mark.parametrize("loop", [CONVENTIONAL, FILTERED, SMALL_MULTIPLIER, replace(ODD, tau_m=inf)])
def test_the_searched_limit_tends_to_the_closed_form(loop):
    nearly_ideal = replace(loop, tau_m=1e4)
    assert nearly_ideal.stability_limit() == pytest.approx(loop.stability_limit(), rel=1e-4)
    assert nearly_ideal.stability_limit() != loop.stability_limit()


def test_limits_of_the_closed_form():
    """1 - cos(TS·sqrt(K)) is 1/5 for B = 4, 1/8 for B = 4 with A = 1/4, and 1/2 for B = 1, a sixth of a turn."""
    for loop, fall in ((CONVENTIONAL, 1 / 5), (FILTERED, 1 / 8), (SMALL_MULTIPLIER, 1 / 2)):
        assert 1 - cos(5e-3 * sqrt(loop.stability_limit())) == pytest.approx(fall, rel=1e-12)
    assert 5e-3 * sqrt(SMALL_MULTIPLIER.stability_limit()) == pytest.approx(pi / 3, rel=1e-12)


def test_limit_of_an_axis_that_follows_its_drive_at_once():
    """tau_m << TS makes the plant an integrator x' = K·tau_m·(X - x - y); r = K·tau_m·TS.

    x+ = e^-r·x - (1 - e^-r)·y and y+ = B·(x+ - x) have a mode at -1 where 1 - e^-r = 2/(2·B + 1).
    """
    tau_m, ts = 5e-9, 5e-3
    for scale in (4, 400):
        limit = SampledLoop(gain=1, sample_period=ts, scale=scale, tau_m=tau_m).stability_limit()
        assert 1 - exp(-limit * tau_m * ts) == pytest.approx(2 / (2 * scale + 1), rel=1e-5)


def test_a_narrow_range_of_unstable_gains_is_found():
    loop = SampledLoop(gain=1, sample_period=1, scale=0.013, coefficient=0.264, tau_m=1 / 0.01815, position_gain=0.561)
    limit = loop.stability_limit()
    beyond = [replace(loop, gain=limit * factor) for factor in (1.0001, 1.01)]
    assert not beyond[0].is_stable
    assert beyond[1].is_stable  # so the range is narrower than 1 %
    assert replace(loop, gain=limit * 0.9999).is_stable


def test_no_limit_where_the_damping_outweighs_the_speed_feedback():
    loop = SampledLoop(gain=4000, sample_period=5e-3, scale=0.01, tau_m=5e-3)
    assert loop.stability_limit() == inf
    for gain in np.geomspace(1, 1e9, 200):
        assert replace(loop, gain=gain).is_stable


# -------------------------------------------------------------------------------------------------- a command


def test_steady_following_error_of_the_specification():
    assert FILTERED.steady_following_error(1000) == pytest.approx(20)
    assert FILTERED.velocity_error_constant == pytest.approx(50)
    assert FILTERED.steady_following_error(1037) == pytest.approx(20.74)
    assert SMALL_MULTIPLIER.steady_following_error(1000) == pytest.approx(5)
    assert SMALL_MULTIPLIER.velocity_error_constant == pytest.approx(200)
    assert DAMPED.steady_following_error(1000) == pytest.approx(23.35, abs=0.005)
    assert DAMPED.steady_following_error(-1000) == -DAMPED.steady_following_error(1000)


@pytest.mark.parametrize("loop", [CONVENTIONAL, FILTERED, SMALL_MULTIPLIER, DAMPED, ODD])
def test_the_response_to_a_ramp_settles_at_the_steady_following_error(loop):
    response = loop.respond([800.0] * 800, points=3)
    steady = loop.steady_following_error(800)
    assert response.following_error[-30:] == pytest.approx(steady, rel=1e-9)
    assert response.velocity[-1] == pytest.approx(800, rel=1e-9)
    assert response.speed_word[-1] == pytest.approx(800 * loop.scale * loop.sample_period, rel=1e-9)
    assert response.drive_word[-1] == pytest.approx(800 / loop.tau_m / loop.gain, rel=1e-9, abs=1e-7)


def test_the_response_at_the_sample_instants_is_the_recursion_of_the_state():
    rates = [100.0, -300.0, 0.0, 250.0, 250.0]
    response = ODD.respond(rates, step=7.0)
    state, command = np.zeros(3), 7.0
    for k, rate in enumerate([*rates, 0.0]):
        row = [response.position[k], response.velocity[k], response.speed_word[k]]
        assert row == pytest.approx(list(state), rel=1e-9, abs=1e-9)
        assert response.command[k] == pytest.approx(command)
        assert response.t[k] == pytest.approx(k * 8e-3)
        state = ODD.transition() @ state + ODD.command_input() @ [command, rate]
        command += rate * 8e-3


def test_columns_of_a_response_belong_together():
    response = ODD.respond([1000.0] * 20 + [0.0] * 20, step=3.0, points=7)
    assert {len(column) for column in (response.t, response.position, response.drive_word)} == {40 * 7 + 1}
    assert response.following_error == pytest.approx(response.command - response.position)
    assert response.drive_word == pytest.approx(1.7 * response.following_error - response.speed_word)
    assert response.t[-1] == pytest.approx(40 * 8e-3)


def test_instants_within_the_windows_do_not_change_the_sample_instants():
    rates = [1000.0] * 10 + [0.0] * 30
    coarse, fine = DAMPED.respond(rates), DAMPED.respond(rates, points=8)
    for name in ("t", "command", "position", "velocity", "speed_word", "following_error", "drive_word"):
        assert getattr(fine, name)[::8] == pytest.approx(getattr(coarse, name), rel=1e-9, abs=1e-9)
    # Within a window the speed word is held and the position moves on.
    assert np.ptp(fine.speed_word[8:16]) == 0
    assert np.all(np.diff(fine.position[8:16]) > 0)


def test_step_of_the_command_from_rest():
    response = CONVENTIONAL.respond([0.0] * 60, step=1.0, points=100)
    # Nothing is counted in the first window: the axis is an undamped oscillator about the new command.
    t = response.t[:100]
    assert response.position[:100] == pytest.approx(1 - np.cos(sqrt(4000) * t), abs=1e-12)
    assert response.speed_word[99] == 0 < response.speed_word[100]
    assert response.following_error[-1] == pytest.approx(0, abs=1e-9)


def test_speed_word_of_the_example_follows_a_step_of_the_speed():
    """Spec, test 12: 5, 8.75, 11.56, 13.67, 15.25 where the axis runs at 1000 counts per second at once."""
    stiff = SampledLoop(gain=1e9, sample_period=5e-3, scale=1e-4, coefficient=0.25, tau_m=1e-7, position_gain=1e3)
    word = stiff.respond([1000.0] * 5).speed_word[1:] * 4 / 1e-4
    assert word == pytest.approx([5, 8.75, 11.56, 13.67, 15.25], abs=0.01)


@pytest.mark.parametrize(
    ("loop", "low", "high"), [(CONVENTIONAL, -1, 0), (FILTERED, -2, -1), (SMALL_MULTIPLIER, -12, -11)]
)
def test_overshoot_after_a_stop_from_1000_counts_per_second(loop, low, high):
    """Spec, test 21, before rounding to counts: -1..0, -2, -11."""
    response = loop.respond([1000.0] * 400 + [0.0] * 100, points=20)
    assert low < response.following_error[400 * 20 :].min() < high


# -------------------------------------------------------------------------------------------------- bad input


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"gain": -1.0}, r"^SampledLoop.gain: got -1 1/s\^2; expected: above 0 and finite; try: state K = K3\*K4"),
        ({"gain": inf}, r"^SampledLoop.gain: got inf 1/s\^2"),
        ({"sample_period": 0.0}, r"^SampledLoop.sample_period: got 0 s; expected: above 0 and finite; try: state the"),
        ({"scale": float("nan")}, r"^SampledLoop.scale: got nan; expected: above 0 and finite; try: state the scale B"),
        ({"coefficient": 2.0}, r"^SampledLoop.coefficient: got 2; expected: above 0, up to 1; try: state A = TS/Tf"),
        ({"tau_m": 0.0}, r"^SampledLoop.tau_m: got 0 s; expected: above 0 or inf; try: state the mechanical"),
        ({"position_gain": 0.0}, r"^SampledLoop.position_gain: got 0; expected: above 0 and finite; try: state K1"),
    ],
)
def test_constants_that_describe_no_loop_are_refused(wrong, message):
    with pytest.raises(DetentError, match=message):
        SampledLoop(**({"gain": 4000, "sample_period": 5e-3, "scale": 4} | wrong))


@pytest.mark.parametrize("rates", [[], [[1.0, 2.0]], [1.0, inf], [float("nan")]])
def test_commands_without_windows_or_numbers_are_refused(rates):
    with pytest.raises(
        DetentError, match=r"^rates: got .*; expected: one finite number per window, at least one; try: "
    ):
        CONVENTIONAL.respond(rates)


def test_a_response_without_instants_is_refused():
    with pytest.raises(DetentError, match=r"^points: got 0; expected: 1 or more; try: state how many instants"):
        CONVENTIONAL.respond([1.0], points=0)


@pytest.mark.process
def test_scipy_loads_only_when_a_loop_is_computed():
    code = (
        "import sys; from detent.analysis.sampled_loop import SampledLoop; before = 'scipy' in sys.modules; "
        "SampledLoop(gain=4000, sample_period=5e-3, scale=4).is_stable; print(before, 'scipy' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False", "True"]
