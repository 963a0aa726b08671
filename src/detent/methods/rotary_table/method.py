"""The rotary table as a method: what its package brings."""

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from detent.files.findings import Caution, Derived
from detent.methods.method import Method, Shown, Simulated
from detent.methods.rotary_table.checks import RULES, find_cautions
from detent.methods.rotary_table.derive import derive
from detent.methods.rotary_table.schema import RotaryTableSpec, fill_derived

if TYPE_CHECKING:
    from detent.page.frame import Comparison, Page
    from detent.record.machine import AnyRecorder, Progress

TIMING = (
    "lines.fine", "lines.coarse", "controller.absolute.theta", "controller.positioner.angle.dar",
    "controller.positioner.angle.flg", "controller.positioner.angle.turn", "controller.positioner.angle.aar",
    "controller.positioner.oar", "controller.positioner.interpolator.irr", "controller.positioner.dr",
    "controller.positioner.s4", "lines.word", "plant.train.motor.velocity",
)  # fmt: skip


class RotaryTableMethod(Method[RotaryTableSpec]):
    """Absolute angle of one turn, servo-controlled jog for any number of turns."""

    name = "rotary_table"
    title = "rotary table: absolute angle of one turn, servo-controlled jog without end"
    jobs = "a sequence (.toml)"
    pace = "100 us, every 20th"
    spec = RotaryTableSpec
    rules = RULES
    state, params = "system:RotaryTable", "system:RotaryTableParams"

    def fill(self, spec: RotaryTableSpec) -> RotaryTableSpec:
        """The defaults that depend on another table."""
        return fill_derived(spec)

    def derive(self, spec: RotaryTableSpec) -> tuple[Derived, ...]:
        """Derived figures."""
        return derive(spec)

    def cautions(self, spec: RotaryTableSpec) -> Iterable[Caution]:
        """What looks wrong."""
        return find_cautions(spec)

    def simulated(self, spec: RotaryTableSpec) -> Simulated:
        """A table that runs sequences."""
        from detent.methods.rotary_table.run import SEQUENCE_SIGNALS, SequenceRun, run_sequence
        from detent.methods.rotary_table.sequence_file import load_sequence
        from detent.methods.rotary_table.sequence_job import Jog, SequenceJob
        from detent.methods.rotary_table.system import TICK
        from detent.record.capture import Clocking

        def run(
            job: SequenceJob, recorder: "AnyRecorder | None" = None, progress: "Progress | None" = None
        ) -> SequenceRun:
            return run_sequence(spec, job, recorder=recorder, progress=progress)

        def sample_job() -> SequenceJob:
            return SequenceJob("a short jog", (Jog(direction=1, duration=max(0.2, spec.method.task_period)),), {})

        return Simulated(
            registers=self.registers(),
            tick=TICK,
            every=20,
            seed=spec.detector.seed,
            signals=SEQUENCE_SIGNALS,
            timing=TIMING,
            clocking=Clocking(),
            load=load_sequence,
            job=SequenceJob,
            run=run,
            sample_job=sample_job,
        )

    def compare(self, spec: RotaryTableSpec, progress: "Progress | None" = None) -> "tuple[Comparison, ...]":
        """Beside an angle without extension and a jog without position control."""
        from detent.methods.rotary_table.comparison_runs import compare_angle

        return (compare_angle(spec, progress=progress),)

    def verdict(self, axis: str, result: Any) -> str:
        """Whether every step was done."""
        done = f"{result.job.name}: every step was done on {axis}."
        return done if result.done else f"Not done: {result.failure}"

    def summary(self, spec: RotaryTableSpec, result: Any) -> list[tuple[str, str]]:
        """Steps, times, deviations."""
        from detent.methods.rotary_table.summary import sequence_summary_rows

        return sequence_summary_rows(spec, result)

    def page(self, spec: RotaryTableSpec, result: Any, shown: Shown) -> "Page":
        """The report."""
        from detent.methods.rotary_table.page import table_page

        return table_page(spec, result, shown.trace, shown.comparisons, shown.settings)
