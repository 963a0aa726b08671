"""The local channel to a live axis: a socket of the system, so that other processes may ask, watch, and be killed.

A message is a line of JSON, 64 kB at most. A client asks ``{"do": "move_to", "value": "120 mm", "as": 7}`` and hears
``{"as": 7, "id": 31}``, later ``{"ended": {...}}``; ``{"do": "status"}``, ``{"do": "describe"}`` and
``{"do": "faults"}`` are answered at once. A client that does not read what it is sent is dropped; one that is gone
leaves its jog to the lease.
"""

import asyncio
import json
import os
import socket
import threading
from contextlib import suppress
from hashlib import sha256
from pathlib import Path
from typing import Any, cast

from detent.errors import AxisError, DetentError
from detent.files.text import shown
from detent.operate.session import Session
from detent.operate.words import Ended

LONGEST = 1 << 16  # bytes of a message
MOST_CLIENTS = 16
MOST_WAITING = 1 << 20  # bytes that a client has not read until it is dropped
LOOK = 2e-3  # how often endings are looked for [s]


def runtime_folder() -> Path:
    """Folder of this user's channels, which nobody else may enter."""
    base = os.environ.get("XDG_RUNTIME_DIR")
    folder = Path(base, "detent") if base else Path("/tmp", f"detent-{os.getuid()}")  # noqa: S108 - made 0700 below
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    held = folder.stat()
    if held.st_uid != os.getuid() or held.st_mode & 0o077:
        raise DetentError(
            f"{folder}: it belongs to somebody else, or others may enter it; remove it, or set XDG_RUNTIME_DIR"
        )
    return folder


def channel_of(file: Path) -> Path:
    """Socket of the axis that a file describes."""
    path = file.resolve()
    stem = "".join(c if c.isascii() and c.isalnum() else "-" for c in path.stem)[:32]
    return runtime_folder() / f"{stem}-{sha256(str(path).encode()).hexdigest()[:10]}.sock"


