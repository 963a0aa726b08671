"""One schema for an axis that slides and for one that turns."""

import math
from typing import ClassVar

import pytest
from pydantic import Field, ValidationError
from tests.bad_files import example_text
from tests.dump import dump_spec

from detent.axisfile.motion import ROTARY_UNITS, MovingTable, motors_model, rotary_model, unit_in
from detent.errors import InputError
from detent.files.fields import Naming, Table, describe_allowed, leaf_fields, named, optional, required, unit_of
from detent.files.problems import field_at
from detent.files.quantities import Force, Length, Time
from detent.methods.registry import METHODS
from detent.units import KINDS, parse_quantity


class InnerTable(Table, frozen=True):
    """Below."""

    force: Force = required("a force", '"3 N"', ge=0.0, le=10.0)


class PlainTable(Table, frozen=True):
    """Nothing that moves."""

    wait: Time = optional("a time", 1.0, gt=0.0)


class OuterTable(Table, frozen=True):
    """Above."""

    way: Length = optional("a way", 0.5, gt=0.0, le=2.0)
    gap: Length | None = optional("a gap", None, ge=0.0, le=1.0)
    half: Length = optional("half the way", lambda data: data["way"] / 2, derived="half the way")
    inner: InnerTable
    maybe: InnerTable | None = None
    plain: PlainTable = Field(default_factory=PlainTable)

    @property
    def double(self) -> float:
        """Twice the way."""
        return 2 * self.way


ROTARY = rotary_model(OuterTable)
TURN = {"way": "90 deg", "gap": "18 deg", "inner": {"force": "2 N*m"}, "maybe": {"force": "40 mN*m"}}


def test_every_unit_exchanged_has_a_name_and_a_partner_of_another_kind():
    for linear, rotary in ROTARY_UNITS.items():
        assert linear in KINDS
        assert rotary in KINDS
        assert KINDS[linear][0] != KINDS[rotary][0]
        # The same power of the length is left: what "m" is measured in is now "rad".
        assert rotary not in ROTARY_UNITS


def test_values_are_read_in_the_units_of_the_motion():
    table = ROTARY.model_validate(TURN)
    assert (table.way, table.half) == (math.pi / 2, math.pi / 4)
    assert table.gap == parse_quantity("18 deg", "rad")
    assert (table.inner.force, table.maybe.force) == (2.0, 0.04)
    assert table.plain.wait == 1.0
    assert table.double == math.pi
    assert isinstance(table, OuterTable)
    assert OuterTable.model_validate({"inner": {"force": "2 N"}}).inner.force == 2.0


@pytest.mark.parametrize(
    ("path", "value"),
    [
        (("way",), "1 m"),
        (("gap",), "1 mm"),
        (("inner", "force"), "2 N"),
        (("maybe", "force"), "2 N"),
        (("way",), "3 rad"),
        (("gap",), "-1 deg"),
        (("inner", "force"), "11 N*m"),
        (("inner", "power"), "1 W"),
    ],
)
def test_bounds_and_unknown_keys_are_those_of_the_model(path, value):
    tables = {**TURN, "inner": dict(TURN["inner"]), "maybe": dict(TURN["maybe"])}
    (tables if len(path) == 1 else tables[path[0]])[path[-1]] = value
    with pytest.raises(ValidationError) as caught:
        ROTARY.model_validate(tables)
    # A default that is made from a wrong key cannot be made either.
    (found,) = {error["loc"] for error in caught.value.errors() if error["type"] != "default_factory_not_called"}
    assert found == path


def test_a_rotary_table_changes_no_more_than_a_linear_one():
    table = ROTARY.model_validate(TURN)
    with pytest.raises(ValidationError):
        table.way = 1.0
    with pytest.raises(ValidationError):
        ROTARY.model_validate({**TURN, "way": 1.0})


def test_a_table_without_lengths_stays_itself():
    assert rotary_model(PlainTable) is PlainTable
    assert rotary_model(OuterTable) is ROTARY
    assert ROTARY.__doc__ == OuterTable.__doc__


class GearedTable(Table, frozen=True):
    """What stands where a motor turns."""

    ratio: float = required("a ratio", "3", ge=1.0)
    end: Length = optional("an end", 0.0, ge=-1.0, le=1.0)


class ScrewTable(Table, frozen=True):
    """What stands where a motor slides."""

    lead: Length = required("a lead", '"1 mm"', gt=0.0)

    turned: ClassVar[type[Table]] = GearedTable


class OneMotor(MovingTable, frozen=True):
    """A motor."""

    way: Length = required("a way", '"1 m"', gt=0.0)
    screw: ScrewTable
    stops: list[Length] = optional("stops", [])


class SeveralMotors(Table, frozen=True):
    """A file of motors."""

    motor: dict[str, OneMotor] = named("a motor", Naming("NAME", "[a-z]+", "letters", "x"), min_length=1)


SLIDES = {"way": "2 m", "screw": {"lead": "3 mm"}, "stops": ["1 m", "2 m"]}
TURNS = {"motion": "rotary", "way": "2 rad", "screw": {"ratio": 3.0, "end": "90 mrad"}, "stops": ["1 rad", "180 deg"]}


