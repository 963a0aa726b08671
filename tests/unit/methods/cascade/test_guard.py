"""What the controller looks after: faults in the sample that shows them, arrival, and peaks that the host clears."""

import math

import numpy as np
import pytest
from tests.cascade_rig import SAMPLE_TICKS, Rig, make_params

import detent
from detent.control.guard import FOLLOWING, NO_ARRIVAL, NO_NUMBER, REVERSED, SATURATED, TRAVEL, await_arrival
from detent.methods.cascade.build import motion_limits
from detent.methods.cascade.controller import (
    ARRIVED,
    FAULT,
    CascadeController,
    CascadeControllerParams,
    look_after,
    note_peaks,
)
from detent.methods.cascade.host import CascadeHost
from detent.methods.load import load_spec
from detent.planning.profile import MotionLimits, plan_move


def guarded(**times):
    """A controller at rest within its limits, and its parameters."""
    p, c = CascadeControllerParams(), CascadeController()
    p.limits.following_error, p.limits.window, p.limits.breaking = 1e-2, 1e-4, math.inf
    p.limits.lowest, p.limits.highest, p.limits.arrival = -1.0, 1.0, 5
    p.guard.following, p.guard.travel = 1, 1
    for name, value in times.items():
        setattr(p.guard, name, value)
    c.guarded = c.known = c.on = 1
    return p, c


def test_what_is_no_number_switches_off():
    p, c = guarded()
    look_after(p, c, 0)
    assert (c.event, c.on) == (0, 1)
    c.law.position_error = math.nan
    look_after(p, c, 0)
    assert (c.event, c.on, c.guard.code) == (FAULT, 0, NO_NUMBER)
    p, c = guarded()
    c.law.position_error = 2e-2
    look_after(p, c, 0)
    assert (c.event, c.on, c.guard.code) == (FAULT, 0, FOLLOWING)


@pytest.mark.parametrize(("place", "side"), [(-1.1, -1), (1.1, 1)])
@pytest.mark.parametrize("on_load", [0, 1])
def test_an_end_is_passed_where_the_chosen_encoder_says_so(place, side, on_load):
    p, c = guarded()
    p.limits.place_on_load = on_load
    (c.motor_sensor if on_load else c.load_sensor).position = place
    look_after(p, c, 0)
    assert c.guard.code == 0
    (c.load_sensor if on_load else c.motor_sensor).position = place
    look_after(p, c, 0)
    assert (c.event, c.guard.code, c.guard.side) == (FAULT, TRAVEL, side)


def test_an_end_says_nothing_while_the_position_is_not_known():
    p, c = guarded()
    c.known = 0
    c.motor_sensor.position = -2.0
    look_after(p, c, 0)
    assert (c.event, c.guard.code) == (0, 0)


def test_the_first_fault_stays():
    p, c = guarded()
    c.motor_sensor.position = -2.0
    look_after(p, c, 0)
    c.law.position_error = 1.0
    look_after(p, c, 0)
    assert c.guard.code == TRAVEL


def test_saturation_is_a_fault_once_it_has_lasted():
    p, c = guarded(saturated=4)
    events = []
    for limited in (1, 1, 1, 0, 1, 1, 1, 1):
        c.law.limited = limited
        look_after(p, c, 0)
        events.append(c.event)
    assert events == [0] * 7 + [FAULT]
    assert c.guard.code == SATURATED


def test_an_axis_is_in_position_once_its_error_has_been_small_for_long_enough():
    p, c = guarded()
    look_after(p, c, 0)
    await_arrival(c.guard, 100)
    c.law.position_error = 1e-3
    look_after(p, c, 0)
    c.law.position_error = 1e-5
    for event in (0, 0, 0, 0, ARRIVED):
        look_after(p, c, 0)
        assert c.event == event
    assert c.on == 1
    c.event = 0
    look_after(p, c, 0)
    assert c.event == 0, "it is told once"


def test_a_fault_comes_before_the_arrival():
    p, c = guarded()
    p.limits.arrival = 1
    await_arrival(c.guard, 100)
    c.motor_sensor.position = 9.0
    look_after(p, c, 0)
    assert (c.event, c.guard.code) == (FAULT, TRAVEL)


def test_who_does_not_arrive_in_time_has_a_fault():
    p, c = guarded()
    c.law.position_error = 1e-3
    await_arrival(c.guard, 3)
    for event in (0, 0, FAULT):
        look_after(p, c, 0)
        assert c.event == event
    assert (c.guard.code, c.on) == (NO_ARRIVAL, 0)


def test_peaks_are_the_largest_magnitudes():
    c = CascadeController()
    for error, command, limited in ((0.1, -2.0, 0), (-0.3, 1.0, 1), (math.nan, 1.0, 1)):
        c.law.position_error, c.law.command, c.law.limited = error, command, limited
        note_peaks(c)
    assert (c.peaks.following, c.peaks.command, c.peaks.limited) == (0.3, 2.0, 2)


def test_a_fault_takes_the_command_away_in_its_sample_and_the_axis_waits_for_its_host():
    p = make_params()
    p.controller.limits.following_error, p.controller.guard.following = 1e-3, 1
    p.controller.limits.breaking = math.inf
    rig = Rig(p)
    rig.r.controller.guarded = 1
    rig.r.controller.reference.position = 2e-3
    run = rig.record(10 * SAMPLE_TICKS, ["lines.enable", "lines.command", "controller.law.command"])
    assert len(run["t"]) == rig.r.tick == 1
    assert (run["lines.enable"][0], run["lines.command"][0]) == (0, 0.0)
    assert run["controller.law.command"][0] != 0.0
    assert rig.r.controller.event == FAULT
    rig.r.controller.event = 0
    rig.run(3 * SAMPLE_TICKS)
    assert rig.x == 0.0


