"""The phase servo as a method: what its package brings."""

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from detent.axisfile.catalogue import DC_MOTORS
from detent.files.findings import Caution, Derived
from detent.methods.method import Method, Shown, Simulated
from detent.methods.moves.job import MoveJob, one_move
from detent.methods.phase_servo.checks import RULES, find_cautions
from detent.methods.phase_servo.derive import derive
from detent.methods.phase_servo.schema import PhaseServoSpec, fill_derived

if TYPE_CHECKING:
    from detent.kernel.registers import Registers
    from detent.page.frame import Comparison, Page
    from detent.record.machine import AnyRecorder, Progress

SIGNALS = (
    "plant.train.position", "plant.train.velocity", "plant.train.current",
    *(f"controller.sequencer.{name}" for name in ("mode", "state", "distance", "ready", "stop")),
    *(f"controller.law.{name}" for name in ("setpoint", "integral", "word")),
    "controller.speed.word", "controller.converters.absolute.word", "plant.gauge.target",
)  # fmt: skip
TRACKING = ("reference", "ps_first", "ps_second", "msb_first", "msb_second", "gate", "plus", "minus")
TIMING = (
    "lines.carrier", "lines.ps", *(f"controller.converters.tracking.{name}" for name in TRACKING),
    "controller.converters.absolute.gated", "controller.converters.absolute.word", "controller.speed.count",
    "controller.sequencer.distance", "controller.sequencer.mode", "controller.law.word", "lines.request",
    "plant.train.current",
)  # fmt: skip


class PhaseServoMethod(Method[PhaseServoSpec]):
    """Resolver phase: pulses for speed, an absolute word for the stop."""

    name = "phase_servo"
    title = "phase servo: resolver phase to pulses for speed, absolute at the stop"
    jobs = "a list of moves (.csv, .toml) or a line of text (.txt)"
    pace = "250 ns, every 256th"
    spec = PhaseServoSpec
    rules = RULES
    catalogue = DC_MOTORS

    def fill(self, spec: PhaseServoSpec) -> PhaseServoSpec:
        """The defaults that depend on another table."""
        return fill_derived(spec)

    def derive(self, spec: PhaseServoSpec) -> tuple[Derived, ...]:
        """Derived figures."""
        return derive(spec)

    def cautions(self, spec: PhaseServoSpec) -> Iterable[Caution]:
        """What looks wrong."""
        return find_cautions(spec)

    def registers(self) -> "type[Registers]":
        """State of the axis."""
        from detent.methods.phase_servo.system import PhaseServo

        return PhaseServo

    def parameters(self) -> "type[Registers]":
        """Constants of the axis."""
        from detent.methods.phase_servo.system import PhaseServoParams

        return PhaseServoParams

    def simulated(self, spec: PhaseServoSpec) -> Simulated:
        """A phase servo that makes moves."""
        from detent.methods.moves.move_file import load_moves
        from detent.methods.moves.run import MoveRun, run_moves
        from detent.methods.phase_servo import system
        from detent.methods.phase_servo.clocking import phase_servo_clocking
        from detent.methods.phase_servo.host import PhaseHost

        p = spec.printing

        def run(job: MoveJob, recorder: "AnyRecorder | None" = None, progress: "Progress | None" = None) -> MoveRun:
            return run_moves(PhaseHost(spec, recorder), job, progress=progress)

        def load(path: Path) -> MoveJob:
            margin = round(p.left_margin / spec.pitch) * spec.pitch
            return load_moves(path, pitch=p.character_pitch, left_margin=margin, hammer_time=p.hammer_time)

        return Simulated(
            registers=system.PhaseServo,
            tick=spec.tick,
            every=256,
            seed=spec.detector.seed,
            signals=SIGNALS,
            timing=TIMING,
            clocking=phase_servo_clocking(spec),
            load=load,
            job=MoveJob,
            run=run,
            sample_job=lambda: one_move("one move of 6 pitches", 6 * spec.pitch, 0.05),
        )

    def compare(self, spec: PhaseServoSpec, progress: "Progress | None" = None) -> "tuple[Comparison, ...]":
        """Beside a servo that stops by counted pulses: noise, rest, load."""
        from detent.methods.phase_servo.hold_comparison import compare_hold
        from detent.methods.phase_servo.noise_comparison import compare_noise

        return compare_noise(spec, progress=progress), compare_hold(spec)

    def summary(self, spec: PhaseServoSpec, result: Any) -> list[tuple[str, str]]:
        """Moves, times, worst errors."""
        from detent.methods.phase_servo.page import phase_summary

        return phase_summary(spec, result)

    def page(self, spec: PhaseServoSpec, result: Any, shown: Shown) -> "Page":
        """The report."""
        from detent.methods.phase_servo.page import phase_page

        return phase_page(spec, result, shown.trace, shown.comparisons, shown.settings)
