"""The figures of a stage's job that a person wants first, as rows of text for the terminal."""

import math
from collections.abc import Callable

from detent.methods.stepper_envelope.run import MotorMove, StageMoveRecord, StageRun
from detent.methods.stepper_envelope.schema import StepperEnvelopeSpec
from detent.methods.stepper_envelope.stage_results import StageFigures, WorstMotion
from detent.page.words import GAP, count, duration, number

Motion = tuple[StageMoveRecord, str, MotorMove]
PULL_OUT_LAG = 2.0
"""Lag from which on the field pulls the rotor the wrong way: half a period of the torque curve, which has four steps
(stepper-envelope specification 7.2) [step]."""


def stage_summary_rows(spec: StepperEnvelopeSpec, run: StageRun) -> list[tuple[str, str]]:
    """Name and text of each figure; what a run did not come to is left out."""
    figures, word = stage_figures(spec, run), "tile" if run.job.kind == "tiles" else "move"
    labels = {move.number: move.label for move in run.moves}

    def whose(worst: WorstMotion) -> str:
        return f"({called(worst.move, labels[worst.move], run.job.kind)}, {worst.motor})"

    rows = [(f"{word}s", f"{count(figures.made)} of {count(figures.asked)}")]
    if figures.placed < figures.made:
        rows.append(("in their places", count(figures.placed, word)))
    if run.moves:
        rows.append(("time", f"{duration(figures.seconds)}, {rate(figures, word)}"))
    if figures.steps:
        rows += [("moving", _moving(figures)), ("lost steps", lost_text(figures))]
    if figures.lag:
        most = f"up to {steps(figures.lag.value)} {whose(figures.lag)}"
        rows.append(("rotor lag", f"{most}; falls out of step at {number(PULL_OUT_LAG)}"))
    if figures.rest:
        rows.append(("at rest", f"within {number(figures.rest.value, 2)} steps of its place {whose(figures.rest)}"))
    if figures.margin:
        least = number(figures.margin.value)
        rows.append(("torque margin", f"at least {least} {whose(figures.margin)}; falls behind below 1"))
    if figures.peak_hz and figures.peak_speed:
        speed = number(figures.peak_speed.value * 1e3)
        rows.append(("peak", f"{count(round(figures.peak_hz.value))} Hz {whose(figures.peak_hz)}, {speed} mm/s"))
    return [(name, text.replace(GAP, " ")) for name, text in rows]


def rate(figures: StageFigures, word: str) -> str:
    """How many moves are made in a minute."""
    return f"{number(figures.rate * 60)} {word}s per minute"


def stated(value: float) -> str:
    """Write a value that a file states, without zeros that nobody wrote.

    >>> stated(0.5), stated(55.000000001), stated(-40.0), stated(87.439)
    ('0.5', '55', '−40', '87.44')
    """
    return f"{float(f'{value:.4g}'):.12g}".replace("-", "−")


def called(number_of: int, label: str, kind: str) -> str:
    """What a move is called in a sentence: a tile goes by its name.

    >>> called(1, "B7", "tiles"), called(1, "zoom in", "moves")
    ('tile B7', 'move 1')
    """
    return f"tile {label}" if kind == "tiles" and label else f"move {count(number_of)}"


def steps(value: float) -> str:
    """Write a distance in steps.

    >>> steps(1.0), steps(0.0561), steps(1.01738)
    ('1 step', '0.0561 steps', '1.02 steps')
    """
    text = number(value)
    return f"{text} {'step' if text == '1' else 'steps'}"


def lost_text(figures: StageFigures) -> str:
    """Steps lost, by motor where there are some."""
    made = count(figures.steps)
    if not figures.first_lost:
        return f"0 of {made}"
    by_motor = ", ".join(f"{name} {number(n)}" for name, n in figures.lost.items() if n) or "0 in the end"
    return f"{by_motor} (from move {count(figures.first_lost.move)} on), of {made}"


def _moving(figures: StageFigures) -> str:
    return (
        f"{duration(figures.moving)}; at the constant start frequency {duration(figures.naive)}, "
        f"{number(figures.faster)} times as long"
    )


# ---- figures


def stage_figures(spec: StepperEnvelopeSpec, run: StageRun) -> StageFigures:
    """Sums and extremes of a run."""
    made = run.made
    spans = [[motor.arrived - move.begin for motor in move.motors.values()] for move in run.moves]
    loses = [motion for motion in made if motion[2].lost]
    needy = [motion for motion in made if math.isfinite(motion[2].margin)]
    return StageFigures(
        asked=run.job.count,
        made=len(run.moves),
        placed=sum(_placed(spec, run)),
        seconds=max(run.time_end - run.time_ready, 0.0) if run.moves else 0.0,
        rate=run.moves_per_second,
        moving=sum(max(span, default=0.0) for span in spans),
        naive=sum(max((motor.naive for motor in move.motors.values()), default=0.0) for move in run.moves),
        steps=sum(motor.steps for _, _, motor in made),
        lost=dict(run.lost),
        first_lost=WorstMotion(loses[0][2].lost, loses[0][0].number, loses[0][1]) if loses else None,
        lag=_largest(made, lambda _, motor: motor.peak_lag),
        rest=_largest(made, lambda _, motor: abs(motor.rest_lag)),
        margin=_negated(_largest(needy, lambda _, motor: -motor.margin)),
        peak_hz=_largest(made, lambda _, motor: motor.peak_hz),
        peak_speed=_largest(made, lambda name, motor: motor.peak_hz * spec.stepper[name].step),
    )


def _placed(spec: StepperEnvelopeSpec, run: StageRun) -> list[bool]:
    """For each move whether every rotor stood in its place after it."""
    lost = dict.fromkeys(spec.stepper, 0)
    placed: list[bool] = []
    for move in run.moves:
        for name, motor in move.motors.items():
            lost[name] += motor.lost
        still = all(
            not motor.missed and abs(motor.rest_lag) <= spec.controller.tolerance for motor in move.motors.values()
        )
        placed.append(still and not any(lost.values()))
    return placed


def _largest(motions: list[Motion], figure: Callable[[str, MotorMove], float]) -> WorstMotion | None:
    """The first motion with the largest figure; what is equal in three digits is equal."""
    if not motions:
        return None
    move, name, motor = max(motions, key=lambda motion: float(f"{figure(motion[1], motion[2]):.3g}"))
    return WorstMotion(figure(name, motor), move.number, name)


def _negated(worst: WorstMotion | None) -> WorstMotion | None:
    return WorstMotion(-worst.value, worst.move, worst.motor) if worst else None
