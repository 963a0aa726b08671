"""Figures that follow from a print-head specification."""

import pytest

from detent.methods.print_head.derive import derive


def derived(axis):
    return {row.name: row for row in derive(axis.spec)}


@pytest.fixture(scope="module")
def figures(load_text, good_text):
    return derived(load_text(good_text, "method.span=emf"))


@pytest.mark.parametrize(
    ("name", "value", "tolerance"),
    [
        # Figures of the specification, 7.2 and 3.10.
        ("drive counts per volt", 300 / 38, 1e-9),
        ("top speed value", 240, 0),
        ("slope K, right", 170, 0.05),
        ("slope K, left", 170, 0.05),
        ("friction, right", 36, 0.05),
        ("friction, left", 28, 0.05),
        ("moving mass", 1.3212, 2e-4),
        ("acceleration from the IR counts", 15.24, 0.01),
        ("electrical time constant", 1e-3, 1e-12),
        ("mechanical time constant", 40.16e-3, 1e-5),
        ("ramp interval at top speed", 418.2e-6, 0.1e-6),
        ("stop distance at top speed", 400, 0),
        ("headroom at top speed, right", 9, 0.5),
        ("headroom at top speed, left", 17, 0.5),
        ("stall current", 38 / 12, 1e-9),
        ("stall current while homing", 1.16, 0.005),
    ],
)
def test_derived_figures_are_those_of_the_specification(figures, name, value, tolerance):
    assert figures[name].value == pytest.approx(value, abs=tolerance)


def test_the_literal_span_gives_the_literal_interval(load_text, good_text):
    rows = derived(load_text(good_text, "method.span=steady"))
    assert rows["ramp interval at top speed"].value == pytest.approx(348.2e-6, abs=0.1e-6)


def test_peak_speed_is_where_the_line_meets_the_supply(figures):
    # 300 counts = K s/256 + friction
    assert figures["peak speed, right"].value == pytest.approx((300 - 36) * 256 / 170 * 0.0254 / 6, rel=1e-3)


def test_the_line_at_top_speed_leaves_room_for_run_up_and_stop(figures):
    emitters = 4350 - 2 * (1.05 * 400 + 12)
    assert figures["print line at top speed"].value == pytest.approx(emitters * 0.0254 / 300, rel=1e-9)


def test_viscous_friction_adds_to_the_slope(load_text, good_text):
    plain = derived(load_text(good_text))["slope K, right"].value
    rows = derived(load_text(good_text, "mechanics.friction.right.viscous=2 N*s/m"))
    # 2 N s/m x r/Kt x R = 1.208 V s/m, beside the back-EMF's 19.87 V s/m
    assert rows["slope K, right"].value / plain == pytest.approx(1 + 2 * 12 / 19.87**2, rel=1e-4)
    assert rows["slope K, left"].value == plain


def test_drifts_are_those_of_the_true_machine(load_text, good_text):
    rows = derived(load_text(good_text, "disturbance.motor_constant=+10 %"))
    assert rows["slope K, right"].value == pytest.approx(1.1 * 170, rel=1e-3)
    # Friction drifts as the drive that overcomes it: a drift of the motor constant alone leaves Vf where it was.
    assert rows["friction, right"].value == pytest.approx(36, rel=1e-3)
    rows = derived(load_text(good_text, "disturbance.supply=34.2 V"))
    assert rows["slope K, right"].value == pytest.approx(170 / 0.9, rel=1e-3)


def test_every_figure_has_a_text_and_a_formula(figures):
    for row in figures.values():
        assert row.text
        assert row.formula
        assert row.unit


def test_the_shortest_way_allowed_still_holds_a_line(load_text, good_text):
    rows = derived(load_text(good_text, "limits.travel=4 in", "print.left_margin=1 in"))
    assert 0 < rows["print line at top speed"].value < 0.0254 * 1.2
