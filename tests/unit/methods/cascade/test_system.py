"""The cascade axis as a whole: its samples, its loops against closed forms, and one result however it is run."""

import math

import numpy as np
import pytest
from tests.cascade_rig import (
    MASS,
    SAMPLE_TICKS,
    STIFFNESS,
    T_SAMPLE,
    TICK,
    Rig,
    make_params,
    set_friction,
    unlimited_params,
)

from detent.methods.cascade.system import CascadeParams, fill_clocks, set_count, smoothing
from detent.planning.profile import MotionLimits, plan_move
from detent.sensing.gauge import set_gauge

T = T_SAMPLE
MOVE = MotionLimits(speed=0.5, acceleration=5.0, jerk=100.0)


# -- samples -----------------------------------------------------------------------------------------------------------


def test_the_first_sample_is_at_power_on_and_then_one_every_so_many_ticks():
    rig = Rig(make_params())
    rig.r.controller.reference.position = 1e-3
    run = rig.record(61, ["controller.law.position_error", "plant.machine.load.position"])
    changes = np.flatnonzero(np.diff(run["controller.law.position_error"])) + 1
    assert changes.tolist() == [20, 40, 60]
    assert run["controller.law.position_error"][0] == 1e-3
    assert run["plant.machine.load.position"][0] > 0.0, "it acts in the tick of its sample"


@pytest.mark.parametrize("delay", [0, 1, 3, 63])
def test_the_delay_of_the_amplifier_is_exact(delay):
    p = unlimited_params()
    p.plant.source.delay = delay
    rig = Rig(p)
    run = rig.record(
        (delay + 3) * SAMPLE_TICKS, ["plant.source.output", "plant.machine.load.velocity"], command=[7.0] * 200
    )
    begins = delay * SAMPLE_TICKS
    assert not run["plant.source.output"][:begins].any()
    assert not run["plant.machine.load.velocity"][:begins].any()
    ticks = np.arange(1, 3 * SAMPLE_TICKS + 1)
    assert run["plant.machine.load.velocity"][begins:] == pytest.approx(7.0 / MASS * ticks * TICK, rel=1e-12)


@pytest.mark.parametrize("delay", [0, 1, 7])
def test_the_delay_of_a_sensor_is_exact(delay):
    p = unlimited_params()
    p.controller.motor_sensor.delay = delay
    rig = Rig(p)
    rig.r.plant.machine.motor.velocity = rig.r.plant.machine.load.velocity = 0.1
    names = ["controller.motor_sensor.position", "controller.load_sensor.position"]
    run = rig.record(30 * SAMPLE_TICKS, names, every=SAMPLE_TICKS, command=[0.0])
    motor, load = (run[name] for name in names)
    assert load == pytest.approx(0.1 * T * np.arange(30), abs=1e-15)
    assert np.array_equal(motor[delay:], load[: 30 - delay])
    assert not motor[:delay].any()


def test_commands_of_the_host_end_in_none():
    rig = Rig(unlimited_params())
    run = rig.record(5 * SAMPLE_TICKS, ["plant.source.output"], every=SAMPLE_TICKS, command=[3.0, -2.0, 5.0])
    assert run["plant.source.output"].tolist() == [3.0, -2.0, 5.0, 0.0, 0.0]
    assert rig.r.controller.law.command == 0.0


@pytest.mark.compiled
def test_behind_the_end_of_the_reference_the_axis_is_held_there():
    rig = Rig(make_params())
    move = plan_move(0.0, 0.01, MOVE, T)
    move.velocity[-1] = 0.3  # a recording may end in motion
    run = rig.record(
        1000 * SAMPLE_TICKS,
        ["controller.reference.position", "controller.reference.velocity"],
        SAMPLE_TICKS,
        profile=move,
    )
    assert np.array_equal(run["controller.reference.position"][: move.count], move.position)
    assert (run["controller.reference.position"][move.count :] == 0.01).all()
    assert run["controller.reference.velocity"][move.count - 1] == 0.3
    assert not run["controller.reference.velocity"][move.count :].any()
    assert rig.x == pytest.approx(0.01, abs=1e-9)
    assert rig.r.controller.entry == move.count


