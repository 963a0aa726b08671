"""The envelope: for every step of the travel the frequency it may have (stepper-envelope specification 3.2 and 3.6).

The table is worked out once, not while the motor runs. An entry holds the ramp index of its step, and in its upper bits
the number of the zone limit that cuts the ramp's frequency there. A stop extreme is one negative entry, the sentinel.
What lies beyond it stays what the zones allow, and so an extreme moves by rewriting one ramp length at its old and one
at its new place, whatever the travel.

Entries are addressed by the position that a step departs from: `entries[p]` decides about the step that leaves p. The
step over the interval i, from boundary i to i + 1, departs from i upwards and from i + 1 downwards.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from detent.planning.step_ramp import StepRamp

INDEX_BITS = 11  # bits of the ramp index in an entry; above them the zone number's four and the sentinel's sign

INDEX_MASK = (1 << INDEX_BITS) - 1
MAX_RAMP = 1 << INDEX_BITS
MAX_LIMITS = 16
SENTINEL = -1  # entry of a step that is not allowed

ENTRY_BYTES = 2


@dataclass(frozen=True, slots=True)
class Zone:
    """Steps begin <= i < end may not be faster than `max_hz` [Hz]."""

    begin: int
    end: int
    max_hz: float


class ZoneMap:
    """Speed limit of every step."""

    def __init__(self, steps: int, max_hz: float, zones: Sequence[Zone] = (), also: Sequence[float] = ()) -> None:
        self.steps, self.max_hz, self.zones = steps, max_hz, tuple(zone for zone in zones if zone.begin < zone.end)
        edges = sorted({0, steps, *(edge for zone in self.zones for edge in (zone.begin, zone.end))})
        # A step that two zones touch is the slower one's.
        inside = ([zone.max_hz for zone in self.zones if zone.begin <= place < zone.end] for place in edges[:-1])
        hz = [min(limits, default=max_hz) for limits in inside]
        self.limits = tuple(sorted({*also, *hz}, reverse=True))  # each limit once, the largest first [Hz]
        if len(self.limits) > MAX_LIMITS:
            raise ValueError(f"the zones have {len(self.limits)} different limits, must be {MAX_LIMITS} or fewer")
        self.edges = np.array(edges, np.int64)  # where the limit changes, 0 and N included
        self.numbers = np.array([self.limits.index(one) for one in hz], np.int32)  # of each stretch's limit in `limits`

    def mirrored(self) -> "ZoneMap":
        """The same limits as one meets them coming from the upper end."""
        n = self.steps
        turned = [Zone(n - zone.end, n - zone.begin, zone.max_hz) for zone in self.zones]
        return ZoneMap(n, self.max_hz, turned, self.limits)

    @property
    def hz(self) -> NDArray[np.float64]:
        """Limit of every step, shape (N,) [Hz]."""
        return np.repeat(np.array(self.limits)[self.numbers], np.diff(self.edges))

    def spread(self, values: NDArray[np.int32], begin: int, end: int) -> NDArray[np.int32]:
        """One value per stretch -> one per step of the window [begin, end)."""
        return np.repeat(values, np.diff(np.clip(self.edges, begin, end)))


@dataclass(frozen=True, slots=True)
class StopEdit:
    """What came of moving a stop."""

    stop: int  # position where the motor will stop
    # the position asked for was too near to come down from the present speed; `stop` is the nearest possible one
    overrun: bool
    written: int  # table entries rewritten, sentinels included


class StepEnvelope:
    """Table of one direction."""

    def __init__(
        self, ramp: StepRamp, zones: ZoneMap, direction: int = 1, start: int | None = None, stop: int | None = None
    ) -> None:
        if len(ramp) > MAX_RAMP:
            raise ValueError(
                f"the ramp has {len(ramp)} entries, must be {MAX_RAMP} or fewer; raise the acceleration or the start "
                "frequency, or lower the largest frequency"
            )
        self.ramp, self.zones, self.direction, self.steps = ramp, zones, direction, zones.steps
        self._map = zones if direction > 0 else zones.mirrored()
        caps = np.array([ramp.index_of(hz) for hz in self._map.limits], np.int32)
        self._caps: NDArray[np.int32] = caps[self._map.numbers]
        n, reach = self.steps, len(ramp)
        self._start = 0 if start is None else self._along(start)
        self._stop = n if stop is None else self._along(stop)
        level = (caps | np.arange(len(caps)) << INDEX_BITS).astype(np.int16)[self._map.numbers]
        travelled = np.append(np.repeat(level, np.diff(self._map.edges)), np.int16(SENTINEL))
        # by the position that the step departs from; the last one in the direction of motion is always a sentinel
        self.entries: NDArray[np.int16] = np.ascontiguousarray(travelled[::direction])
        # The same memory in the order of travel: this direction's first step first.
        self._travelled = self.entries[::direction]
        # Only near a zone's edge or an extreme does a step have to be slower than its own zone allows.
        for edge in {*self._map.edges.tolist(), self._start, self._stop}:
            self._write(edge - reach, edge + reach)

    @property
    def start(self) -> int:
        """Position of the start extreme."""
        return self._start if self.direction > 0 else self.steps - self._start

    @property
    def stop(self) -> int:
        """Position of the stop extreme."""
        return self._stop if self.direction > 0 else self.steps - self._stop

    def _along(self, position: int) -> int:
        """A position of the axis as way from this direction's first step."""
        if not 0 <= position <= self.steps:
            raise ValueError(f"position is {position}, must be 0..{self.steps} steps")
        return position if self.direction > 0 else self.steps - position

    def _feasible(self, begin: int, end: int) -> NDArray[np.int32]:
        """Ramp indices of the window [begin, end) that zones and the end of the travel allow.

        idx[i] = min over all j of cap[j] + |i - j|: nothing further away than a ramp length can matter.
        """
        reach = len(self.ramp)
        low, high = max(begin - reach, 0), min(end + reach, self.steps)
        index = self._map.spread(self._caps, low, high)
        way = np.arange(low, high, dtype=np.int32)
        index -= way
        np.minimum.accumulate(index, out=index)
        index += 2 * way
        backwards = index[::-1]
        np.minimum.accumulate(backwards, out=backwards)
        index -= way
        np.minimum(index, self.steps - 1 - way, out=index)
        return index[begin - low : end - low]

    def _write(self, begin: int, end: int) -> int:
        """Work out the entries of the window [begin, end), cut to the travel; returns how many there are."""
        begin, end = max(begin, 0), min(end, self.steps + 1)
        last = min(end, self.steps)
        way = np.arange(begin, last, dtype=np.int32)
        index = self._feasible(begin, last)
        # A motor that comes from beyond its start extreme finds a ramp there too, not a sudden 0.
        np.minimum(index, np.abs(way - self._start), out=index)
        before = index[: max(self._stop - begin, 0)]
        np.minimum(before, self._stop - 1 - way[: len(before)], out=before)
        self._travelled[begin:last] = index | self._map.spread(self._map.numbers, begin, last) << INDEX_BITS
        for place in (self._stop, self.steps):
            if begin <= place < end:
                self._travelled[place] = SENTINEL
        return max(end - begin, 0)

    def move_start(self, position: int) -> int:
        """Move the start extreme; a motor that runs must be at least its ramp index away from the new place."""
        former, self._start = self._start, self._along(position)
        reach = len(self.ramp)
        return sum(self._write(place - reach + 1, place + reach) for place in {former, self._start})

    def move_stop(self, position: int, at: int | None = None, index: int = -1) -> StopEdit:
        """Move the stop extreme, at rest or between two steps of a run in this direction."""
        wanted = self._along(position)
        nearest = 0 if at is None or index < 0 else self._along(at) + index
        former, self._stop = self._stop, min(max(wanted, nearest), self.steps)
        reach = len(self.ramp)
        written = sum(self._write(place - reach + 1, place + 1) for place in {former, self._stop})
        return StopEdit(self.stop, wanted < nearest, written)

    @property
    def stretches(self) -> tuple[list[int], list[int], list[int]]:
        """In the order of travel: where the limit changes, both ends included; largest index and number of each."""
        return self._map.edges.tolist(), self._caps.tolist(), self._map.numbers.tolist()

    def indices(self) -> NDArray[np.int64]:
        """Ramp index of every step i, -1 at a sentinel, shape (N,)."""
        entries = (self.entries[:-1] if self.direction > 0 else self.entries[1:]).astype(np.int64)
        return np.where(entries < 0, -1, entries & INDEX_MASK)

    def of_steps(self, ramp: NDArray[Any], limits: NDArray[Any], slower: np.ufunc = np.minimum) -> NDArray[Any]:
        """What a step i has of values by ramp index and by zone limit: the slower one, 0 at a sentinel, shape (N,)."""
        entries = self.entries[:-1] if self.direction > 0 else self.entries[1:]
        found = np.zeros(self.steps, ramp.dtype)
        kept = entries[entries >= 0]
        found[entries >= 0] = slower(ramp[kept & INDEX_MASK], limits[kept >> INDEX_BITS])
        return found

    def permissible_hz(self) -> NDArray[np.float64]:
        """f_zul of every step i, 0 at a sentinel, shape (N,) [Hz]."""
        return self.of_steps(self.ramp.hz, np.array(self.zones.limits))


@dataclass(frozen=True, slots=True)
class EnvelopeMemory:
    """What a method keeps in memory [byte]."""

    tables: int  # both directions, 16 bits a step
    compact: int  # one direction with 8-bit ramp indices; 0 where the ramp has more than 255 entries
    ramp: int  # ramp list, 16 bits an entry
    # what the comparison methods store: three extremes of 32 bits, and 32 + 16 bits a zone; they compute instead
    conventional: int


def envelope_memory(ramp: StepRamp, zones: ZoneMap) -> EnvelopeMemory:
    """Memory of the tables without their two closing sentinels, beside that of the comparison methods."""
    short = len(ramp) <= 255  # the 256th value is the sentinel
    return EnvelopeMemory(
        tables=2 * ENTRY_BYTES * zones.steps,
        compact=zones.steps if short else 0,
        ramp=2 * len(ramp),
        conventional=3 * 4 + 6 * len(zones.zones),
    )
