"""The brake of a cascade axis: opened before anything moves, dropped with the torque, and what survives of that."""

import math
from functools import cache

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from tests.acceptance.test_golden_bits import EXAMPLES
from tests.live_bench import Bench

from detent.control import operation as ops
from detent.control.guard import FOLLOWING, JUMPED, SATURATED, STUCK
from detent.methods.cascade.controller import FAULT
from detent.methods.cascade.host import CascadeHost
from detent.methods.cascade.led import LATE, hear, led
from detent.methods.cascade.run import run_cascade_moves
from detent.methods.cascade.wired import machine
from detent.methods.load import load_spec
from detent.methods.moves.job import Move, MoveJob
from detent.methods.registry import METHODS
from detent.operate.faults import injection_of
from detent.operate.host import operation_params
from detent.operate.session import Session
from detent.operate.store import Store
from detent.operate.trust import Trust, Why
from detent.operate.words import why_not_moving
from detent.planning.profile import MotionLimits, plan_move

pytestmark = pytest.mark.compiled

HELD = ("brake.force=1 kN",)
SLOW = (*HELD, "brake.open_time=300 ms")
HEAVY = ("mechanics.weight=150 N", "method.feed_forward.weight=1")


@cache
def spec(*overrides):
    return load_spec(EXAMPLES / "cascade.toml", overrides)


def bench(*overrides, **more):
    made = Bench("cascade", *overrides, **more)
    made.host.run_until_ready()
    return made


def lines(made):
    return made.host.axis.state.lines


def plant(made):
    return made.host.axis.state.plant


def opened(made):
    """Periods from asking to enable until operation is enabled, and the places commanded in them."""
    asked, places = made.host.ask(ops.ENABLE), []
    while made.host.state != "operation enabled":
        made.host.run(1)
        places.append(made.answer.commanded)
        assert len(places) < 1000
    made.host.run(1)
    assert made.host.ending(asked).how == ops.DONE
    return places


# ---- enabling


@pytest.mark.parametrize("time", [0.06, 0.3, 0.0])
def test_operation_is_enabled_once_the_brake_is_open(time):
    made = bench(*HELD, f"brake.open_time={time:g} s")
    closed = plant(made).brake
    assert (lines(made).brake, closed.closed) == (0, 1)
    places = opened(made)
    assert closed.closed == 0
    assert time * 1e3 <= len(places) <= time * 1e3 + 3
    assert set(places) == {made.answer.commanded}
    assert made.do(ops.MOVE_BY, 0.01).how == ops.DONE


def test_torque_comes_first_and_with_it_the_line():
    made = bench(*SLOW)
    asked = made.host.ask(ops.ENABLE)
    made.host.run(1)
    assert (lines(made).enable, lines(made).brake, plant(made).brake.closed) == (1, 1, 1)
    assert made.host.state == "switched on"
    made.host.run(100)
    assert made.host.ending(asked) is None
    assert made.do(ops.MOVE_BY, 0.01).why == ops.NOT_ENABLED
    assert made.answer.commanded_velocity == 0.0


def test_an_axis_that_was_stopped_while_it_opened_is_not_enabled():
    made = bench(*SLOW)
    asked = made.host.ask(ops.ENABLE)
    made.host.run(100)
    made.host.stop()
    made.host.run(2)
    assert (made.host.ending(asked).how, made.host.state) == (ops.ABORTED, "ready to switch on")
    assert (lines(made).enable, lines(made).brake) == (0, 0)
    made.pass_time(1.0)
    assert made.host.state == "ready to switch on"


def test_each_time_it_is_enabled_the_brake_has_its_time():
    made = bench(*SLOW)
    opened(made)
    made.host.off()
    made.host.run(1)
    assert len(opened(made)) >= 300


def test_what_it_waits_for_is_told():
    made = bench(*SLOW)
    made.host.ask(ops.ENABLE)
    made.host.run(5)
    session = Session(made.host, {})
    told = why_not_moving(session.status())
    assert [why for why, _ in told] == ["its brake is opening"]
    made.pass_time(0.4)
    assert "its brake is opening" not in [why for why, _ in why_not_moving(session.status())]


