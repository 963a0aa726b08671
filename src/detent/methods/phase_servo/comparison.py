"""The phase servo beside its alternatives: what spurious pulses do to the stop, and what dead band and integrator do.

Noise (tests 25, 26): the same move is made again and again, each time with pulses inserted on the counting
lines; once with the absolute word as the position error of the final approach, once with the signed count of pulses
still to come. Hold (tests 28 to 30): a move brings each variant to the same target, at rest or under a push.
"""

import math
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from detent.axisfile.tables import BurstTable, DisturbanceTable, InterferenceTable, PushTable
from detent.errors import DetentError
from detent.methods.method import untold
from detent.methods.phase_servo.derive import PhaseFigures
from detent.methods.phase_servo.host import START, UNDISTURBED, PhaseBench
from detent.methods.phase_servo.schema import PhaseServoSpec
from detent.methods.phase_servo.system import PhaseServo
from detent.page.chart import Chart, Curve, Panel, Timeline, line_chart, time_charts
from detent.page.figure import Figure
from detent.page.frame import ComparisonOnScreen
from detent.page.parts import Event
from detent.page.run_page import happened
from detent.page.table import TextTable
from detent.page.words import GAP, count, length, number
from detent.record.machine import Progress
from detent.record.recorder import Recorder
from detent.sensing.interference import ENTRIES
from detent.units import format_quantity

PULSES = (0, 1, 2, 5, 8, 12, 16, 20, 30)  # numbers of spurious pulses of tests 25 and 26
FIRST_PULSE = 5e-3  # when the first one comes [s]; the others follow 24 us apart
SETTLING = 30e-3  # time given to the integrator after the stop [s]
LONGEST_STOP = 0.1  # a one-shot 109 that is longer is not waited for [s]: the carriage has come to rest long before

READINGS = 20
READING = 0.5e-3
"""The rest point is the mean of so many readings so far apart [s]: more than a period of the limit cycle."""

NOISE_BAND = 0.6  # how far off an absolute stop may be, whatever the noise (phase-servo test 25) [steps]

SIGNS = ("+", "-")
DIRECTIONS = ("right", "left")
MOST_STEPS = 65_535  # longest move that the distance word can command [steps]

PITCHES = 6  # length of the move
PUSH_AT = 30e-3  # when the push begins [s], if that is between the arrival and the stop; else halfway between the two
PUSH_SHARE = 3.0  # the push over Coulomb friction: 3 N on the axis of specification 7
PUSH_WITHOUT_FRICTION = 3.0  # the push on an axis without friction [N]
AFTER_STOP = 0.16  # time recorded after the stop [s]
ROW_TIME = 50e-6  # time between two rows [s]: a hundredth of a period of the limit cycle
LAST = 0.1  # stretch at the end of the record that the figures of a case are taken from [s]

SIGNALS = ("plant.train.position", "controller.law.integral", "controller.law.word")

Numbers = NDArray[np.float64]
Whole = NDArray[np.int64]


