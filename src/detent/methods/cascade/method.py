"""The cascade axis as a method: what its package brings."""

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from detent.axisfile.catalogue import DC_MOTORS
from detent.axisfile.motion import rotary_model
from detent.files.findings import Caution, Derived
from detent.methods.cascade.checks import RULES, find_cautions
from detent.methods.cascade.derive import derive
from detent.methods.cascade.schema import CascadeSpec, fill_derived
from detent.methods.method import Method, Shown, Simulated
from detent.methods.moves.job import MoveJob, one_move

if TYPE_CHECKING:
    from detent.kernel.registers import Registers
    from detent.logs.log import Log
    from detent.methods.cascade.replay_job import ReplayJob
    from detent.page.frame import Comparison, Page
    from detent.record.machine import AnyRecorder, Progress

TIMING = (
    "controller.left", "controller.reference.position", "lines.motor.count", "controller.motor_sensor.velocity",
    "controller.law.position_error", "controller.law.command", "controller.law.limited", "plant.source.output",
    "plant.machine.motor.position", "plant.machine.motor.sense", "plant.machine.load.position",
    "plant.machine.side",
)  # fmt: skip

ROTARY: type[CascadeSpec] = rotary_model(CascadeSpec)


class CascadeMethod(Method[CascadeSpec]):
    """Position over velocity loop, the usual servo of today."""

    name = "cascade"
    title = "cascade: position over velocity loop, linear or rotary, as servo drives have it"
    jobs = "a list of moves (.csv, .toml), or a recording to replay"
    pace = "as its file has it, every sample"
    spec = CascadeSpec
    rotary: type[CascadeSpec] | None = ROTARY
    rules = RULES
    catalogue = DC_MOTORS

    def fill(self, spec: CascadeSpec) -> CascadeSpec:
        """The defaults that depend on another table."""
        return fill_derived(spec)

    def derive(self, spec: CascadeSpec) -> tuple[Derived, ...]:
        """Derived figures."""
        return derive(spec)

    def cautions(self, spec: CascadeSpec) -> Iterable[Caution]:
        """What looks wrong."""
        return find_cautions(spec)

    def registers(self) -> "type[Registers]":
        """State of the axis."""
        from detent.methods.cascade.system import Cascade

        return Cascade

    def parameters(self) -> "type[Registers]":
        """Constants of the axis."""
        from detent.methods.cascade.system import CascadeParams

        return CascadeParams

    def simulated(self, spec: CascadeSpec) -> Simulated:
        """An axis that makes moves or replays a recording."""
        from detent.methods.cascade.build import build_cascade
        from detent.methods.cascade.host import cascade_registers
        from detent.methods.cascade.replay import ReplayRun, run_cascade_replay
        from detent.methods.cascade.replay_job import ReplayJob
        from detent.methods.cascade.run import CASCADE_SIGNALS, CascadeRun, run_cascade_moves
        from detent.methods.moves.move_file import load_moves
        from detent.record.capture import Clocking

        p = build_cascade(spec)

        def run(
            job: MoveJob | ReplayJob, recorder: "AnyRecorder | None" = None, progress: "Progress | None" = None
        ) -> CascadeRun | ReplayRun:
            if isinstance(job, ReplayJob):
                return run_cascade_replay(spec, job, recorder=recorder, progress=progress)
            return run_cascade_moves(spec, job, recorder=recorder, progress=progress)

        # To where there is more room.
        way = 0.02 * spec.limits.travel
        middle = spec.limits.lowest + 0.5 * spec.limits.travel
        return Simulated(
            registers=cascade_registers(spec),
            tick=p.plant.machine.period,
            every=p.controller.sample_ticks,
            signals=CASCADE_SIGNALS,
            timing=TIMING,
            clocking=Clocking(),
            load=lambda path: load_moves(path, rotary=spec.axis.motion == "rotary"),
            job=(MoveJob, ReplayJob),
            run=run,
            sample_job=lambda: one_move("one move", way if spec.mechanics.start_position < middle else -way, 0.05),
        )

    def compare(self, spec: CascadeSpec, progress: "Progress | None" = None) -> "tuple[Comparison, ...]":
        """With and without feed-forward and limited jerk."""
        from detent.methods.cascade.comparison import compare_profiles

        return (compare_profiles(spec, progress=progress),)

    def verdict(self, axis: str, result: Any) -> str:
        """Whether every move was in position, or that the recording was replayed."""
        if not result.done:
            return f"Not done: {result.failure}"
        said = "replayed" if result.job.kind == "replay" else "every move was in position"
        return f"{result.job.name}: {said} on {axis}."

    def summary(self, spec: CascadeSpec, result: Any) -> list[tuple[str, str]]:
        """Moves, errors, effort; of a replay, how far simulation and recording are apart."""
        from detent.methods.cascade.summary import cascade_summary, replay_summary

        return replay_summary(spec, result) if result.job.kind == "replay" else cascade_summary(spec, result)

    def page(self, spec: CascadeSpec, result: Any, shown: Shown) -> "Page":
        """The report of moves or of a replay."""
        from detent.methods.cascade.page import cascade_page
        from detent.methods.cascade.replay_page import replay_page

        if result.job.kind == "replay":
            return replay_page(spec, result, shown.settings)
        return cascade_page(spec, result, shown.trace, shown.comparisons, shown.settings)

    def recording(self, spec: CascadeSpec, log: "Log") -> "ReplayJob":
        """A job that replays a log on this axis."""
        from detent.methods.cascade.replay_job import make_replay_job

        signals = {role: (values, log.units[role]) for role, values in log.signals.items()}
        notes = [str(finding) for finding in log.findings]
        notes += [f"guessed: {'; '.join(log.guesses)}"] if log.guesses else []
        return make_replay_job(spec, log.name, log.t, signals, notes)
