"""The hand-shake of set-points in the profile position mode of CiA 402: one that is reached for, one that waits.

A set-point is taken at the rising edge of bit 4 of the control word, while bit 12 of the status word is 0. With bit 5
it takes the place of the one under way at once; without, it waits until that is reached, and bit 12 stays 1 for as
long as it waits. With bit 6 it is a way from the set-point before it.
"""

NEW, AT_ONCE, RELATIVE, HALT = 0x10, 0x20, 0x40, 0x100  # bits of the control word


class SetPoints:
    """What was asked for; positions in counts."""

    def __init__(self, here: int = 0) -> None:
        self.active: int | None = None  # is reached for
        self.waiting: int | None = None
        self.last = here  # the newest of them
        self.acknowledged = self._new = False

    def control(self, word: int, target: int) -> int | None:
        """A control word; gives the set-point for which a motion begins now."""
        edge, self._new = bool(word & NEW) and not self._new, bool(word & NEW)
        begins: int | None = None
        if edge and not self.acknowledged:
            self.last = target + (self.last if word & RELATIVE else 0)
            self.acknowledged = True
            if self.active is None or word & AT_ONCE:
                self.active, self.waiting, begins = self.last, None, self.last
            else:
                self.waiting = self.last
        self._release()
        return begins

    def reached(self) -> int | None:
        """The motion has ended; gives the set-point for which the next one begins."""
        self.active, self.waiting = self.waiting, None
        self._release()
        return self.active

    def drop(self, here: int) -> None:
        """Nothing is asked for any more: a stop, or no torque."""
        self.active = self.waiting = None
        self.last = here
        self._release()

    def _release(self) -> None:
        if not self._new and self.waiting is None:
            self.acknowledged = False
