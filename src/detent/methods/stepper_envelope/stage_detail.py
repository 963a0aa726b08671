"""The most telling motion of a stage's job, step by step: under its table, its torques, and how the rotor followed."""

import math
from collections.abc import Callable

import numpy as np

from detent.methods.stepper_envelope.page_data import MoveDetail, RotorPath
from detent.methods.stepper_envelope.run import MotorMove, StageMoveRecord, StageRun
from detent.methods.stepper_envelope.schema import StepperEnvelopeSpec, StepperTable
from detent.methods.stepper_envelope.stage_job import Change, StageJog, StageMove
from detent.methods.stepper_envelope.stage_results import StageMoveResult
from detent.methods.stepper_envelope.stage_trace import (
    Leg,
    MadeSteps,
    arc_of,
    has,
    legs_of,
    motor_runs,
    move_envelope,
    step_torques,
    travel_envelope,
)
from detent.methods.stepper_envelope.summary import Motion, stated
from detent.page.parts import Event, Numbers
from detent.page.words import GAP
from detent.record.trace import Trace

POINTS = 600
"""Points of one run in the figure of frequency against position."""

NEEDED_ROTOR = ("timer.period", "rule.direction", "rotor.velocity", "rotor.lag")
"""Registers that the rotor is drawn from."""


def move_detail(
    spec: StepperEnvelopeSpec,
    run: StageRun,
    trace: Trace,
    steps: dict[str, MadeSteps],
    results: list[StageMoveResult],
) -> MoveDetail | None:
    """The most telling of the motions that were recorded whole; None if no motion was recorded whole.

    It is the one that lost steps or missed its place first, else the one that had to pass a stop, else the one with the
    least torque margin, of several such the longest.
    """
    whole = [motion for motion in run.made if _recorded(trace, steps, motion)]
    if not whole:
        return None
    (move, name, motor), why = _choose(spec, whole)
    table, asked = spec.stepper[name], next(asked for asked in run.job.moves if asked.number == move.number)
    legs = legs_of(steps[name], table, move, motor)
    # The extremes of a manual run are the ends of the travel.
    envelope = travel_envelope(table) if isinstance(asked, StageJog) else move_envelope(table, legs)
    result = next(result for result in results if result.number == move.number)
    return MoveDetail(
        number=move.number,
        label=move.label,
        why=why,
        motion=next(motion for motion in result.motions if motion.motor == name),
        runs=motor_runs(name, table, envelope, [arc_of(leg, table, POINTS) for leg in legs]),
        torques=step_torques(table, legs),
        rotor=_rotor(spec, trace, (move, name, motor), _events(spec, asked, (move, name, motor), legs)),
    )


def _recorded(trace: Trace, steps: dict[str, MadeSteps], motion: Motion) -> bool:
    move, name, motor = motion
    if name not in steps or move.ready > trace.time[-1] + (trace.time[1] - trace.time[0]):
        return False
    return len(steps[name].between(move.begin, motor.arrived).t) > 0


def _choose(spec: StepperEnvelopeSpec, whole: list[Motion]) -> tuple[Motion, str]:
    bounds = spec.controller.tolerance
    reasons: tuple[tuple[str, Callable[[MotorMove], bool]], ...] = (
        ("the motion that lost steps first", lambda motor: motor.lost != 0),
        ("the motion that did not end in its place", lambda motor: motor.missed != 0 or abs(motor.rest_lag) > bounds),
        ("the motion that had to pass its stop", lambda motor: motor.overrun),
    )
    for why, applies in reasons:
        found = [motion for motion in whole if applies(motion[2])]
        if found:
            return found[0], why
    least = min(_margin(motion) for motion in whole)
    tied = [motion for motion in whole if _margin(motion) == least]
    why = "the motion with the least torque margin" + (", the longest of several" if len(tied) > 1 else "")
    return max(tied, key=lambda motion: motion[2].steps), why


def _margin(motion: Motion) -> float:
    """In three digits: what is equal to a reader is equal."""
    return float(f"{motion[2].margin:.3g}")


# ---- how the rotor followed


def _rotor(spec: StepperEnvelopeSpec, trace: Trace, motion: Motion, events: list[Event]) -> RotorPath | None:
    move, name, _ = motion
    if not has(trace, name, NEEDED_ROTOR):
        return None
    table, part = spec.stepper[name], trace.between(move.begin, move.ready)
    period, direction, velocity, lag = (part[f"{name}.{signal}"] for signal in NEEDED_ROTOR)
    return RotorPath(
        t=part.time - move.begin,
        velocity=velocity * table.mechanics.travel_per_revolution / (2 * math.pi),
        velocity_ref=_field_speed(spec, table, period, direction),
        lag=lag,
        tolerance=spec.controller.tolerance,
        events=events,
    )


def _field_speed(spec: StepperEnvelopeSpec, table: StepperTable, period: Numbers, direction: Numbers) -> Numbers:
    """Speed of the field as travel [m/s]: a step per period, 0 at rest."""
    hz = np.divide(spec.controller.timer, period, out=np.zeros(len(period)), where=period > 0)
    return table.step * hz * direction


def _events(spec: StepperEnvelopeSpec, asked: StageMove | StageJog, motion: Motion, legs: list[Leg]) -> list[Event]:
    """What happened in the move, in order of time since the start signal."""
    move, name, motor = motion
    events = [Event(0.0, _start_text(asked, name))]
    if isinstance(asked, StageJog):
        events.append(Event(asked.duration, "the joystick is let go"))
    elif asked.change is not None:
        events += _change_events(spec.stepper[name], asked.change, move, legs)
    events += [
        Event(float(leg.made.t[0]) - move.begin, f"turns, {'up' if leg.direction > 0 else 'down'} from here")
        for leg in legs[1:]
    ]
    events += [Event(motor.arrived - move.begin, "the last step is over"), *_rest_events(spec, move, motor)]
    return sorted(events, key=lambda event: event.t)


def _start_text(asked: StageMove | StageJog, name: str) -> str:
    if isinstance(asked, StageJog):
        return f"the joystick asks for {stated(asked.speed * 1e3)}{GAP}mm/s"
    others = [other for other in asked.motors if other != name]
    return "start signal" + (f", at the same time for {', '.join(others)}" if others else "")


def _change_events(table: StepperTable, change: Change, move: StageMoveRecord, legs: list[Leg]) -> list[Event]:
    """When the stop was changed, if the motor came by."""
    made = legs[0].made
    passed = np.flatnonzero((made.position - table.step_at(change.at)) * legs[0].direction >= 0)
    text = f"at {_mm(change.at)} the stop is changed to {_mm(change.to)}"
    return [Event(float(made.t[passed[0]]) - move.begin, text)] if passed.size else []


def _mm(length: float) -> str:
    return f"{stated(length * 1e3)}{GAP}mm"


def _rest_events(spec: StepperEnvelopeSpec, move: StageMoveRecord, motor: MotorMove) -> list[Event]:
    """When the rotor was at rest for good, and when the host took the move for done."""
    events = [Event(move.ready - move.begin, "the time to settle is over: the host takes the move for done")]
    if abs(motor.rest_lag) <= spec.controller.tolerance and motor.settled > move.begin:
        text = f"the rotor is within ±{stated(spec.controller.tolerance)} steps of its place for good"
        events.append(Event(motor.settled - move.begin, text))
    return events
