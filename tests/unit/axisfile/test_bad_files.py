"""Every way to get an axis file wrong: place, key, what came, what is allowed, what to do.

Line numbers are those of the packaged example without its head comment: [axis] stands in line 1, [limits] in 6.
"""

from dataclasses import dataclass

import pytest

from detent.errors import InputError


@dataclass(frozen=True)
class Bad:
    """One bad file: edits of the good one, or a text of its own, and the problem expected."""

    name: str
    place: str
    key: str
    came: str
    allowed: str
    remedy: str
    edits: tuple[tuple[str, str], ...] = ()
    text: str | None = None
    append: str = ""
    overrides: tuple[str, ...] = ()
    others: int = 0

    def make(self, good):
        text = good if self.text is None else self.text
        for old, new in self.edits:
            assert old in text, old
            text = text.replace(old, new, 1)
        return text + self.append


TRAVEL = 'travel = "14.5 in"'
SUPPLY = 'supply = "38 V"'
CYCLES = "cycles_per_revolution = 900"
CATALOGUE = 'catalogue = "JDH-2250-DF-1C (inferred)"'
RIGHT = 'coulomb = "7.55 N"'
NAME = 'name = "print head"'


def edit(name, old, new, place, key, came, allowed, remedy, **more):
    return Bad(name, place, key, came, allowed, remedy, edits=((old, new),), **more)


def added(name, lines, place, key, came, allowed, remedy, **more):
    return Bad(name, place, key, came, allowed, remedy, append=f"\n{lines}\n", **more)


def given(name, override, key, came, allowed, remedy, **more):
    return Bad(name, "--set", key, came, allowed, remedy, overrides=(override,), **more)


QUANTITIES = [
    edit("bare number", TRAVEL, "travel = 14.5", "7:1", "limits.travel", "14.5", "a length", '"12 mm"'),
    edit("whole number", TRAVEL, "travel = 14", "7:1", "limits.travel", "14", "a length", "text with a unit"),
    edit("number in quotes", TRAVEL, 'travel = "14.5"', "7:1", "limits.travel", '"14.5"', "a length", "the unit after"),
    edit("wrong dimension", TRAVEL, 'travel = "12 V"', "7:1", "limits.travel", '"12 V"', "a length", "same dimension"),
    edit("unknown unit", TRAVEL, 'travel = "12 inch es"', "7:1", "limits.travel", "inch es", "a length", "use a unit"),
    edit("no number", TRAVEL, 'travel = "long"', "7:1", "limits.travel", '"long"', "a length", "write a length"),
    edit("empty", TRAVEL, 'travel = ""', "7:1", "limits.travel", '""', "a length", "write a length"),
    edit("negative", TRAVEL, 'travel = "-14.5 in"', "7:1", "limits.travel", '"-14.5 in"', "above 0 m", "free way"),
    edit("zero", TRAVEL, 'travel = "0 in"', "7:1", "limits.travel", '"0 in"', "above 0 m", "in this range"),
    edit("too large", TRAVEL, 'travel = "14.5 km"', "7:1", "limits.travel", '"14.5 km"', "up to 10 m", "in this range"),
    edit("a list", TRAVEL, 'travel = ["14.5 in"]', "7:1", "limits.travel", '["14.5 in"]', "a length", "text with"),
    edit("a date", TRAVEL, "travel = 1979-05-27", "7:1", "limits.travel", "1979-05-27", "a length", "text with"),
    edit("true", TRAVEL, "travel = true", "7:1", "limits.travel", "true", "a length", "text with a unit"),
    edit("a table", TRAVEL, "travel = { value = 3 }", "7:1", "limits.travel", "{ value = 3 }", "a length", "text with"),
    edit("many lines", TRAVEL, 'travel = """\n3\nV"""', "7:1", "limits.travel", '"""...', "a length", "same dimension"),
    edit("infinite", SUPPLY, 'supply = "inf V"', "20:1", "drive.supply", '"inf V"', "a voltage", "write a voltage"),
    edit("endless", SUPPLY, f'supply = "{"9" * 90} V"', "20:1", "drive.supply", '"999', "a voltage", "write a voltage"),
    edit(
        "mass for force",
        RIGHT,
        'coulomb = "7 kg"',
        "29:1",
        "mechanics.friction.right.coulomb",
        '"7 kg"',
        "a force",
        "N",
    ),
    edit(
        "ounces",
        CATALOGUE,
        f'{CATALOGUE}\ntorque_constant = "34 oz*in/A"',
        "13:1",
        "motor.torque_constant",
        "34 oz*in/A",
        "a torque constant",
        "ozf",
    ),
    edit(
        "volts per hertz",
        CATALOGUE,
        f'{CATALOGUE}\nback_emf_constant = "1 V/Hz"',
        "13:1",
        "motor.back_emf_constant",
        "1 V/Hz",
        "a back-EMF constant",
        "rpm",
    ),
    added(
        "percentage without sign",
        "[disturbance]\nfriction_left = 20",
        "48:1",
        "disturbance.friction_left",
        "20",
        "a percentage",
        '"+10 %"',
    ),
    added(
        "percentage too low",
        '[disturbance]\nmotor_constant = "-95 %"',
        "48:1",
        "disturbance.motor_constant",
        '"-95 %"',
        "from -90 % up to 200 %",
        "drift",
    ),
]

