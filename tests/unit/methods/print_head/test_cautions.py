"""Warnings about a print-head axis that can be built."""

import pytest

from detent.methods.print_head.cautions import find_cautions


def cautions(load_text, text, *overrides):
    return {caution.name: caution for caution in find_cautions(load_text(text, *overrides).spec)}


def test_the_default_plant_has_nothing_to_warn_about(load_text, good_text):
    assert cautions(load_text, good_text) == {}


@pytest.mark.parametrize(
    ("overrides", "name", "words"),
    [
        (["disturbance.motor_constant=+10 %"], "drive at top speed, right", ["300 counts", "lower limits.speed"]),
        (["limits.effort=36 V"], "drive at top speed, right", ["284.2 counts", "in/s"]),
        (["motor.catalogue=maxon RE 40 148867"], "slope K, left", ["100 to 255/256", "SB1 10"]),
        (["motor.catalogue=maxon RE 40 148867"], "fast calibration pass, left", ["faster than the axis may"]),
        (["motor.catalogue=maxon RE 40 148867"], "ramp interval at top speed", ["350 us to 450 us", "weak"]),
        (
            ["motor.torque_constant=0.31 N*m/A", "motor.back_emf_constant=0.31 V*s/rad"],
            "ramp interval at top speed",
            ["strong"],
        ),
        (["method.friction_max_counts=33"], "friction, right", ["0 to 33 counts"]),
        (["mechanics.carriage_mass=2 kg"], "acceleration from the IR counts", ["longer", "method.ir_counts = 161"]),
        (["mechanics.carriage_mass=0.5 kg"], "acceleration from the IR counts", ["shorter"]),
        (["mechanics.friction.left.static=30 N"], "static friction, left", ["124 counts", "break the head loose"]),
        (["mechanics.friction.right.coulomb=14 N"], "slow calibration pass, right", ["friction holds the head"]),
        (["homing.speed=10 in/s", "homing.drive_limit_counts=60"], "homing drive, right", ["looks like a frame"]),
        (["motor.inductance=0.1 mH"], "electrical time constant", ["8.333 us", "switch-level"]),
        (["motor.max_current=1 A"], "current while accelerating", ["1.393 A", "1 A", "overheats"]),
        (["motor.max_current=1 A"], "stall current while homing", ["1.161 A", "homing.drive_limit_counts"]),
    ],
)
def test_warnings_say_value_limit_consequence_and_remedy(load_text, good_text, overrides, name, words):
    found = cautions(load_text, good_text, *overrides)
    for word in words:
        assert word in str(found[name])


def test_the_switch_level_bridge_shows_current_gaps_so_nothing_is_warned(load_text, good_text):
    overrides = ["motor.inductance=0.1 mH", "axis.fidelity=switch-level"]
    assert "electrical time constant" not in cautions(load_text, good_text, *overrides)
