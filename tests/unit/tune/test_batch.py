"""Chunks of cases: what is measured, and why a case failed."""

import math
import pickle

import numpy as np
import pytest
from tests.acceptance.test_golden_bits import EXAMPLES
from tests.standstill_rig import RIGID, rigid
from tests.tolerance_rig import FORCE_PID, SLIDE, asked, quick

import detent
from detent.methods.batch import kind_of
from detent.methods.moves.job import one_move
from detent.tune.batch import (
    HUNTS,
    STARTS,
    SWING,
    Limit,
    Question,
    default_limits,
    quantities,
    run_chunk,
)
from detent.tune.standstill import standstill


def filtered(folder, tolerance: str):
    file = folder / "servo.toml"
    text = (EXAMPLES / "filtered_servo.toml").read_text(encoding="utf-8")
    file.write_text(f"{text}\n[tolerance]\n{tolerance}\n", encoding="utf-8")
    axis = detent.load(file)
    return Question.of(axis.file, one_move("short", 0.001, 0.0))


def test_a_chunk_is_what_each_machine_does(tmp_path):
    asked = filtered(tmp_path, '"drive.current_per_count" = ["35 mA", "60 mA"]')
    asked = pickle.loads(pickle.dumps(asked))  # noqa: S301 - our own
    chunk = run_chunk(asked, 0, 3)
    names = {one.name: one for one in quantities(asked)}
    assert list(chunk.results) == list(names)
    assert names["settling"].unit == "s"
    assert "approach" not in names  # an axis of one mode has none
    for k in range(3):
        values = {key: each[k] for key, each in chunk.values.items()} if k else {}
        done = asked.method.run(asked.machine(values).spec, asked.job)
        assert chunk.results["settling"][k] == done.moves[0].settling
        assert chunk.results["done"][k] == float(done.done)
    assert chunk.count == 3
    assert chunk.reason.tolist() == ["", "", ""]


def test_what_the_file_would_refuse_is_a_failed_case(tmp_path):
    text = '"mechanics.friction.right.static" = ["2 N", "60 N"]\n"mechanics.friction.right.coulomb" = ["1 N", "59 N"]'
    asked = filtered(tmp_path, text)
    chunk = run_chunk(asked, 0, 12)
    coulomb, static = (chunk.values[f"mechanics.friction.right.{key}"] for key in ("coulomb", "static"))
    refused = coulomb > static
    assert 0 < refused.sum() < 12
    for k in range(12):
        if refused[k]:
            assert "mechanics.friction.right.static" in chunk.reason[k]
            assert chunk.results["done"][k] == 0.0
            assert math.isnan(chunk.results["settling"][k])


def test_default_limits_are_those_of_the_file(tmp_path):
    asked = filtered(tmp_path, '"drive.current_per_count" = ["35 mA", "60 mA"]')
    assert default_limits(asked) == (Limit("done", 1.0, least=True),)


@pytest.mark.parametrize(
    ("failure", "kind"),
    [("move 3 to 0.5 m: did not arrive within 2 s; it is at rest", "did not arrive within ..."),
     ("after power-on: the axis ran faster than 1.1 x 0.5 m/s, and", "the axis ran faster than ...")],
)  # fmt: skip
def test_kinds_of_failures_hold_no_values(failure, kind):
    assert kind_of(failure) == kind


def test_margins_are_quantities_where_they_are_asked_for(tmp_path):
    tolerance = '\n[tolerance]\n"mechanics.load_mass" = "10 %"\n'
    question = asked(tmp_path, tolerance, one_move("none", 0.0, 0.0), quick(), margins=True)
    units = {one.name: one.unit for one in quantities(question)}
    assert units["phase margin at command"] == "rad"
    chunk = run_chunk(question, 0, 2)
    values = {key: float(each[1]) for key, each in chunk.values.items()}
    margins = question.method.linear(question.machine(values).spec).margins["command"]
    assert chunk.results["Ms at command"][1] == margins.sensitivity != chunk.results["Ms at command"][0]


MANY = SLIDE + '"drive.delay" = [0, 2]\n"method.velocity_gain" = "20 %"\n'
FEEDBACKS = [
    pytest.param("", id="motor"),
    pytest.param('"method.derivative" = "10 %"\n', id="pid"),
    pytest.param('"method.derivative_filter" = ["0 ms", "0.3 ms"]\n', id="not in columns"),
]


@pytest.mark.parametrize("more", FEEDBACKS)
def test_margins_of_many_are_those_of_each_in_whatever_pieces(tmp_path, more):
    text = quick(FORCE_PID) if more else quick()
    table = '\n[tolerance]\n"mechanics.load_mass" = "20 %"\n"drive.delay" = [0, 2]\n' + more if more else MANY
    question = asked(tmp_path, table, one_move("none", 0.0, 0.0), text, margins=True)
    count = 40
    chunk = run_chunk(question, 0, count)
    parts = [run_chunk(question, first, n) for first, n in ((0, 1), (1, 2), (3, 30), (33, 7))]
    for name, each in chunk.results.items():
        assert np.array_equal(np.concatenate([part.results[name] for part in parts]), each, equal_nan=True), name
    for k in range(0, count, 7):
        spec = question.machine({key: float(each[k]) for key, each in chunk.values.items()}).spec
        for cut, m in question.method.linear(spec).margins.items():
            for name, value in (("Ms", m.sensitivity), ("phase margin", m.phase), ("gain margin", m.gain)):
                assert chunk.results[f"{name} at {cut}"][k] == pytest.approx(value, rel=1e-9)


@pytest.mark.compiled
def test_hunting_is_a_quantity_where_it_is_asked_for(tmp_path):
    tolerance = '\n[tolerance]\n"mechanics.friction.positive.static" = ["39 N", "41 N"]\n'
    (tmp_path / "slide.toml").write_text(quick(RIGID) + tolerance)
    slide = detent.load(tmp_path / "slide.toml", rigid(40, 0.1).file.overrides)
    question = Question.of(slide.file, one_move("none", 0.0, 0.0), hunt=True)
    assert [one.unit for one in quantities(question)[-2:]] == ["", "m"]
    assert default_limits(question)[-1] == Limit(HUNTS, 0.0)
    chunk = run_chunk(question, 1, 1)
    values = {key: float(each[0]) for key, each in chunk.values.items()}
    found = standstill(question.machine(values).spec, STARTS, question.seed)
    assert chunk.results[SWING][0] == found.swing > 0.0
    assert chunk.results[HUNTS][0] == found.shares["hunts"] > 0.0
