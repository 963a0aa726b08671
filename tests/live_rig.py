"""A store on a bench: sensors, a clock, a model of what it must keep, and memory in the place of a disk."""

import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from random import Random
from typing import Any

from detent.methods.position import PositionSensor, Sensed
from detent.operate.store import Store

BENCH = "bench"  # place of every store here, wherever its file lies
TRAVEL = 20_000  # counts
BAND = 4096


def clock() -> datetime:
    return datetime(2026, 11, 23, 12, 0, 0, tzinfo=UTC)


def sensor(kind: Sensed = Sensed.INCREMENTAL, *, held: bool = False, **other: Any) -> PositionSensor:
    made = {"sensor": "a ruler", "scale": 1e-6, "ends": (0.0, TRAVEL * 1e-6), "window": 5}
    made |= {"band": BAND} if kind is Sensed.BAND else {}
    return PositionSensor(kind=kind, held=held, **(made | other))


SENSORS = {
    "incremental": sensor(),
    "incremental, held": sensor(held=True),
    "band": sensor(Sensed.BAND),
    "band, held": sensor(Sensed.BAND, held=True),
    "band over the travel": sensor(Sensed.BAND, band=2 * TRAVEL),
    "absolute": sensor(Sensed.ABSOLUTE),
    "circle": sensor(Sensed.ABSOLUTE, ends=None, band=TRAVEL),
}


def read(made: PositionSensor, position: int, zero: int) -> int | None:
    """What a sensor shows of an axis that stands somewhere."""
    if made.kind is Sensed.INCREMENTAL:
        return None
    return (position - zero) % made.band if made.band else position - zero


def open_store(path: Path, made: PositionSensor = SENSORS["absolute"], **other: Any) -> Store:
    return Store(path, made, **({"clock": clock, "place": BENCH} | other))


@contextmanager
def memory_folder() -> Iterator[Path]:
    """A folder in memory where the system has one: a kill leaves there what it leaves on a disk, in less time."""
    memory = Path("/dev/shm")  # noqa: S108
    with tempfile.TemporaryDirectory(dir=memory if memory.is_dir() else None) as folder:
        yield Path(folder)


# ---- the position table as it ought to be

Table = dict[str, tuple[int, int]]


@dataclass
class Model:
    """Position table with undo, in the simplest form: whole copies."""

    table: Table = field(default_factory=dict)
    done: list[Table] = field(default_factory=list)
    undone: list[Table] = field(default_factory=list)

    def copy(self) -> "Model":
        return Model(dict(self.table), [*self.done], [*self.undone])

    def change(self, table: Table) -> None:
        self.done.append(self.table)
        self.table, self.undone = table, []

    def undo(self) -> None:
        if self.done:
            self.undone.append(self.table)
            self.table = self.done.pop()

    def redo(self) -> None:
        if self.undone:
            self.done.append(self.table)
            self.table = self.undone.pop()


def table_of(store: Store) -> Table:
    return {name: (one.counts, one.tolerance) for name, one in store.positions.items()}


def table_change(number: int, seed: int) -> tuple[Callable[[Store], object], Callable[[Model], None]]:
    """A change of the table by its number, of a store and of the model."""
    random = Random(f"{seed} {number}")
    # Counts of their own: no change leaves the table as it was, but to undo or redo where there is nothing.
    name, counts, kind = f"p{random.randrange(20)}", number % TRAVEL, random.randrange(10)
    entries = [(f"q{k}", counts, k) for k in random.sample(range(20), 8)]
    if kind == 0:
        return lambda store: store.undo(), Model.undo
    if kind == 1:
        return lambda store: store.redo(), Model.redo
    if kind == 2:
        return lambda store: store.take(entries), lambda model: model.change(
            model.table | {name: (counts, tolerance) for name, counts, tolerance in entries}
        )
    if kind == 3:

        def delete(store: Store) -> None:
            if name in store.positions:
                store.delete(name)

        def forget(model: Model) -> None:
            if name in model.table:
                model.change({other: entry for other, entry in model.table.items() if other != name})

        return delete, forget
    return lambda store: store.edit(name, counts, kind), lambda model: model.change(
        model.table | {name: (counts, kind)}
    )
