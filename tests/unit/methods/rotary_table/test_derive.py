"""Figures that follow from a rotary-table specification: sections 3.1, 3.3 and 7; those of the loop beside the axis."""

import math

import pytest

from detent.kernel.turn_table import TURN
from detent.methods.rotary_table.derive import TableFigures, derive, resolver_error, weakest_output
from detent.methods.rotary_table.schema import FineTable
from detent.sensing.resolver_counter import AbsoluteAngle, CompositionParams, ResolverParams, compose, fill_resolver

IDEAL = ("drive.droop=0 %",)
LOAD = ("disturbance.load.torque=100 N*m", "disturbance.load.at=1 s", "disturbance.load.duration=5 s")
DEG = math.pi / 180


def derived(axis):
    return {row.name: row for row in derive(axis.spec)}


@pytest.fixture(scope="module")
def figures(load_text, good_text):
    return derived(load_text(good_text, *IDEAL))


@pytest.mark.parametrize(
    ("name", "value", "tolerance"),
    [
        ("period T", 368_640, 0),
        ("count", 360 / 368_640 * DEG, 1e-15),
        ("speed of one word", 0.0651 * DEG, 5e-5 * DEG),
        ("largest table speed", 133.33 * DEG, 0.005 * DEG),
        ("distance per interrupt at limits.speed", 122.88, 1e-9),
        ("slowest jog", 360 / 368_640 / 65_536 / 2e-3 * DEG, 1e-18),
        ("slowest jog with a count in each interrupt", 0.48828 * DEG, 1e-5 * DEG),
        ("interrupts in a pass of the task", 10, 1e-12),
        ("interrupts in a turn at limits.speed", 3000, 1e-9),
        ("inertia at the motor J", 9e-4 + 0.8 / 8100, 1e-15),
        ("stiffness of the velocity loop", (9e-4 + 0.8 / 8100) / 20e-3, 1e-12),
        ("acceleration time", 0.2, 1e-12),
        ("acceleration distance", 6 * DEG, 1e-12),
        ("following error at limits.speed", 2 * DEG, 1e-12),
        ("damping without sampling", 0.6455, 5e-5),
        ("damping of the loop", 0.622, 0.001),
        # 2.07 deg of following error at the end of an acceleration (7).
        ("overshoot", 0.07 * DEG, 0.005 * DEG),
        ("cycle of a jog", 6.0, 1e-12),
        ("latency of a rollover", 1.2 * DEG, 1e-12),
        ("in position", 2 * 360 / 368_640 * DEG, 1e-15),
        ("deviation at rest", 1, 0),
        ("allowed coarse error", 1.9 * DEG, 0.015 * DEG),
        ("fine conversion", 204.8e-6, 1e-12),
        ("distance per conversion at limits.speed", 122.88 * 0.1024, 1e-6),
    ],
)
def test_derived_figures_are_those_of_the_specification(figures, name, value, tolerance):
    assert figures[name].value == pytest.approx(value, abs=tolerance)


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("count", "0.0009766 deg (3.516 seconds of arc)"),
        ("following error at limits.speed", "2 deg"),
        ("latency of a rollover", "0 to 1.2 deg"),
        ("in position", "+-0.001953 deg (7.031 seconds of arc) for 20 ms"),
        ("deviation at rest", "up to 1 count"),
        ("allowed coarse error", "+-1.911 deg"),
        ("distance per interrupt at limits.speed", "122.9 counts in an interrupt"),
    ],
)
def test_figures_read_as_people_say_them(figures, name, text):
    assert figures[name].text == text


def test_every_figure_has_a_text_and_a_formula(figures):
    assert all(row.text and row.formula and math.isfinite(row.value) for row in figures.values())


