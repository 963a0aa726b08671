"""`detent live` and `detent connect`: an axis under somebody's hand."""

import json
import shlex
import signal
import sys
import threading
from pathlib import Path
from typing import Annotated, Any

import typer

from detent.cli.app import NOT_DONE, Json, Set, app, option
from detent.cli.terminal import print_json, tell
from detent.errors import DetentError
from detent.units import format_quantity

File = Annotated[Path, typer.Argument(help="Axis file (TOML).", show_default=False)]
SPEED = "How fast time passes on the simulated axis, 0.1 to 10: for practice."
PERIOD = "Time between two periods of the loop; a machine without real-time priority may need a longer one."
FOR = "End after so many seconds by itself."
STORE = "Where to keep what survives; by default beside the axis file."
NO_STORE = "Keep nothing: a simulated axis then begins where its file puts it."
WORD = (
    "Command: status, stop, enable, confirm, move_to, move_by, go_to, jog, disable, reset, home; of the position "
    "table: positions, teach, edit, rename, forget, undo, redo, export, import."
)


@app.command()
def live(
    file: File,
    overrides: Set = None,
    motor: Annotated[str, option("--motor", "NAME", "Which motor, of a file with several.")] = "",
    speed: Annotated[float, option("--speed", "", SPEED)] = 1.0,
    period: Annotated[str, option("--period", "", PERIOD)] = "1 ms",
    seconds: Annotated[float | None, option("--for", "SECONDS", FOR, min=0.0)] = None,
    store: Annotated[Path | None, option("--store", "PATH", STORE)] = None,
    *,
    no_store: Annotated[bool, option("--no-store", "", NO_STORE)] = False,
    as_json: Json = False,
) -> None:
    """Run an axis live, in wall time, until Ctrl-C: it then comes to rest in a ramp and lets go."""
    from detent.operate.client import LiveAxis
    from detent.operate.session import Session
    from detent.operate.start import Place, beside, make_host

    place, where = Place(file), None if no_store else store or beside(file)
    host, name = make_host(file, overrides or [], motor=motor, speed=speed, period=_seconds(period), store=where)
    missing, left = host.start(), threading.Event()
    session = Session(host, {"name": name, "file": str(file), "simulated": True, "speed": speed})
    channel = place.serve(session)

    def leave(_number: int, _frame: object) -> None:
        left.set()

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, leave)
    started = {"name": name, "simulated": True, "speed": speed, "channel": str(channel.path), "not_permitted": missing}
    status = session.status()
    started |= {"state": host.state, "period": session.describe()["period"], "store": status["store"]}
    started |= {key: status[key] for key in ("position", "trust", "find")} | {"unit": session.unit}
    if as_json:
        print(json.dumps(started), flush=True)
    else:
        _tell_start(file, started)
    while not left.wait(seconds if seconds is not None else 0.2) and seconds is None and host.is_alive:
        pass
    died = not host.is_alive
    channel.close()
    axis = LiveAxis(session)
    axis.close()
    place.leave()
    status = session.status()
    if as_json:
        print_json({"ended": status})
    else:
        tell(f"At rest at {status['position']:.6g} {axis.unit}, torque off; {status['loop']['periods']} periods, "
             f"{status['loop']['skipped']} skipped, latest {status['loop']['worst'] * 1e6:.0f} us.")  # fmt: skip
        if status["store"]:
            tell(f"Where it stands is kept in {status['store']['path']}")
    if died:
        raise typer.Exit(NOT_DONE)


def _seconds(period: str) -> float:
    """A time with its unit [s]."""
    from detent.units import QuantityError, parse_quantity

    try:
        return parse_quantity(period, "s")
    except QuantityError as error:
        raise DetentError(f"--period {period}: {error}") from error


def _tell_start(file: Path, started: dict[str, Any]) -> None:
    """What is running, and how to speak to it."""
    name = shlex.quote(str(file))
    speed = "" if started["speed"] == 1.0 else f", time {started['speed']:g} times as fast"
    tell(f"{started['name']}: live, SIMULATION{speed}; every {started['period'] * 1e3:g} ms; {started['state']}.")
    tell(f'From a second terminal: detent connect {name} enable, then detent connect {name} move_by "5 mm"')
    for one in started["not_permitted"]:
        tell(f"Not permitted: {one}")
    _tell_store(name, started)
    tell("Ctrl-C stops the axis, then ends.")
    sys.stdout.flush()


def _tell_store(file: str, started: dict[str, Any]) -> None:
    """What is kept, and where the axis stands."""
    store, place = started["store"], format_quantity(started["position"], started["unit"], 6)
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
    speed: Annotated[float, option("--speed", "", "Share of the largest speed, above 0 to 1.")] = 1.0,
    seconds: Annotated[float, option("--for", "SECONDS", "How long a jog lasts.", min=0.0)] = 1.0,
    *,
    as_json: Json = False,
) -> None:
    """Ask an axis that runs live for something, and wait until that has ended."""
    from detent.operate.start import connect as connect_to
    from detent.operate.words import PLACES, describe_status

    axis = connect_to(file)
    ended: dict[str, Any] = {}
    if word == "jog":
        if value is None:
            raise DetentError('connect: a jog needs a velocity such as "20 mm/s"')
        with axis.jog(value):
            threading.Event().wait(seconds)
    elif word not in ("status", "positions"):
        ended = axis.do(word, _about(word, value, second), speed, wait=False).wait().to_dict()
    if word in ("positions", *PLACES):
        _show_positions(axis.positions, axis.unit, as_json=as_json)
        return
    status = axis.status
    if as_json:
        print_json({"status": status, "ended": ended, "why_not_moving": axis.why_not_moving})
        return
    tell(describe_status(status, axis.unit))
    for what, remedy in axis.why_not_moving:
        tell(f"  not moving: {what}; {remedy}")


def _about(word: str, value: str | None, second: str | None) -> object:
    """What a word is about: a value, two of them, or a file, whose place does not depend on who opens it."""
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
        tell(f"{row['name']}: {format_quantity(row['position'], unit, 6)}, {row['counts']} counts, "
             f"taught {row['taught']}{used}")  # fmt: skip
    if not table:
        tell("No positions yet; teach the first one with: detent connect FILE teach 1")
