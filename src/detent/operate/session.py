"""A live axis in this process: its host, asked in words by several clients."""

import threading
from collections.abc import Mapping
from typing import Any

from detent.control import operation as ops
from detent.errors import DetentError
from detent.operate.host import Host
from detent.operate.words import WORDS, Ended, ended, status_of, value_of

STEP = 2e-3  # how often an ending is looked for [s]


class Session:
    """Takes commands in words and tells how they end; every method may be called from any thread."""

    def __init__(self, host: Host, about: Mapping[str, Any]) -> None:
        self.host, self.about = host, dict(about)
        self.unit = host.axis.unit
        self._lock = threading.Lock()

    def describe(self) -> dict[str, Any]:
        """What does not change: name, method, unit, period, commands."""
        offered = self.host.axis.live.operation.takes
        words = [word for word, (kind, *_) in WORDS.items() if offered >> kind & 1]
        q = self.host.axis.live.operation
        limits = None if q.endless else [q.lowest, q.highest]
        period = self.host.board.loop.period * 1e-9
        facts = [] if self.host.link is None else [str(fact) for fact in self.host.link.facts]
        return self.about | {"drive": facts, "unit": self.unit, "period": period, "commands": words, "limits": limits}

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
        about = value_of(WORDS[word], value, self.unit)
        with self._lock:
            self.host.note()  # of what nobody waits for, too: the loop keeps the last endings only
            return self.host.ask(WORDS[word].kind, about, speed, client=client, **more)

    def ending(self, command: int) -> Ended | None:
        """How a command has ended; None while it has not."""
        with self._lock:
            found = self.host.ending(command)
        if found is None:
            return None
        fault = self.host.axis.fault() if found.how == ops.FAILED else self.host.told(found.why)
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
        self.host.close()
