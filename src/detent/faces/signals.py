"""What a method shows on its scope, for protocols whose clients subscribe: only what somebody looks at is asked for.

The ring of the loop holds eight registers of the axis for all who look, the panel among them. What finds no place is
told to be without a value, and tried again.
"""

import asyncio
import base64
import math
from collections.abc import Awaitable, Callable
from contextlib import suppress

import numpy as np

from detent.errors import DetentError
from detent.faces.service import RATE, AxisService

AGAIN = 1.0  # what found no place is tried again after so long [s]
PATIENCE = 1.0  # how long somebody who looks once waits [s]
Tell = Callable[[str, float, str], Awaitable[None]]


class Signals:
    """Channels by their names; `tell` hears name, value, what is wrong with it, also where nothing is new."""

    def __init__(self, axis: AxisService, tell: Tell) -> None:
        self.axis, self._tell = axis, tell
        self.units: dict[str, str] = {one["name"]: one["unit"] for one in axis.about["channels"]}
        self.about: dict[str, str] = {one["name"]: one["help"] for one in axis.about["channels"]}
        self._looked: dict[str, set[object]] = {}  # by whom, in the order in which they came
        self._held: tuple[str, ...] = ()
        self._without: dict[str, str] = {}  # why what is looked at has no value
        self._tried = -AGAIN
        self._changed, self._fresh = asyncio.Event(), asyncio.Event()
        axis.subscribe(self._fresh.set)

    def name_of(self, channel: str) -> str:
        """Name of a channel behind that of its record: EPICS has colons where the registers have dots."""
        return ":" + channel.replace(".", ":")

    def look(self, channel: str, who: object) -> None:
        """Somebody looks at a channel from now on."""
        self._looked.setdefault(channel, set()).add(who)
        self._changed.set()

    def leave(self, channel: str, who: object) -> None:
        """No more."""
        if who in (lookers := self._looked.get(channel, set[object]())):
            lookers.discard(who)
            if not lookers:
                del self._looked[channel]
            self._changed.set()

    async def once(self, channel: str) -> tuple[float, str]:
        """A channel now: its value, and what is wrong with it."""
        who = object()
        self.look(channel, who)
        try:
            async with asyncio.timeout(PATIENCE):
                while channel not in self._without:
                    if channel in self._held and (found := await self._values((channel,))):
                        return found[channel], ""
                    await asyncio.sleep(1 / RATE)
            return math.nan, self._without[channel]
        except TimeoutError:
            return math.nan, "no value has come in time"
        finally:
            self.leave(channel, who)

    async def follow(self) -> None:
        """Tell what is looked at for every sample that is shown, fifty times a second at most."""
        loop = asyncio.get_running_loop()
        while not self.axis.gone.is_set():
            if not self._looked and not self._held:
                await self._changed.wait()
            await self._fresh.wait()
            self._fresh.clear()
            again = self._without and loop.time() - self._tried > AGAIN
            if self._changed.is_set() or again:
                self._changed.clear()
                self._tried = loop.time()
                await self._choose()
            for channel, value in (await self._values(self._held)).items():
                await self._tell(channel, value, "")
            for channel, why in self._without.items():
                await self._tell(channel, math.nan, why)

    async def _choose(self) -> None:
        """Let the ring hold what is looked at, who came first before who came later."""
        wanted, self._without = [*self._looked], dict[str, str]()
        while True:
            try:
                await self.axis.show(wanted)
            except DetentError as error:
                if not wanted:
                    raise
                self._without[wanted.pop()] = str(error)
            else:
                self._held = tuple(wanted)
                return

    async def _values(self, channels: tuple[str, ...]) -> dict[str, float]:
        """The newest row."""
        if not channels:
            return {}
        with suppress(DetentError):  # the ring does not hold it any more
            told = await self.axis.newest(channels)
            columns = np.frombuffer(base64.b64decode(told["data"]), "<f8").reshape(len(channels), -1)
            if columns.shape[1]:
                return dict(zip(channels, map(float, columns[:, -1]), strict=True))
        return {}
