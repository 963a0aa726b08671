"""An axis that does not know where it stands, and homes: what it then takes for its position, beside the truth."""

from random import Random
from typing import Any

from detent.control import operation as ops
from detent.sensing.position_sensor import shift_positions
from tests.live_bench import Bench

WAYS = ("contact", "switch", "index")
TRAVEL = 0.02  # short, so that it is soon there [m]


class Lost(Bench):
    """The cascade example, somewhere, with positions that are wrong by something."""

    def __init__(self, way: str, rng: Random, *overrides: str) -> None:
        at = rng.uniform(0.0, TRAVEL)
        super().__init__("cascade", f"limits.travel={TRAVEL} m", f"home.by={way}", *overrides, careful=False)
        self.axis: Any = self.host.axis
        self.stand(at)
        for sensor in (self.axis.state.controller.motor_sensor, self.axis.state.controller.load_sensor):
            shift_positions(sensor, rng.uniform(-0.5, 0.5))
        self.operation.trust = ops.NOT_KNOWN
        self.pass_time(0.02)
        assert self.do(ops.ENABLE).how == ops.DONE

    def stand(self, at: float) -> None:
        """Somewhere, as if it had been switched on there."""
        from detent.methods.cascade.system import switch_on

        state = self.axis.state
        switch_on(self.axis.params, state, at)
        state.controller.on = state.lines.enable = 0

    @property
    def off_by(self) -> float:
        """Position as the axis has it, less the true one [m]."""
        return self.answer.position - self.axis.state.plant.machine.motor.position


def zeros(way: str, starts: int) -> list[float]:
    """How far off the position is after a homing from each of so many starts [m]."""
    rng, found = Random(22), list[float]()
    for _ in range(starts):
        axis = Lost(way, rng)
        assert abs(axis.off_by) > 1e-3
        assert axis.do(ops.HOME).how == ops.DONE
        assert axis.operation.trust == ops.REFERENCED
        assert 0.0 < axis.answer.position < TRAVEL
        assert axis.do(ops.MOVE_TO, 0.5 * TRAVEL).how == ops.DONE
        found.append(axis.off_by)
    return found