def test_the_disturbing_force_acts_in_its_ticks():
    p = unlimited_params()
    p.plant.push.force, p.plant.push.begin, p.plant.push.end = -4.0, 13, 33
    run = Rig(p).record(50, ["plant.machine.load.velocity"], command=[0.0])
    ticks = np.clip(np.arange(1, 51) - 13, 0, 20)
    assert run["plant.machine.load.velocity"] == pytest.approx(-4.0 / MASS * ticks * TICK, rel=1e-12, abs=1e-18)


@pytest.mark.compiled
def test_the_gauge_reads_the_load():
    p = make_params()
    rig = Rig(p)
    set_gauge(rig.r.plant.gauge, 0, 0.0, 0.01, 1e-5)
    rig.r.controller.reference.position = 0.01
    run = rig.record(12_000, ["plant.machine.load.position", "plant.machine.load.velocity"])
    x, v = run["plant.machine.load.position"], run["plant.machine.load.velocity"]
    assert rig.r.plant.gauge.peak_speed == v.max()
    assert rig.r.plant.gauge.beyond == pytest.approx(x.max() - 0.01, abs=1e-18)
    assert rig.r.plant.gauge.outside == np.flatnonzero(np.abs(x - 0.01) > 1e-5)[-1] + 1


# -- loops against closed forms ----------------------------------------------------------------------------------------


@pytest.mark.compiled
def test_the_velocity_loop_is_a_first_order_lag():
    """Position gain 0 and a fast sample: v = v_ref (1 - exp(-t K_v / m))."""
    p = make_params()
    fill_clocks(p, 1e-6, 1)
    p.controller.law.cascade.position_gain, p.controller.law.feed_forward.velocity = 0.0, 1.0
    rig = Rig(p)
    rig.r.controller.reference.velocity = 0.2
    run = rig.record(20_000, ["plant.machine.load.velocity"])
    tau = MASS / p.controller.law.cascade.velocity_gain
    # The difference over a sample is 0.5 us late, the hold of the command another 0.5 us: 0.03 % of 4 ms.
    assert run["plant.machine.load.velocity"] == pytest.approx(-0.2 * np.expm1(-run["t"] / tau), abs=0.2 * 3e-4)


@pytest.mark.compiled
def test_the_position_loop_follows_with_the_error_of_its_gain():
    p = make_params()
    rig = Rig(p)
    speed, n = 0.1, 2000
    ramp = np.arange(n) * T * speed
    ref = plan_move(0.0, 1.0, MOVE, T)
    ramp = type(ref)(T, ramp, np.full(n, speed), np.zeros(n))
    rig.record(n * SAMPLE_TICKS, ["tick"], SAMPLE_TICKS, profile=ramp)
    assert rig.r.controller.law.position_error == pytest.approx(
        speed / p.controller.law.cascade.position_gain, rel=1e-6
    )
    p.controller.law.feed_forward.velocity = 1.0
    rig = Rig(p)
    rig.record(n * SAMPLE_TICKS, ["tick"], SAMPLE_TICKS, profile=ramp)
    assert abs(rig.r.controller.law.position_error) < 1e-6 * speed


@pytest.mark.parametrize("pid", [False, True], ids=["cascade", "pid"])
def test_with_full_feed_forward_a_rigid_axis_follows_nearly_without_error(pid):
    p = make_params()
    if pid:
        p.controller.law.position_pid = 1
        p.controller.law.pid.proportional = (
            p.controller.law.cascade.position_gain * p.controller.law.cascade.velocity_gain
        )
        p.controller.law.pid.derivative = p.controller.law.cascade.velocity_gain
    move = plan_move(0.0, 0.1, MOVE, T)
    errors = []
    for share in (0.0, 1.0):
        p.controller.law.feed_forward.velocity = share
        p.controller.law.feed_forward.acceleration = share * MASS
        run = Rig(p).record(
            (move.count + 100) * SAMPLE_TICKS, ["controller.law.position_error"], SAMPLE_TICKS, profile=move
        )
        errors.append(np.abs(run["controller.law.position_error"]).max())
    assert errors[0] > 5e-3
    # What is left is the hold of the command: a sample of jerk, and half a sample in the measured velocity.
    assert errors[1] < 0.01 * errors[0]


