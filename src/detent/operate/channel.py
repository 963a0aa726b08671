"""The local channel to a live axis: a socket of the system, so that other processes may ask, watch, and be killed.

A message is a line of JSON, 64 kB at most. A client asks ``{"do": "move_to", "value": "120 mm", "as": 7}`` and hears
``{"as": 7, "id": 31}``, later ``{"ended": {...}}``. The questions of `QUESTIONS` are answered at once: ``{"do":
"status"}`` with ``{"status": {...}}``. After ``{"do": "watch", "rate": 25, "channels": ["position"]}`` the status comes
by itself, and with it the rows of the ring that were written meanwhile; a client that reads slowly loses rows and is
told how many. One that does not read what it is sent is dropped; one that is gone leaves its jog to the lease.
"""

import asyncio
import json
import math
import socket
import struct
import threading
from collections import deque
from collections.abc import Callable, Collection, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from inspect import signature
from pathlib import Path
from typing import Any, cast

from detent.control.operation import SECOND, STALE
from detent.errors import AxisError, DetentError
from detent.files.text import shown
from detent.operate.audit import Audit
from detent.operate.realtime import going_first
from detent.operate.session import LINES, Session, packed
from detent.operate.words import DURABLE, Ended, why_not_moving

LONGEST = 1 << 16  # bytes of a message
MOST_CLIENTS = 32
MOST_BEHIND = 256  # messages of a client that wait behind one that waits for a disk
MOST_WAITING = 1 << 20  # bytes that a client has not read until it is dropped
SLOW = 1 << 16  # bytes that it has not read until it is sent no rows
LEAVING = 0.5  # for what is still to be sent to a client that leaves [s]
LEAVES = 20  # times that it is asked to let others command, at most
LOOK = 2e-3  # how often endings are looked for [s]
UNTOLD = {"keep"}  # twenty a second: of the jog that they keep there is a record
RATES = 1.0, 50.0  # of a watch [Hz]
QUESTIONS: dict[str, Callable[..., Any]] = {
    "status": Session.status,
    "describe": Session.describe,
    "scope": Session.scope,
    "axis": Session.axis,
    "positions": Session.positions,
    "faults": Session.faults,
}
"""What only reads: the method of `Session` that answers; what else stands in the message are its arguments."""


@dataclass
class Client:
    """Somebody at the other end."""

    number: int
    writer: asyncio.StreamWriter
    who: str
    remote: bool = False  # a face: what it asks comes from elsewhere
    open: set[int] = field(default_factory=set[int])  # commands that have not ended
    told: set[int] = field(default_factory=set[int])  # those of them that stand in the log
    watch: asyncio.Future[None] | None = None
    behind: deque[tuple[bytes, int]] = field(default_factory=deque[tuple[bytes, int]])
    """Messages that wait for their turn, each with the number of stops when it came."""
    turn: asyncio.Future[None] | None = None  # what answers them


