"""The filtered servo as a method: what its package brings."""

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from detent.axisfile.catalogue import DC_MOTORS
from detent.files.findings import Caution, Derived
from detent.methods.filtered_servo.checks import RULES, find_cautions
from detent.methods.filtered_servo.derive import derive
from detent.methods.filtered_servo.schema import FilteredServoSpec, fill_derived
from detent.methods.method import Method, Shown, Simulated
from detent.methods.moves.job import MoveJob, one_move

if TYPE_CHECKING:
    from detent.kernel.registers import Registers
    from detent.page.frame import Comparison, Page
    from detent.record.machine import AnyRecorder, Progress

SIGNALS = (
    "train.position", "train.velocity", "train.current", "generator.command", "deviation.deviation", "deviation.error",
    "deviation.word", "speed.word", "filter.output", "clock.period", "gauge.target",
)  # fmt: skip
TIMING = (
    "encoder.channel_a", "encoder.channel_b", "decoder.a1", "decoder.a2", "decoder.b1", "decoder.b2",
    "decoder.forward", "decoder.reverse", "generator.command", "deviation.deviation", "speed.count", "speed.word",
    "clock.left", "filter.output", "deviation.word",
)  # fmt: skip


class FilteredServoMethod(Method[FilteredServoSpec]):
    """Command pulses, counted speed behind a digital filter."""

    name = "filtered_servo"
    title = "filtered servo: command pulses, counted speed with a low-pass"
    jobs = "a list of moves (.csv, .toml)"
    pace = "10 us, every 10th"
    spec = FilteredServoSpec
    rules = RULES
    catalogue = DC_MOTORS

    def fill(self, spec: FilteredServoSpec) -> FilteredServoSpec:
        """The defaults that depend on another table."""
        return fill_derived(spec)

    def derive(self, spec: FilteredServoSpec) -> tuple[Derived, ...]:
        """Derived figures."""
        return derive(spec)

    def cautions(self, spec: FilteredServoSpec) -> Iterable[Caution]:
        """What looks wrong."""
        return find_cautions(spec)

    def registers(self) -> "type[Registers]":
        """State of the axis."""
        from detent.methods.filtered_servo.system import FilteredServo

        return FilteredServo

    def parameters(self) -> "type[Registers]":
        """Constants of the axis."""
        from detent.methods.filtered_servo.system import FilteredServoParams

        return FilteredServoParams

    def simulated(self, spec: FilteredServoSpec) -> Simulated:
        """A filtered servo that makes moves."""
        from detent.methods.filtered_servo import system
        from detent.methods.filtered_servo.host import FilteredHost
        from detent.methods.moves.move_file import load_moves
        from detent.methods.moves.run import MoveRun, run_moves
        from detent.record.capture import Clocking

        def run(job: MoveJob, recorder: "AnyRecorder | None" = None, progress: "Progress | None" = None) -> MoveRun:
            return run_moves(FilteredHost(spec, recorder), job, progress=progress)

        return Simulated(
            registers=system.FilteredServo,
            tick=system.TICK,
            every=10,
            seed=spec.encoder.seed,
            signals=SIGNALS,
            timing=TIMING,
            clocking=Clocking(system.CLOCKS, clocks={"clock.C": ((0.0, 0.5), "decoder clock, 1 MHz")}),
            load=load_moves,
            job=MoveJob,
            run=run,
            sample_job=lambda: one_move("one move of 1000 pulses", 1000 * spec.pulse, 0.2),
        )

    def compare(self, spec: FilteredServoSpec, progress: "Progress | None" = None) -> "tuple[Comparison, ...]":
        """Beside no filter, a longer window, a smaller multiplier."""
        from detent.methods.filtered_servo.comparison import compare_feedback

        return (compare_feedback(spec, progress=progress),)

    def summary(self, spec: FilteredServoSpec, result: Any) -> list[tuple[str, str]]:
        """Moves, times, worst errors."""
        from detent.methods.filtered_servo.page import filtered_summary

        return filtered_summary(spec, result)

    def page(self, spec: FilteredServoSpec, result: Any, shown: Shown) -> "Page":
        """The report."""
        from detent.methods.filtered_servo.page import filtered_page

        return filtered_page(spec, result, shown.trace, shown.comparisons, shown.settings)
