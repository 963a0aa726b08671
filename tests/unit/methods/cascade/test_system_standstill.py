"""A cascade axis at standstill: starts, leaps and proof of rest. Short enough for plain Python."""

import math

import numpy as np
import pytest
from tests.standstill_rig import RIGID, axis, both, example, rigid

from detent.errors import DetentError
from detent.methods.cascade.standstill import CascadeEnsemble
from detent.methods.tuning import COLUMNS, Swing
from detent.tune.standstill import standstill, watch

SWING = Swing(motor=6e-6, load=6e-6, period=1.0, command=0.1, held=0.9, limited=0.0)


def changed(swing: Swing, **values: float) -> Swing:
    return Swing(**{name: getattr(swing, name) for name in Swing.__slots__} | values)


def test_starts_are_as_far_as_they_say_and_the_same_however_many():
    ensemble = CascadeEnsemble(example("mechanics.coupling.backlash=20 um").spec)
    courses = ensemble.courses(12, 7, on_counts=False)
    assert [one.start for one in courses[:4]] == ["small", "wide", "hard", "small"]
    again = ensemble.courses(3, 7, on_counts=False)
    assert [bytes(one.state) for one in courses[:3]] == [bytes(one.state) for one in again]
    low, high = ensemble.held
    assert (low, high) == (pytest.approx(-29.2 / 175.93, rel=1e-3), pytest.approx(27.2 / 175.93, rel=1e-3))
    for one in courses:
        c, machine = one.state.controller, one.state.plant.machine
        error = abs(one.feed[0][0] - c.motor_sensor.position)
        reach = 3 * 29.2 / ensemble.stiffness + 60e-6 + 5e-6
        most = {"small": 0.3 * reach, "wide": reach, "hard": 2 * 3.4091 * 175.93 / ensemble.stiffness}[one.start]
        assert error <= most * (1 + 1e-4)
        assert one.start != "hard" or error >= 0.99 * reach
        assert abs(machine.motor.position - machine.load.position) <= 10e-6
        assert low <= c.law.integral <= high


def test_targets_may_lie_on_counts():
    ensemble = CascadeEnsemble(example().spec)
    for one, free in zip(*(ensemble.courses(4, 1, on_counts=on) for on in (True, False)), strict=True):
        off = [abs(place - round(place)) for place in (course.feed[0][0] / 1e-6 for course in (one, free))]
        assert off[0] < 1e-6 < off[1]


@pytest.mark.parametrize(
    ("axis", "swing", "period", "why"),
    [
        (rigid(30, 0.1), 6.32e-6, 0.90, "less static friction"),
        (rigid(30, 0.1, integral=0), 0.0, math.inf, "nothing integrates"),
        (rigid(20, 0.1), 0.0, math.inf, "no larger"),
        (rigid(30, 0.1, stribeck=3), 0.0, math.inf, "steeper"),
        (rigid(40, 0.1, stribeck=0.3), 12.63e-6, 0.54, "less static friction"),
        (rigid(30, 0.1, "method.structure=pid", "method.proportional=9 kV/m", "method.integral=200 kV/(m*s)",
               "method.derivative=100 V*s/m"), 6.32e-6, 0.90, "less static friction"),
    ],
)  # fmt: skip
def test_the_rule_of_thumb(axis, swing, period, why):
    rule = CascadeEnsemble(axis.spec).rule
    assert (rule.swing, rule.period) == (pytest.approx(swing, rel=2e-3), pytest.approx(period, rel=1e-2))
    assert why in rule.why


def test_what_makes_it_hunt_is_told_by_how_it_moves():
    rough, free = CascadeEnsemble(rigid(40, 1).spec), CascadeEnsemble(example("mechanics.coupling.backlash=20 um").spec)
    coarse = CascadeEnsemble(rigid(40, 1, "drive.command_step=200 mV").spec)
    assert rough.kind(SWING) == "stick-slip"
    assert coarse.kind(SWING) == "converter step against friction"
    assert rough.kind(changed(SWING, limited=0.5)) == "saturation with integral"
    assert rough.kind(changed(SWING, limited=0.5, period=2.5e-3)) == "beyond the margin"
    assert rough.kind(changed(SWING, held=0.0, period=2.5e-3)) == "beyond the margin"
    assert rough.kind(changed(SWING, held=0.0, motor=1e-6, load=1e-6)) == "count edge"
    assert rough.kind(changed(SWING, held=0.0)) == "stick-slip"
    assert free.kind(changed(SWING, motor=27e-6)) == "gap crossing"
    assert free.kind(changed(SWING, held=0.0)) == "gap crossing"


def test_whether_the_file_says_what_the_answer_depends_on():
    assert not CascadeEnsemble(example().spec).stated  # the guides
    friction = both("load_friction", static="9 N", stribeck="1 mm/s")
    assert CascadeEnsemble(example(*friction).spec).stated


