"""Every reader under damaged inputs: a few hundred here, a minute of each in `make test-long`, and all that was found.

`python -m tests.fuzz.run 60 0 "log hdf5"` does the same by hand and keeps what it finds in tests/fuzz/found;
``DETENT_FIRST_CASE`` begins the long run at other inputs, ``DETENT_FUZZ_SECONDS`` ends it earlier or later.
"""

import os
from itertools import count
from random import Random

import pytest

from detent.logs.read_log import READERS
from detent.methods.registry import METHODS
from tests.fuzz import run
from tests.fuzz.mutate import mutate
from tests.fuzz.run import FOUND, fault, fuzz
from tests.fuzz.targets import TARGETS, Target

pytestmark = pytest.mark.early


def tell(name, found):
    """What went wrong, and how to see it again."""
    lines = [f'{what}: python -m tests.fuzz.run 1 {case} "{name}"' for what, (case, _) in found.items()]
    return "\n".join(lines)


@pytest.mark.parametrize("name", TARGETS)
def test_damaged_inputs(name, tried):
    target = TARGETS[name]
    number, found = fuzz(target, range(target.cases))
    assert not found, tell(name, found)
    assert number == target.cases
    tried("reader", name, "a result or a sentence", number)


@pytest.mark.long
@pytest.mark.parametrize("name", TARGETS)
def test_damaged_inputs_for_a_minute(name):
    first, seconds = int(os.environ.get("DETENT_FIRST_CASE", "0")), float(os.environ.get("DETENT_FUZZ_SECONDS", "60"))
    number, found = fuzz(TARGETS[name], count(first), seconds)
    assert not found, tell(name, found)
    assert number > 0


@pytest.mark.parametrize("kept", sorted(path.name for path in FOUND.iterdir()))
def test_what_was_found_is_mended(tmp_path, kept):
    name = kept.partition(".")[0].rpartition("-")[0]
    (target,) = (target for target in TARGETS.values() if target.file_name == name)
    assert fault(target, tmp_path / f"input{target.ending}", (FOUND / kept).read_bytes()) == ""


def test_every_reader_has_a_target():
    endings = {target.ending.removesuffix(".gz") for target in TARGETS.values() if target.name.startswith("log ")}
    assert {READERS[ending] for ending in endings} == set(READERS.values())
    assert {f"axis {name}" for name in METHODS} <= TARGETS.keys()
    assert len(TARGETS) >= 26


def test_a_case_is_the_same_each_time():
    seeds = [b"t,x\n1,2\n3,4\n", b"a;b"]
    assert len({mutate(Random(f"x {k}"), seeds, text=True) for k in range(100)}) > 80
    assert mutate(Random("x 3"), seeds, text=True) == mutate(Random("x 3"), seeds, text=True)


def never_ends(_):
    while True:
        pass


def test_what_readers_do_wrong_is_told(monkeypatch):
    def reads(path):
        return {b"": 1}[path.read_bytes()[:0] + path.read_bytes()[:3]]

    target = Target("any", ".txt", reads, lambda _: [b"one", b"two"])
    tried, found = fuzz(target, range(50))
    assert tried == 50
    ((what, (case, data)),) = found.items()
    assert what.startswith("KeyError at test_fuzz.py:")
    assert fuzz(target, [case])[1][what][1] == data
    monkeypatch.setattr(run, "SECONDS", 0.05)
    ((what, _),) = fuzz(Target("any", ".txt", never_ends, lambda _: [b""]), [0])[1].items()
    assert what.startswith("LateError at")
