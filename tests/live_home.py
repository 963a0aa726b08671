"""An axis that does not know where it stands, and homes: what it then takes for its position, beside the truth."""

from collections.abc import Callable, Iterator
from random import Random
from typing import Any

from detent.control import operation as ops
from detent.methods.filtered_servo.controller import shift_counters
from detent.methods.filtered_servo.system import switch_on as filtered_on
from detent.methods.phase_servo.system import switch_on as phase_on
from detent.sensing.position_sensor import shift_positions
from tests.live_bench import Bench

WAYS = ("contact", "switch", "index")
TRAVEL = 0.02  # short, so that it is soon there [m]
SHORT = (f"limits.travel={TRAVEL} m",)
ZOOM = "stepper.group_b"
HOMED = {
    "filtered_servo contact": SHORT, "filtered_servo switch": SHORT, "filtered_servo index": SHORT,
    "phase_servo index": SHORT,
    "zoom switch": (
        f"{ZOOM}.limits.travel={TRAVEL} m", f"{ZOOM}.zone.fine.begin=2 mm", f"{ZOOM}.zone.fine.end=4 mm",
        f"{ZOOM}.home.speed=10 mm/s", f"{ZOOM}.home.creep=0.5 mm/s",
    ),
}  # fmt: skip
"""Of the methods beside the cascade: each way, on an axis made short."""


class Lost(Bench):
    """An example, somewhere, with positions that are wrong by something."""

    def __init__(self, way: str, rng: Random, *overrides: str, name: str = "cascade") -> None:
        at, by = rng.uniform(0.05 * TRAVEL, 0.95 * TRAVEL), f"home.by={way}"
        changes, more = (*SHORT, by), {}
        if name != "cascade":
            changes = HOMED[f"{name} {way}"] + (() if name == "zoom" else (by,))
            more = {"motor": "group_b"} if name == "zoom" else {}
        super().__init__(name, *changes, *overrides, careful=False, **more)
        self.axis: Any = self.host.axis
        LOSE[name](self, at, rng)
        self.operation.trust = ops.NOT_KNOWN
        self.pass_time(0.5 if name == "phase_servo" else 0.02)
        assert self.do(ops.ENABLE).how == ops.DONE
        if name == "phase_servo":  # it locks, and settles
            self.pass_time(0.1)

    def lose_cascade(self, at: float, rng: Random) -> None:
        """As if it had been switched on there."""
        from detent.methods.cascade.system import switch_on

        state = self.axis.state
        switch_on(self.axis.params, state, at)
        state.controller.on = state.lines.enable = 0
        for sensor in (state.controller.motor_sensor, state.controller.load_sensor):
            shift_positions(sensor, rng.uniform(-0.5, 0.5))

    def lose_filtered(self, at: float, rng: Random) -> None:
        """Its counters begin anywhere."""
        filtered_on(self.axis.params, self.axis.state, at, 5000, rng.randrange(1 << 30))
        shift_counters(self.axis.state.controller, rng.randrange(-100_000, 100_000))

    def lose_phase(self, at: float, rng: Random) -> None:
        """It locks to the positioning point beside it, whichever that is."""
        phase_on(self.axis.params, self.axis.state, at, rng.randrange(1 << 30))
        self.axis.memory.base = self.axis.memory.position = rng.randrange(-64_000, 64_000)

    def lose_stepper(self, at: float, rng: Random) -> None:
        """Its field is anywhere, and so is its place in the tables."""
        rotor, step = self.axis.state.plant.rotor, self.axis.live.step
        rotor.commanded = round(at / step)
        rotor.angle = rotor.commanded * self.axis.params.plant.rotor.step_angle
        self.axis.state.controller.rule.position = rng.randrange(self.axis.live.up.steps + 1)

    @property
    def true_position(self) -> float:
        """Where the machine is [m]."""
        plant = self.axis.state.plant
        if hasattr(plant, "rotor"):
            return plant.rotor.angle * self.axis.params.plant.way
        return plant.machine.motor.position if hasattr(plant, "machine") else plant.train.position

    @property
    def off_by(self) -> float:
        """Position as the axis has it, less the true one [m]."""
        return self.answer.position - self.true_position


LOSE: dict[str, Callable[[Lost, float, Random], None]] = {
    "cascade": Lost.lose_cascade, "filtered_servo": Lost.lose_filtered, "phase_servo": Lost.lose_phase,
    "zoom": Lost.lose_stepper,
}  # fmt: skip


def homed(way: str, starts: int, name: str = "cascade") -> Iterator[Lost]:
    """The axis, lost and homed, from each of so many starts."""
    rng = Random(22)
    for _ in range(starts):
        axis = Lost(way, rng, name=name)
        while abs(axis.off_by) < 1e-3:  # by chance it was right
            axis = Lost(way, rng, name=name)
        ending = axis.do(ops.HOME)
        assert ending.how == ops.DONE, ending
        assert axis.operation.trust == ops.REFERENCED
        assert 0.0 < axis.answer.position < TRAVEL
        yield axis


def zeros(way: str, starts: int, name: str = "cascade") -> list[float]:
    """How far off the position is after a homing from each of so many starts [m]."""
    found = list[float]()
    for axis in homed(way, starts, name):
        assert axis.do(ops.MOVE_TO, 0.5 * TRAVEL).how == ops.DONE
        axis.pass_time(0.3 if name != "cascade" else 0.0)
        found.append(axis.off_by)
    return found