class Channel:
    """The server's side, in a thread of its own."""

    def __init__(self, session: Session, path: Path, audit: Audit | None = None) -> None:
        self.session, self.path, self.audit = session, path, audit or Audit()
        self._clients: dict[int, Client] = {}
        self._come = 0  # clients that have ever come
        self._slot, self._shown = -1, dict[str, Any]()
        self.lost = ""  # who has left with a motion of its own under way, and when
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
        with going_first():
            self._loop.run_until_complete(self._listen())
        self._loop.close()

    async def _listen(self) -> None:
        server = await asyncio.start_unix_server(self._attend, self.path, limit=LONGEST)
        self.path.chmod(0o600)
        self._ready.set()
        await self._left.wait()
        server.close()
        others = asyncio.all_tasks() - {asyncio.current_task()}
        for task in others:
            task.cancel()
        if others:  # who reads nothing is not waited for
            await asyncio.wait(others, timeout=2 * LEAVING)

    async def _attend(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """One client, until it leaves."""
        if len(self._clients) >= MOST_CLIENTS:
            _send(writer, {"error": f"{MOST_CLIENTS} clients are there already; close one of them"})
            writer.close()
            return
        self._come += 1
        client = Client(self._come + 1, writer, _process_of(writer))  # the process itself is client 1
        self._clients[client.number] = client
        telling = asyncio.ensure_future(self._tell_endings(client))
        try:
            with suppress(ConnectionError, asyncio.CancelledError, ValueError, asyncio.LimitOverrunError):
                while line := await reader.readline():
                    self._take(line, client)
                    if writer.is_closing():
                        break
        finally:
            telling.cancel()
            client.behind.clear()
            if client.turn is not None:  # what it has begun ends before it leaves, or nobody would have asked for it
                with suppress(asyncio.CancelledError):
                    await client.turn
            self._watch_no_more(client)
            del self._clients[client.number]
            self._note_lost(client)
            await self._give_back(client)
            writer.close()
            try:  # the end of a killed client is an error, which asyncio tells where nobody asks for it
                await asyncio.wait_for(writer.wait_closed(), LEAVING)
            except (OSError, TimeoutError, asyncio.CancelledError):
                writer.transport.abort()

    async def _give_back(self, client: Client) -> None:
        """Let somebody else command; asked in the period of a stop it came too early, and is asked again."""
        for _ in range(LEAVES):
            with suppress(BlockingIOError):  # the lease of a jog runs out by itself
                command = self.session.ask("leave", client=client.number)
                until = self._loop.time() + LEAVING
                while (ended := self.session.ending(command)) is None:
                    if not self.session.host.is_running or self._loop.time() > until:
                        return  # nothing has been refused
                    await asyncio.sleep(LOOK)
                if ended.code != STALE:
                    return

    def _note_lost(self, client: Client) -> None:
        """Say who was lost, where what it had begun is still under way and comes to rest now."""
        running = self.session.status()["running"]
        if running and running["id"] in client.open and client.told:
            self.lost = f"{client.who} has gone in a {running['command']}, which was stopped"
            self.audit.note(client.who, client=client.number, note=self.lost)

    def _take(self, line: bytes, client: Client) -> None:
        """Answer a message, in its turn; a stop overtakes what waits for a disk."""
        epoch = int(self.session.host.board.operation.epoch)
        is_free = client.turn is None or client.turn.done()
        if asks_for(line, LINES) or (is_free and not waits_for_disk(line)):
            _send(client.writer, self._answer(line, client, epoch))
            return
        if len(client.behind) >= MOST_BEHIND:
            told = {"error": f"{MOST_BEHIND} messages wait already; wait for answers (a stop is always taken)"}
            _send(client.writer, _mark_of(line) | told)
            return
        client.behind.append((line, epoch))
        if is_free:
            client.turn = asyncio.ensure_future(self._answer_in_turn(client))

    async def _answer_in_turn(self, client: Client) -> None:
        while client.behind:
            line, epoch = client.behind.popleft()
            if waits_for_disk(line):
                answer = await asyncio.to_thread(self._answer, line, client, epoch)
            else:
                answer = self._answer(line, client, epoch)
            _send(client.writer, answer)

    def _answer(self, line: bytes, client: Client, epoch: int | None = None) -> dict[str, Any]:
        """What a message is answered; `epoch`: the stops that whoever asks knew of."""
        try:
            read: Any = json.loads(line)
        except (ValueError, RecursionError):
            return {"error": "that is no JSON"}
        asked = cast("dict[str, Any]", read if isinstance(read, dict) else {})
        mark = {"as": asked.pop("as")} if "as" in asked else {}
        try:
            return mark | self._done(asked, client, {} if epoch is None else {"epoch": epoch})
        except DetentError as error:
            return mark | {"error": str(error)}

    def _done(self, asked: dict[str, Any], client: Client, known: dict[str, int]) -> dict[str, Any]:
        do = asked.pop("do", None)
        if not isinstance(do, str):
            raise DetentError('a message is an object with "do", a command, and perhaps "value" and "speed", a number')
        if do in QUESTIONS:
            told = _told(QUESTIONS[do], self.session, asked)
            return {do: told | {"questions": [*QUESTIONS, "log"]} if do == "describe" else told}
        if do in (own := {"watch": self._watch, "name": self._name, "log": self._log, "note": self._note,
                         "points": self._points}):  # fmt: skip
            return {do: _told(own[do], client, asked)}
        who = str(asked.pop("who", client.who))
        try:
            return {"id": self._command(do, asked, client, who, known)}
        except DetentError as error:
            self.audit.note(who, client=client.number, do=do[:40], error=str(error)[:200])
            raise

    def _command(self, do: str, asked: dict[str, Any], client: Client, who: str, known: dict[str, int]) -> int:
        value, speed = asked.get("value"), asked.get("speed", 1.0)
        barred = self.session.barred(do, value, remote=client.remote)
        if isinstance(speed, bool) or not isinstance(speed, int | float) or abs(speed) > 1e300:
            raise DetentError(f"speed {speed!r:.60}: expected a number above 0 to 1, a share of the largest speed")
        try:
            if barred:
                command = self.session.host.settle(barred)
            else:
                command = self.session.ask(do, value, float(speed), client=client.number, **known)
        except BlockingIOError as error:
            raise DetentError("too many commands at once") from error
        client.open.add(command)
        if do == "selector" and not barred:
            self._stop_barred()
        if do not in UNTOLD and do not in LINES:
            self.lost = ""  # somebody goes on
        if do not in UNTOLD:
            client.told.add(command)
            more = {} if value is None else {"value": value}
            self.audit.note(who, client=client.number, do=do, id=command, **more)
        return command

    def _points(
        self, client: Client, stream: object = 0, values: object = (), *, in_turn: object = False, last: object = False
    ) -> int:
        """Set-points of a stream; no command, so that nothing of them stands in the log."""
        return self.session.points(stream, values, client=client.number, in_turn=in_turn, last=last)

    def _stop_barred(self) -> None:
        """The selector was turned: who may not command any more has its motion stopped, and the command taken."""
        holder = self._clients.get(int(self.session.host.board.operation.client))
        if holder is None or not self.session.barred("move_to", remote=holder.remote):
            return
        self.audit.note(holder.who, client=holder.number, note=f"the selector stands on {self.session.selector}")
        with suppress(BlockingIOError):  # a full mailbox: it may still command nothing, and its lease runs out
            self.session.ask("leave", client=holder.number)

    def _log(self, _client: Client) -> dict[str, Any]:
        """Who asked for what, and how that ended."""
        return self.audit.recent()

    def _note(self, client: Client, who: object = "", what: object = "") -> None:
        """Something that happened at the client's, for the log."""
        self.audit.note(str(who)[:80] or client.who, client=client.number, note=str(what)[:200])

    def _name(self, client: Client, who: object = "", *, remote: object = False) -> str:
        """A client says on whose behalf it asks, and whether that comes from elsewhere."""
        client.who, client.remote = shown(str(who))[:80], bool(remote)
        return client.who

    def _watch(self, client: Client, rate: object = 25.0, channels: object = ()) -> dict[str, Any]:
        """Send status and rows from now on."""
        lowest, highest = RATES
        if isinstance(rate, bool) or not isinstance(rate, int | float) or not lowest <= rate <= highest:
            raise DetentError(f"rate {rate!r:.60}: expected {lowest:g} to {highest:g} times a second")
        paths = self.session.paths(channels)
        first = self.session.show(paths, client.number)
        if client.watch is not None:
            client.watch.cancel()
        client.watch = asyncio.ensure_future(self._stream(client, 1.0 / rate, paths, first))
        return {"first": first, "channels": channels}

    def _watch_no_more(self, client: Client) -> None:
        if client.watch is not None:
            client.watch.cancel()
            self.session.forget(client.number)

    def _sample(self) -> dict[str, Any]:
        """The axis in this fiftieth of a second: whoever watches, panel or face, sees it in the same period."""
        slot = int(self._loop.time() * RATES[1])
        if slot != self._slot:
            self._slot, self._shown = slot, self.session.status()
        return self._shown

    async def _stream(self, client: Client, pause: float, paths: list[str], after: int) -> None:
        """Status and rows, again and again; who reads slowly misses some."""
        missed = 0
        while True:
            if client.writer.transport.get_write_buffer_size() <= SLOW:
                if paths:
                    rows = self.session.rows(after, paths)
                    after, missed = rows.first + len(rows.columns[0]), missed + rows.missed
                    told = {"first": rows.first, "n": len(rows.columns[0]), "data": packed(rows.columns, "<f4")}
                    _send(client.writer, {"rows": told})
                _send(client.writer, self._status_for(client) | {"missed": missed})
            await asyncio.sleep(pause)

    def _status_for(self, client: Client) -> dict[str, Any]:
        status = self._sample()
        holder = self._clients.get(status["client"])
        return {
            "status": status, "why": why_not_moving(status, client.number), "clients": len(self._clients),
            "you": client.number, "holder": status["client"], "holder_name": holder.who if holder else "",
            "lost": self.lost,
        }  # fmt: skip

    def _named(self, ended: Ended) -> Ended:
        """A refusal with the name of who commands."""
        holder = self._clients.get(int(self.session.host.board.operation.client))
        if ended.code != SECOND or holder is None:
            return ended
        return replace(ended, reason=f"{ended.reason} ({holder.who})")

    async def _tell_endings(self, client: Client) -> None:
        while True:
            for command in sorted(client.open):
                ended = self.session.ending(command)
                if ended is not None:
                    client.open.discard(command)
                    if command in client.told:
                        client.told.discard(command)
                        self.audit.note(client.who, client=client.number, ended=command, how=ended.how, code=ended.code)
                    _send(client.writer, {"ended": self._named(ended).to_dict()})
            await asyncio.sleep(LOOK)


def names(line: bytes, words: Collection[str]) -> bool:
    """Whether a message has one of these words."""
    return any(f'"{word}"'.encode() in line for word in words)


def waits_for_disk(line: bytes) -> bool:
    """Whether a message may ask for something that is durable before it is done."""
    return names(line, DURABLE) and not asks_for(line, LINES)


def asks_for(line: bytes, words: Collection[str]) -> bool:
    """Whether a message asks for one of these."""
    return names(line, words) and _read(line).get("do") in words


def _read(line: bytes) -> dict[str, Any]:
    """An object that came as a line; empty where something else did."""
    try:
        read: Any = json.loads(line)
    except (ValueError, RecursionError):
        return {}
    return cast("dict[str, Any]", read) if isinstance(read, dict) else {}


def _mark_of(line: bytes) -> dict[str, Any]:
    """The mark under which a message is answered."""
    said = _read(line)
    return {"as": said["as"]} if "as" in said else {}


def _told(answer: Callable[..., Any], about: object, asked: dict[str, Any]) -> Any:
    """Answer a question; what it does not take is an error that says so."""
    names = [*signature(answer).parameters][1:]
    unknown = [name for name in asked if name not in names]
    if unknown:
        raise DetentError(f"no {unknown[0]!r:.60} in a message of that kind; it takes {', '.join(names) or 'nothing'}")
    return answer(about, **asked)


def _process_of(writer: asyncio.StreamWriter) -> str:
    """Whose process it is, where the system tells."""
    if not hasattr(socket, "SO_PEERCRED"):
        return "a process"
    held = writer.get_extra_info("socket").getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, struct.calcsize("3i"))
    return f"process {struct.unpack('3i', held)[0]}"


