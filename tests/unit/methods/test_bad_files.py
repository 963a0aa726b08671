"""Every way to get an axis file wrong: place, key, what it got, what it expected, what to try.

Line numbers are those of the packaged example without its head comment: [axis] stands in line 1, [limits] in 6.
"""

import pytest
from tests.bad_files import Bad, added, check_bad_file, edit, given, params

TRAVEL = 'travel = "14.5 in"'
SUPPLY = 'supply = "38 V"'
CYCLES = "cycles_per_revolution = 900"
CATALOGUE = 'catalogue = "JDH-2250-DF-1C (inferred)"'
RIGHT = 'coulomb = "7.55 N"'
NAME = 'name = "print head"'

QUANTITIES = [
    edit("bare number", TRAVEL, "travel = 14.5", "7:1", "limits.travel"),
    edit("whole number", TRAVEL, "travel = 14", "7:1", "limits.travel"),
    edit("number in quotes", TRAVEL, 'travel = "14.5"', "7:1", "limits.travel"),
    edit("wrong dimension", TRAVEL, 'travel = "12 V"', "7:1", "limits.travel"),
    edit("unknown unit", TRAVEL, 'travel = "12 inch es"', "7:1", "limits.travel"),
    edit("no number", TRAVEL, 'travel = "long"', "7:1", "limits.travel"),
    edit("empty", TRAVEL, 'travel = ""', "7:1", "limits.travel"),
    edit("negative", TRAVEL, 'travel = "-14.5 in"', "7:1", "limits.travel"),
    edit("zero", TRAVEL, 'travel = "0 in"', "7:1", "limits.travel"),
    edit("too large", TRAVEL, 'travel = "14.5 km"', "7:1", "limits.travel"),
    edit("a list", TRAVEL, 'travel = ["14.5 in"]', "7:1", "limits.travel"),
    edit("a date", TRAVEL, "travel = 1979-05-27", "7:1", "limits.travel"),
    edit("true", TRAVEL, "travel = true", "7:1", "limits.travel"),
    edit("a table", TRAVEL, "travel = { value = 3 }", "7:1", "limits.travel"),
    edit("many lines", TRAVEL, 'travel = """\n3\nV"""', "7:1", "limits.travel"),
    edit("infinite", SUPPLY, 'supply = "inf V"', "20:1", "drive.supply"),
    edit("endless", SUPPLY, f'''supply = "{"9" * 90} V"''', "20:1", "drive.supply"),
    edit("mass for force", RIGHT, 'coulomb = "7 kg"', "29:1", "mechanics.friction.right.coulomb"),
    edit("ounces", CATALOGUE, f'{CATALOGUE}\ntorque_constant = "34 oz*in/A"', "13:1", "motor.torque_constant"),
    edit("volts per hertz", CATALOGUE, f'{CATALOGUE}\nback_emf_constant = "1 V/Hz"', "13:1", "motor.back_emf_constant"),
    added("percentage without sign", "[disturbance]\nfriction_left = 20", "48:1", "disturbance.friction_left"),
    added("percentage too low", '[disturbance]\nmotor_constant = "-95 %"', "48:1", "disturbance.motor_constant"),
]

NUMBERS_AND_WORDS = [
    edit("quoted integer", CYCLES, CYCLES.replace("900", '"900"'), "35:1", "encoder.cycles_per_revolution"),
    edit("a fraction", CYCLES, CYCLES.replace("900", "900.5"), "35:1", "encoder.cycles_per_revolution"),
    edit("a float", CYCLES, CYCLES.replace("900", "900.0"), "35:1", "encoder.cycles_per_revolution"),
    edit("not a number", CYCLES, CYCLES.replace("900", "nan"), "35:1", "encoder.cycles_per_revolution"),
    edit("a switch", CYCLES, CYCLES.replace("900", "true"), "35:1", "encoder.cycles_per_revolution"),
    edit("nought", CYCLES, CYCLES.replace("900", "0"), "35:1", "encoder.cycles_per_revolution"),
    edit("below nought", CYCLES, f"{CYCLES}\nseed = -1", "36:1", "encoder.seed"),
    edit("probability", CYCLES, f"{CYCLES}\nmissing_edges = 0.7", "36:1", "encoder.missing_edges"),
    edit("probability nan", CYCLES, f"{CYCLES}\nmissing_edges = nan", "36:1", "encoder.missing_edges"),
    edit("probability quoted", CYCLES, f'{CYCLES}\nmissing_edges = "0.1"', "36:1", "encoder.missing_edges"),
    edit("jitter", CYCLES, f'{CYCLES}\njitter = "40 deg"', "36:1", "encoder.jitter"),
    added("misspelt choice", '[method]\nspan = "emff"', "48:1", "method.span"),
    added("capital choice", '[method]\nspan = "Steady"', "48:1", "method.span"),
    added("number for choice", "[method]\nspan = 3", "48:1", "method.span"),
    added("quoted switch", '[method]\ntrim = "no"', "48:1", "method.trim"),
    added("number for switch", "[method]\ntrim = 1", "48:1", "method.trim"),
    edit("number for text", NAME, "name = 3", "2:1", "axis.name"),
    edit("no name", NAME, 'name = ""', "2:1", "axis.name"),
    edit("fidelity", NAME, f'{NAME}\nfidelity = "exact"', "3:1", "axis.fidelity"),
]

