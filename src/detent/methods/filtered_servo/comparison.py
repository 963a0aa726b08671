"""What the filter does to a counted speed: this servo beside its alternatives (filtered-servo tests 11, 20, 21, 23).

The conventional servo has the same window and multiplier but no filter. The other two ways to a finer drive word are a
longer window, with a multiplier of 1, and the multiplier alone. All four drive the same motor at the same rate, and
stop.
"""

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from detent.analysis.arguments import check_constants
from detent.axisfile.tables import DisturbanceTable
from detent.control.pulse_generator import PER_PULSE
from detent.methods.filtered_servo.controller import go_to
from detent.methods.filtered_servo.derive import FilteredFigures
from detent.methods.filtered_servo.host import FilteredHost
from detent.methods.filtered_servo.schema import FilteredServoSpec
from detent.methods.filtered_servo.system import TICK, FilteredServo
from detent.methods.method import untold
from detent.page.chart import Chart, Curve, Panel, Timeline, time_charts
from detent.page.figure import Figure
from detent.page.frame import ComparisonOnScreen
from detent.page.table import Cell, Table, TextTable
from detent.page.words import GAP, count, number
from detent.record.machine import Progress
from detent.record.recorder import Recorder

RATE = 1037.0  # rate of the specification [pulses/s]: not a whole number of pulses in a window of 5 ms

WINDOW = 20e-3
"""B TS of the worked example [s]. The times below are for it; an axis whose B TS is longer gets longer ones."""

STEADY_TIME = 8.0  # length of the run at constant rate [s]; figures are taken from its second half
RAMP = 1.0  # the command is at its rate after this time at the latest [s], whatever its acceleration
STOP_AFTER = 2.0  # when the command stops [s]
STOP_TIME = 2.0  # how long the axis is watched after that [s]
SHOWN = 10  # length of the curves, in windows B TS
LONGEST = 50.0  # longest run, as a multiple of the times above
MOST_ROWS = 400_000
SETTLED = 4  # an axis has settled when its following error swings by no more pulses in the last quarter after a stop
WIDE_COUNTER = 16  # width of the speed counter for the long window [bit]
ENDLESS = 10**12  # pulses that no run gets to the end of

Numbers = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class FeedbackCase:
    """One way to feed the counted speed back. Figures of a case that has failed with a fault are NaN."""

    name: str  #: such as "with filter"
    sample_period: float  #: TS, window of the counter [s]
    scale: int  #: B, multiplier of the count
    coefficient: float  #: A of the filter; 1 for none
    kv: float  #: velocity-error constant K1/(B TS) [1/s]
    std_speed: float  #: standard deviation of the speed word y at constant rate [count]
    std_error: float  #: the same of the error E [count]
    force_ripple: float  #: standard deviation of the motor's force at constant rate [N]
    error_range: tuple[float, float]  #: smallest and largest E at constant rate [count]
    #: how far the axis runs beyond the place where the command has stopped [count]; NaN if it does not settle there
    stop_overshoot: float
    stable: bool  #: it settles, and without a fault
    #: gain K at which the loop becomes unstable, by the exact sampled-loop model [1/s^2]; infinite if there is none
    gain_limit: float
    gain_margin: float  #: `gain_limit` over the gain of the axis
    t: Numbers  #: time since power-on [s], at the end of the run at constant rate; shape (n,)
    error: Numbers  #: E [count]; shape (n,)
    speed_word: Numbers  #: y [count]; shape (n,)


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class FeedbackComparison(ComparisonOnScreen):
    """Result of `compare_feedback`."""

    cases: tuple[FeedbackCase, ...]  #: conventional, with filter, long window, small multiplier
    rate: float  #: rate of the command pulses [1/s]
    gain: float  #: K, drive word to acceleration [1/s^2]
    tau_m: float  #: mechanical time constant of back-EMF and viscous friction [s]; infinite without both

    @property
    def table(self) -> TextTable:
        """What every case costs and brings."""
        rows = [[cell.text if isinstance(cell, Cell) else cell for cell in _row(case)] for case in self.cases]
        return TextTable(f"At {self.rate:g} pulses/s", [head for head, _ in HEADS], rows)

    def figures(self) -> tuple[Figure, ...]:
        """Words at constant speed, and all cases as a table."""
        words = "Drive at constant speed, with and without the filter"
        caption = (
            "Alternatives for smoothing a counted speed, all on this axis. A longer window adds delay and may be "
            "unstable; a smaller multiplier reduces damping. KV is speed over following error; the last column "
            f"says by what factor the loop gain (here {count(round(self.gain))}{GAP}1/s²) "
            "could grow before it oscillates, from the exact sampled model."
        )
        table = Table(heads=HEADS, rows=[_row(case) for case in self.cases])
        return (
            Figure(title=words, caption=_quieter(self), charts=_word_charts(self)),
            Figure(title="The filter and its alternatives", caption=caption, table=table),
        )

    def to_dict(self) -> dict[str, Any]:
        """Plain data for ``--json``: everything but the curves."""
        cases = [{k: v for k, v in asdict(case).items() if not isinstance(v, np.ndarray)} for case in self.cases]
        return {"rate": self.rate, "gain": self.gain, "tau_m": self.tau_m, "cases": cases}


