"""The cascade axis as a method: what its package brings."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from detent.axisfile.catalogue import DC_MOTORS
from detent.axisfile.motion import rotary_model
from detent.methods.cascade.schema import CascadeSpec
from detent.methods.method import Method, Shown, Simulated
from detent.methods.moves.job import MoveJob, half_and_back, one_move

if TYPE_CHECKING:
    from detent.page.frame import Page
    from detent.record.machine import AnyRecorder, Progress


class CascadeMethod(Method[CascadeSpec]):
    """Position over velocity loop, the usual servo of today."""

    name = "cascade"
    title = "cascade: position loop around a velocity loop, linear or rotary, as in standard servo drives"
    jobs = "a list of moves (.csv, .toml), or a recording to replay"
    pace = "from the axis file, every sample"
    spec = CascadeSpec
    rotary: type[CascadeSpec] | None = rotary_model(CascadeSpec)
    catalogue = DC_MOTORS
    fills, derives = "schema:fill_derived", "derive:derive"
    senses = "derive:position_sensors"
    refuses, warns = "checks:RULES", "checks:find_cautions"
    state, params = "system:Cascade", "system:CascadeParams"
    actions = (
        "power_on", "engage", "guard_axis", "begin", "arrive_within", "take_event", "coast", "forget_peaks",
        "forget_following", "forget_conduct",
    )  # fmt: skip
    fits = "controller:fit"
    signals = "run:CASCADE_SIGNALS"
    timing = (
        "controller.left", "controller.reference.position", "lines.motor.count", "controller.motor_sensor.velocity",
        "controller.law.position_error", "controller.law.command", "controller.law.limited", "plant.source.output",
        "plant.machine.motor.position", "plant.machine.motor.sense", "plant.machine.load.position",
        "plant.machine.side",
    )  # fmt: skip
    takes, reads = "detent.methods.moves.job:MoveJob", "detent.methods.moves.job:load_moves"
    linear_loops = "loop:linear_loops"
    tunes = "tuning:CascadeTuning"
    stands, checks_standstill = "standstill:CascadeEnsemble", True
    keeps, batches = "build:kept", "batch:CascadeBatch"
    leaves_out = (
        "Neglected: saturation, quantization, Coulomb and Stribeck friction; both masses move, backlash is closed.",
    )
    lives = "live:live"
    wires, machines, boards = "wired:wired", "wired:machine", "led:BOARD"
    compares = ("comparison:compare_profiles",)
    reports = "page:cascade_page"
    says = "{job}: every move was in position on {axis}.", "Not done: {failure}"

    def arithmetic(self, spec: CascadeSpec) -> str:
        """As its file says."""
        return spec.controller.arithmetic

    def tick(self, spec: CascadeSpec) -> float:
        """As many in a sample as the plant needs [s]."""
        return self.brought("build:build_cascade")(spec).plant.machine.period

    def simulated(self, spec: CascadeSpec) -> Simulated:
        """An axis that makes moves or replays a recording."""
        made = super().simulated(spec)
        return replace(
            made,
            registers=self.brought("host:cascade_registers")(spec),
            every=round(spec.method.sample_period / made.tick),
            job=(MoveJob, self.brought("replay:ReplayJob")),
        )

    def load(self, spec: CascadeSpec, path: Path) -> MoveJob:
        """Moves, linear or rotary as the axis is."""
        return self.brought(self.reads)(path, rotary=spec.axis.motion == "rotary")

    def run(
        self, spec: CascadeSpec, job: Any, recorder: "AnyRecorder | None" = None, progress: "Progress | None" = None
    ) -> Any:
        """Moves, or a recording."""
        place = "replay:run_cascade_replay" if job.kind == "replay" else "run:run_cascade_moves"
        return self.brought(place)(spec, job, recorder=recorder, progress=progress)

    def batch(self, spec: CascadeSpec, job: Any) -> Any:
        """Moves on many axes at once; recordings, and parameters that change, one by one."""
        return None if job.kind == "replay" or job.changes else super().batch(spec, job)

    def sample_job(self, spec: CascadeSpec) -> MoveJob:
        """A short way to where there is more room."""
        way, middle = 0.02 * spec.limits.travel, spec.limits.lowest + 0.5 * spec.limits.travel
        return one_move("one move", way if spec.mechanics.start_position < middle else -way, 0.05)

    def trial_job(self, spec: CascadeSpec) -> MoveJob:
        """Half of the travel and back."""
        return half_and_back(spec.limits.lowest, spec.highest, spec.mechanics.start_position)

    def verdict(self, axis: str, result: Any) -> str:
        """Whether every move was in position, or that the recording was replayed."""
        replayed = result.level == "good" and result.job.kind == "replay"
        return f"{result.job.name}: replayed on {axis}." if replayed else super().verdict(axis, result)

    def summary(self, spec: CascadeSpec, result: Any) -> list[tuple[str, str]]:
        """Moves, errors, effort; of a replay, how far simulation and recording are apart."""
        place = "replay_page:replay_summary" if result.job.kind == "replay" else "page:cascade_summary"
        return self.brought(place)(spec, result)

    def page(self, spec: CascadeSpec, result: Any, shown: Shown) -> "Page":
        """The report of moves or of a replay."""
        if result.job.kind == "replay":
            return self.brought("replay_page:replay_page")(spec, result, shown.settings)
        return super().page(spec, result, shown)

    def recording(self, spec: CascadeSpec, log: Any) -> Any:
        """A job that replays a log on this axis."""
        return self.brought("replay:make_replay_job")(spec, log)
