"""Chunks that need no axis, and a run that is killed: for the store, and for who computes."""

import os
import random
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import numpy as np

from detent.tune.batch import Chunk, Question, run_chunk
from detent.tune.store import joined, opened

QUESTION = {"hash": "0123", "seed": 1, "axis": "a slide"}


def computed(question: dict[str, object], first: int, count: int) -> Chunk:
    """Cases of which every third is refused; a file tells each call, if the question names one."""
    if note := question.get("note"):
        with Path(str(note)).open("a", encoding="utf-8") as file:
            file.write(f"{first} {count}\n")
    number = np.arange(first, first + count)
    for _ in range(int(str(question.get("work", 0)))):
        np.sin(number)
    error = np.where(number % 3 == 2, np.nan, np.sin(number))
    reason = np.array(["backlash without stiffness" if k % 3 == 2 else "" for k in number.tolist()], np.str_)
    results = {"done": np.isfinite(error).astype(float), "error": error}
    return Chunk(first, {"mechanics.load_mass": 30.0 + number / 7.0}, results, reason)


def killed_once(question: dict[str, object], first: int, count: int) -> Chunk:
    """The same, by a worker that is killed the first time that it comes to some case."""
    if first == question["killed at"]:
        try:
            os.close(os.open(str(question["once"]), os.O_CREAT | os.O_EXCL))
        except FileExistsError:
            pass
        else:
            os._exit(9)
    return computed(question, first, count)


def run_killed(question: Question, first: int, count: int, at: int, once: str) -> Chunk:
    """A chunk of machines, by a worker that is killed the first time that it comes to some case."""
    killed_once({"killed at": at, "once": once}, first, 1)
    return run_chunk(question, first, count)


def fill(folder: Path, cases: int, size: int = 100, note: str = "", work: int = 0) -> Chunk:
    """Compute what a store lacks."""
    with opened(folder, QUESTION, size) as store:
        chunks = [store.kept(first) for first in range(0, cases, size)]
        for k, first in enumerate(range(0, cases, size)):
            if chunks[k] is None:
                chunks[k] = computed({"note": note, "work": work}, first, size)
                store.keep(first, chunks[k])
        return joined([one for one in chunks if one is not None], cases)


def fill_killed(folder: Path, cases: int, note: Path, chance: random.Random, kills: int) -> None:
    """The same in a process that is killed so many times, each time some chunks farther."""
    words = [sys.executable, __file__, str(folder), str(cases), str(note), "20000"]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    for _ in range(kills):
        far = chance.randrange(1, 2 * cases // 100 // kills)
        before = len(note.read_text().splitlines()) if note.exists() else 0
        with subprocess.Popen(words, env=environment) as process:
            while process.poll() is None and not (note.exists() and note.read_text().count("\n") >= before + far):
                with suppress(subprocess.TimeoutExpired):
                    process.wait(chance.uniform(0.001, 0.02))
            process.kill()


if __name__ == "__main__":
    fill(Path(sys.argv[1]), int(sys.argv[2]), note=sys.argv[3], work=int(sys.argv[4]))
