"""`detent tune` as a command and in Python: what it says, writes and refuses."""

import json
from dataclasses import replace
from pathlib import Path

import pytest
from tests.acceptance.test_golden_bits import EXAMPLES
from tests.cascade_rig import by_hand
from typer.testing import CliRunner

import detent
from detent.cli.app import app
from detent.errors import DetentError
from detent.methods.cascade.loop import LinearLoop
from detent.methods.cascade.tuning import CascadeTuning
from detent.methods.tuning import Bounds
from detent.tune.choice import Chooser, Guaranteed
from detent.tune.plants import Plants
from detent.tune.tuned import _refusals

pytestmark = pytest.mark.early
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
    for chart in ("gain-command", "phase-velocity", "sensitivity-command", "nyquist-velocity", "trade", "response-0",
                  "response-1", "followed"):  # fmt: skip
        assert f'"{chart}"' in page
    for text in ("least of all plants", "95 % of machines", "What would allow more"):
        assert text in page
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
    assert (
        told.limited
        == {
            "rotary_table": "with more gain a stop from 60 deg/s passes its target by more than the window, 2 counts",
            "filtered_servo": "the damping of its swing is 0.501",
        }[name]
    )
    assert "The loops" in told.report(tmp_path / "tuned.html").read_text(encoding="utf-8")
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
    axis = detent.load(CASCADE, sticky)
    told = axis.tune()
    assert told.done
    assert told.hunted is not None
    assert told.hunted.swing > 1e-6
    band, integral = told.cures  # that with the smaller rest error first, and it is chosen
    assert (band.key, integral.key) == ("method.dead_band", "method.velocity_integral")
    assert band.rest_error < integral.rest_error
    assert told.values["method.dead_band"] == band.value == axis.replace(told.values).spec.method.dead_band
    assert told.values["method.velocity_integral"] == 5750.0
    assert told.after is not None
    assert told.after.stood is not None
    assert not told.after.stood.hunts
    assert {name: text for name, _, text in told.rows}["standstill"].startswith("rests from ")
    last = told.why[-2:]
    assert "a dead band, method.dead_band" in last[0]
    assert "or no integral" in last[0]
    assert "of 16 that may be, it " in last[1]
    assert "does not state" in last[1]  # of the load, whose static friction is a default
    assert len(told.table.rows) == 4
    assert len(told.to_dict()["assumed"]) == 16
    assert told.to_dict()["cures"][0] == {
        "key": band.key, "value": band.value, "name": "a dead band", "rest_error": band.rest_error
    }  # fmt: skip


@pytest.mark.compiled
def test_a_dead_band_that_is_held_leaves_the_integral_and_both_held_leave_the_hunting():
    sticky = [f"mechanics.friction.{way}.{one}" for way in ("positive", "negative")
              for one in ("static=60 N", "stribeck=0 mm/s")]  # fmt: skip
    axis = detent.load(CASCADE, sticky)
    less = axis.tune(hold=["method.dead_band"])
    assert [one.key for one in less.cures] == ["method.velocity_integral"]
    assert less.values["method.velocity_integral"] < 5750.0
    assert less.after is not None
    assert less.after.stood is not None
    assert not less.after.stood.hunts
    hunts = axis.tune(hold=["method.dead_band", "method.velocity_integral"])
    assert not hunts.cures
    assert hunts.hunted is not None
    assert any("Neither a dead band" in one for one in hunts.why)


@pytest.mark.compiled
def test_what_limits_an_axis_is_said_and_what_it_would_take_to_go_further():
    told = detent.load(CASCADE).tune()
    assert told.limited.startswith("Ms at the command is 1.7 at 335 Hz, near the resonance of the coupling (31")
    assert told.what_limits[0] in told.why
    further = dict(told.further)
    sooner = detent.load(CASCADE, ["drive.delay=0"]).tune(hold=[])
    assert further["an amplifier that is a sample sooner"] == pytest.approx(sooner.worth[1] / told.worth[1], rel=1e-9)
    looser = next(times for text, times in further.items() if text.startswith("Ms 2, a gain margin of 2"))
    assert looser == pytest.approx(1.196e6 / 5.224e5, rel=0.04)  # both optima of acceptance test 7
    assert told.further[0][1] == max(further.values())


def test_what_is_too_slow_for_all_plants_is_refused():
    """A velocity loop with less than half of its bandwidth, with more than a tenth of the stiffness."""
    axis = detent.load(CASCADE)
    chooser = Chooser(CascadeTuning(axis.spec), Plants(axis.spec, {}), Bounds())
    values = CascadeTuning(axis.spec).stated
    keys = ("method.velocity_gain", "method.velocity_integral")
    slow = values | {key: share * values[key] for key, share in zip(keys, (0.25, 0.12), strict=True)}
    assert list(_refusals(chooser, Guaranteed(values), Guaranteed(values), [])) == []
    (refusal,) = _refusals(chooser, Guaranteed(values), Guaranteed(slow), [])
    assert refusal.value.startswith("the bandwidth of the velocity loop for all plants")
    assert refusal.limit == "at least 50 %"


def test_the_guarantee_of_a_pid_holds_for_plants_that_the_choice_has_not_seen(tmp_path):
    file = tmp_path / "pid.toml"
    file.write_text(CASCADE.read_text(encoding="utf-8") + TOLERANCE, encoding="utf-8")
    pid = ["method.structure=pid", "method.proportional=9 kV/m", "method.integral=200 kV/(m*s)",
           "method.derivative=100 V*s/m"]  # fmt: skip
    axis = detent.load(file, pid)
    chooser = Chooser(CascadeTuning(axis.spec), Plants(axis.spec, axis.file.tolerance), Bounds())
    nominal, found = chooser.nominal(), chooser.guaranteed(fresh=200)
    plants = [*chooser.plants.ends("mechanics.load_mass"), *chooser.plants.random(20, ["mechanics.load_mass"], 9)]

    def worst(values) -> float:
        """Largest Ms over the plants, of the loop as matrices."""
        loops = [LinearLoop(one.spec.varied(values)).open_loop("command") for one in plants]
        return max(replace(one, quick=None).margins().sensitivity for one in loops)

    assert worst(found.values) <= 1.7 * 1.005
    assert worst(nominal.values) > 1.7 * 1.01
    assert chooser.worth(found) < 0.95 * chooser.worth(nominal)


@pytest.mark.compiled
def test_a_share_of_feedforward_is_written_with_its_reason_and_may_be_held(tmp_path):
    key, file = "method.feed_forward.viscous", tmp_path / "slide.toml"
    file.write_text(CASCADE.read_text(encoding="utf-8").replace("viscous = 1", "viscous = 0.5"), encoding="utf-8")
    told = detent.load(file).tune()
    assert told.values[key] == 1.0
    text = told.save(tmp_path / "new.toml").read_text(encoding="utf-8")
    assert "viscous = 1  # tuned, 0.5 before: viscous friction or back-EMF is stated" in text
    assert key not in detent.load(file).tune(hold=[key]).values
