"""Many cascade axes at once: the figures of each are those of its own run."""

import math
import random

import numpy as np
import pytest
from tests.acceptance.test_golden_bits import EXAMPLES
from tests.tolerance_rig import FORCE_PID, SHORT, as_arrays, asked, machine, one_by_one, quick, widened

from detent.methods.batch import kind_of
from detent.methods.moves.job import Move, MoveJob, one_move
from detent.tune.batch import run_chunk

TWO = MoveJob("two", "moves", (Move(1, 0, by=0.0004, dwell=0.001), Move(2, 0, by=-0.0004)))


@pytest.mark.parametrize(
    ("table", "job"),
    [('"mechanics.load_mass" = "10 %"\n"mechanics.friction.positive.coulomb" = "30 %"', TWO),
     ('"limits.speed" = "30 %"', SHORT),  # each has a reference of its own
     ('"mechanics.friction.positive.coulomb" = ["1 N", "900 N"]', SHORT)],  # and some do not arrive
)  # fmt: skip
def test_each_has_the_bits_of_its_own_run(table, job, tmp_path):
    question = asked(tmp_path, f"\n[tolerance]\n{table}\n", job, quick())
    chunk = run_chunk(question, 0, 4)
    for k in range(4):
        run = question.method.run(machine(question, chunk.values, k).spec, job)
        told = run.figures()
        for name, each in chunk.results.items():
            assert each[k] == told[name] or (math.isnan(each[k]) and math.isnan(told[name])), name
        assert chunk.reason[k] == (kind_of(run.failure) if run.failure else "")


@pytest.mark.compiled
def test_a_fault_has_the_kind_of_its_own_run(tmp_path):
    text = quick().replace('velocity_gain = "100 V*s/m"', 'velocity_gain = "400 V*s/m"\nfollowing_error = "60 um"')
    question = asked(tmp_path, '\n[tolerance]\n"drive.delay" = [0, 6]\n', one_move("some", 0.01, 0.0), text)
    chunk = run_chunk(question, 0, 4)
    runs = [question.method.run(machine(question, chunk.values, k).spec, question.job) for k in range(4)]
    assert [kind_of(run.failure) for run in runs] == chunk.reason.tolist()
    assert any("the following error exceeded" in reason for reason in chunk.reason)


@pytest.mark.parametrize("name", ["cascade", "turntable", ""])
def test_arrays_build_the_bytes_of_each_file(name, tmp_path):
    text = (EXAMPLES / f"{name}.toml").read_text(encoding="utf-8") if name else FORCE_PID
    question = asked(tmp_path, widened(text, random.Random(1)), text=text)
    made, refused = one_by_one(question, 20)
    assert as_arrays(question, 20) == (made, refused)
    assert 0 < len(refused) < 20


@pytest.mark.compiled
def test_a_job_that_no_longer_fits_is_a_reason(tmp_path):
    job = one_move("far", 0.45, 0.0)
    question = asked(tmp_path, '\n[tolerance]\n"limits.travel" = ["0.4 m", "0.5 m"]\n', job, quick())
    chunk = run_chunk(question, 1, 3)
    short = chunk.values["limits.travel"] < 0.47
    assert short.any()
    assert (np.char.startswith(chunk.reason[short], "refused: by")).all()


def test_a_model_of_the_file_is_kept(tmp_path):
    text = quick() + '\n[method.feed_forward.model]\nmass = "50 kg"\n'
    question = asked(tmp_path, '\n[tolerance]\n"mechanics.load_mass" = "10 %"\n', SHORT, text)
    made, refused = one_by_one(question, 3)
    assert as_arrays(question, 3) == (made, refused)
    assert question.machine({"mechanics.load_mass": 33.0}).spec.reckoned["mass"] == 50.0
