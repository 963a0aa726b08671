"""Timing diagrams: every tick of a short stretch of a run, as waveforms of its clocked signals."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from detent.errors import DetentError
from detent.kernel.registers import Leaf, Registers
from detent.record.recorder import byte_places, choose_leaves
from detent.record.waveforms import Phase, Waveform, Waveforms, clock_waveform, waveforms_from_rows
from detent.units import format_quantity

MOST_TICKS = 200_000  # ticks of one capture: beyond that no eye follows, and a trace is the better tool


@dataclass(frozen=True, slots=True)
class Clocking:
    """How the registers of a method change inside its base tick."""

    # rows recorded in a tick: 1, or the clocks of a method whose logic runs faster than its tick
    rows_per_tick: int = 1
    phases: Mapping[str, Phase] | None = None  # when inside such a row a register changes, by path or block
    # clocks that are no registers: part of the row in which they are high, and what they do
    clocks: Mapping[str, tuple[tuple[float, float], str]] | None = None
    # registers that change a second time within a row: from the recorded columns, their value in the first half
    between: Mapping[str, Callable[[Any], NDArray[Any]]] | None = None
    needs: tuple[str, ...] = ()  # registers that `between` works from


class CaptureDoneError(Exception):
    """The stretch is recorded; the rest of the run does not matter."""


class Capture:
    """Stands in for a recorder: lets a run pass until the stretch begins, and records it tick by tick."""

    def __init__(self, leaves: Sequence[Leaf], begin: int, end: int, rows_per_tick: int) -> None:
        self.begin, self.end, self.rows_per_tick = begin, end, rows_per_tick
        self.picks = byte_places(leaves)
        self._raw: Any = np.dtype([(leaf.path, "<" + leaf.width.code) for leaf in leaves])
        self.rows = np.zeros(((end - begin + 1) * rows_per_tick, len(self.picks)), np.uint8)
        self._now = 0

    @property
    def every(self) -> int:
        """0 before the stretch, 1 within it."""
        return int(self._now >= self.begin)

    @property
    def fine(self) -> bool:
        """True where each clock of a tick is to be recorded."""
        return self.rows_per_tick > 1 and self._now >= self.begin

    def room(self, tick: int) -> int:
        """Ticks that may still pass before this object must be asked again."""
        self._now = tick
        return self.begin - tick if tick < self.begin else self.end - tick

    def flush(self, tick: int) -> None:
        """Called when the room is used up; at the end of the stretch it ends the run."""
        if tick >= self.end:
            raise CaptureDoneError

    def table(self) -> NDArray[np.void]:
        """Rows of the stretch, numbered as waveforms count them: the row after clock n - 1 is n."""
        n = self.rows_per_tick
        numbers = np.arange(self.begin * n, self.end * n)
        # A tick's row is numbered by the counter after it, a clock's row by the clock itself.
        places = (numbers + (1 if n == 1 else 0)) % len(self.rows)
        found: Any = self.rows[places].view(self._raw)[:, 0].copy()
        found["tick"] = numbers + 1
        return found


def capture(  # noqa: PLR0913 - what runs, and what is shown of it
    registers: type[Registers],
    clocking: Clocking,
    tick: float,
    run: Callable[[Any], Any],
    *,
    at: float,
    duration: float,
    signals: Sequence[str],
    title: str = "",
) -> Waveforms:
    """Run an axis until a moment and record every clock of a stretch from there [s]."""
    begin, ticks = round(at / tick), max(1, round(duration / tick))
    if at < 0 or duration <= 0 or ticks > MOST_TICKS:
        longest = format_quantity(MOST_TICKS * tick, "s")
        raise DetentError(
            f"timing: got {at:g} s for {duration:g} s; expected: a moment from 0 s and up to {longest} "
            "from there; choose a shorter stretch, or record a trace with `detent run --every`"
        )
    shown = choose_leaves(registers, signals)
    needed = choose_leaves(registers, ["tick", *(leaf.path for leaf in shown), *clocking.needs])
    recorder = Capture(needed, begin, begin + ticks, clocking.rows_per_tick)
    try:
        run(recorder)
    except CaptureDoneError:
        return _waveforms(recorder, shown, clocking, tick, title)
    raise DetentError(
        f"timing: the run ends before {format_quantity((begin + ticks) * tick, 's', 7)}; choose an earlier --at, a "
        "shorter --for, or a longer job"
    )


def _waveforms(recorder: Capture, shown: Sequence[Leaf], clocking: Clocking, tick: float, title: str) -> Waveforms:
    rows, period = recorder.table(), tick / recorder.rows_per_tick
    found = waveforms_from_rows(rows, shown, period=period, phases=clocking.phases, title=title)
    between = clocking.between or {}
    signals = [_with_first_half(found[leaf.path], between.get(leaf.path), rows, leaf, period) for leaf in shown]
    first = int(rows["tick"][0]) - 1
    ticks = range(first, first + len(rows))
    clocks = [
        clock_waveform(name, period, ticks, high=high, doc=doc) for name, (high, doc) in (clocking.clocks or {}).items()
    ]
    return replace(found, signals=(*clocks, *signals))


def _with_first_half(
    whole: Waveform, first_half: Callable[[Any], NDArray[Any]] | None, rows: NDArray[np.void], leaf: Leaf, period: float
) -> Waveform:
    """A register that changes at both halves of a row: twice the rows, of half the period."""
    if first_half is None:
        return whole
    doubled: Any = np.empty(2 * len(rows), np.dtype([("tick", "<i8"), (leaf.path, rows.dtype[leaf.path])]))
    doubled[leaf.path][0::2], doubled[leaf.path][1::2] = first_half(rows), rows[leaf.path]
    doubled["tick"] = np.arange(len(doubled)) + 2 * (int(rows["tick"][0]) - 1) + 1
    return waveforms_from_rows(doubled, [leaf], period=period / 2)[leaf.path]
