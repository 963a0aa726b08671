"""A method whose jobs are lists of moves: its run, summary and report, from a host and a view."""

from typing import TYPE_CHECKING, Any, ClassVar, Protocol, TypeVar

from detent.axisfile.tables import AxisSpec
from detent.methods.method import Method, Shown, Simulated
from detent.methods.moves.job import MoveJob, one_move

if TYPE_CHECKING:
    from detent.methods.moves.host import Host
    from detent.methods.moves.page import MoveView
    from detent.methods.moves.run import MoveRun
    from detent.page.frame import Page
    from detent.record.capture import Clocking
    from detent.record.machine import AnyRecorder, Progress

SpecT = TypeVar("SpecT", bound=AxisSpec)


class MoveMethod(Method[SpecT], Protocol[SpecT]):
    """A control method that makes lists of moves."""

    jobs = "a list of moves (.csv, .toml)"
    every: ClassVar[int]
    """Ticks between two rows of a trace."""
    signals: ClassVar[tuple[str, ...]]
    """Registers that a run records unless told otherwise."""
    timing: ClassVar[tuple[str, ...]]
    """The same for a timing diagram."""
    commands: ClassVar[str]
    """Where its package has the host: "host:Name", made of a specification and a recorder."""
    shows: ClassVar[str]
    """Where it has the view of a run: "page:Name", made of a specification."""

    def tick(self, spec: SpecT) -> float:
        """Base tick [s]."""
        ...

    def host(self, spec: SpecT, recorder: "AnyRecorder | None") -> "Host":
        """The simulated axis at power-on, and what commands it."""
        return self.brought(self.commands)(spec, recorder)

    def view(self, spec: SpecT) -> "MoveView":
        """What the method shows of itself on the page of a run."""
        return self.brought(self.shows)(spec)

    def sample_move(self, spec: SpecT) -> MoveJob:
        """A short job for looking at signals: a hundredth of the travel, from where the axis stands."""
        return one_move("one short move", 0.01 * getattr(spec, "limits").travel, 0.05)  # noqa: B009

    def seed(self, spec: SpecT) -> int:
        """What the noise of the axis starts from."""
        del spec
        return 0

    def clocking(self) -> "Clocking":
        """How registers change inside a tick."""
        from detent.record.capture import Clocking

        return Clocking()

    def simulated(self, spec: SpecT) -> Simulated:
        """The axis, making moves."""
        from detent.methods.moves.move_file import load_moves
        from detent.methods.moves.run import run_moves

        def run(job: MoveJob, recorder: "AnyRecorder | None" = None, progress: "Progress | None" = None) -> "MoveRun":
            return run_moves(self.host(spec, recorder), job, progress=progress)

        return Simulated(
            registers=self.registers(),
            tick=self.tick(spec),
            every=self.every,
            seed=self.seed(spec),
            signals=self.signals,
            timing=self.timing,
            clocking=self.clocking(),
            load=load_moves,
            job=MoveJob,
            run=run,
            sample_job=lambda: self.sample_move(spec),
        )

    def summary(self, spec: SpecT, result: Any) -> list[tuple[str, str]]:
        """Moves, times, worst errors."""
        from detent.methods.moves.summary import move_summary

        return move_summary(result, self.view(spec).unit)

    def page(self, spec: SpecT, result: Any, shown: Shown) -> "Page":
        """The report."""
        from detent.methods.moves.page import moves_page

        return moves_page(self.view(spec), result, shown.trace, shown.comparisons, shown.settings)
