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
WAITING = 10_000  # that the disk has not taken; more are lost, and counted


def now() -> datetime:
    """The time of day."""
    return datetime.now(UTC)


class Audit:
    """Records of a session; a file that cannot be written loses them, and says how many, but delays nobody."""

    def __init__(self, path: Path | None = None, clock: Callable[[], datetime] = now) -> None:
        self.path, self._clock = path, clock
        self._kept: deque[dict[str, Any]] = deque(maxlen=KEPT)
        self._waiting: queue.Queue[str | None] = queue.Queue(WAITING)
        self.lost, self.trouble = 0, ""
        self._thread: threading.Thread | None = None
        if path is not None:
            self._thread = threading.Thread(target=self._write, args=(path,), name="audit", daemon=True)
            self._thread.start()

    def note(self, who: str, **what: Any) -> None:
        """Add a record."""
        record = {"at": self._clock().isoformat(timespec="milliseconds"), "who": who} | what
        self._kept.append(record)
        if self._thread is not None:
            try:
                self._waiting.put_nowait(json.dumps(record) + "\n")
            except queue.Full:
                self.lost += 1

    def recent(self) -> dict[str, Any]:
        """The last records, where all are, and what is not there."""
        where = str(self.path) if self.path else ""
        return {"records": list(self._kept), "file": where, "lost": self.lost, "trouble": self.trouble}

    def close(self) -> None:
        """Let the disk take what waits, but not for ever."""
        if self._thread is not None:
            with suppress(queue.Full):
                self._waiting.put(None, timeout=1.0)
            self._thread.join(2.0)

    def _write(self, path: Path) -> None:
        while (line := self._waiting.get()) is not None:
            try:
                _append(path, line)
            except OSError as error:
                self.lost += 1
                self.trouble = f"{path}: {error.strerror}"
            self._waiting.task_done()


def _append(path: Path, line: str) -> None:
    """Add to a file that only this user reads."""
    with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o600), "a", encoding="utf-8") as file:
        file.write(line)
