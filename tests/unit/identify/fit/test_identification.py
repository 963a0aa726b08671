"""The whole way from logs to constants with limits, and a verdict."""

import json
from dataclasses import replace

import numpy as np
import pytest
from tests.identify_rig import SYMMETRIC, TRUTH, Recorder, changed, make_log
from tests.trust.judge import write_csv
from tests.trust.plants import make_case

from detent.errors import InputError
from detent.identify.fit.constants import Constants, reaching
from detent.identify.fit.estimate import quantile
from detent.identify.fit.free_run import simulate_horizons
from detent.identify.fit.identification import Identification, identify
from detent.identify.fit.ladder import RUNGS
from detent.identify.fit.verdict import Refusal
from detent.logs.read_log import read_log

pytestmark = pytest.mark.compiled

RECORDER = Recorder(seconds=8.0, delay=0.004, force_noise=0.1, count=2e-6)


@pytest.fixture(scope="module")
def told():
    return []


@pytest.fixture(scope="module")
def found(told):
    return identify([RECORDER.log()], report=lambda what, share: told.append((what, share)))


def values_of(found):
    return {e.name: e.value for e in found.estimates}


def test_a_good_log_is_trusted_with_constants_near_the_truth(found):
    assert found.verdict == "trusted"
    assert found.refusals == ()
    assert found.trusted == found.estimates
    assert found.rung.name == "per direction"
    values = values_of(found)
    assert values.pop("delay") == pytest.approx(0.004, abs=1e-3)
    assert values == pytest.approx(TRUTH, rel=0.02)
    assert all(0 < e.error < 0.01 * e.value for e in found.estimates if e.name != "delay")
    assert {e.method for e in found.estimates} == {"instrumental variables"}


def test_the_simulation_of_what_was_not_seen_is_close(found):
    assert [h.name for h in found.horizons][:3] == ["0.1 s", "0.5 s", "1 s"]
    assert found.horizons[-1].name == "free run"
    assert found.horizons[-1].duration == pytest.approx(2.0, abs=0.02)  # the last quarter
    assert all(h.rms < 0.05 * h.naive for h in found.horizons if h.name != "one step")


def test_the_constants_that_were_simulated_saw_the_first_part_only(found):
    run = found.runs[0]
    assert found.seen.value("mass") == pytest.approx(2.0, rel=0.01)
    assert found.seen.value("mass") != found.constants.value("mass")
    ours = simulate_horizons(found.seen, [run.part(round(0.75 * len(run.position)), len(run.position))])
    assert ours[-1].rms == pytest.approx(found.horizons[-1].rms)


def test_what_was_chosen_is_said(found):
    effort, windows, how = found.notes
    assert effort == "effort: force [N]"
    assert windows.startswith("windows of 40 ms, ")
    assert how == "references as instruments"


def test_it_tells_what_it_does(found, told):
    assert found.verdict
    assert {what for what, _ in told} == {"ladder", "simulation"}
    for what in ("ladder", "simulation"):
        shares = [share for name, share in told if name == what]
        assert shares == sorted(shares)
    assert told[-1][1] <= 1.0


def test_plain_data_says_all(found):
    plain = json.loads(json.dumps(found.to_dict()))
    assert plain["verdict"] == "trusted"
    assert plain["model"] == "per direction"
    assert [c["name"] for c in plain["constants"]] == plain["correlation"]["names"]
    assert all(c["trusted"] for c in plain["constants"])
    assert np.shape(plain["correlation"]["matrix"]) == (6, 6)
    assert [s["model"] for s in plain["ladder"]] == [rung.name for rung in RUNGS]
    assert plain["ladder"][0]["gain"] is None
    assert [s["taken"] for s in plain["ladder"]][:3] == [True, True, True]
    assert plain["simulation"][-1]["name"] == "free run"
    assert plain["logs"][0]["samples"] == 4000
    assert plain["refusals"] == []


def test_without_a_reference_wider_windows_are_instruments():
    found = identify([RECORDER.log(with_reference=False)])
    assert found.verdict == "trusted"
    assert {e.method for e in found.estimates} == {"instrumental variables of wider windows"}
    assert found.notes[-1] == "wider windows as instruments: no reference that the axis follows closely"
    assert values_of(found) == pytest.approx(TRUTH, rel=0.02)
    # What fits best is used by the simulation, but nobody knows its error.
    assert found.constants.value("delay") == pytest.approx(0.004, abs=1e-3)


def test_a_reference_that_the_axis_does_not_follow_is_no_instrument():
    log = RECORDER.log()
    still = changed(log, reference=np.zeros(len(log.t)))
    assert {e.method for e in identify([still]).estimates} == {"instrumental variables of wider windows"}


