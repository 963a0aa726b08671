import errno
import gc
import os
import resource
import shutil
import sqlite3
import subprocess
import sys
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from random import Random

import pytest
from tests.live_rig import SENSORS, TRAVEL, Model, memory_folder, open_store, table_of

from detent.errors import DetentError, DiskError
from detent.operate.rows import VERSION
from detent.operate.sealed import APPLICATION, DamagedError, StoreHeldError
from detent.operate.store import MarkError
from detent.operate.trust import Trust, Why

HELD = SENSORS["incremental, held"]
RULED = SENSORS["absolute"]


@pytest.fixture
def path():
    with memory_folder() as folder:
        yield folder / "axis.toml.state"


@pytest.fixture
def store(path):
    with open_store(path, HELD) as made:
        yield made


def again(store, **other):
    """The store as the next start finds it."""
    store.close()
    return open_store(store.path, store.sensor, **other)


# ---- motion


def test_a_new_store_knows_nothing(store):
    assert store.aside is None
    assert store.restore().why is Why.NEW
    assert store.saved is None
    assert store.positions == {}
    assert set(store.counters.values()) == {0}


def test_a_position_is_restored_after_rest_and_unknown_after_motion(store):
    store.refer(1000, "index")
    assert store.trust is Trust.REFERENCED
    store.moving()
    with again(store) as late:
        assert late.restore().why is Why.KILLED
        late.refer(2000, "index")
        late.moving()
        late.parked(3000)
        assert late.standing.counts == 3000
        with again(late) as later:
            assert later.restore().counts == 3000
            assert later.trust is Trust.RESTORED
            # Motion that begins with a restored position leaves no more than that.
            later.moving()
            later.parked(3500)
            assert later.saved.trust is Trust.RESTORED


def test_until_it_is_judged_a_position_is_unknown(store):
    store.refer(1000, "index")
    with again(store) as late:
        assert late.trust is Trust.UNKNOWN
        late.moving()
        late.parked(1000)
        assert late.restore().why is Why.UNREFERENCED


def test_the_mark_of_motion_is_written_once(store, monkeypatch):
    store.refer(1000, "index")
    written = []
    monkeypatch.setattr(type(store._file), "change", counting(type(store._file).change, written))
    for _ in range(5):
        store.moving()
    assert len(written) == 1
    store.refer(1010, "index")
    store.moving()
    assert len(written) == 2
    store.parked(1010)
    store.moving()
    assert len(written) == 4


def counting(function, calls):
    def call(*arguments):
        calls.append(arguments)
        return function(*arguments)

    return call


def test_a_position_that_is_distrusted_stays_so(store):
    store.refer(1000, "index")
    store.distrust()
    assert store.trust is Trust.UNKNOWN
    store.moving()
    store.parked(1000)
    with again(store) as late:
        assert late.restore().why is Why.UNREFERENCED


def test_an_absolute_sensor_does_not_bring_back_what_was_distrusted_or_never_known(path):
    with open_store(path, RULED) as store:
        store.refer(1000, "index", 923)
        store.moving()
        store.distrust()
        with again(store) as late:
            assert late.saved.moving
            assert late.restore(4923).why is Why.UNREFERENCED
            late.parked(5000)
            late.refer(5000, "index", 4923)
            with again(late) as later:  # which begins to move before it was judged
                later.moving()
                with again(later) as last:
                    assert last.restore(4923).why is Why.UNREFERENCED


def test_a_reference_at_rest_and_one_in_motion(path):
    with open_store(path, RULED) as store:
        store.moving()
        store.refer(1000, "index", 923)
        with again(store) as late:
            assert late.saved.moving
            assert late.restore(4923).counts == 5000
            assert late.standing.why is Why.UNIQUE
            late.parked(5000)
            late.refer(5002, "a person", 4925)
            assert late.reference.number == 2
            assert not late.saved.moving


