"""A live axis in this process: its host, asked in words by several clients."""

import threading
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from detent.control import operation as ops
from detent.errors import NO_MARK, DetentError
from detent.operate.host import Host
from detent.operate.places import Places
from detent.operate.words import PLACES, WORDS, Ended, ended, status_of, value_of

STEP = 2e-3  # how often an ending is looked for [s]


class Session:
    """Takes commands in words and tells how they end; every method may be called from any thread."""

    def __init__(self, host: Host, about: Mapping[str, Any]) -> None:
        self.host, self.about = host, dict(about)
        self.unit = host.axis.unit
        self._lock, self._places = threading.Lock(), Places(host)

    def describe(self) -> dict[str, Any]:
        """What does not change: name, method, unit, period, commands."""
        words = [word for word, (kind, *_) in WORDS.items() if self._takes(kind)]
        if self.host.keeper is not None:
            words += [word for word in ("go_to", *PLACES) if word not in words]
        q = self.host.axis.live.operation
        limits = None if q.endless else [q.lowest, q.highest]
        period = self.host.board.loop.period * 1e-9
        return self.about | {"unit": self.unit, "period": period, "commands": words, "limits": limits}

    def status(self) -> dict[str, Any]:
        """The axis now."""
        keeper = self.host.keeper
        kept = {"store": keeper.told() if keeper else None, "find": self.find_position()}
        return status_of(self.host, self.host.axis.fault()) | kept

    def find_position(self) -> str:
        """The command that makes a position known: to home, or of an axis that cannot a person's word for it."""
        return "home" if self._takes(ops.HOME) else f"trust {ops.REFERENCED}"

    def ask(self, word: str, value: object = None, speed: float = 1.0, *, client: int = 1, **more: int) -> int:
        """Ask for something; gives the id under which it will end. A `DetentError` where it makes no sense."""
        if word in PLACES:
            return self.host.settle(self._places.do(word, value, client))
        if word not in WORDS:
            raise DetentError(f"no command {word!r}; there are {', '.join((*WORDS, *PLACES))}")
        if word == "go_to" and (place := self._place_of(value)) is not None:
            word, value = "move_to", place
        if word == "stop":
            self.host.stop()
        if word == "disable":
            self.host.off()
        about = value_of(WORDS[word], value, self.unit)
        with self._lock:
            self.host.note()  # of what nobody waits for, too: the loop keeps the last endings only
        return self.host.ask(WORDS[word].kind, about, speed, client=client, **more)  # may wait for the disk

    def positions(self) -> list[dict[str, Any]]:
        """The position table: number, name, position, counts, tolerance, taught and used of each; SI units."""
        return self._places.rows()

    def edit_position(self, name: str, position: str) -> int:
        """Type a position in, as "5 mm" or "0.2 in"; gives the id under which that has ended."""
        return self.ask("edit", [name, position])

    def undo_position(self) -> int:
        """Take the last change of the position table back; gives the id under which that has ended."""
        return self.ask("undo")

    def _place_of(self, value: object) -> float | None:
        """Where a position of the table is; None where the method itself knows that number, or is to say what it is."""
        if self.host.keeper is None or isinstance(value, bool) or not isinstance(value, str | int | float):
            return None
        name = value.strip() if isinstance(value, str) else f"{value:g}"
        numbers = self.host.axis.numbers
        if numbers is not None and name.isdecimal() and (int(name) in numbers or not self._places.has(name)):
            return None
        return self._places.place(name)

    def _takes(self, kind: int) -> bool:
        return bool(self.host.axis.live.operation.takes >> kind & 1)

    def ending(self, command: int) -> Ended | None:
        """How a command has ended; None while it has not."""
        with self._lock:
            found = self.host.ending(command)
        if found is None:
            return None
        fault = self.host.axis.fault() if found.how == ops.FAILED else ""
        told = ended(found.id, found.how, found.why, found.by, fault)
        trouble = self.host.keeper.trouble if self.host.keeper and found.why == NO_MARK else ""
        return replace(told, reason=f"{told.reason} ({trouble})") if trouble else told

    def wait(self, command: int, timeout: float | None = None) -> Ended:
        """Wait until a command has ended; a `TimeoutError` where it has not in time [s]."""
        pause, waited = threading.Event(), 0.0
        while (found := self.ending(command)) is None:
            if timeout is not None and waited >= timeout:
                raise TimeoutError(f"command {command} has not ended within {timeout:g} s")
            if self.host.is_running:
                pause.wait(STEP)
            else:
                self.host.run(1)
            waited += STEP
        return found

    def close(self) -> None:
        """Come to rest, take the torque away, end the loop."""
        self.host.close()