def test_friction_and_weight_fed_forward_leave_the_error_of_the_dead_band():
    p = make_params()
    set_friction(p.plant.machine.motor.friction, coulomb=6.0, viscous=15.0)
    p.plant.machine.weight = 8.0
    move = plan_move(0.0, 0.1, MOVE, T)
    errors = []
    for share in (0.0, 1.0):
        f = p.controller.law.feed_forward
        f.velocity, f.acceleration = 1.0, MASS
        f.viscous, f.weight = share * 15.0, share * 8.0
        f.coulomb_positive = f.coulomb_negative = share * 6.0
        f.dead_band = 1e-3
        run = Rig(p).record(move.count * SAMPLE_TICKS, ["controller.law.position_error"], SAMPLE_TICKS, profile=move)
        errors.append(np.abs(run["controller.law.position_error"]).max())
    assert errors[0] == pytest.approx(
        (6.0 + 15.0 * 0.5 + 8.0) / (2 * math.pi * 10) / p.controller.law.cascade.velocity_gain, rel=0.1
    )
    assert errors[1] < 0.1 * errors[0]


@pytest.mark.compiled
def test_the_integral_takes_the_error_of_the_weight_away():
    p = make_params()
    p.plant.machine.weight = 10.0
    sag = 10.0 / p.controller.law.cascade.velocity_gain / p.controller.law.cascade.position_gain
    assert Rig(p).run(40_000).x == pytest.approx(-sag, rel=1e-6)
    p.controller.law.cascade.integral_gain = p.controller.law.cascade.velocity_gain * 20.0
    rig = Rig(p).run(40_000)
    assert abs(rig.x) < 1e-5 * sag
    assert rig.r.controller.law.integral == pytest.approx(10.0, rel=1e-6)


@pytest.mark.compiled
def test_a_coarse_encoder_leaves_the_axis_within_a_count():
    p = make_params()
    set_count(p, 1e-5, 0.0)
    rig = Rig(p)
    rig.r.controller.reference.position = 0.0123456
    rig.run(40_000)
    assert abs(rig.x - 0.0123456) < 1e-5
    assert rig.r.lines.motor.count in {1234, 1235}


# -- limits ------------------------------------------------------------------------------------------------------------


def release(p: CascadeParams, blocked_ticks: int) -> tuple[float, np.ndarray]:
    """Hold the load by a friction that the motor cannot overcome; then let it go. Integral, and what it does then."""
    set_friction(p.plant.machine.load.friction, coulomb=1e4)
    rig = Rig(p)
    rig.r.controller.reference.position = 0.02
    rig.run(blocked_ticks)
    assert rig.x == 0.0
    held = rig.r.controller.law.integral
    set_friction(p.plant.machine.load.friction, coulomb=0.0)
    return held, rig.record(20_000, ["plant.machine.load.position"])["plant.machine.load.position"]


@pytest.mark.compiled
def test_after_a_stall_of_any_length_the_axis_comes_back_alike():
    p = make_params()
    p.controller.law.max_command = 40.0
    p.controller.law.cascade.integral_gain = p.controller.law.cascade.velocity_gain * 30.0
    p.controller.law.cascade.max_velocity = 0.05
    (held, short), (also_held, long) = release(p, 2_000), release(p, 60_000)
    assert held == also_held < 40.0
    assert np.array_equal(short, long)
    assert short.max() < 0.02 * 1.15
    assert short[-1] == pytest.approx(0.02, abs=2e-4)
    p.controller.law.max_command = math.inf
    wound, free = release(p, 60_000)
    assert wound > 10 * held
    assert free.max() > 5 * short.max()


def test_a_limited_command_moves_the_axis_at_its_limit():
    p = make_params()
    p.controller.law.max_command = 3.0
    rig = Rig(p)
    rig.r.controller.reference.position = 10.0
    rig.run(20_000)
    assert rig.r.controller.law.limited == 1
    assert rig.r.plant.machine.load.velocity == pytest.approx(3.0 / MASS * 20_000 * TICK, rel=1e-9)


