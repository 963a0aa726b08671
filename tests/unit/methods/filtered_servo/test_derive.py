"""Figures that follow from a filtered-servo specification: sections 3.4 to 3.7 and 7."""

import math

import numpy as np
import pytest

from detent.analysis.sampled_loop import SampledLoop
from detent.methods.filtered_servo.derive import FilteredFigures, damping_of, derive

FREE = tuple(f"mechanics.friction.{side}.{kind}=0 N" for side in ("right", "left") for kind in ("coulomb", "static"))
EXACT = ("mechanics.moving_mass=0 kg", "motor.rotor_inertia=700 g*cm^2", *FREE)
PLANT_A = (*EXACT, f"drive.current_per_count={4000 * 7e-5 / 0.05 * 2 * math.pi / 1000!r} A")
PLANT_B = (*EXACT, "drive.amplifier=voltage", "drive.supply=12 V")


def derived(axis):
    return {row.name: row for row in derive(axis.spec)}


@pytest.fixture(scope="module")
def figures(load_text, good_text):
    return derived(load_text(good_text, *PLANT_A, "limits.speed=125 mm/s"))


@pytest.mark.parametrize(
    ("name", "value", "tolerance"),
    [
        ("pulse", 5e-6, 1e-18),
        ("pulse rate at limits.speed", 25_000, 1e-6),
        ("count at limits.speed", 125, 0),
        ("gain K", 4000, 1e-6),
        ("K2", 0.02, 1e-12),
        ("velocity-error constant KV", 50, 1e-9),
        ("following error at limits.speed", 500, 1e-6),
        ("jump of the drive word for one pulse", 1, 0),
        ("filter time constant Tf", 0.02, 1e-12),
        ("equivalent time constant", 17.38e-3, 0.005e-3),
        ("filter corner, -3 dB", 9.22, 0.005),
        ("noise gain of the filter", 0.378, 0.0005),
        ("K TS^2", 0.1, 1e-9),
        ("stability limit", 10_216, 51),
        ("Tf / (K2 / K1)", 1, 1e-12),
        ("error at rest", 0, 0),
        # Trap 1: modes at -8.2 +- j88.8 1/s.
        ("damping of the loop", 8.2 / math.hypot(8.2, 88.8), 0.001),
        ("spectral radius", math.exp(-8.2 * 5e-3), 0.0005),
    ],
)
def test_derived_figures_are_those_of_the_specification(figures, name, value, tolerance):
    assert figures[name].value == pytest.approx(value, abs=tolerance)


@pytest.mark.parametrize(
    ("more", "ideal", "damped"),
    [
        (("method.filter=none",), 16_564, 17_802),
        ((), 10_216, 16_923),
        (
            ("method.filter=none", "method.scale=1", "method.sample_period=20 ms", "method.counter_bits=12"),
            2_742,
            4_044,
        ),
        (("method.filter=none", "method.scale=1"), 43_865, 48_907),
    ],
)
def test_stability_limits_are_those_of_test_22(load_text, good_text, more, ideal, damped):
    for plant, limit in ((PLANT_A, ideal), (PLANT_B, damped)):
        rows = derived(load_text(good_text, *plant, *more))
        assert rows["stability limit"].value == pytest.approx(limit, rel=5e-3)


def test_plant_b_has_a_time_constant_and_a_drive_error(load_text, good_text):
    spec = load_text(good_text, *PLANT_B, "limits.speed=5 mm/s").spec
    rows = {row.name: row for row in derive(spec)}
    assert rows["gain K"].value == pytest.approx(5329, abs=1)
    assert rows["mechanical time constant"].value == pytest.approx(56e-3, rel=1e-6)
    # Test 16: 20 + v / (tau_m K) at 1000 pulses/s.
    assert rows["following error at limits.speed"].value == pytest.approx(23.35, abs=0.01)
    loop = FilteredFigures(spec).loop
    assert spec.following_error(5e-3) == pytest.approx(loop.steady_following_error(1000), rel=1e-12)


def test_friction_adds_to_the_following_error_and_stays_at_rest(load_text, good_text):
    rows = derived(load_text(good_text))
    # 2.26 N over 2.2117 N a count is 1.02 counts: 400 pulses of speed word and 1.02 of friction; one stays at rest.
    assert rows["following error at limits.speed"].value == pytest.approx(401.02, abs=0.01)
    assert rows["error at rest"].value == 1
    viscous = [f"mechanics.friction.{side}.viscous=100 N*s/m" for side in ("right", "left")]
    rows = derived(load_text(good_text, *viscous))
    assert rows["mechanical time constant"].value == pytest.approx(1.1055, rel=1e-3)


