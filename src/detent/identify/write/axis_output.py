"""An axis file of what was identified: a whole one, or numbers put into one that exists.

The whole one is an axis of the cascade method whose drive imposes the effort of the log. Its loops are those of the log
where these can be found (`loop_fit`); else they follow from mass, delay and encoder by the rules of `choose_gains`. The
file says which.
"""

import json
import math
from collections.abc import Iterable
from dataclasses import dataclass

from detent.axisfile.motion import unit_in
from detent.errors import AxisError, DetentError, InputError
from detent.files.locate import Path, Place, locate_keys
from detent.files.source import parse_source
from detent.identify.fit.identification import Identification
from detent.identify.fit.loop_fit import Loops, fit_loops
from detent.identify.write import render
from detent.identify.write.file_numbers import NATIVE, FileNumbers, Number, plain
from detent.identify.write.seen import Seen, outwards, see
from detent.methods.cascade.schema import MOST_SAMPLES, CascadeSpec
from detent.methods.load import axis_of
from detent.units import format_quantity

CLEAR = 0.3  # angle of the velocity loop's crossover frequency over its dead time [rad]: 17 degrees of phase
FASTEST = 2 * math.pi * 40  # largest bandwidth chosen for a velocity loop [rad/s]: no log shows what may swing above it
STEADY = 0.02  # velocity of one count of the encoder over the top speed, at most
LONGEST = 5e-3  # longest stretch that the velocity is a difference over [s]
JUMP = 0.08  # share of the largest effort by which one count of the velocity may move the command
MARGIN = 0.05  # way left at both ends of the seen travel, over that travel
FORCE_SHARE = 0.9  # share of the largest effort that a move at the limits may take


def axis_toml(found: Identification, base: str | None = None, file: str = "axis file", reading: str = "") -> str:
    """Write an axis file."""
    if found.verdict == "refused":
        raise AxisError("no axis file: nothing that was identified is trusted; record what the refusals name")
    if base is None:
        made = _whole_file(found, reading)
    else:
        spec = cascade_spec(base, file)
        made = patch(base, [n for n in FileNumbers(found, spec).numbers() if n.trusted], file)
    axis_of(parse_source(file, made))
    return made


def cascade_spec(text: str, file: str) -> CascadeSpec:
    """Read the text of an axis file of the cascade method."""
    spec = axis_of(parse_source(file, text)).spec
    if not isinstance(spec, CascadeSpec):
        raise DetentError(
            f"{file}: came an axis of the method {spec.axis.method}; allowed: cascade, whose constants are those of an "
            "identification; name an axis file of it, or leave it out"
        )
    return spec


# ---- a whole file


@dataclass(frozen=True, slots=True)
class Gains:
    """Loops of an axis."""

    span: int  # samples that the velocity is a difference over
    dead_time: float  # of the velocity loop [s]
    bandwidth: float  # of the velocity loop [rad/s]
    position: float  # gain of the position loop [1/s]
    velocity: float  # and integral: gains of the velocity loop, effort per velocity and per position
    integral: float


def choose_gains(mass: float, seen: Seen, delay: int) -> Gains:
    """Gains of a rigid axis of which a log tells mass, delay [samples] and encoder.

    The velocity is a difference over as many samples as make one count `STEADY` of the top speed. The velocity loop's
    bandwidth is `CLEAR` over its dead time, `FASTEST` at most, and less where one count would move the command by more
    than `JUMP`; the position loop has a quarter of it, the integral an eighth.
    """
    period, count = seen.period, seen.resolution
    longest = max(1, min(MOST_SAMPLES, math.floor(LONGEST / period)))
    span = min(longest, max(1, math.ceil(count / (STEADY * seen.speed * period))))
    dead = period * (0.5 + delay + 0.5 * span)
    band = min(CLEAR / dead, FASTEST)
    if count > 0.0:
        band = min(band, JUMP * seen.effort / (mass * count / (span * period)))
    return Gains(span, dead, band, band / 4, mass * band, mass * band * band / 8)


def _whole_file(found: Identification, reading: str) -> str:
    """A new axis file, as ``template/axis.toml.j2`` shows it."""
    numbers = {n.key: n for n in FileNumbers(found).numbers()}
    mass, delay = numbers["mechanics.motor_mass"], numbers.get("drive.delay")
    if not mass.trusted:
        raise AxisError("no axis file: the mass is not trusted; record what the refusals name")
    seen, run = see(found.runs), found.runs[0]
    loops, motion = fit_loops(run), "rotary" if run.is_rotary else "linear"
    gains = choose_gains(mass.value, seen, round(delay.value) if delay else 0)
    file_name = plain(run.name)

    def shown(value: float, linear: str, digits: int = 4) -> str:
        return format_quantity(value, unit_in(motion, linear), digits)

    return render(
        "axis.toml.j2",
        found=found,
        run=run,
        seen=seen,
        logs=", ".join(f"{plain(r.name)} ({format_quantity(r.t[-1], 's', 3)})" for r in found.runs),
        name=json.dumps((file_name.rpartition(".")[0] or file_name)[:80] or "axis", ensure_ascii=False),
        replay=_replay_options(found, reading),
        native=NATIVE[motion],
        limits=_limits(seen, numbers),
        force_share=FORCE_SHARE,
        loops=loops,
        gains=gains,
        hertz=gains.bandwidth / (2 * math.pi),
        shares=_shares(loops, numbers),
        numbers=numbers,
        line=_line,
        plain=plain,
        said=_said,
        shown=shown,
    )


