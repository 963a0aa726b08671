"""Figures that follow from a phase-servo specification: the defaults of section 7 and what it computes from them."""

import math

import pytest

from detent.methods.phase_servo.build import velocity_table
from detent.methods.phase_servo.derive import PhaseFigures, derive


def derived(axis):
    return {row.name: row for row in derive(axis.spec)}


@pytest.fixture(scope="module")
def figures(load_text, good_text):
    return derived(load_text(good_text))


@pytest.mark.parametrize(
    ("name", "value", "tolerance"),
    [
        ("pitch", 423.33e-6, 0.005e-6),
        ("step", 6.615e-6, 0.0005e-6),
        ("reference clock", 4e6, 0),
        ("carrier", 62.5e3, 0),
        ("speed sample period", 512e-6, 0),
        ("integration period", 1.024e-3, 1e-12),
        ("one count of the drive word", 0.1875, 1e-12),
        ("one unit of the integral", 0.19, 0.005),
        ("one count of the speed word", 12.9e-3, 0.05e-3),
        ("slew limit, right", 0.420, 0.0005),
        ("slew limit, left", 0.407, 0.0005),
        ("peak speed", 0.349, 0.0005),
        ("speed word", 6, 0),
        ("longest distance", 14 * 60 * 64, 1e-6),
        ("tolerated spurious pulses", 23, 0),
        ("peak of the velocity table", 886, 0),
        ("speed at the change of mode", 43e-3, 2.5e-3),
        ("deceleration after the change of mode", 17, 2.5),
        ("moving mass", 1.07, 0.005),
        ("force at the current limit", 37, 0.5),
        ("acceleration against friction", 34, 0.5),
        ("stall current", 12, 1e-9),
        ("back-EMF at peak speed", 2.2, 0.05),
        ("electrical time constant", 400e-6, 1e-12),
        ("PWM frequency", 31.25e3, 1e-6),
        ("velocity loop", 670, 3),
        ("position loop", 573, 3),
        ("breakaway drive", 2.1, 0.05),
        ("drive of one step", 4, 0),
    ],
)
def test_derived_figures_are_those_of_the_specification(figures, name, value, tolerance):
    assert figures[name].value == pytest.approx(value, abs=tolerance)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("slew limit, right", "63492 steps/s"),
        ("slew limit, left", "61538 steps/s"),
        ("peak speed", "52734 steps/s"),
        ("longest distance", "840 pitches"),
        ("PWM frequency", "78.5 x the electrical corner"),
        ("speed word", "6 of 8 bits"),
        ("peak of the velocity table", "27 counts from 886 steps on"),
    ],
)
def test_texts_say_what_the_specification_says(figures, name, words):
    assert words in figures[name].text


def test_the_share_of_the_slew_limit_is_told(figures):
    assert "85.7 %" in figures["peak speed"].formula


def test_every_figure_has_a_text_and_a_formula(figures):
    assert len(figures) >= 30
    assert all(row.text and row.formula and math.isfinite(row.value) for row in figures.values())


@pytest.mark.parametrize(
    "overrides",
    [
        (),
        ("clock.order=literal",),
        ("limits.speed=0.2 m/s", "method.table_acceleration=3 m/s^2"),
        ("detector.counts=128", "drive.pwm_bits=9", "limits.speed=0.1 m/s", "limits.travel=0.2 m"),
    ],
)
def test_the_peak_of_the_table_is_where_the_table_says(load_text, good_text, overrides):
    axis = load_text(good_text, *overrides)
    spec, distance = axis.spec, derived(axis)["peak of the velocity table"].value
    table = velocity_table(spec)
    assert table[distance] == spec.peak_count > table[distance - 1]
    assert table == [spec.table_velocity(n) for n in range(len(table))]


def test_the_table_is_that_of_the_specification(load_text, good_text):
    spec = load_text(good_text).spec
    entries = {1: 1, 8: 3, 9: 3, 16: 4, 32: 5, 64: 7, 128: 10, 256: 14, 512: 20, 886: 27, 65535: 27}
    assert {n: spec.table_velocity(n) for n in entries} == entries


def test_the_literal_order_halves_the_gain_of_a_finer_count(load_text, good_text):
    rows = derived(load_text(good_text, "clock.order=literal"))
    assert "54 counts" in rows["peak of the velocity table"].text
    assert rows["velocity loop"].value == pytest.approx(670, abs=3)
    assert rows["integration period"].value == pytest.approx(512e-6)


def test_a_weak_supply_limits_the_force(load_text, good_text):
    rows = derived(load_text(good_text, "drive.supply=8 V"))
    assert rows["force at the current limit"].value == pytest.approx(4 * 0.05 / (50.8e-3 / (2 * math.pi)))


def test_the_gain_margin_is_that_of_the_loop_at_its_limit(load_text, good_text):
    machine = PhaseFigures(load_text(good_text).spec)
    more = f"drive.supply={24 * 0.99 * machine.gain_margin} V"
    assert PhaseFigures(load_text(good_text, more).spec).gain_margin == pytest.approx(1 / 0.99, rel=1e-3)
    # Where one step of error is worth a thousand steps in a sample there is nothing to compute.
    feather = (
        "mechanics.carriage_mass=1e-9 kg",
        "mechanics.pulley_inertia=0 kg*m^2",
        "motor.rotor_inertia=1e-4 g*cm^2",
    )
    assert PhaseFigures(load_text(good_text, *feather, "motor.torque_constant=0.3 mN*m/A").spec).gain_margin == 0.0


def test_damping_counts_back_emf_and_viscous_friction(load_text, good_text):
    machine = PhaseFigures(load_text(good_text).spec)
    assert machine.decay == pytest.approx(1 / 56.17e-3, rel=2e-3)  # R J / (Kt Ke), J = 7.02e-5 kg m^2
    assert machine.damping == pytest.approx((668.4 + 17.8) / (2 * 571.3), rel=1e-3)
    sides = [f"mechanics.friction.{side}.viscous=10.74 N*s/m" for side in ("right", "left")]
    assert PhaseFigures(load_text(good_text, *sides).spec).decay == pytest.approx(machine.decay + 10, rel=1e-3)
