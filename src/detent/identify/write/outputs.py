"""What an identification leaves: an axis file, whole or numbers put into one, and a list of moves that shows the rest.

The whole file is an axis of the cascade method whose drive imposes the effort of the log. Its loops are those of the
log where these can be found (`loop_fit`); else they follow from mass, delay and encoder by the rules of `choose_gains`.

Of the moves, ramps show a mass, steady speeds that differ viscous friction, both directions Coulomb friction and a
constant force, the slowest moves static friction. They go to and fro inside the travel, at shares of the top speed.
"""

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from detent.axisfile.motion import unit_in
from detent.errors import AxisError, DetentError
from detent.files.fields import held_leaves
from detent.files.patch import Change, NewValue, patch
from detent.files.problems import dotted
from detent.files.source import parse_source
from detent.identify.fit.identification import Identification
from detent.identify.fit.loop_fit import Loops, fit_loops
from detent.identify.fit.verdict import Refusal
from detent.identify.write.file_numbers import NATIVE, Bounds, FileNumbers, Number, grid_of, outwards, plain, see
from detent.identify.write.intervals import tolerance_values
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
INSIDE = 0.05  # share of the travel that is left free at both ends
STEADY_TIME = 0.8  # time at a steady speed that a move is planned for [s]
SLOWER = 0.5  # share of the top speed that remains where the effort was at its limit
LEAST = 20.0  # length of a recording that is aimed at [s]
RAMP = 0.15  # time of a ramp where neither the axis nor the log tells one [s]
_SPEEDS = "several steady speeds, both ways: viscous friction, Coulomb friction, a constant force"
Move = tuple[float, float, float]  # target, speed, and rest after it [s]


def axis_toml(found: Identification, base: str | None = None, file: str = "axis file", reading: str = "") -> str:
    """Write an axis file."""
    _refuse_untrusted(found)
    if base is not None:
        return patched_axis(found, base, file)[0]
    made = _whole_file(found, reading)
    spec = cascade_spec(made, file)
    made, _ = patch(made, _tolerances(found, list(FileNumbers(found).numbers()), made, spec), file)
    axis_of(parse_source(file, made))
    return made


def patched_axis(found: Identification, base: str, file: str) -> tuple[str, list[Change]]:
    """Put what was identified and is trusted into an axis file."""
    _refuse_untrusted(found)
    spec = cascade_spec(base, file)
    numbers = list(FileNumbers(found, spec).numbers())
    values = [NewValue(n.key, n.value, n.unit, n.note) for n in numbers if n.trusted]
    made, changes = patch(base, values + _tolerances(found, numbers, base, spec), file)
    cascade_spec(made, file)
    return made, changes


def _tolerances(found: Identification, numbers: list[Number], text: str, spec: CascadeSpec) -> list[NewValue]:
    held = {dotted(path) for path, _, value in held_leaves(spec) if isinstance(value, int | float)}
    return tolerance_values(numbers, found.constants, text.removeprefix("\ufeff"), held)


def _refuse_untrusted(found: Identification) -> None:
    if found.verdict == "refused":
        raise AxisError("no axis file: nothing that was identified is trusted; record what the refusals name")


def cascade_spec(text: str, file: str) -> CascadeSpec:
    """Read the text of an axis file of the cascade method."""
    return CascadeSpec.of(axis_of(parse_source(file, text.removeprefix("\ufeff"))).spec, file)


@dataclass(frozen=True, slots=True)
class Gains:
    """Loops of an axis."""

    span: int  # samples that the velocity is a difference over
    dead_time: float  # of the velocity loop [s]
    bandwidth: float  # of the velocity loop [rad/s]
    position: float  # gain of the position loop [1/s]
    velocity: float  # and integral: gains of the velocity loop, effort per velocity and per position
    integral: float


def choose_gains(mass: float, seen: Bounds, delay: int) -> Gains:
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
    seen, run = replace(see(found.runs), grid=grid_of(found.logs)), found.runs[0]
    loops, motion = fit_loops(run), "rotary" if run.is_rotary else "linear"
    gains = choose_gains(mass.value, seen, round(delay.value) if delay else 0)
    file_name = plain(run.name)

    def shown(value: float, linear: str, digits: int = 4) -> str:
        return format_quantity(value, unit_in(motion, linear), digits)

    told = {
        "logs": ", ".join(f"{plain(r.name)} ({format_quantity(r.t[-1], 's', 3)})" for r in found.runs),
        "name": json.dumps((file_name.rpartition(".")[0] or file_name)[:80] or "axis", ensure_ascii=False),
        "replay": _replay_options(found, reading),
        "native": NATIVE[motion],
        "hertz": gains.bandwidth / (2 * math.pi),
    }
    rules = {"limits": _limits(seen, numbers), "force_share": FORCE_SHARE, "shares": _shares(loops, numbers)}
    known = {"found": found, "run": run, "seen": seen, "loops": loops, "gains": gains, "numbers": numbers}
    return _render("axis.toml.j2", **told, **rules, **known, line=_line, plain=plain, said=_said, shown=shown)


