"""`detent live` and `detent connect`: an axis under somebody's hand."""

import contextlib
import json
import os
import select
import shlex
import signal
import sys
import threading
import time
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Annotated, Any

import typer

from detent.cli.app import DONE, NOT_DONE, Json, Set, app, option
from detent.cli.terminal import print_json, tell
from detent.errors import DetentError
from detent.units import format_place

File = Annotated[Path, typer.Argument(help="Axis file (TOML).", show_default=False)]
SPEED = "How fast time passes on the simulated axis, 0.1 to 10: for practice."
PERIOD = "Time between two periods of the loop; a machine without real-time priority may need a longer one."
DRIVE = (
    "What is at the other end of the lines: sim; canopen:INTERFACE:CHANNEL@NODE, as canopen:socketcan:can0@5, "
    "behind which may follow ?mode=velocity or ?mode=position; or a board, serial:PORT, as serial:/dev/ttyACM0."
)
FOR = "End after so many seconds by itself."
STORE = "Where to keep what survives; by default beside the axis file."
NO_STORE = "Keep nothing: a simulated axis then begins where its file puts it."
RECORD = "Write down, line by line, all that is asked: whoever repeats it, repeats the session bit for bit."
BIND = "Address at which the panel is reached from other machines; else only this one reaches it."
PORT = "Port of the panel; else any that is free."
NAME = "Name by which the panel is called, beside its address; repeat for more."
PLAIN = "Serve the panel without TLS on a network; whoever is on it can then read and change what is sent."
COMMANDS = "Let the faces move the axis; without it they read, and stop."
EPICS = "Serve an EPICS motor record of this name over Channel Access, for ophyd and bluesky."
PVA = "The same over PV Access."
CANOPEN = "Be a CiA 402 drive on a CAN bus, BUS:CHANNEL@NODE as python-can names it: socketcan:can0@5."
MODBUS = "Serve registers over Modbus TCP; loopback unless a host is named, as for all faces that follow."
SCPI = 'Take lines in the style of SCPI, on TCP, or with "pty" on a terminal.'
VIEWER = "Print a second link, for somebody who only looks, and may stop."
WORD = (
    "Command: status, stop, enable, confirm, move_to, move_by, go_to, jog, disable, reset, home; selector: who may "
    "command, both, local or remote; of the position table: positions, teach, edit, rename, forget, undo, redo, "
    "export, import; job, pause, resume; inject, faults; link: to the panel."
)


