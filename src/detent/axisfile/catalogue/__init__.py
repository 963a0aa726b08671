"""Published constants of real motors, by name, as an axis file may take them."""

import tomllib
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any


@cache
def _entries(file: str) -> dict[str, dict[str, Any]]:
    """All motors of a file beside this module, by name; a file is read once."""
    text = Path(__file__).with_name(file).read_text(encoding="utf-8")
    return {str(entry["name"]): entry for entry in tomllib.loads(text)["motor"]}


@dataclass(frozen=True)
class Catalogue:
    """Motors of one kind, in one TOML file of ``[[motor]]`` tables."""

    file: str  # name of the file, beside this module
    # keys of an entry that stand in for keys of the same name in ``[motor]``; the others document the motor
    keys: tuple[str, ...]

    def entries(self) -> dict[str, dict[str, Any]]:
        """All motors, by name, as they stand in the file: quantities are texts with units, counts are integers."""
        return _entries(self.file)

    def constants(self, name: str) -> dict[str, str | int] | None:
        """Constants of a motor as an axis file would state them, or None when the catalogue has no such motor.

        >>> STEPPER_MOTORS.constants("MotionKing 17HS4401")["steps_per_turn"]
        200
        """
        entry = self.entries().get(name)
        if entry is None:
            return None
        return {key: entry[key] for key in self.keys if key in entry}


DC_MOTORS = Catalogue(
    "dc_motors.toml",
    ("torque_constant", "back_emf_constant", "resistance", "inductance", "rotor_inertia", "max_current"),
)
"""Brush DC motors."""

STEPPER_MOTORS = Catalogue(
    "stepper_motors.toml",
    ("steps_per_turn", "holding_torque", "rotor_inertia", "resistance", "inductance", "rated_current"),
)
"""Two-phase stepper motors: hybrid and permanent-magnet; resistance, inductance and current of one phase."""
