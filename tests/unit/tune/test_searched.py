"""`detent tune` by simulation: candidates, the choice on all plants, what is written, shown and refused."""

import json

import pytest
from typer.testing import CliRunner

import detent
from detent.cli.app import app
from detent.errors import DetentError
from detent.methods.phase_servo import tuning
from detent.methods.phase_servo.tuning import KEY, PhaseSearch, three_moves
from detent.methods.tuning import Trial
from detent.tune import searched

PHASE = detent.example("phase_servo.toml")
UNSURE = '\n[tolerance]\n"mechanics.carriage_mass" = "10 %"\n'


def judged(self, spec, job):
    """Three of eight gains will do, the stiffer the better, a heavy carriage only with the softest."""
    del self, job
    k1, k2, _ = spec.method.position_gains
    if k2 == 1:
        return Trial("hard cycle of 54 steps while settling", figures={"swing": "54 steps"})
    if k1 > 3 or (k1 > 1 and spec.mechanics.carriage_mass > 0.61):
        return Trial("a move does not arrive", figures={"swing": "2 steps"})
    return Trial("", (10.0 - k1, 0.5), {"settling": f"{10 - k1} ms", "swing": "1 step"})


@pytest.fixture
def quick(monkeypatch):
    """Few candidates, judged without a simulation, and no standstill."""
    monkeypatch.setattr(PhaseSearch, "tried", judged)
    monkeypatch.setattr(tuning, "KP2", (1, 12))
    monkeypatch.setattr(searched, "standstill", lambda *_: type("Still", (), {"shares": {"hunts": 0.0}}))


def run(*words: str):
    return CliRunner().invoke(app, ["tune", *words])


@pytest.fixture
def file(tmp_path):
    made = tmp_path / "axis.toml"
    made.write_text(PHASE.read_text(encoding="utf-8"), encoding="utf-8")
    return made


@pytest.mark.usefixtures("quick")
def test_the_best_candidate_is_told_written_and_drawn(file):
    report = file.with_name("tuned.html")
    done = run(str(file), "--write", str(file), "--report", str(report), "--json")
    told = json.loads(done.stdout)
    assert (done.exit_code, told["values"], told["refusals"]) == (0, {KEY: [3, 12, 1]}, [])
    assert len(told["candidates"]) == 14
    assert told["before"]["refused"] == "a move does not arrive"
    assert [one["key"] for one in told["changes"]] == [KEY]
    assert detent.load(file).spec.method.position_gains == [3, 12, 1]
    assert "# tuned: best of 14 simulated candidates" in file.read_text(encoding="utf-8")
    page = report.read_text(encoding="utf-8")
    assert "hard cycle" in page
    assert "3 of them will do" in page
    assert '"search"' in page
    assert "2 steps before" in page
    screen = run(str(file)).output
    assert "hard cycle: 7, a move does not arrive: 4" in screen


@pytest.mark.usefixtures("quick")
def test_a_choice_must_do_on_every_plant(file):
    file.write_text(file.read_text(encoding="utf-8") + UNSURE, encoding="utf-8")
    found = detent.load(file).tune()
    assert found.values == {KEY: [1, 12, 1]}
    assert (found.done, found.plants) == (True, 2 + searched.HYPERCUBE)
    assert "on 10 plants of [tolerance]" in repr(found)


@pytest.mark.usefixtures("quick")
def test_what_fails_on_a_plant_is_for_the_nominal_axis_only(file, monkeypatch):
    monkeypatch.setattr(searched, "BEST", 2)
    file.write_text(file.read_text(encoding="utf-8") + UNSURE, encoding="utf-8")
    done = run(str(file))
    assert done.exit_code == 1
    assert "for the axis as its file states it only" in done.output
    assert "each of the best 2 fails on one of 11 plants" in done.output
    report = file.with_name("tuned.html")
    detent.load(file).tune().report(report)
    assert "For the nominal axis only" in report.read_text(encoding="utf-8")


@pytest.mark.usefixtures("quick")
def test_what_hunts_is_not_chosen(monkeypatch):
    monkeypatch.setattr(searched, "standstill", lambda *_: type("Hunting", (), {"shares": {"hunts": 0.5}}))
    assert not detent.load(PHASE).tune().done


@pytest.mark.usefixtures("quick")
def test_no_candidate_at_all(file, monkeypatch):
    monkeypatch.setattr(tuning, "KP2", (1,))
    report = file.with_name("none.html")
    found = detent.load(file).tune()
    assert (found.done, found.values, found.changes) == (False, {}, [])
    assert "none of 7 candidates will do" in found.sentence
    found.report(report)
    assert "No values" in report.read_text(encoding="utf-8")
    with pytest.raises(DetentError, match="got no gains"):
        found.save(file.with_name("new.toml"))


@pytest.mark.parametrize(
    ("asked", "told"),
    [({"ms": 1.5}, "got ms 1.5"), ({"overshoot": 1.2, "goal": "quick"}, "got overshoot 1.2, goal quick"),
     ({"hold": ["method.dead_band"]}, "method.position_gains"), ({"hold": [KEY]}, "the only key")],
)  # fmt: skip
def test_what_is_not_for_such_a_method_is_refused(asked, told, monkeypatch):
    monkeypatch.setattr(PhaseSearch, "tried", judged)
    with pytest.raises(DetentError, match=told):
        detent.load(PHASE).tune(**asked)


def test_candidates_fit_the_drive_word():
    found = PhaseSearch(detent.load(PHASE).spec)
    gains = [one[KEY] for one in found.candidates(())]
    # (N/4 + 1) KP1 = 17 KP1 is at most 127.
    assert (len(gains), gains[0], gains[-1]) == (7 * 64, [1, 1, 1], [7, 64, 1])
    assert found.place({KEY: [4, 16, 1]}) == (4.0, 16.0)
    spec = detent.load(PHASE, ["limits.travel=6 mm"]).spec
    assert max(abs(move.by) for move in three_moves(spec).moves) <= 0.4 * 6e-3


@pytest.mark.compiled
def test_too_little_push_back_and_early_arrival_are_refused(monkeypatch):
    spec = detent.load(PHASE).spec
    job, made = three_moves(spec), PhaseSearch(spec)
    assert made.tried(spec.varied({KEY: [7, 16, 1]}), job).refused == "it says that it has arrived before it has"
    assert made.tried(spec.varied({KEY: [4, 4, 1]}), job).refused == "a move does not arrive"
    monkeypatch.setattr(tuning, "SHARE", 0.9)
    assert made.tried(spec.varied({KEY: [1, 13, 1]}), job).refused.startswith("it does not come back after a push of")