def test_only_a_move_while_off_is_confirmed(store):
    with pytest.raises(DetentError, match="confirmation"):
        store.confirm()


def test_a_store_that_was_copied_keeps_its_table_and_no_position(path):
    with open_store(path, HELD) as store:
        store.refer(1000, "index")
        store.teach("1", 1000)
    copy = path.with_name("copy.state")
    shutil.copy(path, copy)
    with open_store(copy, HELD, place="another bench") as store:
        assert store.restore().why is Why.ELSEWHERE
        assert list(store.positions) == ["1"]
        store.moving()
        store.refer(1500, "index")
        store.parked(1500)
        with again(store, place="another bench") as late:
            assert late.restore().counts == 1500
    with open_store(path, HELD) as store:
        assert store.restore().counts == 1000


# ---- the table


def test_teach_edit_delete_undo_redo(store):
    with pytest.raises(DetentError, match="unknown"):
        store.teach("1", 5000)
    store.edit("1", 5000, 3)
    store.refer(1000, "index")
    store.teach("2", 6000)
    store.teach("1", 5500)
    store.delete("2")
    assert table_of(store) == {"1": (5500, 0)}
    assert [store.undo(), store.undo(), store.undo()] == [["2"], ["1"], ["2"]]
    assert table_of(store) == {"1": (5000, 3)}
    assert store.redo() == ["2"]
    store.edit("3", 1)
    assert store.redo() == []
    with again(store) as late:
        assert table_of(late) == {"1": (5000, 3), "2": (6000, 0), "3": (1, 0)}
        assert late.undo() == ["3"]
        assert [late.positions["1"].reference, late.positions["2"].reference] == [0, 1]


def test_when_a_position_was_used_is_not_undone(store):
    store.edit("1", 5000)
    store.edit("1", 6000)
    store.used("1")
    store.undo()
    assert store.position("1").used
    assert store.position("1").counts == 5000


def test_many_positions_are_one_step(store):
    store.edit("a", 1)
    store.take([("a", 2, 0), ("b", 3, 0), ("c", 4, 0)])
    assert sorted(store.undo()) == ["a", "b", "c"]
    assert table_of(store) == {"a": (1, 0)}


def test_what_can_be_undone_is_bounded_and_whole(store, monkeypatch):
    monkeypatch.setattr("detent.operate.store.MOST_POSITIONS", 10)
    monkeypatch.setattr("detent.operate.store.MOST_EDITS", 25)
    entries = [(f"p{k}", k, 0) for k in range(10)]
    model = Model()
    for number in range(4):
        entries = [(name, number, 0) for name, _, _ in entries]
        store.take(entries)
        model.change({name: (counts, tolerance) for name, counts, tolerance in entries})
    undone = 0
    while store.undo():
        model.undo()
        undone += 1
        assert table_of(store) == model.table
    assert undone == 2
    with pytest.raises(DetentError, match="up to 10;"):
        store.edit("one more", 1)


@pytest.mark.parametrize("name", ["", " 1", "1 ", "a\nb", "a\x1b[2J", "\u202eb", "x" * 81, "a\tb"])
def test_names_that_would_steer_or_be_lost_are_refused(store, name):
    with pytest.raises(DetentError, match="the name"):
        store.edit(name, 1)


@pytest.mark.parametrize(("counts", "tolerance"), [(-6, 0), (TRAVEL + 6, 0), (1 << 63, 0), (1, -1), (1, 1 << 63)])
def test_places_outside_the_travel_are_refused(store, counts, tolerance):
    with pytest.raises(DetentError):
        store.edit("1", counts, tolerance)
    assert store.positions == {}


def test_an_unknown_position_names_the_nearest(store):
    store.edit("loading", 1)
    with pytest.raises(DetentError, match='did you mean "loading"'):
        store.delete("lodaing")
    with pytest.raises(DetentError):
        store.used("2")


# ---- constants and counters


