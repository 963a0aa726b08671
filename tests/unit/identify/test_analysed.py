"""Answers to single questions: what to do with each, where commands differ, the report, whether it is done."""

import json
from pathlib import Path

import numpy as np
import pytest
from tests.log_rig import make_log
from tests.places import DATA

import detent
from detent.cli.terminal import print_json
from detent.errors import DetentError
from detent.identify.analysed import table_of
from detent.logs.log import Log

STEP = 1e-3


@pytest.fixture(scope="module")
def moves() -> Log:
    """The same two moves five times each, along a profile, with friction; counts of 1 um."""
    shape = 0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, 300))
    rest = np.zeros(500)
    pieces: list[np.ndarray] = []
    for way in (0.02, 0.05) * 5:
        pieces += [rest, way * shape, rest + way, way * (1.0 - shape)]
    reference = np.concatenate([*pieces, rest])
    rng = np.random.default_rng(3)
    position = np.round((reference + 2e-6 * rng.normal(size=len(reference))) / 1e-6) * 1e-6
    return make_log(np.arange(len(reference)) * STEP, position=position, reference=reference)


def test_moves_of_one_kind_are_one_row_and_a_profile_is_called_one(moves: Log) -> None:
    answer = detent.analyse(moves, "steps")["steps"]
    assert [(kind["times"], kind["is_profile"]) for kind in answer.details["moves"]] == [(5, True)] * 4
    ways = sorted(kind["way"] for kind in answer.details["moves"])
    assert ways == pytest.approx([-0.05, -0.02, 0.02, 0.05], rel=1e-3)
    assert len(answer.details["steps"]) == 20
    rises = [one for one in answer.estimates if one.name.endswith("rise_time")]
    assert len(rises) == 4
    assert all(one.name.partition(":")[0].endswith("5 times") for one in rises)
    # From 10 to 90 % of half a cosine that takes 299 ms.
    wanted = 0.299 * (np.arccos(-0.8) - np.arccos(0.8)) / np.pi
    assert all(one.low <= wanted <= one.high for one in rises)
    assert "20 moves of 4 kinds; the reference is a profile" in answer.advice


def test_every_question_has_a_recommendation_or_what_to_record(moves: Log, tmp_path: Path) -> None:
    found = detent.analyse(moves)
    assert list(found.recommendations) == [one.name for one in found.answers]
    for one in found.answers:
        assert one.advice.startswith("no result: ") == (not one.estimates)
    assert found["sensors"].advice == "state encoder.resolution = 1 um"
    page = found.report(tmp_path / "report.html").read_text(encoding="utf-8")
    assert "State encoder.resolution = 1 um." in page
    for one in found.answers:
        assert f">{one.name}<" in page
    assert found.recommendations["steps"][:20] in repr(found)


def test_it_is_done_when_what_was_named_has_an_answer_or_else_when_anything_has(moves: Log) -> None:
    assert detent.analyse(moves).done
    assert detent.analyse(moves, ["steps", "sensors"]).done
    assert not detent.analyse(moves, ["steps", "winding"]).done
    still = make_log(np.arange(4000) * STEP, position=np.zeros(4000))
    assert not detent.analyse(still).done
    with pytest.raises(DetentError, match="winding was not requested, only steps; name it in what"):
        detent.analyse(moves, "steps")["winding"]


def test_small_lengths_are_told_in_their_prefix(moves: Log) -> None:
    ((name, value, limits, unit),) = table_of(detent.analyse(moves, "sensors")["sensors"]).rows
    assert (name, value, limits, unit) == ("resolution", "1", "", "µm") or float(value) == pytest.approx(1.0)
    assert unit == "µm"


def test_plain_data(moves: Log, capsys: pytest.CaptureFixture[str]) -> None:
    print_json(detent.analyse(moves, "steps").to_dict())
    told = json.loads(capsys.readouterr().out)
    assert told["done"] is True
    assert told["analyses"][0]["recommendation"].startswith("20 moves")


