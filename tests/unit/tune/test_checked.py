"""The row of `detent check` that says what an axis does at standstill, on verdicts made by hand."""

import math
from dataclasses import replace

import pytest
from tests.acceptance.test_golden_bits import EXAMPLES
from tests.standstill_rig import both
from tests.unit.tune.test_standstill import GRAIN

import detent
from detent.methods.check import check_spec
from detent.methods.registry import METHODS
from detent.methods.tuning import Rule, Swing
from detent.tune import stand
from detent.tune.checked import check_axis
from detent.tune.standstill import HUNTS, NOTHING, RESTS, Standstill, Stood

CASCADE = EXAMPLES / "cascade.toml"


def made(ensemble, hunting: int, swing: float) -> Standstill:
    """So many of eight starts hunt so far."""
    moves = Swing(motor=swing, load=swing, period=0.5, command=0.1, held=0.9, limited=0.0)
    still = Stood(start="small", outcome=RESTS, proven=True, swing=NOTHING.swing, error=0.0, moved=False,
                  simulated=1.0, leapt=0.0)  # fmt: skip
    return Standstill(ensemble, [replace(still, outcome=HUNTS, swing=moves) if k < hunting else still
                                 for k in range(8)])  # fmt: skip


@pytest.fixture
def check(monkeypatch):
    """What is said of an axis of which so many starts hunt so far; of one with friction as stated only, others."""
    monkeypatch.setattr(stand, "COMPILED", True)

    def look(hunting, swing, *overrides, stated=(0, 0.0)):
        file = detent.load(CASCADE, overrides).file

        def watch(spec, starts):
            assert starts == 8
            return made(METHODS["cascade"].standstill(spec), *((hunting, swing) if spec is file.spec else stated))

        monkeypatch.setattr(stand, "standstill", watch)
        report = check_axis(file)
        return report.derived[-1], [one for one in report.warnings if one.name == "standstill"]

    return look


ALL = both("load_friction", static="8 N", stribeck="0 m/s")  # all else is stated in the file


def test_an_axis_that_rests_has_a_row_with_the_rule_of_thumb(check):
    row, cautions = check(0, 0.0, *ALL)
    assert (row.name, row.value, row.unit, row.text) == ("standstill", 0.0, "m", "rests from 8 of 8 starts")
    assert "rule of thumb: " in row.formula
    assert "default" not in row.formula
    assert cautions == []


def test_without_an_integral_the_rule_has_no_stick_slip(check):
    row, _ = check(0, 0.0, "method.velocity_integral=0 V/m")
    assert row.formula.startswith("simulated; rule of thumb: no stick-slip")


def test_an_axis_that_hunts_is_cautioned_with_what_helps(check):
    row, (caution,) = check(3, 20e-6, *ALL)
    assert (row.text, row.value) == ("hunts from 3 of 8 starts, 20 um", 20e-6)
    assert caution.value == "hunts from 3 of 8 starts: stick-slip, by 20 um every 500 ms"
    assert "detent hunt --dead-band" in caution.remedy


def test_hunting_by_a_count_is_a_row_and_no_caution(check):
    row, cautions = check(8, 1.4 * GRAIN, *ALL)
    assert row.text.startswith("hunts from 8 of 8")
    assert cautions == []


def test_a_verdict_that_rests_on_a_default_of_static_friction_says_so_and_is_no_caution(check):
    row, cautions = check(8, 20e-6)
    assert row.formula.endswith("static friction or Stribeck velocity is a default")
    assert cautions == []
    _, (caution,) = check(8, 20e-6, stated=(5, 10e-6))
    assert "hunts from 8 of 8 starts: stick-slip, by 20 um" in caution.value
    assert caution.value.endswith("(static friction or Stribeck velocity is a default)")


@pytest.mark.parametrize(
    ("overrides", "compiled", "why"),
    [((), False, "not compiled"), (("method.velocity_gain=600 V*s/m",), True, "do not settle")],
)
def test_what_is_not_watched_says_why(monkeypatch, overrides, compiled, why):
    monkeypatch.setattr(stand, "COMPILED", compiled)
    file = detent.load(CASCADE, overrides).file
    report = check_axis(file)
    row = report.derived[-1]
    assert (row.name, row.text) == ("standstill", "not watched")
    assert why in row.formula
    assert math.isnan(row.value)
    assert report.warnings == check_spec(file).warnings


@pytest.mark.parametrize("name", ["print_head", "phase_servo", "filtered_servo", "rotary_table", "stage"])
def test_other_methods_have_no_such_row(name):
    file = detent.load(EXAMPLES / f"{name}.toml").file
    assert check_axis(file) == check_spec(file)


@pytest.mark.parametrize(
    ("kind", "overrides", "remedy"),
    [
        ("gap crossing", ("method.feedback.position=load",), 'set method.feedback.position = "motor"'),
        ("gap crossing", (), "less play, or friction at the load"),
        ("beyond the margin", (), "choose other values with `detent tune`"),
    ],
)
def test_each_kind_of_hunting_has_a_remedy(kind, overrides, remedy):
    if overrides:
        overrides = (*overrides, "load_encoder.resolution=1 um")
    ensemble = METHODS["cascade"].standstill(detent.load(CASCADE, overrides).spec)
    assert ensemble.helps(kind) == remedy


def test_friction_that_is_stated_everywhere_leaves_nothing_to_assume():
    ensemble = METHODS["cascade"].standstill(detent.load(CASCADE, ALL).spec)
    assert ensemble.as_stated is None
    assert METHODS["rotary_table"].standstill(detent.load(EXAMPLES / "rotary_table.toml").spec).as_stated is None
    assert isinstance(ensemble.rule, Rule)
