"""What became of the cases of `detent tolerance`, chunk by chunk, in a folder that outlives a kill.

    question.json       what was asked, with its hash: another question needs another folder
    chunk-000000.npz    the first thousand cases: values of the keys, results, and why a case has none
    worst/              axis files of the worst cases
    report.html         the report

A chunk is written under another name, synced, renamed, and the folder synced: one that has its name is whole.
"""

import json
import zipfile
from collections.abc import Generator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, cast

import numpy as np

from detent.errors import InputError
from detent.files.text import alone_in, sync_folder, write_errors, write_text, writing
from detent.tune.batch import CHUNK, Chunk

QUESTION = "question.json"
_ALLOWED, _REMEDY = "a folder of this question, or an empty one", "choose another folder, or ask what it was made for"


class Store:
    """A folder of chunks of one question; made by `opened`."""

    def __init__(self, folder: Path, size: int) -> None:
        self.folder, self.size = folder, size

    def path(self, first: int) -> Path:
        """Where the chunk with this case stands."""
        return self.folder / f"chunk-{first // self.size:06d}.npz"

    def kept(self, first: int) -> Chunk | None:
        """The chunk that begins with a case; None where it is not there, or damaged."""
        try:
            with self.path(first).open("rb") as file, np.load(file, allow_pickle=False) as held:
                names = {kind: [str(name) for name in held[f"{kind}_names"]] for kind in ("values", "results")}
                columns = {kind: dict(zip(names[kind], held[kind], strict=True)) for kind in names}
                return Chunk(first, columns["values"], columns["results"], held["reason"])
        except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
            return None

    def keep(self, first: int, chunk: Chunk) -> None:
        """Write a chunk, so that it is there whole or not at all."""
        with writing(self.path(first), force=True) as part, part.open("wb") as file:
            columns: dict[str, Any] = {"reason": chunk.reason}
            for kind, held in (("values", chunk.values), ("results", chunk.results)):
                columns[f"{kind}_names"] = np.array(list(held), dtype=np.str_)
                columns[kind] = np.array(list(held.values())).reshape(len(held), chunk.count)
            np.savez(cast("Any", file), **columns)
        with write_errors(self.folder):
            sync_folder(self.folder)


@contextmanager
def opened(folder: Path, question: Mapping[str, Any], size: int = CHUNK) -> Generator[Store]:
    """Have the store of a question for this process alone, made where it is not there yet.

    The "hash" of the question must agree; the `size` of chunks is that of a folder that is made anew.
    """
    question = json.loads(json.dumps(question, default=str))
    with write_errors(folder):
        folder.mkdir(parents=True, exist_ok=True)
    with alone_in(folder, folder):
        file = folder / QUESTION
        if not file.exists():
            if any(folder.iterdir()):
                raise InputError.of_file(str(folder), "a folder with other files", _ALLOWED, _REMEDY)
            write_text(file, json.dumps({**question, "size": size}, indent=2) + "\n", force=True)
            sync_folder(folder)
        size = _checked(file, question)
        for left in folder.glob("*.part"):  # of a process that was killed
            left.unlink()
        yield Store(folder, size)


def _checked(file: Path, question: Mapping[str, Any]) -> int:
    """Cases of a chunk, where the folder is that of the same question."""
    try:
        held = json.loads(file.read_text("utf-8"))
        known, size = held["hash"], held["size"]
        if not (isinstance(size, int) and size > 0):
            raise ValueError(size)  # noqa: TRY301 - told as all that is wrong with it
    except (OSError, ValueError, KeyError, TypeError):
        raise InputError.of_file(str(file), "a file that is no question of detent's", _ALLOWED, _REMEDY) from None
    if known != question["hash"]:
        differs = [name for name, value in question.items() if name != "hash" and held.get(name) != value]
        told = f"results of another question (another {', '.join(differs) or 'axis'})"
        raise InputError.of_file(str(file.parent), told, _ALLOWED, _REMEDY)
    return size


def joined(chunks: Sequence[Chunk], cases: int) -> Chunk:
    """Chunks one behind the other, so many cases of them."""
    first = chunks[0]

    def columns(kind: str) -> dict[str, Any]:
        """Values, or results, of all chunks, by their names."""
        return {
            name: np.concatenate([getattr(one, kind)[name] for one in chunks])[:cases] for name in getattr(first, kind)
        }

    reason = np.concatenate([one.reason for one in chunks])[:cases]
    return Chunk(first.first, columns("values"), columns("results"), reason)
