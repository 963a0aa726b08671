"""The position table of a live axis, under somebody's hand: teach, edit, rename, forget, undo, export, import.

Nothing of it moves the axis. A table is kept in the store of the axis, each change durable when it is told to be made;
who commands the axis changes it, others read it.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any, cast

from detent.control import operation as ops
from detent.errors import NOT_AT_REST, NOTHING_TO_UNDO, DetentError
from detent.files.text import short
from detent.operate.host import Host
from detent.operate.positions import load_positions, save_positions
from detent.operate.store import Store
from detent.operate.words import example_of
from detent.units import parse_quantity


class Places:
    """What is done with the table; each word gives a reason to refuse it, 0 where it is done."""

    def __init__(self, host: Host) -> None:
        self._host = host
        self._words: dict[str, Callable[[Store, Any], int]] = {
            "teach": self._teach, "edit": self._edit, "rename": self._rename, "forget": self._forget,
            "undo": self._undo, "redo": self._redo, "export": self._export, "import": self._import,
        }  # fmt: skip

    def rows(self) -> list[dict[str, Any]]:
        """The table, positions in SI units; a name that is a number stands as one, too."""
        keeper = self._host.keeper
        if keeper is None:
            return []
        with keeper.lock:
            sensor, held = keeper.store.sensor, list(keeper.store.positions.values())
        return [
            {"number": int(one.name) if one.name.isdecimal() else None, "name": one.name,
             "position": sensor.position(one.counts), "counts": one.counts,
             "tolerance": one.tolerance * sensor.scale, "taught": one.taught, "used": one.used}
            for one in sorted(held, key=lambda one: (not one.name.isdecimal(), one.name.zfill(20)))
        ]  # fmt: skip

    def do(self, word: str, value: object, client: int) -> int:
        """Do what a word says; gives a reason to refuse it, 0 where it is done."""
        keeper, o = self._host.keeper, self._host.board.operation
        if keeper is None:
            raise DetentError(
                f"{word}: got an axis that keeps nothing; expected: one with a store; start it without --no-store, "
                "from a file of your own"
            )
        if o.client not in (0, client) and word != "export":
            return ops.SECOND
        with keeper.lock:
            return self._words[word](keeper.store, value)

    def has(self, name: str) -> bool:
        """Whether there is a position of this name."""
        return any(row["name"] == name for row in self.rows())

    def place(self, name: str) -> float:
        """Where the axis is sent by a name of the table, which is noted there."""
        keeper: Any = self._host.keeper
        with keeper.lock:
            counts = keeper.store.position(name).counts
            with keeper.kept():
                keeper.store.used(name)
        return keeper.store.sensor.position(counts)

    def _teach(self, store: Store, value: object) -> int:
        o = self._host.board.operation
        if o.trust == ops.NOT_KNOWN:
            return ops.UNREFERENCED
        if not o.answer.rests:
            return NOT_AT_REST
        keeper: Any = self._host.keeper
        keeper.look()  # of a trust that the loop has gained since
        store.teach(_name(value), keeper.place)
        return 0

    def _edit(self, store: Store, value: object) -> int:
        name, text = _pair(value, "a name and a position", "5 mm")
        unit, sensor = store.sensor.unit, store.sensor
        try:
            position = parse_quantity(text, unit) if isinstance(text, str) else float(text)
        except (DetentError, TypeError, ValueError) as error:
            raise DetentError(f'edit "{short(name)}": {text!r} is not {example_of(unit)}') from error
        if not abs(position) < 1e9:
            raise DetentError(f'edit "{short(name)}": {text!r} is no place; expected: {example_of(unit)}')
        held = store.positions.get(name)
        store.edit(name, sensor.counts(position), held.tolerance if held else 0)
        return 0

    def _rename(self, store: Store, value: object) -> int:
        store.rename(*_pair(value, "a name and a new one", "load"))
        return 0

    def _forget(self, store: Store, value: object) -> int:
        store.delete(_name(value))
        return 0

    def _undo(self, store: Store, _value: object) -> int:
        return 0 if store.undo() else NOTHING_TO_UNDO

    def _redo(self, store: Store, _value: object) -> int:
        return 0 if store.redo() else NOTHING_TO_UNDO

    def _export(self, store: Store, value: object) -> int:
        save_positions(Path(_name(value)), store.positions.values(), store.sensor)
        return 0

    def _import(self, store: Store, value: object) -> int:
        store.take(load_positions(Path(_name(value)), store.sensor))
        return 0


def _name(value: object) -> str:
    """What a word is about: a name, a number that is one, or a file."""
    if isinstance(value, bool) or not isinstance(value, str | int) or value == "":
        raise DetentError(f'got {value!r}; expected: a name such as "load", or a number such as 3; give one')
    return str(value)


def _pair(value: object, what: str, example: str) -> tuple[str, Any]:
    """What a word with two values is about."""
    pair = cast("list[Any]", value if isinstance(value, list) else [])
    if len(pair) != 2:
        raise DetentError(f'got {value!r}; expected: {what}, such as ["3", "{example}"]; give both')
    return _name(pair[0]), pair[1]