NUMBERS_AND_WORDS = [
    edit(
        "quoted integer",
        CYCLES,
        CYCLES.replace("900", '"900"'),
        "35:1",
        "encoder.cycles_per_revolution",
        '"900"',
        "whole",
        "without quotes",
    ),
    edit(
        "a fraction",
        CYCLES,
        CYCLES.replace("900", "900.5"),
        "35:1",
        "encoder.cycles_per_revolution",
        "900.5",
        "whole",
        "whole number",
    ),
    edit(
        "a float",
        CYCLES,
        CYCLES.replace("900", "900.0"),
        "35:1",
        "encoder.cycles_per_revolution",
        "900.0",
        "whole",
        "whole number",
    ),
    edit(
        "not a number",
        CYCLES,
        CYCLES.replace("900", "nan"),
        "35:1",
        "encoder.cycles_per_revolution",
        "nan",
        "whole",
        "whole number",
    ),
    edit(
        "a switch",
        CYCLES,
        CYCLES.replace("900", "true"),
        "35:1",
        "encoder.cycles_per_revolution",
        "true",
        "whole",
        "whole number",
    ),
    edit("nought", CYCLES, CYCLES.replace("900", "0"), "35:1", "encoder.cycles_per_revolution", "0", "from 1", "range"),
    edit("below nought", CYCLES, f"{CYCLES}\nseed = -1", "36:1", "encoder.seed", "-1", "from 0", "range"),
    edit(
        "probability",
        CYCLES,
        f"{CYCLES}\nmissing_edges = 0.7",
        "36:1",
        "encoder.missing_edges",
        "0.7",
        "up to 0.5",
        "range",
    ),
    edit(
        "probability nan",
        CYCLES,
        f"{CYCLES}\nmissing_edges = nan",
        "36:1",
        "encoder.missing_edges",
        "nan",
        "up to 0.5",
        "range",
    ),
    edit(
        "probability quoted",
        CYCLES,
        f'{CYCLES}\nmissing_edges = "0.1"',
        "36:1",
        "encoder.missing_edges",
        '"0.1"',
        "a number",
        "without quotes",
    ),
    edit(
        "jitter",
        CYCLES,
        f'{CYCLES}\njitter = "40 deg"',
        "36:1",
        "encoder.jitter",
        '"40 deg"',
        "30 deg of a cycle",
        "range",
    ),
    added(
        "misspelt choice",
        '[method]\nspan = "emff"',
        "48:1",
        "method.span",
        '"emff"',
        '"emf" or "steady"',
        'write "emf"',
    ),
    added(
        "capital choice",
        '[method]\nspan = "Steady"',
        "48:1",
        "method.span",
        '"Steady"',
        '"emf" or "steady"',
        'write "steady"',
    ),
    added("number for choice", "[method]\nspan = 3", "48:1", "method.span", "3", '"emf" or "steady"', "write "),
    added("quoted switch", '[method]\ntrim = "no"', "48:1", "method.trim", '"no"', "true or false", "without quotes"),
    added("number for switch", "[method]\ntrim = 1", "48:1", "method.trim", "1", "true or false", "trim = true"),
    edit("number for text", NAME, "name = 3", "2:1", "axis.name", "3", "1 to 80 characters", 'name = "3"'),
    edit("no name", NAME, 'name = ""', "2:1", "axis.name", '""', "1 to 80 characters", "reports"),
    edit(
        "fidelity", NAME, f'{NAME}\nfidelity = "exact"', "3:1", "axis.fidelity", '"exact"', '"switch-level"', "write "
    ),
]

