"""Rigs of live tests of single methods: a stepper and a print head, enabled. Time is that of the axis, no clock's."""

import random
from collections.abc import Iterator
from typing import Any

from detent.control import operation as ops
from detent.control.operation import REFERENCED
from detent.methods.load import load_spec
from detent.methods.registry import METHODS
from detent.operate.host import Host
from detent.plant.stepper_rotor import lost_steps
from tests.acceptance.test_golden_bits import EXAMPLES
from tests.places import DATA

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


def moves(chance: random.Random, lowest: float, highest: float, fastest: float) -> Iterator[tuple[int, float, float]]:
    """Moves and jogs without end: kind, value, share of the speed."""
    while True:
        if chance.random() < 0.6:
            yield ops.MOVE_TO, chance.uniform(lowest, highest), chance.choice((1.0, 1.0, 0.5, 0.15))
        else:
            yield ops.JOG, chance.choice((-1, 1)) * chance.uniform(0.1, 1.0) * fastest, 1.0


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
