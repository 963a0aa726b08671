"""A live axis in this process: its host, asked in words by several clients."""

import threading
from collections.abc import Mapping
from typing import Any

from detent.control import operation as ops
from detent.errors import DetentError
from detent.operate.faults import injection_of, injections
from detent.operate.host import Host
from detent.operate.words import WORDS, Ended, ended, status_of, value_of

STEP = 2e-3  # how often an ending is looked for [s]
NOTE = 0.5  # how often what nobody asks for is taken down [s]


class Session:
    """Takes commands in words and tells how they end; every method may be called from any thread."""

    def __init__(self, host: Host, about: Mapping[str, Any]) -> None:
        self.host, self.about = host, dict(about)
        self.unit = host.axis.unit
        self._lock, self._left = threading.Lock(), threading.Event()
        if host.is_running:
            threading.Thread(target=self._keep_noting, name="notes", daemon=True).start()

    def _keep_noting(self) -> None:
        """Take note of faults, and of what came from outside, before the loop's memory of it has come round."""
        while not self._left.wait(NOTE):
            with self._lock:
                self.host.note()

    def describe(self) -> dict[str, Any]:
        """What does not change: name, method, unit, period, commands."""
        offered = self.host.axis.live.operation.takes
        can_inject = injections(self.host.axis.places)
        words = [word for word, (kind, *_) in WORDS.items() if offered >> kind & 1 or (word == "inject" and can_inject)]
        q = self.host.axis.live.operation
        limits = None if q.endless else [q.lowest, q.highest]
        period = self.host.board.loop.period * 1e-9
        about = {"unit": self.unit, "period": period, "commands": words, "limits": limits}
        return self.about | about | {"injections": can_inject}

    def status(self) -> dict[str, Any]:
        """The axis now."""
        return status_of(self.host, self.host.axis.fault())

    def ask(self, word: str, value: object = None, speed: float = 1.0, *, client: int = 1, **more: int) -> int:
        """Ask for something; gives the id under which it will end. A `DetentError` where it makes no sense."""
        if word not in WORDS:
            raise DetentError(f"no command {word!r}; there are {', '.join(WORDS)}")
        if word == "stop":
            self.host.stop()
        if word == "disable":
            self.host.off()
        kind = WORDS[word].kind
        if word == "inject":
            kind, about = injection_of(self.host.axis.places, value)
        else:
            about = value_of(WORDS[word], value, self.unit)
        with self._lock:
            self.host.note()  # of what nobody waits for, too: the loop keeps the last endings only
            return self.host.ask(kind, about, speed, client=client, **more)

    def faults(self) -> list[dict[str, Any]]:
        """The last faults, the first of them first."""
        with self._lock:
            self.host.note()
            return [one.to_dict() for one in self.host.faults.records]

    def fault_trace(self, number: int) -> dict[str, list[float]]:
        """Columns of the ring from 2 s before to 2 s after a fault."""
        with self._lock:
            self.host.note()
            return self.host.faults.trace(number)

    def ending(self, command: int) -> Ended | None:
        """How a command has ended; None while it has not."""
        with self._lock:
            found = self.host.ending(command)
        if found is None:
            return None
        fault = self.host.axis.fault() if found.how == ops.FAILED else ""
        return ended(found.id, found.how, found.why, found.by, fault)

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
        self._left.set()
        self.host.close()
