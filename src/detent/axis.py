"""The Python API: an axis, loaded from its file, and the runs it makes. The words are those of the command line."""

import json
from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from datetime import datetime
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from detent import __version__
from detent.axisfile.tables import AxisSpec
from detent.errors import DetentError
from detent.files.screen import Block, OnScreen, Screen
from detent.files.source import given_as
from detent.files.text import shown
from detent.methods.check import CheckReport, check_spec
from detent.methods.load import AxisFile, axis_of_tables, read_axis
from detent.methods.method import Job, Method, Simulated
from detent.methods.registry import METHODS, bringing
from detent.page.frame import Comparison
from detent.record.capture import capture
from detent.record.evidence import ELEMENT, Kept, RunEvidence, hash_figures, now
from detent.record.machine import Progress
from detent.record.recorder import Recorder, choose_leaves
from detent.record.trace_files import TraceWriter
from detent.runs import Run, Timing
from detent.tune.checked import check_axis

if TYPE_CHECKING:
    from detent.methods.linear import LinearModel
    from detent.tune.hunted import Hunted
    from detent.tune.searched import Searched
    from detent.tune.tolerated import Tolerated
    from detent.tune.tuned import Tuned

KEPT_ROWS = 100_000  # rows in memory beside a trace file, 40 s at the usual rate: the report draws from these


