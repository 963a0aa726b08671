"""Live specification, section 8: what only one method does, and how it stops. Time is that of the axis, no clock's."""

import math
import random
from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import pytest
from tests.acceptance.test_golden_bits import EXAMPLES
from tests.places import DATA

from detent.control import operation as ops
from detent.control.head_computer import IDLE
from detent.control.operation import ABORTED, DONE, REFERENCED, REFUSED
from detent.control.step_rule import INFEASIBLE
from detent.errors import AxisError, DetentError
from detent.methods.load import load_spec
from detent.methods.print_head.controller import PERIOD_US
from detent.methods.print_head.print_job import load_job
from detent.methods.print_head.run import SimulatedPrinting, print_job
from detent.methods.registry import METHODS
from detent.methods.stepper_envelope.host import StageHost
from detent.methods.stepper_envelope.stage_job import Change, StageMove
from detent.operate.host import Host, repeat
from detent.plant.stepper_rotor import lost_steps

pytestmark = pytest.mark.compiled

STATES = 200  # random ones that an axis is stopped from
PLAIN = ("stepper.group_a.zone.near.speed=20 mm/s", "stepper.group_a.zone.far.speed=20 mm/s")  # one zone: the travel


class Stepper:
    """A motor of the example, enabled, and its first motion confirmed."""

    def __init__(self, *changes: str) -> None:
        self.spec = load_spec(EXAMPLES / "zoom.toml", changes)
        self.host = Host(METHODS["stepper_envelope"], self.spec, motor="group_a", wall=False)
        self.table = self.spec.stepper["group_a"]
        self.state: Any = self.host.axis.state
        self.rule = self.state.controller.rule
        self.answer = self.host.board.operation.answer
        self.host.run(1)
        self.host.ask(ops.ENABLE)
        self.host.ask(ops.CONFIRM)
        self.host.run(2)
        assert self.host.state == "operation enabled"

    def until(self, position: int) -> None:
        """Run until the motor has come to a step boundary."""
        for _ in range(20_000):
            if self.rule.position >= position:
                return
            self.host.run(1)
        raise AssertionError(f"the motor stands at {self.rule.position}")

    def until_rest(self) -> list[int]:
        """Run until it rests; its positions on the way."""
        found = [int(self.rule.position)]
        while len(found) < 20_000:
            self.host.run(1)
            found.append(int(self.rule.position))
            if self.answer.rests:
                return found
        raise AssertionError("the motor does not come to rest")

    def lost(self) -> int:
        """Steps lost, once the rotor has settled."""
        self.host.run(100)
        params: Any = self.host.axis.params
        return lost_steps(params.plant.rotor, self.state.plant.rotor)


def test_25_an_end_position_moved_during_a_run_shortens_the_ramp():
    """As specification stepper-envelope 3.6 and its tests 18 and 19; step by step as the simulation of that change."""
    for new, stop in ((6000, 6000), (3300, 3300)):
        axis = Stepper(*PLAIN)
        move = axis.host.ask(ops.MOVE_TO, 0.04)
        axis.until(3000)
        at = int(axis.rule.position)
        end = axis.host.ask(ops.UPPER, axis.table.position_of(new))
        axis.host.run(1)
        ending = axis.host.ending(move)
        assert ending is not None
        assert (ending.how, ending.by) == (ABORTED, end)
        peak = 0
        while axis.rule.position < new - 230 and not axis.answer.rests:
            peak = max(peak, int(axis.rule.index))
            axis.host.run(1)
        assert new < 4000 or peak == 227  # at full speed up to the new ramp
        axis.until_rest()
        assert axis.rule.position == stop
        simulated = StageHost(axis.spec)
        change = Change(axis.table.position_of(at), axis.table.position_of(new))
        task = StageMove(1, 0, targets={"group_a": 0.04}, change=change)
        assert not simulated.run(task)[1]
        motor = simulated.stage.motors["group_a"]
        assert motor.controller.timer.pulses == axis.state.controller.timer.pulses == stop
        assert axis.lost() == 0
        simulated.stage.pass_time(0.2)
        assert motor.r.plant.rotor.angle == axis.state.plant.rotor.angle
        assert motor.r.plant.rotor.peak_lag == axis.state.plant.rotor.peak_lag


