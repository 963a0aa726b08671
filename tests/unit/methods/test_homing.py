"""How the methods beside the cascade home: each is told by its `serve`, and a machine that does as it is told follows.

That the simulated machines do is among the acceptance tests (test_22).
"""

from collections.abc import Callable
from typing import Any

import pytest
from tests.acceptance.test_golden_bits import EXAMPLES

from detent.control import operation as ops
from detent.control.operation import Operation
from detent.control.phase_sequencer import ACQUIRE, SETTLE_READY, SPEED
from detent.control.phase_sequencer import HOLD as AT_STOP
from detent.kernel.loop import run_serve
from detent.methods.load import load_spec
from detent.methods.registry import METHODS
from detent.operate.host import operation_params

LOOK = 1e-3


class Puppet:
    """A live axis without its plant: `follow` moves it by a look, as its controller asks for."""

    def __init__(self, name: str, way: str, at: float, *changes: str, motor: str = "") -> None:
        spec: Any = load_spec(EXAMPLES / f"{name}.toml", changes)
        self.axis: Any = METHODS[spec.axis.method].live(spec, operation_params(), motor)
        self.q, self.p, self.memory = self.axis.live, self.axis.params, self.axis.memory
        self.c, self.lines = self.axis.state.controller, self.axis.state.lines
        self.home: Any = spec.home if motor == "" else spec.stepper[motor].home
        self.way, self.at, self.rest, self.stuck = way, at, 0.0, False
        self.o: Any = Operation(trust=ops.REFERENCED, state=4)
        self.o.demand.share = 1.0

    def edge(self) -> float:
        behind = self.home.edge_to_index if self.way == "index" else 0.0
        return self.home.position + self.home.side * behind

    def sense(self) -> None:
        self.lines.home.switch = int((self.at - self.edge()) * self.home.side >= 0.0)

    def go(self, way: float) -> float:
        """Go so far [m], up to the frame; gives how far that was."""
        before = self.at
        self.at = before if self.stuck else max(before + way, 0.0)
        return self.at - before

    def whole(self, pulses: float) -> int:
        """Whole pulses of this look; what is left comes with the next."""
        self.rest += pulses
        whole = int(self.rest)
        self.rest -= whole
        return whole

    def follow(self) -> None:
        raise NotImplementedError

    def look(self, do: int, fresh: int) -> int:
        self.o.demand.do, self.o.demand.fresh = do, fresh
        self.sense()
        run_serve(self.q, self.p.controller, self.c, self.lines, self.memory, self.o, *self.axis.feed)
        self.o.demand.fresh = 0
        self.follow()
        return self.o.answer.refused

    def seek(self, most: int = 60_000) -> int:
        """Home; why it failed, 0 where it did not."""
        why = self.look(ops.SEEK, 1)
        for _ in range(most):
            if why or self.memory.homing.phase == 0:
                return why
            why = self.look(ops.SEEK, 0)
        pytest.fail(f"it does not end: phase {self.memory.homing.phase} at {self.at}")


class Filtered(Puppet):
    """Its slide stands where the command is, a turn of the encoder apart from mark to mark."""

    cell = 4

    def follow(self) -> None:
        c, g = self.c, self.c.generator
        wanted = self.whole(g.rate * 1e-6 * LOOK) if g.command != g.goal else 0
        step = max(min(wanted, abs(g.goal - g.command)), 0) * (1 if g.goal > g.command else -1)
        g.command += step
        moved = round(self.go(step * self.q.pulse) / self.q.pulse)
        c.deviation.position += moved
        c.deviation.deviation = g.command - c.deviation.position
        c.away, c.settling = int(g.command != g.goal), 0
        cell = int((self.at - self.home.position) / 5e-3 + 100.0)
        if self.way == "index" and cell != self.cell:
            c.marks, c.mark, self.cell = c.marks + 1, c.deviation.position, cell


class Phase(Puppet):
    """Its carriage goes at the ceiling, and stops at the positioning point that is left."""

    def follow(self) -> None:
        s = self.c.sequencer
        if s.strobe and s.state >= SETTLE_READY:
            s.strobe, s.state, s.distance, s.ready = 0, SPEED, s.command, 0
            s.direction = -1 if s.backward else 1
        if s.state == ACQUIRE:
            s.state, self.lines.enable, s.position = AT_STOP, 1, 0
        if s.state == SPEED:
            step = min(self.whole(s.ceiling * LOOK / self.q.sample), s.distance)
            moved = round(self.go(s.direction * step * self.q.step) / self.q.step)
            s.distance -= abs(moved)
            s.position += moved
        if s.state == SPEED and s.distance == 0:
            s.state, s.ready = AT_STOP, 1


class Motor(Puppet):
    """A stepper, at the frequency that it is told."""

    def follow(self) -> None:
        rule = self.c.rule
        rule.index = max(rule.index, 0) if rule.request >= 0 else -1
        if rule.request < 0:
            return
        stop = self.memory.up_stop if rule.heading > 0 else self.memory.down_stop
        rule.direction = rule.heading
        step = min(self.whole(1e6 / rule.request_word * LOOK), (stop - rule.position) * rule.heading)
        rule.position += step * rule.heading
        self.at += step * rule.heading * self.q.step
        if rule.position == stop:
            rule.index = rule.request = -1


