"""Rules that several methods share, where the methods' own tables do not show them."""

import math
import re

import pytest
from tests.bad_files import EXAMPLES, example_text

from detent.axisfile.common_checks import Plant, inside_travel, time_constants
from detent.axisfile.tables import FrictionTable, FrictionTables
from detent.errors import InputError
from detent.files.fields import held_leaves, unit_of
from detent.files.problems import dotted
from detent.methods.registry import METHODS
from detent.units import parse_quantity


def friction(right=0.0, left=0.0):
    sides = {"right": right, "left": left}
    return FrictionTables.model_construct(
        **{side: FrictionTable.model_construct(coulomb=0.0, viscous=b, static=0.0) for side, b in sides.items()}
    )


def rates(resistance, inductance, coupling, viscous, mass):
    return resistance / inductance + math.sqrt(coupling / inductance) + viscous / mass


@pytest.mark.parametrize("coupling", [0.0, 1.0, 1e6])
@pytest.mark.parametrize("viscous", [0.0, 3.0])
def test_the_inductance_named_is_the_smallest_that_will_do(coupling, viscous):
    def look(inductance):
        return list(time_constants(Plant(2.0, inductance, coupling, 0.5), friction(right=viscous), 1e5))

    (found,) = look(1e-9)
    assert found.keys[0] == "motor.inductance"
    nearest = parse_quantity(found.remedy.split('"')[1], "H")
    assert look(nearest) == []
    assert look(0.998 * nearest) != []
    assert rates(2.0, nearest, coupling, viscous, 0.5) == pytest.approx(1e5, rel=2e-3)


def test_the_side_with_more_viscous_friction_is_to_blame():
    plant = Plant(2.0, 1e-3, 1.0, 0.5)
    (found,) = time_constants(plant, friction(right=1.0, left=1e6), 1e5)
    assert found.keys[0] == "mechanics.friction.left.viscous"
    nearest = parse_quantity(found.remedy.split('"')[1], "N*s/m")
    assert list(time_constants(plant, friction(left=nearest), 1e5)) == []
    assert list(time_constants(plant, friction(left=1.002 * nearest), 1e5)) != []


def test_two_wrong_rates_have_no_one_remedy():
    (found,) = time_constants(Plant(2.0, 1e-9, 1.0, 0.5), friction(left=1e6), 1e5)
    assert "set " not in found.remedy


def test_a_machine_that_would_take_minutes_to_prepare_is_refused_at_once(load_text, good_text):
    # The print head's example: 1 nH at 100 kohm decays in 10 fs, and its PWM period lasts 40 us.
    with pytest.raises(InputError) as caught:
        load_text(good_text, "motor.inductance=1 nH", "motor.resistance=100 kohm")
    (problem,) = caught.value.problems
    assert problem.key == "motor.inductance"
    load_text(good_text, "motor.inductance=100.1 uH", "motor.resistance=100 kohm")


@pytest.mark.parametrize("name", METHODS)
def test_the_override_that_a_remedy_shows_is_one_of_every_method(load_text, name):
    with pytest.raises(InputError) as caught:
        load_text(example_text(EXAMPLES[name]), "nonsense")
    (problem,) = caught.value.problems
    key, value = re.search(r"--set '(.+)=(.+)'", problem.remedy).groups()
    # It is a key that the file has, with the names of its own tables.
    (field,) = (
        field for path, field, _ in held_leaves(load_text(example_text(EXAMPLES[name])).spec) if dotted(path) == key
    )
    assert parse_quantity(value, unit_of(field)) > 0


def test_the_end_of_the_way_is_still_inside():
    assert list(inside_travel({"a": 0.0, "b": 1.0}, 1.0)) == []
    assert [found.keys for found in inside_travel({"a": 1.001, "b": 0.5}, 1.0)] == [("a", "limits.travel")]