KEYS_AND_TABLES = [
    edit(
        "misspelt key", "travel =", "travle =", "7:1", "limits.travle", '"travle"', "travel, speed, effort", '"travel"?'
    ),
    edit(
        "capital key", "travel =", "Travel =", "7:1", "limits.Travel", '"Travel"', "travel, speed, effort", '"travel"?'
    ),
    edit(
        "foreign key",
        "[encoder]",
        '[encoder]\nsupply = "3 V"',
        "35:1",
        "encoder.supply",
        '"supply"',
        "jitter",
        "to [drive]",
    ),
    edit("unheard key", "[encoder]", "[encoder]\nxyzzy = 1", "35:1", "encoder.xyzzy", '"xyzzy"', "jitter", "remove it"),
    edit("quoted key", "[encoder]", '[encoder]\n"a b" = 1', "35:1", 'encoder."a b"', '"a b"', "jitter", "remove it"),
    edit(
        "misspelt table", "[limits]", "[limit]", "6:1", "limit", "unknown table [limit]", "limits, motor", '"limits"?'
    ),
    added(
        "unheard table",
        "[colours]\nred = 1",
        "47:1",
        "colours",
        "unknown table [colours]",
        "limits, motor",
        "remove it",
    ),
    edit(
        "missing key", TRAVEL, "", "6:1", "limits.travel", "nothing", "a length", 'add travel = "14.5 in" in [limits]'
    ),
    edit("missing name", NAME, "", "1:1", "axis.name", "nothing", "characters", 'add name = "print head" in [axis]'),
    edit("missing method", 'method = "print_head"', "", "1:1", "axis.method", "nothing", '"print_head"', "add method"),
    edit("missing table", f"[drive]\n{SUPPLY}", "", "1:1", "drive", "nothing", "[drive]", "add [drive] with supply"),
    edit(
        "missing direction",
        '[mechanics.friction.left]\ncoulomb = "5.87 N"',
        "",
        "28:1",
        "mechanics.friction.left",
        "nothing",
        "the table [mechanics.friction.left]",
        "with coulomb",
    ),
    edit(
        "missing motor",
        CATALOGUE,
        "",
        "11:1",
        "motor.torque_constant",
        "nothing",
        "a torque constant",
        "catalogue",
        others=3,
    ),
    Bad(
        "value for a table",
        "1:1",
        "drive",
        "38",
        "the table [drive] with supply",
        "on a line of its own",
        edits=((f"[drive]\n{SUPPLY}", ""), ("[axis]", "drive = 38\n[axis]")),
    ),
    edit(
        "list of tables",
        "[axis]",
        "[[axis]]",
        "1:1",
        "axis",
        "a list",
        "one table [axis]",
        "one file describes one axis",
    ),
    edit(
        "other method",
        '"print_head"',
        '"rotary-table"',
        "3:1",
        "axis.method",
        '"rotary-table"',
        '"print_head"',
        "write method",
    ),
    edit(
        "almost the method",
        '"print_head"',
        '"Print-Head"',
        "3:1",
        "axis.method",
        '"Print-Head"',
        '"print_head"',
        "did you mean",
    ),
    edit(
        "method as number",
        'method = "print_head"',
        "method = 1",
        "3:1",
        "axis.method",
        "1",
        '"print_head"',
        "print_head",
    ),
    edit(
        "catalogue",
        "JDH-2250-DF-1C (inferred)",
        "maxon RE40",
        "12:1",
        "motor.catalogue",
        '"maxon RE40"',
        "Faulhaber",
        "did you mean",
    ),
    edit(
        "no such motor",
        "JDH-2250-DF-1C (inferred)",
        "%%%%",
        "12:1",
        "motor.catalogue",
        '"%%%%"',
        "Pittman",
        "choose one",
    ),
    edit(
        "catalogue as number",
        CATALOGUE,
        "catalogue = 40",
        "12:1",
        "motor.catalogue",
        "40",
        "text in quotes",
        '"40"',
        others=0,
    ),
    edit(
        "motor without inductance",
        "JDH-2250-DF-1C (inferred)",
        "Pittman 14201S003",
        "11:1",
        "motor.inductance",
        "nothing",
        "an inductance",
        "add inductance",
    ),
]
SYNTAX = [
    edit(
        "unquoted quantity",
        TRAVEL,
        "travel = 14.5 in",
        "7:15",
        "travel",
        "travel = 14.5 in",
        "TOML",
        'travel = "14.5 in"',
    ),
    edit(
        "unquoted word",
        'method = "print_head"',
        "method = print_head",
        "3:10",
        "method",
        "print_head",
        "TOML",
        'method = "print_head"',
    ),
    edit("yes for true", NAME, f"{NAME}\ntrim = yes", "3:8", "trim", "trim = yes", "TOML", "trim = true"),
    edit("capital false", NAME, f"{NAME}\ntrim = False", "3:8", "trim", "trim = False", "TOML", "trim = false"),
    edit("no value", TRAVEL, "travel =", "7:27", "travel", "travel =", "TOML", "give travel a value"),
    edit(
        "open quotes", 'name = "print head"', 'name = "print head', "2:19", "name", "name", "TOML", "close the quotes"
    ),
    edit("open bracket", "[limits]", "[limits", "6:36", "limits", "[limits", "TOML", "close the bracket"),
    edit("colon", 'speed = "40 in/s"', 'speed: "40 in/s"', "8:6", "speed", "speed:", "TOML", 'speed = "40 in/s"'),
    edit("key twice", TRAVEL, f"{TRAVEL}\n{TRAVEL}", "8:", "travel", TRAVEL, "TOML", "remove one"),
    added("table twice", '[limits]\nspeed = "3 in/s"', "47:8", "limits", "[limits]", "TOML", "merge"),
    edit("two values", TRAVEL, f'{TRAVEL} "x"', "7:20", "", TRAVEL, "TOML", "correct the line"),
    edit(
        "a huge number",
        CYCLES,
        f"cycles_per_revolution = {'9' * 5000}",
        "35:1",
        "cycles_per_revolution",
        "999...",
        "TOML",
        "fewer digits",
    ),
    Bad("deep nesting", "1:1", "", "[[[[", "TOML", "nested too deeply", text="a = " + "[" * 5000),
    Bad("prose", "1:6", "", "Dear axis", "TOML", "correct the line", text="Dear axis,\n"),
    Bad("no key", "1:1", "", "= 3", "TOML", "correct the line", text="= 3\n"),
    Bad("unfinished text", "2:6", "", "abc", "TOML", "correct the line", text='a = """\nabc  ', append=""),
]

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