def _replay_options(found: Identification, reading: str) -> str:
    """Options of the command that replays the log, after a space."""
    run, options = found.runs[0], f" {plain(reading)}" if reading else ""
    source = found.logs[0].columns.get(run.effort_name)
    if run.effort_name in {"force", "torque", "voltage", "command"} or source is None:
        return options
    role, native = ("torque", "N*m") if run.is_rotary else ("force", "N")
    sign = "-" if source.factor < 0 else ""
    return f"{options} --column '{role}={sign}{plain(source.column)} [{abs(source.factor):.9g} {native}]'"


def _limits(seen: Bounds, numbers: dict[str, Number]) -> dict[str, float]:
    """What the logs show, a little beyond it and in round numbers; the axis may be able to do more."""
    unit = math.radians(1.0) if seen.is_rotary else 1.0
    speed = unit * outwards(seen.speed / unit, up=True, size=seen.speed / unit)
    margin, size = MARGIN * seen.way, seen.way / unit
    low = unit * outwards((seen.lowest - margin) / unit, up=False, size=size)
    high = unit * outwards((seen.highest + margin) / unit, up=True, size=size)
    offset, weight = _value(numbers, "friction.offset"), _value(numbers, "pendulum")
    needs: list[float] = []  # effort at that speed, in each direction
    for way, sign in (("positive", 1.0), ("negative", -1.0)):
        coulomb, viscous = (_value(numbers, f"friction.{way}.{kind}") for kind in ("coulomb", "viscous"))
        needs.append(coulomb + viscous * speed + sign * offset + weight)
    left = max(FORCE_SHARE * seen.effort - max(needs), 0.1 * seen.effort) / _value(numbers, "motor_mass")
    effort, rise = outwards(seen.effort, up=True, size=seen.effort), min(seen.acceleration, left)
    return {"travel": high - low, "lowest": low, "speed": speed, "acceleration": rise, "effort": effort}


def _shares(loops: Loops | None, numbers: dict[str, Number]) -> dict[str, str]:
    """Feedforward of the log's loops, as shares of what the file says; where none are known, by rule."""
    if loops is None:
        shares = {"velocity": "1", "acceleration": "1", "viscous": "1", "coulomb": "0.8"}
        return shares | ({"weight": "1"} if "mechanics.pendulum" in numbers else {})
    shares = {"velocity": f"{min(loops.feed_velocity, 2.0):.4g}"}
    viscous, coulomb = (
        sum(_value(numbers, f"friction.{way}.{name}") for way in ("positive", "negative")) / 2.0
        for name in ("viscous", "coulomb")
    )
    feeds = {"acceleration": loops.feed_acceleration, "viscous": loops.feed_viscous, "coulomb": loops.feed_coulomb}
    wholes = {"acceleration": _value(numbers, "motor_mass"), "viscous": viscous, "coulomb": coulomb}
    known = {name: fed / wholes[name] for name, fed in feeds.items() if fed > 0.0 and wholes[name] > 0.0}
    return shares | {name: f"{min(share, 2.0):.3g}" for name, share in known.items()}


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


# ---- a list of moves


def bounds_of(found: Identification, spec: CascadeSpec | None) -> Bounds:
    """Limits of an axis, and a little less of its travel; without one what the axis did in its logs."""
    if spec is not None:
        limits, margin = spec.limits, INSIDE * spec.limits.travel
        low, high, start = limits.lowest + margin, spec.highest - margin, spec.mechanics.start_position
        return Bounds(low, high, limits.speed, limits.acceleration, start, spec.axis.motion == "rotary")
    seen = see(found.runs)
    if not (seen.way > 20.0 * seen.resolution and seen.speed > 0.0):
        raise DetentError(
            f"{found.runs[0].name}: got a log without motion; expected: one that shows how far and how fast the axis "
            "may go; name the axis file whose limits the moves shall keep: --axis FILE"
        )
    return replace(seen, acceleration=max(seen.acceleration, seen.speed / 2.0))


@dataclass(frozen=True, slots=True)
class Part:
    """Moves for one thing that is to be seen."""

    text: str  # what they are for
    shares: tuple[float, ...]  # speeds, as shares of the top speed
    steady: float  # time at that speed in each move [s]; 0 for the shortest way that reaches it
    dwell: float = 0.0  # rest after each move [s]


