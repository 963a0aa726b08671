"""What does not go together in a print-head axis; with it, the ranges that follow from the method.

Line numbers are those of the packaged example without its head comment: [axis] stands in line 1, [limits] in 6.
"""

import pytest
from tests.bad_files import added, check_bad_file, edit, params

TRAVEL = 'travel = "14.5 in"'
CYCLES = "cycles_per_revolution = 900"
RIGHT = 'coulomb = "7.55 N"'

CONTRADICTIONS = [
    edit("effort", 'effort = "38 V"', 'effort = "39 V"', "9:1", "limits.effort"),
    edit("too fast", '"40 in/s"', '"41 in/s"', "8:1", "limits.speed"),
    edit("too slow", '"40 in/s"', '"2.9 in/s"', "8:1", "limits.speed"),
    edit("encoder", CYCLES, "cycles_per_revolution = 500", "35:1", "encoder.cycles_per_revolution"),
    edit("pulley", '"3 in"', '"75 mm"', "35:1", "encoder.cycles_per_revolution"),
    edit("short way", TRAVEL, 'travel = "3 in"', "7:1", "limits.travel"),
    edit("long way", TRAVEL, 'travel = "6 m"', "7:1", "limits.travel"),
    added(
        "print speed",
        '[method]\nmax_print_speed = "40 in/s"',
        "--set",
        "limits.speed",
        overrides=("limits.speed=30 in/s",),
    ),
    added("homing speed", '[homing]\nspeed = "10.1 in/s"', "48:1", "homing.speed"),
    added(
        "homing above limit", '[homing]\nspeed = "6 in/s"', "--set", "limits.speed", overrides=("limits.speed=5 in/s",)
    ),
    added("start outside", "[mechanics.x]", "47:1", "mechanics.x"),
    edit(
        "start position",
        'carriage_mass = "1.1 kg"',
        'carriage_mass = "1.1 kg"\nstart_position = "15 in"',
        "25:1",
        "mechanics.start_position",
    ),
    added("left margin", '[print]\nleft_margin = "14.5 in"', "48:1", "print.left_margin"),
    added("width tolerance", '[homing]\nwidth_tolerance = "1 m"', "48:1", "homing.width_tolerance"),
    added("obstacle", '[disturbance.obstacle]\nposition = "20 in"', "48:1", "disturbance.obstacle.position"),
    added("obstacle without place", "[disturbance.obstacle]", "47:1", "disturbance.obstacle.position"),
    added("push without time", '[disturbance.push]\nforce = "3 N"\nduration = "1 s"', "47:1", "disturbance.push.at"),
    edit("stiction", RIGHT, f'{RIGHT}\nstatic = "5 N"', "30:1", "mechanics.friction.right.static"),
    edit("no mass", '"1.1 kg"', '"0 kg"', "24:1", "mechanics.carriage_mass"),
    added("slope range", "[method]\nslope_min = 255", "48:1", "method.slope_min"),
    added("default slope", "[method]\ndefault_slope = 90", "48:1", "method.default_slope"),
    added("slope limit alone", "[method]\nslope_min = 160", "48:1", "method.slope_min"),
    added("default friction", "[method]\ndefault_friction_counts = 85", "48:1", "method.default_friction_counts"),
    added("homing drive", "[homing]\ndrive_limit_counts = 51", "48:1", "homing.drive_limit_counts"),
    added("contact timeout", '[homing]\ncontact_timeout = "5 ms"', "48:1", "homing.contact_timeout"),
    added("zero-speed timeout", '[method]\nzero_speed_timeout = "1 ms"', "48:1", "method.zero_speed_timeout"),
    added("another supply", '[disturbance]\nsupply = "12 V"', "48:1", "disturbance.supply"),
]

TABLE = params(contradiction=CONTRADICTIONS)


@pytest.mark.parametrize("bad", TABLE)
def test_contradiction(bad, good_text, load_text, golden):
    check_bad_file(bad, good_text, load_text, golden)
