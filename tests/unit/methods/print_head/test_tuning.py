"""What `tune` tries of a print head: pairs of drive counts and speed, each printed."""

import pytest

import detent
from detent.files.quantities import INCH
from detent.methods.print_head import tuning
from detent.methods.print_head.tuning import COUNTS, SPEED, HeadSearch
from detent.methods.registry import METHODS

HEAD = detent.example("print_head.toml")


def test_candidates_hold_the_file_and_the_limit():
    spec = detent.load(HEAD, ["limits.speed=32 in/s", "method.ir_counts=90"]).spec
    made = HeadSearch(spec)
    found = made.candidates(())
    assert sorted({round(one[SPEED] / INCH, 6) for one in found}) == [15.0, 20.0, 25.0, 30.0, 32.0]
    assert sorted({one[COUNTS] for one in found}) == sorted([*range(48, 193, 8), 90])
    assert {one[COUNTS] for one in made.candidates((COUNTS,))} == {90}
    assert [one[SPEED] for one in made.candidates((SPEED, COUNTS))] == pytest.approx([32 * INCH])
    assert made.place({COUNTS: 96, SPEED: 0.762}) == (30.0, 96.0)


@pytest.mark.compiled
def test_a_pair_is_printed_and_judged():
    spec = detent.load(HEAD).spec
    made, job = METHODS["print_head"].search(spec), METHODS["print_head"].trial_job(spec)
    usual = made.tried(spec, job)
    assert usual.refused == ""
    assert usual.rank[0] == pytest.approx(1.18, rel=0.05)
    assert usual.rank[1] < 10e-6

    def why(**changes):
        return made.tried(spec.changed(method=changes), job).refused

    # The ramp is made for 600 in/s^2, which 96 counts give: less is late, more is early.
    assert why(ir_counts=32) == "a dot is more than half an emitter off"
    assert why(ir_counts=128) == "a line takes a second run"
    # At half of the top speed the same counts are enough: what slows it down is the speed.
    slow = made.tried(spec.changed(method={"max_print_speed": 20 * INCH}), job)
    assert slow.rank > usual.rank
    assert why(ir_counts=72).startswith("a caution of ")
    blocked = detent.load(HEAD, ["disturbance.obstacle.position=8 in"]).spec
    assert made.tried(blocked, job).refused == "the job is not printed"


@pytest.mark.compiled
def test_tune_takes_the_quickest_that_prints_well(monkeypatch):
    monkeypatch.setattr(tuning, "TRIED_COUNTS", (64, 128))
    monkeypatch.setattr(tuning, "STEP", 12.5 * INCH)
    found = detent.load(HEAD).tune()
    assert found.done
    good = {found.search.place(one.values): one.trial.rank for one in found.candidates if not one.trial.refused}
    assert min(good.values()) == found.after.rank
    assert found.search.place(found.values)[1] == 96.0
    assert found.after.rank <= found.before.rank
