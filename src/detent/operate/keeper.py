"""The store of an axis that runs: marked before a motion can begin, parked after rest, trust as the loop has it.

Torque is motion that may come: a request that gives it waits until the mark is on the disk, outside the loop. Once the
torque is off and the axis has stood still for a while, it is parked. What the loop finds out about the position, a
reference or the loss of one, is kept as soon as it is seen; until then the store says less than is known, never more.
"""

import threading
from collections.abc import Callable, Generator
from contextlib import contextmanager
from typing import Any

from detent.control import operation as ops
from detent.control.axis_states import ENABLE_OPERATION, ENABLED, FAULT_REACTION, QUICK_STOP
from detent.errors import DiskError
from detent.methods.position import Sensed
from detent.operate.store import Store
from detent.operate.trust import Trust, Why

STILL = 0.1  # time without torque and without a count until the axis is parked [s]
LOOK = 0.02  # how often the axis is looked at [s]
POWERED = ENABLED, QUICK_STOP, FAULT_REACTION
TRUSTS = (Trust.UNKNOWN, Trust.RESTORED, Trust.REFERENCED)
BY_FILE, BY_HOMING, BY_WORD = "axis file", "homing", "a person's word"  # where a reference came from


class Keeper:
    """Keeps the store of an axis; every method may be called from any thread."""

    def __init__(self, store: Store, board: Any) -> None:
        self.store, self._board = store, board
        self.trouble = ""  # why something could not be written last, empty where all is kept
        self.lock = threading.RLock()
        self._trust = ops.NOT_KNOWN  # as the store has it
        self._asked = 0  # last request that may give torque
        self._marked = True  # as far as it is known, the axis may be in motion
        self._still_with: int = 0  # that request when it was first seen still and without torque; -1 it has torque
        self._last = self._parked = 0  # counts: where it was seen last, and where it was parked
        self._since = self._looked = self._fault = 0  # periods: since when it is still, and of the last look
        self._counted = dict.fromkeys(("moves", "distance", "enabled", "faults"), 0.0)
        self._left = threading.Event()
        self._thread: threading.Thread | None = None
        self._by = BY_HOMING  # where the next reference comes from

    # ---- when it begins and ends

    def begin(self, *, stated: bool) -> int:
        """Judge what was kept, now that the sensor can be read; gives the trust that the loop is to have.

        `stated`: the axis stands where its file says, so that with a store that has never seen it move, nothing is
        unknown about it.
        """
        store, counts = self.store, self._counts()
        judged = store.restore(self._reading(counts))
        with self.kept():
            if stated and judged.why is Why.NEW and store.aside is None:
                store.refer(counts, BY_FILE, self._reading(counts), Why.STATED)
            store.count(starts=1)
        self._last = self._parked = counts
        self._since = self._looked = int(self._board.loop.periods)
        self._marked = store.saved is not None and store.saved.moving
        self._trust = TRUSTS.index(store.trust)
        return self._trust

    def start(self, supervised: Callable[[Callable[[], None]], Callable[[], None]]) -> None:
        """Look at the axis again and again, in a thread of its own; `supervised` sees an error in it."""

        def look() -> None:
            while not self._left.wait(LOOK):
                self.look()

        self._thread = threading.Thread(target=supervised(look), name="store", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Let go of the store; an axis that still moves is not parked."""
        self._left.set()
        if self._thread is not None:
            self._thread.join()
        with self.lock:
            self.store.close()

    # ---- while it runs

    @contextmanager
    def marked(self, kind: int, value: float) -> Generator[bool]:
        """Around the writing of a request: the mark of motion is durable first, where the request may give torque.

        False where the mark could not be written: the request must not be.
        """
        if kind in (ops.MOVE_TO, ops.MOVE_BY, ops.GO):
            self._counted["moves"] += 1.0
        if kind in (ops.HOME, ops.TRUST):
            self._by = BY_HOMING if kind == ops.HOME else BY_WORD
        if kind != ops.ENABLE and not (kind == ops.ORDER and value == ENABLE_OPERATION):
            yield True
            return
        with self.lock:
            with self.kept():
                self.trouble = ""
                self.store.moving()
                self._marked = True
            yield not self.trouble
            self._asked = int(self._board.inbox.written)

    def look(self) -> bool:
        """Keep what has changed; gives whether the axis is parked.

        The loop goes on while it is looked at, and a busy machine may hold up these lines anywhere. So the order
        counts: the time before the axis, requests before the state that comes of them, the state before the place. Two
        looks that find no torque, the same place, and no request for torque between them, have an axis that stood.
        """
        with self.lock, self.kept():
            o, loop = self._board.operation, self._board.loop
            now, trust = int(loop.periods), int(o.trust)
            powered = int(o.taken) < self._asked or bool(o.opening) or int(o.state) in POWERED
            counts, far = self._counts(), self.store.sensor.window
            moved: bool = powered or self._asked != self._still_with or abs(counts - self._last) > far
            self._note(o, counts, (now - self._looked) * loop.period * 1e-9)
            if trust != self._trust:
                self._trust = trust
                self._follow(trust, counts)
            if moved:
                self._last, self._still_with, self._since = counts, -1 if powered else self._asked, int(loop.periods)
            elif self._marked and (now - self._since) * loop.period * 1e-9 >= STILL:
                self.store.parked(self._place(counts), **self._counted)
                self._counted, self._marked, self._parked = dict.fromkeys(self._counted, 0.0), False, counts
                self.trouble = ""
            if not self._marked and abs(counts - self._parked) > far:  # pushed by hand, or sinking
                self.store.moving()
                self._marked = True
            self._looked = now
        return not self._marked

    @property
    def place(self) -> int:
        """Where the axis is [count]."""
        return self._place(self._counts())

    def told(self) -> dict[str, Any]:
        """The store, for people; waits for no disk."""
        standing = self.store.standing.describe(self.store.sensor)
        aside = str(self.store.aside) if self.store.aside else ""
        return {"path": str(self.store.path), "position": standing, "aside": aside, "trouble": self.trouble}

    def _follow(self, trust: int, counts: int) -> None:
        """The loop trusts the position more, or less, than the store does."""
        store = self.store
        if trust == ops.NOT_KNOWN:
            store.distrust()
        elif trust == ops.REFERENCED:
            store.refer(self._place(counts), self._by, self._reading(counts))
        elif store.standing.why is Why.MOVED:
            store.confirm()

    def _note(self, o: Any, counts: int, seconds: float) -> None:
        """Way, time with torque, faults, for the counters."""
        counted = self._counted
        counted["distance"] += abs(counts - self._last)
        counted["enabled"] += seconds if o.state == ENABLED else 0.0
        counted["faults"] += 1.0 if o.fault and not self._fault else 0.0
        self._fault = int(o.fault)

    def _counts(self) -> int:
        return self.store.sensor.counts(self._board.operation.answer.position)

    def _place(self, counts: int) -> int:
        """The place that a count of a circle stands for."""
        return counts % self.store.sensor.band if self.store.sensor.is_circle else counts

    def _reading(self, counts: int) -> int | None:
        """What an absolute sensor shows there."""
        sensor = self.store.sensor
        if sensor.kind is Sensed.INCREMENTAL:
            return None
        return counts % sensor.band if sensor.band else counts

    @contextmanager
    def kept(self) -> Generator[None]:
        """A disk that takes nothing is trouble, which is told; a motion that runs goes on."""
        try:
            yield
        except DiskError as error:
            self.trouble = str(error)
