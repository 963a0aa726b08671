"""Live specification, section 8, tests 33 to 36: what survives a kill, a power cut, an edit, a push by hand."""

import _sqlite3
import json
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from tests.live_rig import SENSORS, memory_folder, open_store, read, table_of
from tests.power_cut import RecordingDisk, images

from detent.methods.load import load_spec
from detent.methods.position import Sensed
from detent.methods.registry import METHODS
from detent.operate.opening import meanings, store_path
from detent.operate.store import Store
from detent.operate.trust import Trust, Why

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = ROOT / "src" / "detent" / "examples"
RANK = {Trust.UNKNOWN: 0, Trust.RESTORED: 1, Trust.REFERENCED: 2}

# ---- 33: kills


def kill(kills: int) -> Counter[str]:
    """Kills by two processes that do nothing else; whatever is not as it must be ends one of them."""
    with memory_folder() as one, memory_folder() as other:
        command = [sys.executable, "-m", "tests.live_kills", str(kills // 2)]
        started = [
            subprocess.Popen([*command, str(seed), str(folder)], cwd=ROOT, stdout=subprocess.PIPE, text=True)
            for seed, folder in enumerate((one, other))
        ]
        told = sum((Counter(json.loads(process.communicate()[0] or "{}")) for process in started), Counter())
        assert [process.returncode for process in started] == [0, 0]
    return told


def check_kills(told: Counter[str]) -> None:
    """Of the judgements that a kill can lead to, each came about; most hosts had begun to move."""
    assert told["in motion or ready"] > 0.4 * told["kills"]
    assert told["changes"] > 0.3 * told["kills"]
    for why in (Why.PARKED, Why.READ, Why.UNIQUE, Why.KILLED, Why.NOT_HELD, Why.AMBIGUOUS, Why.MOVED, Why.UNREFERENCED):
        assert told[why.name] > 0, why


@pytest.mark.wide
@pytest.mark.skipif(sys.platform == "win32", reason="processes are forked")
def test_33_no_wrong_position_and_no_lost_row_after_a_thousand_kills(tried):
    told = kill(1000)
    check_kills(told)
    tried("store", "host killed while it wrote and moved", "no wrong position taken, no change lost", told["kills"])


@pytest.mark.long
@pytest.mark.skipif(sys.platform == "win32", reason="processes are forked")
def test_33_no_wrong_position_and_no_lost_row_after_fifty_thousand_kills():
    check_kills(kill(50_000))


# ---- 34: power cuts


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


@needs_library
def test_34_a_power_cut_at_every_sync_leaves_old_or_new():
    with memory_folder() as folder:
        told = cut_everywhere("incremental, held", 0, folder)
    assert told["cuts"] > 150
    assert min(told["old"], told["new"], told[Trust.UNKNOWN], told[Trust.RESTORED]) > 5


@needs_library
@pytest.mark.parametrize("synchronous", ["OFF", "NORMAL"])
def test_34_a_protocol_that_syncs_less_is_found_out(synchronous):
    with memory_folder() as folder, pytest.raises(AssertionError):
        cut_everywhere("incremental, held", 4, folder, synchronous)


@needs_library
@pytest.mark.wide
@pytest.mark.parametrize("name", ["incremental, held", "absolute", "band, held", "circle"])
def test_34_a_power_cut_with_writes_torn_and_lost_leaves_old_or_new(name, tried):
    with memory_folder() as folder:
        told = cut_everywhere(name, 8, folder)
    assert told["disks"] > 1000
    assert min(told["old"], told[Trust.UNKNOWN], told[Trust.RESTORED]) > 300
    # A change is new before it is told to be made only while its journal is being cut off.
    assert told["new"] > 5
    tried("store", "power cut, writes lost and torn", "old or new, never more trusted", told["disks"])


# ---- 35: the axis file


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


@pytest.mark.parametrize("edit", EDITS)
def test_35_a_store_of_another_axis_is_kept_aside_and_both_are_shown(tmp_path, edit):
    made, path = SENSORS["absolute"], tmp_path / "axis.toml.state"
    taught_store(path, made)
    before, other = path.read_bytes(), replace(made, **EDITS[edit])
    with open_store(path, other) as store:
        assert store.restore(4923) == store.standing
        assert store.standing.why is Why.NEW
        assert store.positions == {}
        aside = store.aside
        assert aside is not None
        assert aside.path.read_bytes() == before
        names = {name: pair for name, pair in aside.differs.items() if not (edit == "scale" and name == "travel")}
        expected = {"scale": "scale", "origin": "scale", "travel": "travel"}.get(edit, "sensor")
        assert names == {expected: (meanings(made)[expected], meanings(other)[expected])}
        assert all(text in str(aside) for pair in aside.differs.values() for text in pair)
        assert [one.counts for one in aside.positions] == [5000]
    # What was kept aside is still the store of the axis that it was made for.
    aside.path.rename(path)
    with open_store(path, made) as store:
        assert store.aside is None
        assert store.restore(4923).counts == 5000


def test_35_an_edit_of_gains_keeps_the_position(tmp_path):
    file = EXAMPLES / "cascade.toml"
    before = sensors_of(file)
    assert sensors_of(file, "method.position_gain=31", "limits.speed=0.1 m/s") == before
    other = {"encoder.resolution=3 um": "scale", "limits.travel=0.71 m": "travel"}
    for override, name in other.items():
        after = sensors_of(file, override)
        assert [key for key in before if before[key] != after[key]] == [name]
    assert store_path(tmp_path / file.name).name == "cascade.toml.state"


def sensors_of(file: Path, *overrides: str) -> dict[str, str]:
    spec = load_spec(file, overrides)
    return meanings(METHODS[spec.axis.method].sensors(spec)[""])


# ---- 36: moved while off


@pytest.mark.parametrize("name", [name for name, made in SENSORS.items() if made.kind is not Sensed.INCREMENTAL])
@pytest.mark.parametrize("moved", [6, -6, 700, -1500])
def test_36_an_axis_that_was_moved_while_off_is_not_restored_and_the_distance_is_shown(tmp_path, name, moved):
    made, path = SENSORS[name], tmp_path / "axis.state"
    taught_store(path, made)
    with open_store(path, made) as store:
        assert store.restore(read(made, 5000, 77)).trust is (Trust.UNKNOWN if name == "band" else Trust.RESTORED)
        assert store.restore(read(made, 5000 + made.window, 77)).distance == made.window
        judged = store.restore(read(made, 5000 + moved, 77))
        assert (judged.trust, judged.counts) == (Trust.UNKNOWN, None)
        assert (judged.shown, judged.distance) == (5000 + moved, moved)
        assert judged.why is (Why.AMBIGUOUS if name == "band" else Why.MOVED)
        assert f"{moved} um" in judged.describe(made) or f"{moved / 1000} mm" in judged.describe(made)
        if name != "band":
            assert store.confirm().counts == 5000 + moved
            assert store.trust is Trust.RESTORED
