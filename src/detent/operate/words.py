"""Commands in words: what a person, a program or a page says, and what it is told."""

import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from typing import Any, NamedTuple

from detent.control import operation as ops
from detent.control.axis_states import STATE_NAMES
from detent.control.move_commands import lower_end, upper_end
from detent.errors import REFUSAL_TEXT, AxisError, DetentError
from detent.operate.loop import INJECT
from detent.units import format_place, format_quantity, parse_quantity

TRUSTS = ("unknown", "restored", "referenced")


class Word(NamedTuple):
    """A command: its kind, what its value is in the unit of the axis (empty: none; "number": a position number)."""

    kind: int
    value: str = ""
    help: str = ""


WORDS = {
    "enable": Word(ops.ENABLE, help="take torque; the target is where the axis is"),
    "disable": Word(ops.OFF, help="take the torque away, now"),
    "stop": Word(ops.STOP, help="come to rest as soon as the limits let it, and hold"),
    "reset": Word(ops.RESET, help="leave a fault; never moves"),
    "confirm": Word(ops.CONFIRM, help="the first motion went as expected: full speed from now on"),
    "move_to": Word(ops.MOVE_TO, "place", "to a position"),
    "move_by": Word(ops.MOVE_BY, "place", "by a way"),
    "jog": Word(ops.JOG, "speed", "at a velocity for as long as it is kept"),
    "keep": Word(ops.KEEP, help="go on with the jog"),
    "go_to": Word(ops.GO, "number", "to a numbered position"),
    "home": Word(ops.HOME, help="find the reference"),
    "job": Word(ops.JOB, "job", "moves of a file or a list, one after another, or what the axis prints"),
    "stream_position": Word(ops.STREAM_POSITION, "time", "follow positions that are sent once in this time"),
    "stream_velocity": Word(ops.STREAM_VELOCITY, "time", "the same of velocities"),
    "stream_effort": Word(ops.STREAM_EFFORT, "time", "the same of efforts, shares of the limit"),
    "pause": Word(ops.PAUSE, help="the job that is under way comes to rest, and is held"),
    "resume": Word(ops.RESUME, help="go on with it"),
    "take": Word(ops.TAKE, help="take over the command; a motion under way is stopped first"),
    "trust": Word(ops.TRUST, "number", "0 position unknown, 1 restored, 2 referenced"),
    "leave": Word(ops.LEAVE, help="command no longer; a motion under way is stopped"),
    "inject": Word(INJECT, "fault", help="a fault into the simulated machine, or nothing any more"),
    "order": Word(ops.ORDER, "number", "an order of the control word of CiA 402, 0 shutdown to 6 fault reset"),
}

PLACES = {
    "teach": "where the axis rests becomes a position of the table, under a name or a number",
    "edit": "a position of the table is typed in: its name and where it is",
    "rename": "a position gets another name", "forget": "a position leaves the table",
    "undo": "the last change of the table is taken back", "redo": "it is made again",
    "export": "the table is written to a file", "import": "the positions of a file are taken into it",
}  # fmt: skip
"""What is done with the position table: nothing of it moves the axis."""

DURABLE = "enable", "order", "go_to", "job", "positions", *PLACES  # that may have to wait for a disk


class CommandError(AxisError):
    """A live command that was not done: `reason` says why, `remedy` what to do, `code` is the number of both."""

    def __init__(self, command: str, what: str, code: int, reason: str, remedy: str) -> None:
        self.command, self.code, self.reason, self.remedy = command, code, reason, remedy
        told = f"{command} {what}"
        told += f" ({code})" if code else ""
        super().__init__("; ".join(filter(None, (f"{told}: {reason}" if reason else told, remedy))))


class CommandRefusedError(CommandError):
    """A command that was not taken: nothing has changed."""


class CommandAbortedError(CommandError):
    """A command that another one, or a stop, has ended."""


class CommandFailedError(CommandError):
    """A command that a fault has ended."""


