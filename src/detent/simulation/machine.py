"""A print-head axis in simulated time: parameters, state, recorder, and the passing of time."""

import numpy as np

from detent.axisfile.build import build_print_head
from detent.axisfile.schema import PrintHeadSpec
from detent.simulation.recorder import Recorder
from detent.systems.print_head import PERIOD_US, PrintHead, advance, switch_on

TICK = PERIOD_US * 1e-6
LONGEST_STRETCH = 1 << 20
"""Ticks of one call into compiled code: progress can be shown between two."""


class Machine:
    """The simulated axis.

    Attributes
    ----------
    params : PrintHeadParams
        What does not change.
    state : PrintHead
        The registers.
    """

    def __init__(self, spec: PrintHeadSpec, recorder: Recorder | None = None) -> None:
        self.spec = spec
        self.params = build_print_head(spec)
        self.state = PrintHead()
        self.recorder = recorder
        switch_on(self.params, self.state, spec.mechanics.start_position, spec.encoder.seed)
        self._no_rows = (np.zeros((1, 1), np.uint8), np.zeros(0, np.int64))

    @property
    def time(self) -> float:
        """Simulated time since power-on [s]."""
        return self.state.tick * TICK

    def pass_time(self, seconds: float) -> None:
        """Let at most `seconds` pass (a tick at least); returns earlier when a status byte waits."""
        left = max(1, round(seconds / TICK))
        while left > 0 and not self.state.head.status.latch.flag:
            left -= self._run(min(left, LONGEST_STRETCH))

    def _run(self, ticks: int) -> int:
        r = self.recorder
        if r is None:
            return advance(self.params, self.state, ticks, *self._no_rows, 0)
        done = advance(self.params, self.state, min(ticks, r.room(self.state.tick)), r.rows, r.picks, r.every)
        if r.room(self.state.tick) <= 0:
            r.flush(self.state.tick)
        return done

    def close(self) -> None:
        """Hand the last rows to the recorder's sink."""
        if self.recorder is not None:
            self.recorder.flush(self.state.tick)
