"""What `detent check` has to show: values in effect, derived figures, warnings."""

import json

import pytest

from detent.axisfile.check import check_spec


@pytest.fixture(scope="module")
def report(load_text, good_text):
    return check_spec(load_text(good_text, "method.span=emf"))


def derived(report):
    return {row.name: row for row in report.derived}


def cautions(load_text, text, *overrides):
    return {warning.name: warning for warning in check_spec(load_text(text, *overrides)).warnings}


def test_the_default_plant_has_nothing_to_warn_about(report):
    assert report.warnings == ()


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
def test_derived_figures_are_those_of_the_specification(report, name, value, tolerance):
    assert derived(report)[name].value == pytest.approx(value, abs=tolerance)


def test_the_literal_span_gives_the_literal_interval(load_text, good_text):
    rows = derived(check_spec(load_text(good_text, "method.span=steady")))
    assert rows["ramp interval at top speed"].value == pytest.approx(348.2e-6, abs=0.1e-6)


def test_peak_speed_is_where_the_line_meets_the_supply(report):
    # 300 counts = K s/256 + friction
    assert derived(report)["peak speed, right"].value == pytest.approx((300 - 36) * 256 / 170 * 0.0254 / 6, rel=1e-3)


def test_the_line_at_top_speed_leaves_room_for_run_up_and_stop(report):
    emitters = 4350 - 2 * (1.05 * 400 + 12)
    assert derived(report)["print line at top speed"].value == pytest.approx(emitters * 0.0254 / 300, rel=1e-9)


def test_viscous_friction_adds_to_the_slope(load_text, good_text):
    plain = derived(check_spec(load_text(good_text)))["slope K, right"].value
    rows = derived(check_spec(load_text(good_text, "mechanics.friction.right.viscous=2 N*s/m")))
    # 2 N s/m x r/Kt x R = 1.208 V s/m, beside the back-EMF's 19.87 V s/m
    assert rows["slope K, right"].value / plain == pytest.approx(1 + 2 * 12 / 19.87**2, rel=1e-4)
    assert rows["slope K, left"].value == plain


def test_drifts_are_those_of_the_true_machine(load_text, good_text):
    rows = derived(check_spec(load_text(good_text, "disturbance.motor_constant=+10 %")))
    assert rows["slope K, right"].value == pytest.approx(1.1 * 170, rel=1e-3)
    # Friction drifts as the drive that overcomes it: a drift of the motor constant alone leaves Vf where it was.
    assert rows["friction, right"].value == pytest.approx(36, rel=1e-3)
    rows = derived(check_spec(load_text(good_text, "disturbance.supply=34.2 V")))
    assert rows["slope K, right"].value == pytest.approx(170 / 0.9, rel=1e-3)


def test_every_figure_has_a_text_and_a_formula(report):
    for row in report.derived:
        assert row.text
        assert row.formula
        assert row.unit


def test_rows_hold_every_value_with_its_origin(report):
    rows = {row.key: row for row in report.rows}
    assert rows["limits.travel"].value == "368.3 mm"
    assert rows["limits.travel"].written == "14.5 in"
    assert rows["limits.travel"].origin == "axis.toml line 7"
    assert rows["motor.resistance"].origin == "catalogue JDH-2250-DF-1C (inferred)"
    assert rows["method.span"].origin == "--set"
    assert rows["method.trim"].origin == "default"
    assert rows["mechanics.start_position"].value == "92.08 mm"
    assert "disturbance.obstacle.position" not in rows


def test_an_optional_table_that_is_given_is_shown(load_text, good_text):
    rows = {row.key: row for row in check_spec(load_text(good_text, "disturbance.obstacle.position=7 in")).rows}
    assert rows["disturbance.obstacle.position"].value == "177.8 mm"


def test_the_report_is_plain_data_for_json(report):
    data = json.loads(json.dumps(report.to_dict()))
    assert data["name"] == "print head"
    assert data["method"] == "print_head"
    assert data["rows"][0]["key"] == "axis.name"
    assert data["warnings"] == []


@pytest.mark.parametrize(
    ("overrides", "name", "words"),
    [
        (["disturbance.motor_constant=+10 %"], "drive at top speed, right", ["300 counts", "lower limits.speed"]),
        (["limits.effort=36 V"], "drive at top speed, right", ["284.2 counts", "in/s"]),
        (["motor.catalogue=maxon RE 40 148867"], "slope K, left", ["100 to 255/256", "SB1 10"]),
        (["motor.catalogue=maxon RE 40 148867"], "fast calibration pass, left", ["faster than the axis may"]),
        (["motor.catalogue=maxon RE 40 148867"], "ramp interval at top speed", ["350 us to 450 us", "weak"]),
        (
            ["motor.torque_constant=0.31 N*m/A", "motor.back_emf_constant=0.31 V*s/rad"],
            "ramp interval at top speed",
            ["strong"],
        ),
        (["method.friction_max_counts=33"], "friction, right", ["0 to 33 counts"]),
        (["mechanics.carriage_mass=2 kg"], "acceleration from the IR counts", ["longer", "method.ir_counts = 161"]),
        (["mechanics.carriage_mass=0.5 kg"], "acceleration from the IR counts", ["shorter"]),
        (["mechanics.friction.left.static=30 N"], "static friction, left", ["124 counts", "break the head loose"]),
        (["mechanics.friction.right.coulomb=14 N"], "slow calibration pass, right", ["friction holds the head"]),
        (["homing.speed=10 in/s", "homing.drive_limit_counts=60"], "homing drive, right", ["looks like a frame"]),
        (["motor.inductance=0.1 mH"], "electrical time constant", ["8.333 us", "switch-level"]),
        (["motor.max_current=1 A"], "current while accelerating", ["1.393 A", "1 A", "overheats"]),
        (["motor.max_current=1 A"], "stall current while homing", ["1.161 A", "homing.drive_limit_counts"]),
    ],
)
def test_warnings_say_value_limit_consequence_and_remedy(load_text, good_text, overrides, name, words):
    found = cautions(load_text, good_text, *overrides)
    for word in words:
        assert word in str(found[name])


def test_the_shortest_way_allowed_still_holds_a_line(load_text, good_text):
    rows = derived(check_spec(load_text(good_text, "limits.travel=4 in", "print.left_margin=1 in")))
    assert 0 < rows["print line at top speed"].value < 0.0254 * 1.2


def test_the_switch_level_bridge_shows_current_gaps_so_nothing_is_warned(load_text, good_text):
    overrides = ["motor.inductance=0.1 mH", "axis.fidelity=switch-level"]
    assert "electrical time constant" not in cautions(load_text, good_text, *overrides)