def test_constants_and_counters(store):
    store.note("friction", 7.5, "N", "run of Monday")
    store.note("friction", -0.0, "N", "run of Tuesday")
    store.count(starts=1, enabled=0.25)
    store.refer(0, "index")
    store.moving()
    store.parked(10, moves=1, distance=10, enabled=1.5)
    with again(store) as late:
        assert late.constants["friction"].source == "run of Tuesday"
        assert late.counters == {"moves": 1, "distance": 10, "enabled": 1.75, "faults": 0, "starts": 1}
    for value in (float("nan"), float("inf")):
        with open_store(store.path, HELD) as late, pytest.raises(DetentError, match="finite"):
            late.note("friction", value, "N", "a run")


@pytest.mark.parametrize("counted", [{"turns": 1}, {"moves": -1}, {"moves": float("nan")}, {"moves": float("inf")}])
def test_what_is_no_count_is_refused_and_nothing_is_kept(store, counted):
    store.refer(0, "index")
    store.moving()
    with pytest.raises(DetentError):
        store.parked(10, **counted)
    assert store.saved.moving


# ---- one opener


def test_a_second_opener_is_told_who_has_it(store):
    with pytest.raises(StoreHeldError, match=f"this process \\({os.getpid()}\\)"):
        open_store(store.path, HELD)
    script = (
        "import sys; from pathlib import Path; from tests.live_rig import *\n"
        "try: open_store(Path(sys.argv[1]), SENSORS['incremental, held'])\n"
        "except Exception as error: print(type(error).__name__, error.holder)"
    )
    command = [sys.executable, "-c", script, str(store.path)]
    told = subprocess.run(command, capture_output=True, text=True, check=True, cwd=Path(__file__).parents[3]).stdout
    assert told.startswith("StoreHeldError")
    if sys.platform == "linux":
        assert f"process {os.getpid()} (" in told
    # Nobody's attempt has let go of the lock or moved the file.
    store.edit("1", 1)
    with again(store) as late:
        assert late.aside is None
        assert table_of(late) == {"1": (1, 0)}


def test_a_store_that_was_forgotten_is_not_held(path):
    for _ in range(3):
        forgotten = open_store(path, HELD)
        forgotten._file._connection.close()
        del forgotten
        gc.collect()


@pytest.mark.parametrize("counts", [1 << 63, -(1 << 63) - 1])
def test_a_position_is_a_number_of_64_bits(store, counts):
    store.moving()
    for keep in (store.parked, lambda number: store.refer(number, "index")):
        with pytest.raises(DetentError, match="64 bits"):
            keep(counts)
    assert store.saved.moving


def test_a_store_that_is_taken_away_is_written_no_more(store):
    store.path.rename(store.path.with_name("elsewhere"))
    with pytest.raises(MarkError, match="removed or replaced"):
        store.moving()
    store.path.with_name("elsewhere").rename(store.path)
    store.moving()


# ---- damage


def filled(path):
    with open_store(path, HELD) as store:
        store.refer(1000, "index")
        store.moving()
        store.parked(5000, moves=1)
        store.teach("1", 5000, 2)
        store.teach("2", 6000, 2)
        store.note("friction", 7.5, "N", "a run")
        return table_of(store), store.saved, store.constants, store.counters, store.reference


def kept(store):
    return table_of(store), store.saved, store.constants, store.counters, store.reference


def check_damaged(path, good, content):
    """A damaged file is read as what was written, or kept aside as it is; True where it was."""
    for old in path.parent.iterdir():
        old.unlink()
    path.write_bytes(content)
    with open_store(path, HELD) as store:
        if store.aside is None:
            assert kept(store) == good
            return False
        assert store.aside.path.read_bytes() == content
        assert store.restore().why is Why.NEW
        assert all(good[0].get(one.name) == (one.counts, one.tolerance) for one in store.aside.positions)
        return True


