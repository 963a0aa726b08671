"""Warnings about a print-head axis that can be built."""

from functools import partial

import pytest
from tests.remedies import check_caution

from detent.methods.print_head.checks import find_cautions


def cautions(load_text, text, *overrides):
    return {caution.name: caution for caution in find_cautions(load_text(text, *overrides).spec)}


def test_the_default_plant_has_nothing_to_warn_about(load_text, good_text):
    assert cautions(load_text, good_text) == {}


@pytest.mark.parametrize(
    ("overrides", "name"),
    [
        (["disturbance.motor_constant=+10 %"], "drive at top speed, right"),
        (["limits.effort=36 V"], "drive at top speed, right"),
        (["motor.catalogue=maxon RE 40 148867"], "slope K, left"),
        (["motor.catalogue=maxon RE 40 148867"], "fast calibration pass, left"),
        (["motor.catalogue=maxon RE 40 148867"], "ramp interval at top speed"),
        (["motor.torque_constant=0.31 N*m/A", "motor.back_emf_constant=0.31 V*s/rad"], "ramp interval at top speed"),
        (["method.friction_max_counts=33"], "friction, right"),
        (["mechanics.carriage_mass=2 kg"], "acceleration from the IR counts"),
        (["mechanics.carriage_mass=0.5 kg"], "acceleration from the IR counts"),
        (["mechanics.friction.left.static=30 N"], "static friction, left"),
        (["mechanics.friction.right.coulomb=14 N"], "slow calibration pass, right"),
        (["homing.speed=10 in/s", "homing.drive_limit_counts=60"], "homing drive, right"),
        (["limits.speed=12 in/s", "method.max_print_speed=12 in/s"], "identification"),
        (["limits.speed=20 in/s", "method.max_print_speed=20 in/s"], "tolerance of the identification"),
        (["motor.inductance=0.1 mH"], "electrical time constant"),
        (["motor.max_current=1 A"], "current while accelerating"),
        (["motor.max_current=1 A"], "stall current while homing"),
    ],
)
def test_warnings_say_value_limit_consequence_and_remedy(load_text, good_text, golden, overrides, name):
    found = cautions(load_text, good_text, *overrides)
    golden(f"{name}, {' '.join(overrides)}", found[name])
    # The IR counts named are in the middle of what will do.
    at_bound = name != "acceleration from the IR counts"
    check_caution(partial(cautions, load_text, good_text), overrides, name, found[name], at_bound=at_bound)


def test_the_switch_level_bridge_shows_current_gaps_so_nothing_is_warned(load_text, good_text):
    overrides = ["motor.inductance=0.1 mH", "axis.fidelity=switch-level"]
    assert "electrical time constant" not in cautions(load_text, good_text, *overrides)
