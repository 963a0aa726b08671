"""Tables that the user names, as ``[rail.north]``, and lists of quantities: read, refused, shown and written back."""

from typing import Annotated

import pytest
from annotated_types import Ge, Le
from tests.dump import dump_spec
from tests.reference import reference_rows

from detent.axisfile.catalogue import STEPPER_MOTORS
from detent.axisfile.tables import AxisSpec, AxisTable
from detent.errors import InputError
from detent.files.fields import (
    AnyName,
    Naming,
    Table,
    bounds_of_length,
    describe_allowed,
    fits,
    held_leaves,
    is_list,
    is_named,
    leaf_fields,
    list_example,
    named,
    named_as,
    optional,
    required,
    table_of,
    unit_of,
)
from detent.files.findings import Contradiction
from detent.files.problems import bad_names, default_text, field_at, format_value, known_keys
from detent.files.quantities import Frequency, Inertia, Length, Torque
from detent.methods.check import check_spec
from detent.methods.method import Method
from detent.methods.registry import METHODS

NAME = Naming("NAME", "[a-z][a-z0-9_-]{0,9}", "up to 10 small letters, digits and signs, a letter first", "north")
NUMBER = Naming("NUMBER", "[0-9]", "a digit", "1")


class MotorTable(Table, frozen=True):
    """Motor of a rail."""

    catalogue: str = optional("motor of the catalogue", "", max_length=80)
    steps_per_turn: int = required("full steps", "200", ge=4, le=1000)
    holding_torque: Torque = required("holding torque", '"60 mN*m"', gt=0.0, le=10.0)
    rotor_inertia: Inertia = optional("rotor", 1e-7, ge=0.0, le=1.0)
    curve: list[Annotated[Frequency, Ge(0.0), Le(1e4)]] = optional("frequencies", [], max_length=3)
    tapers: list[Length] | None = optional("thicknesses", None)


class StopTable(Table, frozen=True):
    """A stop of a rail."""

    at: Length = optional("where it is", 0.5, ge=0.0, le=10.0)


class RailTable(Table, frozen=True):
    """A rail."""

    travel: Length = required("free way", '"2 m"', gt=0.0, le=10.0)
    motor: MotorTable
    stop: dict[str, StopTable] = named("a stop by its number", NUMBER, max_length=3)


class YardSpec(AxisSpec, frozen=True):
    """Several rails."""

    axis: AxisTable
    rail: dict[str, RailTable] = named("a rail by its name", NAME, min_length=1, max_length=2)


def stops_inside(spec):
    for name, rail in spec.rail.items():
        for number, stop in rail.stop.items():
            if stop.at > rail.travel:
                keys = (f"rail.{name}.stop.{number}.at", f"rail.{name}.travel")
                yield Contradiction(keys, "up to the travel", f"set {keys[0]} = ...")


@pytest.fixture(autouse=True)
def yard(monkeypatch):
    class Yard(Method[YardSpec]):
        name = "yard"
        title = "yard: rails side by side"
        spec = YardSpec
        rules = (stops_inside,)
        catalogue = STEPPER_MOTORS

    monkeypatch.setitem(METHODS.known, "yard", Yard())


MOTOR = "Trinamic QSH2818-32-07-006"
TEXT = f"""[axis]
name = "yard"
method = "yard"
[rail.north]
travel = "3 m"
[rail.north.motor]
catalogue = "{MOTOR}"
holding_torque = "50 mN*m"
[rail.north.stop.1]
at = "1 m"
[rail.north.stop.2]
[rail.south]
travel = "2 m"
[rail.south.motor]
steps_per_turn = 48
holding_torque = "20 mN*m"
curve = ["500 Hz", "2 kHz"]
"""


def problems_of(load_text, text, *overrides):
    with pytest.raises(InputError) as caught:
        load_text(text, *overrides)
    return caught.value.problems


# ------------------------------------------------------------------------------------------------------ declarations


def test_the_schema_has_a_placeholder_where_the_user_has_a_name():
    paths = [path for path, _ in leaf_fields(YardSpec)]
    assert ("rail", "NAME", "travel") in paths
    assert ("rail", "NAME", "stop", "NUMBER", "at") in paths
    placed = next(path for path in paths if path[-1] == "at")
    assert [isinstance(part, AnyName) for part in placed] == [False, True, False, True, False]
    keys = [row.key for row in reference_rows("yard") if not row.key.startswith("faces.")]
    assert keys[3:5] == ["rail.NAME.travel", "rail.NAME.motor.catalogue"]


