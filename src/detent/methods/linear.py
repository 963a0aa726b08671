"""The linear model of an axis: its loops cut open, their margins, their Bode diagram, and hand-over to other tools."""

import importlib
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from detent.analysis.linear_system import LinearSystem
from detent.analysis.margins import Margins
from detent.errors import DetentError
from detent.files.screen import Block, OnScreen, Screen
from detent.files.text import check_target, did_you_mean
from detent.page.plots import ABOVE, COLOURS, Axes, Figure, new_figure
from detent.units import format_quantity

SHOWN = 3.5  # decades of frequency in a Bode diagram


@dataclass(frozen=True, repr=False, eq=False)
class LinearModel(OnScreen):
    """The loops of an axis, exact at the samples, each cut open at one place.

    Attributes
    ----------
    name : str
        Name of the axis.
    loops : mapping of str to LinearSystem
        By the place of the cut. Of a cascade: "command" (both loops, what the amplifier sees), "velocity" (the velocity
        loop alone) and "position" (the position loop around it); a PID has "command" alone.
    notes : tuple of str
        What the model leaves out.
    """

    name: str
    loops: Mapping[str, LinearSystem]
    notes: tuple[str, ...] = ()

    def __getitem__(self, cut: str) -> LinearSystem:
        """Give the loop that is cut at one place."""
        if cut not in self.loops:
            known = ", ".join(self.loops)
            remedy = did_you_mean(cut, self.loops, "name one of these")
            raise DetentError(f"{self.name}: got the cut {cut!r}; expected: {known}; try: {remedy}")
        return self.loops[cut]

    @cached_property
    def margins(self) -> dict[str, Margins]:
        """Margins by the place of the cut."""
        return {cut: loop.margins() for cut, loop in self.loops.items()}

    @cached_property
    def settles(self) -> bool:
        """Whether every mode of the closed loops decays; the first cut goes through all of them."""
        return next(iter(self.loops.values())).closed().spectral_radius < 1.0

    def to_control(self, cut: str = "") -> Any:
        """Give one loop, by default the first, as a ``control.StateSpace``; a `DetentError` without python-control."""
        return self[cut or next(iter(self.loops))].to_control()

    def to_scipy(self, cut: str = "") -> Any:
        """Give one loop, by default the first, as a discrete ``scipy.signal.StateSpace``."""
        return self[cut or next(iter(self.loops))].to_scipy()

    def screen(self) -> Screen:
        """The margins of every loop."""
        rows = [
            (
                cut,
                format_quantity(m.crossover, "Hz", 4) if m.crossover else "never",
                format_quantity(m.phase, "rad", 3),
                f"{m.gain:.3g}" if math.isfinite(m.gain) else "any",
                format_quantity(m.delay, "s", 3) if math.isfinite(m.delay) else "any",
                f"{m.sensitivity:.3g} at {format_quantity(m.peak, 'Hz', 3)}",
            )
            for cut, m in self.margins.items()
        ]
        heads = ("cut", "crossover", "phase margin", "gain margin", "delay margin", "Ms")
        title = (
            f"Linear model of {self.name}{'' if self.settles else ': it does not settle, and its margins mean nothing'}"
        )
        return Screen("\n".join([title, *self.notes]), [Block("", heads, rows)], ".bode()")

    def bode(self, cuts: Sequence[str] = (), path: str | Path | None = None, *, force: bool = False) -> Figure:
        """Draw the Bode diagram of open loops.

        Parameters
        ----------
        cuts : sequence of str
            Places of the cuts; by default all.
        path : path, optional
            PNG, SVG or PDF file that it is written to as well.
        force : bool
            Replace a file that detent did not write.

        Returns
        -------
        matplotlib.figure.Figure
            Gain over phase; each loop with its crossover and phase margin.

        Raises
        ------
        DetentError
            A cut is unknown, or the file cannot be written.
        """
        path = None if path is None else check_target(path, force=force)
        chosen = {cut: self[cut] for cut in cuts or self.loops}
        with new_figure(path, 9.0, 5.6, force=force) as figure:
            levels, phases = figure.subplots(2, sharex=True)
            for (cut, loop), colour in zip(chosen.items(), COLOURS, strict=False):
                self._draw(levels, phases, cut, loop, colour)
            self._label(levels, phases, next(iter(chosen.values())).dt)
        return figure

    def _draw(self, levels: Axes, phases: Axes, cut: str, loop: LinearSystem, colour: str) -> None:
        frequencies = loop.frequencies()
        last = 0.49 / loop.dt
        frequencies = frequencies[(frequencies > 10**-SHOWN * last) & (frequencies < last)]
        m = self.margins[cut]
        label = f"{cut}: {m.crossover:.3g} Hz, {math.degrees(m.phase):.0f}°" if m.crossover else cut
        found = loop.response(frequencies)
        levels.semilogx(frequencies, 20.0 * np.log10(np.maximum(np.abs(found), 1e-300)), color=colour, label=label)
        # The phase of an open loop falls; it begins between -270 and 90 degrees.
        phase = np.degrees(np.unwrap(np.angle(found)))
        phases.semilogx(frequencies, phase - 360.0 * np.round((phase[0] + 90.0) / 360.0), color=colour)
        if m.crossover:
            levels.plot([m.crossover], [0.0], "o", color=colour, markersize=4)

    def _label(self, levels: Axes, phases: Axes, dt: float) -> None:
        ticker: Any = importlib.import_module("matplotlib.ticker")
        levels.axhline(0.0, color="#7d8996", linewidth=0.8)
        levels.set_ylabel("gain [dB]")
        levels.legend(**ABOVE, ncols=3, fontsize=9)
        low, high = levels.get_ylim()
        levels.set_ylim(max(low, -100.0), min(high, 100.0))
        phases.axhline(-180.0, color="#7d8996", linewidth=0.8)
        phases.set_ylabel("phase [deg]")
        phases.yaxis.set_major_locator(ticker.MultipleLocator(90.0))
        low, high = phases.get_ylim()
        phases.set_ylim(max(low, -540.0), high)
        phases.set_xlabel(f"frequency [Hz], up to half of the sample rate, {format_quantity(0.5 / dt, 'Hz', 3)}")
        phases.xaxis.set_major_formatter(ticker.StrMethodFormatter("{x:g}"))
        levels.margins(x=0)
