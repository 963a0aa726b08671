"""The axis files of servos, tables and stages for every input: text and specification are one, remedies keep promises.

Values are drawn from the whole range that the schema allows for a key, so that many axes are absurd: those must be
refused by a rule, and what no rule refuses must be an axis that can be looked over and built.
"""

import json
import math
import re
from copy import copy

import pytest
from annotated_types import Ge, Gt, Le, Lt
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.bad_files import example_text
from tests.dump import dump_spec
from tests.remedies import named_value

from detent.errors import InputError
from detent.files.fields import AnyName, is_list, leaf_fields, options_of, unit_of
from detent.files.nearest import at_least, at_most
from detent.files.problems import dotted
from detent.files.source import parse_source
from detent.methods.cascade.build import build_cascade
from detent.methods.check import check_spec
from detent.methods.filtered_servo.build import build_filtered_servo
from detent.methods.load import axis_of
from detent.methods.phase_servo.build import build_phase_servo
from detent.methods.registry import METHODS
from detent.methods.rotary_table.build import build_rotary_table
from detent.methods.stepper_envelope.build import build_stepper, make_tables
from detent.units import parse_quantity


def build_motors(spec):
    return [build_stepper(spec, name, make_tables(table)) for name, table in spec.stepper.items()]


BUILD = {
    "phase_servo": lambda spec: [build_phase_servo(spec)],
    "filtered_servo": lambda spec: [build_filtered_servo(spec)],
    "rotary_table": lambda spec: [build_rotary_table(spec)],
    "zoom": build_motors,
    "stage": build_motors,
    "cascade": lambda spec: [build_cascade(spec)],
    "turntable": lambda spec: [build_cascade(spec)],
}
"""By example: its registers of parameters."""
TEXT = {name: example_text(name) for name in BUILD}
TEXT["stage"] += '[stepper.y.zone.edge]\nbegin = "-40 mm"\nend = "-38 mm"\nspeed = "5 mm/s"\n'
TEXT["cascade"] += '[load_encoder]\nresolution = "1 um"\n'
SOURCE = {name: parse_source("axis.toml", text) for name, text in TEXT.items()}
METHOD = dict.fromkeys(BUILD, "stepper_envelope") | {name: name for name in BUILD if name in METHODS}
METHOD["turntable"] = "cascade"
ROTARY = {"turntable"}
"""Examples of an axis that turns, of a method that knows both motions."""
NAMES = {
    "rotary_table": {"NUMBER": "2"},
    "zoom": {"NAME": "group_a", "ZONE": "near"},
    "stage": {"NAME": "y", "ZONE": "edge"},
}
"""Names that stand for the placeholders of the schema."""
GAINS = st.lists(st.sampled_from([1, 2, 4, 16, 100, 1000]), min_size=3, max_size=3).map(str)
BURST, LOAD = "disturbance.lines.burst", "disturbance.load"
RATIOS = ("mechanics.gear_ratio", "detector.coarse.reduction")
CLOCKS = ("method.strobe_period", "method.interrupt_delay", "method.task_period", "method.task_phase")
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


def quantities(field):
    """Lists of quantities, of which some rise."""
    low, high = {"Hz": (10.0, 1e4), "N*m": (0.0, 0.08)}[unit_of(field)]
    numbers = st.lists(st.floats(low, high), min_size=0, max_size=5) | st.lists(st.floats(low, high)).map(sorted)
    return numbers.map(lambda held: json.dumps([f"{value!r} {unit_of(field)}" for value in held]))


def values_of(key, field):
    if options_of(field):
        return st.sampled_from(options_of(field))
    if field.annotation is bool:
        return st.sampled_from(["true", "false"])
    if is_list(field) and unit_of(field):
        return quantities(field)
    if key in RATIOS:
        return st.sampled_from(["2", "7", "90", "360", "5000", "1000000"]) | numbers(field)
    if key in CLOCKS:
        low, high = bounds_of(field)
        return st.integers(round(low * 1e4), round(high * 1e4)).map("{}e-4 s".format) | numbers(field)
    return GAINS if key.endswith("gains") else numbers(field)


def named_path(name, path):
    return tuple(NAMES[name][part] if isinstance(part, AnyName) else part for part in path)


HELD = {"axis.name", "axis.method", "axis.motion", "disturbance.push.force", "disturbance.push.at"}
ASIDE = ("disturbance.push", LOAD, BURST, "home.", "hardware.", "brake.")
"""Tables that are there as a whole or not at all."""


def model_of(name):
    method = METHODS[METHOD[name]]
    return method.rotary if name in ROTARY else method.spec