def test_25_an_end_nearer_than_the_motor_can_stop_is_overrun_without_a_lost_step():
    axis = Stepper(*PLAIN)
    axis.host.ask(ops.MOVE_TO, 0.04)
    axis.until(3000)
    at, k = int(axis.rule.position), int(axis.rule.index)
    axis.host.ask(ops.UPPER, axis.table.position_of(3100))
    places = axis.until_rest()
    assert k == 227
    assert axis.rule.position == at + k
    assert places == sorted(places)
    assert axis.host.axis.memory.overruns == 1
    assert axis.lost() == 0
    outward = axis.host.until_ended(axis.host.ask(ops.MOVE_BY, 0.001))
    assert (outward.how, outward.why) == (REFUSED, ops.BEYOND)
    assert axis.host.until_ended(axis.host.ask(ops.MOVE_TO, axis.table.position_of(3100))).how == DONE
    assert axis.rule.position == 3100


def test_25_an_end_moved_outwards_lets_a_jog_rise_again():
    axis = Stepper(*PLAIN)
    axis.host.ask(ops.UPPER, axis.table.position_of(6000))
    jog = axis.host.ask(ops.JOG, 0.02)
    slowest = 0
    for _ in range(4000):
        axis.host.ask(ops.KEEP)
        axis.host.run(1)
        if axis.rule.position >= 5900 and not slowest:
            slowest = int(axis.rule.index)
            axis.host.ask(ops.UPPER, axis.table.position_of(8000))
        if axis.rule.position >= 6050:
            break
    assert 0 < slowest < 120
    assert axis.rule.index > slowest
    for _ in range(700):
        axis.host.ask(ops.KEEP)
        axis.host.run(1)
    assert axis.rule.position == 8000
    assert axis.host.ending(jog) is None
    axis.host.ask(ops.JOG, 0.0, id=jog)
    assert axis.host.until_ended(jog).how == DONE
    assert axis.lost() == 0


def moves(chance: random.Random, lowest: float, highest: float, fastest: float) -> Iterator[tuple[int, float, float]]:
    """Moves and jogs without end: kind, value, share of the speed."""
    while True:
        if chance.random() < 0.6:
            yield ops.MOVE_TO, chance.uniform(lowest, highest), chance.choice((1.0, 1.0, 0.5, 0.15))
        else:
            yield ops.JOG, chance.choice((-1, 1)) * chance.uniform(0.1, 1.0) * fastest, 1.0


def test_14_a_stepper_stops_from_every_state_by_its_ramp():
    axis, chance = Stepper(), random.Random(14)
    host, seen = axis.host, set[int]()
    todo = moves(chance, 0.0, 0.04, 0.02)
    for _ in range(STATES):
        for _ in range(chance.choice((1, 1, 2))):  # the second may find the first under way, and turn it round
            kind, value, share = next(todo)
            host.ask(kind, value, share)
            host.run(chance.randrange(1, 150))
        at, k, direction = int(axis.rule.position), int(axis.rule.index), int(axis.rule.direction)
        seen.add(int(axis.rule.state))
        host.stop()
        places = axis.until_rest()
        steps = [b - a for a, b in pairwise(places)]
        assert all(one * direction >= 0 for one in steps)  # no reversal
        assert abs(places[-1] - at) == max(k, 0)  # by its ramp: an index a step
        assert 0 <= places[-1] <= 8000
        assert host.board.operation.last_stop <= (k + 6) * axis.table.step  # seen from the look before
    assert len(seen) >= 3
    assert axis.rule.cause != INFEASIBLE
    assert axis.lost() == 0


