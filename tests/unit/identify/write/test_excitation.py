"""Lists of moves for what a log lacks: they load, keep to their bounds, and a recording of them is trusted."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.identify_files import AXIS, columns_of, one_way, write_log

import detent
from detent.errors import DetentError
from detent.identify.fit.identification import Identification, identify
from detent.identify.fit.verdict import Refusal
from detent.identify.write.outputs import RAMPS, REVERSALS, SLOW, SPEEDS, cascade_spec, excitation_job, missing_parts
from detent.logs.read_log import read_log
from detent.methods.cascade.schema import CascadeSpec
from detent.methods.moves.job import MoveJob, load_moves

pytestmark = pytest.mark.compiled


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("logs")


@pytest.fixture(scope="module")
def found(folder: Path) -> Identification:
    """Of a log that moves one way, and that for half a second."""
    return identify([read_log(write_log(folder / "oneway.csv", one_way()))])


@pytest.fixture(scope="module")
def spec() -> CascadeSpec:
    return cascade_spec(AXIS, "bench.toml")


def moves_of(folder: Path, text: str, *, rotary: bool = False) -> MoveJob:
    path = folder / "job.toml"
    path.write_text(text, encoding="utf-8")
    return load_moves(path, rotary=rotary)


def refusal(subject: str, *constants: str) -> Refusal:
    return Refusal(subject, "what was found", "what to do", constants)


@pytest.mark.parametrize(
    ("refusals", "parts"),
    [
        ((), [SPEEDS, RAMPS, SLOW]),
        ((refusal("little acceleration", "mass"),), [RAMPS]),
        ((refusal("not determined by the data", "viscous.positive"),), [SPEEDS]),
        ((refusal("not determined by the data", "coulomb.negative"),), [REVERSALS]),
        ((refusal("not determined by the data", "static.negative"), refusal("x", "stribeck")), [SLOW]),
        ((refusal("too short"),), [SPEEDS, RAMPS]),
        ((refusal("model does not explain the log"),), [SPEEDS, RAMPS, SLOW]),
        ((refusal("not determined by the data", "mass"), refusal("x", "coulomb.positive")), [REVERSALS, RAMPS]),
    ],
)
def test_moves_are_those_that_the_refusals_ask_for(refusals: tuple[Refusal, ...], parts: list[object]) -> None:
    assert missing_parts(refusals) == parts


def test_a_recording_of_the_moves_is_trusted(folder: Path, found: Identification, spec: CascadeSpec) -> None:
    assert found.verdict == "refused"
    bench = folder / "bench.toml"
    bench.write_text(AXIS, encoding="utf-8")
    job = folder / "job.toml"
    job.write_text(excitation_job(found, spec), encoding="utf-8")
    run = detent.load(bench).run(job)
    assert run.done, run.failure
    again = identify([read_log(write_log(folder / "again.csv", columns_of(run)))])
    assert again.verdict == "trusted"
    assert {e.name: e for e in again.estimates}["mass"].holds(4.0)


def test_moves_keep_to_the_limits_of_the_axis(folder: Path, found: Identification, spec: CascadeSpec) -> None:
    job = moves_of(folder, excitation_job(found, spec))
    places = [move.target for move in job.moves if move.target is not None]
    assert len(places) == job.count
    assert min(places) >= spec.limits.lowest
    assert max(places) <= spec.highest
    assert max(move.speed or 0.0 for move in job.moves) <= spec.limits.speed * (1 + 1e-6)


def test_without_an_axis_they_keep_to_what_was_seen(folder: Path, found: Identification) -> None:
    text = excitation_job(found)
    seen = found.runs[0].position
    job = moves_of(folder, text)
    places = np.array([move.target for move in job.moves])
    room = 1e-3 * float(np.ptp(seen))
    assert seen.min() - room <= places.min()
    assert places.max() <= seen.max() + room
    assert "travel and speed of oneway.csv" in text
    assert any(move.speed and move.speed > 0.29 for move in job.moves)


def test_moves_go_both_ways_at_several_speeds(folder: Path, found: Identification) -> None:
    job = moves_of(folder, excitation_job(found))
    places = np.array([move.target for move in job.moves])
    ways = np.sign(np.diff(places))
    assert np.count_nonzero(ways > 0) > 5
    assert np.count_nonzero(ways < 0) > 5
    assert len({move.speed for move in job.moves}) > 5


def test_the_job_says_what_each_part_is_for(found: Identification) -> None:
    text = excitation_job(found)
    for refused in found.refusals:
        assert f"try: {refused.record}" in text
    assert re.search(r"^# Several steady speeds, both ways", text, flags=re.MULTILINE)
    assert re.search(r"^# Short ramps", text, flags=re.MULTILINE)


def test_a_saturated_effort_gets_slower_moves(folder: Path, found: Identification, spec: CascadeSpec) -> None:
    saturated = replace(found, refusals=(refusal("saturated"),))
    job = moves_of(folder, excitation_job(saturated, spec))
    assert max(move.speed or 0.0 for move in job.moves) <= 0.5 * spec.limits.speed * (1 + 1e-6)


def test_no_moves_mend_a_sign(found: Identification) -> None:
    assert "No move mends a sign" in excitation_job(replace(found, refusals=(refusal("wrong sign"),)))
    assert "No move mends a sign" not in excitation_job(found)


def test_what_is_partly_trusted_is_looked_at_with_the_new_log(found: Identification) -> None:
    estimates = found.estimates
    assert estimates
    partly = replace(found, refusals=(refusal("little acceleration", "mass"),))
    assert "detent identify oneway.csv NEW_LOG" in excitation_job(partly)


def test_moves_of_an_angle_are_angles(folder: Path) -> None:
    log = write_log(folder / "turn.csv", setpoint="setpoint [rad]", position="position [rad]", force="torque [N*m]")
    job = moves_of(folder, excitation_job(identify([read_log(log)])), rotary=True)
    assert all(move.target is not None and abs(move.target) < 0.2 for move in job.moves)


def test_a_log_at_rest_tells_no_limits(found: Identification, spec: CascadeSpec) -> None:
    run = found.runs[0]
    rests = replace(found, runs=(replace(run, position=np.zeros_like(run.position)),))
    with pytest.raises(DetentError, match=r"got a log without motion; .*--axis FILE"):
        excitation_job(rests)
    assert "limits of slide" in excitation_job(rests, spec)


def test_counts_tell_no_limits(found: Identification) -> None:
    counts = replace(found, runs=tuple(replace(run, position_unit="count") for run in found.runs))
    with pytest.raises(DetentError, match="got positions in count"):
        excitation_job(counts)