HEADS = (("speed feedback", False), ("TS [ms]", True), ("B", True), ("A", True), ("KV [1/s]", True),
         ("speed word, std [pulse]", True), ("drive word, std [count]", True), ("drive word, from \u2026 to", True),
         ("force ripple, std [N]", True), ("overshoot at stop [pulse]", True), ("gain margin", True))  # fmt: skip
"""Columns of the table, and whether they hold numbers."""


def _row(case: FeedbackCase) -> list[str | Cell]:
    low, high = case.error_range
    margin = f"× {number(case.gain_margin)}" if math.isfinite(case.gain_margin) else "any"
    rest = math.isnan(case.stop_overshoot)
    return [
        Cell(text=case.name, nowrap=True),
        number(case.sample_period * 1e3),
        number(case.scale),
        "\u2013" if case.coefficient == 1 else number(case.coefficient),
        number(case.kv) if case.stable else "\u2013",
        number(case.std_speed),
        number(case.std_error),
        f"{number(low, 2)} \u2026 {number(high, 2)}",
        number(case.force_ripple),
        Cell(text="never at rest" if rest else number(case.stop_overshoot), over=rest),
        Cell(text=margin if case.stable else f"{margin}: unstable", over=not case.stable),
    ]


def _quieter(found: FeedbackComparison) -> str:
    without, with_filter = found.cases[:2]
    quieter = f", {number(without.std_error / with_filter.std_error, 2)} times quieter" if with_filter.std_error else ""
    return (
        f"At a constant {number(found.rate, 4)} pulses per second the count per window is not a whole number: it "
        "jumps between two values, and without a filter every jump, times B, reaches the motor. Look for: the "
        "filtered drive word"
        f"{quieter} at the same following error."
    )


def _word_charts(found: FeedbackComparison) -> list[Chart]:
    """Without the filter and with it; none if one of the two did not come as far as constant speed."""
    without, with_filter = found.cases[:2]
    if not len(without.t) or not len(with_filter.t):
        return []
    t: Numbers = without.t - without.t[0]
    rows = [min(row, len(with_filter.t) - 1) for row in np.searchsorted(with_filter.t - with_filter.t[0], t).tolist()]

    def pair(before: Numbers, after: Numbers) -> list[Curve]:
        """The same quantity without and with the filter."""
        return [
            Curve(label="without the filter", colour="left", width=1, step=True, y=before),
            Curve(label="with the filter", colour="speed", width=2, step=True, y=after[rows]),
        ]

    speeds, drives = pair(without.speed_word, with_filter.speed_word), pair(without.error, with_filter.error)
    return time_charts(Timeline(name="feedback", t=t), [
        Panel(name="feedback-speed", label="speed word [pulse]", height=180, curves=speeds),
        Panel(name="feedback-drive", label="drive word [count]", zero=True, curves=drives),
    ])  # fmt: skip


def compare_feedback(spec: FilteredServoSpec, *, rate: float = RATE, progress: Progress = untold) -> FeedbackComparison:
    """Drive the axis at constant rate and stop it, with each way of feeding the counted speed back."""
    check_constants("compare_feedback: ", rate=rate)
    rate = min(rate, spec.limits.speed / spec.pulse)
    variants = feedback_variants(spec)
    stretch = min(max(1.0, spec.method.scale * spec.method.sample_period / WINDOW), LONGEST)
    cases: list[FeedbackCase] = []
    for name, variant in variants.items():
        progress(len(cases) / len(variants), name)
        cases.append(_measure(name, variant, rate, stretch))
    return FeedbackComparison(cases=tuple(cases), rate=rate, gain=spec.gain, tau_m=FilteredFigures(spec).tau_m)


