"""What does not go together in a print-head axis; with it, the ranges that follow from the method.

Line numbers are those of the packaged example without its head comment: [axis] stands in line 1, [limits] in 6.
"""

import pytest
from tests.bad_files import added, check_bad_file, edit, params

TRAVEL = 'travel = "14.5 in"'
CYCLES = "cycles_per_revolution = 900"
RIGHT = 'coulomb = "7.55 N"'

CONTRADICTIONS = [
    edit(
        "effort",
        'effort = "38 V"',
        'effort = "39 V"',
        "9:1",
        "limits.effort",
        '"39 V"',
        "drive.supply, 38 V",
        "lower limits.effort",
    ),
    edit("too fast", '"40 in/s"', '"41 in/s"', "8:1", "limits.speed", '"41 in/s"', "3 in/s to 40 in/s", "range"),
    edit("too slow", '"40 in/s"', '"2.9 in/s"', "8:1", "limits.speed", '"2.9 in/s"', "3 in/s to 40 in/s", "range"),
    edit(
        "encoder",
        CYCLES,
        "cycles_per_revolution = 500",
        "35:1",
        "encoder.cycles_per_revolution",
        "500",
        "1/300 in",
        "42.3333 mm",
    ),
    edit("pulley", '"3 in"', '"75 mm"', "35:1", "encoder.cycles_per_revolution", "900", "1/300 in", "use 886 cycles"),
    edit("short way", TRAVEL, 'travel = "3 in"', "7:1", "limits.travel", '"3 in"', "101.6 mm", "correct limits.travel"),
    edit("long way", TRAVEL, 'travel = "6 m"', "7:1", "limits.travel", '"6 m"', "5.549 m", "correct limits.travel"),
    added(
        "print speed",
        '[method]\nmax_print_speed = "40 in/s"',
        "--set",
        "limits.speed",
        "30 in/s",
        "max_print_speed",
        "lower",
        overrides=("limits.speed=30 in/s",),
    ),
    added(
        "homing speed",
        '[homing]\nspeed = "10.1 in/s"',
        "48:1",
        "homing.speed",
        '"10.1 in/s"',
        "3 in/s to 10 in/s",
        "range",
    ),
    added(
        "homing above limit",
        '[homing]\nspeed = "6 in/s"',
        "--set",
        "limits.speed",
        "5 in/s",
        "homing.speed",
        "lower",
        overrides=("limits.speed=5 in/s",),
    ),
    added("start outside", "[mechanics.x]", "47:1", "mechanics.x", "unknown table", "carriage_mass", "remove it"),
    edit(
        "start position",
        'carriage_mass = "1.1 kg"',
        'carriage_mass = "1.1 kg"\nstart_position = "15 in"',
        "25:1",
        "mechanics.start_position",
        '"15 in"',
        "368.3 mm",
        "lower",
    ),
    added(
        "left margin", '[print]\nleft_margin = "14.5 in"', "48:1", "print.left_margin", '"14.5 in"', "368.3 mm", "lower"
    ),
    added(
        "width tolerance",
        '[homing]\nwidth_tolerance = "1 m"',
        "48:1",
        "homing.width_tolerance",
        '"1 m"',
        "368.3 mm",
        "lower",
    ),
    added(
        "obstacle",
        '[disturbance.obstacle]\nposition = "20 in"',
        "48:1",
        "disturbance.obstacle.position",
        '"20 in"',
        "14.5 in",
        "lower",
    ),
    added(
        "obstacle without place",
        "[disturbance.obstacle]",
        "47:1",
        "disturbance.obstacle.position",
        "nothing",
        "a length",
        "add position",
    ),
    added(
        "push without time",
        '[disturbance.push]\nforce = "3 N"\nduration = "1 s"',
        "47:1",
        "disturbance.push.at",
        "nothing",
        "a time",
        "add at",
    ),
    edit(
        "stiction",
        RIGHT,
        f'{RIGHT}\nstatic = "5 N"',
        "30:1",
        "mechanics.friction.right.static",
        '"5 N"',
        "7.55 N",
        "1.15 x coulomb",
    ),
    edit("no mass", '"1.1 kg"', '"0 kg"', "24:1", "mechanics.carriage_mass", '"0 kg"', "above 0 kg", "range"),
    added(
        "slope range",
        "[method]\nslope_min = 255",
        "48:1",
        "method.slope_min",
        "255",
        "slope_max, 255",
        "lower method.slope_min",
    ),
    added("default slope", "[method]\ndefault_slope = 90", "48:1", "method.default_slope", "90", "100", "plausible"),
    added(
        "slope limit alone",
        "[method]\nslope_min = 160",
        "48:1",
        "method.slope_min",
        "160",
        "method.default_slope (its default)",
        "plausible",
    ),
    added(
        "default friction",
        "[method]\ndefault_friction_counts = 85",
        "48:1",
        "method.default_friction_counts",
        "85",
        "80",
        "raise",
    ),
    added(
        "homing drive", "[homing]\ndrive_limit_counts = 51", "48:1", "homing.drive_limit_counts", "51", "= 52", "raise"
    ),
    added(
        "contact timeout",
        '[homing]\ncontact_timeout = "5 ms"',
        "48:1",
        "homing.contact_timeout",
        '"5 ms"',
        "longer than",
        "raise",
    ),
    added(
        "zero-speed timeout",
        '[method]\nzero_speed_timeout = "1 ms"',
        "48:1",
        "method.zero_speed_timeout",
        '"1 ms"',
        "1.2 ms",
        "range",
    ),
    added(
        "another supply",
        '[disturbance]\nsupply = "12 V"',
        "48:1",
        "disturbance.supply",
        '"12 V"',
        "19 V to 76 V",
        "a drift",
    ),
]

TABLE = params(contradiction=CONTRADICTIONS)


@pytest.mark.parametrize("bad", TABLE)
def test_contradiction(bad, good_text, load_text):
    check_bad_file(bad, good_text, load_text)