@pytest.mark.compiled
@pytest.mark.parametrize("way", [-1, 1], ids=["lower", "upper"])
def test_an_end_is_passed_in_the_sample_in_which_the_encoder_shows_it(way):
    """The guard knows what its encoder read at the sample, behind the true load by counts and twist.

    A judge of the true load at the end of a sample would have seen it one sample earlier at most: the load is beyond
    the end there by less than what it moves in a sample, a count, and the twist.
    """
    spec = load_spec(
        detent.example("cascade.toml"),
        ["limits.lowest=0 m", "limits.travel=100 mm", "mechanics.start_position=50 mm", "method.following_error=10 m"],
    )
    host, limits = CascadeHost(spec), spec.limits
    end = spec.highest + spec.method.in_position if way > 0 else limits.lowest - spec.method.in_position
    move = plan_move(0.05, 0.05 + way * 0.08, motion_limits(spec), host.period)
    host.follow(move)
    seen = host.watch(move.count)
    assert host.controller.guard.code == TRAVEL
    assert host.controller.guard.side == way
    passed = host.controller.samples
    rows = seen[: passed - 1]
    beyond = way * (rows["plant.machine.load.position"] - end)
    shown = way * (rows["controller.motor_sensor.position"] - end)
    assert (shown <= 0.0).all(), "no sample before showed it"
    # By the speed, a sample of it; by stiffness and force, the twist; and a count.
    force = np.abs(rows["controller.law.command"]).max() * spec.effort_per_command
    assert spec.mechanics.coupling is not None
    slack = limits.speed * host.period + force / spec.mechanics.coupling.stiffness + spec.encoder.resolution
    assert beyond.max() < slack


@pytest.mark.compiled
@pytest.mark.parametrize("pieces", [(1,), (1, 7, 13, 40)], ids=["whole", "cut"])
def test_a_blocked_load_is_a_following_error_in_the_same_sample_every_time(pieces):
    spec = load_spec(detent.example("cascade.toml"), ["method.following_error=1 mm"])
    host = CascadeHost(spec)
    host.follow(plan_move(spec.mechanics.start_position, 0.4, MotionLimits(0.1, 5.0, 200.0), host.period))
    assert host.pass_samples(round(1.0 / host.period)) == 0
    blocked = host.params.plant.machine.load.friction
    for direction in (blocked.positive, blocked.negative):
        direction.coulomb = direction.static = 1e6
    event, count = 0, 0
    while not event:
        event = host.pass_samples(pieces[count % len(pieces)])
        count += 1
    # At 100 mm/s the reference is 1 mm ahead after 40 samples of 0.25 ms; in some more the coupling still gave way.
    assert (event, host.controller.guard.code) == (FAULT, FOLLOWING)
    assert host.controller.samples == 4000 + 44


@pytest.mark.compiled
@pytest.mark.parametrize(
    "changes",
    [
        (),
        ("mechanics.coupling.stiffness=6 N/um", "mechanics.coupling.backlash=40 um"),
        ("mechanics.coupling.stiffness=600 N/um",),
        ("encoder.delay=2",),
        ("load_encoder.resolution=1 um", "mechanics.coupling.stiffness=6 N/um"),
    ],
    ids=["screw", "soft", "stiff", "late", "load"],
)
def test_an_end_is_seen_as_late_as_the_sample_the_count_and_the_twist_make_it(changes):
    """The calculation stands in docs/explanation/cascade-axis.md."""
    push = ("disturbance.push.force=-2000 N", "disturbance.push.at=10 ms", "disturbance.push.duration=1 s")
    spec = load_spec(detent.example("cascade.toml"), [*push, "mechanics.start_position=1 mm", *changes])
    host = CascadeHost(spec)
    load = host.watch(400)["plant.machine.load.position"]
    assert host.controller.guard.code == TRAVEL
    passed = int(np.argmax(load < spec.limits.lowest - spec.method.in_position))
    late = host.controller.samples - (passed + 1)
    step, way = load[passed - 1] - load[passed], 0.5 * spec.encoder.resolution
    coupling = spec.mechanics.coupling
    assert coupling is not None
    if spec.load_encoder is None:
        force = (2000.0 * spec.motor_mass + spec.largest_effort * spec.mechanics.load_mass) / spec.mass
        way += 2.0 * force / coupling.stiffness + coupling.backlash
    assert 1 + spec.encoder.delay <= late <= 1 + spec.encoder.delay + math.ceil(way / step)


@pytest.mark.compiled
@pytest.mark.parametrize("resolution", ["1 um", "5 um", "20 um"])
@pytest.mark.parametrize("weight", [0.0, 300.0])
@pytest.mark.parametrize("way", [0.1, -0.01])
def test_a_motor_with_its_leads_exchanged_is_found_before_it_has_gone_far(resolution, weight, way):
    changes = [f"encoder.resolution={resolution}", f"mechanics.weight={weight} N"]
    spec = load_spec(detent.example("cascade.toml"), changes)
    host, start = CascadeHost(spec), spec.mechanics.start_position
    host.params.plant.source.gain *= -1.0
    host.follow(plan_move(start, start + way, motion_limits(spec), host.period))
    load = host.watch(1000)["plant.machine.load.position"]
    assert host.controller.guard.code == REVERSED
    # From rest with all the effort and the weight, for one window; it may take a second one where counts are coarse.
    acceleration, window = (spec.largest_effort + weight) / spec.mass, host.params.controller.guard.reversed
    gone = abs(load[host.controller.samples - 1] - start)
    assert gone < 0.5 * acceleration * (2 * window * host.period) ** 2 < 0.4 * spec.limits.travel
    assert gone < 0.01
