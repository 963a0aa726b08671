"""Three ways of choosing the drive value, compared on one drifted machine (print-head specification, tests 24 and 25).

The power-on default, a table computed from the nameplate, and the constants the axis identified on the machine itself.
Every way drives the same machine open loop at several speeds, and starts it with the slow trim running.
"""

from dataclasses import asdict, dataclass
from math import inf, isfinite
from typing import Any

import numpy as np
from numpy.typing import NDArray

from detent.control.head_computer import HIGH_STEADY, IDLE, OK
from detent.control.speed_selection import HIGH_SPEED
from detent.errors import AxisError, DetentError, describe_sb1
from detent.files.quantities import INCH
from detent.methods.print_head.build import build_print_head
from detent.methods.print_head.derive import HeadFigures
from detent.methods.print_head.run import print_head_machine
from detent.methods.print_head.schema import EMITTER, PrintHeadSpec, speed_value
from detent.methods.print_head.supervisor import Answer, Supervisor, calculate_parameters, controlled_run_to, set_speed
from detent.methods.print_head.system import TICK, PrintHead, switch_on
from detent.page.chart import Curve, Panel, Timeline, line_chart, time_charts
from detent.page.figure import Figure
from detent.page.frame import ComparisonOnScreen
from detent.page.table import TextTable
from detent.record.machine import Machine, Progress
from detent.record.recorder import Recorder

SPEEDS = (40 * INCH, 20 * INCH, 10 * INCH)
BENCH_EMITTERS = 65_535  # length of the line the machine is measured on: the longest the protocol can count
FROM_FRAME = 200  # emitters between a frame and the start or the target of a measuring run
SETTLING = 15  # mechanical time constants until a speed counts as steady: what is left is below 1e-6
READING = 0.05  # length of the speed reading at the end of an open-loop run [s]
START_TIME = 1.2  # recorded length of a start [s]
FIRST_LINE = 0.30  # what a line of 13.2 in lasts at 40 in/s, a little less [s]: the mean error is taken over it
BAND = 0.01  # half-width of the band of good speed, as a fraction of the commanded one
COLOURS = ("muted", "left", "right")  # of the ways, in their order

Numbers = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class DriveConstants:
    """Constants the axis computer works with: slope K [1/256 count per speed value], friction drive Vf [count]."""

    slope_right: int
    slope_left: int
    friction_right: int
    friction_left: int


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveStart:
    """A start to the right at top speed, with the trim running."""

    t: Numbers  # and velocity: time since the move began [s] and carriage speed [m/s]
    velocity: Numbers
    mean_error: float  # speed error over the first 0.30 s of steady motion, as a fraction of the commanded speed
    # from the end of the ramp until the speed first is within 1 % of the commanded one [s]; infinite if it never is
    time_to_band: float

    def settled(self, target: float) -> float:
        """When the speed is within `BAND` of `target` [m/s] for good [s]; infinite if it never is."""
        outside = np.flatnonzero(~(np.abs(self.velocity - target) <= BAND * target))
        after = int(outside[-1]) + 1 if outside.size else 0
        return float(self.t[after]) if after < len(self.t) else inf


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class DriveComparison(ComparisonOnScreen):
    """Result of `compare_drives`.

    Attributes
    ----------
    methods : tuple of str
        Names, in the order of everything below.
    constants : tuple of DriveConstants
        What each method drives with.
    speeds : tuple of float
        Commanded speeds [m/s].
    errors : ndarray, shape (methods, speeds, 2)
        Open-loop speed error as a fraction of the commanded speed, measured - commanded; right, then left. -1 where the
        drive did not move the head.
    starts : tuple of DriveStart
        Starts at `target`.
    target : float
        Commanded speed of the starts [m/s].
    machine : str
        How the machine differs from its file, in a few words.
    """

    methods: tuple[str, ...]
    constants: tuple[DriveConstants, ...]
    speeds: tuple[float, ...]
    errors: Numbers
    starts: tuple[DriveStart, ...]
    target: float
    machine: str

    @property
    def table(self) -> TextTable:
        """Steady speed errors of the drives."""
        rows = [
            (f"{speed / INCH:.4g} in/s", *(f"{right:+.1%} / {left:+.1%}" for right, left in self.errors[:, k, :]))
            for k, speed in enumerate(self.speeds)
        ]
        return TextTable(f"Steady speed error, right / left ({self.machine})", ("speed", *self.methods), rows)

    def figures(self) -> tuple[Figure, ...]:
        """How far off speed each drive is open loop, and how it starts with the trim."""
        return _error_figure(self), _start_figure(self)

    def to_dict(self) -> dict[str, Any]:
        """Plain data for ``--json``: everything but the curves."""
        return {
            "target": self.target,
            "speeds": list(self.speeds),
            "methods": [
                {
                    "method": method,
                    "constants": asdict(self.constants[k]),
                    "errors_right": self.errors[k, :, 0].tolist(),
                    "errors_left": self.errors[k, :, 1].tolist(),
                    "mean_error": self.starts[k].mean_error,
                    "time_to_band": self.starts[k].time_to_band if isfinite(self.starts[k].time_to_band) else None,
                }
                for k, method in enumerate(self.methods)
            ],
        }