def test_each_of_several_motors_is_read_by_its_own_motion():
    read = SeveralMotors.model_validate({"motor": {"x": SLIDES, "phi": TURNS}}).motor
    assert (read["x"].turns, read["phi"].turns) == (False, True)
    assert read["x"].screw.lead == 0.003
    assert (read["phi"].screw.ratio, read["phi"].screw.end) == (3.0, 0.09)
    assert read["phi"].stops == [1.0, math.pi]
    assert (read["x"].text(0.002, "m"), read["phi"].text(math.pi, "m")) == ("2 mm", "180 deg")
    assert [table.unit("m/s") for table in read.values()] == ["m/s", "rad/s"]


@pytest.mark.parametrize(
    ("name", "wrong", "place"),
    [
        ("phi", {**TURNS, "way": "2 m"}, ("way",)),
        ("phi", {**TURNS, "screw": {"ratio": 0.5}}, ("screw", "ratio")),
        ("phi", {**TURNS, "screw": {"ratio": 2.0, "lead": "1 mm"}}, ("screw", "lead")),
        ("x", {**SLIDES, "way": "2 rad"}, ("way",)),
        ("x", {**SLIDES, "motion": "round"}, ("motion",)),
    ],
)
def test_what_is_wrong_with_a_motor_has_its_place_in_the_file(name, wrong, place):
    with pytest.raises(ValidationError) as caught:
        SeveralMotors.model_validate({"motor": {"x": SLIDES, "phi": TURNS, name: wrong}})
    assert [error["loc"] for error in caught.value.errors()] == [("motor", name, *place)]


def test_keys_of_a_motor_that_turns_are_found_by_its_name():
    mixed = motors_model(SeveralMotors, frozenset({"phi"}))
    assert motors_model(SeveralMotors, frozenset()) is SeveralMotors
    assert unit_of(field_at(mixed, ("motor", "x", "way"))) == "m"
    assert unit_of(field_at(mixed, ("motor", "phi", "way"))) == "rad"
    assert field_at(mixed, ("motor", "phi", "screw", "ratio")).is_required()
    with pytest.raises(KeyError):
        field_at(mixed, ("motor", "x", "screw", "ratio"))
    paths = [path for path, _ in leaf_fields(mixed)]
    assert ("motor", "phi", "screw", "ratio") in paths
    assert ("motor", "NAME", "screw", "lead") in paths
    assert isinstance(mixed.model_validate({"motor": {"x": SLIDES, "phi": TURNS}}), SeveralMotors)
    everything = [path[-1] for path, _ in leaf_fields(rotary_model(SeveralMotors))]
    assert everything == ["motion", "way", "ratio", "end", "stops"]


def test_only_units_and_examples_differ():
    linear, rotary = dict(leaf_fields(METHODS["cascade"].spec)), dict(leaf_fields(METHODS["cascade"].rotary))
    assert list(linear) == list(rotary)
    changed = 0
    for path, field in linear.items():
        other = rotary[path]
        assert unit_of(other) == unit_in("rotary", unit_of(field))
        assert other.is_required() == field.is_required()
        assert other.description == field.description
        assert (other.default, other.default_factory) == (field.default, field.default_factory)
        if unit_of(field) in ROTARY_UNITS:
            changed += 1
            assert describe_allowed(other) != describe_allowed(field)
        else:
            assert describe_allowed(other) == describe_allowed(field)
        for example in other.examples or []:
            assert not unit_of(other) or math.isfinite(parse_quantity(example.strip('"'), unit_of(other)))
    assert changed > 30


def test_the_dump_of_a_rotary_axis_is_one_again(load_text):
    axis = load_text(example_text("turntable"))
    text = dump_spec(axis.spec)
    assert 'speed = "3.141592653589793 rad/s"' in text
    assert 'stiffness = "900.0 N*m/rad"' in text
    assert load_text(text).spec == axis.spec


def problems(load_text, text, *overrides):
    with pytest.raises(InputError) as caught:
        load_text(text, *overrides)
    return caught.value.problems


def test_a_quantity_of_the_other_motion_is_refused_where_it_stands(load_text):
    text = example_text("turntable").replace('speed = "180 deg/s"', 'speed = "0.5 m/s"')
    (problem,) = problems(load_text, text)
    assert str(problem).startswith("axis.toml:9:1 limits.speed")
    assert problem.got == '"0.5 m/s"'
    assert problem.allowed.startswith("an angular velocity above 0 deg/s")
    assert problem.remedy == 'use a unit of the same dimension as in "60 deg/s", or set axis.motion = "linear"'


@pytest.mark.parametrize(
    ("name", "wrong", "right"), [("cascade", "rotary", "linear"), ("turntable", "linear", "rotary")]
)
def test_a_wrong_motion_says_so_at_every_quantity(load_text, name, wrong, right):
    found = problems(load_text, example_text(name), f"axis.motion={wrong}")
    assert len(found) > 15
    assert all(problem.remedy.endswith(f', or set axis.motion = "{right}"') for problem in found)


@pytest.mark.parametrize("value", ["3 kg", "3", "fast"])
def test_a_quantity_of_no_motion_does_not_blame_the_motion(load_text, value):
    (problem,) = problems(load_text, example_text("cascade"), f"limits.speed={value}")
    assert "motion" not in problem.remedy


def test_an_unknown_motion_is_refused(load_text):
    (problem,) = problems(load_text, example_text("cascade"), "axis.motion=round")
    assert (problem.key, problem.allowed) == ("axis.motion", '"linear" or "rotary"')


def test_other_methods_know_no_motion(load_text):
    (problem,) = problems(load_text, example_text("print_head"), "axis.motion=rotary")
    assert problem.got == 'the unknown key "axis.motion"'
