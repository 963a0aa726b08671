"""A starting file holds every key, is sound as it is, and what its comments say of defaults is what holds."""

import re
import tomllib
from pathlib import Path

import pytest

from detent.errors import InputError
from detent.files.fields import Table, extra_of, fits, held_leaves, leaf_fields
from detent.files.keys import key_rows
from detent.files.source import parse_source
from detent.methods.check import check_spec
from detent.methods.load import axis_of
from detent.methods.registry import METHODS
from detent.methods.start import starting_axis

FILE = Path("somewhere/carriage.toml")
TURNED = [name for name in METHODS if METHODS[name].rotary]
STARTS = [(name, ()) for name in METHODS]
STARTS += [(name, (f"{'.'.join(METHODS[name].motion_key).replace('NAME', 'x')}=rotary",)) for name in TURNED]
each_start = pytest.mark.parametrize(("name", "overrides"), STARTS, ids=str)


def start(name: str, *overrides: str) -> str:
    return starting_axis(METHODS[name], FILE, overrides)


def uncommented(text: str) -> str:
    """The same with every key and table that stands behind a # without a space."""
    return re.sub(r"(?m)^#(?=[\[a-z])", "", text)


def model_of(name: str, overrides: tuple[str, ...]) -> type[Table]:
    method = METHODS[name]
    return method.model_of(frozenset(tuple(text.partition("=")[0].split(".")) for text in overrides))


@each_start
def test_it_is_sound_as_it_is(name, overrides):
    axis = axis_of(parse_source(str(FILE), start(name, *overrides)))
    assert (axis.spec.axis.method, axis.spec.axis.name) == (name, "carriage")
    assert type(axis.spec) is model_of(name, overrides)
    assert check_spec(axis).warnings == ()


@each_start
def test_it_holds_every_key_with_its_meaning_and_its_range(name, overrides):
    text = start(name, *overrides)
    places = parse_source(str(FILE), uncommented(text)).places
    told = " ".join(line.lstrip("# ") for line in text.splitlines())
    model = METHODS[name].rotary if overrides else METHODS[name].spec
    for path, _ in leaf_fields(model):
        assert any(fits(path, place) for place in places), path
    for row in key_rows(model):
        assert f"{row.doc}: {row.allowed}" in told, row.key


@each_start
def test_a_default_taken_out_of_its_comment_changes_nothing(name, overrides):
    model, text = model_of(name, overrides), start(name, *overrides)
    without = axis_of(parse_source(str(FILE), text)).spec
    everything = tomllib.loads(uncommented(text))
    declared = dict(leaf_fields(model))
    looked_at = 0
    for path, field, held in held_leaves(without):
        pattern = next(known for known in declared if fits(known, path))
        if field.is_required() or extra_of(field, "derived") or field.default is None or extra_of(field, "start"):
            continue
        if field.default == []:
            continue
        value = everything
        for part in path:
            value = value[part]
        with_it = axis_of(parse_source(str(FILE), text), [f"{'.'.join(path)}={_text(value)}"]).spec
        assert dict((p, v) for p, _, v in held_leaves(with_it))[path] == held, pattern  # noqa: C402 - three of three
        looked_at += 1
    assert looked_at > 10


def _text(value: object) -> str:
    return str(value).lower() if isinstance(value, bool) else f'"{value}"' if isinstance(value, str) else str(value)


def test_what_is_overridden_is_stated_and_opens_its_table():
    text = start("cascade", "disturbance.push.force=3 N", "mechanics.weight=20 N", "axis.name=lift")
    tables = tomllib.loads(text)
    assert tables["disturbance"]["push"] == {"force": "3 N", "at": "2 s", "duration": "60 ms"}
    assert (tables["mechanics"]["weight"], tables["axis"]["name"]) == ("20 N", "lift")


def test_what_the_catalogue_gives_is_no_more_than_a_comment():
    text = start("cascade", "motor.catalogue=maxon RE 65 353297", "motor.resistance=0.4 ohm")
    assert '#torque_constant = "123 mN*m/A"' in text
    assert tomllib.loads(text)["motor"] == {"catalogue": "maxon RE 65 353297", "resistance": "0.4 ohm"}


def test_a_motor_that_the_catalogue_lacks_is_refused():
    with pytest.raises(InputError, match=r"--set motor\.catalogue"):
        start("cascade", "motor.catalogue=maxon RE 1")


def test_motors_have_the_names_that_overrides_give_them():
    tables = tomllib.loads(start("stepper_envelope", "stepper.y.limits.travel=80 mm", "stepper.z.limits.travel=9 mm"))
    assert {name: motor["limits"]["travel"] for name, motor in tables["stepper"].items()} == {"y": "80 mm", "z": "9 mm"}


@pytest.mark.parametrize(
    ("override", "key"),
    [
        ("limits.travle=1 m", "limits.travle"),
        ("limits.travel=5", "limits.travel"),
        ("limits.travel=1 V", "limits.travel"),
    ],
)
def test_a_wrong_override_is_refused_where_it_stands(override, key):
    with pytest.raises(InputError) as refused:
        start("cascade", override)
    assert [(problem.file, problem.key) for problem in refused.value.problems] == [("--set", key)]