SPEEDS = Part(_SPEEDS, (0.1, 0.25, 0.5, 0.75, 1.0), STEADY_TIME)
RAMPS = Part("short ramps, one after the other: the mass", (0.6, 0.8, 1.0, 0.9, 0.7, 1.0), 0.0)
SLOW = Part("slow, both ways: friction near standstill", (0.01, 0.02, 0.04, 0.07), 1.5, 0.1)
REVERSALS = Part("both directions: friction is told from a constant force", (0.3, 0.6), STEADY_TIME, 0.1)
# What a refusal asks for beside its constants and, where it concerns all of them, a log of its own.
_BY_SUBJECT = {"model does not explain the log": (SLOW,), "friction below 0": (SPEEDS, SLOW)}
# What shows a constant, by its kind; slow moves show all others.
_BY_CONSTANT = {"mass": RAMPS, "viscous": SPEEDS, "coulomb": REVERSALS}


def missing_parts(refusals: Sequence[Refusal]) -> list[Part]:
    """Moves that refusals ask for; all of them where there are none.

    A log of which nothing is trusted is of no use, so that the next one must show everything but static friction; else
    the moves only add what is missing.

    >>> [part.text for part in missing_parts([Refusal("little acceleration", "", "", ("mass",))])]
    ['short ramps, one after the other: the mass']
    """
    wanted: list[Part] = []
    for refusal in refusals:
        wanted += _BY_SUBJECT.get(refusal.subject, ())
        wanted += [_BY_CONSTANT.get(name.partition(".")[0], SLOW) for name in refusal.constants]
        wanted += [] if refusal.constants else [SPEEDS, RAMPS]
    parts = [part for part in (REVERSALS, SPEEDS, RAMPS, SLOW) if not wanted or part in wanted]
    return [part for part in parts if part is not REVERSALS or SPEEDS not in parts]


def excitation_job(found: Identification, axis: CascadeSpec | None = None) -> str:
    """Write a list of moves that a recording needs for what is missing, as ``template/moves.toml.j2`` shows it."""
    bounds = bounds_of(found, axis)
    told = f"travel and speed of {found.runs[0].name}" if axis is None else f"limits of {axis.axis.name}"
    subjects = {refusal.subject for refusal in found.refusals}
    moves = _Moves(bounds, SLOWER * bounds.speed if "saturated" in subjects else bounds.speed)
    middle = 0.5 * (bounds.lowest + bounds.highest)
    parts = [("to the middle of the way", [moves.to(middle, 0.5 * moves.top)])]
    parts += [(part.text, moves.of(part, middle)) for part in missing_parts(found.refusals)]
    parts += [("back to the begin", [moves.to(bounds.start, 0.5 * moves.top)])]
    texts = {"told": plain(told), "logs": ", ".join(plain(log.name) for log in found.logs), "subjects": subjects}
    repeat, way = max(1, math.ceil(LEAST / moves.seconds)), "rad" if bounds.is_rotary else "m"
    times = {"top": moves.top, "seconds": moves.seconds, "repeat": repeat, "slower": SLOWER}
    known = {"found": found, "bounds": bounds, "parts": parts, "way": way}
    return _render("moves.toml.j2", **texts, **times, **known, plain=plain, quantity=format_quantity)


class _Moves:
    """Makes moves to and fro, and counts their time."""

    def __init__(self, bounds: Bounds, top: float) -> None:
        self.top, self.seconds = top, 0.0
        self._free, self._place = bounds.highest - bounds.lowest, bounds.start
        self._rise = bounds.acceleration if bounds.acceleration > 0.0 else top / RAMP

    def of(self, part: Part, middle: float) -> list[Move]:
        """Moves of a part, each speed there and back around the middle of the travel."""
        found: list[Move] = []
        for speed in (share * self.top for share in part.shares):
            way = min(speed * part.steady + speed**2 / self._rise, self._free)
            found += [self.to(middle + sign * 0.5 * way, speed, part.dwell) for sign in (1.0, -1.0)]
        return found

    def to(self, target: float, speed: float, dwell: float = 0.0) -> Move:
        """One move."""
        way = abs(target - self._place)
        self._place = target
        ramp = speed / self._rise
        self.seconds += dwell + (way / speed + ramp if way > speed * ramp else 2.0 * math.sqrt(way / self._rise))
        return target, speed, dwell


def _render(template: str, **values: Any) -> str:
    """Text of a file, by the template that looks like it."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    templates = Environment(  # noqa: S701 - TOML, not HTML
        loader=PackageLoader("detent.identify", "template"), undefined=StrictUndefined,
        trim_blocks=True, lstrip_blocks=True, keep_trailing_newline=True,
    )  # fmt: skip
    return templates.get_template(template).render(values)