def flip_bits(path, flips):
    good = filled(path)
    content = path.read_bytes()
    found = tries = 0
    for place, bit in flips(content):
        flipped = bytearray(content)
        flipped[place] ^= 1 << bit
        found += check_damaged(path, good, bytes(flipped))
        tries += 1
    return found, tries


def test_no_flipped_bit_gets_through(path, tried):
    """Most of the file is room that nothing stands in: half of the bits are of those that say something."""

    def some(content):
        random = Random(1)
        meant = [place for place, byte in enumerate(content) if byte]
        for k in range(200):
            yield (random.choice(meant) if k % 2 else random.randrange(len(content))), random.randrange(8)

    found, tries = flip_bits(path, some)
    assert found > 60
    tried("store", "a bit of the file, flipped", "kept aside, or read as written", tries)


@pytest.mark.long
def test_no_flipped_bit_of_any_byte_gets_through(path, tried):
    def every(content):
        return [(place, bit) for place, byte in enumerate(content) for bit in (range(8) if byte else (place % 8,))]

    found, tries = flip_bits(path, every)
    assert found > 5000
    tried("store", "each bit that says something, one of each other byte", "kept aside, or read as written", tries)


@pytest.mark.parametrize(
    ("damage", "reason"),
    [
        (lambda content: b"[axis]\n".ljust(len(content)), "first bytes"),
        (lambda content: content[:50], "first bytes"),
        (lambda content: content[:-4096], "SQLite"),
        (lambda content: content[:68] + b"\0\0\0\1" + content[72:], "another application"),
        (lambda content: content[:60] + (VERSION + 1).to_bytes(4, "big") + content[64:], f"version {VERSION + 1}"),
        (lambda content: content[:8192] + bytes(4096) + content[12288:], ""),
        # a free page that there is not, which the next change would write to
        (lambda content: content[:39] + b"\1" + content[40:], "SQLite"),
    ],
)
def test_what_is_no_store_is_kept_aside(path, damage, reason):
    good = filled(path)
    assert check_damaged(path, good, damage(path.read_bytes()))
    aside = next(one for one in path.parent.iterdir() if ".aside-20261123T120000Z" in one.name)
    with open_store(aside.rename(path), HELD) as store:
        assert reason in store.aside.reason
        assert reason in str(store.aside)


def test_an_empty_file_is_a_new_store(path):
    path.touch()
    with open_store(path, HELD) as store:
        assert store.aside is None
        assert store.restore().why is Why.NEW


@pytest.mark.parametrize(
    "sql",
    [
        "UPDATE motion SET counts = 4999",
        "UPDATE position SET counts = 1 WHERE name = '1'",
        "DELETE FROM position WHERE name = '1'",
        "DELETE FROM motion",
        "UPDATE meaning SET text = 'bench 2' WHERE name = 'place'",
        "UPDATE seal SET revision = revision - 1",
        "DELETE FROM seal",
        "UPDATE seal SET total = 'x'",
        "UPDATE seal SET revision = x'01'",
        "UPDATE position SET name = x'31' WHERE name = '1'",
        "UPDATE position SET seal = 'x' WHERE name = '1'",
        "CREATE TABLE other (a)",
        "ALTER TABLE counter ADD COLUMN more",
    ],
)
def test_what_another_program_changed_is_seen(path, sql):
    good = filled(path)
    with sqlite3.connect(path) as connection:
        connection.execute(sql)
    connection.close()
    assert check_damaged(path, good, path.read_bytes())


def test_entries_are_read_from_what_was_kept_aside(path):
    filled(path)
    with sqlite3.connect(path) as connection:
        connection.execute("UPDATE position SET counts = 1 WHERE name = '1'")
    connection.close()
    with open_store(path, HELD) as store:
        assert [(one.name, one.counts) for one in store.aside.positions] == [("2", 6000)]