@pytest.mark.parametrize("more", [(), ("drive.delay=3", "encoder.velocity_span=4"), ("drive.command_step=5 mV",)])
def test_a_leap_leaves_what_the_same_samples_one_by_one_leave(more):
    """From a standstill with an error of 0.4 um, 30 N of static friction."""
    one, other = (CascadeEnsemble(rigid(30, 0.1, *more).spec).courses(4, 3, on_counts=False)[0] for _ in range(2))
    other.watch.leaps = 0
    for course in (one, other):
        c = course.state.controller
        course.feed[0][0] = c.motor_sensor.position + 0.4e-6
        c.law.integral = 0.166  # of 0.1705 V that friction holds with this error
    while one.watch.leapt == 0:
        one.go(one.period)
    passed = round(one.watch.sample)
    assert passed > 200
    rows = other.go(passed * other.period)
    a, b = one.state, other.state
    assert (a.tick, a.controller.samples) == (b.tick, b.controller.samples)
    for mass in ("motor", "load"):
        for name in ("position", "velocity"):
            ours, theirs = (getattr(getattr(r.plant.machine, mass), name) for r in (a, b))
            assert ours == pytest.approx(theirs, rel=1e-9)
    assert a.plant.machine.effort == pytest.approx(b.plant.machine.effort, rel=1e-9)
    assert a.controller.law.integral == pytest.approx(b.controller.law.integral, rel=1e-9)
    left = one.go(20 * one.period)
    late = one.watch.margin + one.params.plant.source.delay
    assert 1 <= np.flatnonzero(left[:, 8] == 0.0)[0] <= late + 1
    assert len(rows) == passed


def test_rest_is_proven_where_nothing_integrates_and_in_a_dead_band():
    for one in (rigid(30, 0.1, integral=0), rigid(30, 0.1, "method.dead_band=20 um")):
        course = CascadeEnsemble(one.spec).courses(1, 1, on_counts=False)[0]
        course.feed[0][0] = course.state.controller.motor_sensor.position + 5e-6
        found = watch(course, 0.1e-6, 1.0)
        assert (found.outcome, found.proven) == ("rests", True)
        assert found.swing.largest == 0.0
        assert found.simulated == 0.25


def test_an_axis_that_sticks_and_slips_is_found_and_its_rows_say_how():
    found = standstill(rigid(40, 1).spec, starts=1, longest=0.75)
    only = found.found[0]
    assert len(COLUMNS) == 10
    assert only.leapt > 0.5
    assert only.swing.motor == pytest.approx(12.1e-6, rel=0.1)
    assert only.swing.held > 0.5


def test_a_method_that_is_not_watched_says_so():
    import detent
    from detent.methods.registry import METHODS

    spec = detent.load(detent.example("print_head.toml")).spec
    with pytest.raises(DetentError, match="closes no loop at rest"):
        METHODS[spec.axis.method].standstill(spec)


NO_FRICTION = [*both(coulomb="0 N", static="0 N"), "drive.command_step=0 V", "method.velocity_integral=0 V/m"]


def edged(*overrides: str) -> CascadeEnsemble:
    return CascadeEnsemble(axis(RIGID, [*NO_FRICTION, "encoder.resolution=10 um", *overrides]).spec)


@pytest.mark.parametrize(("time", "swing", "frequency"), [("0.3 ms", 0.157, 333.3), ("1 ms", 0.187, 200.0)])
def test_a_cycle_across_the_edge_of_a_count_is_forecast(time, swing, frequency):
    (found,) = edged(f"encoder.velocity_filter={time}").forecasts
    assert found.kind == "count edge"
    assert found.swing == pytest.approx(swing * 10e-6, rel=1e-2)
    assert 1.0 / found.period == pytest.approx(frequency, rel=1e-3)


def test_friction_holds_what_is_weaker_than_the_command_of_a_count():
    held = 0.5 * 175.93 * edged().forecasts[0].command  # force that it costs [N]
    beyond, within = (both(coulomb=f"{share * held:.6g} N", static=f"{share * held:.6g} N") for share in (1.01, 0.99))
    assert not edged(*beyond).forecasts
    assert len(edged(*within).forecasts) == 1
    assert not edged("encoder.resolution=0 um").forecasts
    assert not edged("encoder.resolution=100 um").forecasts  # the command is at its limit


def test_a_loop_beyond_its_margin_swings_as_far_as_its_limit_lets_it():
    (found,) = CascadeEnsemble(example("method.velocity_gain=600 V*s/m").spec).forecasts
    assert found.kind == "beyond the margin"
    assert 1.0 / found.period == pytest.approx(404, rel=1e-2)
    assert 12e-6 < found.swing < 26e-6
    assert found.command == pytest.approx(2 * 600 / 175.93, rel=1e-3)
    assert [one.kind for one in CascadeEnsemble(example().spec).forecasts] == ["count edge"]  # it flickers so