def _replay_options(found: Identification, reading: str) -> str:
    """Options of the command that replays the log, after a space."""
    run, options = found.runs[0], f" {plain(reading)}" if reading else ""
    source = found.logs[0].columns.get(run.effort_name)
    if run.effort_name in {"force", "torque", "voltage", "command"} or source is None:
        return options
    role, native = ("torque", "N*m") if run.is_rotary else ("force", "N")
    sign = "-" if source.factor < 0 else ""
    return f"{options} --column '{role}={sign}{plain(source.column)} [{abs(source.factor):.9g} {native}]'"


def _limits(seen: Seen, numbers: dict[str, Number]) -> dict[str, float]:
    """What the logs show, a little beyond it and in round numbers; the axis may be able to do more."""
    unit = math.radians(1.0) if seen.is_rotary else 1.0
    speed = unit * outwards(seen.speed / unit, up=True, size=seen.speed / unit)
    margin, size = MARGIN * seen.way, seen.way / unit
    low = unit * outwards((seen.lowest - margin) / unit, up=False, size=size)
    high = unit * outwards((seen.highest + margin) / unit, up=True, size=size)
    offset, weight = _value(numbers, "friction.offset"), _value(numbers, "pendulum")
    steady = max(
        _value(numbers, f"friction.{way}.coulomb")
        + _value(numbers, f"friction.{way}.viscous") * speed
        + sign * offset
        + weight
        for way, sign in (("positive", 1.0), ("negative", -1.0))
    )
    left = max(FORCE_SHARE * seen.effort - steady, 0.1 * seen.effort) / _value(numbers, "motor_mass")
    return {
        "travel": high - low,
        "lowest": low,
        "speed": speed,
        "acceleration": min(seen.acceleration, left),
        "effort": outwards(seen.effort, up=True, size=seen.effort),
    }


def _shares(loops: Loops | None, numbers: dict[str, Number]) -> dict[str, str]:
    """Feed-forward of the log's loops, as shares of what the file says; where none are known, by rule."""
    if loops is None:
        shares = {"velocity": "1", "acceleration": "1", "viscous": "1", "coulomb": "0.8"}
        return shares | ({"weight": "1"} if "mechanics.pendulum" in numbers else {})
    shares = {"velocity": f"{min(loops.feed_velocity, 2.0):.4g}"}
    viscous, coulomb = (
        sum(_value(numbers, f"friction.{way}.{name}") for way in ("positive", "negative")) / 2.0
        for name in ("viscous", "coulomb")
    )
    for name, fed, whole in (
        ("acceleration", loops.feed_acceleration, _value(numbers, "motor_mass")),
        ("viscous", loops.feed_viscous, viscous),
        ("coulomb", loops.feed_coulomb, coulomb),
    ):
        if fed > 0.0 and whole > 0.0:
            shares[name] = f"{min(fed / whole, 2.0):.3g}"
    return shares


def _value(numbers: dict[str, Number], name: str) -> float:
    """A number of the mechanics; 0 where the file has none."""
    key = f"mechanics.{name}"
    return numbers[key].value if key in numbers else 0.0


def _line(number: Number) -> str:
    """A key with its number; in a comment where it is not trusted."""
    said = _said(f"{number.key.rpartition('.')[2]} = {number.text}", number.note)
    return said if number.trusted else f"# not trusted: {said}"


def _said(line: str, comment: str) -> str:
    """A line and its comment, all comments in one column."""
    return f"{line:<35} # {comment}"


# ---- numbers put into a file


def patch(text: str, numbers: Iterable[Number], file: str) -> str:
    """Put numbers into an axis file.

    A number that the file states is replaced where it stands, and what is said of it goes into a comment: behind it, or
    into a line of its own above where there is a comment already. A number that it does not state is added to its
    table.
    """
    newline = "\r\n" if "\r\n" in text else "\n"
    lines = text.split(newline)
    for number in numbers:
        path = tuple(number.key.split("."))
        # Every number moves the lines below it.
        places = locate_keys("\n".join(lines))
        if path in places:
            _replace(lines, places[path], number)
        else:
            _add(lines, places, path, number, file)
    return newline.join(lines)


def _replace(lines: list[str], place: Place, number: Number) -> None:
    """Put a number in the place of another."""
    row = place.line - 1
    line = lines[row]
    begin = line.index(place.text, line.index("=", place.column - 1))
    head, tail = line[:begin], line[begin + len(place.text) :]
    lines[row] = f"{head}{number.text}{tail}"
    if tail.strip():
        indent = line[: len(line) - len(line.lstrip())]
        was = "" if place.text == number.text else f"{place.text.strip(chr(34))} before; "
        lines.insert(row, f"{indent}# {was}{number.note}")
    else:
        lines[row] += f"  # {number.note}"


def _add(lines: list[str], places: dict[Path, Place], path: Path, number: Number, file: str) -> None:
    """Add a number to its table, or the table too."""
    table, said = path[:-1], f"{path[-1]} = {number.text}  # {number.note}"
    keys = [place.line for known, place in places.items() if known[:-1] == table]
    keys = [line for line in keys if not lines[line - 1].lstrip().startswith("[")]
    header = places.get(table)
    if header is not None and lines[header.line - 1].lstrip().startswith("["):
        lines.insert(max([header.line, *keys]), said)
        return
    if keys:
        raise InputError.of_file(
            file,
            f"{'.'.join(table)} without a table of its own",
            f"[{'.'.join(table)}], which {path[-1]} can be added to",
            "write its keys below such a line",
        )
    while lines and not lines[-1].strip():
        lines.pop()
    lines += ["", f"[{'.'.join(table)}]", said, ""]
