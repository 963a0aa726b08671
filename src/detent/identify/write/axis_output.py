"""An axis file of what was identified: a whole one, or numbers put into one that exists.

The whole one is an axis of the cascade method whose drive imposes the effort of the log. Its loops are those of the log
where these can be found (`loop_fit`); else they follow from mass, delay and encoder by the rules of `choose_gains`. The
file says which.
"""

import json
import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from detent.axisfile.motion import unit_in
from detent.errors import AxisError, DetentError, InputError
from detent.files.locate import Path, Place, locate_keys
from detent.files.source import parse_source
from detent.identify.fit.identification import Identification
from detent.identify.fit.loop_fit import Loops, fit_loops
from detent.identify.fit.prepare import Run
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
    """A new axis file."""
    numbers = {n.key: n for n in FileNumbers(found).numbers()}
    if not numbers["mechanics.motor_mass"].trusted:
        raise AxisError("no axis file: the mass is not trusted; record what the refusals name")
    seen = see(found.runs)
    parts = (
        _head(found, reading),
        _axis(found),
        _limits(found, seen, numbers),
        _drive(numbers, seen),
        _mechanics(numbers, seen),
        _loops(found.runs[0], numbers, seen),
    )
    return "\n".join(line for part in parts for line in part) + "\n"


def _head(found: Identification, reading: str) -> Iterator[str]:
    """What the file is, and what to do with it."""
    run = found.runs[0]
    logs = ", ".join(f"{plain(r.name)} ({format_quantity(r.t[-1], 's', 3)})" for r in found.runs)
    yield f"# Cascade axis, identified from {logs}."
    yield "#"
    yield f"#   detent run THIS_FILE --replay {plain(run.name)}{_replay_options(found, reading)}"
    yield "#"
    yield f"# Verdict: {found.verdict}. Each identified number has its 95 % interval behind it; a number that is not"
    yield "# trusted stands in a comment, and counts as not stated."
    yield from (f"# {plain(str(refusal))}" for refusal in found.refusals)
    native = NATIVE["rotary" if run.is_rotary else "linear"]
    if run.effort_unit != native:
        yield "#"
        yield f"# The log holds a {run.effort_name}, in {run.effort_unit}, and no force. Where this file says {native},"
        yield f"# read {run.effort_unit}: forces, masses and frictions are what they are to that {run.effort_name}."
    yield ""


def _replay_options(found: Identification, reading: str) -> str:
    """Options of the command that replays the log, after a space."""
    run, options = found.runs[0], f" {plain(reading)}" if reading else ""
    source = found.logs[0].columns.get(run.effort_name)
    if run.effort_name in {"force", "torque", "voltage", "command"} or source is None:
        return options
    role, native = ("torque", "N*m") if run.is_rotary else ("force", "N")
    sign = "-" if source.factor < 0 else ""
    return f"{options} --column '{role}={sign}{plain(source.column)} [{abs(source.factor):.9g} {native}]'"


def _axis(found: Identification) -> Iterator[str]:
    name = plain(found.runs[0].name).rpartition(".")[0] or plain(found.runs[0].name)
    yield "[axis]"
    yield f"name = {json.dumps(name[:80] or 'axis', ensure_ascii=False)}"
    yield 'method = "cascade"'
    if found.runs[0].is_rotary:
        yield 'motion = "rotary"'
    yield ""


def _limits(found: Identification, seen: Seen, numbers: dict[str, Number]) -> Iterator[str]:
    """What the logs show, which the axis may exceed."""
    way, rise = _unit(seen, "m"), _unit(seen, "m/s^2")
    angle = math.radians(1.0) if seen.is_rotary else 1.0
    speed = angle * outwards(seen.speed / angle, up=True, size=seen.speed / angle)
    low, high = (angle * edge for edge in _edges(seen, angle))
    mass = numbers["mechanics.motor_mass"].value
    steady = max(_resistance(numbers, way, speed) for way in ("positive", "negative"))
    left = max(FORCE_SHARE * seen.effort - steady, 0.1 * seen.effort) / mass
    took = f"{format_quantity(seen.acceleration, rise)} in the log"
    if left < seen.acceleration:
        took += f"; at full speed {FORCE_SHARE:.0%} of the effort leave this"
    shown = (format_quantity(place, way) for place in (seen.lowest, seen.highest))
    yield _said("[limits]", "what the log shows; the axis may be able to do more")
    yield _said(f"travel = {_quoted(high - low, way)}", f"{' to '.join(shown)} in the log")
    yield f"lowest = {_quoted(low, way)}"
    yield _said(f"speed = {_quoted(speed, _unit(seen, 'm/s'))}", "top speed in the log, rounded up")
    yield _said(f"acceleration = {_quoted(min(seen.acceleration, left), rise, 3)}", took)
    most = outwards(seen.effort, up=True, size=seen.effort)
    name = found.runs[0].effort_name
    yield _said(f"effort = {_quoted(most, _unit(seen, 'N'))}", f"largest {name} in the log, rounded up")
    yield ""


def _edges(seen: Seen, unit: float) -> tuple[float, float]:
    """Ends of the way, a little beyond what was seen, as round numbers of a unit."""
    margin, size = MARGIN * seen.way, seen.way / unit
    low = outwards((seen.lowest - margin) / unit, up=False, size=size)
    return low, outwards((seen.highest + margin) / unit, up=True, size=size)


def _resistance(numbers: dict[str, Number], way: str, speed: float) -> float:
    """Friction at a speed in one direction, and what holds weights."""
    sign = 1.0 if way == "positive" else -1.0
    table = f"mechanics.friction.{way}"
    found = {name: numbers[name].value for name in (f"{table}.coulomb", f"{table}.viscous") if name in numbers}
    offset = numbers["mechanics.friction.offset"].value if "mechanics.friction.offset" in numbers else 0.0
    weight = numbers["mechanics.pendulum"].value if "mechanics.pendulum" in numbers else 0.0
    return found.get(f"{table}.coulomb", 0.0) + found.get(f"{table}.viscous", 0.0) * speed + sign * offset + weight