# ---- noise on the pulse lines


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class NoiseComparison(ComparisonOnScreen):
    """Result of `compare_noise`."""

    pulses: tuple[int, ...]  #: numbers of spurious pulses in one move, rising
    #: rest point of this servo less target [steps], for + and for - pulses, in moves to the right and to the left;
    #: shape (len(pulses), 2, 2)
    absolute: Numbers
    incremental: Numbers  #: the same of the servo that stops by counted pulses
    step: float  #: travel per step [m]
    counts: int  #: steps per pitch, N
    #: pulses that the method bears, N/2 - threshold; with more the servo stops at another positioning point
    margin: int
    pitches: int  #: length of the move

    @property
    def table(self) -> TextTable:
        """Rest points in steps, right and left."""
        heads = ("pulses inserted", "this servo, + pulses", "- pulses", "incremental servo, + pulses", "- pulses")
        rows = [
            (str(n), *(_range(rest[k, sign]) for rest in (self.absolute, self.incremental) for sign in (0, 1)))
            for k, n in enumerate(self.pulses)
        ]
        title = (
            f"Where a move of {self.pitches} pitches ends, in steps of {format_quantity(self.step, 'm')} from its "
            f"target (right / left; a pitch off from {self.margin} pulses on)"
        )
        return TextTable(title, heads, rows)

    def figures(self) -> tuple[Figure, ...]:
        """Rest points over pulses, and the same magnified."""
        caption = (
            f"Noise inserts pulses on the counting lines during a move of {count(self.pitches, 'pitch', 'pitches')}. A "
            "purely incremental servo stops off target by the number of inserted pulses, and keeps the error. This one "
            "stops on target, because the resolver phase gives the absolute position. Its limit: more than "
            f"{count(self.margin, 'pulse')} in one move, and it stops exactly one pitch off."
        )
        title = "Noise on the pulse lines: rest position"
        return (Figure(title=title, caption=caption, charts=_rest_charts(self)),)

    def to_dict(self) -> dict[str, Any]:
        """Plain data for ``--json``: a row for each number of pulses, sign and direction."""
        keys = ("pulses", "sign", "direction", "absolute", "incremental")
        places = product(self.pulses, SIGNS, DIRECTIONS)
        rests = zip(self.absolute.ravel().tolist(), self.incremental.ravel().tolist(), strict=True)
        rows = [dict(zip(keys, (*place, *rest), strict=True)) for place, rest in zip(places, rests, strict=True)]
        return {name: getattr(self, name) for name in ("step", "counts", "margin", "pitches")} | {"rest": rows}


def _range(pair: Any) -> str:
    """Right and left, as whole numbers where they are far, else with two digits."""
    return " / ".join(f"{value:+.0f}" if abs(value) >= 10 else f"{value:+.2f}" for value in pair)


def _rest_charts(found: NoiseComparison) -> list[Chart]:
    """Rest point [step] against the pulses that noise has put in, of both servos and directions, - to the left."""
    pulses = np.array(found.pulses)
    # From the most - pulses over none, which both signs share, to the most + pulses; a ring needs room at either end.
    x = np.concatenate((-pulses[:0:-1], pulses))
    x = np.concatenate(([1.05 * x[0]], x, [1.05 * x[-1]]))

    def against(rest: Numbers, direction: int) -> Numbers:
        return np.concatenate(([np.nan], rest[:0:-1, 1, direction], rest[:, 0, direction], [np.nan]))

    # The lines are straight by their nature; what lies between two points of this servo nobody has tried.
    counted: list[Curve] = []
    stops: list[Curve] = []
    for k, (way, dash, rings) in enumerate((("right", None, 11), ("left", (8, 4), 6))):
        place = against(found.incremental, k)
        counted.append(Curve(label=f"only incremental, moving {way}", colour="muted", width=2, dash=dash, y=place))
        stops.append(Curve(label=f"this servo, moving {way}", colour=way, rings=rings, y=against(found.absolute, k)))
    label, levels = "right of the target [step]", [(side * NOISE_BAND, "") for side in (-1, 1)]
    panels = [
        Panel(name="noise", label=label, height=300, zero=True, curves=[*counted, *stops]),
        Panel(
            name="noise-near", label="off [step]", height=180, zero=True, span=(-1.2, 1.2), levels=levels, curves=stops,
            title=f"Magnified: no stop on target may be more than {NOISE_BAND:g} steps off (dashed)",
        ),
    ]  # fmt: skip
    marks = {"marks": [{"x": side * found.margin, "label": "limit"} for side in (-1, 1)]}
    return [line_chart(panel, x, "− pulses inserted   [pulse]   + pulses inserted") | marks for panel in panels]


