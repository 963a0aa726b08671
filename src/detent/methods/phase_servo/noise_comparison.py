"""What spurious pulses do to the stop: this servo beside one that stops by counted pulses (phase-servo tests 25, 26).

The same move is made again and again on the same axis, each time with some pulses put in on the counting lines on the
way; once with the absolute word as the position error of the final approach, once with the signed count of pulses still
to come. Everything else is equal.
"""

from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from detent.axisfile.tables import BurstTable, InterferenceTable
from detent.errors import DetentError
from detent.methods.method import untold
from detent.methods.phase_servo.host import START, UNDISTURBED, PhaseBench
from detent.methods.phase_servo.schema import DisturbanceTable, PhaseServoSpec
from detent.page.chart import Chart, Curve, Panel, line_chart
from detent.page.figure import Figure
from detent.page.table import TextTable
from detent.page.words import count
from detent.record.machine import Progress
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

Numbers = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class NoiseComparison:
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
        heads = ("pulses put in", "this servo, + pulses", "- pulses", "incremental servo, + pulses", "- pulses")
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
            f"Noise puts pulses on the counting lines during a move of {count(self.pitches, 'pitch', 'pitches')}. A "
            "servo that only counts stops as far off its target as pulses came, and keeps the error. This one stops on "
            "its target, because the phase of the resolver says where that is. Its limit: more than "
            f"{count(self.margin, 'pulse')} in one move, and it stops exactly one pitch off."
        )
        title = "Noise on the pulse lines: where the axis comes to rest"
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
            title=f"Magnified: no stop on the target may be more than {NOISE_BAND:g} steps off (dashed)",
        ),
    ]  # fmt: skip
    marks = {"marks": [{"x": side * found.margin, "label": "limit"} for side in (-1, 1)]}
    return [line_chart(panel, x, "− pulses put in   [pulse]   + pulses put in") | marks for panel in panels]


def compare_noise(spec: PhaseServoSpec, *, pitches: int = 6, progress: Progress = untold) -> NoiseComparison:
    """Find where the axis stops after spurious pulses, and where it would stop by counted pulses."""
    counts = spec.detector.counts
    most = MOST_STEPS // counts
    if not 1 <= pitches <= most:
        raise DetentError(
            f"comparison of noise: came a move of {pitches} pitches; allowed: 1 to {most}; choose another"
        )
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
