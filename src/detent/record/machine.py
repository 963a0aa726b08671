"""An axis in simulated time: parameters, state, recorder, and the passing of time."""

from collections.abc import Callable
from typing import Any, Generic, Protocol, TypeVar

import numpy as np

from detent.kernel.loop import Bytes, Offsets, advance
from detent.kernel.registers import Registers
from detent.record.capture import Capture
from detent.record.recorder import Recorder

LONGEST_STRETCH = 1 << 20  # ticks of one call into compiled code: progress can be shown between two
Progress = Callable[[float, str], None]  # called with the share done, 0..1, and what is being done
P = TypeVar("P", bound=Registers)
S = TypeVar("S", bound=Registers)


AnyRecorder = Recorder | Capture  # what records a run: every n-th tick of all of it, or each clock of a stretch


class Witness(Protocol):
    """Sees every tick of a run, and what its host writes between two stretches of them."""

    motor: str  # which of several it sees; empty where there is one
    rows: Bytes  # a row per tick, by its number modulo their count
    picks: Offsets

    def room(self) -> int:
        """Ticks of the next stretch at most."""
        ...

    def begin(self, params: Any, state: Any, feed: tuple[Any, ...]) -> None:
        """A stretch begins; the host has written what it wants."""
        ...

    def exchange(self, params: Any) -> None:
        """Another set of parameters from the next tick on."""
        ...

    def take(self, ticks: int) -> None:
        """So many ticks have passed."""
        ...

    def act(self, params: Any, state: Any, action: Callable[..., Any], args: tuple[Any, ...]) -> Any:
        """The host does ``action(*args)``, and gets what that gives."""
        ...


class Machine(Generic[P, S]):
    """A simulated axis whose base tick lasts `tick` [s].

    What the host has laid ready for a stretch is ``feed()``.
    ``advance(params, state, ticks, trace, picks, every)`` gives the ticks run: fewer when the axis waits for its host;
    ``by_clocks(params, state, ticks, trace, picks)`` is the same, recording every clock inside a tick.
    """

    def __init__(  # noqa: PLR0913 - an axis, its clock, what records it, and how it runs
        self,
        params: P,
        state: S,
        tick: float,
        recorder: AnyRecorder | Witness | None = None,
        *,
        advance: Callable[..., int] = advance,
        by_clocks: Callable[..., int] | None = None,
        feed: Callable[[], tuple[Any, ...]] = tuple,
    ) -> None:
        self.params, self.state, self.tick, self.recorder = params, state, tick, recorder
        self._advance, self._by_clocks, self._feed = advance, by_clocks, feed
        self.changes: list[tuple[int, Callable[[P], None]]] = []
        """What writes another set of parameters before which tick, in the order of time."""
        self._clock: Any = state  # every axis's state has a field `tick`, which the base class cannot name
        self._no_rows = (np.zeros((1, 1), np.uint8), np.zeros(0, np.int64))

    @property
    def time(self) -> float:
        """Simulated time since power-on [s]."""
        return self._clock.tick * self.tick

    def act(self, action: Callable[..., Any], *args: Any) -> Any:
        """Let the host do something to the controller: ``action(*args)``, and what that gives."""
        r = self.recorder
        if r is None or isinstance(r, Recorder | Capture):
            return action(*args)
        return r.act(self.params, self.state, action, args)

    def pass_time(self, seconds: float) -> None:
        """Let at most `seconds` pass (a tick at least); returns earlier when the axis waits for its host."""
        self.pass_ticks(max(1, round(seconds / self.tick)))

    def pass_ticks(self, ticks: int) -> int:
        """Let at most so many ticks pass; returns how many did: fewer when the axis waits for its host."""
        left = ticks
        while left > 0:
            asked = min(left, LONGEST_STRETCH, self._to_change())
            done = self._run(asked)
            left -= done
            if done == 0:
                break
        return ticks - left

    def _to_change(self) -> int:
        """Make the changes of parameters that are due; ticks until the next one."""
        due = 0
        while self.changes and self.changes[0][0] <= self._clock.tick:
            self.changes.pop(0)[1](self.params)
            due += 1
        if due and self.recorder is not None and not isinstance(self.recorder, Recorder | Capture):
            self.recorder.exchange(self.params)
        return self.changes[0][0] - self._clock.tick if self.changes else LONGEST_STRETCH

    def _run(self, ticks: int) -> int:
        r, now = self.recorder, self._clock.tick
        if r is None:
            return self._advance(self.params, self.state, ticks, *self._no_rows, 0)
        if not isinstance(r, Recorder | Capture):
            r.begin(self.params, self.state, self._feed())
            done = self._advance(self.params, self.state, min(ticks, r.room()), r.rows, r.picks, 1)
            r.take(done)
            return done
        ticks = min(ticks, r.room(now))
        if isinstance(r, Capture) and r.fine and self._by_clocks is not None:
            done = self._by_clocks(self.params, self.state, ticks, r.rows, r.picks)
        else:
            done = self._advance(self.params, self.state, ticks, r.rows, r.picks, r.every)
        if r.room(now + done) <= 0:
            r.flush(now + done)
        return done

    def close(self) -> None:
        """Hand the last rows to the recorder's sink."""
        if isinstance(self.recorder, Recorder | Capture):
            self.recorder.flush(self._clock.tick)
