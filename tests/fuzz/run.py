"""Damaged inputs by their numbers, given to a reader one after the other; what it does wrong is told by its place."""

import signal
import sys
import tempfile
import time
import traceback
import warnings
from collections.abc import Generator, Iterable
from contextlib import contextmanager
from pathlib import Path
from random import Random
from types import FrameType

from detent.errors import DetentError
from detent.files import apart
from tests.fuzz.mutate import mutate
from tests.fuzz.targets import Target

SECONDS = 20.0  # for one input; a process of its own gets 5
HERE = Path(__file__).parent
FOUND = HERE / "found"
PACKAGE = HERE.parents[1] / "src"


class LateError(BaseException):
    """An input takes too long; no reader catches it."""


@contextmanager
def in_time() -> Generator[None]:
    """What stands here ends within `SECONDS`, where the system can see to it."""

    def late(_: int, __: FrameType | None) -> None:
        raise LateError

    if not hasattr(signal, "SIGALRM"):
        yield
        return
    before = signal.signal(signal.SIGALRM, late)
    signal.setitimer(signal.ITIMER_REAL, SECONDS)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)


def fault(target: Target, path: Path, data: bytes) -> str:
    """What a reader does wrong about an input: the error and its place; empty where nothing is wrong."""
    path.write_bytes(data)
    try:
        with in_time():
            target.read(path)
    except DetentError as error:
        return "" if str(error).strip() else "an error that says nothing"
    except (Exception, LateError) as error:  # noqa: BLE001 - that is the question
        frames = traceback.extract_tb(error.__traceback__)
        own = [frame for frame in frames if str(PACKAGE) in frame.filename] or frames
        place = f"{Path(own[-1].filename).name}:{own[-1].lineno} {own[-1].name}"
        return f"{type(error).__name__}: {str(error)[:100]} at {place}"
    return ""


def fuzz(target: Target, cases: Iterable[int], seconds: float = 1e9) -> tuple[int, dict[str, tuple[int, bytes]]]:
    """How many inputs were tried, and by what went wrong the number of one of them, and that itself."""
    found: dict[str, tuple[int, bytes]] = {}
    count, end = 0, time.monotonic() + seconds
    kept, apart.SECONDS = apart.SECONDS, 5.0
    try:
        with tempfile.TemporaryDirectory() as folder:
            seeds = target.seeds(Path(folder))
            path = Path(folder) / f"input{target.ending}"
            for case in cases:
                if time.monotonic() > end:
                    break
                count += 1
                data = mutate(Random(f"{target.name} {case}"), seeds, text=target.text)
                wrong = fault(target, path, data)
                if wrong:
                    place = wrong.rpartition(" at ")[2]
                    found.setdefault(f"{wrong.partition(':')[0]} at {place}" if place else wrong, (case, data))
    finally:
        apart.SECONDS = kept
    return count, found


def main(names: list[str]) -> None:
    """Run targets for so many seconds each, from a case on; keep what they find: `SECONDS FIRST TARGET...`."""
    from itertools import count

    from tests.fuzz.targets import TARGETS

    warnings.simplefilter("error")  # as in the tests
    seconds, first, *chosen = names
    for name in chosen or TARGETS:
        tried, found = fuzz(TARGETS[name], count(int(first)), float(seconds))
        sys.stdout.write(f"{name}: {tried} inputs, {len(found)} faults\n")
        for what, (case, data) in found.items():
            kept = FOUND / f"{TARGETS[name].file_name}-{case}{TARGETS[name].ending}"
            kept.write_bytes(data)
            sys.stdout.write(f"    {what} ({kept.name})\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main(sys.argv[1:])
