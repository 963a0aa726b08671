"""The sequence controller: what it does at which tick."""

import math

import numpy as np
import pytest

import detent
from detent.errors import AxisError
from detent.methods.load import load_spec
from detent.methods.rotary_table.host import TableHost
from detent.methods.rotary_table.sequence_controller import SequenceController, input_edges, suspect
from detent.methods.rotary_table.sequence_job import Go, Jog, Output, Wait
from detent.methods.rotary_table.system import TICK, RotaryTable
from detent.record.recorder import Recorder

pytestmark = pytest.mark.compiled

SPEED = math.radians(30)


class Bench:
    """A controller, and what its steps have asked for after every stretch of time."""

    def __init__(self, *overrides, recorder=None, **inputs):
        self.host = TableHost(load_spec(detent.example("rotary_table.toml"), overrides), recorder)
        self.host.start()
        self.start = self.host.tick
        self.lines = self.host.machine.state.controller.positioner
        self.asked = []
        self.controller = SequenceController(self.host, inputs, self.asked.append)

    def do(self, *steps):
        for step in steps:
            self.controller.do(step)
        return self

    @property
    def ticks(self):
        return self.host.tick - self.start

    def times(self, changes):
        return [(round(time / self.host.machine.tick) - self.start, name, on) for time, name, on in changes]


# -- inputs -------------------------------------------------------------------------------------------------


def test_edges_come_in_the_order_of_time():
    edges = input_edges({"b": ((0.0, 0.3),), "a": ((0.1, 0.2), (0.3, 0.4))}, 7)
    assert [edge[0] for edge in edges] == [7, 1007, 2007, 3007, 3007, 4007]
    assert [edge[1] for edge in edges] == ["b", "a", "a", "a", "b", "a"]
    assert [edge[2] for edge in edges] == [True, True, False, True, False, False]


def test_a_pulse_lasts_a_tick_at_least_and_pulses_within_a_tick_are_one():
    assert input_edges({"a": ((0.1, 0.100001),)}, 0) == [(1000, "a", True), (1001, "a", False)]
    assert input_edges({"a": ((0.1, 0.20001), (0.20002, 0.3))}, 0) == [(1000, "a", True), (3000, "a", False)]


def test_inputs_are_taken_over_at_their_ticks_whatever_is_done_meanwhile():
    stretches = ((0.0, 0.01234), (0.5, 0.5001), (0.7777, 0.9))
    bench = Bench(a=stretches).do(Go(1), Wait(0.1))
    assert bench.times(bench.controller.inputs) == [
        (0, "a", True), (123, "a", False), (5000, "a", True), (5001, "a", False), (7777, "a", True), (9000, "a", False),
    ]  # fmt: skip
    assert bench.controller.coming == []


def test_what_has_not_come_yet_is_known():
    bench = Bench(a=((0.0, 1.0),), b=((2.0, 3.0),)).do(Wait(0.5))
    assert bench.controller.coming == ["a", "b"]
    assert bench.do(Wait(1.0)).controller.coming == ["b"]


# -- steps --------------------------------------------------------------------------------------------------


def test_a_wait_takes_its_time_to_the_tick():
    assert Bench().do(Wait(0.1234)).ticks == 1234
    assert Bench().do(Wait(0.0)).ticks == 0
    assert Bench(a=((0.05, 0.06),)).do(Wait(0.1234), Wait(0.0001)).ticks == 1235


def test_a_wait_for_a_signal_ends_at_its_edge():
    assert Bench(a=((0.25, 0.5),)).do(Wait(signal="a")).ticks == 2500
    assert Bench(a=((0.25, 0.5),)).do(Wait(signal="a"), Wait(signal="a", level=False)).ticks == 5000
    assert Bench(a=((0.0, 0.5),)).do(Wait(signal="a")).ticks == 0
    assert Bench(a=((0.25, 0.5),)).do(Wait(signal="a", level=False)).ticks == 0
    assert Bench(a=((0.25, 0.5),)).do(Wait(0.3), Wait(signal="a")).ticks == 3000


def test_outputs_are_switched_at_once():
    bench = Bench().do(Output("x", on=True), Wait(0.01), Output("x", on=False), Output("x", on=False))
    assert bench.times(bench.controller.outputs) == [(0, "x", True), (100, "x", False), (100, "x", False)]


@pytest.mark.parametrize(("direction", "line"), [(1, "plus"), (-1, "minus")])
def test_the_button_follows_the_signal_to_the_tick(direction, line):
    recorder = Recorder(RotaryTable, [f"controller.positioner.{line}"], every=1, period=TICK)
    bench = Bench(recorder=recorder, a=((0.0301, 0.2507),)).do(Jog(direction, SPEED, "a"))
    bench.host.machine.close()
    held = np.flatnonzero(recorder.trace()[f"controller.positioner.{line}"])
    # The row of a tick is written at its end: the first row is tick 1.
    assert (held[0] + 1, held[-1] + 1) == (bench.start + 302, bench.start + 2507)
    assert len(held) == 2507 - 301
    assert bench.lines.z == direction
    way = direction * (bench.lines.angle.position - round(10 / 360 * bench.host.spec.period)) * bench.host.spec.count
    assert way == pytest.approx(SPEED * (0.2507 - 0.0301), abs=SPEED * 0.02)


def test_a_jog_for_a_time_asks_for_its_way_and_ends_at_rest():
    bench = Bench().do(Jog(1, SPEED, duration=1.0))
    assert bench.controller.asked == pytest.approx(SPEED * 1.0)
    assert bench.asked == sorted(bench.asked)
    assert not bench.host.is_moving
    assert bench.host.in_position
    assert 1.0 + 0.1 < bench.ticks * 1e-4 < 1.0 + 0.1 + 0.5  # deceleration, then settling
    assert bench.controller.warnings == {}


