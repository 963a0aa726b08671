"""The contract: everything a control method brings, so that nothing outside its package needs to know which it is.

A method is a class derived from `Method`, found by the entry point of its name in the group ``detent.methods``. What it
leaves out has the default that stands here. Importing its module must load neither compiled blocks nor pictures, so
that `detent check` stays quick: a method says where its package has them.
"""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field
from functools import cached_property, partial
from importlib import import_module
from operator import attrgetter
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, Protocol, Self, TypeVar

from detent.axisfile.catalogue import Catalogue
from detent.axisfile.tables import AxisSpec
from detent.errors import DetentError
from detent.files.fields import leaf_fields
from detent.files.findings import Caution, Contradiction, Derived
from detent.files.locate import Path

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from detent.kernel.registers import Registers
    from detent.methods.batch import Batch
    from detent.methods.linear import LinearModel
    from detent.methods.position import PositionSensor
    from detent.methods.tuning import Ensemble, Search, Tuning
    from detent.page.frame import Comparison, Page
    from detent.plant.injection import Place
    from detent.record.capture import Clocking
    from detent.record.machine import AnyRecorder, Progress
    from detent.record.run import Level
    from detent.record.trace import Trace

SpecT = TypeVar("SpecT", bound=AxisSpec)
T = TypeVar("T")


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

    @property
    def level(self) -> "Level":
        """Of its verdict: not done is bad, done with warnings is warn."""
        ...

    @property
    def doubt(self) -> str:
        """What happened, of the first warning."""
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
    load: Callable[[FilePath], Any]  # reads a job file of the kind the method takes
    job: type | tuple[type, ...]  # class of the jobs it takes; the first is that of the files that `load` reads
    run: Callable[..., Any]  # ``run(job, recorder=, progress=)`` makes a job
    sample_job: Callable[[], Any]  # a short job for looking at signals


@dataclass(frozen=True, slots=True)
class Live:
    """An axis at power-on as the live loop takes it."""

    params: "Registers"  # of controller and plant
    state: "Registers"  # controller, lines and plant
    live: "Registers"  # how it is operated: `operation`, `look_ticks`, and what the method needs
    memory: "Registers"  # what the method remembers between two looks
    tick: float  # base tick [s]
    unit: str = "m"  # of positions
    speed: float = math.nan  # largest that may be commanded [m/s] or [rad/s]
    acceleration: float = math.nan  # with which it comes to speed [m/s^2] or [rad/s^2]
    view: Mapping[str, Any] = field(default_factory=dict[str, Any])
    """What its own view on the panel shows (`panel.js` of its package): "title", and "data" that does not change."""
    feed: tuple[Any, ...] = ()  # what the host lays ready
    fault: Callable[[], str] = str  # the fault of its guard in a sentence, empty where there is none
    tray: "NDArray[np.uint8] | None" = None
    """Places for pieces of a job in what the loop shares, a row each; None where it does no jobs."""
    numbers: frozenset[int] | None = None  # of positions that the method itself knows; None where it knows none
    work: "Callable[[Any], Work] | None" = None  # a job as pieces for the tray
    legs: "Callable[[Any], Sequence[Leg]] | None" = None
    """A job as moves that the operation makes one after another, where the method does jobs in no way of its own."""
    text: Callable[[str], Any] | None = None  # a text as a job, where it prints
    places: "Mapping[str, Place]" = field(default_factory=dict[str, Any])
    """Where faults can be injected; nowhere where the machine is none that is simulated."""
    limits: Mapping[int, float] = field(default_factory=dict[int, float])
    """What its guard compares with, by the number of the fault, in the unit of what is compared."""
    fault_numbers: Mapping[int, int] = field(default_factory=dict[int, int])
    """Number in the table of faults of those that the method numbers by itself."""


@dataclass(frozen=True, slots=True)
class Plant:
    """An amplifier and what it moves, at rest: the other end of the lines."""

    params: "Registers"
    state: "Registers"  # lines and plant
    sample: Callable[[], None]  # let the time between two samples pass, with the lines as they are at its beginning