@app.command()
def live(
    file: File,
    overrides: Set = None,
    motor: Annotated[
        str, option("--motor", "NAME", "Which motor, of a file with several; else all of them, each an axis.")
    ] = "",
    speed: Annotated[float, option("--speed", "", SPEED)] = 1.0,
    period: Annotated[str, option("--period", "", PERIOD)] = "1 ms",
    drive: Annotated[str, option("--drive", "NAME:ADDRESS", DRIVE)] = "sim",
    seconds: Annotated[float | None, option("--for", "SECONDS", FOR, min=0.0)] = None,
    store: Annotated[Path | None, option("--store", "PATH", STORE)] = None,
    record: Annotated[Path | None, option("--record", "FILE", RECORD)] = None,
    headless: Annotated[bool, option("--headless", "", "Without the panel in the browser.")] = False,
    bind: Annotated[str, option("--bind", "ADDRESS", BIND)] = "",
    port: Annotated[int, option("--port", "", PORT, min=0, max=65535)] = 0,
    names: Annotated[list[str] | None, option("--name", "HOST", NAME)] = None,
    certificate: Annotated[str, option("--tls-certificate", "PEM", "Certificate of the panel.")] = "",
    key_file: Annotated[str, option("--tls-key", "PEM", "Its private key.")] = "",
    plain: Annotated[bool, option("--i-accept-plain-http", "", PLAIN)] = False,
    viewer_link: Annotated[bool, option("--viewer-link", "", VIEWER)] = False,
    epics: Annotated[str, option("--epics", "RECORD", EPICS)] = "",
    pva: Annotated[str, option("--pva", "RECORD", PVA)] = "",
    canopen: Annotated[str, option("--canopen", "BUS", CANOPEN)] = "",
    modbus: Annotated[str, option("--modbus", "[HOST]:PORT", MODBUS)] = "",
    scpi: Annotated[str, option("--scpi", "[HOST]:PORT", SCPI)] = "",
    grbl: Annotated[str, option("--grbl", "[HOST]:PORT", "Be a grbl 1.1; the same places.")] = "",
    gcs: Annotated[str, option("--gcs", "[HOST]:PORT", "Speak GCS 2.0 as PI's controllers do; the same.")] = "",
    zaber: Annotated[
        str, option("--zaber", "[HOST]:PORT", "Speak Zaber's ASCII protocol, native units; the same.")
    ] = "",
    alpaca: Annotated[str, option("--alpaca", "[HOST]:PORT", "Be an ASCOM Alpaca focuser or rotator.")] = "",
    commands: Annotated[bool, option("--commands", "", COMMANDS)] = False,
    *,
    no_store: Annotated[bool, option("--no-store", "", NO_STORE)] = False,
    as_json: Json = False,
) -> None:
    """Run an axis live, in wall time, until Ctrl-C: it then comes to rest in a ramp and lets go."""
    from detent.cli.running import Running, end_all, places
    from detent.faces.child import Faces
    from detent.operate.realtime import going_first
    from detent.operate.start import beside
    from detent.panel.child import PanelPlace

    at = PanelPlace(bind, port, certificate, key_file, plain, names or ())
    at.check()
    asked = {"epics": epics, "pva": pva, "canopen": canopen, "modbus": modbus, "scpi": scpi, "grbl": grbl, "gcs": gcs,
             "zaber": zaber, "alpaca": alpaca}  # fmt: skip
    wanted, may_command = _faces(file, overrides or [], asked, commands=commands)
    motors = _motors(file, overrides or [], motor, {"--store": store, "--record": record, "--drive": drive != "sim"})
    kept = None if no_store else store or beside(file)
    chosen = {"overrides": overrides or [], "speed": speed, "period": _seconds(period), "store": kept, "drive": drive}
    with ExitStack() as closing:
        closing.enter_context(going_first())
        read, left = _axis_file(file, overrides or []), Ending()
        axes = [Running(closing, file, one, chosen, read, record=record, quiet=as_json) for one in motors]
        left.hear()
        for one, where in () if headless else zip(axes, places(at, axes), strict=True):
            one.show(closing, where)
        channels = {one.motor: one.channel.path for one in axes}
        faces = closing.enter_context(contextlib.closing(Faces(channels, wanted, commands=may_command)))
        roles = ("engineer", "viewer")[: 1 + viewer_link]
        more = {"faces": faces.places, "commands": may_command, "face_processes": faces.processes}
        _tell_start(file, {one.motor: one.started(roles) for one in axes}, more, as_json=as_json)
        while not left.wait(seconds if seconds is not None else 0.2) and seconds is None and _live(axes):
            told = [text for one in (*axes, faces) for text in one.mend()]
            for text in filter(None, () if as_json else told):
                tell(text)
        status = DONE if _live(axes) else NOT_DONE
        _tell_end(end_all(axes), {one.motor: one.session.unit for one in axes}, as_json=as_json)
    raise typer.Exit(status)


def _live(axes: Any) -> bool:
    """True while all loops run: where one has ended, the others are brought to rest with it."""
    return all(one.host.is_alive for one in axes)


def _motors(file: Path, overrides: list[str], motor: str, single: dict[str, object]) -> list[str]:
    """Motors that run; options that are for one of them are refused for several."""
    from detent.methods.load import read_axis
    from detent.operate.start import motors_of

    motors = motors_of(read_axis(file, overrides), motor)
    wrong = [name for name, value in single.items() if value]
    if len(motors) > 1 and wrong:
        got = f"{wrong[0]}: got {file} with the motors {', '.join(motors)}"
        raise DetentError(f"{got}; expected: one of them; name it, as --motor {motors[0]}")
    return motors


def _faces(file: Path, overrides: list[str], asked: dict[str, str], *, commands: bool) -> tuple[dict[str, str], bool]:
    """Address of each face that the file or the command line asks for, and whether they may command."""
    from detent.methods.load import load_spec

    table = load_spec(file, overrides).faces
    stated = table.wanted if table else {}
    return stated | {face: one for face, one in asked.items() if one}, commands or bool(table and table.commands)