def filtered(way: str, at: float) -> Puppet:
    axis = Filtered("filtered_servo", way, at, "limits.travel=50 mm", f"home.by={way}")
    axis.c.deviation.position = axis.c.generator.command = axis.c.generator.goal = 12_345
    return axis


def phase(way: str, at: float) -> Puppet:
    axis = Phase("phase_servo", way, round(at / 4.23333e-4) * (50.8e-3 / 120), "limits.travel=50 mm")
    axis.lines.enable, axis.c.sequencer.state, axis.c.sequencer.ready = 1, AT_STOP, 1
    axis.memory.base = axis.memory.position = axis.memory.target = 64 * 77
    axis.memory.driving = axis.memory.locked = 1
    return axis


def stepper(way: str, at: float) -> Puppet:
    axis = Motor("zoom", way, at, "stepper.group_b.home.speed=10 mm/s", motor="group_b")
    axis.c.rule.position = 4321
    return axis


CASES: dict[str, tuple[Callable[[str, float], Puppet], str, float]] = {
    "filtered contact": (filtered, "contact", 6e-6), "filtered switch": (filtered, "switch", 11e-6),
    "filtered index": (filtered, "index", 16e-6), "phase": (phase, "index", 1e-9), "stepper": (stepper, "switch", 6e-6),
}  # fmt: skip
"""How each is made, by what it homes, and within what its position is then true [m]."""


@pytest.mark.parametrize("at", [0.0004, 0.0213])
@pytest.mark.parametrize("case", CASES)
def test_after_a_homing_the_position_is_that_of_the_machine(case: str, at: float) -> None:
    make, way, within = CASES[case]
    axis = make(way, at)
    assert axis.q.operation.takes >> ops.HOME & 1
    assert axis.seek() == 0
    assert axis.o.trust == ops.REFERENCED
    axis.look(ops.HOLD, 0)
    assert axis.o.answer.rests == 1
    assert axis.o.answer.position == pytest.approx(axis.at, abs=within)


@pytest.mark.parametrize("case", ["filtered switch", "phase"])
def test_something_in_the_way_ends_it(case: str) -> None:
    make, way, _ = CASES[case]
    axis = make(way, 0.02)
    axis.look(ops.SEEK, 1)
    for _ in range(200):
        axis.look(ops.SEEK, 0)
    axis.stuck = True
    why = 0
    for _ in range(200):
        why = why or axis.look(ops.SEEK, 0)
    assert (why, axis.o.trust, axis.memory.homing.phase) == (341, ops.NOT_KNOWN, 0)
    if case == "phase":  # the bridge has let go of what it pushed against, and has locked anew
        assert (axis.c.sequencer.state, axis.lines.enable) == (AT_STOP, 1)
    else:
        assert axis.c.generator.command == axis.c.generator.goal
        assert axis.c.known == 0


def test_a_stepper_looks_on_where_its_table_ends() -> None:
    axis = stepper("switch", 0.029)
    axis.c.rule.position = 200  # it believes to be near its lower end
    assert axis.seek() == 0
    assert axis.memory.shift != 0
    assert axis.o.answer.position == pytest.approx(axis.at, abs=6e-6)


def test_a_stepper_that_finds_no_switch_says_so() -> None:
    axis = stepper("switch", 0.02)
    axis.sense = lambda: None  # pyright: ignore[reportAttributeAccessIssue]
    assert axis.seek() == 341
    assert axis.o.trust == ops.NOT_KNOWN


@pytest.mark.parametrize("case", CASES)
def test_another_demand_ends_a_homing(case: str) -> None:
    make, way, _ = CASES[case]
    axis = make(way, 0.02)
    axis.look(ops.SEEK, 1)
    for _ in range(20):
        axis.look(ops.SEEK, 0)
    assert axis.memory.homing.phase != 0
    axis.look(ops.HALT, 1)
    assert (axis.memory.homing.phase, axis.o.trust) == (0, ops.NOT_KNOWN)


@pytest.mark.parametrize("change", ["method.final=incremental", "method.stop_always_off=true"])
def test_a_phase_servo_that_does_not_stop_by_its_phase_does_not_home(change: str) -> None:
    axis = Phase("phase_servo", "index", 0.02, change)
    assert not axis.q.operation.takes >> ops.HOME & 1


@pytest.mark.parametrize(("share", "ceiling"), [(1.0, 0), (0.1, 2), (0.001, 1)])
def test_a_share_of_the_speed_is_a_ceiling_of_the_velocity_table(share: float, ceiling: int) -> None:
    axis = phase("index", 0.02)
    axis.o.demand.share, axis.o.demand.target = share, axis.q.home
    axis.look(ops.TRAVEL, 1)
    assert axis.c.sequencer.ceiling == ceiling