KEYS_AND_TABLES = [
    edit("misspelt key", "travel =", "travle =", "7:1", "limits.travle"),
    edit("capital key", "travel =", "Travel =", "7:1", "limits.Travel"),
    edit("foreign key", "[encoder]", '[encoder]\nsupply = "3 V"', "35:1", "encoder.supply"),
    edit("unheard key", "[encoder]", "[encoder]\nxyzzy = 1", "35:1", "encoder.xyzzy"),
    edit("quoted key", "[encoder]", '[encoder]\n"a b" = 1', "35:1", 'encoder."a b"'),
    edit("misspelt table", "[limits]", "[limit]", "6:1", "limit"),
    added("unheard table", "[colours]\nred = 1", "47:1", "colours"),
    edit("missing key", TRAVEL, "", "6:1", "limits.travel"),
    edit("missing name", NAME, "", "1:1", "axis.name"),
    edit("missing method", 'method = "print_head"', "", "1:1", "axis.method"),
    edit("missing table", f"[drive]\n{SUPPLY}", "", "1:1", "drive"),
    edit("missing direction", '[mechanics.friction.left]\ncoulomb = "5.87 N"', "", "28:1", "mechanics.friction.left"),
    edit("missing motor", CATALOGUE, "", "11:1", "motor.torque_constant", others=3),
    Bad("value for a table", "1:1", "drive", edits=((f"[drive]\n{SUPPLY}", ""), ("[axis]", "drive = 38\n[axis]"))),
    edit("list of tables", "[axis]", "[[axis]]", "1:1", "axis"),
    edit("other method", '"print_head"', '"lathe"', "3:1", "axis.method"),
    edit("method with a hyphen", '"print_head"', '"rotary-table"', "3:1", "axis.method"),
    edit("almost the method", '"print_head"', '"Print-Head"', "3:1", "axis.method"),
    edit("method as number", 'method = "print_head"', "method = 1", "3:1", "axis.method"),
    edit("catalogue", "JDH-2250-DF-1C (inferred)", "maxon RE40", "12:1", "motor.catalogue"),
    edit("no such motor", "JDH-2250-DF-1C (inferred)", "%%%%", "12:1", "motor.catalogue"),
    edit("catalogue as number", CATALOGUE, "catalogue = 40", "12:1", "motor.catalogue", others=0),
    edit("motor without inductance", "JDH-2250-DF-1C (inferred)", "Pittman 14201S003", "11:1", "motor.inductance"),
]
SYNTAX = [
    edit("unquoted quantity", TRAVEL, "travel = 14.5 in", "7:15", "travel"),
    edit("unquoted word", 'method = "print_head"', "method = print_head", "3:10", "method"),
    edit("yes for true", NAME, f"{NAME}\ntrim = yes", "3:8", "trim"),
    edit("capital false", NAME, f"{NAME}\ntrim = False", "3:8", "trim"),
    edit("no value", TRAVEL, "travel =", "7:27", "travel"),
    edit("open quotes", 'name = "print head"', 'name = "print head', "2:19", "name"),
    edit("open bracket", "[limits]", "[limits", "6:36", "limits"),
    edit("colon", 'speed = "40 in/s"', 'speed: "40 in/s"', "8:6", "speed"),
    edit("key twice", TRAVEL, f"{TRAVEL}\n{TRAVEL}", "8:", "travel"),
    added("table twice", '[limits]\nspeed = "3 in/s"', "47:8", "limits"),
    edit("two values", TRAVEL, f'{TRAVEL} "x"', "7:20", ""),
    edit("a huge number", CYCLES, f"cycles_per_revolution = {'9' * 5000}", "35:1", "cycles_per_revolution"),
    Bad("deep nesting", "1:1", "", text="a = " + "[" * 5000),
    Bad("prose", "1:6", "", text="Dear axis,\n"),
    Bad("no key", "1:1", "", text="= 3\n"),
    Bad("unfinished text", "2:6", "", text='a = """\nabc  ', append=""),
]

OVERRIDES = [
    given("no equals sign", "nonsense", key="nonsense"),
    given("no value", "drive.supply=", key="drive.supply"),
    given("misspelt key", "drive.suply=34 V", key="drive.suply"),
    given("unheard key", "qqqqqq=1", key="qqqqqq"),
    given("a table", "drive=1", key="drive"),
    given("bare number", "drive.supply=34", key="drive.supply"),
    given("wrong dimension", "drive.supply=34 A", key="drive.supply"),
    given("choice", "method.span=fast", key="method.span"),
    given("switch", "method.trim=maybe", key="method.trim"),
    given("fraction", "encoder.cycles_per_revolution=1.5", key="encoder.cycles_per_revolution"),
    given("method", "axis.method=lathe", key="axis.method"),
    given("part of a method", "axis.method=stepper", key="axis.method"),
    given("catalogue", "motor.catalogue=maxon RE 4", key="motor.catalogue"),
    given("supply below effort", "drive.supply=34 V", key="drive.supply"),
]

TABLE = params(quantity=QUANTITIES, value=NUMBERS_AND_WORDS, key=KEYS_AND_TABLES, syntax=SYNTAX, override=OVERRIDES)


def test_the_table_is_long_enough_to_mean_something():
    assert len(TABLE) >= 60


@pytest.mark.parametrize("bad", TABLE)
def test_bad_file(bad, good_text, load_text, golden):
    check_bad_file(bad, good_text, load_text, golden)