def test_motion_too_quick_for_wider_windows_is_fitted_by_least_squares():
    """Turning round thrice a second, sampled at 25 Hz: windows of a second see hardly any of it."""
    step = 0.04
    recorder = Recorder(step=step, seconds=40.0, force_noise=0.05)
    found = identify([recorder.log(with_reference=False)])
    assert {e.method for e in found.estimates} == {"least squares"}
    told = "least squares: no reference that the axis follows closely, and motion too quick"
    assert any(note.startswith(told) for note in found.notes)


def test_several_logs_are_one_identification(found):
    logs = [Recorder(seconds=4.0, delay=0.004, force_noise=0.1, seed=seed).log() for seed in (3, 4)]
    both = identify(logs)
    assert len(both.runs) == len(both.logs) == 2
    assert values_of(both)["mass"] == pytest.approx(2.0, rel=0.01)
    assert sum(h.starts for h in both.horizons if h.name == "free run") == 2
    assert len(both.fit.residual) == pytest.approx(len(found.fit.residual), rel=0.1)


def test_coarse_counts_ask_for_wider_windows(found):
    coarse = identify([Recorder(seconds=8.0, count=2e-4).log(with_reference=False)])
    # "windows of 40 ms, ..."
    assert float(coarse.notes[1].split()[2]) > float(found.notes[1].split()[2])
    assert values_of(coarse)["mass"] == pytest.approx(2.0, rel=0.05)


def test_the_effort_can_be_chosen():
    log = RECORDER.log()
    units = {"voltage": "V"}
    both = make_log(log.t, log.signals | {"voltage": 0.5 * log.signals["force"]}, units)
    assert identify([both]).notes[0] == "effort: force [N]"
    found = identify([both], "voltage")
    assert found.notes[0] == "effort: voltage [V]"
    mass = next(e for e in found.estimates if e.name == "mass")
    assert (mass.unit, mass.value) == ("V*s^2/m", pytest.approx(1.0, rel=0.01))


def test_the_simplest_rung_that_is_enough():
    symmetric = Recorder(SYMMETRIC, 8.0, force_noise=0.1, seed=5)
    found = identify([symmetric.log()])
    assert found.rung.name in {"viscous", "per direction"}
    plus, minus = (values_of(found)[f"viscous.{way}"] for way in ("positive", "negative"))
    assert plus == pytest.approx(minus, rel=0.02)


def test_low_speed_friction_that_the_log_shows_is_found():
    recorder = Recorder(seconds=10.0, force_noise=0.05, excess=1.0, stribeck=0.05)
    found = identify([recorder.log()])
    values = values_of(found)
    assert found.rung.name == "stribeck"
    assert values["stribeck"] == pytest.approx(0.05, rel=0.1)
    assert values["static.positive"] == pytest.approx(2.6, rel=0.1)
    assert values["static.negative"] == pytest.approx(1.95, rel=0.1)  # its excess is in proportion
    assert {"stribeck", "static.positive"} <= {e.name for e in found.trusted}


def test_low_speed_friction_that_nobody_can_tell_is_not_given():
    """A tenth of a newton below the noise may predict better by chance; constants that nobody knows are no model."""
    taken = {}
    for seed in range(6):
        found = identify([Recorder(seconds=6.0, force_noise=0.5, excess=0.03, stribeck=0.03, seed=seed).log()])
        taken[seed] = found.rung.name
        assert found.rung.name != "stribeck" or "stribeck" in {e.name for e in found.estimates}
    assert list(taken.values()).count("stribeck") <= 1, taken


# -- refusals -------------------------------------------------------------------------------------------------


def test_a_turned_force_is_refused():
    log = RECORDER.log()
    found = identify([changed(log, force=-log.signals["force"])])
    assert found.verdict == "refused"
    assert found.trusted == ()
    assert found.horizons == ()
    assert "wrong sign" in {r.subject for r in found.refusals}
    assert not any(c["trusted"] for c in found.to_dict()["constants"])


def test_a_log_of_half_a_second_is_refused():
    found = identify([Recorder(seconds=0.5).log()])
    assert found.verdict == "refused"
    assert "too short" in {r.subject for r in found.refusals}
    assert found.trusted == ()


def test_a_log_of_a_moment_is_refused_without_constants():
    found = identify([Recorder(seconds=0.15).log()])
    assert found.verdict == "refused"
    assert [r.subject for r in found.refusals] == ["too short"]
    assert found.estimates == found.horizons == found.climbs == ()
    assert found.constants is None
    assert found.rung is None
    plain = json.loads(json.dumps(found.to_dict()))
    assert (plain["model"], plain["correlation"], plain["constants"]) == (None, None, [])


def test_a_log_at_standstill_is_refused():
    t = np.arange(3000) * 2e-3
    found = identify([make_log(t, {"position": np.zeros(3000), "force": np.sin(t)})])
    assert found.verdict == "refused"
    assert all(r.record for r in found.refusals)