def test_without_a_filter_its_figures_are_left_out(load_text, good_text):
    rows = derived(load_text(good_text, "method.filter=none"))
    assert not [name for name in rows if "filter" in name or name == "equivalent time constant"]
    assert rows["jump of the drive word for one pulse"].value == 4
    assert rows["Tf / (K2 / K1)"].value == 0


def test_a_filter_that_hardly_filters_has_no_corner(load_text, good_text):
    assert "filter corner, -3 dB" not in derived(load_text(good_text, "method.coefficient=0.9"))


def test_an_axis_without_a_limit_of_stability_names_none(load_text, good_text):
    quick = (*PLANT_B, "motor.rotor_inertia=25 g*cm^2", "method.scale=1", "limits.speed=5 mm/s")
    machine = FilteredFigures(load_text(good_text, *quick).spec)
    assert machine.tau_m == pytest.approx(2e-3)
    assert machine.gain_margin == math.inf
    assert "stability limit" not in {row.name for row in derive(machine.spec)}


def test_every_figure_has_a_text_and_a_formula(figures):
    assert all(row.text and row.formula and math.isfinite(row.value) for row in figures.values())


def test_the_largest_force_is_that_of_the_word_or_of_the_limit(load_text, good_text):
    rows = derived(load_text(good_text, "limits.effort=100 N"))
    assert rows["largest force"].text == "100 N at 45.21 counts"
    assert "127 counts" in derived(load_text(good_text, "limits.effort=1 kN"))["largest force"].text


def test_top_speed_is_where_the_drive_is_used_up(load_text, good_text):
    # No-load speed of plant B: 127/128 of 12 V over 0.05 V s/rad, 2290 rpm less a 128th (7).
    machine = FilteredFigures(load_text(good_text, *PLANT_B, "limits.effort=1e5 N").spec)
    assert machine.top_speed / 5e-3 * 60 == pytest.approx(2290 * 127 / 128, rel=1e-3)
    assert FilteredFigures(load_text(good_text).spec).top_speed == math.inf
    held = [f"mechanics.friction.{side}.coulomb=300 N" for side in ("right", "left")]
    still = [f"mechanics.friction.{side}.static=300 N" for side in ("right", "left")]
    assert FilteredFigures(load_text(good_text, *held, *still).spec).top_speed == -math.inf


def test_the_ramp_is_that_of_the_command(load_text, good_text):
    machine = FilteredFigures(load_text(good_text).spec)
    ramp = machine.ramp
    # 0.1 m/s at 1 m/s^2 are 20 windows of 5 ms; then the speed of 100 pulses a window.
    assert len(ramp.t) == 1 + 20 + 200
    assert np.diff(ramp.command)[:2] == pytest.approx([2.5, 7.5])
    assert np.diff(ramp.command)[20:] == pytest.approx(np.full(200, 100.0))
    # Reproduced by the simulated axis, which counts 103 (tests of the rig).
    assert machine.largest_count == 103
    assert 400 < machine.largest_error < 500


def test_a_command_that_jumps_has_no_ramp(load_text, good_text):
    machine = FilteredFigures(load_text(good_text, "method.command_acceleration=0 m/s^2").spec)
    assert np.diff(machine.ramp.command) == pytest.approx(np.full(200, 100.0))


def test_a_slow_ramp_is_computed_from_its_end(load_text, good_text):
    machine = FilteredFigures(load_text(good_text, "method.command_acceleration=5 mm/s^2").spec)
    assert len(machine.ramp.t) == 1 + 2000 + 200
    assert np.diff(machine.ramp.command)[1999:] == pytest.approx(np.full(201, 100.0), abs=0.02)


@pytest.mark.parametrize(
    ("values", "damping"),
    [
        ({"scale": 4}, 0.815),
        ({"scale": 4, "coefficient": 0.25}, 0.092),
        ({"scale": 1, "sample_period": 20e-3}, -0.077),
        ({"scale": 40, "gain": 150.0}, 1.0),
    ],
)
def test_damping_is_that_of_the_mode_that_swings_most(values, damping):
    loop = SampledLoop(**{"gain": 4000.0, "sample_period": 5e-3, **values})
    assert damping_of(loop) == pytest.approx(damping, abs=0.001)
