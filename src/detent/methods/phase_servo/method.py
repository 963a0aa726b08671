"""The phase servo as a method: what its package brings."""

from pathlib import Path
from typing import TYPE_CHECKING

from detent.axisfile.catalogue import DC_MOTORS
from detent.methods.moves.job import MoveJob, one_move
from detent.methods.moves.method import MoveMethod
from detent.methods.phase_servo.schema import PhaseServoSpec

if TYPE_CHECKING:
    from detent.record.capture import Clocking

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


class PhaseServoMethod(MoveMethod[PhaseServoSpec]):
    """Resolver phase: pulses for speed, an absolute word for the stop."""

    name = "phase_servo"
    title = "phase servo: resolver phase to pulses for speed, absolute at the stop"
    jobs = "a list of moves (.csv, .toml) or a line of text (.txt)"
    pace = "250 ns, every 256th"
    spec = PhaseServoSpec
    catalogue = DC_MOTORS
    fills, derives = "schema:fill_derived", "derive:derive"
    refuses, warns = "checks:RULES", "checks:find_cautions"
    state, params = "system:PhaseServo", "system:PhaseServoParams"
    every = 256
    seed = "detector.seed"
    signals, timing = SIGNALS, TIMING
    compares = "noise_comparison:compare_noise", "hold_comparison:compare_hold"
    commands, shows = "host:PhaseHost", "page:PhaseView"

    def tick(self, spec: PhaseServoSpec) -> float:
        """Period of the reference clocks [s]."""
        return spec.tick

    def clocking(self, spec: PhaseServoSpec) -> "Clocking":
        """Two reference clocks in a tick."""
        return self.brought("clocking:phase_servo_clocking")(spec)

    def load(self, spec: PhaseServoSpec, path: Path) -> MoveJob:
        """Moves, or a text whose characters lie on positioning points."""
        from detent.methods.moves.move_file import load_moves

        p, margin = spec.printing, round(spec.printing.left_margin / spec.pitch) * spec.pitch
        return load_moves(path, pitch=p.character_pitch, left_margin=margin, hammer_time=p.hammer_time)

    def sample_job(self, spec: PhaseServoSpec) -> MoveJob:
        """Six pitches."""
        return one_move("one move of 6 pitches", 6 * spec.pitch, 0.05)
