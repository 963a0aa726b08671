"""`detent hunt` as a command and in Python: what it says, writes, draws and refuses."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from tests.acceptance.test_golden_bits import EXAMPLES
from tests.standstill_rig import RIGID, axis, both, example, rigid
from typer.testing import CliRunner

import detent
from detent.cli.app import app
from detent.errors import DetentError
from detent.methods.cascade.standstill import CascadeEnsemble
from detent.methods.tuning import Swing
from detent.tune import dead_band, hunted, standstill

STICKS = [*both(coulomb="20 N", static="30 N", stribeck="0 m/s"), "drive.command_step=0 V", "encoder.resolution=0.1 um"]


def run(*words: str):
    return CliRunner().invoke(app, ["hunt", *words])


@pytest.fixture
def file(tmp_path: Path) -> Path:
    made = tmp_path / "slide.toml"
    made.write_text(RIGID, encoding="utf-8")
    return made


@pytest.fixture
def quick(monkeypatch):
    """Fewer seeds, widths and starts, and less time."""
    monkeypatch.setattr(dead_band, "SEEDS", 1)
    monkeypatch.setattr(dead_band, "WIDTHS", np.array([0.0, 1.0]))
    monkeypatch.setattr(dead_band, "INTEGRALS", (0.0, 1.0, 2.0))
    monkeypatch.setattr(dead_band, "MAP_STARTS", 2)
    monkeypatch.setattr(hunted, "TABLE_STARTS", 1)
    monkeypatch.setattr(CascadeEnsemble, "fewest", 3)
    monkeypatch.setattr(
        standstill.standstill, "__kwdefaults__", standstill.standstill.__kwdefaults__ | {"longest": 4.0}
    )


@pytest.mark.compiled
@pytest.mark.usefixtures("quick")
def test_the_command_says_how_far_writes_the_dead_band_and_draws(file):
    report, words = file.with_name("hunted.html"), [word for one in STICKS for word in ("--set", one)]
    done = run(str(file), *words, "--starts", "3", "--map", "--write", str(file), "--report", str(report), "--json")
    assert done.exit_code == 1
    told = json.loads(done.stdout)
    assert told["outcome"] == "hunts"
    assert told["shares"]["hunts"] == 1.0
    assert told["kinds"][0]["name"] == "stick-slip"
    assert told["kinds"][0]["motor"] == pytest.approx(6.15e-6, rel=5e-2)
    assert told["rule"]["swing"] == pytest.approx(6.3e-6, rel=1e-2)
    assert told["cured_on_counts"] is False
    width = told["dead_band"]["width"]
    assert 1e-7 < width < 5e-6
    assert [one["key"] for one in told["changes"]] == ["method.dead_band"]
    assert told["files"] == [str(file), str(report)]
    again = detent.load(file)
    assert again.spec.method.dead_band == pytest.approx(width, rel=1e-5)
    line = next(one for one in file.read_text(encoding="utf-8").splitlines() if one.startswith("dead_band"))
    assert re.fullmatch(r'dead_band = "[0-9.]+ [nu]m" +# tuned: stops hunting by 6\.\d+ um', line)
    page = report.read_text(encoding="utf-8")
    for chart in ("worst-position", "worst-command", "cobweb", "band-over-integral"):
        assert f'"{chart}"' in page
    assert len(told["map"]["swing"]) == 3
    assert told["map"]["swing"][1][0] > 0.0 == told["map"]["swing"][1][1] == told["map"]["swing"][0][0]
    stopped = again.hunt(starts=3)
    assert (stopped.done, stopped.standing.hunts) == (True, False)


@pytest.mark.compiled
@pytest.mark.usefixtures("quick")
def test_the_command_tells_in_words(file):
    done = run(str(file), *[word for one in STICKS for word in ("--set", one)], "--starts", "3", "--dead-band")
    assert done.exit_code == 1
    for text in (
        "hunts from all 3 starts: stick-slip, by 6.", "it hunts by itself", "rule of thumb: 6.32 um every 900 ms",
        "simulated by 6.", "do not stop it", "a dead band of", "--write FILE",
    ):  # fmt: skip
        assert text in done.output


@pytest.mark.compiled
@pytest.mark.usefixtures("quick")
def test_what_rests_says_so_with_status_0(file):
    still = [word for one in [*STICKS, "method.velocity_integral=0 V/m"] for word in ("--set", one)]
    report = file.with_name("rests.html")
    done = run(str(file), *still, "--starts", "3", "--dead-band", "--write", str(file), "--report", str(report))
    assert done.exit_code == 0
    assert "rests from every one of 3 starts" in done.output
    assert "no stick-slip, for nothing integrates" in done.output
    assert file.read_text(encoding="utf-8") == RIGID
    assert '"cobweb"' not in report.read_text(encoding="utf-8")


@pytest.mark.compiled
@pytest.mark.usefixtures("quick")
def test_where_the_file_does_not_say_there_is_a_table():
    text = re.sub("(?m)^(static|stribeck) = .*\n", "", RIGID)
    made = both(coulomb="20 N")
    found = detent.load(_tables(text, made)).hunt(starts=3)
    assert len(found.assumed) == 16
    assert [row[0] for row in found.table.rows] == ["1", "1.15", "1.5", "2"]
    assert found.table.rows[3][1].startswith("hunts")
    assert any("of 16 that may be" in one for one in found.told)
    assert "static / Coulomb" not in repr(found)
    assert "stick-slip" in repr(found)


def _tables(text: str, overrides: list[str]):
    import tomllib

    tables = tomllib.loads(text)
    for one in overrides:
        path, _, value = one.partition("=")
        at = tables
        *outer, last = path.split(".")
        for part in outer:
            at = at.setdefault(part, {})
        at[last] = value
    return tables


@pytest.mark.compiled
@pytest.mark.usefixtures("quick")
def test_no_dead_band_stops_a_gap_without_friction():
    free = [*both(coulomb="0 N", static="0 N"), *both("load_friction", coulomb="0 N", static="0 N")]
    on_load = ["method.feedback.position=load", "load_encoder.resolution=1 um", "mechanics.coupling.backlash=40 um"]
    found = example(*free, *on_load).hunt(starts=3, dead_band=True)
    assert found.band is not None
    assert found.band.width is None
    assert any("no dead band up to" in one for one in found.told)
    assert "gap crossing, the load by" in found.sentence
    assert found.slips is None
    with pytest.raises(DetentError, match="no dead band"):
        found.save("nothing.toml")


def test_the_map_of_slips_goes_back_by_the_swing():
    found = rigid(30, 0).hunt(starts=12)
    assert found.slips is not None
    errors, behind = found.slips
    near = np.abs(np.abs(errors) - 3e-6) < 1e-6
    assert np.abs(errors - behind)[near] == pytest.approx(6.15e-6, rel=5e-2)
    assert np.all(errors[near] * behind[near] < 0.0)


@pytest.mark.parametrize(
    ("words", "told"), [(["--starts", "5"], "at least 12"), (["--write", "x.csv"], ".toml"), (["--seed", "-1"], "seed")]
)
def test_what_is_out_of_range_is_refused(words, told):
    done = run(str(EXAMPLES / "cascade.toml"), *words, "--json")
    assert done.exit_code == 2
    assert told in json.loads(done.stdout)["error"]


def test_a_method_that_is_not_watched_says_so():
    done = run(str(EXAMPLES / "print_head.toml"), "--json")
    assert done.exit_code == 2
    assert "closes no loop at rest" in json.loads(done.stdout)["error"]


@pytest.mark.parametrize("words", [{"dead_band": True}, {"map_it": True}])
def test_a_method_without_a_dead_band_says_so(words, monkeypatch):
    monkeypatch.setattr(CascadeEnsemble, "band", "")
    with pytest.raises(DetentError, match="no dead band of its integral"):
        rigid(30, 0).hunt(**words)


def test_a_flicker_is_told_with_the_command_it_costs_and_closed_forms_beside_it():
    def stood(start: str):
        swing = Swing(motor=1.5e-6, load=1.5e-6, period=4e-3, command=4.5, held=0.0, limited=0.0)
        told = {"proven": True, "error": 0.0, "moved": True, "simulated": 1.0, "leapt": 0.0}
        return standstill.Stood(start=start, outcome="flickers", swing=swing, **told)

    free = [*both(coulomb="0 N", static="0 N"), "drive.command_step=0 V", "method.velocity_integral=0 V/m"]
    made = axis(RIGID, [*free, "encoder.resolution=10 um"])
    standing = standstill.Standstill(CascadeEnsemble(made.spec), [stood("small"), stood("wide")])
    found = hunted.Hunted(made.file, standing, None, None, None, None, [])
    flicker, edge = found.told[1:]
    assert flicker == "flicker: count edge, by 1.5 um at 250 Hz (2 of 2 starts); its command goes to and fro by 4.5 V"
    assert edge == (
        "count edge by Tsypkin's method: 1.57 um at 333 Hz, the command by 4.53 V; simulated by 1.5 um at 250 Hz"
    )
    assert found.to_dict()["forecasts"][0]["kind"] == "count edge"
    alone = hunted.Hunted(made.file, standstill.Standstill(standing.ensemble, []), None, None, None, None, [])
    assert alone.told[-1].endswith("the simulation does not")
