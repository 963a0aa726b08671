"""`detent tune` as a command and in Python: what it says, writes and refuses."""

import json
from pathlib import Path

import pytest
from tests.acceptance.test_golden_bits import EXAMPLES
from tests.cascade_rig import by_hand
from typer.testing import CliRunner

import detent
from detent.cli.app import app
from detent.errors import DetentError

CASCADE = EXAMPLES / "cascade.toml"
TOLERANCE = '\n[tolerance]\n"mechanics.load_mass" = "10 %"\n'


def run(*words: str):
    return CliRunner().invoke(app, ["tune", *words])


@pytest.fixture
def file(tmp_path: Path) -> Path:
    made = tmp_path / "slide.toml"
    made.write_text(by_hand(CASCADE.read_text(encoding="utf-8")) + TOLERANCE, encoding="utf-8")
    return made


@pytest.mark.compiled
def test_the_command_writes_gains_and_report(file):
    report, before = file.with_name("tuned.html"), file.read_text(encoding="utf-8")
    done = run(str(file), "--write", str(file), "--report", str(report), "--json")
    assert done.exit_code == 0
    told = json.loads(done.stdout)
    assert told["worth"]["before"] < told["worth"]["guaranteed"] < told["worth"]["nominal"]
    assert [one["key"] for one in told["changes"]] == list(told["values"])
    assert told["files"] == [str(file), str(report)]
    assert told["worst"] <= 1.005
    assert told["fresh"] == 2000
    assert before != file.read_text(encoding="utf-8")
    page = report.read_text(encoding="utf-8")
    assert "guaranteed over [tolerance] (1 keys)" in page
    for chart in ("sensitivity-command", "nyquist-velocity", "trade"):
        assert f'"{chart}"' in page
    again = json.loads(run(str(file), "--json").stdout)
    assert again["values"] == told["values"]


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--ms", "3"], "1.2 to 2.5"),
        (["--overshoot", "0.5"], "1 to 2"),
        (["--for", "stif"], "stiff"),
        (["--hold", "method.velocity_gian"], "method.velocity_gain"),
    ],
)
def test_what_is_out_of_range_is_refused(words, told):
    done = run(str(CASCADE), *words, "--json")
    assert done.exit_code == 2
    assert told in json.loads(done.stdout)["error"]


@pytest.mark.parametrize("name", ["zoom", "stage"])
def test_a_method_without_linear_gains_says_so(name):
    done = run(str(EXAMPLES / f"{name}.toml"), "--json")
    assert done.exit_code == 2
    assert "no linear model" in json.loads(done.stdout)["error"]


@pytest.mark.compiled
def test_the_command_tells_gains_and_what_it_has_written(tmp_path):
    written = tmp_path / "new.toml"
    done = run(str(EXAMPLES / "rotary_table.toml"), "--write", str(written))
    assert done.exit_code == 0
    assert f"written: {written}" in done.stdout
    assert "method.position_gain" in done.stdout
    again = run(str(written))
    assert again.exit_code == 0
    assert "written" not in again.stdout


def test_the_command_tells_why_no_gains_do():
    done = run(str(CASCADE), "--set", "drive.delay=60", "--hold", "method.velocity_gain")
    assert done.exit_code == 1
    assert "no gains keep Ms 1.7" in done.stdout
    assert "dead time" in done.output


def test_an_axis_that_nothing_makes_settle_is_refused():
    """A dead time of 60 samples on a velocity loop that is held."""
    told = detent.load(CASCADE, ["drive.delay=60"]).tune(hold=["method.velocity_gain"])
    assert not told.done
    assert told.values == {}
    assert told.sentence == "cascade axis: no gains keep Ms 1.7."
    assert "dead time" in told.refusals[0].remedy
    assert "no gains keep" in repr(told)
    with pytest.raises(DetentError, match="no gains"):
        told.save("nothing.toml")


@pytest.mark.compiled
@pytest.mark.parametrize(
    ("name", "keys"),
    [("rotary_table", ["method.position_gain"]),
     ("filtered_servo", ["method.sample_period", "method.scale", "method.coefficient"])],
)  # fmt: skip
def test_other_methods_are_tuned_and_tried(name, keys, tmp_path):
    axis = detent.load(EXAMPLES / f"{name}.toml")
    told = axis.tune()
    assert told.done
    assert list(told.values) == keys
    assert told.after is not None
    assert told.after.result.done
    assert detent.load(told.save(tmp_path / "new.toml")).tune().values == told.values


@pytest.mark.compiled
def test_a_whole_number_stays_one():
    axis = detent.load(EXAMPLES / "filtered_servo.toml", ["method.scale=8", "method.sample_period=2.5 ms"])
    told = axis.tune()
    assert told.typed["method.scale"] == 4
    assert isinstance(told.typed["method.scale"], int)


@pytest.mark.compiled
def test_gains_for_a_plant_that_nobody_knows_are_refused(tmp_path):
    made = tmp_path / "slide.toml"
    made.write_text(f'{CASCADE.read_text()}\n[tolerance]\n"mechanics.load_mass" = "not trusted"\n')
    told = detent.load(made).tune()
    assert not told.done
    assert told.values
    assert told.refusals[0].value == "mechanics.load_mass not trusted"
    assert "identify --job" in told.refusals[0].remedy


@pytest.mark.compiled
def test_a_job_that_leaves_no_reserve_is_refused_with_what_helps():
    """The axis accelerates at more than its drive has, and stands at its limit meanwhile."""
    told = detent.load(CASCADE, ["limits.acceleration=12 m/s^2", "limits.jerk=3000 m/s^3"]).tune()
    assert not told.done
    assert told.values
    assert told.sentence.endswith("the job is not done with a reserve.")
    (refusal,) = told.refusals
    assert "limits.acceleration" in refusal.remedy
    assert told.after is not None
    assert not told.after.result.done or told.after.result.limited_share > 0.05


@pytest.mark.compiled
def test_gains_that_hunt_are_told_so_with_what_stops_it_and_what_it_depends_on():
    sticky = [f"mechanics.friction.{way}.static=60 N" for way in ("positive", "negative")]
    sticky += [f"mechanics.friction.{way}.stribeck=0 mm/s" for way in ("positive", "negative")]
    told = detent.load(CASCADE, sticky).tune()
    assert told.done
    assert told.after is not None
    assert told.after.stood is not None
    assert told.after.stood.hunts
    assert told.to_dict()["after"]["standstill"]["swing"] == told.after.stood.swing > 1e-6
    last = told.why[-2:]
    assert "dead band" in last[0]
    assert "`detent hunt` has a table" in last[1]
    assert "does not state" in last[1]  # of the load, whose static friction is a default
    assert {name: text for name, _, text in told.rows}["standstill"].startswith("hunts from ")


@pytest.mark.compiled
def test_a_share_of_feedforward_is_written_with_its_reason_and_may_be_held(tmp_path):
    key, file = "method.feed_forward.viscous", tmp_path / "slide.toml"
    file.write_text(CASCADE.read_text(encoding="utf-8").replace("viscous = 1", "viscous = 0.5"), encoding="utf-8")
    told = detent.load(file).tune()
    assert told.values[key] == 1.0
    text = told.save(tmp_path / "new.toml").read_text(encoding="utf-8")
    assert "viscous = 1  # tuned, 0.5 before: viscous friction or back-EMF is stated" in text
    assert key not in detent.load(file).tune(hold=[key]).values
