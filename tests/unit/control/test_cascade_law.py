import math

import pytest

from detent.control.cascade_law import CascadeLaw, CascadeLawParams, CascadeReference, control

T = 1e-3


def law(**changes: float) -> CascadeLawParams:
    """Cascade of 20 1/s over 300 V.s/m; names of gains and of the feedforward are unique."""
    p = CascadeLawParams(period=T, max_command=math.inf)
    p.cascade.position_gain, p.cascade.velocity_gain, p.cascade.max_velocity = 20.0, 300.0, math.inf
    p.pid.smoothing = 1.0
    for path, value in changes.items():
        block, _, name = path.rpartition("__")
        setattr(getattr(p, block) if block else p, name, value)
    return p


def reference(position: float = 0.0, velocity: float = 0.0, acceleration: float = 0.0) -> CascadeReference:
    return CascadeReference(position=position, velocity=velocity, acceleration=acceleration)


def test_position_p_over_velocity_p():
    p, r = law(), CascadeLaw()
    control(p, r, reference(1.0), 0.75, 0.125)
    assert r.position_error == 0.25
    assert r.velocity_error == 20.0 * 0.25 - 0.125
    assert r.command == 300.0 * (20.0 * 0.25 - 0.125)
    assert (r.integral, r.limited) == (0.0, 0)


def test_velocity_pi_integrates_the_velocity_error():
    p, r = law(cascade__integral_gain=5000.0), CascadeLaw()
    for k in range(1, 6):
        control(p, r, reference(0.01), 0.0, 0.1)
        assert r.integral == pytest.approx(k * 5000.0 * T * 0.1, rel=1e-12)
        assert r.command == pytest.approx(300.0 * 0.1 + r.integral, rel=1e-12)


@pytest.mark.parametrize("sign", [1, -1])
def test_the_velocity_demand_is_limited_with_its_feed_forward(sign):
    p, r = law(cascade__max_velocity=0.5, feed_forward__velocity=1.0), CascadeLaw()
    control(p, r, reference(sign * 1.0, sign * 0.25), 0.0, 0.0)
    assert r.velocity_error == sign * 0.5


def test_the_share_of_the_velocity_fed_forward_takes_the_following_error_away():
    p, r = law(feed_forward__velocity=1.0), CascadeLaw()
    control(p, r, reference(1.0, 0.3), 1.0, 0.3)
    assert r.command == 0.0
    p.feed_forward.velocity = 0.5
    control(p, r, reference(1.0, 0.3), 1.0, 0.3)
    assert r.command == pytest.approx(-300.0 * 0.15)


def pid(**changes: float) -> CascadeLawParams:
    gains = {"position_pid": 1, "pid__proportional": 1000.0, "pid__integral": 4000.0, "pid__derivative": 50.0}
    return law(**gains | changes)


@pytest.mark.parametrize("integral", [math.nan, math.inf])
def test_what_is_no_number_is_not_limited_to_one(integral):
    """The guard sees it then; a limit would hide it."""
    p, r = law(), CascadeLaw(integral=integral)
    control(p, r, reference(1.0), 0.5, 0.0)
    assert math.isnan(r.command) or r.command == p.max_command
    assert math.isnan(r.command) == math.isnan(integral)


def test_position_pid():
    p, r = pid(), CascadeLaw()
    control(p, r, reference(1.0), 0.75, 0.125)
    assert r.integral == 4000.0 * T * 0.25
    assert r.command == 1000.0 * 0.25 + 1.0 - 50.0 * 0.125
    control(p, r, reference(1.0), 0.75, 0.125)
    assert r.integral == 2 * 4000.0 * T * 0.25


def test_with_the_velocity_fed_forward_the_derivative_acts_on_the_error():
    p, r = pid(pid__integral=0.0, feed_forward__velocity=1.0), CascadeLaw()
    control(p, r, reference(1.0, 0.5), 1.0, 0.125)
    assert r.command == 50.0 * 0.375


def test_the_derivative_filter_is_of_first_order():
    p, r = pid(pid__integral=0.0, pid__proportional=0.0, pid__smoothing=0.25), CascadeLaw()
    for k in range(1, 20):
        control(p, r, reference(), 0.0, -0.5)
        assert r.command == pytest.approx(50.0 * 0.5 * (1.0 - 0.75**k), rel=1e-12)


def fed(ref: CascadeReference, **constants: float) -> float:
    """Feedforward on its own: reference and measurement agree."""
    p, r = law(**{"feed_forward__" + name: value for name, value in constants.items()}), CascadeLaw()
    p.cascade.velocity_gain = 0.0
    control(p, r, ref, ref.position, ref.velocity)
    assert r.command == r.feed_forward
    return r.command


