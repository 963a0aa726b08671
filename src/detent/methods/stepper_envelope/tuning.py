"""How hard steppers may accelerate, and with what reserve of torque: each pair is tried on the simulated rotors.

No loop tells of a lost step: the ramp must keep clear of what the motor can do. Of every motor the acceleration of the
linear part is a share of the largest with which torque is left at the start frequency, and its pull-out torque is
divided by the same reserve. Of the pairs with which no step is lost and nothing new is doubted the quickest is taken.
"""

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np

from detent.methods.stepper_envelope.checks import LEAST_SAFETY, find_cautions
from detent.methods.stepper_envelope.derive import MotorFigures
from detent.methods.stepper_envelope.run import run_stage
from detent.methods.stepper_envelope.schema import StepperEnvelopeSpec
from detent.methods.stepper_envelope.stage_job import StageJob, StageMove
from detent.methods.tuning import Search, Trial, digits
from detent.units import format_quantity

SHARES = np.geomspace(0.1, 1.0, 11)  # of the largest acceleration, that are tried
RESERVES = (2.0, 2.5, 3.0, 4.0)  # divisors of the pull-out torque
WAY = 3  # times the shortest way that reaches the largest frequency, that is moved there and back
ACCELERATION, RESERVE = "limits.acceleration", "drive.torque_safety"


class StageSearch(Search):
    """What `tune` asks."""

    decides = "time for the moves, to a millisecond, and of those alike the smallest lag of a rotor behind its field"
    measure, sides = "time for the moves [s]", ("reserve of torque", "share of the largest acceleration")

    def __init__(self, spec: StepperEnvelopeSpec) -> None:
        self.spec, self.names = spec, tuple(spec.stepper)
        self.keys = tuple(f"stepper.{name}.{key}" for key in (ACCELERATION, RESERVE) for name in self.names)
        self.warned = {one.name for one in find_cautions(spec)}

    @cached_property
    def largest(self) -> dict[str, float]:
        """Acceleration with which no torque would be left at the start frequency, by motor [m/s^2]."""
        found = dict[str, float]()
        for name in self.names:
            m = MotorFigures(self.spec, name)
            torque = m.motor.pull_out(m.start_hz) / LEAST_SAFETY - m.motor.friction_torque
            found[name] = torque / m.acceleration_torque(1.0) * m.table.step
        return found

    @property
    def job(self) -> StageJob:
        """All motors there and back, by ways on which each reaches its largest speed where its travel lets it."""
        there, back = dict[str, float](), dict[str, float]()
        for name, table in self.spec.stepper.items():
            start = table.step_inside(table.mechanics.start_position)
            way = WAY * MotorFigures(self.spec, name).shortest_way
            end = start + min(way, table.steps - start) if start <= table.steps // 2 else max(start - way, 0)
            there[name], back[name] = table.position_of(end), table.position_of(start)
        moves = (StageMove(1, 0, targets=there), StageMove(2, 0, targets=back))
        return StageJob("there and back", "moves", moves, self.names, ())

    def candidates(self, held: Sequence[str]) -> list[dict[str, Any]]:
        """Every pair of share and reserve; keys that are held have that of the file."""
        found = [
            {f"stepper.{name}.{ACCELERATION}": digits(share * self.largest[name]) for name in self.names}
            | {f"stepper.{name}.{RESERVE}": reserve for name in self.names}
            for reserve in RESERVES for share in SHARES.tolist()
        ]  # fmt: skip
        own = {key: self._stated(key) for key in self.keys}
        made = [one | {key: own[key] for key in held} for one in [own, *found]]
        return [one for k, one in enumerate(made) if one not in made[:k]]

    def _stated(self, key: str) -> float:
        """The file's value."""
        _, name, table, last = key.split(".")
        return float(getattr(getattr(self.spec.stepper[name], table), last))

    def place(self, values: Mapping[str, Any]) -> tuple[float, float]:
        """Reserve, and share of the largest acceleration, of the first motor."""
        first = self.names[0]
        share = values[f"stepper.{first}.{ACCELERATION}"] / self.largest[first]
        return values[f"stepper.{first}.{RESERVE}"], round(share, 3)

    def tried(self, spec: StepperEnvelopeSpec, job: StageJob) -> Trial:
        """The moves, from power-on."""
        new = sorted({one.name for one in find_cautions(spec)} - self.warned)
        if new:
            return Trial(f"a caution of {new[0]}")
        run = run_stage(spec, job)
        figures = {
            "time for the moves": format_quantity(run.time_end - run.time_ready, "s", 4),
            "largest lag of a rotor": f"{run.worst_lag:.3g} steps",
            "least torque over torque needed": f"{run.least_margin:.3g}",
        }
        if not run.done:
            return Trial("a rotor is not in its place" if not any(run.lost.values()) else "a step is lost", (), figures)
        if run.warnings:
            return Trial("its run is doubted", figures=figures)
        return Trial("", (round(run.time_end - run.time_ready, 3), run.worst_lag), figures)
