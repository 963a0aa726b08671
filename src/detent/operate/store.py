"""What survives of a live axis: where it stands and how far that may be trusted, its positions, constants, counters.

One file for each axis, beside the axis file. `moving` is durable before the first motion, `parked` after rest: of an
axis that was killed between them the position is unknown, unless its sensor tells. A file that does not fit the axis
file, or is damaged, is kept aside under another name; nothing is taken out of it unasked.
"""

import json
import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, replace
from datetime import datetime
from pathlib import Path
from typing import Any, Self

from detent.errors import DetentError, DiskError
from detent.files.text import did_you_mean, short
from detent.methods.position import PositionSensor
from detent.operate.opening import here, open_fitting
from detent.operate.rows import (
    COUNTERS,
    LARGEST,
    MOST_EDITS,
    MOST_POSITIONS,
    NAME,
    Constant,
    Counter,
    Edit,
    Meaning,
    Motion,
    Position,
    Reference,
    is_name,
)  # fmt: skip
from detent.operate.sealed import Change, Connect, connect
from detent.operate.trust import Judgement, Saved, Trust, Why, judge
from detent.record.evidence import now
from detent.units import format_place


class MarkError(DiskError):
    """The mark of motion cannot be written: no new motion may begin. One that runs goes on."""


class Store:
    """The store of one axis, for one process at a time, and one thread of it.

    Positions are int64 counts of `sensor`, which the axis file gives (`Method.sensors`). A store that is absent is
    made; one that does not fit is kept aside, and `aside` says so. Until `restore` has judged what was kept, the
    position is unknown. `clock` gives the time of day; `place` says where the store lies, if not where `here` does.
    """

    def __init__(
        self,
        path: Path | str,
        sensor: PositionSensor,
        *,
        clock: Callable[[], datetime] = now,
        place: str = "",
        connect: Connect = connect,
    ) -> None:
        self.path, self.sensor = Path(path), sensor
        self._clock, self._place = clock, place or here(self.path)
        self._file, self.aside = open_fitting(self.path, sensor, self._place, clock, connect)
        self._standing = Judgement(Trust.UNKNOWN, Why.NEW)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def close(self) -> None:
        """Let others open it; the journal stays as it is."""
        self._file.close()

    # ----------------------------------------------------------------------------------------------------- motion

    @property
    def trust(self) -> Trust:
        """Trust of the position."""
        return self._standing.trust

    @property
    def standing(self) -> Judgement:
        """Trust of the position, and why."""
        return self._standing

    @property
    def reference(self) -> Reference | None:
        """The last reference that was found."""
        return max(self._file.all(Reference), key=lambda one: one.number, default=None)

    @property
    def saved(self) -> Saved | None:
        """What was kept of the motion before; None before the first."""
        motion = next(iter(self._file.all(Motion)), None)
        if motion is None:
            return None
        reference, place = self.reference, self._file.get(Meaning, "place")
        offset = reference.counts - int(reference.reading) if reference and reference.reading else None
        elsewhere = place is None or place.text != self._place
        return Saved(motion.phase != "parked", Trust(motion.trust), motion.counts, offset, elsewhere)

    def restore(self, reading: int | None = None) -> Judgement:
        """Judge what was kept, with the present reading of an absolute sensor; once, before anything moves."""
        self._standing = judge(self.sensor, self.saved, reading)
        return self._standing

    def confirm(self) -> Judgement:
        """A person takes the place that an absolute sensor shows for the position of an axis that was moved."""
        standing = self._standing
        if standing.why is not Why.MOVED or standing.shown is None:
            raise DetentError(
                f"{self.path}: got a confirmation while the position is {standing.trust} ({standing.why}); expected: "
                "after a move while the power was off; home the axis"
            )
        self._standing = replace(standing, trust=Trust.RESTORED, counts=standing.shown)
        return self._standing

    def refer(self, counts: int, by: str, reading: int | None = None, why: Why = Why.REFERRED) -> Judgement:
        """A reference was found at a position; an absolute sensor gave this reading there."""
        last = self.reference
        at, number = self._now(), last.number + 1 if last else 1
        motion = next(iter(self._file.all(Motion)), None)
        with self._file.change() as change:
            if last:
                change.drop(Reference, last.number)
            change.put(Reference(number, by, counts, "" if reading is None else str(reading), at))
            # A mark of motion stays, and says from now on that the position was known.
            self._put_motion(change, motion.phase if motion else "parked", counts, Trust.REFERENCED)
        self._standing = Judgement(Trust.REFERENCED, why, counts)
        return self._standing

    def distrust(self) -> Judgement:
        """The position is not to be trusted any more: a sensor failed, steps were lost, an axis was pushed.

        It is unknown from this moment on, even where that cannot be written.
        """
        self._standing = Judgement(Trust.UNKNOWN, Why.DISTRUSTED)
        motion = next(iter(self._file.all(Motion)), None)
        if motion and motion.trust != Trust.UNKNOWN:
            with self._file.change() as change:
                self._put_motion(change, motion.phase, motion.counts, Trust.UNKNOWN)
        return self._standing

    def moving(self) -> None:
        """Mark the axis as in motion, durable when this returns; costs nothing where the mark stands already.

        `MarkError`: it could not be written, and no motion may begin.
        """
        motion = next(iter(self._file.all(Motion)), None)
        if motion and motion.phase == "moving" and motion.trust == self.trust and not self._is_elsewhere():
            return
        at = self._standing.counts if self._standing.counts is not None else motion.counts if motion else 0
        try:
            with self._file.change() as change:
                self._put_motion(change, "moving", at, self.trust)
        except DiskError as error:
            raise MarkError(f"{error}; until then no motion may begin") from error

    def parked(self, counts: int, **counted: float) -> None:
        """Keep where the axis has come to rest, and what it did on its way (arguments as of `count`)."""
        with self._file.change() as change:
            self._put_motion(change, "parked", counts, self.trust)
            self._put_counters(change, counted)
        if self.trust is not Trust.UNKNOWN:
            self._standing = replace(self._standing, counts=counts)

    def _put_motion(self, change: Change, phase: str, counts: int, trust: Trust) -> None:
        for other in ("moving", "parked"):
            change.drop(Motion, other)
        change.put(Motion(phase, trust, counts, self._now()))
        if self._is_elsewhere():
            change.put(Meaning("place", self._place))

    def _is_elsewhere(self) -> bool:
        place = self._file.get(Meaning, "place")
        return place is None or place.text != self._place

    # -------------------------------------------------------------------------------------------------- positions

    @property
    def positions(self) -> dict[str, Position]:
        """The position table, by name."""
        return {one.name: one for one in self._file.all(Position)}

    def position(self, name: str) -> Position:
        """An entry; `DetentError` where there is none."""
        found = self._file.get(Position, name)
        if found is None:
            remedy = did_you_mean(name, self.positions, "teach it first")
            raise DetentError(
                f'{self.path}: got the unknown position "{short(name)}"; expected: one of the table; {remedy}'
            )
        return found

    def teach(self, name: str, counts: int, tolerance: int = 0) -> Position:
        """Make a place that the axis stands at an entry, in the place of one of this name."""
        if self.trust is Trust.UNKNOWN:
            raise DetentError(
                f'{self.path}: got "{short(name)}" to teach while the position is unknown ({self._standing.why}); '
                "expected: once it is known; home the axis, or type the position in"
            )
        return self.edit(name, counts, tolerance)

    def edit(self, name: str, counts: int, tolerance: int = 0) -> Position:
        """Make a place that was typed in an entry, in the place of one of this name."""
        made = self._entry(name, counts, tolerance)
        self._change_table([made])
        return made

    def take(self, entries: Iterable[tuple[str, int, int]]) -> None:
        """Make many places entries in one step: name, counts, tolerance of each."""
        made = {entry[0]: self._entry(*entry) for entry in entries}
        self._change_table(made.values())

    def rename(self, name: str, to: str) -> Position:
        """Give an entry another name, which none has; all else of it stays."""
        made = replace(self._entry(to, self.position(name).counts, 0), **{**asdict(self.position(name)), "name": to})
        if to in self.positions:
            raise DetentError(f'{self.path}: got the name "{short(to)}", which there is; expected: a new one; give one')
        self._change_table([made], [name])
        return made

    def delete(self, name: str) -> None:
        """Take an entry out."""
        self.position(name)
        self._change_table((), [name])

    def used(self, name: str) -> None:
        """Note that the axis was sent to an entry; there is nothing to undo about it."""
        with self._file.change() as change:
            change.put(replace(self.position(name), used=self._now()))

    def undo(self) -> list[str]:
        """Take the last step of changes back; the names of its entries, none where there is nothing to undo."""
        return self._go_back(max((one.step for one in self._file.all(Edit) if not one.undone), default=0), undone=True)

    def redo(self) -> list[str]:
        """Make the last step that was undone again; the names of its entries, none where there is nothing to redo."""
        return self._go_back(min((one.step for one in self._file.all(Edit) if one.undone), default=0), undone=False)

    def _go_back(self, step: int, *, undone: bool) -> list[str]:
        edits = [one for one in self._file.all(Edit) if one.step == step]
        if not edits:
            return []
        held = self.positions
        with self._file.change() as change:
            for one in edits:
                text = one.before if undone else one.after
                if text:
                    entry = Position(**json.loads(text))
                    known = held.get(entry.name, entry)
                    change.put(replace(entry, used=max(entry.used, known.used)))
                else:
                    change.drop(Position, one.name)
                change.put(replace(one, undone=int(undone)))
        return [one.name for one in edits]

    def _entry(self, name: str, counts: int, tolerance: int) -> Position:
        """A new entry, checked."""
        if not is_name(name):
            got = f'{self.path}: got the name "{short(name)}"'
            raise DetentError(f"{got}; expected: {NAME}; give the position such a name")
        self._check_counts(f'the position "{name}"', counts)
        if not 0 <= tolerance <= LARGEST:
            raise DetentError(
                f'{self.path}: got a tolerance of {tolerance} counts for "{name}"; expected: 0 or more; give one'
            )
        held, reference = self._file.get(Position, name), self.reference
        number = reference.number if reference else 0
        return Position(name, counts, tolerance, number, self._now(), held.used if held else "")

    def _check_counts(self, what: str, counts: int) -> None:
        """Refuse a place where the axis cannot stand."""
        sensor = self.sensor
        low, high = sensor.reach or (-LARGEST - 1, LARGEST)
        if not low <= counts <= high:
            said = f"{format_place(sensor.position(counts), sensor.unit)} ({counts} counts)"
            ends = " to ".join(format_place(sensor.position(one), sensor.unit) for one in (low, high))
            raise DetentError(f"{self.path}: got {said} for {what}; expected: {ends}; give a place within the travel")

    def _change_table(self, made: Iterable[Position], gone: Iterable[str] = ()) -> None:
        """Put and drop entries in one step that can be undone; what was undone before cannot be redone after it."""
        made, held = list(made), self.positions
        if len({*held, *(one.name for one in made)}) > MOST_POSITIONS:
            raise DetentError(
                f"{self.path}: got a position beyond {MOST_POSITIONS}; expected: up to {MOST_POSITIONS}; delete some"
            )
        edits = self._file.all(Edit)
        kept = [one for one in edits if not one.undone]
        number, step = (kept[-1].number, kept[-1].step + 1) if kept else (0, 1)
        new = [(one.name, _json(held.get(one.name)), _json(one)) for one in made]
        new += [(name, _json(held[name]), "") for name in gone]
        # Of a step that would not be whole nothing is kept.
        room = max(0, MOST_EDITS - len(new))
        oldest = kept[len(kept) - room - 1].step if len(kept) > room else 0
        with self._file.change() as change:
            for one in edits:
                if one.undone or one.step <= oldest:
                    change.drop(Edit, one.number)
            for one in made:
                change.put(one)
            for name in gone:
                change.drop(Position, name)
            for k, (name, before, after) in enumerate(new, start=1):
                change.put(Edit(number + k, step, 0, name, before, after))

    # ------------------------------------------------------------------------------------- constants and counters

    @property
    def constants(self) -> dict[str, Constant]:
        """Constants that were identified, by name."""
        return {one.name: one for one in self._file.all(Constant)}

    def note(self, name: str, value: float, unit: str, source: str) -> None:
        """Keep an identified constant, in the place of one of this name."""
        if not math.isfinite(value):
            raise DetentError(
                f"{self.path}: got {value} for the constant {name}; expected: a finite number; identify it again"
            )
        with self._file.change() as change:
            change.put(Constant(name, value, unit, source, self._now()))

    @property
    def counters(self) -> dict[str, float]:
        """Moves, distance [count], time enabled [s], faults, starts."""
        held = {one.name: one.value for one in self._file.all(Counter)}
        return {name: held.get(name, 0) * (1e-6 if name == "enabled" else 1) for name in COUNTERS}

    def count(self, **counted: float) -> None:
        """Add to counters: `moves`, `distance` [count], `enabled` [s], `faults`, `starts`."""
        with self._file.change() as change:
            self._put_counters(change, counted)

    def _put_counters(self, change: Change, counted: Mapping[str, float]) -> None:
        for name, value in counted.items():
            if name not in COUNTERS or not 0 <= value < math.inf:
                raise DetentError(
                    f"{self.path}: got {name} = {value}; expected: {', '.join(COUNTERS)}, each 0 or more; correct it"
                )
            held = self._file.get(Counter, name)
            more = round(value * 1e6) if name == "enabled" else int(value)
            change.put(Counter(name, min((held.value if held else 0) + more, LARGEST)))

    def _now(self) -> str:
        return self._clock().isoformat(timespec="seconds")


def _json(entry: Position | None) -> str:
    made: dict[str, Any] = asdict(entry) if entry else {}
    return json.dumps(made) if made else ""
