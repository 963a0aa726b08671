"""From a run and its trace to what is shown, and the figures for the terminal."""

import math

import numpy as np
import pytest

import detent
from detent.methods.cascade.host import cascade_registers
from detent.methods.cascade.replay import Compared, run_cascade_replay
from detent.methods.cascade.replay_job import ReplayJob
from detent.methods.cascade.report import (
    NEEDED,
    cascade_report,
    cascade_summary_rows,
    figure,
    replay_report,
    replay_summary_rows,
)
from detent.methods.cascade.run import CASCADE_SIGNALS, run_cascade_moves
from detent.methods.cascade.units import Units
from detent.methods.load import load_spec
from detent.methods.moves.job import Move, MoveJob
from detent.page.words import GAP
from detent.record.recorder import Recorder

pytestmark = pytest.mark.compiled

JOB = MoveJob("two.csv", "moves", (Move(number=1, row=1, target=0.12, dwell=0.1), Move(number=2, row=2, by=-0.1)))


def linear(*overrides):
    return load_spec(detent.example("cascade.toml"), overrides)


def recorded(spec, every=6):
    recorder = Recorder(cascade_registers(spec), CASCADE_SIGNALS, every=every, period=spec.method.sample_period / 3)
    run = run_cascade_moves(spec, JOB, recorder=recorder)
    return run, recorder.trace()


@pytest.fixture(scope="module")
def done():
    spec = linear()
    return spec, *recorded(spec)


@pytest.fixture(scope="module")
def failed():
    spec = linear("method.following_error=15 um", "method.in_position=5 um")
    return spec, *recorded(spec)


def test_what_is_needed_is_recorded():
    assert set(NEEDED.values()) <= set(CASCADE_SIGNALS)


def test_the_whole_job_and_the_fastest_move_are_shown(done):
    spec, run, trace = done
    data = cascade_report(spec, run, trace)
    assert data.path.t[0] == pytest.approx(0.0, abs=1e-3)
    assert data.path.t[-1] == pytest.approx(run.time_end - run.time_ready, abs=1e-3)
    assert data.path.load[-1] == pytest.approx(0.02, abs=1e-4)
    assert data.detail.number == max(run.moves, key=lambda move: move.peak_speed).number
    assert data.detail.why == "the fastest move"
    texts = [event.text for event in data.detail.events]
    assert texts[0] == "the reference sets off"
    assert len(texts) == 4
    begin, end = data.detail.rest
    shown = run.moves[data.detail.number - 1]
    assert begin < shown.arrived - shown.begin < end


def test_a_drive_that_is_off_shows_no_reference_and_no_error(failed):
    spec, run, trace = failed
    data = cascade_report(spec, run, trace)
    off = data.path.t > run.time_off - run.time_ready
    assert 0 < np.count_nonzero(off) < len(off)
    assert np.isnan(data.path.reference[off]).all()
    assert np.isnan(data.path.following[off]).all()
    assert not np.isnan(data.path.following[~off]).any()
    assert data.path.command[-1] == 0.0
    assert data.detail.why == "the move that failed"
    assert data.detail.events[-1].text == "the drive goes off"
    assert data.detail.rest is None


def test_without_a_trace_or_its_signals_there_are_no_figures_over_time(done):
    spec, run, trace = done
    assert cascade_report(spec, run, None).path is None
    part = trace.between(0.0, 0.051)
    assert cascade_report(spec, run, part).detail is None
    few = cascade_report(spec, run, recorded(spec, every=30_000)[1])
    assert (few.path, few.detail) == (None, None)


def test_the_summary_names_each_figure_and_whose_it_is(done):
    spec, run, _ = done
    rows = dict(cascade_summary_rows(spec, run))
    assert rows["moves"] == "2 of 2 in position"
    assert rows["settling"].endswith("from the end of the reference until within 50 µm for good")
    assert rows["peak speed"].startswith("500 mm/s (move ") or rows["peak speed"].startswith("50")
    assert "of 3.41 V" in rows["peak command"]
    assert not any(GAP in text for text in rows.values())


def test_the_summary_of_a_failed_run_leaves_out_what_it_did_not_come_to(failed):
    spec, run, _ = failed
    rows = dict(cascade_summary_rows(spec, run))
    assert rows["moves"] == "0 of 2 in position"
    assert "settling" not in rows
    assert "error at rest" not in rows
    run.moves.clear()
    assert list(dict(cascade_summary_rows(spec, run))) == ["moves"]


def replayed(**efforts):
    t = np.arange(2000) * 1e-3
    job = ReplayJob(
        name="log", t=t, position=0.1 + 0.02 * np.sin(3 * t), efforts=efforts, reference=0.1 + 0.02 * np.sin(3 * t),
        notes=("guessed: a lot",),
    )  # fmt: skip
    return run_cascade_replay(linear(), job)


def test_a_replay_is_told_signal_by_signal():
    run = replayed(voltage=np.ones(2000))
    rows = dict(replay_summary_rows(linear(), run))
    assert list(rows) == ["recording", "position", "velocity", "acceleration", "voltage", "following error"]
    assert rows["recording"] == "2.00 s, 2 000 samples, along the recorded reference"
    assert rows["position"].endswith("% of the recording")
    data = replay_report(linear(), run)
    assert [note.level for note in data.notes] == ["note"]


def test_warnings_of_a_replay_come_with_its_notes():
    data = replay_report(linear(), replayed())
    assert sorted(note.level for note in data.notes) == ["note", "warning"]


@pytest.mark.parametrize(
    ("unit", "value", "text"),
    [("m", 5.69e-6, "5.7 µm"), ("rad", 0.1, "5.73 deg"), ("m/s", 0.25, "250 mm/s"), ("rad/s^2", math.pi, "180 deg/s²"),
     ("m/s^2", 1.5, "1.50 m/s²"), ("N*m", 0.5, "0.500 N m")],
)  # fmt: skip
def test_differences_are_written_in_the_units_of_the_trade(unit, value, text):
    one = Compared(name="x", unit=unit, measured=np.zeros(1), simulated=np.zeros(1))
    assert figure(one, value, Units(rotary=unit.startswith("rad"))).replace(GAP, " ") == text