# ---- it drops with the torque


@pytest.mark.parametrize("phase", ["opening", "at rest", "under way", "stopping", "quick stop"])
def test_off_takes_torque_and_line_in_the_same_period(phase):
    made = bench(*SLOW)
    if phase == "opening":
        made.host.ask(ops.ENABLE)
    else:
        made.enable()
    if phase in ("under way", "stopping", "quick stop"):
        made.host.ask(ops.MOVE_BY, 0.05)
        made.pass_time(0.06)
    if phase == "stopping":
        made.host.stop()
    if phase == "quick stop":
        made.host.ask(ops.ORDER, 5.0)
    made.host.run(2)
    assert (lines(made).enable, lines(made).brake) == (1, 1)
    made.host.off()
    made.host.run(1)
    assert (lines(made).enable, lines(made).brake) == (0, 0)
    made.pass_time(0.045)
    assert plant(made).brake.closed == 1


def test_a_fault_takes_torque_and_line_in_the_same_sample():
    host = CascadeHost(spec(*HELD))
    host.follow(plan_move(0.02, 0.3, MotionLimits(0.3, 5.0, 200.0), host.period))
    wires, event = host.state.lines, 0
    for k in range(4000):
        assert (wires.enable, wires.brake) == (1, 1)
        host.state.plant.machine.motor.position += 0.02 * (k >= 400)  # its encoder jumps
        event = host.pass_samples(1)
        assert wires.enable == wires.brake
        if event:
            break
    assert event == FAULT
    assert wires.brake == 0


def test_a_live_fault_drops_it_and_a_reset_does_not_open_it():
    made = bench(*HELD).enable()
    made.host.ask(ops.MOVE_BY, 0.2, 0.5)
    made.pass_time(0.2)
    assert (lines(made).enable, lines(made).brake) == (1, 1)
    made.host.ask(*injection_of(made.host.axis.places, "encoder garbage"))
    seen = []
    for _ in range(100):
        made.host.run(1)
        seen.append((lines(made).enable, lines(made).brake))
    assert set(seen) <= {(1, 1), (0, 0)}
    assert made.host.state == "fault"
    assert made.operation.fault in (FOLLOWING, JUMPED)
    made.host.ask(*injection_of(made.host.axis.places, "nothing"))
    assert made.do(ops.RESET).how == ops.DONE
    made.host.run(10)
    assert (lines(made).brake, plant(made).brake.closed) == (0, 1)


def test_a_ramp_goes_before_the_brake():
    """A fault that is ridden out, then torque off: the brake falls when the axis rests."""
    made = bench(*HELD).enable()
    made.host.ask(ops.MOVE_BY, 0.2)
    made.pass_time(0.2)
    made.loop.delay_at, made.loop.delay = made.loop.periods + 1, 6 * made.loop.period
    speeds = []
    for _ in range(500):
        made.host.run(1)
        if not lines(made).brake:
            speeds.append(abs(plant(made).machine.motor.velocity))
    assert made.host.state == "fault"
    assert max(speeds, default=0.0) < 1e-3


# ---- what it holds


def test_a_load_that_is_pushed_stands_with_the_brake_while_it_is_off_and_runs_away_without():
    push = ("disturbance.push.force=150 N", "disturbance.push.at=10 ms", "disturbance.push.duration=10 s")
    ways = []
    # Its coupling passes on twice the force when the push begins.
    for brake in (("brake.force=400 N",), ("brake.force=100 N",), ()):
        made = bench(*push, *brake)
        begin = plant(made).machine.motor.position
        made.pass_time(0.3)
        ways.append(plant(made).machine.motor.position - begin)
        assert not lines(made).enable
    assert ways[0] == 0.0
    assert 0.001 < ways[1] < ways[2]
    assert ways[2] > 0.05


