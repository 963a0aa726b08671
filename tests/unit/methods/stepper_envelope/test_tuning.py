"""Acceleration and reserve of steppers, tried on the simulated rotors."""

import numpy as np
import pytest

import detent
from detent.methods.stepper_envelope import tuning
from detent.methods.stepper_envelope.tuning import StageSearch

STAGE = detent.example("stage.toml")
KEYS = [f"stepper.{name}.{key}" for key in ("limits.acceleration", "drive.torque_safety") for name in "xy"]


@pytest.fixture
def few(monkeypatch):
    """A slow and a quick pair, and one that nothing holds."""
    monkeypatch.setattr(tuning, "SHARES", np.array([0.02, 0.1, 4.0]))
    monkeypatch.setattr(tuning, "RESERVES", (2.0,))


@pytest.mark.compiled
@pytest.mark.usefixtures("few")
def test_the_quickest_pair_that_loses_no_step_and_is_not_doubted_is_taken(tmp_path):
    axis = detent.load(STAGE)
    found = axis.tune()
    assert found.done
    assert list(found.values) == KEYS
    shares = {one.values[KEYS[0]] / StageSearch(axis.spec).largest["x"]: one.trial for one in found.candidates}
    refused = [trial.refused for share, trial in shares.items() if share > 1.0]
    assert len(refused) == 1
    assert refused[0].startswith("a caution of x: torque used")
    best = min((one for one in found.candidates if not one.trial.refused), key=lambda one: one.trial.rank)
    assert dict(best.values) == dict(found.values)
    assert found.after is not None
    assert found.after.rank < found.before.rank
    again = detent.load(found.save(tmp_path / "new.toml"))
    assert again.spec.stepper["x"].limits.acceleration == found.values[KEYS[0]]
    assert [one.key for one in found.changes] == KEYS[:2]  # the reserve is that of the file
    assert again.check().warnings == axis.check().warnings


@pytest.mark.compiled
@pytest.mark.usefixtures("few")
def test_a_key_that_is_held_stays_and_tolerances_are_tried(tmp_path):
    file = tmp_path / "stage.toml"
    table = '\n[tolerance]\n"stepper.x.mechanics.moving_mass" = "10 %"\n'
    file.write_text(STAGE.read_text(encoding="utf-8") + table, encoding="utf-8")
    found = detent.load(file).tune(hold=KEYS[:1])
    assert (found.done, found.plants) == (True, 10)
    assert found.values[KEYS[0]] == 0.3
    assert found.values[KEYS[1]] != 0.3


def test_all_move_there_and_back_within_their_travels():
    spec = detent.load(detent.example("photo_table.toml")).spec
    there, back = StageSearch(spec).job.moves
    for name, table in spec.stepper.items():
        low = table.mechanics.lower_end
        assert low <= there.targets[name] <= low + table.limits.travel
        assert there.targets[name] != back.targets[name]
    assert back.targets == {name: pytest.approx(table.mechanics.start_position, abs=table.step)
                            for name, table in spec.stepper.items()}  # fmt: skip


@pytest.mark.compiled
def test_steps_that_are_lost_refuse_a_pair():
    """With a torque divided by 1 the ramp asks for all that there is, and friction is on top."""
    spec = detent.load(STAGE, ["stepper.x.drive.torque_safety=1", "stepper.x.limits.acceleration=20 m/s^2"]).spec
    made = StageSearch(spec)
    told = made.tried(spec, made.job)
    assert told.refused == "a rotor is not in its place"
    assert float(told.figures["least torque over torque needed"]) < 1.0
