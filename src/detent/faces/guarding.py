"""Node guarding of CiA 301: a master asks by a remote frame, the node answers with its state and a bit that toggles.

Both look after the other: a master that asks no more is gone when its guard time (100C) times the life time factor
(100D) has passed since it last did. It is the older way; a node that sends a heartbeat (1017) answers none.
"""

import time
from collections.abc import Callable
from typing import Any

import can
from canopen.nmt import NMT_STATES

GUARD_TIME, LIFE_TIME_FACTOR, HEARTBEAT_TIME = 0x100C, 0x100D, 0x1017
ANSWER = 0x700  # identifier
TOGGLE = 0x80
_CODES = {name: code for code, name in NMT_STATES.items()}


class Guarding(can.Listener):
    """The side of the node; its messages come in the thread of the bus."""

    def __init__(self, node: Any, clock: Callable[[], float] = time.monotonic) -> None:
        self._node, self._clock = node, clock
        self._toggle, self._asked = 0, 0.0  # bit of the next answer; when it was last asked, 0 never

    def _number(self, index: int) -> int:
        return int.from_bytes(self._node.get_data(index, 0), "little")

    def on_message_received(self, msg: can.Message) -> None:
        """Answer, where it is asked."""
        node = self._node
        if msg.is_remote_frame and msg.arbitration_id == ANSWER + node.id and not self._number(HEARTBEAT_TIME):
            self._asked = self._clock()
            node.network.send_message(ANSWER + node.id, [self._toggle | _CODES[node.nmt.state]])
            self._toggle ^= TOGGLE

    def begin_anew(self) -> None:
        """The communication was reset."""
        self._toggle, self._asked = 0, 0.0

    def is_lost(self) -> bool:
        """True once where a master has asked, and asks no more; until it asks again nobody is waited for."""
        life = self._number(GUARD_TIME) * 1e-3 * self._number(LIFE_TIME_FACTOR)
        lost = self._asked > 0.0 and 0.0 < life < self._clock() - self._asked
        if lost:
            self._asked = 0.0
        return lost