def _error_figure(found: DriveComparison) -> Figure:
    caption = (
        f"Steady-state speed error (measured minus commanded) without trim, on this machine: {found.machine}. The "
        "default is what the axis assumes at power-on, the nominal table is that of a conventional printer, "
        "computed from the nameplate. Circles should be on the line; below it the head is too slow, at −100 % it "
        "does not move."
    )
    speeds, order = np.sort(found.speeds) / INCH, np.argsort(found.speeds)
    # A circle needs room at either end.
    x = np.concatenate(([-1.1 * speeds[-1]], -speeds[::-1], speeds, [1.1 * speeds[-1]]))
    curves: list[Curve] = []
    for method, colour, one in zip(found.methods, COLOURS, 100 * found.errors[:, order], strict=True):
        y = np.concatenate(([np.nan], one[::-1, 1], one[:, 0], [np.nan]))
        curves.append(Curve(label=method, colour=colour, rings=11, y=y, digits=2))
    low, high = min(0.0, 100 * float(found.errors.min())), max(0.0, 100 * float(found.errors.max()))
    room = 0.12 * max(high - low, 1.0)
    span = (round(low - room, 2), round(high + room, 2))
    panel = Panel(name="drives", label="speed error [%]", height=260, zero=True, span=span, curves=curves)
    chart = line_chart(panel, x, "\u2190 to the left   commanded speed [in/s]   to the right \u2192")
    title = "Speed error for each choice of drive"
    return Figure(title=title, caption=caption, charts=[chart], table=found.table.on_page)


def _start_figure(found: DriveComparison) -> Figure:
    target, band = found.target / INCH, f"±{100 * BAND:g} %"
    caption = (
        f"The same drives, starting to the right at {target:.4g} in/s with the trim running. Below: the settling, "
        f"magnified. Compare when each stays between the dashed lines; what settles after {FIRST_LINE:.1f} s is too "
        "late for a line of 13 in at 40 in/s."
    )
    longest = max((start.t for start in found.starts), key=len)
    curves: list[Curve] = []
    for method, colour, start in zip(found.methods, COLOURS, found.starts, strict=True):
        gap = np.full(len(longest) - len(start.t), np.nan)  # to the end, of an axis that gave up
        curves.append(Curve(label=method, colour=colour, width=2, y=np.append(start.velocity / INCH, gap)))
    levels = [(round(target * (1 + sign * BAND), 3), f"{text}{100 * BAND:g} %") for sign, text in ((1, "+"), (-1, "−"))]
    near = (round(0.95 * target, 3), round(1.03 * target, 3))
    timeline = Timeline(name="drive-starts", t=longest, label="time since the move began", unit="s")
    charts = time_charts(timeline, [
        Panel(name="drive-starts", label="speed [in/s]", height=240, zero=True, curves=curves),
        Panel(name="drive-starts-near", label="speed [in/s]", height=180, span=near, levels=levels, curves=curves),
    ])  # fmt: skip
    heads = ("drive", "slope K, right / left", "friction Vf, right / left", f"within {band} for good after [s]",
             f"mean error over {FIRST_LINE:.2f} s [%]")  # fmt: skip
    rows = [
        (method, f"{way.slope_right} / {way.slope_left}", f"{way.friction_right} / {way.friction_left}",
         f"{settled:.2f}" if isfinite(settled := start.settled(found.target)) else "not reached",
         f"{100 * start.mean_error:+.1f}")
        for method, way, start in zip(found.methods, found.constants, found.starts, strict=True)
    ]  # fmt: skip
    title = f"Settling to within {band} of {target:.4g} in/s"
    return Figure(title=title, caption=caption, charts=charts, table=TextTable(title, heads, rows).on_page)