def test_28_a_session_with_moving_ends_repeats_itself():
    """The tables are edited by the loop, and so they are part of what a log repeats."""
    axis, chance = Stepper(), random.Random(28)
    host, todo = axis.host, moves(chance, 0.0, 0.04, 0.02)
    for _ in range(60):
        kind, value, share = next(todo)
        host.ask(kind, value, share)
        host.run(chance.randrange(1, 200))
        host.ask(chance.choice((ops.LOWER, ops.UPPER)), chance.uniform(0.0, 0.04))
        host.run(chance.randrange(1, 100))
        if chance.random() < 0.1:
            host.stop()
    axis.until_rest()
    assert axis.host.axis.memory.overruns > 0
    assert axis.lost() == 0
    again = Host(METHODS["stepper_envelope"], axis.spec, motor="group_a", wall=False)
    repeat(again, host.log, host.board.loop.periods)
    state: Any = again.axis.state
    assert bytes(state) == bytes(axis.state)
    assert [bytes(one) for one in again.axis.feed] == [bytes(one) for one in host.axis.feed]


def test_a_stepper_is_switched_on_and_off():
    axis = Stepper()
    host = axis.host
    assert host.until_ended(host.ask(ops.MOVE_BY, 0.0)).how == DONE  # a null move is done, too
    host.ask(ops.MOVE_TO, 0.01)
    host.run(200)
    assert axis.rule.index > 0
    host.off()
    host.run(1)
    assert axis.state.lines.disable == 1
    assert axis.state.lines.period == 0
    assert host.board.operation.trust == ops.NOT_KNOWN  # the rotor rolls out, and nobody counts it
    pulses = axis.state.controller.timer.pulses
    host.run(200)
    assert axis.state.controller.timer.pulses == pulses
    assert abs(axis.state.plant.rotor.lag) > 1.0
    host.ask(ops.ENABLE)
    host.run(2)
    refused = host.until_ended(host.ask(ops.MOVE_TO, 0.01))
    assert (refused.how, refused.why) == (REFUSED, ops.UNREFERENCED)
    off = host.until_ended(host.ask(ops.OFF))
    trusted = host.until_ended(host.ask(ops.TRUST, REFERENCED))
    assert (off.how, trusted.how) == (DONE, DONE)


def test_a_stepper_in_fault_comes_down_its_ramp_and_is_reset():
    axis = Stepper()
    host = axis.host
    host.ask(ops.MOVE_TO, 0.04)
    host.run(150)
    entries = host.axis.feed[0]
    for k in range(axis.rule.position + 20, 8001):  # somebody truncates the table
        entries[k] = -1
    while host.state == "operation enabled":
        host.run(1)
    assert axis.rule.index == -1
    host.run(2)
    assert host.state == "fault"
    assert host.board.operation.fault == 241
    assert "fell by more than one ramp step" in host.axis.fault()
    assert host.until_ended(host.ask(ops.MOVE_BY, 0.001)).why == ops.IN_FAULT
    assert host.until_ended(host.ask(ops.RESET)).how == DONE
    host.run(5)
    assert host.state == "switch on disabled"
    host.ask(ops.ENABLE)
    host.run(5)
    assert host.state == "operation enabled"


def test_a_motor_of_several_is_named():
    spec = load_spec(EXAMPLES / "zoom.toml", ())
    with pytest.raises(DetentError, match="group_a, group_b"):
        Host(METHODS["stepper_envelope"], spec, wall=False)
    literal = load_spec(EXAMPLES / "zoom.toml", ("stepper.group_a.method.rule=literal",))
    with pytest.raises(DetentError, match="literal"):
        Host(METHODS["stepper_envelope"], literal, motor="group_a", wall=False)


# ---------------------------------------------------------------------------------------------------- print head


class Head:
    """The print head of the example, enabled: it has found its frames and measured itself."""

    def __init__(self, *changes: str, speed: float = 1.0, enable: bool = True) -> None:
        self.spec = load_spec(EXAMPLES / "print_head.toml", changes)
        self.host = Host(METHODS["print_head"], self.spec, wall=False, speed=speed)
        self.state: Any = self.host.axis.state
        self.memory: Any = self.host.axis.memory
        self.head = self.state.controller.head
        self.answer = self.host.board.operation.answer
        self.host.run(1)
        if enable:
            self.host.ask(ops.ENABLE)
            self.host.ask(ops.CONFIRM)
            self.until_rest()
            assert self.memory.identified == 1
            assert self.host.board.operation.trust == REFERENCED

    def until_rest(self) -> list[int]:
        """Run until the head rests; its positions on the way [emitter]."""
        found = [int(self.head.emitter)]
        while len(found) < 30_000:
            self.host.run(1)
            found.append(int(self.head.emitter))
            if self.answer.rests:
                return found
        raise AssertionError("the head does not come to rest")

    def printed(self) -> Any:
        """What came of the last job."""
        assert self.host.job is not None
        return self.host.job.result()

    @property
    def speed(self) -> float:
        """True speed [in/s]."""
        return abs(self.state.plant.train.velocity) / 0.0254


