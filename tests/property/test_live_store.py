"""The store of a live axis against its model: any order of changes and starts, any reading of any sensor."""

from pathlib import Path
from tempfile import TemporaryDirectory

from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule
from tests.live_rig import SENSORS, TRAVEL, Model, open_store, read, table_of

from detent.methods.position import PositionSensor, Sensed
from detent.operate.positions import load_positions, save_positions
from detent.operate.rows import LARGEST, Position
from detent.operate.trust import Saved, Trust, Why, judge

NAMES = st.sampled_from(["1", "2", "loading", "é", "a,b"])
COUNTS = st.integers(0, TRAVEL)
READINGS = st.integers(-LARGEST, LARGEST) | st.integers(-2 * TRAVEL, 2 * TRAVEL)


class StoreMachine(RuleBasedStateMachine):
    """Starts, stops, motion and the table; the model knows what must be there and where the axis stands."""

    def __init__(self) -> None:
        super().__init__()
        memory = Path("/dev/shm")  # noqa: S108
        self.folder = TemporaryDirectory(dir=memory if memory.is_dir() else None)
        self.path = Path(self.folder.name, "axis.state")
        self.sensor, self.model = SENSORS["incremental, held"], Model()
        self.store = open_store(self.path, self.sensor)
        self.at, self.moving, self.known, self.moves = 0, False, False, 0

    def teardown(self) -> None:
        self.store.close()
        self.folder.cleanup()

    @rule(name=NAMES, counts=COUNTS, tolerance=st.integers(0, 9))
    def edit(self, name, counts, tolerance):
        self.store.edit(name, counts, tolerance)
        self.model.change(self.model.table | {name: (counts, tolerance)})

    @rule(entries=st.dictionaries(NAMES, COUNTS, min_size=1))
    def take(self, entries):
        self.store.take((name, counts, 1) for name, counts in entries.items())
        self.model.change(self.model.table | {name: (counts, 1) for name, counts in entries.items()})

    @precondition(lambda self: self.model.table)
    @rule(pick=st.randoms(use_true_random=False))
    def delete(self, pick):
        name = pick.choice(sorted(self.model.table))
        self.store.delete(name)
        self.model.change({other: entry for other, entry in self.model.table.items() if other != name})

    @rule()
    def undo(self):
        assert bool(self.store.undo()) == bool(self.model.done)
        self.model.undo()

    @rule()
    def redo(self):
        assert bool(self.store.redo()) == bool(self.model.undone)
        self.model.redo()

    @rule(counts=COUNTS)
    def home(self, counts):
        self.store.refer(counts, "index")
        self.at, self.known = counts, True

    @rule()
    def begin(self):
        self.store.moving()
        self.moving = True

    @precondition(lambda self: self.moving)
    @rule(counts=COUNTS)
    def rest(self, counts):
        self.store.parked(counts, moves=1)
        self.at, self.moving, self.moves = counts, False, self.moves + 1

    @rule()
    def distrust(self):
        self.store.distrust()
        self.known = False

    @rule()
    def start_again(self):
        self.store.close()
        self.store = open_store(self.path, self.sensor)
        judged = self.store.restore()
        self.known = self.known and not self.moving
        assert (judged.trust is Trust.RESTORED) == self.known
        if self.known:
            assert judged.counts == self.at

    @invariant()
    def nothing_is_lost(self):
        assert self.store.aside is None
        assert table_of(self.store) == self.model.table
        assert self.store.counters["moves"] == self.moves
        assert (self.store.trust is not Trust.UNKNOWN) == self.known


TestStore = StoreMachine.TestCase
TestStore.settings = settings(max_examples=20, stateful_step_count=25)


@given(
    st.sampled_from(sorted(SENSORS)),
    st.builds(Saved, st.booleans(), st.sampled_from(Trust), READINGS, st.none() | READINGS, st.booleans()),
    st.none() | READINGS,
)
def test_a_judgement_is_never_more_than_what_is_known(name, saved, reading):
    sensor = SENSORS[name]
    judged = judge(sensor, saved, reading)
    assert judged.trust in {Trust.UNKNOWN, Trust.RESTORED}
    assert (judged.counts is None) == (judged.trust is Trust.UNKNOWN)
    if judged.trust is Trust.UNKNOWN:
        return
    assert saved.trust is not Trust.UNKNOWN
    assert not saved.elsewhere
    if sensor.kind is Sensed.INCREMENTAL:
        assert sensor.held
        assert not saved.moving
        assert judged.counts == saved.counts
        return
    # The place is one that the sensor shows, within the travel, and no other is.
    low, high = sensor.reach
    period = sensor.band or (1 << 70)
    assert low <= judged.counts <= high
    assert (judged.counts - reading - saved.offset) % period == 0
    if not (sensor.held and not saved.moving) and not sensor.is_circle:
        assert not low <= judged.counts - period <= high
        assert not low <= judged.counts + period <= high
    if not saved.moving:
        away = abs(judged.counts - saved.counts)
        assert min(away, abs(away - sensor.band) if sensor.is_circle else away) <= sensor.window


@given(st.sampled_from(sorted(SENSORS)), COUNTS, st.integers(0, TRAVEL), st.booleans())
def test_a_place_that_is_accepted_is_where_the_axis_stands(name, left, stands, moving):
    """Whatever happened to the axis; one that is held was only moved if it was in motion."""
    sensor = SENSORS[name]
    if sensor.is_circle:
        left, stands = left % sensor.band, stands % sensor.band
    if sensor.held and not moving:
        stands = left
    judged = judge(sensor, Saved(moving, Trust.REFERENCED, left, 77), read(sensor, stands, 77))
    assert judged.counts in {None, stands}
    if sensor.kind is Sensed.ABSOLUTE:
        assert judged.shown == stands
        assert judged.why in {Why.READ, Why.UNIQUE, Why.MOVED}


@given(
    st.lists(st.integers(-(2**51), 2**51), min_size=1, max_size=5),
    st.sampled_from([1e-9, 1e-6, 25.4e-3 / 300, 5e-6 / 3]),
    st.sampled_from([0.0, 0.01, -0.3]),
    st.sampled_from([".csv", ".toml"]),
)
def test_any_table_comes_back_as_it_was(counts, scale, origin, kind):
    sensor = PositionSensor(sensor="any", kind=Sensed.INCREMENTAL, scale=scale, origin=origin)
    table = [Position(str(k), one, abs(one) % 1000, 0, "") for k, one in enumerate(counts) if abs(one * scale) < 1e6]
    if table:
        with TemporaryDirectory() as folder:
            file = save_positions(Path(folder, f"table{kind}"), table, sensor)
            assert load_positions(file, sensor) == [(one.name, one.counts, one.tolerance) for one in table]