@pytest.mark.parametrize(
    "overrides",
    [IDEAL, (), ("mechanics.coulomb=0.1 N*m",), ("limits.speed=20 deg/s", "position.1.speed=1 deg/s")],
)
def test_the_simulated_axis_follows_as_the_figures_say(bench_of, overrides):
    bench = bench_of(overrides).run(0.1).jog(1)
    torque = error = 0.0
    for _ in range(5000):
        bench.run(1e-4)
        torque = max(torque, bench.r.plant.amplifier.torque)
        error = max(error, bench.r.controller.positioner.dr / 65_536 * bench.spec.count)
    machine = TableFigures(bench.spec)
    following, passed = machine.following_error(machine.speed), machine.overshoot(machine.speed)
    assert error == pytest.approx(following + passed, abs=0.001 * DEG)
    bench.run(1.0)
    assert bench.r.controller.positioner.dr / 65_536 * bench.spec.count == pytest.approx(following, abs=0.002 * DEG)
    assert bench.r.controller.positioner.s4 == pytest.approx(machine.word_at(machine.speed), abs=1)
    # Droop and friction are at their largest at the end of an acceleration, which itself is at its beginning; a short
    # one does not come to its peak. The word is rounded.
    word = bench.spec.stiffness * bench.spec.speed_per_word * bench.spec.ratio
    assert 0.8 * (machine.accelerating_torque - machine.resisting_torque) <= torque
    assert torque <= machine.accelerating_torque + word


@pytest.mark.parametrize(
    ("overrides", "most"),
    [((), 1), (("drive.word_bits=10",), 4), (("mechanics.coulomb=0.09 N*m", "mechanics.static=0.1 N*m"), 45)],
)
def test_no_positioning_of_the_simulated_axis_rests_farther_off(bench_of, overrides, most):
    errors = []
    for k in range(25):
        bench = bench_of((*overrides, f"position.1.angle={20 + 3.37 * k} deg")).run(0.1).go(1).run(7)
        errors.append(abs(bench.r.controller.positioner.oar - bench.r.controller.positioner.angle.aar))
    assert TableFigures(bench.spec).resting_error == most
    assert max(errors) <= most
    assert most == 1 or max(errors) > most / 3


def test_a_table_that_is_put_beside_its_place_rests_there(bench_of):
    # 45 counts of 46 are held by friction; from 50 the motor breaks loose.
    for counts, stays in ((45, True), (50, False)):
        bench = bench_of(("mechanics.coulomb=0.09 N*m", "mechanics.static=0.1 N*m")).run(0.1)
        bench.r.plant.train.motor.angle += counts * math.tau / 4096
        bench.run(0.5)
        held = bench.r.controller.positioner.angle.aar - bench.r.controller.positioner.oar
        assert (held == counts) == stays


def test_a_load_is_held_with_the_deviation_stated(load_text, good_text, bench_of):
    figure = derived(load_text(good_text, *LOAD))["deviation under the load"]
    assert figure.value == pytest.approx(0.497 * DEG, abs=0.001 * DEG)
    bench = bench_of((*LOAD, "drive.word_bits=20")).run(3.0)
    moved = (bench.r.controller.positioner.angle.aar - bench.r.controller.positioner.oar) * bench.spec.count
    assert moved == pytest.approx(figure.value, abs=2 * bench.spec.count)


def test_without_position_control_there_is_no_loop(load_text, good_text):
    rows = derived(load_text(good_text, "method.position_control=false", *LOAD))
    for name in ("following error at limits.speed", "damping of the loop", "overshoot", "deviation at rest"):
        assert name not in rows
    assert not {"acceleration torque", "deviation under the load"} & set(rows)
    assert rows["cycle of a jog"].text == "6 s"


def test_an_unstable_loop_has_a_limit_and_no_overshoot(load_text, good_text):
    rows = derived(load_text(good_text, "method.position_gain=1000"))
    assert rows["stability limit"].text == "Kp = 890.7 1/s, 0.891 x the gain"
    assert not {"overshoot", "acceleration torque"} & set(rows)


