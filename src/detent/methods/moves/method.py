"""A method whose jobs are lists of moves: its run, summary and report, from a host and a view."""

from typing import TYPE_CHECKING, Any, ClassVar, Protocol, TypeVar

from detent.axisfile.tables import AxisSpec
from detent.methods.method import Method, Shown
from detent.methods.moves.job import MoveJob, half_and_back, one_move

if TYPE_CHECKING:
    from detent.methods.moves.page import MoveView
    from detent.methods.moves.run import MoveRun
    from detent.page.frame import Page
    from detent.record.machine import AnyRecorder, Progress

SpecT = TypeVar("SpecT", bound=AxisSpec)


class MoveMethod(Method[SpecT], Protocol[SpecT]):
    """A control method that makes lists of moves."""

    jobs = "a list of moves (.csv, .toml)"
    takes, reads = "detent.methods.moves.job:MoveJob", "detent.methods.moves.job:load_moves"
    commands: ClassVar[str]  # place of the host, made of a specification and a recorder
    shows: ClassVar[str]  # place of the view of a run, made of a specification

    def view(self, spec: SpecT) -> "MoveView":
        """What the method shows of itself on the page of a run."""
        return self.brought(self.shows)(spec)

    def sample_job(self, spec: SpecT) -> MoveJob:
        """A hundredth of the travel, from where the axis stands."""
        return one_move("one short move", 0.01 * getattr(spec, "limits").travel, 0.05)  # noqa: B009

    def trial_job(self, spec: SpecT) -> MoveJob:
        """Half of the travel and back."""
        whole: Any = spec
        return half_and_back(0.0, whole.limits.travel, whole.mechanics.start_position)

    def run(
        self, spec: SpecT, job: MoveJob, recorder: "AnyRecorder | None" = None, progress: "Progress | None" = None
    ) -> "MoveRun":
        """Make the moves, from power-on."""
        from detent.methods.moves.run import run_moves

        return run_moves(self.brought(self.commands)(spec, recorder), job, progress=progress)

    def summary(self, spec: SpecT, result: Any) -> list[tuple[str, str]]:
        """Moves, times, worst errors."""
        from detent.methods.moves.summary import move_summary

        return move_summary(result, self.view(spec).unit)

    def page(self, spec: SpecT, result: Any, shown: Shown) -> "Page":
        """The report."""
        from detent.methods.moves.page import moves_page

        return moves_page(self.view(spec), result, shown.trace, shown.comparisons, shown.settings)
