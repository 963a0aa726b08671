"""The phase servo as a method: what its package brings."""

from pathlib import Path
from typing import TYPE_CHECKING

from detent.axisfile.catalogue import DC_MOTORS
from detent.methods.moves.job import MoveJob, load_moves, one_move
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
TRACKING = "controller.converters.tracking"
SAMPLERS = ("reference", "ps_first", "ps_second", "msb_first", "msb_second", "gate", "plus", "minus")
TIMING = (
    "lines.carrier", "lines.ps", *(f"{TRACKING}.{name}" for name in SAMPLERS),
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
    senses = "derive:position_sensors"
    refuses, warns = "checks:RULES", "checks:find_cautions"
    state, params = "system:PhaseServo", "system:PhaseServoParams"
    actions = ("power_on", "command", "acquire", "take_ready", "arrive_within", "forget_conduct")
    fits = "controller:fit"
    every = 256
    seed = "detector.seed"
    signals, timing = SIGNALS, TIMING
    searches, stands = "tuning:PhaseSearch", "standstill:PhaseEnsemble"
    lives = "live:live"
    compares = "comparison:compare_noise", "comparison:compare_hold"
    commands, shows = "host:PhaseHost", "page:PhaseView"

    def tick(self, spec: PhaseServoSpec) -> float:
        """Period of the reference clocks [s]."""
        return spec.tick

    def clocking(self, spec: PhaseServoSpec) -> "Clocking":
        """First clock and sawtooth as a tick begins, pulses while the second clock is active, samplers as it ends."""
        from detent.record.capture import Clocking
        from detent.record.waveforms import Phase

        reference, plus, minus = (f"{TRACKING}.{name}" for name in ("reference", "plus", "minus"))
        sawtooth, request = "controller.pwm.sawtooth", "lines.first_request"
        mask, half = spec.detector.counts - 1, 1 << (spec.drive.pwm_bits - 1)
        late = (TRACKING, "controller.speed", "controller.sequencer", "controller.law")
        pulses = (f"{TRACKING}.gate", plus, minus)
        return Clocking(
            phases=dict.fromkeys(late, Phase(0.75)) | dict.fromkeys(pulses, Phase(pulse=(0.5, 0.75))),
            clocks={
                "controller.clocks.CK1": ((0.0, 0.25), "first reference clock"),
                "controller.clocks.CK2": ((0.5, 0.75), "second reference clock"),
            },
            # The counter without the pulse of the second clock; sawtooth and request of the first oscillator period.
            between={
                reference: lambda rows: (rows[reference] - rows[plus].astype("i8") + rows[minus].astype("i8")) & mask,
                sawtooth: lambda rows: (rows[sawtooth].astype("i8") - 1 + half) % (2 * half) - half,
                "lines.request": lambda rows: rows[request],
            },
            needs=(plus, minus, sawtooth, request),
        )

    def load(self, spec: PhaseServoSpec, path: Path) -> MoveJob:
        """Moves, or a text whose characters lie on positioning points."""
        p, margin = spec.printing, round(spec.printing.left_margin / spec.pitch) * spec.pitch
        return load_moves(path, pitch=p.character_pitch, left_margin=margin, hammer_time=p.hammer_time)

    def sample_job(self, spec: PhaseServoSpec) -> MoveJob:
        """Six pitches."""
        return one_move("one move of 6 pitches", 6 * spec.pitch, 0.05)

    def trial_job(self, spec: PhaseServoSpec) -> MoveJob:
        """Three moves, short and long, to both sides."""
        return self.brought("tuning:three_moves")(spec)
