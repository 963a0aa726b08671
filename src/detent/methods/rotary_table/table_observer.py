"""An observer beside the rotary table: the true angle of table and motor, over any number of turns."""

import math
from typing import Any

from detent.kernel.turn_table import FRACTION, TURN, at_phase
from detent.methods.rotary_table.schema import RotaryTableSpec
from detent.methods.rotary_table.system import RotaryTable, RotaryTableParams
from detent.plant.gearing import PHASE_PER_RADIAN
from detent.record.machine import Machine


def endless_phase(p: RotaryTableParams, r: RotaryTable) -> int:
    """True angle of the table with all its turns [turn/2^32]: `detent.plant.gearing.output_phase` goes on beyond one.

    Whole numbers of any length: it is as fine after a million turns as in the first.
    """
    gear, motor = p.plant.train.gear, r.plant.train.motor
    within = math.floor((motor.angle + r.plant.train.gear.slack) * PHASE_PER_RADIAN)
    phase = ((motor.turns << 32) + within) // gear.ratio
    return phase + at_phase(gear.eccentricity, phase & FRACTION) if gear.eccentricity.used else phase


class TableObserver:
    """Looks at a table whose axis has taken its first angle."""

    def __init__(self, spec: RotaryTableSpec, machine: Machine[RotaryTableParams, RotaryTable]) -> None:
        self._spec, self._machine = spec, machine
        # ctypes gives every register its type at run time only.
        self._state: Any = machine.state
        # The axis knows the angle within a turn only: it starts in [0, T) whatever turn the table is in.
        away = self._state.controller.positioner.angle.position - self._motor_counts
        self._start_turns = round(away / spec.period)

    @property
    def angle(self) -> float:
        """True angle of the table [rad], endless; 0 where the motor's angle is 0."""
        turns, phase = divmod(endless_phase(self._machine.params, self._machine.state), TURN)
        return turns * math.tau + phase / TURN * math.tau

    @property
    def target(self) -> float:
        """Where the positioner holds the table [rad], in the same turns."""
        return self._target_counts * self._spec.count

    @property
    def miss(self) -> float:
        """Target less true angle of the motor [turn of the motor]: what the detector has wrong, and what is left."""
        return (self._target_counts - self._motor_counts) / self._spec.detector.fine.counts

    @property
    def _target_counts(self) -> int:
        positioner = self._state.controller.positioner
        angle = positioner.angle
        return angle.position + positioner.oar - angle.aar - self._start_turns * self._spec.period

    @property
    def _motor_counts(self) -> float:
        motor, fine = self._state.plant.train.motor, self._spec.detector.fine.counts
        return motor.turns * fine + motor.angle / math.tau * fine

    @property
    def speed(self) -> float:
        """Velocity of the motor, at the table [rad/s]."""
        return self._state.plant.train.motor.velocity / self._spec.ratio