# ----------------------------------------------------------------------------------------------------------- detector


@pytest.mark.parametrize(
    "faults",
    [
        {"gain_error": 0.05},
        {"gain_error": -0.3, "quadrature_error": 0.1},
        {"offset_error": -0.2},
        {"gain_error": -0.5, "quadrature_error": 0.3, "offset_error": 0.4},
    ],
)
def test_the_error_of_a_resolver_is_that_of_its_table(faults):
    table, p = FineTable().model_copy(update=faults), ResolverParams()
    fill_resolver(p, table.gain_error, table.quadrature_error, table.offset_error)
    worst = max(abs(value) for value in p.errors.value)
    assert resolver_error(table) == pytest.approx(worst / TURN * 2 * math.pi, abs=1e-8)
    places = [2 * math.pi * k / 3600 for k in range(3600)]
    gain, q = 1 + table.gain_error, table.quadrature_error
    outputs = [math.hypot(gain * math.cos(x) - math.sin(q) * math.sin(x), math.cos(q) * math.sin(x)) for x in places]
    assert weakest_output(table) == pytest.approx(min(outputs), abs=1e-5)


def test_a_perfect_resolver_has_no_error():
    assert (resolver_error(FineTable()), weakest_output(FineTable())) == (0, 1)


ERRORS = (
    "detector.coarse.backlash=1 deg",
    "detector.coarse.eccentricity=0.3 deg",
    "detector.coarse.alignment_error=-0.2 deg",
    "detector.coarse.noise=0.1 deg",
    "detector.coarse.offset_error=1 %",
    "detector.fine.noise=9 deg",
)


def test_coarse_errors_add_up(load_text, good_text):
    axis = load_text(good_text, *ERRORS)
    errors = TableFigures(axis.spec).coarse_errors
    assert {name: round(math.degrees(error), 3) for name, error in errors.items()} == {
        "backlash": 0.5,
        "eccentricity": 0.3,
        "alignment": 0.2,
        "windings and comparator": 0.573,
        "noise": 0.1,
        "fine resolver": 0.1,
    }
    row = derived(axis)["coarse error"]
    assert row.text == "up to 1.773 deg"
    assert row.formula == "backlash + eccentricity + alignment + windings and comparator + noise + fine resolver"


# A word is rounded down: one that errs to larger angles has a count more of room.
@pytest.mark.parametrize(
    ("share", "exact"), [(0.999, True), (-0.999, True), (1.06, True), (-1.06, False), (1.3, False)]
)
def test_composition_is_right_up_to_the_allowed_error(load_text, good_text, share, exact):
    spec = load_text(good_text, "detector.coarse.counts=1024").spec
    p, r = CompositionParams(ratio=90, fine=4096, coarse=1024), AbsoluteAngle()
    error = round(share * TableFigures(spec).allowed_coarse_error / (2 * math.pi) * TURN)
    wrong = 0
    for theta in range(0, spec.period, 7):
        phase = ((theta << 32) // spec.period + error) % TURN
        compose(p, r, theta % 4096, (phase * 1024) >> 32)
        wrong += r.theta != theta
    assert (wrong == 0) == exact


def test_what_no_loop_sees(load_text, good_text):
    assert "angle error of the table" not in derived(load_text(good_text))
    more = ("mechanics.backlash=0.1 deg", "mechanics.eccentricity=0.02 deg", "detector.fine.offset_error=10 %")
    error = derived(load_text(good_text, *more))["angle error of the table"]
    assert error.value == pytest.approx((0.05 + 0.02) * DEG + math.asin(0.1) / 90)


def test_conversions(load_text, good_text):
    rows = derived(load_text(good_text, "detector.coarse.counts=8192", "detector.clock=40 MHz"))
    assert rows["fine conversion"].value == pytest.approx(102.4e-6)
    assert rows["coarse conversion"].value == pytest.approx(204.8e-6)