def compare_drives(
    spec: PrintHeadSpec, speeds: tuple[float, ...] = SPEEDS, progress: Progress | None = None
) -> DriveComparison:
    """Compare the power-on default, the nominal table and the identified drive on the machine of `spec`."""
    chosen = tuple(v for v in speeds if v <= spec.limits.speed * (1 + 1e-9))
    low = [v for v in chosen if speed_value(v) < HIGH_SPEED]
    if low or not chosen:
        got = ", ".join(f"{v / INCH:.4g} in/s" for v in low or speeds)
        raise DetentError(
            f"comparison of drives: got {got}; expected: 10 in/s to {spec.limits.speed / INCH:.4g} in/s "
            "(limits.speed); choose speeds of the high-speed class, or raise limits.speed"
        )
    ways = {
        "power-on default": default_constants(spec),
        "nominal table": nominal_constants(spec),
        "identified": identified_constants(spec),
    }
    bench, errors, starts = MeasuringBench(spec), list[Any](), list[DriveStart]()
    for name, way in ways.items():
        if progress:
            progress(len(starts) / len(ways), name)
        errors.append([[bench.open_loop_error(way, v, d) for d in (1, -1)] for v in chosen])
        starts.append(bench.start(way, spec.limits.speed))
    return DriveComparison(
        methods=tuple(ways),
        constants=tuple(ways.values()),
        speeds=chosen,
        errors=np.array(errors),
        starts=tuple(starts),
        target=spec.limits.speed,
        machine=drift_text(spec),
    )


def drift_text(spec: PrintHeadSpec) -> str:
    """How the true machine differs from its file, in a few words."""
    d = spec.disturbance
    drifts = {"K": d.motor_constant, "friction right": d.friction_right, "friction left": d.friction_left}
    parts = [f"{name} {100 * value:+.3g} %" for name, value in drifts.items() if value]
    if d.supply != spec.drive.supply:
        parts.append(f"supply {d.supply:.4g} V instead of {spec.drive.supply:.4g} V")
    return ", ".join(parts) or "machine as in its file"


def default_constants(spec: PrintHeadSpec) -> DriveConstants:
    """What the axis computer assumes at power-on, both directions."""
    slope, friction = spec.method.default_slope, spec.method.default_friction_counts
    return DriveConstants(slope, slope, friction, friction)


def nominal_constants(spec: PrintHeadSpec) -> DriveConstants:
    """The table of a conventional printer: computed from the description of the machine, without its disturbances."""
    nameplate = spec.disturbance.model_copy(
        update={"motor_constant": 0.0, "friction_right": 0.0, "friction_left": 0.0, "supply": spec.drive.supply}
    )
    figures = HeadFigures(spec.model_copy(update={"disturbance": nameplate}))
    return DriveConstants(*map(round, (*figures.slope.values(), *figures.coulomb_counts.values())))