@dataclass(frozen=True, slots=True, kw_only=True)
class Wiring:
    """The lines of one motor as its drive has them; lines by their paths."""

    lines: "type[Registers]"
    enable: str  # 1 lets the drive act
    position: str  # takes the counts of its encoder
    demand: str  # what is demanded of it
    count: float  # travel per count [m]
    turn: float  # counts in a turn of the motor
    torque: float  # of the motor per demand [N*m]
    largest: float  # magnitude of the demand
    sample: float  # time between two exchanges [s]
    hardware: str  # what the axis file says that the drive says of itself; empty where it says nothing
    mode: str = "torque"  # what is demanded: a torque, a "velocity" [m/s] or a "position" [m]
    zero: str = ""  # of a position demand: the position of count 0 [m]
    effort: str = ""  # takes what the loops of the drive give, where `torque` says how much that is; none where not
    samples: str = ""  # takes the number of samples that were heard of; none where nobody asks
    turn_key: str = "encoder.resolution or mechanics.travel_per_revolution"  # what in the axis file says that turn
    firmware: bytes = b""  # parameters of the controller, where the other end may run it


@dataclass(frozen=True, slots=True, kw_only=True)
class Board:
    """How its controller on a board is led over a serial line: a part of the export."""

    lines: "type[Registers]"  # what goes to and fro
    code: str  # of the board, a template in its package
    places: Mapping[str, str]  # in that code, of the lines that are none of the controller
    values: Callable[[Any], Mapping[str, float]]  # ``values(spec)``: constants of that code


class Leg(NamedTuple):
    """A move of a job: its kind (`control.operation`), 0 for a rest alone; to where, by what way, at what velocity."""

    kind: int
    value: float = 0.0
    speed: float | None = None  # largest [m/s] or [rad/s]; None for the axis's own
    seconds: float = 0.0  # of rest after it; of a jog, how long it lasts