def test_the_amplifier_has_its_own_limit_and_steps():
    p = unlimited_params()
    p.plant.source.limit, p.plant.source.step = 2.0, 0.25
    run = Rig(p).record(3 * SAMPLE_TICKS, ["plant.source.output"], SAMPLE_TICKS, command=[1.1, 9.0, -9.0])
    assert run["plant.source.output"].tolist() == [1.0, 2.0, -2.0]


# -- two masses --------------------------------------------------------------------------------------------------------


@pytest.mark.compiled
def test_the_position_loop_on_the_load_takes_backlash_out_of_the_load():
    """On the motor's encoder the load is behind by half the gap and its strain; what friction costs both have."""
    ends = []
    for on_load in (0, 1):
        p = make_params(coupled=True, gap=4e-4)
        p.controller.feedback.position_on_load = on_load
        p.controller.law.cascade.position_gain = 10.0
        set_friction(p.plant.machine.load.friction, coulomb=0.3)
        rig = Rig(p)
        rig.r.controller.reference.position = 0.01
        rig.run(60_000)
        ends.append(rig.x - 0.01)
    sag = 0.3 / p.controller.law.cascade.velocity_gain / 10.0
    assert ends == pytest.approx([-2e-4 - sag - 0.3 / STIFFNESS, -sag], rel=1e-6)


def test_the_velocity_loop_on_the_load_swings_up_where_that_on_the_motor_does_not():
    """The coupling is between drive and sensor then: the reason why velocity is measured at the motor."""
    peaks = []
    for on_load in (0, 1):
        p = make_params(coupled=True)
        p.controller.feedback.velocity_on_load = on_load
        p.plant.machine.damping = 2.0
        rig = Rig(p)
        rig.r.controller.reference.position = 1e-3
        run = rig.record(20_000, ["plant.machine.load.velocity"])
        peaks.append(np.abs(run["plant.machine.load.velocity"][-2000:]).max())
    assert peaks[0] < 1e-3
    assert peaks[1] > 1.0


# -- what the clocks depend on -----------------------------------------------------------------------------------------


def test_smoothing_of_a_filter():
    assert smoothing(0.0, T) == 1.0
    assert smoothing(5e-3, T) == pytest.approx(1.0 - math.exp(-0.2), rel=1e-14)


def test_clocks_are_filled_everywhere():
    p = make_params()
    fill_clocks(p, 1e-5, 25)
    assert (p.plant.machine.period, p.controller.sample_ticks) == (1e-5, 25)
    assert p.controller.law.period == p.controller.motor_sensor.period == p.controller.load_sensor.period == 25e-5


@pytest.mark.parametrize(
    ("path", "value", "text"),
    [
        ("plant.source.delay", 64, "delay of the amplifier 64 samples, must be 0 to 63"),
        ("plant.source.delay", -1, "delay of the amplifier -1 samples"),
        ("controller.motor_sensor.span", 0, "motor sensor: span 0"),
        ("controller.load_sensor.delay", 63, "load sensor: span 1 and delay 63"),
        ("plant.machine.half_gap", 1e-4, r"half gap 0\.0001 m of a rigid coupling"),
        ("plant.machine.stiffness", 1e9, r"tick 5e-05 s, must be 2\.19e-05 s or less"),
    ],
)
def test_what_cannot_run_is_refused(path, value, text):
    p = make_params()
    *blocks, name = path.split(".")
    owner = p
    for block in blocks:
        owner = getattr(owner, block)
    setattr(owner, name, value)
    with pytest.raises(ValueError, match=text):
        fill_clocks(p, TICK, SAMPLE_TICKS)


@pytest.mark.parametrize(("tick", "ticks"), [(0.0, 1), (TICK, 0)])
def test_clocks_that_do_not_run_are_refused(tick, ticks):
    with pytest.raises(ValueError, match="must be above 0 and 1 or more"):
        fill_clocks(make_params(), tick, ticks)
