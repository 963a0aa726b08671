"""Recordings of one axis against one another."""

import json

import numpy as np
import pytest
from tests.foreign_logs import motion, table
from typer.testing import CliRunner

from detent.cli.app import app
from detent.errors import DetentError
from detent.identify.fit.estimate import estimate
from detent.identify.records import _wander, compare_records

WRITE = table("time [s],position [mm],current [A]")


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    """Three recordings of one axis, the last on a day with more friction."""
    folder = tmp_path_factory.mktemp("records")
    for name, seed, coulomb in (("a", 5, 1.5), ("b", 6, 1.5), ("c", 7, 1.7)):
        WRITE(folder / f"{name}.csv", motion(4000, 0.002, coulomb, seed))
    return folder


def test_recordings_of_the_same_axis_agree(logs):
    done = compare_records([logs / "a.csv", logs / "b.csv"])
    assert done.changed == ()
    assert {"mass", "coulomb.positive"} <= {one.name for one in done.constants}
    assert "Nothing changed" in done.sentence


def test_friction_that_changed_is_named_and_the_mass_is_not(logs):
    done = compare_records([logs / f"{name}.csv" for name in "abc"])
    assert any(name.startswith("coulomb") for name in done.changed)
    assert "mass" not in done.changed
    friction = next(one for one in done.constants if one.name == "coulomb.positive")
    widest = max(one.half for one in friction.records)
    assert friction.of_the_day.half > 10 * widest  # a record of seconds says nothing of tomorrow
    assert friction.of_the_day.holds(1.5)
    assert friction.of_the_day.holds(1.7)
    assert "c.csv" in " ".join(done.table[1])
    json.dumps(done.to_dict())


def test_the_command_says_it_and_its_status_is_1_where_something_changed(logs):
    told = CliRunner().invoke(app, ["identify", str(logs / "a.csv"), str(logs / "c.csv"), "--compare"])
    assert told.exit_code == 1
    assert "Changed between 2 recordings: coulomb" in told.output
    same = CliRunner().invoke(app, ["identify", str(logs / "a.csv"), str(logs / "b.csv"), "--compare", "--json"])
    assert same.exit_code == 0
    assert json.loads(same.output)["changed"] == []


def test_compare_takes_recordings_alone(logs, tmp_path):
    job = ["--job", str(tmp_path / "x.toml")]
    told = CliRunner().invoke(app, ["identify", str(logs / "a.csv"), str(logs / "b.csv"), "--compare", *job])
    assert told.exit_code == 2
    assert "--compare: got --job" in told.output
    with pytest.raises(DetentError, match="two or more recordings"):
        compare_records([logs / "a.csv"])


def test_the_interval_of_the_day_holds_the_next_recording():
    rng, held, changed = np.random.default_rng(3), 0, 0
    for _ in range(2000):
        values = rng.normal(10.0, 0.5, 6)
        seen = [estimate("c", float(rng.normal(value, 0.1)), "N", 0.1, "test") for value in values]
        one = _wander("c", tuple(seen[:5]))
        held += one.of_the_day.holds(seen[5].value)
        changed += one.changed
    assert 0.93 < held / 2000 < 0.97
    assert changed / 2000 > 0.95


def test_constants_that_are_the_same_are_called_changed_in_5_per_cent():
    rng = np.random.default_rng(4)
    drawn = ([estimate("c", float(value), "N", 0.1, "test") for value in rng.normal(10, 0.1, 4)] for _ in range(4000))
    share = sum(_wander("c", tuple(each)).changed for each in drawn) / 4000
    assert 0.04 < share < 0.06
