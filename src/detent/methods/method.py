"""The contract: everything a control method brings, so that nothing outside its package needs to know which it is.

A method is a class derived from `Method`, found by the entry point of its name in the group ``detent.methods``. What it
leaves out has the default that stands here. Importing its module must load neither compiled blocks nor pictures: they
are imported inside the functions that need them, so that `detent check` stays quick.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Protocol, Self, TypeVar

from detent.axisfile.catalogue import Catalogue
from detent.axisfile.tables import AxisSpec
from detent.files.findings import Caution, Contradiction, Derived

if TYPE_CHECKING:
    from detent.kernel.registers import Registers
    from detent.page.frame import Comparison, Page
    from detent.record.capture import Clocking
    from detent.record.machine import Progress
    from detent.record.trace import Trace

SpecT = TypeVar("SpecT", bound=AxisSpec)


class Job(Protocol):
    """What an axis is asked to do; a job may also have `notes`, told with the run."""

    @property
    def name(self) -> str:
        """Name of the file it came from, or of what it is."""
        ...


class Result(Protocol):
    """What an axis did with a job."""

    @property
    def job(self) -> Any:
        """The job."""
        ...

    @property
    def done(self) -> bool:
        """True when the axis did the whole job."""
        ...

    @property
    def failure(self) -> str:
        """Why it did not, and what to do; empty otherwise."""
        ...

    @property
    def warnings(self) -> Sequence[str]:
        """What looks wrong about the run."""
        ...

    def to_dict(self) -> dict[str, Any]:
        """Plain data, as ``--json`` prints it."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Simulated:
    """An axis as the simulation takes it."""

    registers: "type[Registers]"  # class of the state
    tick: float  # base tick [s]
    every: int  # ticks between two rows of a trace unless told otherwise
    seed: int = 0  # what its noise starts from
    signals: tuple[str, ...]  # registers that a run records unless told otherwise
    timing: tuple[str, ...]  # the same for a timing diagram
    clocking: "Clocking"  # how registers change inside a tick
    load: Callable[[Path], Any]  # reads a job file of the kind the method takes
    job: type | tuple[type, ...]  # class of the jobs it takes; the first is that of the files that `load` reads
    run: Callable[..., Any]  # ``run(job, recorder=, progress=)`` makes a job
    sample_job: Callable[[], Any]  # a short job for looking at signals


@dataclass(frozen=True, slots=True, kw_only=True)
class Shown:
    """What a report shows beside the result of a run."""

    trace: "Trace | None" = None  # what was recorded; figures that lack their signals are left out
    comparisons: Sequence[Any] = ()  # as `Method.compare` gives them
    settings: dict[str, str] = field(default_factory=dict[str, str])  # small print: file, seed, command


class Method(Protocol[SpecT]):
    """A control method."""

    name: ClassVar[str]
    """What ``axis.method`` says."""
    title: ClassVar[str]
    """A few words for people."""
    jobs: ClassVar[str]
    """What it takes as a job, for help texts."""
    pace: ClassVar[str]
    """Its base tick and how many lie between two rows of a trace, for help texts."""
    spec: type[SpecT]
    """Model of the whole file."""
    rotary: type[SpecT] | None = None
    """The model where ``axis.motion = "rotary"``; None where the method has no such key."""
    rules: Sequence[Callable[[SpecT], Iterable[Contradiction]]] = ()
    """What must hold between keys; each gives the contradictions it finds."""
    catalogue: Catalogue | None = None
    """Motors that ``motor.catalogue`` may name."""
    state: ClassVar[str]
    """Where its package has the class of the axis's state, or of a part of which it has several: "system:Name"."""
    params: ClassVar[str]
    """The same of what does not change while it runs."""
    reports_comparisons: bool = True
    """Whether the report of a run shows the comparisons unless told otherwise."""

    # ---- the axis file

    def turned(self) -> Self:
        """The same method with the model of an axis that turns."""
        made = copy(self)
        made.spec = self.rotary or self.spec
        return made

    def fill(self, spec: SpecT) -> SpecT:
        """The specification with the defaults that depend on another table."""
        return spec

    def derive(self, spec: SpecT) -> tuple[Derived, ...]:
        """Derived figures, in the order they are read."""
        del spec
        return ()

    def cautions(self, spec: SpecT) -> Iterable[Caution]:
        """What looks wrong with an axis that can be built."""
        del spec
        return ()

    # ---- the simulated axis

    def registers(self) -> "type[Registers]":
        """Class of the axis's state, or of a part of which it has several."""
        return self.brought(self.state)

    def parameters(self) -> "type[Registers]":
        """Class of what does not change while it runs."""
        return self.brought(self.params)

    def brought(self, place: str) -> Any:
        """What stands at ``module:name`` of the method's package; it loads only here."""
        module, _, name = place.partition(":")
        return getattr(import_module(f"{type(self).__module__.rpartition('.')[0]}.{module}"), name)

    def simulated(self, spec: SpecT) -> Simulated:
        """The axis as the simulation takes it."""
        ...

    def compare(self, spec: SpecT, progress: "Progress | None" = None) -> "tuple[Comparison, ...]":
        """The method beside its alternatives on this axis; none by default."""
        del spec, progress
        return ()

    # ---- what people see

    def verdict(self, axis: str, result: Any) -> str:
        """Whether the job was done on the axis of that name, in a sentence."""
        done = f"{result.job.name}: every move arrived on {axis}."
        return done if result.done else f"Not done: {result.failure}"

    def summary(self, spec: SpecT, result: Any) -> list[tuple[str, str]]:
        """The figures of a run that a person wants first."""
        ...

    def page(self, spec: SpecT, result: Any, shown: Shown) -> "Page":
        """The report of a run."""
        ...

    # ---- what only some methods bring; the registry tells which (`registry.bringing`)

    def recording(self, spec: SpecT, log: Any) -> Any:
        """A job that replays a recording of a machine, of an axis whose loops follow any reference."""
        ...

    def envelopes(self, spec: SpecT) -> Mapping[str, Any]:
        """Tables of permissible frequencies that firmware takes, by motor."""
        ...
