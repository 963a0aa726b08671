"""Published constants of real motors, by name, as an axis file may take them."""

import tomllib
from functools import cache
from pathlib import Path
from typing import Any

MOTORS_FILE = Path(__file__).with_name("dc_motors.toml")

MOTOR_KEYS = ("torque_constant", "back_emf_constant", "resistance", "inductance", "rotor_inertia", "max_current")
"""Keys of an entry that stand in for keys of the same name in ``[motor]``; the others document the motor."""


@cache
def dc_motors() -> dict[str, dict[str, Any]]:
    """All brush DC motors of the catalogue, by name, as they stand in the file (texts with units)."""
    entries: list[dict[str, Any]] = tomllib.loads(MOTORS_FILE.read_text(encoding="utf-8"))["motor"]
    return {str(entry["name"]): entry for entry in entries}


def motor_constants(name: str) -> dict[str, str] | None:
    """Constants of a motor as an axis file would state them, or None when the catalogue has no such motor.

    Examples
    --------
    >>> motor_constants("maxon RE 40 148867")["resistance"]
    '0.299 ohm'
    """
    entry = dc_motors().get(name)
    if entry is None:
        return None
    return {key: str(entry[key]) for key in MOTOR_KEYS if key in entry}
