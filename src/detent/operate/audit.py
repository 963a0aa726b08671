"""Who asked for what, and how that ended: appended line by line, by a thread of its own that a slow disk may delay."""

import json
import os
import queue
import threading
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

KEPT = 1000  # records in memory
WAITING = 10_000  # lines that the disk has not taken; more are lost, and counted


def now() -> datetime:
    """The time of day."""
    return datetime.now(UTC)


class Appender:
    """Lines for a file that only this user reads; where they cannot be written it says how many, but delays nobody."""

    def __init__(self, path: Path) -> None:
        self.path, self.lost, self.trouble = path, 0, ""
        self._waiting: queue.Queue[str | None] = queue.Queue(WAITING)
        self._thread = threading.Thread(target=self._write, name=path.name, daemon=True)
        self._thread.start()

    def add(self, line: str) -> None:
        """Add a line."""
        try:
            self._waiting.put_nowait(line)
        except queue.Full:
            self.lost += 1

    def flush(self) -> None:
        """Wait until the disk has taken what waits."""
        self._waiting.join()

    def close(self) -> None:
        """Let the disk take what waits, but not for ever."""
        with suppress(queue.Full):
            self._waiting.put(None, timeout=1.0)
        self._thread.join(2.0)

    def _write(self) -> None:
        while (line := self._waiting.get()) is not None:
            try:
                descriptor = os.open(self.path, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o600)
                with os.fdopen(descriptor, "a", encoding="utf-8") as file:
                    file.write(line)
            except OSError as error:
                self.lost += 1
                self.trouble = f"{self.path}: {error.strerror}"
            self._waiting.task_done()


class Audit:
    """Records of a session: the last ones in memory, all in a file where there is one."""

    def __init__(self, path: Path | None = None, clock: Callable[[], datetime] = now) -> None:
        self._clock = clock
        self._kept: deque[dict[str, Any]] = deque(maxlen=KEPT)
        self.file = Appender(path) if path else None

    def note(self, who: str, **what: Any) -> None:
        """Add a record."""
        record = {"at": self._clock().isoformat(timespec="milliseconds"), "who": who} | what
        self._kept.append(record)
        if self.file is not None:
            self.file.add(json.dumps(record) + "\n")

    def recent(self) -> dict[str, Any]:
        """The last records, where all are, and what is not there."""
        file = self.file
        where = {"file": str(file.path), "lost": file.lost, "trouble": file.trouble} if file else {"file": ""}
        return {"records": list(self._kept)} | where

    def close(self) -> None:
        """End its file."""
        if self.file is not None:
            self.file.close()
