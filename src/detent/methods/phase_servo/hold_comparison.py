"""What dead band and integrator do at the stop: the carriage at rest, and under a push (phase-servo tests 28 to 30).

A move of six pitches brings each variant of the axis to the same target; what it does there is recorded.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from detent.axisfile.tables import PushTable
from detent.methods.phase_servo.derive import Machine as Figures
from detent.methods.phase_servo.phase_bench import UNDISTURBED, PhaseBench, change_method
from detent.methods.phase_servo.schema import DisturbanceTable, PhaseServoSpec
from detent.methods.phase_servo.system import PhaseServo
from detent.record.machine import Progress
from detent.record.recorder import Recorder

PITCHES = 6
"""The move before."""

PUSH_AT = 30e-3
"""When the push begins [s], if that is between the arrival and the stop; else halfway between the two."""

PUSH_SHARE = 3.0
"""The push over Coulomb friction: 3 N on the axis of specification 7."""

PUSH_WITHOUT_FRICTION = 3.0
"""The push on an axis without friction [N]."""

AFTER_STOP = 0.16
"""Time recorded after the stop [s]."""

ROW_TIME = 50e-6
"""Time between two rows [s]: a hundredth of a period of the limit cycle."""

LAST = 0.1
"""Stretch at the end of the record that the figures of a case are taken from [s]."""

SIGNALS = ("train.position", "law.integral", "law.word")

Numbers = NDArray[np.float64]
Whole = NDArray[np.int64]


@dataclass(frozen=True, slots=True, kw_only=True)
class HoldCase:
    """One variant of the axis at its target.

    Attributes
    ----------
    name : str
        Such as "without integrator".
    about : str
        What is different in it, one sentence.
    t : ndarray, shape (n,)
        Time since power-on [s], from the beginning of position mode on.
    displacement : ndarray, shape (n,)
        Position less target [steps].
    integral, word : ndarray, shape (n,)
        Integral of the error, and drive word [count].
    """

    name: str
    about: str
    t: Numbers
    displacement: Numbers
    integral: Whole
    word: Whole

    @property
    def _last(self) -> int:
        """Row with which the last 0.1 s begin."""
        return int(np.count_nonzero(self.t < self.t[-1] - LAST))

    @property
    def swing(self) -> float:
        """Peak to peak of the displacement in the last 0.1 s [steps]."""
        last = self.displacement[self._last :]
        return float(last.max() - last.min())

    @property
    def rest(self) -> float:
        """Mean displacement in the last 0.1 s [steps]."""
        return float(np.mean(self.displacement[self._last :]))

    def to_dict(self) -> dict[str, Any]:
        """Plain data for ``--json``: everything but the curves."""
        integral = self.integral[self._last :]
        return {
            "name": self.name,
            "about": self.about,
            "swing": self.swing,
            "rest": self.rest,
            "integral": [int(integral.min()), int(integral.max())],
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class HoldComparison:
    """Result of `compare_hold`.

    Attributes
    ----------
    still : tuple of HoldCase
        Without a push: settling for ever, as the file has it, and with the integrator but no dead band.
    loaded : tuple of HoldCase
        Under a push that stays: with the integrator, and without.
    push : float
        Force [N].
    push_at, stop_at : float
        When the push begins, and when the stop does in the variants that have one [s since power-on].
    step : float
        Travel per step [m].
    """

    still: tuple[HoldCase, ...]
    loaded: tuple[HoldCase, ...]
    push: float
    push_at: float
    stop_at: float
    step: float

    def to_dict(self) -> dict[str, Any]:
        """Plain data for ``--json``: everything but the curves."""
        found: dict[str, Any] = {name: getattr(self, name) for name in ("push", "push_at", "stop_at", "step")}
        return found | {"still": [c.to_dict() for c in self.still], "loaded": [c.to_dict() for c in self.loaded]}


Variant = tuple[str, str, dict[str, Any]]
"""Name, what is different, and the values of ``[method]`` that make it so."""

STILL: tuple[Variant, ...] = (
    ("settling for ever", "stop never comes: the corrector never gives zero", {"stop_always_off": True}),
    ("as the file has it", "dead band and integrator as the axis file has them, from the stop on", {}),
    ("no dead band", "the integrator alone: D = 0", {"dead_band": 0, "integrator": True}),
)
LOADED: tuple[Variant, ...] = (
    ("with integrator", "from the stop on the integral counts until it balances the push", {"integrator": True}),
    ("without integrator", "nothing but the error itself balances the push", {"integrator": False}),
)


def compare_hold(spec: PhaseServoSpec, *, progress: Progress | None = None) -> HoldComparison:
    """Record how the axis stands at its target, still and pushed, with and without dead band and integrator.

    Parameters
    ----------
    spec : PhaseServoSpec
        The axis; its ``[disturbance]`` is left out. Each variant but the first stops, whatever `stop_always_off` says.
    progress : callable, optional
        Told the share done.
    """
    cases = len(STILL) + len(LOADED)
    stopping = change_method(spec, stop_always_off=False)

    def record(done: int, variant: Variant, disturbance: DisturbanceTable) -> HoldCase:
        """Tell the progress and record one variant."""
        if progress is not None:
            progress(done / cases, variant[0])
        return _record(stopping, variant, disturbance)

    still = tuple(record(k, variant, UNDISTURBED) for k, variant in enumerate(STILL))
    arrived = _arrive(PhaseBench(stopping, PITCHES))
    stop_at = arrived + spec.method.stop_time
    push_at = PUSH_AT if arrived < PUSH_AT < stop_at else (arrived + stop_at) / 2
    push = push_force(spec)
    # Values in SI already: nothing is to be read from text. It lasts longer than any record.
    pushed = DisturbanceTable(push=PushTable.model_construct(force=push, at=push_at, duration=1e5))
    loaded = tuple(record(len(STILL) + k, variant, pushed) for k, variant in enumerate(LOADED))
    return HoldComparison(still=still, loaded=loaded, push=push, push_at=push_at, stop_at=stop_at, step=spec.step)


def push_force(spec: PhaseServoSpec) -> float:
    """Push that fits the axis [N]: three times its Coulomb friction, 3 N where it has none."""
    coulomb = Figures(spec).coulomb
    return PUSH_SHARE * coulomb if coulomb > 0 else PUSH_WITHOUT_FRICTION


def _arrive(bench: PhaseBench) -> float:
    """Make the move; when position mode begins [s], or for an axis that does not get there, when one gives up."""
    entered = bench.move()
    return bench.machine.time if math.isnan(entered) else entered


def _record(spec: PhaseServoSpec, variant: Variant, disturbance: DisturbanceTable) -> HoldCase:
    """One variant, from its arrival on."""
    name, about, values = variant
    every = max(1, round(ROW_TIME / spec.tick))
    recorder = Recorder(PhaseServo, SIGNALS, every=every, period=spec.tick)
    bench = PhaseBench(change_method(spec, **values), PITCHES, disturbance, recorder)
    arrived = _arrive(bench)
    bench.run_until(arrived + spec.method.stop_time + AFTER_STOP)
    bench.machine.close()
    trace = recorder.trace()
    kept = trace.time >= arrived
    return HoldCase(
        name=name,
        about=about,
        t=trace.time[kept],
        displacement=(trace["train.position"][kept] - bench.target) / bench.spec.step,
        integral=trace["law.integral"][kept].astype(np.int64),
        word=trace["law.word"][kept].astype(np.int64),
    )
