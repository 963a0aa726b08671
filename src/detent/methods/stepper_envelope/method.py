"""The stepper envelope as a method: what its package brings."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from detent.axisfile.catalogue import STEPPER_MOTORS
from detent.axisfile.motion import motors_model, rotary_model
from detent.files.locate import Path as Key
from detent.methods.method import Method, Simulated
from detent.methods.stepper_envelope.schema import StepperEnvelopeSpec

if TYPE_CHECKING:
    from detent.methods.stepper_envelope.envelope_files import Envelope
    from detent.methods.stepper_envelope.stage_job import StageJob
    from detent.page.frame import Comparison
    from detent.record.machine import Progress

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
    rotary: type[StepperEnvelopeSpec] | None = rotary_model(StepperEnvelopeSpec)
    catalogue = STEPPER_MOTORS
    fills, derives = "schema:fill_derived", "derive:derive"
    senses, begins = "derive:position_sensors", "stepper.*.mechanics.start_position"
    refuses, warns = "rules:RULES", "checks:find_cautions"
    state, params = "system:Stepper", "system:StepperParams"
    actions = ("place", "start", "deflect", "release", "reset", "acknowledge", "call_at")
    interrupts = ("next_period",)
    fits = "controller:fit"
    every = 100
    takes, runs = "stage_job:StageJob", "run:run_stage"
    searches = "tuning:StageSearch"
    lives = "live:live"
    rests = "the field of its windings holds the rotor"
    sums_up, reports = "summary:stage_summary_rows", "page:stage_page"
    says = "{job}: every move arrived on {axis}, no step was lost.", "Not done: {failure}"

    def model_of(self, turning: frozenset[Key]) -> type[StepperEnvelopeSpec]:
        """The model of a file in which some motors turn."""
        return motors_model(self.spec, frozenset(motor for _, motor, _ in turning))

    def tick(self, spec: StepperEnvelopeSpec) -> float:
        """Time step of the rotors [s]."""
        return self.brought("build:instant")(spec)

    def simulated(self, spec: StepperEnvelopeSpec) -> Simulated:
        """A stage: the registers of each motor in a block of its name."""
        return replace(
            super().simulated(spec),
            registers=self.brought("host:stage_registers")(spec),
            signals=self.brought("run:stage_signals")(spec),
            timing=tuple(f"{name}.{signal}" for name in spec.stepper for signal in TIMING),
        )

    def load(self, spec: StepperEnvelopeSpec, path: Path) -> "StageJob":
        """Moves of its motors."""
        return self.brought("stage_job:load_stage_job")(path, tuple(spec.stepper), spec.turning)

    def sample_job(self, spec: StepperEnvelopeSpec) -> "StageJob":
        """All motors 200 steps, as far as their ways go."""
        from detent.methods.stepper_envelope.stage_job import StageJob, StageMove

        ways: dict[str, float] = {}
        for name, table in spec.stepper.items():
            start = table.step_inside(table.mechanics.start_position)
            ways[name] = table.position_of(min(start + 200, table.steps))
        return StageJob("one move of 200 steps", "moves", (StageMove(1, 0, targets=ways),), tuple(ways), ())

    def compare(self, spec: StepperEnvelopeSpec, progress: "Progress | None" = None) -> "tuple[Comparison, ...]":
        """Beside speed computed per step, constant speed, and a jerk-limited profile."""
        from detent.methods.stepper_envelope.comparison import compare_jerk, compare_steps

        return (*compare_steps(spec, progress=progress), compare_jerk(spec))

    def envelopes(self, spec: StepperEnvelopeSpec) -> Mapping[str, "Envelope"]:
        """Tables of permissible frequencies of each motor, between its extremes at power-on."""
        from detent.methods.stepper_envelope.envelope_files import Envelope, envelope_tables

        return {name: Envelope(envelope_tables(spec, name)) for name in spec.stepper}