def test_named_tables_are_told_from_others():
    rail = field_at(YardSpec, ("rail",))
    assert is_named(rail)
    assert table_of(rail) is RailTable
    assert bounds_of_length(rail) == (1, 2)
    assert bounds_of_length(field_at(YardSpec, ("rail", "north", "stop"))) == (0, 3)
    # One of them is a table like any other.
    assert not is_named(field_at(YardSpec, ("rail", "north")))
    assert table_of(field_at(YardSpec, ("rail", "north"))) is RailTable
    assert unit_of(field_at(YardSpec, ("rail", "any", "stop", "7", "at"))) == "m"
    assert known_keys(YardSpec, ("rail",)) == ["NAME"]
    assert known_keys(YardSpec, ("rail", "north")) == ["travel", "motor", "stop"]


@pytest.mark.parametrize(
    ("path", "does"),
    [
        (("rail", "north", "stop", "1", "at"), True),
        (("rail", "anything at all", "stop", "x", "at"), True),
        (("rail", "north", "stop", "1", "to"), False),
        (("rail", "north", "stop", "at"), False),
        (("mast", "north", "stop", "1", "at"), False),
    ],
)
def test_a_path_of_a_file_fits_one_of_the_schema(path, does):
    assert fits(("rail", AnyName("NAME"), "stop", AnyName("NUMBER"), "at"), path) is does


@pytest.mark.parametrize(
    ("path", "filled"),
    [
        (("rail", "north", "motor", "at"), ("rail", "north", "stop", "NUMBER", "at")),
        (("rail", "north", "stop", "2", "to"), ("rail", "north", "stop", "2", "at")),
        (("mast", "north"), ("rail", "NAME", "stop", "NUMBER", "at")),
        (("rail",), ("rail", "NAME", "stop", "NUMBER", "at")),
        ((), ("rail", "NAME", "stop", "NUMBER", "at")),
    ],
)
def test_a_path_of_the_schema_takes_the_names_of_a_path_beside_it(path, filled):
    assert named_as(("rail", AnyName("NAME"), "stop", AnyName("NUMBER"), "at"), path) == filled


@pytest.mark.parametrize(
    ("tables", "names"),
    [
        ({"rail": {"north": {}}}, []),
        ({"rail": {"North": {}, "a b": {}}}, [("rail", "North"), ("rail", "a b")]),
        ({"rail": {"north": {"stop": {"12": {}, "3": {}}}}}, [("rail", "north", "stop", "12")]),
        ({"rail": {"0": {"stop": {"x": 3}}}}, [("rail", "0"), ("rail", "0", "stop", "x")]),
        ({"rail": 3}, []),
        ({"rail": {"north": 3}}, []),
        ({"mast": {"North": {}}}, []),
        (3, []),
    ],
)
def test_names_that_will_not_do(tables, names):
    assert [path for path, _ in bad_names(YardSpec, tables)] == names


# ------------------------------------------------------------------------------------------------- read, shown, written


def test_tables_are_read_in_the_order_of_the_file(load_text):
    spec = load_text(TEXT).spec
    assert list(spec.rail) == ["north", "south"]
    assert {number: stop.at for number, stop in spec.rail["north"].stop.items()} == {"1": 1.0, "2": 0.5}
    assert spec.rail["south"].stop == {}
    assert spec.rail["south"].motor.curve == [500.0, 2000.0]


def test_held_leaves_have_the_names_of_the_user(load_text):
    held = {path: value for path, _, value in held_leaves(load_text(TEXT).spec)}
    assert held["rail", "north", "travel"] == 3.0
    assert held["rail", "north", "stop", "2", "at"] == 0.5
    assert held["rail", "south", "motor", "steps_per_turn"] == 48
    assert not any("NAME" in path or "NUMBER" in path for path in held)


