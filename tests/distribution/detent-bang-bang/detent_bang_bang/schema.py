"""What an axis file of the bang-bang positioner may say, and what follows from it."""

from collections.abc import Iterator
from typing import Literal

from detent.axisfile.tables import AxisSpec, AxisTable, EncoderTable, MotorTable, ScrewTable
from detent.files.fields import Table, optional, required
from detent.files.findings import Contradiction, Derived, quantity_figure, wrong
from detent.files.quantities import Acceleration, Length, Time, Voltage

TICK = 1e-5


class BangBangAxisTable(AxisTable, frozen=True):
    method: Literal["bang_bang"] = required("control method", '"bang_bang"')


class LimitsTable(Table, frozen=True):
    travel: Length = required("way of the slide", '"0.3 m"', gt=0.0)


class MethodTable(Table, frozen=True):
    supply: Voltage = required("voltage of full drive", '"12 V"', gt=0.0)
    deceleration: Acceleration = required("what braking is reckoned with", '"2 m/s^2"', gt=0.0)
    braking: bool = optional("brake ahead of the target", default=True)
    dead_band: int = optional("pulses around the target without drive", 4, ge=1, le=1000)
    window: Time = optional("window of the speed counter", 5e-4, ge=1e-4, le=0.1)
    settling: Time = optional("time inside the dead band until the axis says so", 0.01, gt=0.0, le=1.0)


class BangBangSpec(AxisSpec, frozen=True):
    axis: BangBangAxisTable
    limits: LimitsTable
    motor: MotorTable
    mechanics: ScrewTable
    encoder: EncoderTable
    method: MethodTable

    @property
    def pulse(self) -> float:
        return self.mechanics.travel_per_revolution / (4 * self.encoder.cycles_per_revolution)

    @property
    def top_speed(self) -> float:
        return self.method.supply / self.motor.back_emf_constant * self.mechanics.radius


def fill(spec: BangBangSpec) -> BangBangSpec:
    return spec.filled(mechanics={"start_position": 0.1 * spec.limits.travel})


def countable(spec: BangBangSpec) -> Iterator[Contradiction]:
    if spec.top_speed * TICK > spec.pulse:
        yield wrong("encoder.cycles_per_revolution method.supply", "one edge in a tick at full speed", "lower supply")


def derive(spec: BangBangSpec) -> Iterator[Derived]:
    yield quantity_figure("top speed", spec.top_speed, "m/s", "supply over back-EMF constant")