ERRORS: dict[str, type[CommandError]] = {
    "refused": CommandRefusedError, "aborted": CommandAbortedError, "failed": CommandFailedError,
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Ended:
    """How a command has ended, for people."""

    id: int
    how: str  # done, aborted, refused or failed
    code: int = 0
    reason: str = ""
    remedy: str = ""

    def to_dict(self) -> dict[str, Any]:
        """Plain data."""
        return asdict(self)


def ended(id_: int, how: int, why: int, by: int, known: str) -> Ended:
    """What is told of an ending; `known` is the sentence of who knows more of it than its text says."""
    name = ops.ENDINGS[how]
    if how == ops.ABORTED:
        return Ended(id_, name, 0, f"command {by} took its place" if by else "a stop ended it")
    text = known or REFUSAL_TEXT.get(why, "")
    reason, _, remedy = text.partition("; ")
    return Ended(id_, name, why, reason, remedy)


def value_of(word: Word, value: object, unit: str) -> float:
    """Read what a command is about: a number in SI units, or a text with a unit such as "5 mm"."""
    if not word.value:
        return 0.0
    wanted = {"place": unit, "speed": f"{unit}/s", "time": "s", "number": ""}[word.value]
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        shown = "nothing" if value is None else repr(value)
        raise DetentError(f"a command with {shown}; it needs {example_of(wanted)}")
    if isinstance(value, str):
        try:
            return parse_quantity(value, wanted) if wanted else float(value)
        except (DetentError, ValueError) as error:
            raise DetentError(f"{value!r} is not {example_of(wanted)}") from error
    if abs(value) < 1e300:
        return float(value)
    return -math.inf if value < 0 else math.inf  # a whole number may be too long for a float


def example_of(unit: str) -> str:
    """What a command takes, with an example.

    >>> example_of("m"), example_of("rad/s"), example_of("")
    ('a value such as "5 mm"', 'a value such as "30 deg/s"', 'a number such as 3')
    """
    examples = {"s": "1 ms", "m": "5 mm", "m/s": "20 mm/s", "rad": "90 deg", "rad/s": "30 deg/s"}
    return f'a value such as "{examples[unit]}"' if unit in examples else "a number such as 3"


def status_of(host: Any, fault: str) -> dict[str, Any]:
    """The axis now, as plain data; positions in SI units."""
    o, loop = host.board.operation, host.board.loop
    a = o.answer
    kind = ops.COMMAND_NAMES[int(o.kind) - 1] if o.kind else ""
    return {
        "state": STATE_NAMES[o.state], "position": a.position, "velocity": a.velocity, "commanded": a.commanded,
        "error": a.error, "effort": a.effort, "limited": bool(a.limited), "rests": bool(a.rests),
        "at_end": _end_of(host.axis.live.operation, o), "in_window": bool(a.near),
        "ready": bool(a.ready), "opening": bool(o.opening),
        "trust": TRUSTS[o.trust], "confirmed": bool(o.confirmed),
        "fault": {"code": int(o.fault), "text": fault or host.told(o.fault) or REFUSAL_TEXT.get(o.fault, "")}
        if o.fault else None,
        "barred": {"code": int(o.barred), "text": host.told(o.barred) or REFUSAL_TEXT[o.barred]} if o.barred else None,
        "running": {"id": int(o.running), "command": kind} if o.running else None, "epoch": int(o.epoch),
        "job": _job_of(host) if o.kind == ops.JOB else None,
        "client": int(o.client), "last_stop": o.last_stop,
        "loop": {
            "periods": int(loop.periods), "skipped": int(loop.skipped), "overruns": int(loop.overruns),
            "ended": host.is_running and not host.is_alive,
            "worst": loop.worst * 1e-9, "mean_work": loop.work * 1e-9 / max(loop.periods, 1),
            "longest_work": loop.longest * 1e-9, "late": [int(n) for n in loop.late],
        },
    }  # fmt: skip


def _job_of(host: Any) -> dict[str, Any]:
    """How far the job has come that is under way."""
    return {
        "name": host.job.name, "done": host.job.done, "of": host.job.pieces,
        "paused": bool(host.board.operation.paused), "shown": dict(host.job.shown),
    } if host.job else {"name": "", "done": 0, "of": 0, "paused": False, "shown": {}}  # fmt: skip


def why_not_moving(status: dict[str, Any], client: int = 0) -> list[tuple[str, str]]:
    """Every condition of a motion that is not met, each with what to do; `client` is who asks, 0 anybody."""
    found = [*_why_no_torque(status)]
    enabled = status["state"] == "operation enabled"
    if client and status["client"] not in (0, client):
        found.append(("somebody else commands", "take over, which stops a motion of theirs, or let them finish"))
    if status["selector"] == "remote":
        found.append(("the selector stands on remote: only faces command", "turn the selector to both, or to local"))
    if status["trust"] == "unknown":
        found.append(("the position is not known: it creeps, and goes to no position", status["find"]))
    if status["store"] and status["store"]["trouble"]:
        found.append((f"what survives cannot be kept: {status['store']['trouble']}", "give its disk room, then enable"))
    if status["job"] and status["job"]["paused"]:
        found.append(("a pause holds its job", "resume, or stop"))
    if enabled and not status["confirmed"]:
        found.append(("the first motion is held to a tenth of the speed", "look at it, then confirm"))
    if status["at_end"]:
        found.append((f"it stands at its {status['at_end']} limit", "move to the other side"))
    if enabled and status["limited"]:
        found.append(("the command is at its limit", "look for what holds the axis"))
    if enabled and status["rests"] and not status["in_window"]:
        found.append(("it is not in its window", "wait; where that lasts, look for what holds the axis, or stop"))
    if not found and status["running"] is None and status["rests"]:
        found.append(("nothing has been asked of it", "jog, or move to a position"))
    return found


def _why_no_torque(status: dict[str, Any]) -> Iterator[tuple[str, str]]:
    """What keeps the axis from holding and moving at all."""
    state, fault = status["state"], status["fault"]
    if status["loop"]["ended"]:
        yield "the loop has ended", "start it again with: detent live FILE"
    if fault and state == "fault reaction active":
        yield f"fault {fault['code']}: {fault['text']}", "wait until it has come to rest"
    elif fault:
        yield f"fault {fault['code']}: {fault['text']}", "mend its cause, then reset"
    if status["barred"]:
        yield f"{status['barred']['text']} ({status['barred']['code']})", "then enable"
    if not status["ready"]:
        yield "the axis is not ready yet", "wait; after power-on it takes its first position"
    elif state == "quick stop active":
        yield "a quick stop holds it", "enable"
    elif status["opening"]:
        yield "its brake is opening", "wait: then it is enabled"
    elif state != "operation enabled" and not fault:
        yield f"no torque: {state}", "enable"


def _end_of(q: Any, o: Any) -> str:
    """Soft limit that the commanded point stands at: lower, upper, or none of them."""
    if q.endless or not o.answer.ready or o.trust == ops.NOT_KNOWN:
        return ""
    lowest, highest = lower_end(q, o), upper_end(q, o)
    near = 1e-6 * (highest - lowest)
    return "lower" if o.answer.commanded <= lowest + near else "upper" if o.answer.commanded >= highest - near else ""


def describe_status(status: dict[str, Any], unit: str) -> str:
    """One line for a terminal."""
    place = format_place(status["position"], unit)
    moving = "" if status["rests"] else f", {format_quantity(status['velocity'], unit + '/s')}"
    stands = status["fault"]
    fault = f"; fault {stands['code']}: {stands['text'].partition('; ')[0]}" if stands else ""
    error = "" if abs(status["error"]) < 1e-9 else f", error {format_quantity(status['error'], unit, 3)}"
    return f"{status['state']}, {place} ({status['trust']}){moving}{error}{fault}"
