"""`detent export firmware` and `detent verify`: what they print, and their status."""

from functools import cache
from pathlib import Path

import pytest
from tests.unit.test_cli import call

import detent
from detent.export import measure, misra, teeth
from detent.export import verify as proving
from detent.export.write import read_manifest
from detent.methods.stepper_envelope.method import StepperEnvelopeMethod

pytestmark = pytest.mark.compiled
CASCADE, ZOOM = str(detent.example("cascade.toml")), str(detent.example("zoom.toml"))


@pytest.fixture(autouse=True)
def in_a_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def looked_at_once(monkeypatch):
    """The rules that the folder of a test breaks are looked at by the first command alone: it takes seconds."""
    monkeypatch.setattr(misra, "findings", cache(misra.findings))


def export(*more: object):
    return call(
        "export", "firmware", CASCADE, "--output", "out", "--ticks", "50", "--files", "1", "--rounds", "200", *more
    )


def test_an_export_says_what_it_wrote_and_what_comes_next():
    answer = export()
    assert answer.status == 0
    assert "golden run: one move" in answer.out or "50 ticks, hash " in answer.out
    assert "next: detent verify out" in answer.out
    assert Path("out/cascade_axis.c").exists()
    data = export("--prefix", "slide", "--json").data
    assert (data["name"], data["ticks"]) == ("slide", 50)
    assert Path("out/slide.c").exists()
    assert not Path("out/cascade_axis.c").exists()


def test_refusals_have_status_1_and_a_wrong_folder_2(monkeypatch):
    with monkeypatch.context() as without:
        without.setattr(StepperEnvelopeMethod, "actions", ())
        refused = call("export", "firmware", ZOOM, "--output", "out")
    assert (refused.status, "FW01" in refused.err, Path("out").exists()) == (1, True, False)
    unnamed = call("export", "firmware", ZOOM, "--output", "out")
    assert (unnamed.status, "one of group_a, group_b" in unnamed.err, Path("out").exists()) == (2, True, False)
    Path("out").mkdir()
    Path("out/mine").write_text("mine")
    answer = export()
    assert (answer.status, "FW14" in answer.err) == (2, True)
    assert call("verify", "out").status == 2


@pytest.mark.usefixtures("looked_at_once")
def test_verify_tells_each_target_and_what_is_not_installed(monkeypatch):
    export()
    gone = proving.Target("gone", "no-such-gcc", "gcc-gone")
    for module in (proving, measure):
        monkeypatch.setattr(module, "TARGETS", {"gone": gone})
    answer = call("verify", "out")
    assert answer.status == 1
    assert "gone        not run: needs no-such-gcc (Debian: apt install gcc-gone)" in answer.out
    assert call("verify", "out", "--on", "gone").status == 1
    data = call("verify", "out", "--json").data
    nothing = {"equal": False, "proofs": [], "differences": [], "not run": {"gone": gone.missing}}
    absent = {misra.TOOL: misra.missing()} if misra.missing() else {}
    rules = data.pop("misra")
    assert data == nothing | {"not run": nothing["not run"] | absent, "measured": {}, "reach": None, "mutants": []}
    assert (rules == {}) if absent else (rules["2.5"] == 3 and rules.keys() <= misra.DEVIATIONS.keys())


def test_verify_counts_rules_and_fails_where_one_is_not_to_be_broken(monkeypatch):
    export()
    broken = [misra.Finding("cascade_axis.c", 7, rule) for rule in ("15.5", "10.4", "15.5")]
    monkeypatch.setattr(misra, "missing", str)
    monkeypatch.setattr(misra, "findings", lambda *_: broken)
    told = {"host-gcc": proving.TARGETS["host-gcc"]}
    for module in (proving, measure):
        monkeypatch.setattr(module, "TARGETS", told)
    monkeypatch.setattr(proving, "_replayed", lambda *given: proving.Proof(given[2].name, given[3], True, "1"))
    answer = call("verify", "out")
    assert answer.status == 1
    assert "cascade_axis.c:7 breaks rule 10.4 of MISRA C:2012" in answer.out
    assert f"rule 15.5: 2 times; {misra.DEVIATIONS['15.5']}" in answer.out.replace("\n", " ")
    assert read_manifest(Path("out"))["report"]["misra"] == {"10.4": 1, "15.5": 2}
    del broken[1]
    assert call("verify", "out").status == 0
    assert read_manifest(Path("out"))["report"]["misra"] == {"15.5": 2}


@pytest.mark.process
@pytest.mark.usefixtures("looked_at_once")
def test_verify_replays_here_and_compares_with_the_axis(monkeypatch):
    export()
    same = call("verify", "out", "--on", "host-gcc", "--against", CASCADE)
    assert same.status == 0, same.out + same.err
    assert "host-gcc    -Os  equal, hash " in same.out
    replayed = [proving.Proof("host-gcc", "-Os", equal=True, told=read_manifest(Path("out"))["hash"])]
    monkeypatch.setattr(proving, "verify", lambda *_: replayed)  # the same folder: it has just been
    other = call("verify", "out", "--on", "host-gcc", "--against", CASCADE, "--set", "method.position_gain=41")
    assert other.status == 1
    assert "cascade_axis_params.c is another file" in other.out + other.err


@pytest.mark.parametrize("missed", [0, 3])
def test_verify_tells_what_the_vectors_miss_and_fails_below_the_bar(monkeypatch, missed):
    export()
    fine = proving.Proof("host-gcc", "-Os", equal=True, told="77")
    outcomes = tuple(teeth.Outcome(5, "if (a < b) {", way) for way in range(missed))
    made = [teeth.Mutant(9, "a + b", "-", ""), teeth.Mutant(9, "a < b", "<=", "job")]
    monkeypatch.setattr(proving, "verify", lambda *_: [fine])
    monkeypatch.setattr(misra, "findings", lambda *_: [])  # and what the units take is looked at elsewhere
    monkeypatch.setattr(measure, "TARGETS", {})
    monkeypatch.setattr(teeth, "reach", lambda _: teeth.Reach(20, outcomes, 30, ()))
    monkeypatch.setattr(teeth, "mutants", lambda *_: made)
    answer = call("verify", "out", "--coverage-bar", "90", "--mutants", "2")
    assert answer.status == (1 if missed else 0)
    told = answer.out + answer.err
    assert f"{100 - 5 * missed:.1f} % of 20" in told
    assert told.count("never taken: if (a < b) {") == missed
    assert "mutants found: 1 of 2" in told
    assert "line 9, - not found: a + b" in told
    data = call("verify", "out", "--coverage-bar", "90", "--mutants", "2", "--json").data
    assert data["reach"]["share"] == 100 - 5 * missed
    assert [one["found"] for one in data["mutants"]] == ["", "job"]
