"""From an axis file to a specification: values, defaults, origins, overrides."""

import math
import subprocess
import sys

import pytest

from detent.errors import InputError
from detent.methods.load import load_spec, read_axis


@pytest.fixture
def axis_path(tmp_path, good_text):
    path = tmp_path / "axis.toml"
    path.write_text(good_text, encoding="utf-8")
    return path


def test_the_example_is_the_default_plant_of_the_specification(axis_path):
    spec = load_spec(axis_path)
    assert spec.axis.name == "print head"
    assert spec.limits.travel == 0.3683
    assert spec.limits.speed == 1.016
    assert spec.motor.torque_constant == spec.motor.back_emf_constant == 0.24097
    assert (spec.motor.resistance, spec.motor.inductance, spec.motor.rotor_inertia) == (12.0, 0.012, 2.6e-5)
    assert spec.drive.supply == spec.disturbance.supply == spec.limits.effort == 38.0
    assert spec.mechanics.pulley_circumference == 0.0762
    radius = spec.mechanics.pulley_circumference / (2 * math.pi)
    mass = spec.mechanics.carriage_mass + spec.mechanics.belt_mass + spec.motor.rotor_inertia / radius**2
    assert mass == pytest.approx(1.3212, abs=2e-4)
    assert spec.mechanics.friction.right.coulomb == 7.55
    assert spec.mechanics.friction.left.coulomb == 5.87
    assert spec.encoder.cycles_per_revolution == 900


def test_defaults_that_depend_on_other_keys(axis_path):
    spec = load_spec(axis_path)
    assert spec.mechanics.start_position == 0.25 * spec.limits.travel
    assert spec.method.max_print_speed == spec.limits.speed
    assert spec.mechanics.friction.right.static == 1.15 * 7.55
    assert spec.disturbance.obstacle is None
    assert spec.disturbance.push is None


def test_stated_values_win_over_derived_defaults(load_text, good_text):
    spec = load_text(
        good_text,
        "mechanics.start_position=1 in",
        "method.max_print_speed=20 in/s",
        "mechanics.friction.left.static=9 N",
        "motor.back_emf_constant=0.25 V*s/rad",
        "disturbance.supply=36 V",
    ).spec
    assert spec.mechanics.start_position == 0.0254
    assert spec.method.max_print_speed == 0.508
    assert spec.mechanics.friction.left.static == 9.0
    assert spec.motor.back_emf_constant == 0.25
    assert (spec.drive.supply, spec.disturbance.supply) == (38.0, 36.0)


def test_a_stated_constant_wins_over_the_catalogues(load_text, good_text):
    text = good_text.replace("# resistance =", "resistance =").replace('"12 ohm"', '"13 ohm"')
    axis = load_text(text)
    assert axis.spec.motor.resistance == 13.0
    assert axis.spec.motor.inductance == 0.012
    assert axis.origins["motor.resistance"].startswith("line ")
    assert axis.origins["motor.inductance"] == "catalogue JDH-2250-DF-1C (inferred)"


def test_a_motor_may_be_stated_without_a_catalogue(load_text, good_text):
    text = good_text.replace("catalogue =", "# catalogue =")
    for key in ("torque_constant", "resistance", "inductance", "rotor_inertia"):
        text = text.replace(f"# {key} =", f"{key} =")
    spec = load_text(text).spec
    assert spec.motor.catalogue == ""
    assert spec.motor.torque_constant == 0.24


def test_tables_may_be_written_inline(load_text, good_text):
    head, _, rest = good_text.partition("[mechanics.friction.right]")
    _, _, rest = rest.partition("[encoder]")
    text = f'{head}friction = {{ right = {{ coulomb = "7 N" }}, left.coulomb = "6 N" }}\n[encoder]{rest}'
    assert load_text(text).spec.mechanics.friction.left.coulomb == 6.0