def overrides_of(name, held=()):
    """Overrides of a few keys of a method's packaged example, but for those that end so."""
    leaves = {dotted(named_path(name, path)): field for path, field in leaf_fields(model_of(name))}
    tried = [key for key in leaves if key not in HELD and not key.startswith(ASIDE) and ".home." not in key]
    tried = [key for key in tried if not key.endswith(("catalogue", *held))]
    drawn = {key: values_of(key, leaves[key]).map(f"{key}={{}}".format) for key in tried}
    some = st.lists(st.sampled_from(tried), min_size=0, max_size=6, unique=True)
    return some.flatmap(lambda keys: st.tuples(*(drawn[key] for key in keys)))


def bursts():
    """Overrides that make a burst, of evenly spaced pulses or of listed ones."""
    kind = st.sampled_from(["+", "-", "remove", "lose sample", "corrupt"]).map(f"{BURST}.kind={{}}".format)
    even = st.tuples(
        st.floats(0, 1e4).map(lambda at: f"{BURST}.at={at!r} s"), st.integers(1, 64).map(f"{BURST}.count={{}}".format)
    )
    listed = st.tuples(TICKS.map(f"{BURST}.ticks={{}}".format))
    return st.tuples(kind, even | listed).map(lambda pair: (pair[0], *pair[1]))


def loads():
    """Overrides that make a load torque."""
    torque, at, length = st.floats(-1e6, 1e6), st.floats(0, 1e5), st.floats(1e-6, 1e5)
    return st.tuples(
        torque.map(f"{LOAD}.torque={{!r}} N*m".format),
        at.map(f"{LOAD}.at={{!r}} s".format),
        length.map(f"{LOAD}.duration={{!r}} s".format),
    )


def disturbances(name):
    """Overrides that make the disturbance of a method, of which no part stands alone."""
    if name == "rotary_table":
        return st.just(()) | loads()
    return st.just(()) | bursts() if name.endswith("servo") else st.just(())


def load(name, overrides):
    return axis_of(SOURCE[name], overrides)


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
        for one in value if hasattr(value, "_length_") else [value]:
            if isinstance(one, float):
                yield math.isfinite(one)


@pytest.mark.parametrize("name", BUILD)
def test_specification_to_text_to_specification_is_identity(name):
    @given(overrides_of(name), disturbances(name))
    @settings(max_examples=70)
    def check(overrides, disturbance):
        axis, _ = attempt(name, (*overrides, *disturbance))
        assert axis is None or axis_of(parse_source("axis.toml", dump_spec(axis.spec))).spec == axis.spec

    check()


@pytest.mark.parametrize("name", BUILD)
def test_what_no_rule_refuses_can_be_looked_over_and_built(name):
    @given(overrides_of(name), disturbances(name))
    @settings(max_examples=70, deadline=None)
    def check(overrides, disturbance):
        axis, problems = attempt(name, (*overrides, *disturbance))
        assert all(problem.allowed and problem.remedy for problem in problems)
        if axis is None:
            return
        report = check_spec(axis)
        assert all(math.isfinite(row.value) and row.text and row.formula for row in report.derived)
        assert not any(re.search(r"\bnan\b", str(caution)) for caution in report.warnings)
        assert all(value for registers in BUILD[name](axis.spec) for value in finite_values(registers))

    check()


@pytest.mark.parametrize("name", BUILD)
def test_the_value_that_a_remedy_names_satisfies_its_rule(name, monkeypatch):
    method = METHODS[METHOD[name]]
    without = copy(method)
    without.rules = ()
    monkeypatch.setitem(METHODS.known, METHOD[name], without)

    @given(overrides_of(name, held=[".motion"]))  # the lengths of the file would be no angles
    @settings(max_examples=70, deadline=None)
    def check(overrides):
        spec = load(name, overrides).spec
        for rule in method.rules:
            for contradiction in rule(spec):
                better = load(name, (*overrides, *named_value(contradiction.remedy))).spec
                assert not named_value(contradiction.remedy) or contradiction.keys not in {
                    again.keys for again in rule(better)
                }

    check()


@given(st.floats(1e-9, 1e6), st.sampled_from(["m", "m/s", "m/s^2", "s", "Hz", "kg", "N", "V", "A", "H", "%"]))
def test_a_value_named_beside_a_bound_keeps_to_it_and_is_near(value, unit):
    low, high = (parse_quantity(text.strip('"'), unit) for text in (at_most(value, unit), at_least(value, unit)))
    assert low <= value <= high
    assert math.isclose(low, high, rel_tol=1.01e-3)
