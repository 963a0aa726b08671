"""The Python API: an axis, loaded from its file, and the runs it makes. The words are those of the command line."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from detent.axisfile.check import CheckReport, check_spec
from detent.axisfile.load import AxisFile, read_axis
from detent.axisfile.schema import PrintHeadSpec
from detent.planning.print_job import PrintJob, load_job
from detent.report.data import ReportData
from detent.report.print_report import print_report
from detent.simulation.comparison import DriveComparison, compare_drives
from detent.simulation.machine import TICK
from detent.simulation.print_run import PrintRun, Progress, default_signals, print_job
from detent.simulation.recorder import Recorder, choose_leaves, make_trace
from detent.simulation.trace import Trace
from detent.simulation.trace_files import load_trace, save_trace
from detent.simulation.trace_store import TraceWriter
from detent.systems.print_head import PrintHead

EVERY = 10
"""Ticks between two rows of a trace unless told otherwise: 0.4 ms, the time of a count of the ramp."""

KEPT_ROWS = 100_000
"""Rows kept in memory beside a trace that goes to a file, 40 s at the usual rate: the report draws from these."""


@dataclass(frozen=True)
class Axis:
    """An axis as its file describes it.

    Attributes
    ----------
    file : AxisFile
        The specification with the origin of every value.
    """

    file: AxisFile

    @property
    def spec(self) -> PrintHeadSpec:
        """The specification, in SI units."""
        return self.file.spec

    @property
    def name(self) -> str:
        """Name of the axis."""
        return self.spec.axis.name

    def check(self) -> CheckReport:
        """Effective values, derived figures and warnings."""
        return check_spec(self.file)

    def check_signals(self, names: Sequence[str]) -> None:
        """Refuse names and patterns that are no register of the axis, before any work is done.

        Raises
        ------
        DetentError
            A name is unknown; the message names the nearest.
        """
        choose_leaves(PrintHead, names)

    def run(
        self,
        job: str | Path | PrintJob,
        *,
        signals: Sequence[str] | None = None,
        every: int = EVERY,
        trace_file: str | Path | None = None,
        progress: Progress | None = None,
    ) -> "Run":
        """Print a job from power-on.

        Parameters
        ----------
        job : path or PrintJob
            Text or a Diablo 630 stream.
        signals : sequence of str, optional
            Registers to record; "all" for every one. Default: what the report needs.
        every : int
            Ticks of 40 us between two rows; 0 records nothing.
        trace_file : path, optional
            Stream the trace to this HDF5 file as it arises: memory then stays constant however long the job is.
        progress : callable, optional
            ``progress(share, text)``.

        Returns
        -------
        Run
            Also when the axis failed: see `Run.printed` and `Run.failure`.

        Raises
        ------
        InputError
            The job cannot be read or does not fit the axis.
        DetentError
            A signal is unknown, or the trace cannot be written.
        """
        loaded = job if isinstance(job, PrintJob) else load_job(job)
        if every == 0:
            return Run(self, print_job(self.spec, loaded, progress=progress), None)
        names = list(default_signals() if signals is None else signals)
        about: dict[str, str | float | int] = {
            "axis": self.name, "job": loaded.name, "seed": self.spec.encoder.seed, "fidelity": self.spec.axis.fidelity,
        }  # fmt: skip
        memory = _Memory()
        recorder = Recorder(PrintHead, names, every=every, period=TICK, sink=memory)
        if trace_file is None:
            result = print_job(self.spec, loaded, recorder=recorder, progress=progress)
        else:
            with TraceWriter(
                trace_file, recorder.dtype, units=recorder.units, docs=recorder.docs, attributes=about
            ) as writer:
                memory.also, memory.most = writer.append, KEPT_ROWS
                result = print_job(self.spec, loaded, recorder=recorder, progress=progress)
        return Run(self, result, memory.trace(recorder, about))

    def compare(self) -> DriveComparison:
        """Power-on default, nominal table and identified drive on this (drifted) axis."""
        return compare_drives(self.spec)


class _Memory:
    """Keeps rows for the report and passes them on."""

    def __init__(self) -> None:
        self.blocks: list[Any] = []
        self.rows = 0
        self.most: int | None = None
        self.also: Any = None

    def __call__(self, block: Any) -> None:
        if self.also is not None:
            self.also(block)
        room = len(block) if self.most is None else min(len(block), self.most - self.rows)
        if room > 0:
            self.blocks.append(block[:room])
            self.rows += room

    def trace(self, recorder: Recorder, about: dict[str, str | float | int]) -> Trace:
        return make_trace(recorder, self.blocks, about)


@dataclass
class Run:
    """What an axis did with a job.

    Attributes
    ----------
    axis : Axis
        The axis.
    result : PrintRun
        Figures, lines, identified constants.
    trace : Trace or None
        Recorded registers over time.
    settings : dict
        Small print for the report, beside file, fidelity and seed.
    """

    axis: Axis
    result: PrintRun
    trace: Trace | None
    settings: dict[str, str] = field(default_factory=dict[str, str])

    @property
    def printed(self) -> bool:
        """True when the whole job is on paper."""
        return self.result.printed

    @property
    def failure(self) -> str:
        """Why it is not, and what to do."""
        return self.result.failure

    def to_dict(self) -> dict[str, Any]:
        """Plain data, as ``--json`` prints it."""
        return {"axis": self.axis.name, "file": self.axis.file.file} | self.result.to_dict()

    def report_data(self) -> ReportData:
        """What the report shows."""
        settings = {
            "axis file": self.axis.file.file,
            "fidelity": self.axis.spec.axis.fidelity,
            "seed": str(self.axis.spec.encoder.seed),
        }
        return print_report(self.axis.spec, self.result, self.trace, settings=settings | self.settings)

    def report(self, path: str | Path) -> Path:
        """Write the report as one self-contained HTML file."""
        from detent.report.html import write_report

        write_report(self.report_data(), path)
        return Path(path)

    def save(self, path: str | Path) -> Path:
        """Write the trace; the suffix chooses HDF5, CSV or Parquet."""
        save_trace(self._trace(), path)
        return Path(path)

    def plot(self, signals: Iterable[str], path: str | Path, t_range: tuple[float, float] | None = None) -> Path:
        """Draw signals against time into a PNG, SVG or PDF file."""
        from detent.report.figures import plot_signals

        plot_signals(self._trace(), list(signals), path, t_range)
        return Path(path)

    def _trace(self) -> Trace:
        from detent.errors import DetentError

        if self.trace is None:
            raise DetentError("this run recorded nothing; run with every >= 1")
        return self.trace


def load(path: str | Path, overrides: Sequence[str] = ()) -> Axis:
    """Load an axis file.

    Parameters
    ----------
    path : path
        TOML file.
    overrides : sequence of str
        ``"dotted.key=value"`` texts that replace or add values, checked like the file.

    Returns
    -------
    Axis

    Raises
    ------
    InputError
        Everything that is wrong with it, each with its line, what came, what is allowed and what to do.
    """
    return Axis(read_axis(path, overrides))


__all__ = ["Axis", "Run", "load", "load_trace"]