def identified_constants(spec: PrintHeadSpec) -> DriveConstants:
    """Run CALCULATE PARAMETERS on the machine of `spec` and read what it found."""
    machine, answers = print_head_machine(spec), list[Answer]()
    c = machine.state.controller
    supervisor = Supervisor(c, machine.pass_time, answers.append, spec.method.ack_last)
    supervisor.send(calculate_parameters())
    supervisor.finish()
    if answers[0].byte != OK:
        raise AxisError(f"comparison of drives: CALCULATE PARAMETERS failed: {describe_sb1(answers[0].byte)}")
    right, left = c.head.right, c.head.left
    return DriveConstants(right.slope, left.slope, right.friction, left.friction)


class MeasuringBench:
    """The machine of a specification on a line of 218 in, where the steady speed of any drive can be measured."""

    def __init__(self, spec: PrintHeadSpec) -> None:
        limits = spec.limits.model_copy(update={"travel": BENCH_EMITTERS * EMITTER})
        disturbance = spec.disturbance.model_copy(update={"obstacle": None, "push": None})
        self.spec = spec.model_copy(update={"limits": limits, "disturbance": disturbance})
        self.params = build_print_head(self.spec)

    def open_loop_error(self, constants: DriveConstants, speed: float, direction: int) -> float:
        """Error of the steady speed without trim, as a fraction of `speed` [m/s]; -1 if the head does not move."""
        seconds = min(0.2 + SETTLING * HeadFigures(self.spec).mechanical_time_constant, 4.0)
        velocity, _ = self._run(constants, speed, direction, seconds, trim=False)
        if len(velocity) < round(seconds / TICK):
            return -1.0
        return float(np.mean(velocity[-round(READING / TICK) :])) * direction / speed - 1.0

    def start(self, constants: DriveConstants, speed: float) -> DriveStart:
        """A start to the right at `speed` [m/s] with the trim running."""
        velocity, state = self._run(constants, speed, 1, START_TIME, trim=True)
        t = np.arange(1, len(velocity) + 1, dtype=np.float64) * TICK
        error = velocity[state.tolist().index(HIGH_STEADY) :] / speed - 1.0 if HIGH_STEADY in state else np.empty(0)
        good = np.flatnonzero(np.abs(error) <= BAND)
        return DriveStart(
            t=t,
            velocity=velocity,
            mean_error=float(np.mean(error[: round(FIRST_LINE / TICK)])) if len(error) else -1.0,
            time_to_band=float(good[0] * TICK) if len(good) else inf,
        )

    def _run(
        self, way: DriveConstants, speed: float, direction: int, seconds: float, *, trim: bool
    ) -> tuple[Numbers, NDArray[np.uint8]]:
        """Velocity and state in a move, tick by tick from its first; fewer than `seconds` if the axis gave up."""
        p, r = self.params, PrintHead()
        p.controller.trim = trim
        begin, target = FROM_FRAME, BENCH_EMITTERS - FROM_FRAME
        if direction < 0:
            begin, target = target, begin
        switch_on(p, r, (begin + 0.5) * EMITTER, self.spec.encoder.seed)
        head = r.controller.head
        head.emitter, head.width, head.homed, head.state = begin, BENCH_EMITTERS, 1, IDLE
        head.right.slope, head.right.friction = way.slope_right, way.friction_right
        head.left.slope, head.left.friction = way.slope_left, way.friction_left
        recorder = Recorder(PrintHead, ("plant.train.velocity", "controller.head.state"), every=1, period=TICK)
        machine = Machine(p, r, TICK, recorder)
        supervisor = Supervisor(r.controller, machine.pass_time, lambda _: None, self.spec.method.ack_last)
        supervisor.send(set_speed(speed_value(speed)))
        supervisor.finish()
        supervisor.send(controlled_run_to(target))
        before = r.tick
        machine.pass_ticks(round(seconds / TICK))
        machine.close()
        _, velocity, state = recorder.trace().columns.values()
        return velocity[before:], state[before:]