def _send(writer: asyncio.StreamWriter, message: dict[str, Any]) -> bool:
    """Send, unless the client has left or does not read."""
    if writer.is_closing() or writer.transport.get_write_buffer_size() > MOST_WAITING:
        writer.transport.abort()
        return False
    try:
        text = json.dumps(message, allow_nan=False)
    except ValueError:  # what a fault has left; a browser reads no NaN
        text = json.dumps(_finite(message))
    writer.write(text.encode() + b"\n")
    return True


def _finite(value: Any) -> Any:
    """Data in which null stands for what is no number."""
    if isinstance(value, dict):
        return {name: _finite(one) for name, one in cast("dict[str, Any]", value).items()}
    if isinstance(value, list | tuple):
        return [_finite(one) for one in cast("list[Any]", value)]
    return None if isinstance(value, float) and not math.isfinite(value) else value


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
                with suppress(BrokenPipeError):  # who has closed may have said why, which is read below
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

    def positions(self) -> list[dict[str, Any]]:
        """The position table."""
        return self._request({"do": "positions"})["positions"]

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

    def points(self, stream: int, values: Sequence[float], *, in_turn: bool = False, last: bool = False) -> int:
        """Send set-points of a stream; gives how many of them were taken."""
        message = {"do": "points", "stream": stream, "values": [*values], "in_turn": in_turn, "last": last}
        return self._request(message)["points"]

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