def test_every_motor_takes_its_own_constants_from_the_catalogue(load_text):
    axis = load_text(TEXT)
    north, south = axis.spec.rail["north"].motor, axis.spec.rail["south"].motor
    assert (north.steps_per_turn, north.holding_torque, north.rotor_inertia) == (200, 0.05, pytest.approx(9e-7))
    assert (south.steps_per_turn, south.rotor_inertia) == (48, 1e-7)
    assert axis.origins["rail.north.motor.steps_per_turn"] == f"catalogue {MOTOR}"
    assert axis.origins["rail.north.motor.holding_torque"] == "line 8"
    assert "rail.south.motor.rotor_inertia" not in axis.origins
    both = load_text(TEXT, "rail.south.motor.catalogue=Trinamic QSH2818-51-07-012").spec
    assert [rail.motor.rotor_inertia for rail in both.rail.values()] == [pytest.approx(9e-7), pytest.approx(18e-7)]


def test_a_motor_that_is_not_in_the_catalogue_is_told_at_its_own_table(load_text):
    (problem,) = problems_of(load_text, TEXT.replace(MOTOR, "%%%%"))
    assert (problem.key, problem.line) == ("rail.north.motor.catalogue", 7)
    assert problem.remedy == (
        "choose one of these, or state its constants in [rail.north.motor]: steps_per_turn, holding_torque"
    )
    first, second = problems_of(load_text, TEXT.replace(MOTOR, "%%%%").replace("steps_per_turn = 48\n", ""))
    # What the south lacks has nothing to do with the north's motor.
    assert (first.key, second.key) == ("rail.north.motor.catalogue", "rail.south.motor.steps_per_turn")


def test_the_check_has_a_row_for_every_value_of_every_table(load_text):
    rows = {row.key: row for row in check_spec(load_text(TEXT, "rail.south.stop.3.at=0.7 m")).rows}
    assert (rows["rail.north.travel"].value, rows["rail.north.travel"].origin) == ("3 m", "axis.toml line 5")
    assert (rows["rail.north.stop.2.at"].value, rows["rail.north.stop.2.at"].origin) == ("500 mm", "default")
    assert (rows["rail.south.stop.3.at"].value, rows["rail.south.stop.3.at"].origin) == ("700 mm", "--set")
    assert rows["rail.south.motor.curve"].value == "500 Hz, 2 kHz"
    assert rows["rail.south.motor.curve"].written == '["500 Hz", "2 kHz"]'
    assert rows["rail.north.motor.rotor_inertia"].origin == f"catalogue {MOTOR}"
    assert not [key for key in rows if "NAME" in key]


@pytest.mark.parametrize(
    "overrides",
    [
        (),
        ("rail.north.stop.9.at=2 in",),
        ('rail.north.motor.curve=["1 Hz", "0.3 kHz", "1e4 Hz"]', 'rail.north.motor.tapers=["1 in"]'),
        ("rail.north.motor.tapers=[]",),
    ],
)
def test_loading_what_was_dumped_gives_the_same_specification(load_text, overrides):
    spec = load_text(TEXT, *overrides).spec
    text = dump_spec(spec)
    assert load_text(text).spec == spec
    assert "[rail.north.stop.2]" in text


def test_a_table_without_values_of_its_own_is_still_written(load_text):
    text = TEXT.replace('[rail.south]\ntravel = "2 m"\n', "") + "[rail.south]\ntravel = '2 m'\n"
    spec = load_text(text).spec
    assert load_text(dump_spec(spec)).spec == spec


# --------------------------------------------------------------------------------------------------------- overrides


def test_an_override_changes_one_table_only(load_text):
    spec = load_text(TEXT, "rail.north.travel=4 m", "rail.north.stop.1.at=0.2 m").spec
    assert [rail.travel for rail in spec.rail.values()] == [4.0, 2.0]
    assert [stop.at for stop in spec.rail["north"].stop.values()] == [0.2, 0.5]


def test_an_override_may_add_a_table(load_text):
    axis = load_text(TEXT, "rail.south.stop.4.at=1 m")
    assert list(axis.spec.rail["south"].stop) == ["4"]
    assert axis.origins["rail.south.stop.4.at"] == "--set"