def test_feed_forward_of_acceleration_and_viscous_friction():
    assert fed(reference(0.0, 0.5, -3.0), acceleration=2.0) == -6.0
    assert fed(reference(0.0, 0.5, -3.0), viscous=7.0) == 3.5


@pytest.mark.parametrize(
    ("velocity", "command"), [(0.02, 1.5), (0.0101, 1.5), (0.01, 0.0), (0.0, 0.0), (-0.01, 0.0), (-0.0101, -2.5)]
)
def test_feed_forward_of_coulomb_friction_has_a_dead_band_and_two_directions(velocity, command):
    assert fed(reference(0.0, velocity), coulomb_positive=1.5, coulomb_negative=2.5, dead_band=0.01) == command


def test_feed_forward_of_the_weight():
    assert fed(reference(), weight=9.0) == 9.0
    assert fed(reference(math.pi / 6), pendulum=4.0, weight=1.0) == pytest.approx(3.0)
    assert fed(reference(-math.pi / 2), pendulum=4.0) == pytest.approx(-4.0)


LAWS = {
    "cascade": ({"cascade__integral_gain": 5000.0}, 0.002),
    "pid": ({"position_pid": 1, "pid__proportional": 50.0, "pid__integral": 4000.0}, 0.002),
}


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("name", LAWS)
def test_at_the_limit_the_integral_does_not_wind_up(name, sign):
    changes, error = LAWS[name]
    p, r = law(max_command=15.0, **changes), CascadeLaw()
    away = reference(sign * error)
    for _ in range(20_000):
        control(p, r, away, 0.0, 0.0)
        assert abs(r.command) <= 15.0
    assert (r.command, r.limited) == (sign * 15.0, 1)
    stopped = r.integral
    control(p, r, away, 0.0, 0.0)
    assert r.integral == stopped
    assert abs(stopped) <= 15.0
    control(p, r, reference(-sign * error), 0.0, 0.0)
    assert abs(r.integral) < abs(stopped), "back it integrates at once"
    assert r.limited == 0


def test_at_the_limit_an_error_the_other_way_still_integrates():
    """Otherwise a loop whose proportional part alone is beyond the limit would never leave it."""
    p, r = law(max_command=1.0, cascade__integral_gain=5000.0, feed_forward__weight=100.0), CascadeLaw()
    for k in range(1, 4):
        control(p, r, reference(), 0.001, 0.0)
        assert (r.command, r.limited) == (1.0, 1)
        assert r.integral == pytest.approx(-k * 5000.0 * T * 0.02)


def test_one_law_is_used_and_not_the_other():
    p, r = pid(), CascadeLaw()
    control(p, r, reference(1.0), 0.75, 0.125)
    before = r.command
    p.cascade.velocity_gain = p.cascade.integral_gain = 1e6
    r = CascadeLaw()
    control(p, r, reference(1.0), 0.75, 0.125)
    assert r.command == before
    p.position_pid, p.cascade.velocity_gain, p.cascade.integral_gain = 0, 0.0, 0.0
    control(p, CascadeLaw(), reference(1.0), 0.75, 0.125)
    r = CascadeLaw()
    control(p, r, reference(1.0), 0.75, 0.125)
    assert r.command == 0.0


@pytest.mark.parametrize("structure", [{"cascade__integral_gain": 5000.0}, {"position_pid": 1, "pid__integral": 4e4}])
@pytest.mark.parametrize("sign", [1, -1])
def test_the_integral_of_an_axis_at_rest_holds_still_within_the_dead_band(structure, sign):
    p, r = law(dead_band=1e-6, standing=1e-4, **structure), CascadeLaw(integral=0.25)
    for error, velocity, speed, holds in (
        (1e-6, 0.0, 0.0, True), (0.5e-6, 0.99e-4, 0.0, True), (0.0, -0.5e-4, 0.0, True),
        (1.01e-6, 0.0, 0.0, False), (0.5e-6, 1e-4, 0.0, False), (0.5e-6, 0.0, 1e-9, False),
    ):  # fmt: skip
        before, r.velocity_error = r.integral, 0.0
        control(p, r, reference(sign * error, sign * speed), 0.0, sign * velocity)
        assert (r.integral == before) == holds
        # Everything else acts as it would without a band.
        free = CascadeLaw(integral=before)
        control(law(**structure), free, reference(sign * error, sign * speed), 0.0, sign * velocity)
        assert r.command - r.integral == pytest.approx(free.command - free.integral, rel=1e-12, abs=1e-15)
