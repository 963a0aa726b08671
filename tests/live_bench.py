"""A live axis for tests: its loop as fast as it can, its host at hand, nothing injected but what a test injects."""

from functools import cache
from typing import Any

from detent.control import operation as ops
from detent.methods.load import load_spec
from detent.methods.registry import METHODS
from detent.operate.host import Ending, Host
from tests.acceptance.test_golden_bits import EXAMPLES

OPERATED = ("cascade", "rotary_table", "phase_servo", "filtered_servo")
MOVED = ("cascade", "phase_servo", "filtered_servo")  # of these, those that go to places


@cache
def _spec(name: str, overrides: tuple[str, ...]) -> Any:
    return load_spec(EXAMPLES / f"{name}.toml", overrides)


class Bench:
    """Host of an example in simulated time."""

    def __init__(self, name: str, *overrides: str, **more: Any) -> None:
        self.spec = _spec(name, overrides)
        self.host = Host(METHODS[self.spec.axis.method], self.spec, **{"wall": False, **more})
        self.operation: Any = self.host.board.operation
        self.answer: Any = self.operation.answer
        self.loop: Any = self.host.board.loop
        self.grain: float = getattr(self.spec, "count", 0.0) or getattr(self.spec, "pulse", 0.0) or 1e-9

    def pass_time(self, seconds: float) -> None:
        """Let time pass."""
        self.host.run(round(seconds * 1e9 / self.loop.period))

    def enable(self) -> "Bench":
        """Operation enabled, at rest in its window, the first motion confirmed."""
        self.pass_time(0.7)
        self.do(ops.ENABLE)
        self.pass_time(0.7)
        self.do(ops.CONFIRM)
        assert self.host.state == "operation enabled"
        return self

    def do(self, kind: int, value: float = 0.0, speed: float = 1.0, **more: int) -> Ending:
        """Ask, and let time pass until it has ended."""
        return self.host.until_ended(self.host.ask(kind, value, speed, **more))

    def watch(self, seconds: float) -> list[tuple[float, float]]:
        """Commanded point and its velocity of every period."""
        seen: list[tuple[float, float]] = []
        for _ in range(round(seconds * 1e9 / self.loop.period)):
            self.host.run(1)
            seen.append((self.answer.commanded, self.answer.commanded_velocity))
        return seen