def longest_stop(speed: float) -> float:
    """Way of a stop [emitter]: v^2/(2a) of 600 in/s^2, a period until it is seen, and what a stop may miss."""
    return 300 * (speed * speed / 1200 + speed * 1e-3) + 12


PAGES = {"brochure": EXAMPLES / "brochure.prn", "WordStar": DATA / "workloads/daisywheel_diablo630/wsprint.prn"}


@pytest.mark.parametrize("name", PAGES)
def test_23_the_print_head_prints_a_stream_live_as_a_run_does(name):
    """In the loop the head begins its first line when the host is ready, a while after it has come to rest."""
    if not PAGES[name].exists():
        pytest.skip("the recorded workloads (../shared/data) are not here")
    job, axis = load_job(PAGES[name]), Head(speed=10.0)
    measured = axis.memory.answered_us
    assert axis.host.until_ended(axis.host.work(job)).how == DONE
    live = axis.printed()
    fed = next(one.period for one in axis.host.log.asked if one.fields[1] == ops.FEED)
    begun = math.floor((fed - 1) * axis.host.board.loop.ticks)  # the tick in which that period begins
    waited = begun - (round(measured / PERIOD_US) + 1)

    simulated = SimulatedPrinting(axis.spec, job, None, lambda _share, _text: None)
    simulated.prepare()
    simulated.machine.pass_ticks(waited)
    simulated.print_all()
    same = simulated.finish()
    assert same.done
    assert live.done
    assert live.strikes == same.strikes
    assert (live.errors_right == same.errors_right).all()
    assert (live.errors_left == same.errors_left).all()
    assert (live.worst_error, live.rms_error) == (same.worst_error, same.rms_error)
    assert [one.speed_value for one in live.lines] == [one.speed_value for one in same.lines]

    run = print_job(axis.spec, job)  # its first line begins at once, before the last current has died away
    assert (live.characters, live.columns, live.missed) == (run.characters, run.columns, 0)
    assert [one.direction for one in live.lines] == [one.direction for one in run.lines]
    assert live.worst_error == pytest.approx(run.worst_error, abs=2e-6)
    assert live.print_time == pytest.approx(run.print_time, rel=0.05)


def test_14_a_print_head_stops_from_every_state_as_short_as_its_speed():
    axis, chance = Head(), random.Random(14)
    host, seen, fastest = axis.host, set[int](), 0.0
    todo = moves(chance, 0.0, 0.36, 1.0)
    for _ in range(STATES):
        for _ in range(chance.choice((1, 1, 2))):
            kind, value, share = next(todo)
            host.ask(kind, value, share)
            host.run(chance.randrange(1, 150))
        at, speed, heading = int(axis.head.emitter), axis.speed, math.copysign(1, axis.state.plant.train.velocity)
        seen.add(int(axis.head.state))
        fastest = max(fastest, speed)
        host.stop()
        places = axis.until_rest()
        assert host.state == "operation enabled"
        assert abs(places[-1] - at) <= longest_stop(speed)
        assert all((b - a) * heading >= -1 for a, b in pairwise(places))  # a stop swings back by an emitter at most
        assert 0 <= places[-1] <= axis.head.width
        assert (axis.head.drive_cmd, axis.head.state) == (0, IDLE)
    assert len(seen) >= 6
    assert fastest > 39.0