def test_a_motion_before_its_effort_is_no_dead_time() -> None:
    t = np.arange(8000) * STEP
    rng = np.random.default_rng(5)
    force = np.repeat(rng.normal(size=200), 40)
    velocity = np.cumsum(force - np.convolve(force, np.ones(400) / 400, "same")) * STEP
    position = np.cumsum(velocity) * STEP
    early = make_log(t[:-6], position=position[6:], force=force[:-6])
    answer = detent.analyse(early, "sensors")["sensors"]
    assert "delay" not in {one.name for one in answer.estimates}
    assert any(note.startswith("dead time: no result: ") for note in answer.notes)


@pytest.mark.skipif(not DATA.exists(), reason="the recordings are not at hand")
def test_a_resonance_says_how_fast_a_loop_may_be() -> None:
    path = DATA / "lsb250_two_mass" / "exp1.npz"
    found = detent.analyse(path, "frequency", columns=["voltage=-input_V [V]"])
    assert found.done
    told = found.recommendations["frequency"]
    assert told.startswith("resonance 13.6 Hz: keep the velocity-loop bandwidth below 5.9 Hz")
    assert found["frequency"].shown is not None


@pytest.mark.skipif(not DATA.exists(), reason="the recordings are not at hand")
def test_two_commands_agree_on_one_log() -> None:
    """149.6 N s/m from constant speeds alone, 166.3 from all motion: the limits carry what the model leaves open.

    A friction that falls to standstill would tell this log better by eight standard errors, with 155.1 N s/m.
    """
    path, columns = DATA / "emps" / "DATA_EMPS.mat", ["force=vir [35.15 N]"]
    analysed = detent.analyse(path, "two-speeds", columns=columns)
    identified = detent.identify_axis(path, columns=columns)
    steady = next(one for one in analysed["two-speeds"].estimates if one.name == "slope.positive")
    whole = identified.constants["viscous.positive"]
    assert steady.value == pytest.approx(149.6, abs=0.05)
    assert whole.value == pytest.approx(166.3, abs=0.05)
    assert whole.holds(steady.value)
    assert analysed.remarks == ()
    (delay,) = identified.remarks
    assert delay.startswith("delay")
    assert delay in repr(identified).replace("\n  ", " ")
    assert identified.to_dict()["remarks"] == list(identified.remarks)


def test_friction_that_would_drive_the_axis_is_not_recommended() -> None:
    rng = np.random.default_rng(4)
    speed = np.repeat([0.1, 0.2, -0.1, -0.2] * 2, 2000)
    force = -np.sign(speed) * 3.0 + 50.0 * speed + 0.05 * rng.normal(size=len(speed))
    log = make_log(np.arange(len(speed)) * STEP, position=np.cumsum(speed) * STEP, force=force)
    found = detent.analyse(log, "two-speeds")
    assert not found.done
    assert "would drive the axis" in found.recommendations["two-speeds"]
    falling = make_log(log.t, position=log.signals["position"], force=np.sign(speed) * 9.0 - 20.0 * speed)
    assert "slope.positive and slope.negative below 0" in detent.analyse(falling, "two-speeds")["two-speeds"].reason


def test_a_profile_is_seen_however_quickly_it_is_sampled() -> None:
    shape = 0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, 20_000))
    reference = np.concatenate([np.zeros(4000), 0.3 * shape, np.full(4000, 0.3), 0.3 - 0.1 * shape, np.full(4000, 0.2)])
    log = make_log(np.arange(len(reference)) * 5e-5, position=reference, reference=reference)
    moves = detent.analyse(log, "steps")["steps"].details["moves"]
    assert [(round(one["way"], 3), one["times"]) for one in moves] == [(0.3, 1), (-0.1, 1)]
    assert [one["duration"] for one in moves] == pytest.approx([1.0, 1.0], rel=0.02)
