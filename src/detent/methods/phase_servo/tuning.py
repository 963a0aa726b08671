"""The gains of position mode of a phase servo: whole numbers, each pair of them simulated.

Every KP1 that keeps the drive word within its range at a quarter turn and a step of error, beside every KP2 from 1 to
64. A pair that keeps swinging by more than the edge of a step while it settles, from any of eight starts, has a hard
cycle and will not do. Of the others the best settles first after the change of mode, counted in speed samples; of two
that settle alike it is the one that swings less.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from detent.axisfile.tables import PushTable
from detent.errors import DetentError
from detent.methods.moves.job import Move, MoveJob
from detent.methods.moves.run import SOONEST, run_moves
from detent.methods.phase_servo.derive import PhaseFigures
from detent.methods.phase_servo.host import UNDISTURBED, PhaseBench, PhaseHost
from detent.methods.phase_servo.schema import PhaseServoSpec
from detent.methods.phase_servo.standstill import EDGE, PhaseEnsemble
from detent.methods.standing import EIGHT
from detent.methods.tuning import Search, Trial
from detent.sensing.gauge import set_gauge
from detent.units import format_quantity

KEY = "method.position_gains"
KP2 = range(1, 65)
WAYS = 1, 6, -20  # pitches of the moves
REST = 20e-3  # at stop after each of them [s]
PUSHED, PUSH, AFTER = 10e-3, 60e-3, 120e-3  # at stop before a push, how long it lasts, and how long it may be felt [s]
SHARE = 1.0 / 3.0  # of the largest force: the push
WATCHED, LAST = 0.12, 0.6  # of each start while it settles: time [s], and its part that is looked at
SEED = 1


def three_moves(spec: PhaseServoSpec) -> MoveJob:
    """Short and long moves to both sides, as far as the travel lets them; each with its stop."""
    most = math.floor(0.4 * spec.limits.travel / spec.pitch)
    sense = 1 if spec.mechanics.start_position < 0.5 * spec.limits.travel else -1
    ways = [sense * max(-most, min(way, most)) for way in (WAYS[0], WAYS[1], -WAYS[2], WAYS[2])][:3]
    moves = tuple(
        Move(number=k, row=0, by=way * spec.pitch, dwell=spec.method.stop_time + REST) for k, way in enumerate(ways, 1)
    )
    return MoveJob("three moves", "moves", moves)


class PhaseSearch(Search):
    """What `tune` asks."""

    keys = (KEY,)
    decides = "settling after the change of mode, in speed samples, and of those alike the smallest swing"
    measure, sides = "settling [speed samples]", ("KP1", "KP2")

    def __init__(self, spec: PhaseServoSpec) -> None:
        self.spec = spec

    def candidates(self, held: Sequence[str]) -> list[dict[str, Any]]:
        """All that fit the drive word; KP3 stays."""
        if held:
            raise DetentError(f"hold: got {KEY}, the only key that is chosen here; expected: none; leave hold out")
        k3 = self.spec.method.position_gains[2]
        word = (1 << (self.spec.drive.pwm_bits - 1)) - 1
        most = word // (k3 * (self.spec.detector.counts // 4 + 1))
        return [{KEY: [k1, k2, k3]} for k1 in range(1, most + 1) for k2 in KP2]

    def place(self, values: Mapping[str, Any]) -> tuple[float, float]:
        """KP1 and KP2."""
        k1, k2, _ = values[KEY]
        return float(k1), float(k2)

    def tried(self, spec: PhaseServoSpec, job: MoveJob) -> Trial:
        """Standstill while it settles, moves, and a push."""
        swing, period = settling_swing(spec)
        swings = f"{format_quantity(swing, 'm', 3)} ({swing / spec.step:.3g} steps)"
        figures = {"swing while settling": swings}
        if swing > EDGE * spec.step:
            often = "" if math.isnan(period) else f" at {format_quantity(1.0 / period, 'Hz', 2)}"
            return Trial(f"hard cycle of {swing / spec.step:.3g} steps{often} while settling", figures=figures)
        run = run_moves(PhaseHost(spec), job)
        if not run.done:
            return Trial("a move does not arrive", figures=figures)
        if any(move.early > SOONEST for move in run.moves):
            return Trial("it says that it has arrived before it has", figures=figures)
        if run.warnings:
            return Trial("its run is doubted", figures=figures)
        settling = max(move.approach for move in run.moves)
        figures |= {
            "settling after the change of mode": format_quantity(settling, "s", 3),
            "worst error at rest": format_quantity(run.worst_error, "m", 3),
        }
        force, back = pushed(spec)
        if math.isinf(back):
            return Trial(f"it does not come back after a push of {format_quantity(force, 'N', 3)}", figures=figures)
        figures[f"back after a push of {format_quantity(force, 'N', 3)}"] = format_quantity(back, "s", 3)
        samples = math.ceil(settling / spec.sample_period - 1e-9)
        return Trial("", (float(samples), round(swing / spec.step, 3), back), figures)


def settling_swing(spec: PhaseServoSpec) -> tuple[float, float]:
    """Largest swing of eight starts that never come to stop, peak to peak [m], and its period [s]."""
    settling = PhaseEnsemble(spec.changed(method={"stop_always_off": True}))
    found = list[tuple[float, float]]()
    for course in settling.courses(EIGHT, SEED, on_counts=False):
        rows = course.go(WATCHED)
        rows = rows[int((1.0 - LAST) * len(rows)) :]
        place = 0.5 * (rows[:, 1] + rows[:, 2])
        above = place > 0.5 * (place.min() + place.max())
        turns = rows[1:, 0][above[1:] & ~above[:-1]]
        period = (turns[-1] - turns[0]) / (len(turns) - 1) if len(turns) > 1 else math.nan
        found.append((float(np.ptp(place)), float(period)))
    return max(found, key=lambda one: one[0])


def pushed(spec: PhaseServoSpec) -> tuple[float, float]:
    """Force of a push at stop [N], and the time after its end until the carriage is back for good [s]."""
    force, begin = SHARE * PhaseFigures(spec).force_limit, spec.method.stop_time + PUSHED
    push = PushTable.model_construct(force=force, at=begin, duration=PUSH)
    bench = PhaseBench(spec, 0, UNDISTURBED.model_copy(update={"push": push}))
    state, within = bench.machine.state, spec.arrived_steps
    set_gauge(state.plant.gauge, 0, bench.target, bench.target, within * spec.step)
    bench.run_until(begin + PUSH + AFTER)
    back = max(state.plant.gauge.outside * spec.tick - begin - PUSH, 0.0)
    return force, back if abs(bench.displacement) <= within else math.inf
