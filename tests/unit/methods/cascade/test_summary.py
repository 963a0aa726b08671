"""The figures of a run for the terminal."""

import math

import numpy as np
import pytest
from tests.unit.methods.cascade.samples import cascade_run, failed_run, move, replay_run

import detent
from detent.methods.cascade.schema import CascadeSpec
from detent.methods.cascade.summary import cascade_summary, replay_summary
from detent.methods.load import load_spec
from detent.page.words import GAP


@pytest.fixture(scope="module")
def spec() -> CascadeSpec:
    found = load_spec(detent.example("cascade.toml"))
    assert isinstance(found, CascadeSpec)
    return found


def test_each_figure_is_named_with_whose_it_is(spec: CascadeSpec) -> None:
    assert dict(cascade_summary(spec, cascade_run(move(1), move(2, peak_speed=0.5)))) == {
        "moves": "2 of 2 in position",
        "time": "3 s",
        "settling": "worst 40 ms (move 1), from the end of the reference until within 50 µm for good",
        "following error": "worst 80 µm (move 2)",
        "overshoot": "worst 4 µm (move 2)",
        "error at rest": "worst 8.0 µm (move 2), of the load",
        "peak speed": "500 mm/s (move 2)",
        "peak command": "2.50 of 10 V (move 1)",
    }


def test_what_a_failed_run_did_not_come_to_is_left_out(spec: CascadeSpec) -> None:
    run = failed_run()
    run.moves = run.moves[1:]
    rows = dict(cascade_summary(spec, run))
    assert rows["moves"] == "0 of 2 in position"
    assert not {"settling", "error at rest"} & set(rows)
    run.moves.clear()
    assert list(dict(cascade_summary(spec, run))) == ["moves"]


def test_a_replay_is_told_signal_by_signal(spec: CascadeSpec) -> None:
    rows = dict(replay_summary(spec, replay_run()))
    assert list(rows) == ["recording", "position", "velocity", "acceleration", "force", "following error"]
    assert rows["recording"] == "20 s, 2 001 samples, along the recorded reference"
    assert rows["position"] == "rms 5.0 µm, largest 20.0 µm, 0.0071 % of the recording"
    assert rows["following error"] == "up to 1 mm, simulated"
    open_loop = dict(replay_summary(spec, replay_run(open_loop="force", peak_following=math.nan)))
    assert open_loop["recording"].endswith("driven by the recorded force")
    assert "following error" not in open_loop


def test_a_terminal_gets_plain_spaces(spec: CascadeSpec) -> None:
    texts = [text for _, text in (*cascade_summary(spec, cascade_run()), *replay_summary(spec, replay_run()))]
    assert not any(GAP in text for text in texts)
    assert np.unique(texts).size == len(texts)
