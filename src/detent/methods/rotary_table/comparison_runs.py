"""Runs an axis over the end of its turn, by hand, and from near the boundary, in every form of its method."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from detent.errors import DetentError
from detent.methods.rotary_table.build import start_turns, ticks
from detent.methods.rotary_table.comparison import AngleComparison, Crossing, Feed, Start
from detent.methods.rotary_table.host import TableHost
from detent.methods.rotary_table.schema import DisturbanceTable, PositionTable, RotaryTableSpec
from detent.methods.rotary_table.system import TICK, RotaryTable
from detent.page.parts import Numbers
from detent.record.machine import Progress
from detent.record.recorder import Recorder
from detent.units import format_quantity

START = math.radians(100)  # where the crossing begins [rad]
TARGET = math.radians(540)  # target of the conventional unit [rad]: one and a half turns
WATCHED = 2 * math.tau  # way of a jog while the crossing is watched [rad]

FEED_SPEEDS = tuple(math.radians(speed) for speed in (0.1, 1.0, 60.0))  # of manual feed [rad/s], up to the axis's own
FEED_START, FEED_TIME = 2.0, 10.0  # mean speeds are taken from so long after the start on, for at least so long [s]
FEED_COUNTS, FEED_LONGEST = 1000, 1000.0  # and over at least so many counts, though no longer than this [s]
FORWARD = math.radians(840)  # way of a jog that starts near the boundary [rad]: two rollovers
LAGS = (0.0, 0.25, 0.5, 1.0, 1.5)  # where it starts, in following errors: a table that lags more than that fails
FORMS: dict[str, dict[str, object]] = {
    "flag": {"form": "flag", "guarded": False},
    "guarded flag": {"form": "flag", "guarded": True},
    "turn counter": {"form": "turn counter", "guarded": False},
}
"""Forms of the extension, all judged by the theoretical remaining angle (specification 3.2, 3.5; test 12)."""

MOST_ROWS = 400_000
LONGEST_TURN = 3600.0  # a table that takes longer for a turn is not compared: nobody would see it go round [s]


def compare_angle(spec: RotaryTableSpec, *, progress: Progress | None = None) -> AngleComparison:
    """Take the axis over the end of its turn, feed it by hand, and start it near the boundary, in every form."""
    speed = crossing_speed(spec)
    if speed < math.tau / LONGEST_TURN:
        least = format_quantity(math.tau / LONGEST_TURN, "rad/s")
        raise DetentError(
            f"compare: came a table that goes round at {format_quantity(speed, 'rad/s')}; allowed: {least} or more, a "
            "turn in an hour; do: raise limits.speed, or limits.acceleration where it stops the table too slowly"
        )
    speeds = sorted({min(wanted, spec.limits.speed) for wanted in FEED_SPEEDS})
    lag = speed / spec.method.position_gain / (1 - spec.drive.droop)
    places = sorted({*(share * lag for share in LAGS), spec.count, START})
    starts = [(place, form) for place in places for form in FORMS]
    runs = 2 + len(speeds) + len(starts)
    done = 0

    def told(what: str, result: Any) -> Any:
        """Say that one more run is done, and hand it on."""
        nonlocal done
        done += 1
        if progress is not None:
            progress(done / runs, what)
        return result

    return AngleComparison(
        speed=speed,
        following_error=lag,
        crossings=(
            told("conventional crossing", _cross(spec, speed, endless=False)),
            told("endless crossing", _cross(spec, speed, endless=True)),
        ),
        feeds=tuple(told("manual feed", _feed(spec, wanted)) for wanted in speeds),
        starts=tuple(told(f"start with {form}", _start(spec, speed, place, form)) for place, form in starts),
    )


def crossing_speed(spec: RotaryTableSpec) -> float:
    """Speed of the crossings [rad/s]: the axis's largest from which it stops within a quarter turn."""
    return min(spec.limits.speed, math.sqrt(2 * spec.limits.acceleration * math.tau / 4))


def _variant(spec: RotaryTableSpec, place: float, **changes: object) -> RotaryTableSpec:
    """The axis at a start angle [rad], with the recommended method (specification 3.5) but for the changes."""
    usual: dict[str, object] = {
        "form": "turn counter", "judge": "theoretical", "inclusive": False, "guarded": False, "update": "atomic",
        "signed_remaining": True, "position_control": True,
    }  # fmt: skip
    return spec.model_copy(
        update={
            "mechanics": spec.mechanics.model_copy(update={"start_angle": place}),
            "method": spec.method.model_copy(update=usual | changes),
            "disturbance": DisturbanceTable(),
            "protection": spec.protection.lifted(),
        }
    )