def compare_noise(spec: PhaseServoSpec, *, pitches: int = PITCHES, progress: Progress = untold) -> NoiseComparison:
    """Find where the axis stops after spurious pulses, and where it would stop by counted pulses."""
    counts = spec.detector.counts
    most = MOST_STEPS // counts
    if not 1 <= pitches <= most:
        got = f"got a move of {pitches} pitches; expected: 1 to {most}; choose another"
        raise DetentError(f"comparison of noise: {got}")
    servos = [spec.changed(method={"final": final}) for final in ("absolute", "incremental")]
    margin = counts // 2 - spec.method.threshold
    pulses = pulse_counts(margin)
    begin = _first_pulse(servos[0], pitches)
    runs = list(product(servos, pulses, SIGNS, (pitches, -pitches)))
    rests: list[float] = []
    for servo, spurious, sign, way in runs:
        progress(len(rests) / len(runs), f"{spurious} spurious pulses")
        rests.append(rest_point(servo, way, spurious, sign, begin))
    absolute, incremental = np.reshape(rests, (2, len(pulses), 2, 2))
    return NoiseComparison(
        pulses=pulses, absolute=absolute, incremental=incremental, step=spec.step, counts=counts, margin=margin,
        pitches=pitches,
    )  # fmt: skip


def pulse_counts(margin: int) -> tuple[int, ...]:
    """Numbers of pulses to try: those of the specification, and one below and one above the axis's own `margin`.

    >>> pulse_counts(24)
    (0, 1, 2, 5, 8, 12, 16, 20, 30)
    >>> pulse_counts(5)
    (0, 1, 2, 4, 5, 6, 8, 12, 16, 20, 30)
    """
    own = {margin * 5 // 6, margin + max(1, margin // 4)}
    return tuple(sorted({*PULSES, *(n for n in own if 0 <= n <= ENTRIES)}))


def rest_point(spec: PhaseServoSpec, pitches: int, count: int, sign: str, begin: float) -> float:
    """Where a move ends that `count` spurious pulses disturb [steps]."""
    disturbance = UNDISTURBED
    if count:
        # Values in SI already: nothing is to be read from text.
        burst = BurstTable.model_construct(kind=sign, at=begin, count=count)
        disturbance = DisturbanceTable(lines=InterferenceTable(burst=burst))
    bench = PhaseBench(spec, pitches, disturbance)
    entered = bench.move()
    if np.isnan(entered):
        return bench.displacement
    end = entered + min(spec.method.stop_time, LONGEST_STOP) + SETTLING
    readings: list[float] = []
    for k in reversed(range(READINGS)):
        bench.run_until(end - k * READING)
        readings.append(bench.displacement)
    return float(np.mean(readings))


def _first_pulse(spec: PhaseServoSpec, pitches: int) -> float:
    """When the pulses begin [s]: at 5 ms, but within the first quarter of a quicker traverse."""
    entered = PhaseBench(spec, pitches).move()
    return FIRST_PULSE if np.isnan(entered) else min(FIRST_PULSE, START + (entered - START) / 4)


# ---- standing at the target


@dataclass(frozen=True, slots=True, kw_only=True)
class HoldCase:
    """One variant of the axis at its target."""

    name: str  #: such as "without integrator"
    about: str  #: what is different in it, one sentence
    t: Numbers  #: time since power-on [s], from the beginning of position mode on; shape (n,)
    displacement: Numbers  #: position minus target [steps]; shape (n,)
    integral: Whole  #: integral of the error [count]; shape (n,)
    word: Whole  #: drive word [count]; shape (n,)

    @property
    def _last(self) -> slice:
        """Rows of the last 0.1 s."""
        return slice(int(np.count_nonzero(self.t < self.t[-1] - LAST)), None)

    @property
    def swing(self) -> float:
        """Peak to peak of the displacement in the last 0.1 s [steps]."""
        return float(np.ptp(self.displacement[self._last]))

    @property
    def rest(self) -> float:
        """Mean displacement in the last 0.1 s [steps]."""
        return float(np.mean(self.displacement[self._last]))

    def to_dict(self) -> dict[str, Any]:
        """Plain data for ``--json``: everything but the curves."""
        integral = self.integral[self._last]
        found: dict[str, Any] = {name: getattr(self, name) for name in ("name", "about", "swing", "rest")}
        return found | {"integral": [int(integral.min()), int(integral.max())]}


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class HoldComparison(ComparisonOnScreen):
    """Result of `compare_hold`."""

    #: without a push; never in stop mode, as in the axis file, and with the integrator but no dead band
    still: tuple[HoldCase, ...]
    loaded: tuple[HoldCase, ...]  #: under a push that stays, with the integrator and without
    push: float  #: force [N]
    push_at: float  #: when the push begins [s since power-on]
    stop_at: float  #: when the stop does, in the variants that have one [s since power-on]
    step: float  #: travel per step [m]

    @property
    def table(self) -> TextTable:
        """How every case stands in the end."""
        heads = ("servo", "peak to peak", "mean displacement", "integral")
        rows = [
            (case.name, f"{case.swing:.2f}", f"{case.rest:+.2f}", f"{case.integral[-1]:g}")
            for case in (*self.still, *self.loaded)
        ]
        return TextTable("At rest, last 0.1 s, in steps", heads, rows)

    def figures(self) -> tuple[Figure, ...]:
        """At rest: unloaded and hunting, then pushed."""
        swings = [f"{case.name} {number(round(case.swing, 2), 2)}" for case in self.still]
        still = (
            "A digital servo without a zero reading has a limit cycle from one step to the next. Here a dead band "
            f"opens shortly after arrival, and an integrator works outside it. A step is {length(self.step)}. "
            f"Final limit cycle, peak to peak in steps: {', '.join(swings)}."
        )
        rests = [f"{case.name} {number(round(case.rest, 2), 2)}" for case in self.loaded]
        loaded = (
            f"A force of {number(self.push)}{GAP}N pushes the carriage to the right after it has arrived. The error "
            "alone gives too little drive to push back; the integral counts up until the motor balances the "
            f"force. Final position, in steps right of the target: {', '.join(rests)}."
        )
        push = f"a force of {number(self.push)}{GAP}N pushes from now on"
        events = happened({push: self.push_at, "stop: dead band and integrator take over": self.stop_at}, math.inf)
        return (
            Figure(title="At rest", caption=still, charts=_still_charts(self)),
            Figure(title="Under load", caption=loaded, charts=_loaded_charts(self, events), events=events),
        )

    def to_dict(self) -> dict[str, Any]:
        """Plain data for ``--json``: everything but the curves."""
        found: dict[str, Any] = {name: getattr(self, name) for name in ("push", "push_at", "stop_at", "step")}
        return found | {"still": [c.to_dict() for c in self.still], "loaded": [c.to_dict() for c in self.loaded]}


Variant = tuple[str, str, dict[str, Any]]  # name, what is different, and the values of ``[method]`` that make it so

STILL: tuple[Variant, ...] = (
    ("never in stop mode", "stop mode never starts: the corrector never outputs zero", {"stop_always_off": True}),
    ("as in the axis file", "dead band and integrator as in the axis file, from the stop on", {}),
    ("no dead band", "the integrator alone: D = 0", {"dead_band": 0, "integrator": True}),
)
LOADED: tuple[Variant, ...] = (
    ("with integrator", "from the stop on the integral counts until it balances the push", {"integrator": True}),
    ("without integrator", "only the error itself balances the push", {"integrator": False}),
)


def _still_charts(found: HoldComparison) -> list[Chart]:
    """A chart per case on one scale, without the first half of the settling, beside which nothing could be seen."""
    shown = [_since(case, found.stop_at) for case in found.still]
    reach = max((float(np.abs(case.displacement[part]).max()) for case, part in zip(found.still, shown, strict=True)))
    span = (round(-1.1 * reach, 3), round(1.1 * reach, 3))
    drawn: list[Chart] = []
    for index, (case, part) in enumerate(zip(found.still, shown, strict=True)):
        curve = Curve(label="true position", colour="speed", y=case.displacement[part])
        panel = Panel(
            name=f"still-{index}", label="off [step]", height=140, zero=True, span=span, curves=[curve],
            title=f"{case.name}: {case.about}", about=f"Displacement over time, {case.name}",
        )  # fmt: skip
        drawn += time_charts(Timeline(name="still", t=case.t[part]), [panel])
    return drawn


def _loaded_charts(found: HoldComparison, events: list[Event]) -> list[Chart]:
    """Both cases in one chart of the place and one of the integral."""
    part = _since(found.loaded[0], found.push_at)
    t = found.loaded[0].t[part]
    places: list[Curve] = []
    integrals: list[Curve] = []
    for case, colour, dash in zip(found.loaded, ("speed", "left"), (None, (6, 4)), strict=True):
        place, integral = np.interp(t, case.t, case.displacement), np.interp(t, case.t, case.integral)
        places.append(Curve(label=case.name, colour=colour, width=2, dash=dash, y=place))
        integrals.append(Curve(label=case.name, colour=colour, width=2, dash=dash, step=True, y=integral))
    return time_charts(Timeline(name="loaded", t=t, events=events), [
        Panel(name="loaded-place", label="right of the target [step]", height=220, zero=True, curves=places),
        Panel(name="loaded-integral", label="integral [count]", height=160, zero=True, curves=integrals),
    ])  # fmt: skip


def _since(case: HoldCase, moment: float) -> slice:
    """Rows from halfway between the arrival and a moment [s] on."""
    return slice(int(np.searchsorted(case.t, (float(case.t[0]) + moment) / 2)), None)


def compare_hold(spec: PhaseServoSpec, *, progress: Progress = untold) -> HoldComparison:
    """Record how the axis stands at its target, still and pushed, with and without dead band and integrator."""
    stopping = spec.changed(method={"stop_always_off": False})
    arrived = _arrive(PhaseBench(stopping, PITCHES))
    stop_at = arrived + spec.method.stop_time
    push_at = PUSH_AT if arrived < PUSH_AT < stop_at else (arrived + stop_at) / 2
    push = push_force(spec)
    # Values in SI already: nothing is to be read from text. It lasts longer than any record.
    pushed = DisturbanceTable(push=PushTable.model_construct(force=push, at=push_at, duration=1e5))
    planned = [*((variant, UNDISTURBED) for variant in STILL), *((variant, pushed) for variant in LOADED)]
    cases: list[HoldCase] = []
    for variant, disturbance in planned:
        progress(len(cases) / len(planned), variant[0])
        cases.append(_record(stopping, variant, disturbance))
    still, loaded = tuple(cases[: len(STILL)]), tuple(cases[len(STILL) :])
    return HoldComparison(still=still, loaded=loaded, push=push, push_at=push_at, stop_at=stop_at, step=spec.step)


def push_force(spec: PhaseServoSpec) -> float:
    """Push that fits the axis [N]: three times its Coulomb friction, 3 N where it has none."""
    coulomb = PhaseFigures(spec).coulomb
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
    bench = PhaseBench(spec.changed(method=values), PITCHES, disturbance, recorder)
    arrived = _arrive(bench)
    bench.run_until(arrived + spec.method.stop_time + AFTER_STOP)
    bench.machine.close()
    trace = recorder.trace()
    kept = trace.time >= arrived
    return HoldCase(
        name=name, about=about, t=trace.time[kept],
        displacement=(trace["plant.train.position"][kept] - bench.target) / bench.spec.step,
        integral=trace["controller.law.integral"][kept].astype(np.int64),
        word=trace["controller.law.word"][kept].astype(np.int64),
    )  # fmt: skip