class Work(Protocol):
    """A job done live: the host lays piece after piece ready, and the loop takes them."""

    @property
    def name(self) -> str:
        """What it is called."""
        ...

    @property
    def pieces(self) -> int:
        """How many it has."""
        ...

    @property
    def done(self) -> int:
        """How many of them have ended."""
        ...

    @property
    def shown(self) -> Mapping[str, Any]:
        """What the method's view on the panel shows of the piece under way; plain data."""
        ...

    def piece(self) -> bytes | None:
        """The next piece as a row of the tray; None where none is left, or none may be laid yet."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Shown:
    """What a report shows beside the result of a run."""

    trace: "Trace | None" = None  # what was recorded; figures that lack their signals are left out
    comparisons: Sequence[Any] = ()  # as `Method.compare` gives them
    settings: dict[str, str] = field(default_factory=dict[str, str])  # small print: file, seed, command


def untold(share: float, text: str) -> None:
    """The progress of what nobody watches."""


class Method(Protocol[SpecT]):
    """A control method: a declaration, and what it does in a way of its own.

    A declaration "module:name" is a place in the method's package, or a whole ``package.module:name`` elsewhere; what
    stands there loads when it is first needed.
    """

    name: ClassVar[str]  # what ``axis.method`` says
    title: ClassVar[str]  # a few words for people
    jobs: ClassVar[str]  # what it takes as a job, for help texts
    pace: ClassVar[str]  # its base tick and how many lie between two rows of a trace, for help texts
    spec: type[SpecT]  # model of the whole file
    rotary: type[SpecT] | None = None
    """The model where every key ``motion`` is "rotary"; None where the method has no such key."""
    turning: frozenset[Path] = frozenset()
    """Which of these keys say so in the file at hand."""
    catalogue: Catalogue | None = None  # motors that ``motor.catalogue`` may name

    fills: ClassVar[str] = ""  # place of what gives a specification the defaults that depend on another table
    refuses: ClassVar[str] = ""  # place of the `rules`: what must hold between keys
    derives: ClassVar[str] = ""  # place of the derived figures of a specification
    warns: ClassVar[str] = ""  # place of the cautions: what looks wrong with an axis that can be built

    state: ClassVar[str]  # place of the class of the axis's state, or of a part of which it has several
    params: ClassVar[str]  # the same of what does not change while it runs
    clock: ClassVar[str] = "system:TICK"  # place of its base tick [s]
    every: ClassVar[int] = 1  # ticks between two rows of a trace unless told otherwise
    seed: ClassVar[str] = ""  # key of the file that its noise starts from
    signals: ClassVar[str | tuple[str, ...]] = ()
    """Registers that a run records unless told otherwise, or the place of their names."""
    timing: ClassVar[tuple[str, ...]] = ()  # the same for a timing diagram
    takes: ClassVar[str]  # place of the class of its jobs
    reads: ClassVar[str]  # place of what reads a job file
    runs: ClassVar[str]  # place of what makes a job: ``run(spec, job, recorder=, progress=)``
    senses: ClassVar[str] = ""
    """Place of what counts its position: ``senses(spec)``, by the name of the motor; of a single one by ""."""
    begins: ClassVar[str] = "mechanics.start_position"
    """Key of the place where a simulated axis stands at power-on; of a motor by its name in the place of a ``*``."""
    lives: ClassVar[str] = ""
    """Place of what makes it live: ``live(spec, operation)`` gives a `Live` by the name of each motor, by "" where
    there is one only; none where it has no operator."""
    wires: ClassVar[str] = ""
    """Place of what lets its controller run on a drive: ``wired(spec, operation, mode)`` gives a `Live` without a plant
    and its `Wiring`, by the name of each motor; the mode is what the drive is told, as in `Wiring`."""
    machines: ClassVar[str] = ""
    """Place of the other half, the drive's amplifier and what it moves: ``machine(spec, mode)`` gives a `Plant` and
    the same `Wiring`, by the name of each motor."""
    actions: ClassVar[tuple[str, ...]] = ()
    """Steps of its `controller` that firmware has beside a tick of it, the first puts it on; none where it has none."""
    interrupts: ClassVar[tuple[str, ...]] = ()
    """Steps of its `controller` that a tick of it calls, and that an interrupt of firmware may call in its place."""
    fits: ClassVar[str] = ""
    """Place of how much of its arrays such a controller uses: ``fit(params)`` gives a `registers.Fit`; without one it
    uses all of them."""
    boards: ClassVar[str] = ""
    """Place of how that firmware is led over a serial line, a `Board`; none where it is not."""
    linear_loops: ClassVar[str] = ""
    """Place of its loops as linear systems, by where they are cut open: ``loops(spec)``; none where none is linear."""
    leaves_out: ClassVar[tuple[str, ...]] = ()  # what these do not know, in sentences
    tunes: ClassVar[str] = ""
    """Place of what chooses its gains: ``tuning(spec)`` gives a `tuning.Tuning`; none where it has no gains."""
    searches: ClassVar[str] = ""
    """Place of what chooses values by simulation alone, where no linear model does: ``search(spec)`` gives a
    `tuning.Search`."""
    stands: ClassVar[str] = ""
    """Place of what watches it at standstill: ``ensemble(spec)`` gives a `tuning.Ensemble`; none where no loop does."""
    checks_standstill: ClassVar[bool] = False
    """Whether `check` watches it there as well: eight of its starts then take less than half a second."""
    rests: ClassVar[str] = ""  # what holds it at rest where no loop does, as the end of a sentence
    keeps: ClassVar[str] = ""
    """Place of what its controller keeps where the machine is another than that of its file: ``kept(spec)`` gives
    values by dotted key."""
    batches: ClassVar[str] = ""
    """Place of what makes a job on many machines of one file at once: ``Batch(spec, job)`` is a `batch.Batch`; without
    it each is run for itself."""
    compares: ClassVar[tuple[str, ...]] = ()
    """Places of what holds it beside its alternatives: ``compare(spec, progress=)``."""

    sums_up: ClassVar[str]  # place of what gives the first figures of a run: ``rows(spec, result)``
    reports: ClassVar[str]  # place of the report of a run: ``page(spec, result, trace, comparisons, settings)``
    says: ClassVar[tuple[str, str]] = ("{job}: every move arrived on {axis}.", "Not done: {failure}")
    """Whether the job was done, in a sentence: when it was, and when it was not."""
    doubts: ClassVar[str] = "{job}: done on {axis}, but {doubt}."  # the same when something looks wrong about it
    reports_comparisons: bool = True  # whether the report of a run shows the comparisons unless told otherwise

    def brought(self, place: str) -> Any:
        """What stands at a place; it loads only here."""
        module, _, name = place.partition(":")
        package = "" if "." in module else type(self).__module__.rpartition(".")[0] + "."
        return getattr(import_module(package + module), name)

    # ---- the axis file

    @property
    def motion_key(self) -> Path:
        """The key that says whether the axis slides or turns, of each motor where it is theirs; empty without one."""
        paths = [path for path, _ in leaf_fields(self.spec) if path[-1] == "motion"]
        return paths[0] if paths else ()

    def model_of(self, turning: frozenset[Path]) -> type[SpecT]:
        """The model of a file in which these keys say that something turns."""
        return self.rotary if turning and self.rotary else self.spec

    def turned(self, turning: frozenset[Path]) -> Self:
        """The same method with the model of a file in which these keys say that something turns."""
        made = copy(self)
        made.spec, made.turning = self.model_of(turning), turning
        return made

    @cached_property
    def rules(self) -> Sequence[Callable[[SpecT], Iterable[Contradiction]]]:
        """What must hold between keys; each gives the contradictions it finds."""
        return self.brought(self.refuses) if self.refuses else ()

    def fill(self, spec: SpecT) -> SpecT:
        """The specification with the defaults that depend on another table."""
        return self.brought(self.fills)(spec) if self.fills else spec

    def derive(self, spec: SpecT) -> tuple[Derived, ...]:
        """Derived figures, in the order they are read."""
        return tuple(self.brought(self.derives)(spec)) if self.derives else ()

    def cautions(self, spec: SpecT) -> Iterable[Caution]:
        """What looks wrong with an axis that can be built."""
        return self.brought(self.warns)(spec) if self.warns else ()

    # ---- the simulated axis

    def registers(self) -> "type[Registers]":
        """Class of the axis's state, or of a part of which it has several."""
        return self.brought(self.state)

    def parameters(self) -> "type[Registers]":
        """Class of what does not change while it runs."""
        return self.brought(self.params)

    def arithmetic(self, spec: SpecT) -> str:
        """What its controller computes in: "double", or "single" (`kernel.registers.single`)."""
        del spec
        return "double"

    def tick(self, spec: SpecT) -> float:
        """Base tick [s]."""
        del spec
        return self.brought(self.clock)

    def clocking(self, spec: SpecT) -> "Clocking":
        """How registers change inside a tick."""
        from detent.record.capture import Clocking

        del spec
        return Clocking()

    def load(self, spec: SpecT, path: FilePath) -> Any:
        """Read a job file."""
        del spec
        return self.brought(self.reads)(path)

    def run(
        self, spec: SpecT, job: Any, recorder: "AnyRecorder | None" = None, progress: "Progress | None" = None
    ) -> Any:
        """Make a job, from power-on."""
        return self.brought(self.runs)(spec, job, recorder=recorder, progress=progress)

    def sample_job(self, spec: SpecT) -> Any:
        """A short job for looking at signals."""
        ...

    def trial_job(self, spec: SpecT) -> Any:
        """The job that gains are tried with unless told otherwise."""
        return self.sample_job(spec)

    def simulated(self, spec: SpecT) -> Simulated:
        """The axis as the simulation takes it."""
        return Simulated(
            registers=self.registers(),
            tick=self.tick(spec),
            every=self.every,
            seed=attrgetter(self.seed)(spec) if self.seed else 0,
            signals=self.brought(self.signals) if isinstance(self.signals, str) else self.signals,
            timing=self.timing,
            clocking=self.clocking(spec),
            load=partial(self.load, spec),
            job=self.brought(self.takes),
            run=partial(self.run, spec),
            sample_job=partial(self.sample_job, spec),
        )

    def live(self, spec: SpecT, operation: Callable[..., Any], motor: str = "") -> Live:
        """One motor at power-on, to be operated; by its name where the file has several."""
        return self._of_motor(self.brought(self.lives)(spec, operation), spec, motor)

    def wired(
        self, spec: SpecT, operation: Callable[..., Any], motor: str = "", mode: str = "torque"
    ) -> "tuple[Live, Wiring]":
        """The controller of one motor alone, to be operated on a drive."""
        return self._of_motor(self._half(self.wires, spec)(spec, operation, mode), spec, motor)

    def machine(self, spec: SpecT, motor: str = "", mode: str = "torque") -> "tuple[Plant, Wiring]":
        """What stands at the other end of its lines: amplifier and mechanics of the file."""
        return self._of_motor(self._half(self.machines, spec)(spec, mode), spec, motor)

    def _half(self, place: str, spec: SpecT) -> Callable[..., Any]:
        if not place:
            raise DetentError(
                f"{spec.axis.name}: got an axis of the method {self.name} and a drive; expected: a method whose lines "
                "a drive has; run it live without --drive"
            )
        return self.brought(place)

    def motor(self, spec: SpecT, motor: str) -> str:
        """The name of a motor of the file, which is needed where it has several; empty where it has one without."""
        return self._of_motor({name: name for name in self.sensors(spec)}, spec, motor)

    def _of_motor(self, motors: Mapping[str, T], spec: SpecT, motor: str) -> T:
        """What belongs to a motor; its name is needed where the file has several."""
        if not motor and len(motors) == 1:
            return next(iter(motors.values()))
        if motor not in motors:
            names = ", ".join(motors)
            got = f"the motor {motor}" if motor else "no motor"
            allowed = f"one of {names}" if names else "none, for it has one motor only"
            raise DetentError(f"{spec.axis.name}: got {got}; expected: {allowed}; try: name one of them")
        return motors[motor]

    def linear(self, spec: SpecT) -> "LinearModel":
        """Its linear model; refused where its loop is not a linear one."""
        from detent.methods.linear import LinearModel

        if not self.linear_loops:
            raise DetentError(
                f"{spec.axis.name}: got an axis of the method {self.name}, whose law is no linear loop; "
                "look at its steps with run and compare"
            )
        return LinearModel(spec.axis.name, self.brought(self.linear_loops)(spec), self.leaves_out)

    def tuning(self, spec: SpecT) -> "Tuning":
        """What chooses its gains; refused where it has none."""
        if not self.tunes:
            raise DetentError(
                f"{spec.axis.name}: got an axis of the method {self.name}, whose gains no linear model chooses; "
                f"expected: a method with one; try: compare settings of this one with `detent run --set KEY=VALUE`"
            )
        return self.brought(self.tunes)(spec)

    def search(self, spec: SpecT) -> "Search":
        """What chooses its values by simulation; of a method that has `searches`."""
        return self.brought(self.searches)(spec)

    def standstill(self, spec: SpecT) -> "Ensemble":
        """What watches it at standstill; refused where no loop holds it there."""
        if not self.stands:
            raise DetentError(
                f"{spec.axis.name}: got an axis of the method {self.name}, which closes no loop at rest"
                f"{self.rests and f': {self.rests}'}; expected: a method that holds its place by a loop, which may "
                "hunt; try: see how moves end with `detent run`"
            )
        return self.brought(self.stands)(spec)

    def kept(self, spec: SpecT) -> dict[str, Any]:
        """What its controller keeps where the machine is another than that of its file, by key; nothing by default."""
        return self.brought(self.keeps)(spec) if self.keeps else {}

    def batch(self, spec: SpecT, job: Any) -> "Batch | None":
        """What makes a job on many machines of one file at once; None where each is run for itself."""
        return self.brought(self.batches)(spec, job) if self.batches else None

    def sensors(self, spec: SpecT) -> "Mapping[str, PositionSensor]":
        """What counts the position of each of its motors; of a single one by the name ""."""
        if not self.senses:
            raise DetentError(
                f"{spec.axis.name}: got an axis of the method {self.name}, which does not say what counts its "
                "position; expected: a method with `senses`; add it to the class of the method"
            )
        return self.brought(self.senses)(spec)

    def sensor(self, spec: SpecT, motor: str = "") -> "PositionSensor | None":
        """What counts the position of one motor, or of the only one; None where the method does not say."""
        if not self.senses:
            return None
        motors = self.sensors(spec)
        return next(iter(motors.values())) if len(motors) == 1 else motors.get(motor)

    def compare(self, spec: SpecT, progress: "Progress | None" = None) -> "tuple[Comparison, ...]":
        """The method beside its alternatives on this axis; none by default."""
        return tuple(self.brought(place)(spec, progress=progress or untold) for place in self.compares)

    # ---- what people see

    def verdict(self, axis: str, result: Any) -> str:
        """Whether the job was done on the axis of that name, in a sentence."""
        done, failed = self.says
        said = {"good": done, "warn": self.doubts, "bad": failed}[result.level]
        return said.format(job=result.job.name, axis=axis, failure=result.failure, doubt=result.doubt)

    def summary(self, spec: SpecT, result: Any) -> list[tuple[str, str]]:
        """The figures of a run that a person wants first."""
        return self.brought(self.sums_up)(spec, result)

    def page(self, spec: SpecT, result: Any, shown: Shown) -> "Page":
        """The report of a run."""
        return self.brought(self.reports)(spec, result, shown.trace, shown.comparisons, shown.settings)

    # ---- what only some methods bring; the registry tells which (`registry.bringing`)

    def recording(self, spec: SpecT, log: Any) -> Any:
        """A job that replays a recording of a machine, of an axis whose loops follow any reference."""
        ...

    def envelopes(self, spec: SpecT) -> Mapping[str, Any]:
        """Tables of permissible frequencies that firmware takes, by motor."""
        ...
