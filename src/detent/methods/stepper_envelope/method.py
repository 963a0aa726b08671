"""The stepper envelope as a method: what its package brings."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

from detent.axisfile.catalogue import STEPPER_MOTORS
from detent.files.findings import Caution, Contradiction, Derived
from detent.methods.method import Method, Shown, Simulated
from detent.methods.stepper_envelope.schema import StepperEnvelopeSpec, fill_derived

if TYPE_CHECKING:
    from detent.kernel.registers import Registers
    from detent.methods.stepper_envelope.envelope_files import Envelope
    from detent.page.frame import Comparison, Page
    from detent.record.machine import AnyRecorder, Progress

TIMING = (
    "controller.timer.pulses", "controller.timer.phase", "controller.timer.period", "controller.rule.index",
    "controller.rule.relation", "controller.rule.state", "plant.rotor.lag",
)  # fmt: skip


class StepperEnvelopeMethod(Method[StepperEnvelopeSpec]):
    """Several steppers, the permissible speed of every step as a table."""

    name = "stepper_envelope"
    title = "stepper envelope: speed as a table of what is allowed, one motor or several"
    jobs = "moves of several motors, or tiles (.csv, .toml)"
    pace = "2 us, every 100th"
    spec = StepperEnvelopeSpec
    catalogue = STEPPER_MOTORS

    @cached_property
    def rules(self) -> Sequence[Callable[[StepperEnvelopeSpec], Iterable[Contradiction]]]:  # pyright: ignore[reportIncompatibleVariableOverride] - they make tables, with NumPy
        """What must hold between keys."""
        from detent.methods.stepper_envelope.checks import RULES

        return RULES

    def fill(self, spec: StepperEnvelopeSpec) -> StepperEnvelopeSpec:
        """The defaults that depend on another table."""
        return fill_derived(spec)

    def derive(self, spec: StepperEnvelopeSpec) -> tuple[Derived, ...]:
        """Derived figures."""
        from detent.methods.stepper_envelope.derive import derive

        return derive(spec)

    def cautions(self, spec: StepperEnvelopeSpec) -> Iterable[Caution]:
        """What looks wrong."""
        from detent.methods.stepper_envelope.checks import find_cautions

        return find_cautions(spec)

    def registers(self) -> "type[Registers]":
        """State of the axis."""
        from detent.methods.stepper_envelope.system import Stepper

        return Stepper

    def parameters(self) -> "type[Registers]":
        """Constants of the axis."""
        from detent.methods.stepper_envelope.system import StepperParams

        return StepperParams

    def simulated(self, spec: StepperEnvelopeSpec) -> Simulated:
        """A stage that makes moves of several motors."""
        from detent.methods.stepper_envelope.build import instant
        from detent.methods.stepper_envelope.machine import stage_registers
        from detent.methods.stepper_envelope.run import StageRun, run_stage, stage_signals
        from detent.methods.stepper_envelope.stage_file import load_stage_job
        from detent.methods.stepper_envelope.stage_job import StageJob, StageMove
        from detent.record.capture import Clocking

        names = tuple(spec.stepper)

        def run(job: StageJob, recorder: "AnyRecorder | None" = None, progress: "Progress | None" = None) -> StageRun:
            return run_stage(spec, job, recorder=recorder, progress=progress)

        def sample_job() -> StageJob:
            ways: dict[str, float] = {}
            for name, table in spec.stepper.items():
                start = table.step_inside(table.mechanics.start_position)
                ways[name] = table.position_of(min(start + 200, table.steps))
            return StageJob("one move of 200 steps", "moves", (StageMove(1, 0, targets=ways),), names, ())

        return Simulated(
            registers=stage_registers(spec),
            tick=instant(spec),
            every=100,
            signals=stage_signals(spec),
            timing=tuple(f"{name}.{signal}" for name in names for signal in TIMING),
            clocking=Clocking(),
            load=lambda path: load_stage_job(path, names),
            job=StageJob,
            run=run,
            sample_job=sample_job,
        )

    def compare(self, spec: StepperEnvelopeSpec, progress: "Progress | None" = None) -> "tuple[Comparison, ...]":
        """Beside speed computed per step, constant speed, and a jerk-limited profile."""
        from detent.methods.stepper_envelope.comparison import compare_steps
        from detent.methods.stepper_envelope.jerk_comparison import compare_jerk

        return (*compare_steps(spec, progress=progress), compare_jerk(spec))

    def verdict(self, axis: str, result: Any) -> str:
        """Whether every move arrived."""
        done = f"{result.job.name}: every move arrived on {axis}, no step was lost."
        return done if result.done else f"Not done: {result.failure}"

    def summary(self, spec: StepperEnvelopeSpec, result: Any) -> list[tuple[str, str]]:
        """Moves, times, lag and margin."""
        from detent.methods.stepper_envelope.summary import stage_summary_rows

        return stage_summary_rows(spec, result)

    def page(self, spec: StepperEnvelopeSpec, result: Any, shown: Shown) -> "Page":
        """The report."""
        from detent.methods.stepper_envelope.page import stage_page

        return stage_page(spec, result, shown.trace, shown.comparisons, shown.settings)

    def envelopes(self, spec: StepperEnvelopeSpec) -> Mapping[str, "Envelope"]:
        """Tables of permissible frequencies of each motor, between its extremes at power-on."""
        from detent.methods.stepper_envelope.envelope_files import Envelope, envelope_tables

        return {name: Envelope(envelope_tables(spec, name)) for name in spec.stepper}