def test_14_a_print_head_stops_while_it_looks_for_its_frames_and_measures_itself():
    seen: set[int] = set()
    for moment in (5, 60, 400, 2000, *range(3300, 7500, 73)):
        axis = Head(enable=False)
        axis.host.ask(ops.ENABLE)
        axis.host.run(moment)
        at, speed = int(axis.head.emitter), axis.speed
        seen.add(int(axis.head.state))
        assert axis.memory.measuring
        axis.host.stop()
        places = axis.until_rest()
        assert abs(places[-1] - at) <= longest_stop(speed)
        assert axis.memory.identified == 0
    assert len(seen) >= 5
    host = axis.host
    assert host.until_ended(host.ask(ops.HOME)).how == DONE  # once more, and whole
    assert axis.memory.identified == 1
    assert host.until_ended(host.ask(ops.MOVE_TO, 0.1)).how == DONE


def test_a_print_head_is_switched_on_and_off():
    axis = Head()
    host = axis.host
    assert host.until_ended(host.ask(ops.MOVE_BY, 0.0)).how == DONE  # a null move is done, too
    place = axis.answer.position
    host.ask(ops.MOVE_TO, 0.02)
    host.run(120)
    assert axis.speed > 20
    host.off()
    host.run(1)
    assert (axis.head.drive_cmd, axis.state.lines.count, axis.state.lines.transition) == (0, 0, 0)
    host.ask(ops.ENABLE)
    host.ask(ops.CONFIRM)
    home = host.ask(ops.MOVE_TO, place)
    host.run(1)
    assert axis.speed > 10  # it still rolls, counted on: what is asked waits for that
    assert host.until_ended(home).how == DONE
    assert axis.answer.position == pytest.approx(place, abs=1.1e-3)
    assert host.board.operation.trust == REFERENCED


def test_a_print_head_without_power_stalls_and_is_reset():
    axis = Head()
    host = axis.host
    params: Any = host.axis.params
    move, params.plant.supply = host.ask(ops.MOVE_TO, 0.1), 0.0
    ending = host.until_ended(move)
    assert (ending.how, ending.why) == (ops.FAILED, 250)
    host.run(2)
    assert host.state == "fault"
    assert "obstructed or stalled" in host.axis.fault()
    params.plant.supply = 38.0
    assert host.until_ended(host.ask(ops.RESET)).how == DONE
    host.run(2)
    assert host.state == "switch on disabled"
    host.ask(ops.ENABLE)
    host.ask(ops.CONFIRM)
    axis.until_rest()
    assert host.until_ended(host.ask(ops.MOVE_TO, 0.1)).how == DONE


def test_a_job_that_is_stopped_ends_there_and_another_one_prints_whole():
    job, axis = load_job(EXAMPLES / "letter.txt"), Head()
    first = axis.host.work(job)
    while axis.memory.done < 2:
        axis.host.run(1)
    axis.host.stop()
    assert axis.host.until_ended(first).how == ABORTED
    axis.until_rest()
    half = axis.printed()
    assert len(half.lines) == 2
    assert not half.done
    assert axis.host.until_ended(axis.host.work(job)).how == DONE
    page = axis.printed()
    assert page.done
    assert (page.missed, len(page.lines)) == (0, len(job.lines))
    again = Head(enable=False)  # what came from outside makes the session, bit for bit
    repeat(again.host, axis.host.log, axis.host.board.loop.periods)
    assert bytes(again.state.controller) == bytes(axis.state.controller)


def test_a_job_waits_for_the_frames_and_for_the_first_motion_to_be_confirmed():
    job, axis = load_job(EXAMPLES / "letter.txt"), Head(enable=False)
    with pytest.raises(AxisError, match="not calibrated"):
        axis.host.work(job)
    axis.host.ask(ops.ENABLE)
    axis.until_rest()
    assert axis.host.until_ended(axis.host.work(job)).why == ops.NOT_CONFIRMED
    axis.host.ask(ops.CONFIRM)
    assert axis.host.until_ended(axis.host.ask(ops.FEED, 1)).why == ops.NO_JOB
    assert axis.host.until_ended(axis.host.ask(ops.MOVE_TO, 0.1, 0.2)).how == DONE
    assert axis.head.maximum < 60
    assert axis.host.until_ended(axis.host.work(job)).how == DONE  # at the speed of the file, not of the last move
    page = axis.printed()
    assert page.done
    assert max(page.speeds) > 60
