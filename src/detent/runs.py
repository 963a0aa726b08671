"""What an axis has done: a run, with its report and its trace, and every clock of a short stretch."""

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from detent.errors import DetentError
from detent.files.screen import Block, OnScreen, Screen
from detent.methods.check import check_spec
from detent.methods.method import Result, Shown
from detent.page.frame import Comparison
from detent.page.parts import Note
from detent.record.evidence import ELEMENT, RunEvidence
from detent.record.run import Level
from detent.record.trace import Trace
from detent.record.trace_files import save_trace
from detent.record.waveforms import Waveforms, save_vcd

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from detent.axis import Axis


@dataclass(frozen=True, repr=False)
class Timing(OnScreen):
    """Clocked signals over a short stretch: `waveforms` has each as its changes over time."""

    waveforms: Waveforms

    def screen(self) -> Screen:
        """Its stretch, and each signal with the number of its changes."""
        w = self.waveforms
        rows = [(one.name, one.unit, f"{len(one.times) - 1} changes", one.doc) for one in w.signals]
        title = f"Timing of {w.title}: {w.begin * 1e-12:.9g} s to {w.end * 1e-12:.9g} s"
        return Screen(title, [Block("", (), rows, 28, ".waveforms.signals")], ".plot()  .save('timing.vcd')")

    def plot(self, path: str | Path | None = None, *, force: bool = False) -> "Figure":
        """Draw the timing diagram.

        Parameters
        ----------
        path : path, optional
            PNG, SVG or PDF file that it is written to as well.
        force : bool
            Replace a file that detent did not write.

        Returns
        -------
        matplotlib.figure.Figure
            Shown by a notebook; `savefig` writes it.

        Raises
        ------
        DetentError
            There are too many signals for a diagram, or the file cannot be written.
        """
        from detent.page.timing import plot_timing

        return plot_timing(self.waveforms, path, force=force)

    def save(self, path: str | Path, *, force: bool = False) -> Path:
        """Write a VCD file, which GTKWave and Surfer open; `force` as of `plot`."""
        save_vcd(self.waveforms, path, force=force)
        return Path(path)


@dataclass(repr=False)
class Run(OnScreen):
    """What an axis did with a job.

    Attributes
    ----------
    axis : Axis
        The axis.
    result : PrintRun, MoveRun, SequenceRun, StageRun, CascadeRun or ReplayRun
        Figures; lines and identified constants, moves, steps of a sequence, or a recording beside its simulation.
    trace : Trace or None
        Recorded registers over time.
    settings : dict
        Small print for the report, beside file and seed.
    comparisons : tuple
        What `Axis.compare` found, if the report shall show it.
    evidence : RunEvidence
        What the run was made from, and hashes of what it gave: report, HDF5 trace and JSON carry it.
    """

    axis: "Axis"
    result: Result
    trace: Trace | None
    settings: dict[str, str] = field(default_factory=dict[str, str])
    comparisons: tuple[Comparison, ...] = ()
    evidence: RunEvidence | None = None

    @property
    def done(self) -> bool:
        """True when the axis did the whole job."""
        return self.result.done

    @property
    def failure(self) -> str:
        """Why it did not, and what to do."""
        return self.result.failure

    @property
    def verdict(self) -> str:
        """Whether the job was done, in a sentence."""
        return self.axis.method.verdict(self.axis.name, self.result)

    def screen(self) -> Screen:
        """The verdict, the figures that a person wants first, and what was recorded."""
        held = "nothing was recorded" if self.trace is None else self.trace.screen().title
        told = "\n".join([self.verdict, *(f"warning: {one}" for one in self.result.warnings)])
        return Screen(told, [Block("", (), self.summary(), 28)], f"{held}; .result  .trace  .plot()  .report(path)")

    def summary(self) -> list[tuple[str, str]]:
        """The figures a person wants first: name and text."""
        return self.axis.method.summary(self.axis.spec, self.result)

    @property
    def level(self) -> Level:
        """Of the verdict: "good" when it was done, "warn" when it was done and `result.warnings` say more, "bad"."""
        return self.result.level

    @cached_property
    def cautions(self) -> tuple[str, ...]:
        """What a look at the file warns of, standstill aside: it was known before the run."""
        return tuple(map(str, check_spec(self.axis.file).warnings))

    def to_dict(self) -> dict[str, Any]:
        """Plain data, as ``--json`` prints it."""
        told = {"axis": self.axis.name, "file": self.axis.file.file, "verdict": self.verdict}
        told |= self.result.to_dict() | {"check": list(self.cautions)}
        return told | ({"evidence": self.evidence.to_dict()} if self.evidence else {})

    def report(self, path: str | Path, *, force: bool = False) -> Path:
        """Write the report as one self-contained HTML file; `force` replaces one that detent did not write."""
        from detent.page.render import write_page

        settings = {"axis file": self.axis.file.file, "seed": str(self.axis.simulated.seed)} | self.settings
        if self.evidence:
            settings |= {"date": self.evidence.date, "repeat it": f"detent run --again {Path(path).name}"}
        shown = Shown(trace=self.trace, comparisons=self.comparisons, settings=settings)
        page = self.axis.method.page(self.axis.spec, self.result, shown)
        checked = [Note("warning", f"Known before the run, from detent check: {text}") for text in self.cautions]
        carried = {ELEMENT: self.evidence.to_dict()} if self.evidence else {}
        write_page(path, replace(page, notes=[*page.notes, *checked], embedded=carried), force=force)
        return Path(path)

    def save(self, path: str | Path, *, force: bool = False) -> Path:
        """Write the trace; the suffix chooses HDF5, CSV or Parquet; `force` replaces a file that is not detent's."""
        save_trace(self._trace(), path, force=force)
        return Path(path)

    def plot(
        self,
        signals: str | Iterable[str] = "*",
        path: str | Path | None = None,
        t_range: tuple[float, float] | None = None,
        *,
        force: bool = False,
    ) -> "Figure":
        """Draw signals against time, one plot area per unit.

        Parameters
        ----------
        signals : str or iterable of str
            Names of recorded signals, or patterns such as ``"controller.*"``. Default: all that were recorded.
        path : path, optional
            PNG, SVG or PDF file that it is written to as well.
        t_range : (float, float), optional
            First and last moment, since power-on [s].
        force : bool
            Replace a file that detent did not write.

        Returns
        -------
        matplotlib.figure.Figure
            Shown by a notebook; `savefig` writes it.

        Raises
        ------
        DetentError
            A signal is unknown, nothing was recorded, or the file cannot be written.
        """
        from detent.page.plots import plot_signals

        wanted = [signals] if isinstance(signals, str) else list(signals)
        return plot_signals(self._trace(), wanted, path, t_range, force=force)

    def _trace(self) -> Trace:
        if self.trace is None:
            raise DetentError("this run recorded nothing; run with every >= 1")
        return self.trace