def test_a_hanging_load_is_taken_over_by_the_loops_before_the_brake_opens():
    made = bench(*HEAVY, *HELD)
    begin = plant(made).machine.load.position
    made.pass_time(0.5)
    opened(made)
    made.pass_time(0.3)
    assert abs(plant(made).machine.load.position - begin) < made.spec.method.in_position
    assert made.operation.fault == 0


@pytest.mark.parametrize("command", [0.99, 2.0])
def test_the_guard_says_nothing_of_an_effort_against_the_brake_while_it_opens(command):
    """Effort that would break the axis loose, and at its limit."""
    made = bench(*SLOW, "protection.saturation_time=50 ms", "protection.stuck_time=50 ms")
    controller, limits = made.host.axis.state.controller, made.host.axis.params.controller.limits
    made.host.ask(ops.ENABLE)
    made.host.run(3)
    controller.law.integral = command * made.spec.largest_command
    made.pass_time(0.25)
    assert controller.law.command > limits.breaking
    assert controller.law.limited == (command > 1.0)
    assert made.operation.fault == 0
    controller.law.integral = 0.0
    made.pass_time(0.2)
    assert (made.operation.fault, made.host.state) == (0, "operation enabled")


@pytest.mark.parametrize("how", ["off", "stuck"])
def test_a_brake_that_does_not_open_is_found(how):
    made = bench(*HELD)
    made.host.ask(*injection_of(made.host.axis.places, f"brake {how}"))
    made.host.run(2)
    assert made.do(ops.ENABLE).how == ops.DONE
    assert (lines(made).enable, plant(made).brake.closed) == (1, 1)
    begin = plant(made).machine.motor.position
    ended = made.do(ops.MOVE_BY, 0.1)
    assert (ended.how, ended.why) in [(ops.FAILED, code) for code in (STUCK, SATURATED, FOLLOWING)]
    assert plant(made).machine.motor.position == begin
    assert not lines(made).enable


def test_without_a_brake_there_is_no_place_for_its_fault():
    assert "brake" not in bench().host.axis.places


# ---- what is said of it


def test_a_rotary_axis_has_a_torque():
    turntable = load_spec(EXAMPLES / "turntable.toml", ("brake.force=2 N*m",))
    assert turntable.brake.force == 2.0
    assert CascadeHost(turntable).params.plant.brake.force == 2.0


# ---- what survives


def stored(folder, *overrides):
    path = folder / "axis.state"
    return bench(*overrides, store=Store(path, METHODS["cascade"].sensors(spec(*overrides))[""])), path


@pytest.mark.parametrize(("brake", "trust", "why"), [(HELD, "RESTORED", "PARKED"), ((), "UNKNOWN", "NOT_HELD")])
def test_a_position_survives_where_a_brake_holds_the_axis(tmp_path, brake, trust, why):
    made, path = stored(tmp_path, *brake)
    made.enable()
    assert made.do(ops.MOVE_BY, 0.05).how == ops.DONE
    made.host.off()
    made.pass_time(0.5)
    counts = made.host.keeper.place
    made.host.close()
    with Store(path, METHODS["cascade"].sensors(spec(*brake))[""]) as store:
        judged = store.restore(None)
        assert (judged.trust, judged.why) == (Trust[trust], Why[why])
        assert judged.counts == (counts if brake else None)


def test_an_axis_whose_brake_opens_is_not_parked(tmp_path):
    made, _ = stored(tmp_path, *SLOW)
    made.pass_time(0.3)
    assert not made.host.keeper.store.saved.moving
    made.host.ask(ops.ENABLE)
    for _ in range(28):
        made.pass_time(0.01)
        made.host.keeper.look()
        assert made.host.state == "switched on"
        assert made.host.keeper.store.saved.moving


@pytest.mark.parametrize(("before", "after"), [((), HELD), (HELD, ())])
def test_an_edit_of_the_brake_keeps_the_store_aside(tmp_path, before, after):
    path, (old, new) = tmp_path / "axis.state", (METHODS["cascade"].sensors(spec(*one))[""] for one in (before, after))
    with Store(path, old) as store:
        store.restore(None)
        store.edit("p", 5000)
    with Store(path, new) as store:
        assert set(store.aside.differs) == {"sensor"}
        assert [one.counts for one in store.aside.positions] == [5000]
        assert store.restore(None).why is Why.NEW


