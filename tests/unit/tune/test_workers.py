"""Who computes chunks: the same bits from threads, processes and Dask, and what is told where nobody answers."""

import os
import subprocess
import sys

import pytest
from tests.store_rig import computed, killed_once

from detent.errors import DetentError
from detent.tune import workers

SPANS = [(first, 100) for first in range(0, 1200, 100)]


def bits(found) -> dict[tuple[int, int], bytes]:
    return {span: chunk.results["error"].tobytes() for span, chunk in found}


HERE = {span: computed({}, *span).results["error"].tobytes() for span in SPANS}


def test_threads_give_every_chunk_once():
    assert bits(workers.computed(workers.threads(2), computed, {}, SPANS)) == HERE


def test_few_chunks_wait_to_be_taken():
    """Of a run of ten million cases memory holds those that somebody asked for."""
    made = list[int]()

    def noted(_question: object, first: int, _count: int) -> int:
        made.append(first)
        return first

    found = workers.computed(workers.threads(1), noted, {}, SPANS)
    assert next(found)[0] == (0, 100)
    found.close()
    assert len(made) <= workers.IN_FLIGHT


def test_what_goes_wrong_in_a_chunk_ends_the_others():
    def wrong(_question: object, first: int, _count: int) -> None:
        raise DetentError(f"case {first}")

    with pytest.raises(DetentError, match="case"):
        list(workers.computed(workers.threads(2), wrong, {}, SPANS))


@pytest.mark.process
def test_processes_give_every_chunk_once():
    assert bits(workers.computed(workers.processes(2), computed, {}, SPANS)) == HERE


@pytest.mark.process
def test_a_worker_ends_with_its_parent(tmp_path):
    """One that is killed cannot tell its workers, which wait for work."""
    text = (
        "import os, sys\nfrom tests.store_rig import computed\nfrom detent.tune import workers\n"
        "if __name__ == '__main__':\n"
        "    found = workers.computed(workers.processes(1), computed, {'note': sys.argv[1]}, [(0, 9), (9, 9)])\n"
        "    next(found)\n    import multiprocessing\n"
        "    print(*(one.pid for one in multiprocessing.active_children()), flush=True)\n    os._exit(9)\n"
    )
    script = tmp_path / "killed_parent.py"
    script.write_text(text)
    done = subprocess.run(
        [sys.executable, str(script), str(tmp_path / "note")], capture_output=True, text=True, check=False, timeout=60,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
    )  # fmt: skip
    assert done.returncode == 9
    # Its output was that of the worker as well: that `run` came back says that the worker has ended.
    assert done.stdout.strip().isdecimal()


def test_an_address_that_is_none_is_told():
    with pytest.raises(DetentError, match="local:2"):
        list(workers.computed(workers.dask("local:two"), computed, {}, SPANS))


def test_without_dask_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(DetentError, match=r"detent\[dask\]"):
        list(workers.computed(workers.dask("local:2"), computed, {}, SPANS))


class Answering:
    """A client whose workers say of themselves what they are told to."""

    def __init__(self, answers: object) -> None:
        self.answers = answers

    def run(self, _what: object, on_error: str) -> object:
        assert on_error == "return"
        if isinstance(self.answers, Exception):
            raise self.answers
        return self.answers


@pytest.mark.parametrize(
    ("answers", "told"),
    [
        ({}, "without workers"),
        ({"tcp://a:1": ModuleNotFoundError("No module named 'detent'")}, "tcp://a:1 cannot load detent"),
        (ModuleNotFoundError("No module named 'detent'"), "cannot load detent"),
        ({"tcp://a:1": workers.identity(), "tcp://b:2": {**workers.identity(), "source hash": "12"}},
         "tcp://b:2 has source hash 12"),
        ({"tcp://a:1": {**workers.identity(), "numba": "0.1"}}, "tcp://a:1 has numba 0.1"),
    ],
)  # fmt: skip
def test_workers_that_may_give_other_bits_are_refused_by_name(answers, told):
    with pytest.raises(DetentError, match=told):
        workers._check_workers(Answering(answers))


@pytest.mark.process
@pytest.mark.wide
def test_dask_gives_every_chunk_once_though_a_worker_is_killed(tmp_path):
    question = {"killed at": 400, "once": str(tmp_path / "once")}
    assert bits(workers.computed(workers.dask("local:2"), killed_once, question, SPANS)) == HERE
    assert (tmp_path / "once").exists()
