"""The exact sampled model of a servo for every loop: what it says agrees with the equations it is made of."""

from dataclasses import replace
from math import cos, inf, pi, sqrt

import numpy as np
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from detent.analysis.sampled_loop import SampledLoop


def powers_of_ten(low, high):
    return st.floats(low, high).map(lambda exponent: 10.0**exponent)


@st.composite
def loops(draw, *, ideal=False):
    """Loops of any time scale, from far below the limit of the gain to above it."""
    period, position_gain = draw(powers_of_ten(-4, 0)), draw(powers_of_ten(-1, 1))
    stiffness = draw(powers_of_ten(-3, 1))
    damping = draw(powers_of_ten(-4, 1))
    return SampledLoop(
        gain=stiffness / period**2 / position_gain,
        sample_period=period,
        scale=draw(powers_of_ten(-2, 2)),
        coefficient=draw(st.one_of(st.just(1.0), powers_of_ten(-3, 0))),
        tau_m=inf if ideal or draw(st.booleans()) else period / damping,
        position_gain=position_gain,
    )


@given(
    loop=loops(),
    state=st.tuples(st.floats(-100, 100), st.floats(-100, 100), st.floats(-100, 100)),
    command=st.floats(-100, 100),
    advance=st.floats(-100, 100),
)
def test_the_transition_agrees_with_numerical_integration(loop, state, command, advance):
    """x'' = K·(K1·(X - x) - y) - x'/tau_m over one window, y held, X moving; then y takes up the mean speed."""
    ts = loop.sample_period
    x, per_window, y = state
    start, rate = np.array([x, per_window / ts, y]), advance / ts

    def move(t, xv):
        drive_word = loop.position_gain * (command + rate * t - xv[0]) - y
        return [xv[1], loop.gain * drive_word - xv[1] / loop.tau_m]

    end = solve_ivp(move, (0, ts), start[:2], method="DOP853", rtol=1e-10, atol=[1e-8, 1e-8 / ts]).y[:, -1]
    word = loop.coefficient * loop.scale * (end[0] - x) + (1 - loop.coefficient) * y
    exact = loop.transition() @ start + loop.command_input() @ [command, rate]
    size = 1 + abs(x) + abs(per_window) + abs(y) * (1 + 1 / loop.position_gain) + abs(command) + abs(advance)
    unit = np.array([1, 1 / ts, 1 + loop.scale]) * size
    np.testing.assert_allclose(exact / unit, np.array([*end, word]) / unit, rtol=0, atol=1e-7)


@given(loop=loops(ideal=True), factor=powers_of_ten(-2, 2))
def test_without_damping_the_limit_goes_with_the_inverse_square_of_the_sample_period(loop, factor):
    limit = loop.stability_limit()
    faster = replace(loop, sample_period=loop.sample_period * factor).stability_limit()
    np.testing.assert_allclose(faster * factor**2, limit, rtol=1e-12)
    turn = loop.sample_period * sqrt(loop.position_gain * limit)
    assert 0 < turn <= pi / 2


@given(loop=loops(), fraction=st.floats(0.001, 0.9999))
def test_below_the_limit_every_gain_is_stable_and_just_above_it_none(loop, fraction):
    limit = loop.stability_limit()
    ideal = replace(loop, tau_m=inf).stability_limit()
    assert limit >= ideal * (1 - 1e-9)  # damping never takes gain away
    below = fraction * min(limit, 100 * ideal)
    assert replace(loop, gain=below).spectral_radius() < 1 + 1e-12
    if limit < inf:
        np.testing.assert_allclose(replace(loop, gain=limit).spectral_radius(), 1, rtol=0, atol=1e-7)
        assert replace(loop, gain=limit * (1 + 1e-6)).spectral_radius() > 1 - 1e-12


@given(loop=loops(), rate=st.floats(-1e4, 1e4))
def test_a_steady_motion_goes_on(loop, rate):
    """At constant speed, with the following error of the formula, a window reproduces its beginning."""
    ts, error = loop.sample_period, loop.steady_following_error(rate)
    word = rate * loop.scale * ts
    state = np.array([0.0, rate, word])
    after = loop.transition() @ state + loop.command_input() @ [error, rate]
    unit = np.array([ts, 1, (1 + loop.scale) * ts]) * (abs(rate) + 1e-3) * (1 + loop.gain * ts**2)
    np.testing.assert_allclose((after - [rate * ts, rate, word]) / unit, 0, atol=1e-9)


@given(loop=loops(ideal=True))
def test_modes_of_an_undamped_loop_multiply_to_what_filter_and_window_leave(loop):
    """det = (1 - A) + A·B·(1 - cos(TS·sqrt(K1·K)))/K1, by hand; the plant itself keeps its energy."""
    turn = loop.sample_period * sqrt(loop.position_gain * loop.gain)
    a = loop.coefficient
    by_hand = 1 - a + a * loop.scale * (1 - cos(turn)) / loop.position_gain
    assume(by_hand > 1e-6)
    np.testing.assert_allclose(np.prod(loop.eigenvalues()).real, by_hand, rtol=1e-6)
