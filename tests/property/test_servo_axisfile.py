"""The axis files of both servos for every input: text and specification are one, and a remedy keeps what it promises.

Values are drawn from the whole range that the schema allows for a key, so that many axes are absurd: those must be
refused by a rule, and what no rule refuses must be an axis that can be looked over and built.
"""

import math
from dataclasses import replace
from importlib.resources import files

import pytest
from annotated_types import Ge, Gt, Le, Lt
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.remedies import alternatives

from detent.axisfile.check import check_spec
from detent.axisfile.dump import dump_spec
from detent.axisfile.fields import leaf_fields, options_of, unit_of
from detent.axisfile.filtered_servo.build import build_filtered_servo
from detent.axisfile.load import axis_of
from detent.axisfile.methods import METHODS
from detent.axisfile.nearest import at_least, at_most
from detent.axisfile.phase_servo.build import build_phase_servo
from detent.axisfile.problems import dotted
from detent.axisfile.source import parse_source
from detent.errors import InputError
from detent.units import parse_quantity

BUILD = {"phase_servo": build_phase_servo, "filtered_servo": build_filtered_servo}
TEXT = {name: files("detent").joinpath(f"examples/{name}.toml").read_text(encoding="utf-8") for name in BUILD}
GAINS = st.lists(st.sampled_from([1, 2, 4, 16, 100, 1000]), min_size=3, max_size=3).map(str)
BURST = "disturbance.lines.burst"
TICKS = st.lists(st.integers(0, 10**7), min_size=1, max_size=64, unique=True).map(lambda ticks: str(sorted(ticks)))


def bounds_of(field):
    low, high = 0.0, 1e6
    for entry in field.metadata:
        if isinstance(entry, Ge | Gt):
            low = float(entry.ge if isinstance(entry, Ge) else entry.gt)
        elif isinstance(entry, Le | Lt):
            high = float(entry.le if isinstance(entry, Le) else entry.lt)
    return low, high


def numbers(field):
    """Numbers of a field over its whole range, the small ones as often as the large."""
    low, high = bounds_of(field)
    if field.annotation is int:
        # A float cannot hold the largest seed.
        low, high = int(low), min(int(high), 2**62)
        return st.integers(low, high).map(str) | st.sampled_from([str(low), str(high)])
    smallest = math.log(max(low, 1e-9))
    positive = st.floats(smallest, math.log(high)).map(math.exp)
    if low < 0:
        positive |= st.floats(low, high)
    unit = unit_of(field)
    factor = 100 if unit == "%" else 1
    return positive.map(lambda value: f"{min(max(value, low), high) * factor!r} {unit}".strip())


def values_of(key, field):
    if options_of(field):
        return st.sampled_from(options_of(field))
    if field.annotation is bool:
        return st.sampled_from(["true", "false"])
    return GAINS if key.endswith("gains") else numbers(field)


def overrides_of(name):
    """Overrides of a few keys of a method's packaged example."""
    held = {"axis.name", "axis.method", "motor.catalogue", "disturbance.push.force", "disturbance.push.at"}
    leaves = {dotted(path): field for path, field in leaf_fields(METHODS[name].spec)}
    tried = [key for key in leaves if key not in held and not key.startswith(("disturbance.push", BURST))]
    some = st.lists(st.sampled_from(tried), min_size=0, max_size=6, unique=True)
    return some.flatmap(
        lambda keys: st.tuples(*(values_of(key, leaves[key]).map(f"{key}={{}}".format) for key in keys))
    )


def bursts():
    """Overrides that make a burst, of evenly spaced pulses or of listed ones."""
    kind = st.sampled_from(["+", "-", "remove", "lose sample", "corrupt"]).map(f"{BURST}.kind={{}}".format)
    even = st.tuples(
        st.floats(0, 1e4).map(lambda at: f"{BURST}.at={at!r} s"), st.integers(1, 64).map(f"{BURST}.count={{}}".format)
    )
    listed = st.tuples(TICKS.map(f"{BURST}.ticks={{}}".format))
    return st.tuples(kind, even | listed).map(lambda pair: (pair[0], *pair[1]))


def load(name, overrides):
    return axis_of(parse_source("axis.toml", TEXT[name]), overrides)


def attempt(name, overrides):
    """The axis, or the problems with it: one of the two, never another exception."""
    try:
        return load(name, overrides), ()
    except InputError as error:
        return None, error.problems


def finite_values(registers):
    for name, _ in registers._fields_:
        value = getattr(registers, name)
        if hasattr(value, "_fields_"):
            yield from finite_values(value)
        elif isinstance(value, float):
            yield math.isfinite(value)


@pytest.mark.parametrize("name", BUILD)
def test_specification_to_text_to_specification_is_identity(name):
    @given(overrides_of(name), st.just(()) | bursts())
    @settings(max_examples=200)
    def check(overrides, burst):
        axis, _ = attempt(name, (*overrides, *burst))
        assert axis is None or axis_of(parse_source("axis.toml", dump_spec(axis.spec))).spec == axis.spec

    check()


@pytest.mark.parametrize("name", BUILD)
def test_what_no_rule_refuses_can_be_looked_over_and_built(name):
    @given(overrides_of(name))
    @settings(max_examples=150, deadline=None)
    def check(overrides):
        axis, problems = attempt(name, overrides)
        assert all(problem.allowed and problem.remedy for problem in problems)
        if axis is None:
            return
        report = check_spec(axis)
        assert all(math.isfinite(row.value) and row.text and row.formula for row in report.derived)
        assert all("nan" not in str(caution) for caution in report.warnings)
        assert all(finite_values(BUILD[name](axis.spec)))

    check()


@pytest.mark.parametrize("name", BUILD)
def test_the_value_that_a_remedy_names_satisfies_its_rule(name, monkeypatch):
    rules = METHODS[name].rules
    monkeypatch.setitem(METHODS, name, replace(METHODS[name], rules=()))

    @given(overrides_of(name))
    @settings(max_examples=200, deadline=None)
    def check(overrides):
        spec = load(name, overrides).spec
        for rule in rules:
            for contradiction in rule(spec):
                for alternative in alternatives(contradiction.remedy):
                    better = load(name, (*overrides, *alternative)).spec
                    assert contradiction.keys[0] not in {again.keys[0] for again in rule(better)}

    check()


@given(st.floats(1e-9, 1e6), st.sampled_from(["m", "m/s", "m/s^2", "s", "Hz", "kg", "N", "V", "A", "H", "%"]))
def test_a_value_named_beside_a_bound_keeps_to_it_and_is_near(value, unit):
    low, high = (parse_quantity(text.strip('"'), unit) for text in (at_most(value, unit), at_least(value, unit)))
    assert low <= value <= high
    assert math.isclose(low, high, rel_tol=1.01e-3)