class Ending:
    """Whether somebody has asked for the end: by signals, of which one may come while another is heeded."""

    def __init__(self) -> None:
        self._hears, self._tells = os.pipe()
        os.set_blocking(self._tells, False)

    def hear(self) -> None:
        """Heed Ctrl-C and `kill` from now on."""
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self.ask)

    def ask(self, _number: int, _frame: object) -> None:
        """Ask for it; a lock would wait for whoever was interrupted, for ever."""
        with suppress(BlockingIOError):
            os.write(self._tells, b".")

    def wait(self, seconds: float) -> bool:
        """Wait so long at most; True once it was asked for."""
        return bool(select.select([self._hears], [], [], seconds)[0])


def _tell_end(ends: dict[str, dict[str, Any]], units: dict[str, str], *, as_json: bool) -> None:
    """Where each stands, and how its loop did."""
    if as_json:
        print_json({"ended": ends if len(ends) > 1 else next(iter(ends.values()))})
        return
    for motor, status in ends.items():
        at, loop = f"{motor}: at" if motor else "At", status["loop"]
        tell(f"{at} rest at {format_place(status['position'], units[motor])}, torque off; {loop['periods']} periods, "
             f"{loop['skipped']} skipped, latest {loop['worst'] * 1e6:.0f} us.")  # fmt: skip
        if status["store"]:
            tell(f"Where it stands is kept in {status['store']['path']}")


def _axis_file(file: Path, overrides: list[str]) -> dict[str, Any]:
    """Text of an axis file, and every effective value with its origin."""
    from detent.methods.check import check_spec
    from detent.methods.load import read_axis

    read = read_axis(file, overrides)
    rows = [[row.key, row.value, row.origin, row.doc] for row in check_spec(read).rows]
    return {"file": read.file, "text": read.source.content.decode(errors="replace"), "effective": rows}


def _seconds(period: str) -> float:
    """A time with its unit [s]."""
    from detent.units import QuantityError, parse_quantity

    try:
        return parse_quantity(period, "s")
    except QuantityError as error:
        raise DetentError(f"--period {period}: {error}") from error


def _tell_start(file: Path, axes: dict[str, dict[str, Any]], more: dict[str, Any], *, as_json: bool) -> None:
    """What is running, and how to speak to it."""
    if as_json:
        print(json.dumps(({"axes": axes} if len(axes) > 1 else next(iter(axes.values()))) | more), flush=True)
        return
    for motor, started in axes.items():
        _tell_axis(shlex.quote(str(file)), f" --motor {motor}" if motor else "", started)
    _tell_faces(more)
    tell(f"Ctrl-C stops {'all axes' if len(axes) > 1 else 'the axis'}, then ends.")
    sys.stdout.flush()


def _tell_axis(name: str, motor: str, started: dict[str, Any]) -> None:
    """Of one axis."""
    speed = "" if started["speed"] == 1.0 else f", time {started['speed']:g} times as fast"
    what = "SIMULATION" if started["simulated"] else f"on {started['hardware']}"
    tell(f"{started['name']}: live, {what}{speed}; every {started['period'] * 1e3:g} ms; {started['state']}.")
    for fact in started["drive"]:
        tell(f"  {fact}")
    for link, role in zip(started["panel"], ("", ", to look only"), strict=False):
        tell(f"Panel{role}: {link} (works once, within ten minutes; another: detent connect {name}{motor} link)")
    tell(
        f'From a second terminal: detent connect {name}{motor} enable, then detent connect {name}{motor} move_by "5 mm"'
    )
    for one in started["not_permitted"]:
        tell(f"Not permitted: {one}")
    _tell_store(name + motor, started)


def _tell_faces(started: dict[str, Any]) -> None:
    """Where other people's software finds the axis."""
    from detent.faces.child import FACES

    for face, places in started["faces"].items():
        tell(f"{FACES[face].title}: {', '.join(places)}")
    if started["faces"] and not started["commands"]:
        tell("The faces read, and stop; let them move the axis with --commands")


