"""`detent hunt` of the methods whose starts are moves and stops of their own hosts."""

import json

import pytest
from typer.testing import CliRunner

import detent
from detent.cli.app import app
from detent.errors import DetentError

FREE = [f"mechanics.friction.{side}.{kind}=0 N" for side in ("right", "left") for kind in ("coulomb", "static")]
NOISY = ["detector.fine.noise=0.2 deg"]


def run(name: str, overrides: list[str], *words: str):
    sets = [word for one in overrides for word in ("--set", one)]
    return CliRunner().invoke(app, ["hunt", str(detent.example(name)), *sets, *words])


@pytest.mark.compiled
def test_a_phase_servo_rests_at_stop_and_swings_before_it(tmp_path):
    report = tmp_path / "phase.html"
    done = run("phase_servo.toml", [], "--json", "--report", str(report))
    told = json.loads(done.stdout)
    assert (done.exit_code, told["outcome"], told["rule"], told["cured_on_counts"]) == (0, "rests", None, None)
    assert told["earlier"]["outcome"] == "hunts"
    assert [one["name"] for one in told["earlier"]["kinds"]] == ["count edge"]
    assert "until stop 20 ms after the change of mode, it swings as long as it lasts" in told["told"][0]
    assert "command [count]" in report.read_text(encoding="utf-8")
    screen = run("phase_servo.toml", [])
    assert "it rests up to" in screen.output


@pytest.mark.compiled
def test_a_phase_servo_that_never_stops_hunts_for_good():
    done = run("phase_servo.toml", ["method.stop_always_off=true"], "--json")
    told = json.loads(done.stdout)
    assert (done.exit_code, told["outcome"], told["earlier"]) == (1, "hunts", None)
    hard = json.loads(run("phase_servo.toml", ["method.stop_always_off=true", "method.position_gains=[4,1,1]"],
                          "--json").stdout)  # fmt: skip
    assert [one["name"] for one in hard["kinds"]] == ["beyond the margin"]


@pytest.mark.compiled
def test_a_filtered_servo_without_friction_hunts_across_a_count(tmp_path):
    report = tmp_path / "filtered.html"
    done = run("filtered_servo.toml", FREE, "--report", str(report))
    assert done.exit_code == 1
    assert "hunts from all 8 starts: count edge, by 5" in done.output
    assert "swing" in done.output.split("starts")[-2]
    assert "by itself" not in done.output
    assert '"load"' not in report.read_text(encoding="utf-8")


@pytest.mark.compiled
def test_a_filtered_servo_beyond_its_margin_is_told_so_or_switched_off():
    loose = [*FREE, "drive.current_per_count=95 mA", "protection.saturation_time=0 s"]
    told = json.loads(run("filtered_servo.toml", loose, "--json").stdout)
    assert {one["name"] for one in told["kinds"]} == {"beyond the margin"}


@pytest.mark.compiled
def test_a_rotary_table_is_stopped_with_and_without_noise():
    quiet = json.loads(run("rotary_table.toml", [], "--json").stdout)
    assert quiet["outcome"] == "rests"
    assert any("no noise of the resolvers" in one for one in quiet["told"])
    told = json.loads(run("rotary_table.toml", NOISY, "--json").stdout)
    assert told["shares"] == {"rests": 0.5, "stands open": 0.0, "flickers": 0.0, "hunts": 0.5}
    assert told["kinds"][0]["of"] == ["stop with noise"]
    beyond = json.loads(run("rotary_table.toml", ["method.position_gain=700"], "--json").stdout)
    assert {one["name"] for one in beyond["kinds"]} == {"beyond the margin"}


@pytest.mark.parametrize(
    ("words", "told"),
    [(["--on-counts"], "always lie on counts"), (["--starts", "7"], "at least 8, moves to places"),
     (["--dead-band"], "no dead band of its integral"), (["--map"], "leave dead_band and map out")],
)  # fmt: skip
def test_what_such_a_method_has_not_is_refused(words, told):
    done = run("phase_servo.toml", [], *words, "--json")
    assert done.exit_code == 2
    assert told in json.loads(done.stdout)["error"]


@pytest.mark.parametrize(("name", "held"), [("print_head.toml", "friction holds"), ("stage.toml", "windings")])
def test_what_closes_no_loop_at_rest_says_what_holds_it(name, held):
    with pytest.raises(DetentError, match=rf"closes no loop at rest: .*{held}"):
        detent.load(detent.example(name)).hunt()