def test_an_effort_of_another_machine_is_refused():
    log = RECORDER.log()
    other = np.random.default_rng(1).standard_normal(len(log.t)).cumsum()
    found = identify([changed(log, force=other - other.mean())])
    assert found.verdict == "refused"
    assert found.trusted == ()


def test_steady_speeds_alone_say_little_about_the_mass():
    """To and fro at steady speeds with smooth turns: friction shows, a mass of 50 g does not."""
    t = np.arange(0.0, 12.0, 2e-3)
    w = 2 * np.pi / 3.0
    steep = 8.0 * np.sin(w * t)
    v = 0.02 * np.tanh(steep) * (1.0 + 0.3 * np.sin(0.21 * w * t))
    q = np.concatenate([[0.0], np.cumsum(0.5 * (v[1:] + v[:-1]) * 2e-3)])
    late = np.interp(t + 1e-3, t, v)
    force = 0.05 * np.gradient(late, t) + 1.0 * np.sign(late) + 20.0 * late
    noise = 0.1 * np.random.default_rng(3).standard_normal(len(t))
    found = identify([make_log(t, {"position": q, "force": force + noise})])
    assert found.verdict == "partly trusted"
    assert ("little acceleration", ("mass",)) in [(r.subject, r.constants) for r in found.refusals]
    assert "mass" not in {e.name for e in found.trusted}
    assert {"coulomb.positive", "coulomb.negative"} <= {e.name for e in found.trusted}
    marks = {c["name"]: c["trusted"] for c in found.to_dict()["constants"]}
    assert (marks["mass"], marks["coulomb.positive"]) == (False, True)


def with_refusals(*refusals):
    names = ("mass", "coulomb.positive")
    constants = Constants(names, np.array([2.0, 1.0]), 1e-4 * np.eye(2), np.full(2, 10.0), "")
    run = Recorder(seconds=1.0).run()
    return Identification((), (run,), constants, constants.estimates(run), (), None, (), refusals)


def test_the_verdict_follows_from_the_refusals():
    assert with_refusals().verdict == "trusted"
    one = Refusal("little acceleration", "", "", ("mass",))
    assert with_refusals(one).verdict == "partly trusted"
    assert [e.name for e in with_refusals(one).trusted] == ["coulomb.positive"]
    each = Refusal("not determined by the data", "", "", ("coulomb.positive",))
    assert with_refusals(one, each).verdict == "refused"
    assert with_refusals(one, Refusal("saturated", "", "")).verdict == "refused"
    assert with_refusals(one, Refusal("saturated", "", "")).trusted == ()


def test_a_log_that_cannot_be_identified_is_an_error_with_what_to_do():
    t = np.arange(1000) * 1e-3
    with pytest.raises(InputError, match=r"a recording with position; try: name the column") as error:
        identify([make_log(t, {"force": np.sin(t)})])
    assert error.value.exit_status == 2
    with pytest.raises(InputError, match="something that drives the axis"):
        identify([make_log(t, {"position": np.sin(t)})])
    with pytest.raises(InputError, match="torque that drives the axis"):
        identify([RECORDER.log()], "torque")
    with pytest.raises(InputError, match="record a longer run"):
        identify([make_log(t[:10], {"position": t[:10], "force": t[:10]})])


def test_where_the_regression_does_not_predict_the_motion_the_simulation_fit_takes_its_place(tmp_path):
    """A log whose regression misses 68 % of the travel; the limits of the simulation fit alone miss 3 of 6 truths."""
    case = make_case(162)
    write_csv(case, tmp_path / "log.csv")
    found = identify([read_log(tmp_path / "log.csv")])
    (told,) = (note for note in found.notes if "the regression misses held-out travel by" in note)
    assert told.endswith("its constants are given, with intervals that hold those of both")
    assert found.verdict == "trusted"
    assert len(found.trusted) == len(case.truth)
    assert all(one.low <= case.truth[one.name] <= one.high for one in found.trusted)


def test_limits_that_reach_as_far_as_those_of_another_way():
    one = Constants(("mass", "delay"), np.array([2.0, 0.0]), np.diag([0.01, 1.0]), np.array([1e9, 1e9]), "a")
    other = Constants(("mass",), np.array([3.0]), np.array([[0.25]]), np.array([1e9]), "b")
    found = reaching(one, other)
    assert found.values.tolist() == [2.0, 0.0]
    assert quantile(1e9) * found.errors[0] == pytest.approx(1.0 + quantile(1e9) * 0.5)
    assert found.errors[1] == 1.0
    assert reaching(one, replace(other, values=np.array([2.0]), covariance=np.array([[1e-4]]))).errors[0] == 0.1


def test_a_log_that_the_regression_predicts_is_not_simulated_once_more(found):
    assert not any("simulation fit" in note for note in found.notes)
