"""Rigs of live tests 33 to 36: kills counted, every disk that a power cut leaves, axis files that were edited."""

import _sqlite3
import json
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest

from detent.methods.load import load_spec
from detent.methods.registry import METHODS
from detent.operate.opening import meanings
from detent.operate.store import Store
from detent.operate.trust import Trust, Why
from tests.live_rig import SENSORS, open_store, read, table_of
from tests.places import ROOT
from tests.power_cut import RecordingDisk, images

RANK = {Trust.UNKNOWN: 0, Trust.RESTORED: 1, Trust.REFERENCED: 2}


def kill(kills: int) -> Counter[str]:
    """Kills by a process that does nothing else; whatever is not as it must be ends it."""
    command = [sys.executable, "-m", "tests.live_kills", str(kills)]
    done = subprocess.run(command, cwd=ROOT, stdout=subprocess.PIPE, text=True, check=False)
    assert done.returncode == 0
    return Counter(json.loads(done.stdout))


def check_kills(told: Counter[str]) -> None:
    """Of the judgements that a kill can lead to, each came about; most hosts had begun to move."""
    assert told["in motion or ready"] > 0.4 * told["kills"]
    assert told["changes"] > 0.3 * told["kills"]
    for why in (Why.PARKED, Why.READ, Why.UNIQUE, Why.KILLED, Why.NOT_HELD, Why.AMBIGUOUS, Why.MOVED, Why.UNREFERENCED):
        assert told[why.name] > 0, why


def protocol(store: Store, name: str) -> Iterator[tuple[str, int | None]]:
    """What a host writes in a day: what was done, and where the axis stands then, None while it may move."""
    made = SENSORS[name]

    def shown(position: int) -> int | None:
        return read(made, position, 77)

    store.restore(shown(500))
    yield "begun", 500
    store.moving()
    yield "search", None
    store.refer(1000, "index", shown(1000))
    yield "referenced", None
    store.parked(1000)
    yield "at rest", 1000
    store.teach("1", 1000, 3)
    yield "taught", 1000
    store.take([("2", 4000, 0), ("3", 5000, 1), ("1", 1001, 2)])
    yield "imported", 1000
    store.moving()
    yield "under way", None
    store.used("2")
    yield "sent", None
    store.parked(4000, moves=1, distance=3000)
    yield "arrived", 4000
    store.undo()
    yield "undone", 4000
    store.note("friction", 7.5, "N", "a run")
    yield "identified", 4000
    store.moving()
    yield "under way again", None
    store.distrust()
    yield "sensor lost", None
    store.parked(4400)
    yield "at rest, unknown", 4400


def snapshot(store: Store) -> tuple[object, ...]:
    """All that is kept."""
    return (table_of(store), store.saved, store.reference, store.constants, store.counters, store.positions)


def cut_everywhere(name: str, tears: int, folder: Path, synchronous: str = "FULL") -> Counter[str]:
    """Make every disk that a cut can leave, at every event of the protocol, and open it."""
    disk, made, told = RecordingDisk(synchronous), SENSORS[name], Counter[str]()
    path = folder / "recorded.state"
    marks: list[tuple[int, tuple[object, ...], int | None]] = []
    with open_store(path, made, connect=disk.connect) as store:
        marks += [(len(disk.events), snapshot(store), position) for _, position in protocol(store, name)]
    with open_store(folder / "empty.state", made) as store:
        marks.insert(0, (-1, snapshot(store), None))
    seen: set[object] = set()
    for cut in range(len(disk.events) + 1):
        acknowledged = max(k for k, (end, *_) in enumerate(marks) if end <= cut)
        told["cuts"] += 1
        for image in images(disk.events, cut, tears):
            key = (acknowledged, *sorted(image.items()))
            if key not in seen:
                seen.add(key)
                told["disks"] += 1
                look(folder / "cut", image, marks, acknowledged, name, told)
    return told


def look(folder: Path, image: dict[str, bytes], marks, acknowledged: int, name: str, told: Counter[str]) -> None:
    """Open what a cut left: all old or all new, and nothing trusted that is not so."""
    folder.mkdir(exist_ok=True)
    for old in folder.iterdir():
        old.unlink()
    for file, content in image.items():
        (folder / file).write_bytes(content)
    following = min(acknowledged + 1, len(marks) - 1)
    # Where the axis can stand: it moves from the moment in which the mark was told to be there.
    _, old, position = marks[acknowledged]
    places = [500] if acknowledged == 0 else [position] if position is not None else []
    if position is None and acknowledged and marks[following][2] is not None:
        places = [marks[following][2]]
    here = places[0] if places else 2222
    with open_store(folder / "recorded.state", SENSORS[name]) as store:
        assert store.aside is None
        found = snapshot(store)
        assert found in (old, marks[following][1]), (acknowledged, found)
        told["new" if found != old else "old"] += 1
        judged = store.restore(read(SENSORS[name], here, 77))
        assert RANK[judged.trust] <= min(RANK[Trust.RESTORED], RANK[store.saved.trust] if store.saved else 0)
        if judged.trust is not Trust.UNKNOWN:
            assert judged.counts == here
        told[judged.trust] += 1


needs_library = pytest.mark.skipif(
    not hasattr(_sqlite3, "__file__") or sys.platform in {"win32", "darwin"}, reason="SQLite is not a library here"
)


def taught_store(path: Path, made) -> None:
    with open_store(path, made) as store:
        store.refer(1000, "index", read(made, 1000, 77))
        store.moving()
        store.parked(5000)
        store.teach("1", 5000, 2)


EDITS = {
    "scale": {"scale": 2e-6, "ends": (0.0, 0.04)},
    "origin": {"origin": 1e-3},
    "travel": {"ends": (0.0, 0.03)},
    "sensor": {"sensor": "another ruler"},
    "hardware": {"id": "serial number 2"},
    "brake": {"held": True},
}


def sensors_of(file: Path, *overrides: str) -> dict[str, str]:
    spec = load_spec(file, overrides)
    return meanings(METHODS[spec.axis.method].sensors(spec)[""])