def test_a_jog_too_short_for_its_speed_asks_for_a_triangle():
    bench = Bench().do(Jog(1, math.radians(60), duration=0.1))
    assert bench.controller.asked == pytest.approx(math.radians(300) * 0.1**2)


def test_a_jog_waits_for_its_signal():
    bench = Bench(a=((1.0, 1.1),)).do(Jog(1, SPEED, "a"))
    assert bench.ticks > 11_000
    assert bench.asked[0] == 0.0


def test_a_jog_whose_signal_the_task_does_not_see_moves_nothing():
    # The pass of the task is at 20 ms.
    bench = Bench(a=((0.005, 0.012),)).do(Jog(1, SPEED, "a", row=4))
    assert bench.ticks == 120
    (warning,) = bench.controller.warnings
    assert warning.startswith('line 4: "a" was on for less than the task period, 20 ms')
    assert bench.do(Wait(0.5)).host.in_position


def test_a_positioning_ends_in_position():
    bench = Bench().do(Go(1))
    assert bench.host.at_rest
    assert bench.controller.asked == pytest.approx(math.radians(80), abs=2 * bench.host.spec.count)
    assert bench.controller.latency == 0.0


def test_a_step_begins_with_the_line_acknowledged():
    bench = Bench().do(Go(1), Go(1), Go(2))
    assert bench.host.positioner.refused == 0
    assert bench.lines.angle.dar == pytest.approx(bench.host.spec.period / 2, abs=2)


# -- what does not end --------------------------------------------------------------------------------------


def test_a_signal_that_is_over_does_not_come_again():
    bench = Bench(a=((0.1, 0.2),)).do(Wait(0.3))
    for step in (Wait(signal="a"), Jog(1, SPEED, "a")):
        with pytest.raises(AxisError, match=r'"a" went off for good at 200\.\d ms, before the step began'):
            bench.do(step)
    assert bench.ticks == 3000


def test_a_table_that_does_not_get_there_is_given_up():
    bench = Bench("mechanics.coulomb=0.5 N*m")
    with pytest.raises(AxisError, match=r"it was not in position within 8\.\d+ s; it is 0\.\d+ deg away"):
        bench.do(Go(1))
    assert bench.ticks * 1e-4 < 8.4


def test_a_refused_start_ends_the_step():
    bench = Bench()
    bench.host.machine.params.controller.positioner.pdt.speed[1] = 0
    with pytest.raises(AxisError, match="the positioner refused the start: the position table has no such entry"):
        bench.do(Go(1))


def test_friction_that_keeps_the_table_from_its_window_is_a_warning():
    bench = Bench("mechanics.coulomb=0.5 N*m").do(Jog(1, SPEED, duration=1.0), Jog(-1, SPEED, duration=1.0))
    assert len(bench.controller.warnings) == 1
    assert "did not come within its window" in next(iter(bench.controller.warnings))


@pytest.mark.parametrize("speed", [0.1, 0.5, 2.0])  # deg/s; a count is 1.4 deg, an acceleration's word 0.6 deg/s
def test_a_slow_jog_on_coarse_counts_comes_to_rest(speed):
    """Up to a count more than its braking path is made at that speed: it was given up after 0.54 s."""
    coarse = ["detector.fine.counts=64", "detector.coarse.counts=64", "mechanics.gear_ratio=4"]
    bench = Bench(*coarse).do(Jog(1, math.radians(speed), duration=1.05))
    assert not bench.host.is_moving
    assert bench.host.way <= bench.host.spec.method.in_position * bench.host.spec.count


PUSH = ["disturbance.load.at=0.1 s", "disturbance.load.duration=100 s"]


def test_a_table_that_is_driven_away_is_no_jog_done():
    """89.9 deg off and still turning at 26 deg/s was a warning."""
    bench = Bench("method.position_control=false", "disturbance.load.torque=200 N*m", *PUSH)
    with pytest.raises(
        AxisError,
        match=r"it is \d+\.\d+ deg from where it is held 353\.3 ms after the jog; the table's angle is not "
        r"controlled",
    ):
        bench.do(Jog(1, math.radians(30), duration=3.0))
    assert bench.controller.warnings == {}


def test_a_load_that_holds_the_table_away_is_a_warning():
    bench = Bench("disturbance.load.torque=20 N*m", *PUSH).do(Jog(1, SPEED, duration=1.0))
    assert "did not come within its window" in next(iter(bench.controller.warnings))


@pytest.mark.parametrize("seed", range(4))
def test_a_table_whose_reading_leaves_the_window_again_and_again_has_not_settled(seed):
    """Where it was read in the very last strobe decided."""
    bench = Bench("detector.fine.noise=0.4 deg", f"detector.seed={seed}").do(Jog(1, SPEED, duration=0.5))
    assert "did not come within its window" in next(iter(bench.controller.warnings))


def test_a_window_that_takes_long_to_be_in_is_waited_for():
    assert Bench("method.in_position_time=1 s").do(Jog(1, SPEED, duration=0.5)).controller.warnings == {}


@pytest.mark.parametrize(
    ("overrides", "text"),
    [
        (["method.position_control=false", "method.signed_remaining=false"], "set method.position_control = true"),
        (["method.signed_remaining=false"], "set method.signed_remaining = true"),
        (["detector.composition=truncated"], 'set detector.composition = "rounded"'),
        ([], "check deviation and torque in the report"),
    ],
)
def test_what_is_suspected_first(overrides, text):
    assert text in suspect(TableHost(load_spec(detent.example("rotary_table.toml"), overrides)))
