"""Cyclic synchronous modes of CiA 402: a target for every SYNC, which the axis follows as a stream of set-points.

A master sends a target and a SYNC in each interpolation period (60C2). What it has sent before a SYNC is the set-point
of that period; without a new target a SYNC brings none. A stream that has ended, because no set-points came or for a
stop, is not begun again by a set-point: operation is enabled, the mode chosen, or a halt released for that.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

from detent.faces.service import AxisService, NotDoneError
from detent.operate.drivers import cia402 as c


class Streamed(NamedTuple):
    """What a mode streams: the word that begins it, and the object that its targets are written to."""

    word: str
    target: int


MODES = {
    c.CYCLIC[of].number: Streamed(f"stream_{of}", c.CYCLIC[of].target) for of in ("position", "velocity", "torque")
}
MODES[10] = Streamed("stream_effort", c.TORQUE)
POSITION, VELOCITY = 8, 9
PER_MILLE = 1e-3  # unit of a torque: thousandths of the largest


def supported(axis: AxisService) -> int:
    """Bits of the cyclic modes that an axis has (6502)."""
    return sum(1 << (mode - 1) for mode, one in MODES.items() if one.word in axis.about["commands"])


def cycle(axis: AxisService) -> tuple[int, int]:
    """Interpolation period that stands there first (60C2): that of the loop; 1 ms where that does not go into it."""
    value, power = c.cycle_of(axis.about["period"])
    return (value, power) if value else (1, -3)


class Cyclic:
    """The stream of a drive."""

    def __init__(self, axis: AxisService, tell: Callable[[], object]) -> None:
        self._axis, self._tell = axis, tell
        self.mode = self._stream = 0  # mode and id of what is under way
        self._target: int | None = None  # sent since the last SYNC

    @property
    def follows(self) -> bool:
        """True while set-points are followed."""
        return self._stream != 0

    async def begin(self, mode: int, period: float) -> Any:
        """Begin a stream; gives what waits for its end."""
        ending = await self._axis.begin(MODES[mode].word, period)
        self.mode, self._stream, self._target = mode, self._axis.asked, None
        return self._ended(MODES[mode].word, ending, self._stream)

    async def _ended(self, word: str, ending: Any, stream: int) -> None:
        try:
            await self._axis.ended(word, ending)
        except NotDoneError:
            pass  # the status word shows it
        finally:
            if self._stream == stream:
                self._stream = self.mode = 0
        self._tell()

    def write(self, index: int, value: int) -> None:
        """A target has come; in the thread of the bus, as the next one."""
        if self._stream and index == MODES[self.mode].target:
            self._target = value

    def sync(self) -> tuple[int, float] | None:
        """A SYNC has come: stream and set-point, where there is one."""
        target, mode = self._target, self.mode
        self._target = None
        if target is None or not self._stream:
            return None
        axis = self._axis
        if mode == POSITION:
            value = axis.in_si(axis.from_counts(target))
        else:
            value = axis.in_si(target * axis.count) if mode == VELOCITY else target * PER_MILLE
        return self._stream, value