_SIGNALS = (
    "plant.train.motor.turns", "plant.train.motor.angle", "plant.train.motor.velocity", "controller.positioner.dr",
    "controller.positioner.s4", "controller.positioner.angle.crossings",
)  # fmt: skip


def _run(spec: RotaryTableSpec, seconds: float, begin: Callable[[TableHost], None]) -> dict[str, Numbers]:
    """Let the host begin something, and time pass; the table may do what it likes.

    Columns by the names of `Crossing`, one value per interrupt or less often, and the speed of the table [rad/s].
    """
    strobes = max(1, math.ceil(seconds / spec.method.strobe_period / MOST_ROWS))
    every = strobes * ticks(spec.method.strobe_period)
    recorder = Recorder(RotaryTable, _SIGNALS, every=every, period=TICK)
    host = TableHost(spec, recorder)
    host.start()
    start = host.tick
    begin(host)
    while host.tick < start + ticks(seconds):
        host.machine.pass_ticks(start + ticks(seconds) - host.tick)
        host.acknowledge()
    host.machine.close()
    trace = recorder.trace()
    turns = trace["plant.train.motor.turns"] - math.floor(start_turns(spec))
    return {
        "t": trace.time - start * TICK,
        "angle": (turns + trace["plant.train.motor.angle"] / math.tau - start_turns(spec) % 1)
        * (math.tau / spec.ratio),
        "speed": trace["plant.train.motor.velocity"] / spec.ratio,
        "deviation": trace["controller.positioner.dr"] * (spec.count / (1 << spec.method.fraction_bits)),
        "s4": trace["controller.positioner.s4"] * spec.speed_per_word,
        "crossings": trace["controller.positioner.angle.crossings"],
    }


def _cross(spec: RotaryTableSpec, speed: float, *, endless: bool) -> Crossing:
    """Over the end of the turn: by a jog, or conventionally by a positioning beyond it."""
    target = PositionTable.model_construct(angle=TARGET, speed=speed, direction="as commanded")
    axis = _variant(spec, START, form="turn counter" if endless else "raw").model_copy(
        update={"position": {"0": target}}
    )
    seconds = WATCHED / speed + speed / spec.limits.acceleration
    seen = _run(axis, seconds, lambda host: host.press(1, speed) if endless else host.begin(0))
    t, deviation = seen["t"], seen["deviation"]
    after = int(np.argmax(seen["crossings"] > 0))
    crossed = bool(seen["crossings"][after]) and after > 0
    return Crossing(
        name="endless" if endless else "conventional",
        time=float(t[after]) if crossed else math.nan,
        deviation_before=float(deviation[after - 1]) if crossed else math.nan,
        deviation_after=float(deviation[after]) if crossed else math.nan,
        travel=float(seen["angle"][-1]),
        speed=float(seen["speed"][-1]),
        **{name: seen[name] for name in ("t", "angle", "deviation", "s4")},
    )


def _feed(spec: RotaryTableSpec, speed: float) -> Feed:
    """Mean speed of a jog with and without position control."""
    span = min(max(FEED_TIME, FEED_COUNTS * spec.count / speed), FEED_LONGEST)
    begin = FEED_START + speed / spec.limits.acceleration
    errors: list[float] = []
    for closed in (True, False):
        seen = _run(_variant(spec, START, position_control=closed), begin + span, lambda host: host.press(1, speed))
        late = seen["t"] >= begin
        errors.append(float(np.polyfit(seen["t"][late], seen["angle"][late], 1)[0]) / speed - 1)
    return Feed(speed=speed, closed=errors[0], opened=errors[1])


def _start(spec: RotaryTableSpec, speed: float, place: float, form: str) -> Start:
    """A jog to larger angles from a place, with one form."""
    ramp = speed / spec.limits.acceleration
    seen = _run(_variant(spec, place, **FORMS[form]), FORWARD / speed, lambda host: host.press(1, speed))
    asked = FORWARD - speed * ramp / 2
    travel = float(seen["angle"][-1])
    return Start(angle=place, form=form, travel=travel, asked=asked, thrown_back=asked - travel > math.tau / 2)