OVERRIDES = [
    given("no equals sign", "nonsense", "nonsense", '"nonsense"', "KEY=VALUE", "--set 'drive.supply=34 V'"),
    given("no value", "drive.supply=", "drive.supply", '"drive.supply="', "KEY=VALUE", "--set 'drive.supply=34 V'"),
    given("misspelt key", "drive.suply=34 V", "drive.suply", "drive.suply", "a key", '"drive.supply"?'),
    given("unheard key", "qqqqqq=1", "qqqqqq", "qqqqqq", "a key", "lists the keys"),
    given("a table", "drive=1", "drive", "drive", "a key", "drive.supply"),
    given("bare number", "drive.supply=34", "drive.supply", "34", "a voltage", "text with a unit"),
    given("wrong dimension", "drive.supply=34 A", "drive.supply", "34 A", "a voltage", "same dimension"),
    given("choice", "method.span=fast", "method.span", "fast", '"emf" or "steady"', 'write "steady"'),
    given("switch", "method.trim=maybe", "method.trim", "maybe", "true or false", "trim = true"),
    given("fraction", "encoder.cycles_per_revolution=1.5", "encoder.cycles_per_revolution", "1.5", "whole", "whole"),
    given("method", "axis.method=stepper", "axis.method", "stepper", '"print_head"', "write method"),
    given("catalogue", "motor.catalogue=maxon RE 4", "motor.catalogue", "maxon RE 4", "Faulhaber", "did you mean"),
    given("supply below effort", "drive.supply=34 V", "drive.supply", "34 V", 'limits.effort ("38 V") up to', "lower"),
]

TABLE = [
    pytest.param(bad, id=f"{group}: {bad.name}")
    for group, bads in {
        "quantity": QUANTITIES,
        "value": NUMBERS_AND_WORDS,
        "key": KEYS_AND_TABLES,
        "syntax": SYNTAX,
        "contradiction": CONTRADICTIONS,
        "override": OVERRIDES,
    }.items()
    for bad in bads
]


def test_the_table_is_long_enough_to_mean_something():
    assert len(TABLE) >= 60


@pytest.mark.parametrize("bad", TABLE)
def test_bad_file(bad, good_text, load_text):
    with pytest.raises(InputError) as caught:
        load_text(bad.make(good_text), *bad.overrides)
    first, *others = caught.value.problems
    expected = bad.place if bad.place == "--set" else f"axis.toml:{bad.place}"
    assert str(first).startswith(expected)
    assert first.key == bad.key
    assert bad.came in first.came
    assert bad.allowed in first.allowed
    assert bad.remedy in first.remedy
    assert len(others) == bad.others, others
