"""The stepper catalogue's figures: readable, sourced, and those of real motors of their size."""

import math
from pathlib import Path

import pytest

from detent.axisfile import catalogue
from detent.axisfile.catalogue import STEPPER_MOTORS
from detent.units import parse_quantity

MOTORS = STEPPER_MOTORS.entries()
COMPLETE = [name for name, entry in MOTORS.items() if "rotor_inertia" in entry]
FRAMED = [name for name in COMPLETE if "frame" in MOTORS[name]]
DOCUMENTING = {"name", "maker", "source", "frame", "rated_voltage", "detent_torque"}
UNITS = {
    "holding_torque": "N*m",
    "rotor_inertia": "kg*m^2",
    "resistance": "ohm",
    "inductance": "H",
    "rated_current": "A",
    "rated_voltage": "V",
    "detent_torque": "N*m",
}
SLIPPED_POINTS = [(key, factor) for key in STEPPER_MOTORS.keys if key in UNITS for factor in (0.1, 10.0)]


def figures_of(name):
    """Every quantity of an entry, in SI units."""
    entry = MOTORS[name]
    return {key: parse_quantity(entry[key], unit) for key, unit in UNITS.items() if key in entry}


def rotor_teeth(name):
    """A two-phase motor makes four full steps per tooth (hybrid) or pole pair (permanent magnet)."""
    return MOTORS[name]["steps_per_turn"] / 4


def frame_side(name):
    """Side of the flange: the NEMA number is its length in tenths of an inch."""
    return int(MOTORS[name]["frame"].removeprefix("NEMA ")) * 2.54e-3


def heat(figures):
    """Power of both phases at rated current."""
    return 2 * figures["resistance"] * figures["rated_current"] ** 2


def natural_frequency(figures, teeth):
    """Small swing of the bare rotor about a step: J x'' = -T sin(teeth x)."""
    return math.sqrt(teeth * figures["holding_torque"] / figures["rotor_inertia"]) / math.tau


def time_constant(figures):
    return figures["inductance"] / figures["resistance"]


def measures_of(figures, teeth, side):
    """What hardly depends on a hybrid motor's size, each with the range that real motors lie in.

    Of two similar motors the larger sheds heat as its surface, has the time constant of the square of its size and a
    torque per root of heat of the cube of its size. Every range is narrower than one decade in the figures under it
    (two for a square, half for a root), so that no slip of the decimal point stays inside all of them.
    """
    return {
        "natural frequency [Hz]": (natural_frequency(figures, teeth), 130, 400),
        "heat per flange [W/m^2]": (heat(figures) / side**2, 1.5e3, 13e3),
        "time constant per flange [s/m^2]": (time_constant(figures) / side**2, 0.17, 1.6),
        "torque per root of heat [N*m/W^0.5/m^3]": (
            figures["holding_torque"] / math.sqrt(heat(figures)) / side**3,
            360,
            3400,
        ),
    }


def misfits(figures, teeth, side):
    measures = measures_of(figures, teeth, side)
    return {what: value for what, (value, lowest, highest) in measures.items() if not lowest < value < highest}


def test_there_is_a_choice_of_motors_makers_and_sizes():
    assert len(COMPLETE) >= 12
    assert len({MOTORS[name]["maker"] for name in COMPLETE}) >= 5
    assert {MOTORS[name]["frame"] for name in FRAMED} == {f"NEMA {size}" for size in (11, 14, 17, 23, 34)}
    assert {MOTORS[name]["steps_per_turn"] for name in COMPLETE} == {48, 200, 400}


def test_no_name_is_given_twice():
    text = Path(catalogue.__file__).with_name(STEPPER_MOTORS.file).read_text(encoding="utf-8")
    assert text.count("[[motor]]") == len(MOTORS)


@pytest.mark.parametrize("name", MOTORS)
def test_an_entry_has_known_keys_a_source_and_readable_figures(name):
    entry = MOTORS[name]
    needed = {"name", "maker", "source", *STEPPER_MOTORS.keys} - {"rotor_inertia"}
    assert needed <= set(entry) <= DOCUMENTING | set(STEPPER_MOTORS.keys)
    assert len(entry["source"]) > 20
    assert len(entry["name"]) <= 80
    assert type(entry["steps_per_turn"]) is int
    assert entry["steps_per_turn"] % 4 == 0
    assert all(figure > 0 for figure in figures_of(name).values())


@pytest.mark.parametrize("name", COMPLETE)
def test_an_entry_is_a_motor_by_any_size(name):
    # What no stepper of a hand's size leaves, whatever its frame: a swapped pair of columns or a wrong unit does.
    figures = figures_of(name)
    assert 0.3e-3 < time_constant(figures) < 12e-3
    assert 4 < heat(figures) < 35
    assert 70 < natural_frequency(figures, rotor_teeth(name)) < 400


@pytest.mark.parametrize("name", FRAMED)
def test_a_hybrid_motors_figures_fit_its_frame(name):
    assert misfits(figures_of(name), rotor_teeth(name), frame_side(name)) == {}


@pytest.mark.parametrize("name", FRAMED)
@pytest.mark.parametrize(("key", "factor"), SLIPPED_POINTS)
def test_a_slipped_decimal_point_would_show(name, key, factor):
    figures = figures_of(name)
    figures[key] *= factor
    assert misfits(figures, rotor_teeth(name), frame_side(name))


@pytest.mark.parametrize("name", [name for name, entry in MOTORS.items() if "rated_voltage" in entry])
def test_rated_voltage_drives_the_rated_current(name):
    # At rest there is no back-EMF: the resistance alone limits the current. Sheets round the voltage to two digits.
    figures = figures_of(name)
    assert figures["resistance"] * figures["rated_current"] == pytest.approx(figures["rated_voltage"], rel=0.03)


@pytest.mark.parametrize("name", [name for name, entry in MOTORS.items() if "detent_torque" in entry])
def test_detent_torque_is_a_small_part_of_holding_torque(name):
    figures = figures_of(name)
    assert 0.02 < figures["detent_torque"] / figures["holding_torque"] < 0.1


def test_one_motor_wired_in_series_and_in_parallel_stays_one_motor():
    # In series the windings carry half the current through four times the resistance and inductance: the same heat.
    series = figures_of("Trinamic QSH8618-65-59-340 (series)")
    parallel = figures_of("Trinamic QSH8618-65-59-340 (parallel)")
    for key, ratio in {"resistance": 4, "inductance": 4, "rated_current": 0.5}.items():
        assert series[key] / parallel[key] == pytest.approx(ratio, rel=0.02)
    assert series["rotor_inertia"] == parallel["rotor_inertia"]
    assert series["holding_torque"] == parallel["holding_torque"]


def test_constants_are_what_an_axis_file_would_state():
    assert STEPPER_MOTORS.constants("Trinamic QSH4218-35-10-027") == {
        "steps_per_turn": 200,
        "holding_torque": "27 N*cm",
        "rotor_inertia": "35 g*cm^2",
        "resistance": "5.3 ohm",
        "inductance": "6.6 mH",
        "rated_current": "1.0 A",
    }


def test_an_unpublished_constant_is_left_to_the_axis_file():
    constants = STEPPER_MOTORS.constants("Motech MT-2303HS280AW")
    assert set(STEPPER_MOTORS.keys) - set(constants) == {"rotor_inertia"}


def test_an_unknown_motor_has_no_constants():
    assert STEPPER_MOTORS.constants("perpetuum mobile") is None
    assert STEPPER_MOTORS.constants("maxon RE 40 148867") is None