@pytest.mark.parametrize(
    ("override", "remedy"),
    [
        ("rail.north.travle=3 m", 'did you mean "rail.north.travel"?'),
        ("rail.nort.stop.1.to=3 m", 'did you mean "rail.nort.stop.1.at"?'),
        ("travel=3 m", 'did you mean "rail.south.travel"?'),
        ("rail.travel=3 m", 'did you mean "rail.south.travel"?'),
        ("south.travel=3 m", 'did you mean "rail.south.travel"?'),
        ("rail.north.stop.at=3 m", 'did you mean "rail.north.stop.2.at"?'),
        ("xyz=3", "`detent check` lists the keys"),
    ],
)
def test_an_unknown_override_is_told_with_a_key_of_this_file(load_text, override, remedy):
    (problem,) = problems_of(load_text, TEXT, override)
    assert (problem.file, problem.remedy) == ("--set", remedy)


def test_an_override_that_is_none_is_told_with_a_key_of_this_file(load_text):
    (problem,) = problems_of(load_text, TEXT, "nonsense")
    assert problem.remedy == "write it as in --set 'rail.north.travel=2 m'"
    load_text(TEXT, "rail.north.travel=2 m")
    *_, last = problems_of(load_text, "", "axis.method=yard", "nonsense")
    assert last.remedy == "write it as in --set 'rail.NAME.travel=2 m'"


def test_a_name_that_will_not_do_in_an_override(load_text):
    (problem,) = problems_of(load_text, TEXT, "rail.north.stop.12.at=1 m")
    assert (problem.key, problem.got, problem.allowed) == ("rail.north.stop.12", 'the name "12"', "a digit")


# ---------------------------------------------------------------------------------------------------------- problems


NORTH = "[rail.north]"
BAD = [
    (NORTH, "[rail.North]", 0, "rail.North", 'the name "North"', "up to 10 small letters", "as in [rail.north]"),
    ("[rail.north.stop.1]", "[rail.north.stop.one]", 9, "rail.north.stop.one", '"one"', "a digit",
     "rename it, as in [rail.north.stop.1]"),
    (NORTH, "[rail.north]\nspeed = 3", 5, "rail.north.speed", '"speed"', "in [rail.north]: travel, motor, stop",
     "remove it"),
    (NORTH, "[rail.north]\nat = 3", 5, "rail.north.at", '"at"', "in [rail.north]: travel, motor, stop",
     "move it to [rail.north.stop.NUMBER]"),
    ('at = "1 m"', 'at = "1 m"\ntravel = "1 m"', 11, "rail.north.stop.1.travel", '"travel"',
     "in [rail.north.stop.1]: at", "move it to [rail.north]"),
    ("[rail.north.motor]", "[rail.north.moter]", 6, "rail.north.moter", "the unknown table", "travel, motor, stop",
     'did you mean "motor"?'),
    ("[rail.north.stop.1]", "[rail.north.halt.1]", 9, "rail.north.halt", "the unknown table", "travel, motor, stop",
     "remove it"),
    ('travel = "3 m"\n', "", 4, "rail.north.travel", "nothing", "a length", 'add travel = "2 m" in [rail.north]'),
    ('holding_torque = "20 mN*m"\n', "", 14, "rail.south.motor.holding_torque", "nothing", "a torque",
     "name a motor of the catalogue that has it"),
    ('at = "1 m"', 'at = "1 s"', 10, "rail.north.stop.1.at", '"1 s"', "from 0 m up to 10 m", "same dimension"),
    ('at = "1 m"', 'at = "4 m"', 10, "rail.north.stop.1.at", '"4 m"', "up to the travel", "set rail.north.stop.1.at"),
]  # fmt: skip


@pytest.mark.parametrize(("old", "new", "line", "key", "got", "allowed", "remedy"), BAD)
def test_a_problem_of_a_named_table_is_told_at_its_place(load_text, old, new, line, key, got, allowed, remedy):
    first, *_ = problems_of(load_text, TEXT.replace(old, new, 1))
    assert (first.key, first.line) == (key, line or first.line)
    assert got in first.got
    assert allowed in first.allowed
    assert remedy in first.remedy


TOO_MANY = "".join(f"[rail.south.stop.{number}]\n" for number in range(4))