def test_what_another_process_has_kept_aside_meanwhile_is_not_moved_again(path, monkeypatch):
    filled(path)
    good = path.read_bytes()
    path.write_bytes(b"x" * 200)

    def check(file, _version):
        if file.read_bytes() != good:
            file.rename(file.with_name("aside by another"))
            file.with_name("new").write_bytes(good)
            file.with_name("new").rename(file)
            raise DamagedError("as another process found as well")

    monkeypatch.setattr("detent.operate.sealed._check_head", check)
    with open_store(path, HELD) as store:
        assert store.aside is None
        assert store.restore().counts == 5000


def test_stores_that_are_kept_aside_do_not_replace_one_another(path):
    for number in range(3):
        path.write_bytes(b"x" * (200 + number))
        open_store(path, HELD).close()
    names = sorted(one.name for one in path.parent.iterdir() if "aside" in one.name)
    assert len(names) == 3


# ---- disks


@contextmanager
def full_disk(limit):
    """No file grows beyond so many bytes; no bytecode is written meanwhile, which would be cut short."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "dont_write_bytecode", True)
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, hard))
        try:
            yield
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def test_on_a_full_disk_no_motion_begins_and_one_that_runs_goes_on(store, tried):
    store.refer(1000, "index")
    store.teach("1", 1000)
    with full_disk(600):
        with pytest.raises(MarkError, match="no motion may begin"):
            store.moving()
        with pytest.raises(DiskError):
            store.teach("2", 2000)
        assert table_of(store) == {"1": (1000, 0)}
    store.moving()
    with full_disk(600):
        store.moving()  # the mark is there: motion goes on
        with pytest.raises(DiskError):
            store.parked(2000)
    assert store.trust is Trust.REFERENCED
    with again(store) as late:
        assert late.aside is None
        assert late.restore().why is Why.KILLED
        assert table_of(late) == {"1": (1000, 0)}
    tried("store", "disk full before and during a motion", "no new motion; the position unknown after it")


class FullDisk(sqlite3.Connection):
    """A connection to a disk that fills up at one statement of a change, after SQLite has begun it."""

    at = ""

    def execute(self, sql, *arguments):
        if FullDisk.at and sql.startswith(FullDisk.at):
            error = sqlite3.OperationalError("database or disk is full")
            error.sqlite_errorcode = sqlite3.SQLITE_FULL
            raise error
        return super().execute(sql, *arguments)


@pytest.mark.parametrize("at", ["BEGIN", "INSERT", "UPDATE seal", "COMMIT"])
def test_a_change_that_fails_anywhere_has_not_been(path, monkeypatch, at):
    def connect(file):
        return sqlite3.connect(file, timeout=0.0, isolation_level=None, factory=FullDisk)

    monkeypatch.setattr(FullDisk, "at", "")
    with open_store(path, HELD, connect=connect) as store:
        store.refer(1000, "index")
        FullDisk.at = at
        with pytest.raises(MarkError):
            store.moving()
        with pytest.raises(DiskError):
            store.edit("1", 1)
        FullDisk.at = ""
        assert not store.saved.moving
        store.edit("2", 2)
        with again(store) as late:
            assert late.aside is None
            assert table_of(late) == {"2": (2, 0)}


@pytest.mark.parametrize("where", ["no such folder/axis.state", "."])
def test_where_no_store_can_lie(tmp_path, where):
    with pytest.raises(DiskError, match="choose another place"):
        open_store(tmp_path / where, HELD)


def test_a_store_that_cannot_be_read_is_left_alone(path, monkeypatch):
    filled(path)

    def refuse(*_):
        raise OSError(errno.EIO, "input/output error")

    monkeypatch.setattr(Path, "open", refuse)
    with pytest.raises(DiskError, match="input/output"):
        open_store(path, HELD)
    monkeypatch.undo()
    assert [one.name for one in path.parent.iterdir()] == [path.name]


def test_the_file_says_whose_it_is(path):
    filled(path)
    assert path.read_bytes()[68:72] == APPLICATION.to_bytes(4, "big")
    assert replace(HELD, id="7") != HELD