def test_how_strong_and_how_fast_it_is_is_no_other_sensor():
    one, other = (METHODS["cascade"].sensors(spec(*each)) for each in (HELD, ("brake.force=2 kN", *SLOW[1:])))
    assert one == other


# ---- a job


def coasted(*overrides):
    """Way of the load after its drive has gone off at speed."""
    host = CascadeHost(spec("limits.effort=600 N", *overrides))
    host.follow(plan_move(0.02, 0.42, MotionLimits(0.5, 5.0, 200.0), host.period))
    host.pass_samples(2000)
    begin = host.state.plant.machine.load.position
    host.controller.on = 0
    host.pass_samples(4000)
    assert host.state.plant.machine.load.velocity == 0.0 or not overrides
    return host.state.plant.machine.load.position - begin


def test_a_fault_closes_it_and_the_way_to_rest_is_shorter():
    free, slow, fast = coasted(), coasted(*HELD), coasted(*HELD, "brake.close_time=10 ms")
    assert 0.0 < fast < slow < 0.5 * free
    # At 0.5 m/s it closes 30 ms earlier.
    assert slow - fast == pytest.approx(0.5 * 0.03, rel=0.15)


def test_a_run_begins_with_the_brake_open():
    job = MoveJob("job", "moves", (Move(number=1, row=1, target=0.12),))
    held, free = (run_cascade_moves(spec(*one), job) for one in (HELD, ()))
    assert held.done
    assert held.moves == free.moves


@settings(max_examples=15, deadline=None)
@given(
    st.sampled_from([(), ("mechanics.coupling.backlash=20 um",), ("drive.input=voltage", "mechanics.weight=40 N")]),
    st.floats(-0.015, 0.3), st.floats(0.05, 0.5), st.integers(1, 3000),
)  # fmt: skip
def test_a_brake_that_is_open_changes_no_bit_of_any_motion(overrides, way, speed, samples):
    snapshots = []
    for brake in (HELD, ()):
        host = CascadeHost(spec(*overrides, *brake))
        host.follow(plan_move(0.02, 0.02 + way, MotionLimits(speed, 5.0, 200.0), host.period))
        assume(not host.pass_samples(samples))  # a fault would close it
        state = host.state
        state.lines.brake = 0  # which the one without a brake does not set
        snapshots.append(bytes(state))
    assert snapshots[0] == snapshots[1]


# ---- a drive that is elsewhere


def test_a_drive_opens_the_brake_of_its_motor_with_its_own_torque():
    (made, _), = machine(spec(*HELD, "disturbance.push.force=200 N", "disturbance.push.at=0 s",
                              "disturbance.push.duration=10 s")).values()  # fmt: skip
    state, sample = made.state, made.params.plant.machine.period
    begin = state.plant.machine.motor.position

    def pass_time(time):
        for _ in range(math.ceil(time / spec().method.sample_period)):
            made.sample()

    pass_time(0.2)
    assert state.plant.machine.motor.position == begin
    state.lines.enable = 1
    pass_time(0.059)
    assert (state.plant.brake.closed, state.plant.machine.motor.position) == (1, begin)
    pass_time(0.05)
    assert state.plant.brake.closed == 0
    assert state.plant.machine.motor.position > begin + 10 * sample


def test_where_the_loops_are_elsewhere_its_time_counts_by_the_samples_that_were_told_of():
    live, _ = led(spec(*HELD), operation_params(), "position")
    p, c, lines = live.params.controller, live.state.controller, live.state.lines
    assert p.brake.open == c.brake.left == math.ceil(0.06 / spec().method.sample_period) + LATE
    c.on = 1
    for told in (0, 0, 1, 1, 0, 1):
        lines.samples += told
        hear(p, c, lines)
    assert c.brake.left == p.brake.open - 3
    # What is told to the board is its own file: nothing of this margin.
    assert CascadeHost(spec(*HELD)).params.controller.brake.open == p.brake.open - LATE
