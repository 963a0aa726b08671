"""The axis file for every input: text and specification are one, and no text leads to a traceback."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.bad_files import EXAMPLES as EXAMPLE_OF
from tests.bad_files import example_text
from tests.dump import dump_spec

from detent.errors import InputError
from detent.files.source import parse_source
from detent.methods.check import check_spec
from detent.methods.load import axis_of
from detent.methods.registry import METHODS
from detent.units import KINDS, QuantityError, format_quantity, parse_quantity

EXAMPLES = {name: example_text(EXAMPLE_OF[name]) for name in METHODS}
GOOD = EXAMPLES["print_head"]

FRAGMENTS = [
    "",
    "\n",
    "=",
    '"',
    "'",
    '"""',
    "[",
    "]",
    "{",
    "}",
    "#",
    ".",
    ",",
    "-",
    "\\",
    "%",
    "nan",
    "inf",
    "true",
    "1e400",
    "0x1F",
    "900",
    '"38 V"',
    '"-3 in"',
    '"5 °C"',
    "[limits]",
    "[[motor]]",
    "[disturbance.push]",
    "[disturbance.lines.burst]",
    "[method]",
    "[4, 16, 1]",
    "[stepper]",
    "[stepper.group_a]",
    "[stepper.group_c.motor]",
    "[stepper.group_a.zone.near]",
    "[position.3]",
    "[position]",
    '["500 Hz", "2 kHz"]',
    "stepper = 3",
    "[[stepper]]",
    '"points"',
    '"8 MHz"',
    "axis.method = 3",
    "drive = 3",
    "\x00",
    "ä",
    "\U0001f5a8",
    "1979-05-27T07:32:00Z",
]


def load(text, *overrides):
    return axis_of(parse_source("axis.toml", text), overrides)


def attempt(text, *overrides):
    """Specification or problems: one of the two, never another exception."""
    try:
        return load(text, *overrides).spec, ()
    except InputError as error:
        return None, error.problems


def quantities(unit, low, high):
    """Texts of quantities that any file could hold."""
    return st.floats(low, high, allow_subnormal=False).map(lambda value: f"{value!r} {unit}")


GOOD_OVERRIDES = st.fixed_dictionaries(
    {},
    optional={
        "axis.name": st.text(
            st.characters(exclude_categories=["Cs", "Zs", "Zl", "Zp", "Cc"]), min_size=1, max_size=80
        ).map(lambda name: f"'{name}'"),
        "axis.fidelity": st.sampled_from(["averaged", "switch-level"]),
        "limits.travel": quantities("in", 5.0, 200.0),
        "limits.effort": quantities("V", 1.0, 38.0),
        "motor.resistance": quantities("mohm", 1.0, 1e5),
        "motor.torque_constant": quantities("ozf*in/A", 0.001, 1000.0),
        "motor.max_current": quantities("A", 0.1, 100.0),
        "mechanics.carriage_mass": quantities("g", 1.0, 1e5),
        "mechanics.friction.left.coulomb": quantities("N", 0.0, 50.0),
        "mechanics.friction.left.viscous": quantities("N*s/m", 0.0, 5.0),
        "encoder.jitter": quantities("deg", 0.0, 29.9),
        "encoder.missing_edges": st.floats(0.0, 0.5).map(repr),
        "encoder.seed": st.integers(0, 2**63 - 1).map(str),
        "method.trim": st.sampled_from(["true", "false"]),
        "method.ir_counts": st.integers(1, 250).map(str),
        "disturbance.motor_constant": quantities("%", -89.0, 199.0),
        "disturbance.friction_right": quantities("%", -100.0, 500.0),
        "disturbance.obstacle.position": quantities("in", 0.1, 4.9),
        "disturbance.supply": quantities("V", 19.0, 76.0),
        "print.flight_time": quantities("us", 0.0, 10000.0),
    },
)


@given(GOOD_OVERRIDES)
def test_specification_to_text_to_specification_is_identity(values):
    spec = load(GOOD, *(f"{key}={value}" for key, value in values.items())).spec
    assert load(dump_spec(spec)).spec == spec


@given(GOOD_OVERRIDES)
def test_every_good_axis_can_be_looked_over(values):
    axis = load(GOOD, *(f"{key}={value}" for key, value in values.items()))
    report = check_spec(axis)
    assert all(math.isfinite(row.value) for row in report.derived)
    assert {row.key for row in report.rows} >= set(values)


@given(
    st.sampled_from(sorted(EXAMPLES)),
    st.lists(st.tuples(st.floats(0, 1), st.integers(0, 40), st.sampled_from(FRAGMENTS)), min_size=1, max_size=6),
)
@settings(max_examples=200)
def test_random_edits_give_problems_with_places_or_a_specification(name, edits):
    text = EXAMPLES[name]
    for place, length, fragment in edits:
        start = round(place * len(text))
        text = text[:start] + fragment + text[start + length :]
    spec, problems = attempt(text)
    assert (spec is None) == bool(problems)
    assert spec is None or load(dump_spec(spec)).spec == spec
    for problem in problems:
        assert problem.file == "axis.toml"
        assert 1 <= problem.line <= len(text.splitlines())
        assert problem.column >= 1
        assert problem.got
        assert problem.allowed
        assert problem.remedy


@given(st.text(max_size=300))
def test_any_text_gives_problems(text):
    with pytest.raises(InputError):
        load(text)


@given(
    st.sampled_from(sorted(EXAMPLES)),
    st.lists(
        st.text(max_size=40)
        | st.from_regex(r"(limits|motor|drive|method|clock|detector)\.[a-z_]{2,10}=.{0,12}")
        | st.from_regex(r"(stepper\.[a-z_]{1,8}\.(limits|motor|zone\.fine)|position\.[0-9])\.[a-z_]{2,10}=.{0,12}"),
        min_size=1,
        max_size=3,
    ),
)
def test_any_override_gives_problems_or_a_specification(name, overrides):
    spec, problems = attempt(EXAMPLES[name], *overrides)
    assert (spec is None) == bool(problems)
    assert all(problem.remedy for problem in problems)


@given(st.text(max_size=90), st.sampled_from(sorted(KINDS)))
def test_any_text_is_a_finite_quantity_or_refused(text, unit):
    try:
        value = parse_quantity(text, unit)
    except QuantityError:
        return
    assert math.isfinite(value)


@given(
    st.floats(-1e6, 1e6, allow_subnormal=False).filter(lambda value: value == 0 or abs(value) > 1e-6),
    st.sampled_from(sorted(set(KINDS) - {"rpm"})),
)
def test_what_is_written_for_people_reads_back(value, unit):
    assert parse_quantity(format_quantity(value, unit, digits=15), unit) == pytest.approx(value, rel=1e-12)