@dataclass(frozen=True, repr=False)
class Axis(OnScreen):
    """An axis as its file describes it: `file` is the specification with the origin of every value."""

    file: AxisFile

    @property
    def spec(self) -> AxisSpec:
        """The specification, in SI units."""
        return self.file.spec

    @property
    def name(self) -> str:
        """Name of the axis."""
        return self.spec.axis.name

    @property
    def method(self) -> Method[Any]:
        """Its control method."""
        return METHODS[self.spec.axis.method]

    @cached_property
    def simulated(self) -> Simulated:
        """What the simulation takes of it: registers, base tick, usual signals."""
        return self.method.simulated(self.spec)

    def screen(self) -> Screen:
        """Its method, and what its file states."""
        stated = [(key, self.file.texts[key], origin) for key, origin in self.file.origins.items()]
        blocks = [Block("", ("key", "value", "origin"), stated, 28, ".check().rows has every effective value")]
        title = f"{self.name}, an axis of the method {self.method.title}\n{self.file.file}"
        return Screen(title, blocks, ".check()  .run(job)  .replace({KEY: value})  .linear()  .compare()")

    def replace(self, changes: Mapping[str, Any] | None = None, /, **tables: Any) -> "Axis":
        """Make the same axis with other values.

        Parameters
        ----------
        changes : mapping, optional
            By dotted key, ``{"limits.speed": 0.5}``, or by table, ``{"limits": {"speed": "500 mm/s"}}``: a number of a
            key with a dimension is in its SI unit, as in `spec`; text has a unit, as in a file; None takes a value
            back to its default. Keys that are not named keep their values.
        **tables
            The same by the name of a table: ``limits={"speed": 0.5}``.

        Returns
        -------
        Axis
            A new one, checked as a whole; what follows from the values, such as a catalogue motor's constants, follows
            from the new ones.

        Raises
        ------
        InputError
            Everything that is wrong with the new values.
        """
        return Axis(self.file.replaced({**(changes or {}), **tables}))

    def check(self) -> CheckReport:
        """Effective values, derived figures and warnings; of a cascade also what it does at standstill."""
        return check_axis(self.file)

    def check_signals(self, names: Sequence[str]) -> None:
        """Refuse names and patterns that are no register of the axis, before any work is done, and name the nearest."""
        choose_leaves(self.simulated.registers, names)

    def load_job(self, path: str | Path) -> Job:
        """Read a job of the kind the axis takes, as ``detent run --help`` lists it, or tell all that is wrong."""
        return self.simulated.load(Path(path))

    def _job(self, job: str | Path | Job) -> Job:
        """The job itself, read if it is a file; refused if the method takes none of its kind."""
        wanted = self.simulated.job
        loaded = self.load_job(job) if isinstance(job, str | Path) else job
        if not isinstance(loaded, wanted):
            names = " or ".join(kind.__name__ for kind in (wanted if isinstance(wanted, tuple) else (wanted,)))
            raise DetentError(
                f"{self.name}: got a {type(loaded).__name__}; expected: a {names}, or a file as load_job "
                "reads it; give the axis a job of its own kind"
            )
        return loaded

    def load_recording(self, path: str | Path, mapping: str | Path | None = None, columns: Sequence[str] = ()) -> Any:
        """Read a recording of a machine, to be replayed on this axis by `run`.

        Parameters
        ----------
        path : path
            CSV, HDF5, Parquet, MATLAB, NPZ or JSON.
        mapping : path, optional
            Mapping file (TOML): what its columns are; what neither it nor `columns` says is guessed.
        columns : sequence of str
            The same in short: ``"force=vir [35.15 N]"``.

        Returns
        -------
        ReplayJob
            Its `notes` tell what was found wrong with the log, and what was guessed.

        Raises
        ------
        InputError
            The log or the mapping cannot be read, or says something wrong.
        DetentError
            The axis is of a method that replays nothing, or the log does not fit it.
        """
        from detent.logs.read_log import read_log

        replay = self._brought("recording", "whose loops follow any reference")
        return replay(self.spec, read_log(path, mapping, columns))

    def _brought(self, word: str, why: str) -> Callable[..., Any]:
        """What not every method brings; refused where this one does not."""
        able = bringing(word)
        if self.method.name not in able:
            raise DetentError(
                f"{self.name}: got an axis of the method {self.method.name}; expected: {' or '.join(able)}, {why}; "
                "name an axis file of it"
            )
        return getattr(self.method, word)

    def run(  # noqa: PLR0913 - what to do, what to record of it, and whom to tell
        self,
        job: str | Path | Job,
        *,
        signals: Sequence[str] | None = None,
        every: int | None = None,
        trace_file: str | Path | None = None,
        job_file: str | Path | None = None,
        clock: Callable[[], datetime] = now,
        progress: Progress | None = None,
        force: bool = False,
    ) -> "Run":
        """Do a job from power-on.

        Parameters
        ----------
        job : path or job object
            A file as of `load_job`, or what that or `load_recording` returned.
        signals : sequence of str, optional
            Registers to record; "all" for every one. Default: what the report needs.
        every : int, optional
            Base ticks between two rows; 0 records nothing. Default: the method's.
        trace_file : path, optional
            Stream the trace to this HDF5 file as it arises: memory then stays constant however long the job is.
        job_file : path, optional
            The file that a job object was read from, for the evidence of the run.
        clock : callable, optional
            ``clock()`` gives the date of the run; the same date gives the same bytes of report and trace.
        progress : callable, optional
            ``progress(share, text)``.
        force : bool
            Stream the trace in place of a file that detent did not write.

        Returns
        -------
        Run
            Also when the axis failed: see `Run.done` and `Run.failure`.

        Raises
        ------
        InputError
            The job cannot be read or does not fit the axis.
        DetentError
            The job is of another kind, a signal is unknown, or the trace cannot be written.
        """
        method = self.simulated
        loaded = self._job(job)
        every = method.every if every is None else every
        names = list(method.signals if signals is None else signals)
        source = job if isinstance(job, str | Path) else job_file
        made = self._evidence(source, names, every, clock)
        with given_as(loaded.name, job):
            if every:
                return self._recorded(loaded, made, trace_file, progress, force=force)
            result = method.run(loaded, progress=progress)
            return Run(self, result, None, evidence=replace(made, figures=hash_figures(result.to_dict())))

    def _recorded(
        self, job: Job, made: RunEvidence, trace_file: str | Path | None, progress: Progress | None, *, force: bool
    ) -> "Run":
        """Do a job and record what the evidence says."""
        method = self.simulated
        about: dict[str, str | float | int] = {"axis": self.name, "job": job.name, "seed": method.seed}
        fidelity = getattr(self.spec.axis, "fidelity", None)
        about |= {"fidelity": fidelity} if fidelity else {}
        recorder = Recorder(method.registers, made.signals, every=made.every, period=method.tick)
        with TraceWriter(trace_file, recorder.trace(**about), force=force) if trace_file else nullcontext() as writer:
            if writer is not None:
                recorder.pass_on(writer.append, KEPT_ROWS)
            result = method.run(job, recorder=recorder, progress=progress)
            made = replace(made, figures=hash_figures(result.to_dict()), trace=recorder.hashes)
            if writer is not None:
                writer.note(ELEMENT, json.dumps(made.to_dict()))
        return Run(self, result, recorder.trace(**about), evidence=made)

    def _evidence(
        self, job_file: str | Path | None, signals: Sequence[str], every: int, clock: Callable[[], datetime]
    ) -> RunEvidence:
        """What a run is made from."""
        job = None if job_file is None else Kept.of_file(Path(job_file))
        return RunEvidence(
            version=__version__,
            date=clock().isoformat(timespec="seconds"),
            axis=Kept.of(self.file.file, self.file.source.content),
            overrides=list(self.file.overrides),
            changes=self.file.changes,
            effective={row.key: shown(row.value) for row in check_spec(self.file).rows},
            job=job,
            seed=self.simulated.seed,
            signals=list(signals),
            every=every,
        )

    def compare(self, progress: Progress | None = None) -> tuple[Comparison, ...]:
        """Compare the method with the alternatives that it improves on, on this axis.

        Print head: one `DriveComparison`. Phase servo: `NoiseComparison` and `HoldComparison`. Filtered servo: one
        `FeedbackComparison`. Rotary table: one `AngleComparison`. Steppers: a `StepComparison` per motor and a
        `JerkComparison`. Cascade: one `ProfileComparison`.
        """
        return self.method.compare(self.spec, progress)

    def linear(self) -> "LinearModel":
        """Give the loops of the axis as linear systems, exact at the samples, with margins and Bode diagram.

        Returns
        -------
        LinearModel
            Cascade: the loop cut at the command, the velocity loop, the position loop. Filtered servo: cut at the speed
            word. Rotary table: cut at the speed signal.

        Raises
        ------
        DetentError
            The axis is of a method whose law is no linear loop.

        Examples
        --------
        >>> import detent
        >>> model = detent.load(detent.example("cascade.toml")).linear()
        >>> round(model.margins["velocity"].crossover, 1), round(model.margins["command"].sensitivity, 2)
        (30.2, 1.7)
        >>> model["position"].closed().to_scipy().dt
        0.00025
        """
        return self.method.linear(self.spec)

    def tune(  # noqa: PLR0913 - what may be asked
        self,
        *,
        ms: float | None = None,
        overshoot: float | None = None,
        goal: str = "",
        hold: Sequence[str] = (),
        job: str | Path | Job | None = None,
        progress: Progress | None = None,
    ) -> "Tuned | Searched":
        """Choose gains with margins, for all that ``[tolerance]`` allows, and try them on the simulation.

        Parameters
        ----------
        ms : float, optional
            Largest sensitivity, the peak of ``|1/(1 + L)|`` where a loop is cut, 1.2 to 2.5, 1.7 unless told
            otherwise. It leaves a gain margin of Ms/(Ms - 1) and a phase margin of 2 asin(1/(2 Ms)).
        overshoot : float, optional
            Largest peak of the reference to the position without feedforward, 1 to 2, 1.1 unless told otherwise.
        goal : str
            "stiff": as much integral stiffness as the bounds allow; "quiet": as little noise as the stiffness of the
            file's gains takes; "quick": of gains between both, those with which the job settles first. Default: the
            first that the method has.
        hold : sequence of str
            Keys that stay as they are.
        job : path or job object, optional
            What both sets of gains are tried with. Default: of an axis that makes moves, half of the travel and back.
        progress : callable, optional
            ``progress(share, text)``.

        Returns
        -------
        Tuned or Searched
            Also where nothing was found: see `refusals`. Of a method whose values no linear model gives, candidates
            are simulated (`Searched`): it takes neither `ms`, `overshoot` nor `goal`.

        Raises
        ------
        DetentError
            The method has nothing to choose, or a parameter is out of its range.
        """
        from detent.tune.searched import no_bounds, search
        from detent.tune.tuned import tune

        tried = None if job is None else self._job(job)
        if self.method.searches:
            no_bounds(self.file, {"ms": ms, "overshoot": overshoot, "goal": goal or None})
            return search(self.file, hold=hold, job=tried, progress=progress)
        bounds = {"sensitivity": ms, "overshoot": overshoot}
        given = {name: value for name, value in bounds.items() if value is not None}
        return tune(self.file, **given, goal=goal, hold=hold, job=tried, progress=progress)

    def hunt(  # noqa: PLR0913 - what may be asked
        self,
        *,
        starts: int | None = None,
        seed: int = 1,
        on_counts: bool = False,
        dead_band: bool = False,
        map_it: bool = False,
        progress: Progress | None = None,
    ) -> "Hunted":
        """Watch the axis at standstill, from many starts: whether it hunts, and what stops it.

        Parameters
        ----------
        starts : int, optional
            How many; the first are the same however many there are. 24 unless told otherwise, at least 12, a third
            each small, wide and hard; of a method that draws none eight, which are moves or stops of its own host.
        seed : int
            What they are drawn from.
        on_counts : bool
            Targets lie on counts of the encoder.
        dead_band : bool
            Find the least dead band of the integral that stops it.
        map_it : bool
            Try dead bands and integral gains beside one another.
        progress : callable, optional
            ``progress(share, text)``.

        Returns
        -------
        Hunted
            Verdict, kinds of hunting, rule of thumb, dead band.

        Raises
        ------
        DetentError
            The method closes no loop at rest, or there are too few starts.
        AxisError
            The guard of the axis switches it off where it should stand.
        """
        from detent.tune.hunted import hunt

        return hunt(
            self.file, starts=starts, seed=seed, on_counts=on_counts, dead_band=dead_band, map_it=map_it,
            progress=progress,
        )  # fmt: skip

    def tolerance(  # noqa: PLR0913 - what may be asked
        self,
        job: str | Path | Job | None = None,
        *,
        cases: int = 1000,
        seed: int = 1,
        limits: Sequence[str] = (),
        margins: bool = False,
        hunt: bool = False,
        total: int = 0,
        store: str | Path | None = None,
        worst: str | Path | None = None,
        workers: int = 0,
        dask: str = "",
        yes: bool = False,
        force: bool = False,
        progress: Progress | None = None,
    ) -> "Tolerated":
        """Make a job on many machines that differ in the keys of ``[tolerance]``, and say how many are good.

        The values of a case are a function of the seed, its number and the key alone; case 0 is the machine of the
        file.

        Parameters
        ----------
        job : path or job object, optional
            What each machine does. Default: of an axis that makes moves, half of the travel and back.
        cases : int
            How many machines.
        seed : int
            0 to 2**64 - 1: another one draws other machines.
        limits : sequence of str
            What passes beside that the job is done: ``"peak_following <= 45 um"``. Default: what the file says.
        margins : bool
            Margins of the loops are quantities, too.
        hunt : bool
            And what each of at most 1000 machines does at standstill from eight starts: the share of them that hunt,
            and the largest swing.
        total : int
            Points of a scheme of runs of its own, a power of 2, that gives the total index of each key; it makes that
            many times the number of keys and two runs.
        store : path, optional
            Folder that keeps each chunk of cases; one of the same question is continued.
        worst : path, optional
            Folder for an axis file of the worst machine found of each quantity. Default: ``worst`` in the store.
        workers : int
            Threads, or processes where the method runs each machine for itself; 0 for all processors. A script whose
            processes these are has its work under ``if __name__ == "__main__":``.
        dask : str
            Address of a Dask scheduler, or "local:2", which computes instead.
        yes : bool
            More than an hour is allowed.
        force : bool
            Replace axis files in the folder of the worst that detent did not write.
        progress : callable, optional
            ``progress(share, text)``.

        Returns
        -------
        Tolerated
            `yields`, `figures`, `sensitivities` and `cases`; `report` writes the page.

        Raises
        ------
        DetentError
            Nothing is toleranced, a limit or another parameter makes no sense, or it would take more than an hour.
        InputError
            The job does not fit the axis, or the store is that of another question.
        """
        from detent.tune.tolerated import Means, tolerance

        tried = None if job is None else self._job(job)
        means = Means(
            store=None if store is None else Path(store), workers=workers, dask=dask, long=yes, force=force,
            worst=None if worst is None else Path(worst), job=str(job) if isinstance(job, str | Path) else "",
        )  # fmt: skip
        return tolerance(
            self.file, job=tried, cases=cases, seed=seed, limits=limits, margins=margins, hunt=hunt, total=total,
            means=means, progress=progress,
        )  # fmt: skip

    def envelopes(self) -> Mapping[str, Any]:
        """Table of permissible frequencies, an `Envelope`, of each motor by name, between its extremes at power-on.

        An axis without steppers has none: a `DetentError`.
        """
        return self._brought("envelopes", "whose motors have a table of permissible frequencies")(self.spec)

    def timing(
        self,
        at: float,
        duration: float,
        *,
        job: str | Path | Job | None = None,
        signals: Sequence[str] | None = None,
        progress: Progress | None = None,
    ) -> "Timing":
        """Record every clock of a short stretch of a run.

        Parameters
        ----------
        at, duration : float
            Begin, since power-on, and length [s].
        job : path or job object, optional
            What the axis does meanwhile; a short move or word of its own by default.
        signals : sequence of str, optional
            Registers; a choice of the method's by default.
        progress : callable, optional
            ``progress(share, text)``.

        Raises
        ------
        InputError
            The job cannot be read or does not fit the axis.
        DetentError
            A signal is unknown, the stretch is too long, or the run ends before it.
        """
        method = self.simulated
        loaded = method.sample_job() if job is None else self._job(job)
        run, chosen = partial(method.run, loaded, progress=progress), method.timing if signals is None else signals
        waveforms = capture(
            method.registers, method.clocking, method.tick, run, at=at, duration=duration, signals=chosen,
            title=self.name,
        )  # fmt: skip
        return Timing(waveforms)


def load(source: str | Path | Mapping[str, Any], overrides: Sequence[str] = ()) -> Axis:
    """Load an axis.

    Parameters
    ----------
    source : path or mapping
        Axis file (TOML), or what one says, as nested dictionaries; there a number of a key with a dimension is in its
        SI unit, text has a unit as in a file.
    overrides : sequence of str
        ``"dotted.key=value"``: replace or add values, and are checked like them.

    Raises
    ------
    InputError
        Everything that is wrong with it, each with its line, what it got, what it expected and what to try.

    Examples
    --------
    >>> import detent
    >>> axis = detent.load(detent.example("cascade.toml"))
    >>> softer = axis.replace({"method.position_gain": 30.0, "limits": {"speed": "300 mm/s"}})
    >>> softer.spec.method.position_gain, softer.spec.limits.speed
    (30.0, 0.3)
    """
    return Axis(axis_of_tables(source, overrides) if isinstance(source, Mapping) else read_axis(source, overrides))