def _tell_store(file: str, started: dict[str, Any]) -> None:
    """What is kept, and where the axis stands."""
    store, place = started["store"], format_place(started["position"], started["unit"])
    if store is None:
        tell(f"Nothing is kept: the simulated axis begins where its file puts it, {place} ({started['trust']}).")
        return
    tell(f"Store: {store['path']}; {store['position']}")
    if store["aside"]:
        tell(store["aside"])
    if started["trust"] == "unknown":
        tell(f"The position is not known; find it with: detent connect {file} {started['find']}")


@app.command()
def connect(
    file: Annotated[Path, typer.Argument(help="Axis file that runs live, or its socket.", show_default=False)],
    word: Annotated[str, typer.Argument(help=WORD)] = "status",
    value: Annotated[str | None, typer.Argument(help='Where to, how far, how fast: "120 mm", 3, "20 mm/s".')] = None,
    second: Annotated[str | None, typer.Argument(help='Of edit the place, "5 mm"; of rename the new name.')] = None,
    motor: Annotated[str, option("--motor", "NAME", "Which motor, of a file with several that run.")] = "",
    speed: Annotated[float, option("--speed", "", "Share of the largest speed, above 0 to 1.")] = 1.0,
    seconds: Annotated[float, option("--for", "SECONDS", "How long a jog lasts.", min=0.0)] = 1.0,
    *,
    as_json: Json = False,
) -> None:
    """Ask an axis that runs live for something, and wait until that has ended."""
    from detent.operate.faults import describe_fault
    from detent.operate.opening import running_channel
    from detent.operate.start import connect as connect_to
    from detent.operate.words import PLACES, describe_status
    from detent.panel.keys import keys_of, link_of

    if word == "link":
        tell(link_of(keys_of(running_channel(file, motor)), value or "engineer", time.time()))
        return
    with connect_to(file, motor) as axis:
        ended: dict[str, Any] = {}
        if word == "jog":
            if value is None:
                raise DetentError('connect: a jog needs a velocity such as "20 mm/s"')
            with axis.jog(value):
                threading.Event().wait(seconds)
        elif word == "job":
            ended = _do_job(axis, value, speed)
        elif word not in ("status", "positions", "faults"):
            ended = axis.do(word, _about(word, value, second), speed, wait=False).wait().to_dict()
        if word in ("positions", *PLACES):
            _show_positions(axis.positions, axis.unit, as_json=as_json)
            return
        status, faults = axis.status, axis.faults if word == "faults" else []
        why = axis.why_not_moving
    if as_json:
        found = {"faults": faults} if word == "faults" else {}
        print_json({"status": status, "ended": ended, "why_not_moving": why} | found)
        return
    for one in faults:
        tell(describe_fault(one))
    tell(describe_status(status, axis.unit))
    for what, remedy in why:
        tell(f"  not moving: {what}; {remedy}")


def _about(word: str, value: str | None, second: str | None) -> object:
    """What a word is about: a value, two of them, or a file, whose place does not depend on who opens it."""
    if word.startswith("stream_"):
        raise DetentError(
            f"connect: got {word}; expected: a command that one line says; send set-points from Python: axis.stream()"
        )
    if word in ("export", "import") and value is not None:
        return str(Path(value).absolute())
    return value if second is None else [value, second]


def _show_positions(table: list[dict[str, Any]], unit: str, *, as_json: bool) -> None:
    """The position table."""
    if as_json:
        print_json({"positions": table})
        return
    for row in table:
        used = f", last used {row['used']}" if row["used"] else ""
        tell(f"{row['name']}: {format_place(row['position'], unit)}, {row['counts']} counts, "
             f"taught {row['taught']}{used}")  # fmt: skip
    if not table:
        tell("No positions yet; teach the first one with: detent connect FILE teach 1")


def _do_job(axis: Any, what: str | None, speed: float) -> dict[str, Any]:
    """Lead a job to its end: a file, or places with commas between them; Ctrl-C stops it."""
    if what is None:
        raise DetentError(
            'connect: got a job without moves; expected: a file, or places such as "left, 20 mm"; name them'
        )
    is_file = Path(what).exists() or ("," not in what and "." in what)
    try:
        job = what if is_file else [one.strip() for one in what.split(",")]
        return axis.run_job(job, speed=speed, wait=False).wait().to_dict()
    except KeyboardInterrupt:
        axis.stop()
        raise