@pytest.mark.parametrize(
    ("text", "key", "got", "allowed", "remedy"),
    [
        ("", "rail", "0 tables", "1 to 2 tables such as [rail.north]", "add [rail.north] (a rail by its name)"),
        ("[rail]\n", "rail", "0 tables", "1 to 2 tables", "add [rail.north]"),
        (
            f"{TEXT}{TOO_MANY}",
            "rail.south.stop",
            "4 tables",
            "0 to 3 tables such as [rail.south.stop.1]",
            "remove some",
        ),
        ("rail = 3\n", "rail", "3", "tables with names, such as [rail.north]", "with single brackets"),
        ("[[rail]]\ntravel = '2 m'\n", "rail", "a list", "tables with names", "[rail.north] with single brackets"),
        (
            "[rail]\nnorth = 3\n",
            "rail.north",
            "3",
            "the table [rail.north] with travel, motor, stop",
            "line of its own",
        ),
    ],
)
def test_the_tables_as_a_whole(load_text, text, key, got, allowed, remedy):
    head = "" if text.startswith("[axis]") else "".join(TEXT.partition('method = "yard"\n')[:2])
    # A key before any table belongs to the top of the file.
    whole = text + head if text.startswith("rail =") else head + text
    first, *_ = problems_of(load_text, whole)
    assert first.key == key
    assert got in first.got
    assert allowed in first.allowed
    assert remedy in first.remedy


def test_rules_look_at_the_other_tables_where_one_is_wrong(load_text):
    text = TEXT.replace('travel = "3 m"', 'travel = "3 s"').replace('at = "1 m"', 'at = "9 m"')
    # The north's travel is wrong, so that nothing can be said about its stops; the south's is right.
    assert [p.key for p in problems_of(load_text, text)] == ["rail.north.travel"]
    found = problems_of(load_text, text, "rail.south.stop.1.at=3 m")
    assert [p.key for p in found] == ["rail.north.travel", "rail.south.stop.1.at"]


# ------------------------------------------------------------------------------------------------ lists of quantities


CURVE = 'curve = ["500 Hz", "2 kHz"]'
LISTS = [
    ("curve = 500", "500", 'write quantities in brackets, as in curve = ["20 kHz"]'),
    ('curve = "500 Hz"', '"500 Hz"', "write quantities in brackets"),
    ("curve = [500]", "500 as element 1", 'every element as text with a unit, as in curve = ["20 kHz"]'),
    ('curve = ["500 Hz", "2"]', '"2" as element 2', "every element as text with a unit"),
    ('curve = ["500 Hz", "2 m"]', '"2 m" as element 2', "every element as text with a unit"),
    ('curve = ["500 Hz", "20 kHz"]', '"20 kHz" as element 2', "every number of curve a value in this range"),
    ('curve = ["1 Hz", "2 Hz", "3 Hz", "4 Hz"]', "4 numbers", "give curve so many numbers (frequencies)"),
    ('tapers = ["1 Hz"]', '"1 Hz" as element 1', 'as in tapers = ["12 mm"]'),
]


@pytest.mark.parametrize(("line", "got", "remedy"), LISTS)
def test_a_bad_list_of_quantities_is_one_problem(load_text, line, got, remedy):
    (problem,) = problems_of(load_text, TEXT.replace(CURVE, line))
    key = f"rail.south.motor.{line.partition(' ')[0]}"
    assert (problem.key, problem.line) == (key, 17)
    assert got in problem.got
    assert remedy in problem.remedy
    assert problem.allowed == describe_allowed(field_at(YardSpec, tuple(key.split("."))))


def test_a_list_of_quantities_says_what_it_may_be():
    curve, tapers = (field_at(MotorTable, (name,)) for name in ("curve", "tapers"))
    assert is_list(curve)
    assert (unit_of(curve), unit_of(tapers)) == ("Hz", "m")
    assert describe_allowed(curve) == (
        'a list, each a frequency from 0 Hz up to 10 kHz, such as ["20 kHz"], at most 3 of them'
    )
    assert describe_allowed(tapers) == 'a list, each a length, such as ["12 mm"]'
    assert list_example(curve) == '["20 kHz"]'
    assert (default_text(curve), default_text(tapers)) == ("", "none")
    assert format_value(curve, [500.0, 2e3]) == "500 Hz, 2 kHz"


def test_an_override_may_be_a_list_of_quantities(load_text):
    spec = load_text(TEXT, 'rail.north.motor.curve=["1 kHz", "60 rpm"]'.replace("60 rpm", "2e3 Hz")).spec
    assert spec.rail["north"].motor.curve == [1000.0, 2000.0]
    (problem,) = problems_of(load_text, TEXT, "rail.north.motor.curve=1 kHz")
    assert (problem.file, problem.got) == ("--set", "1 kHz")