@pytest.mark.parametrize(
    ("override", "table", "key", "value"),
    [
        ("drive.supply=39 V", "drive", "supply", 39.0),
        (" drive.supply = 39 V ", "drive", "supply", 39.0),
        ('drive.supply="39 V"', "drive", "supply", 39.0),
        ("method.span=steady", "method", "span", "steady"),
        ("method.trim=false", "method", "trim", False),
        ("method.ir_counts=90", "method", "ir_counts", 90),
        ("encoder.missing_edges=0.01", "encoder", "missing_edges", 0.01),
        ("encoder.missing_edges=1e-3", "encoder", "missing_edges", 0.001),
        ("axis.name=42", "axis", "name", "42"),
        ("axis.name=true", "axis", "name", "true"),
        ("axis.fidelity=switch-level", "axis", "fidelity", "switch-level"),
        ("motor.catalogue=maxon RE 40 148877", "motor", "resistance", 1.13),
        ("disturbance.motor_constant=+10 %", "disturbance", "motor_constant", 0.1),
    ],
)
def test_an_override_is_read_as_a_file_would_be(load_text, good_text, override, table, key, value):
    axis = load_text(good_text, override)
    assert getattr(getattr(axis.spec, table), key) == value


def test_the_last_of_two_overrides_holds(load_text, good_text):
    assert load_text(good_text, "method.ir_counts=90", "method.ir_counts=91").spec.method.ir_counts == 91


def test_an_override_may_open_a_new_table(load_text, good_text):
    spec = load_text(good_text, "disturbance.obstacle.position=7 in").spec
    assert spec.disturbance.obstacle is not None
    assert spec.disturbance.obstacle.position == 0.1778


def test_an_override_repairs_a_bad_value_of_the_file(load_text, good_text):
    text = good_text.replace('supply = "38 V"', 'supply = "38 A"')
    assert load_text(text, "drive.supply=38 V").spec.drive.supply == 38.0


def test_origins_and_texts_tell_where_values_came_from(axis_path):
    axis = read_axis(axis_path, ["method.span=steady"])
    assert axis.file == str(axis_path)
    assert axis.origins["limits.travel"] == "line 7"
    assert axis.texts["limits.travel"] == "14.5 in"
    assert axis.origins["method.span"] == "--set"
    assert "method.trim" not in axis.origins


def test_comments_and_order_do_not_matter(load_text, good_text):
    tables = good_text.split("\n[")
    shuffled = "\n[".join([tables[0], *reversed(tables[1:])])
    assert load_text(shuffled).spec == load_text(good_text).spec


def test_a_windows_file_with_a_byte_order_mark_is_read(tmp_path, good_text):
    path = tmp_path / "axis.toml"
    path.write_bytes(b"\xef\xbb\xbf" + good_text.replace("\n", "\r\n").encode())
    assert load_spec(path).limits.travel == 0.3683


def test_a_specification_cannot_be_changed(axis_path):
    from pydantic import ValidationError

    spec = load_spec(axis_path)
    with pytest.raises(ValidationError, match="frozen"):
        spec.limits.travel = 1.0


@pytest.mark.process
def test_a_file_of_common_units_is_read_without_pint(axis_path):
    program = (
        "import sys; from detent.methods.load import load_spec; "
        f"load_spec({str(axis_path)!r}); assert 'pint' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", program], check=True, timeout=60)


def test_all_problems_of_file_and_overrides_come_at_once(load_text, good_text):
    text = good_text.replace('"14.5 in"', '"14.5 V"').replace("= 900", '= "900"').replace("belt_mass", "belt_mas")
    with pytest.raises(InputError) as caught:
        load_text(text, "drive.suply=3 V", "method.span=x")
    keys = [problem.key for problem in caught.value.problems]
    assert keys == [
        "limits.travel",
        "mechanics.belt_mas",
        "encoder.cycles_per_revolution",
        "drive.suply",
        "method.span",
    ]


def test_a_consequence_of_an_error_is_not_another_error(load_text, good_text):
    # With a wrong travel nothing can be said about the obstacle, with a wrong supply nothing about the effort.
    text = good_text.replace('"14.5 in"', '"14.5 V"').replace('supply = "38 V"', 'supply = "3 m"')
    with pytest.raises(InputError) as caught:
        load_text(text, "disturbance.obstacle.position=30 in")
    assert [problem.key for problem in caught.value.problems] == ["limits.travel", "drive.supply"]


def test_a_contradiction_is_found_beside_an_error_elsewhere(load_text, good_text):
    text = good_text.replace("= 900", '= "900"').replace('effort = "38 V"', 'effort = "40 V"')
    with pytest.raises(InputError) as caught:
        load_text(text)
    assert [problem.key for problem in caught.value.problems] == ["limits.effort", "encoder.cycles_per_revolution"]
