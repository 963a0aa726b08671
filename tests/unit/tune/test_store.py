"""The store of chunks: what is whole stays, what is not is not seen, another question is refused."""

import json

import numpy as np
import pytest
from tests.store_rig import QUESTION, computed, fill

from detent.errors import DiskError, InputError
from detent.tune.store import joined, opened


def test_what_is_kept_comes_back(tmp_path):
    with opened(tmp_path / "store", QUESTION, 50) as store:
        store.keep(50, computed({}, 50, 50))
        back = store.kept(50)
        assert back is not None
        assert back.first == 50
        assert back.results["error"].tobytes() == computed({}, 50, 50).results["error"].tobytes()
        assert (
            back.values["mechanics.load_mass"].tolist() == computed({}, 50, 50).values["mechanics.load_mass"].tolist()
        )
        assert back.reason.tolist()[:4] == ["backlash without stiffness", "", "", "backlash without stiffness"]
        assert store.kept(0) is None
        assert store.path(99).name == "chunk-000001.npz"


def test_chunks_are_put_together():
    whole, parts = computed({}, 0, 250), [computed({}, first, 100) for first in (0, 100, 200)]
    made = joined(parts, 250)
    assert made.count == 250
    assert made.results["error"].tobytes() == whole.results["error"].tobytes()
    assert made.reason.tolist() == whole.reason.tolist()
    assert np.array_equal(made.values["mechanics.load_mass"], whole.values["mechanics.load_mass"])


def test_a_store_that_is_continued_is_that_of_one_run(tmp_path):
    fill(tmp_path / "a", 200)
    fill(tmp_path / "a", 500, note=str(tmp_path / "calls"))
    fill(tmp_path / "b", 500)
    assert (tmp_path / "calls").read_text() == "200 100\n300 100\n400 100\n"
    for name in sorted(path.name for path in (tmp_path / "b").iterdir()):
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()


def test_a_damaged_chunk_is_computed_again(tmp_path):
    fill(tmp_path, 300)
    kept = (tmp_path / "chunk-000001.npz").read_bytes()
    (tmp_path / "chunk-000001.npz").write_bytes(kept[: len(kept) // 2])
    (tmp_path / "chunk-000002.npz.part").write_bytes(kept[:100])
    fill(tmp_path, 300)
    assert (tmp_path / "chunk-000001.npz").read_bytes() == kept
    assert not list(tmp_path.glob("*.part"))


def test_another_question_is_refused_with_what_differs(tmp_path):
    fill(tmp_path, 100)
    with (
        pytest.raises(InputError, match="another seed"),
        opened(tmp_path, {**QUESTION, "hash": "4567", "seed": 2}),
    ):
        pass


@pytest.mark.parametrize("text", ["", "[]", '{"hash": "0123"}', '{"hash": "0123", "size": 0}'])
def test_what_is_no_question_is_refused(tmp_path, text):
    (tmp_path / "question.json").write_text(text)
    with pytest.raises(InputError, match="no question"), opened(tmp_path, QUESTION):
        pass


def test_a_folder_of_others_is_refused(tmp_path):
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(InputError, match="other files"), opened(tmp_path, QUESTION):
        pass
    assert [path.name for path in tmp_path.iterdir()] == ["notes.txt"]


def test_one_process_at_a_time(tmp_path):
    with opened(tmp_path, QUESTION), pytest.raises(DiskError, match="another process"), opened(tmp_path, QUESTION):
        pass


def test_the_size_of_chunks_is_that_of_the_first_time(tmp_path):
    fill(tmp_path, 100, size=100)
    with opened(tmp_path, QUESTION, 1000) as store:
        assert store.size == 100
    assert json.loads((tmp_path / "question.json").read_text())["seed"] == 1