class Channel:
    """The server's side, in a thread of its own."""

    def __init__(self, session: Session, path: Path) -> None:
        self.session, self.path = session, path
        self._clients = self._open = 0  # that have ever come, and that are there
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._serve, name="channel", daemon=True)
        self._ready, self._left = threading.Event(), asyncio.Event()

    def start(self) -> None:
        """Listen."""
        self.path.unlink(missing_ok=True)
        self._thread.start()
        self._ready.wait()

    def close(self) -> None:
        """Listen no longer."""
        self._loop.call_soon_threadsafe(self._left.set)
        self._thread.join()
        self.path.unlink(missing_ok=True)

    def _serve(self) -> None:
        asyncio.set_event_loop(self._loop)
        self._loop.run_until_complete(self._listen())
        self._loop.close()

    async def _listen(self) -> None:
        server = await asyncio.start_unix_server(self._attend, self.path, limit=LONGEST)
        self.path.chmod(0o600)
        self._ready.set()
        await self._left.wait()
        server.close()
        for task in asyncio.all_tasks() - {asyncio.current_task()}:
            task.cancel()

    async def _attend(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """One client, until it leaves."""
        if self._open >= MOST_CLIENTS:
            _send(writer, {"error": f"{MOST_CLIENTS} clients are there already; close one of them"})
            writer.close()
            return
        self._open += 1
        self._clients += 1
        number, open_ = self._clients + 1, set[int]()  # the process itself is client 1
        telling = asyncio.ensure_future(self._tell_endings(open_, writer))
        with suppress(ConnectionError, asyncio.CancelledError, ValueError, asyncio.LimitOverrunError):
            while line := await reader.readline():
                answer = self._answer(line, number, open_)
                if not _send(writer, answer):
                    break
        telling.cancel()
        self._open -= 1
        with suppress(BlockingIOError):  # the lease of a jog runs out by itself
            self.session.ask("leave", client=number)
        writer.close()

    def _answer(self, line: bytes, client: int, open_: set[int]) -> dict[str, Any]:
        """What a message is answered."""
        try:
            read: Any = json.loads(line)
        except (ValueError, RecursionError):
            return {"error": "that is no JSON"}
        asked = cast("dict[str, Any]", read if isinstance(read, dict) else {})
        mark = {"as": asked["as"]} if "as" in asked else {}
        try:
            return mark | self._done(asked, client, open_)
        except DetentError as error:
            return mark | {"error": str(error)}

    def _done(self, asked: dict[str, Any], client: int, open_: set[int]) -> dict[str, Any]:
        do = asked.get("do")
        if do == "status":
            return {"status": self.session.status()}
        if do == "describe":
            return {"describe": self.session.describe()}
        if do == "faults":
            return {"faults": self.session.faults()}
        speed = asked.get("speed", 1.0)
        if not isinstance(do, str) or isinstance(speed, bool) or not isinstance(speed, int | float):
            raise DetentError('a message is an object with "do", a command, and perhaps "value" and "speed", a number')
        try:
            command = self.session.ask(do, asked.get("value"), float(speed), client=client)
        except BlockingIOError as error:
            raise DetentError("too many commands at once") from error
        open_.add(command)
        return {"id": command}

    async def _tell_endings(self, open_: set[int], writer: asyncio.StreamWriter) -> None:
        while True:
            for command in sorted(open_):
                ended = self.session.ending(command)
                if ended is not None:
                    open_.discard(command)
                    _send(writer, {"ended": ended.to_dict()})
            await asyncio.sleep(LOOK)


def _send(writer: asyncio.StreamWriter, message: dict[str, Any]) -> bool:
    """Send, unless the client has left or does not read."""
    if writer.is_closing() or writer.transport.get_write_buffer_size() > MOST_WAITING:
        writer.transport.abort()
        return False
    writer.write(json.dumps(message).encode() + b"\n")
    return True


class Connection:
    """The client's side: a `Link` to an axis that another process runs."""

    def __init__(self, path: Path, timeout: float = 5.0) -> None:
        self._socket = socket.socket(socket.AF_UNIX)
        self._socket.settimeout(timeout)
        try:
            self._socket.connect(str(path))
        except OSError as error:
            self._socket.close()
            told = f"no live axis there ({error.strerror}); start one with: detent live FILE"
            raise AxisError(f"{shown(str(path))}: {told}") from error
        self._file = self._socket.makefile("rb")
        self._lock, self._marks, self._ended = threading.RLock(), 0, dict[int, Ended]()

    def _read(self) -> dict[str, Any]:
        line = self._file.readline(LONGEST * 4)
        if not line:
            raise AxisError("the live axis has gone; look at the process that ran it")
        message = json.loads(line)
        if "ended" in message:
            ended = Ended(**message["ended"])
            self._ended[ended.id] = ended
        return message

    def _request(self, message: dict[str, Any]) -> dict[str, Any]:
        with self._lock:
            self._marks += 1
            try:
                self._socket.sendall(json.dumps(message | {"as": self._marks}).encode() + b"\n")
                while (answer := self._read()).get("as") != self._marks:
                    if "error" in answer:
                        raise AxisError(answer["error"])
            except OSError as error:
                raise AxisError(f"the live axis does not answer ({error}); look at the process that runs it") from error
        if "error" in answer:
            raise DetentError(answer["error"])
        return answer

    def describe(self) -> dict[str, Any]:
        """What does not change."""
        return self._request({"do": "describe"})["describe"]

    def status(self) -> dict[str, Any]:
        """The axis now."""
        return self._request({"do": "status"})["status"]

    def faults(self) -> list[dict[str, Any]]:
        """The last faults."""
        return self._request({"do": "faults"})["faults"]

    def ask(self, word: str, value: object = None, speed: float = 1.0) -> int:
        """Ask for something; gives an id."""
        return self._request({"do": word, "value": value, "speed": speed})["id"]

    def ending(self, command: int) -> Ended | None:
        """How a command has ended; None while it has not."""
        if command not in self._ended:
            self.status()  # what has ended is told before it
        return self._ended.get(command)

    def wait(self, command: int, timeout: float | None = None) -> Ended:
        """Wait until a command has ended."""
        pause, waited = threading.Event(), 0.0
        while (found := self.ending(command)) is None:
            if timeout is not None and waited >= timeout:
                raise TimeoutError(f"command {command} has not ended within {timeout:g} s")
            pause.wait(0.01)
            waited += 0.01
        return found

    def close(self) -> None:
        """Give the command back; what this client had under way is stopped."""
        self._file.close()
        self._socket.close()