def feedback_variants(spec: FilteredServoSpec) -> dict[str, FilteredServoSpec]:
    """The same axis with each of the four kinds of speed feedback."""
    method = spec.method
    window = method.scale * method.sample_period
    changes: dict[str, dict[str, object]] = {
        "conventional": {"filter": "none"},
        "with filter": {"filter": "float" if method.filter == "none" else method.filter},
        "long window": {"filter": "none", "scale": 1, "sample_period": window, "counter_bits": WIDE_COUNTER},
        "small multiplier": {"filter": "none", "scale": 1},
    }
    return {name: spec.changed(method=change) for name, change in changes.items()}


def _measure(name: str, spec: FilteredServoSpec, rate: float, stretch: float) -> FeedbackCase:
    """One case: figures of a run at constant rate, of a stop, and of the model."""
    seconds = STEADY_TIME * stretch
    signals = ("controller.deviation.error", "controller.filter.output", "plant.train.current")
    host, recorder = _driven(spec, rate, seconds, signals, max(1, math.ceil(seconds / 2 / TICK / MOST_ROWS)))
    host.machine.close()
    trace = recorder.trace()
    # The second half; no rows if the axis fails.
    late = (trace.time >= seconds / 2) & (not host.failure)
    t, (error, speed, current) = trace.time[late], (trace[name][late] for name in signals)
    overshoot = _stop(spec, rate, stretch)
    model = FilteredFigures(spec).loop
    limit = model.stability_limit()
    shown = t >= seconds - SHOWN * WINDOW * stretch
    return FeedbackCase(
        name=name, sample_period=spec.method.sample_period, scale=spec.method.scale, coefficient=model.coefficient,
        kv=model.velocity_error_constant, std_speed=_std(speed), std_error=_std(error),
        force_ripple=_std(current * (spec.motor.torque_constant / spec.mechanics.radius)),
        error_range=(float(error.min()), float(error.max())) if len(error) else (math.nan, math.nan),
        stop_overshoot=overshoot, stable=len(t) > 0 and not math.isnan(overshoot),
        gain_limit=limit, gain_margin=limit / spec.gain, t=t[shown], error=error[shown], speed_word=speed[shown],
    )  # fmt: skip


def _std(values: Numbers) -> float:
    """Standard deviation; NaN of nothing."""
    return float(np.std(values)) if len(values) else math.nan


def _driven(
    spec: FilteredServoSpec, rate: float, seconds: float, signals: Sequence[str], every: int
) -> tuple[FilteredHost, Recorder]:
    """An axis with way enough after some time at a rate without end, and the recorder of every n-th tick."""
    half = math.ceil(2 * rate * seconds) + 100_000  # pulses to either side, more than an unstable axis swings
    stated = spec.method.command_acceleration
    acceleration = max(stated, rate * spec.pulse / RAMP) if stated > 0 else 0.0  # 0 jumps to the rate
    roomy = spec.changed(
        limits={"travel": 2 * half * spec.pulse},
        mechanics={"start_position": half * spec.pulse},
        method={"command_acceleration": acceleration},
        disturbance=DisturbanceTable(),
    )
    recorder = Recorder(FilteredServo, signals, every=every, period=TICK)
    host = FilteredHost(roomy, recorder)
    host.start()
    go_to(host.controller, ENDLESS, round(rate * PER_PULSE))
    host.stands(round(seconds / host.machine.tick))
    return host, recorder


def _stop(spec: FilteredServoSpec, rate: float, stretch: float) -> float:
    """Overshoot after a stop from constant rate [count]; NaN for an axis that does not settle."""
    deviation, moment = "controller.deviation.deviation", STOP_AFTER * stretch
    host, recorder = _driven(spec, rate, moment, (deviation,), max(1, math.ceil(stretch)))
    generator = host.controller.generator
    go_to(host.controller, generator.command, generator.rate)  # the command stops where it is
    host.stands(round(STOP_TIME * stretch / host.machine.tick))
    host.machine.close()
    trace = recorder.trace()
    after = trace[deviation][trace.time > moment]
    if host.failure or np.ptp(after[-len(after) // 4 :]) > SETTLED:
        return math.nan
    return float(max(0, -int(after.min())))