def _drive(numbers: dict[str, Number], seen: Seen) -> Iterator[str]:
    """An amplifier that imposes the effort."""
    yield "[drive]"
    yield _said('input = "force"', f"1 V of command is 1 {_unit(seen, 'N')}")
    yield f'effort_per_volt = "1 {_unit(seen, "N/V")}"'
    yield f"command_limit = {_quoted(outwards(seen.effort, up=True, size=seen.effort), 'V')}"
    if "drive.delay" in numbers:
        yield _line(numbers["drive.delay"])
    yield ""


def _mechanics(numbers: dict[str, Number], seen: Seen) -> Iterator[str]:
    """Masses, weights, friction and the encoder."""
    way = _unit(seen, "m")
    yield "[mechanics]"
    yield _line(numbers["mechanics.motor_mass"])
    for key in ("mechanics.pendulum", "mechanics.transmission_loss"):
        if key in numbers:
            yield _line(numbers[key])
    yield _said(f"start_position = {_quoted(seen.start, way)}", "of the log")
    for table in ("mechanics.friction", "mechanics.friction.positive", "mechanics.friction.negative"):
        yield from ("", f"[{table}]")
        yield from (_line(n) for key, n in numbers.items() if key.rpartition(".")[0] == table)
    yield ""
    yield "[encoder]"
    found = "smallest step in the log" if seen.resolution > 0 else "no counts show in the log"
    yield _said(f"resolution = {_quoted(seen.resolution, way)}", found)


def _loops(run: Run, numbers: dict[str, Number], seen: Seen) -> Iterator[str]:
    """Loops of the log, or by the rules of `choose_gains`."""
    found = fit_loops(run)
    number = numbers.get("drive.delay")
    mass = numbers["mechanics.motor_mass"].value
    g = choose_gains(mass, seen, round(number.value) if number else 0)
    yield _said(f"velocity_span = {g.span if found is None else found.span}", "samples")
    yield ""
    yield from _chosen_loops(g, seen) if found is None else _found_loops(found, seen)
    yield ""
    yield _said("[method.feed_forward]", "shares of what a move takes by this file")
    if found is None:
        yield from ("velocity = 1", "acceleration = 1", "viscous = 1", "coulomb = 0.8")
    else:
        yield from _shares(found, numbers)
    if "mechanics.pendulum" in numbers and found is None:
        yield "weight = 1"


def _chosen_loops(g: Gains, seen: Seen) -> Iterator[str]:
    dead, hz = format_quantity(g.dead_time, "s", 3), f"{g.bandwidth / (2 * math.pi):.3g} Hz"
    yield _said("[method]", "no log tells these loops: they follow from mass, delay and encoder")
    yield _said(f"sample_period = {_quoted(seen.period, 's')}", "of the log")
    gain = _quoted(g.velocity, _unit(seen, "V*s/m"), 4)
    yield _said(f"velocity_gain = {gain}", f"mass x bandwidth, {hz}; the dead time is {dead}")
    yield _said(f"velocity_integral = {_quoted(g.integral, _unit(seen, 'V/m'), 4)}", "velocity_gain x bandwidth / 8")
    yield _said(f"position_gain = {g.position:.4g}", "bandwidth / 4")


def _found_loops(found: Loops, seen: Seen) -> Iterator[str]:
    yield _said("[method]", f"loops of the log: what they leave of its effort in a part not fitted: {found.error:.1%}")
    yield _said(f"sample_period = {_quoted(seen.period, 's')}", "of the log")
    yield f"velocity_gain = {_quoted(found.velocity, _unit(seen, 'V*s/m'), 5)}"
    if found.integral > 0.0:
        yield f"velocity_integral = {_quoted(found.integral, _unit(seen, 'V/m'), 5)}"
    yield f"position_gain = {found.position:.5g}"
    most = 1.5 * seen.speed + seen.effort / found.velocity
    yield _said(f"velocity_limit = {_quoted(most, _unit(seen, 'm/s'), 3)}", "never in the way")


def _shares(found: Loops, numbers: dict[str, Number]) -> Iterator[str]:
    """Feed-forward of the log's loops, as shares of what the file says."""

    def mean(name: str) -> float:
        keys = (f"mechanics.friction.{way}.{name}" for way in ("positive", "negative"))
        return sum(numbers[key].value for key in keys if key in numbers) / 2.0

    yield f"velocity = {min(found.feed_velocity, 2.0):.4g}"
    for name, fed, whole in (
        ("acceleration", found.feed_acceleration, numbers["mechanics.motor_mass"].value),
        ("viscous", found.feed_viscous, mean("viscous")),
        ("coulomb", found.feed_coulomb, mean("coulomb")),
    ):
        if fed > 0.0 and whole > 0.0:
            yield f"{name} = {min(fed / whole, 2.0):.3g}"


def _line(number: Number) -> str:
    """A key with its number; in a comment where it is not trusted."""
    said = _said(f"{number.key.rpartition('.')[2]} = {number.text}", number.note)
    return said if number.trusted else f"# not trusted: {said}"


def _said(line: str, comment: str) -> str:
    """A line and its comment, all comments in one column."""
    return f"{line:<35} # {comment}"


def _unit(seen: Seen, linear: str) -> str:
    return unit_in("rotary" if seen.is_rotary else "linear", linear)


def _quoted(value: float, unit: str, digits: int = 6) -> str:
    return f'"{format_quantity(value, unit, digits)}"'


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
