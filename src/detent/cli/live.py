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

File = Annotated[Path, typer.Argument(help="Axis file (TOML).", show_default=False)]
SPEED = "How fast time passes on the simulated axis, 0.1 to 10: for practice."
PERIOD = "Time between two periods of the loop; a machine without real-time priority may need a longer one."
DRIVE = "What is at the other end of the lines: sim, or canopen:INTERFACE:CHANNEL@NODE, as canopen:socketcan:can0@5."
FOR = "End after so many seconds by itself."
WORD = "Command: status, stop, enable, confirm, move_to, move_by, go_to, jog, disable, reset, home."


@app.command()
def live(
    file: File,
    overrides: Set = None,
    motor: Annotated[str, option("--motor", "NAME", "Which motor, of a file with several.")] = "",
    speed: Annotated[float, option("--speed", "", SPEED)] = 1.0,
    period: Annotated[str, option("--period", "", PERIOD)] = "1 ms",
    drive: Annotated[str, option("--drive", "NAME:ADDRESS", DRIVE)] = "sim",
    seconds: Annotated[float | None, option("--for", "SECONDS", FOR, min=0.0)] = None,
    *,
    as_json: Json = False,
) -> None:
    """Run an axis live, in wall time, until Ctrl-C: it then comes to rest in a ramp and lets go."""
    from detent.operate.client import LiveAxis
    from detent.operate.session import Session
    from detent.operate.start import Place, make_host, shared_memory
    from detent.operate.watchdog import Watchdog

    place, (board, memory) = Place(file), shared_memory()
    host, name = make_host(
        file, overrides or [], motor=motor, speed=speed, period=_seconds(period), memory=memory, drive=drive
    )
    missing, left, watchdog = host.start(), threading.Event(), Watchdog(host.board, board)
    simulated = host.link is None
    session = Session(host, {"name": name, "file": str(file), "simulated": simulated, "speed": speed})
    channel = place.serve(session)

    def leave(_number: int, _frame: object) -> None:
        left.set()

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, leave)
    about = session.describe()
    started = {"name": name, "simulated": simulated, "speed": speed, "channel": str(channel.path)}
    started |= {"not_permitted": missing, "watchdog": watchdog.id}
    started |= {"state": host.state, "period": about["period"], "drive": about["drive"]}
    if host.link is not None:
        started["hardware"] = host.link.driver.hardware
    if as_json:
        print(json.dumps(started), flush=True)
    else:
        _tell_start(file, started)
    while not left.wait(seconds if seconds is not None else 0.2) and seconds is None and host.is_alive:
        if watchdog.keep() and not as_json:
            tell("The watchdog had ended; another one watches now.")
    died = not host.is_alive
    channel.close()
    axis = LiveAxis(session)
    axis.close()
    watchdog.close()
    place.leave()
    status = session.status()
    if as_json:
        print_json({"ended": status})
    else:
        tell(f"At rest at {status['position']:.6g} {axis.unit}, torque off; {status['loop']['periods']} periods, "
             f"{status['loop']['skipped']} skipped, latest {status['loop']['worst'] * 1e6:.0f} us.")  # fmt: skip
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
    what = "SIMULATION" if started["simulated"] else f"on {started['hardware']}"
    tell(f"{started['name']}: live, {what}{speed}; every {started['period'] * 1e3:g} ms; {started['state']}.")
    for fact in started["drive"]:
        tell(f"  {fact}")
    tell(f'From a second terminal: detent connect {name} enable, then detent connect {name} move_by "5 mm"')
    for one in started["not_permitted"]:
        tell(f"Not permitted: {one}")
    tell("Ctrl-C stops the axis, then ends.")
    sys.stdout.flush()


@app.command()
def connect(
    file: Annotated[Path, typer.Argument(help="Axis file that runs live, or its socket.", show_default=False)],
    word: Annotated[str, typer.Argument(help=WORD)] = "status",
    value: Annotated[str | None, typer.Argument(help='Where to, how far, how fast: "120 mm", 3, "20 mm/s".')] = None,
    speed: Annotated[float, option("--speed", "", "Share of the largest speed, above 0 to 1.")] = 1.0,
    seconds: Annotated[float, option("--for", "SECONDS", "How long a jog lasts.", min=0.0)] = 1.0,
    *,
    as_json: Json = False,
) -> None:
    """Ask an axis that runs live for something, and wait until that has ended."""
    from detent.operate.start import connect as connect_to
    from detent.operate.words import describe_status

    axis = connect_to(file)
    ended: dict[str, Any] = {}
    if word == "jog":
        if value is None:
            raise DetentError('connect: a jog needs a velocity such as "20 mm/s"')
        with axis.jog(value):
            threading.Event().wait(seconds)
    elif word != "status":
        ended = axis.do(word, value, speed, wait=False).wait().to_dict()
    status = axis.status
    if as_json:
        print_json({"status": status, "ended": ended, "why_not_moving": axis.why_not_moving})
        return
    tell(describe_status(status, axis.unit))
    for what, remedy in axis.why_not_moving:
        tell(f"  not moving: {what}; {remedy}")
