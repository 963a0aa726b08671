"""Signals of a method: asked for while somebody looks, and not longer."""

import asyncio
import base64
import math
from typing import Any

import numpy as np
from tests.fake_axis import FakeLine, service

from detent.errors import DetentError
from detent.faces.signals import Signals

CHANNELS = [{"name": f"law.c{k}", "unit": "m", "help": f"number {k}"} for k in range(10)]


class Ring(FakeLine):
    """A line whose ring has room for eight."""

    def __init__(self, **about: Any) -> None:
        super().__init__(**about)
        self.watched_channels: list[list[str]] = []
        self.asked_rows = 0

    async def ask(self, message: dict[str, Any], tell: Any = None) -> Any:
        """Answer a message."""
        if message["do"] == "watch":
            if len(message.get("channels", ())) > 8:
                raise DetentError("must be 8 or fewer")
            self.watched_channels.append(message["channels"])
            return {}
        if message["do"] == "scope":
            self.asked_rows += 1
            rows = np.array([[k, k + 0.5] for k in range(len(message["channels"]))], "<f8")
            return {"scope": {"data": base64.b64encode(rows.tobytes()).decode()}}
        return await super().ask(message, tell)


async def turn(axis: Any, line: Ring, times: int = 3) -> None:
    """Samples come."""
    for _ in range(times):
        line.status["loop"]["periods"] += 1
        axis._take({"status": line.status | {"loop": dict(line.status["loop"])}})
        for _ in range(10):
            await asyncio.sleep(0)


def test_only_what_is_looked_at_is_asked_for() -> None:
    async def work() -> None:
        axis, plain = service(channels=CHANNELS)
        line = Ring(channels=CHANNELS)
        line.status, axis._line = plain.status, line  # type: ignore[assignment]
        told: dict[str, tuple[float, str]] = {}

        async def tell(channel: str, value: float, wrong: str) -> None:
            told[channel] = value, wrong

        signals = Signals(axis, tell)
        following = asyncio.ensure_future(signals.follow())
        await turn(axis, line)
        assert (line.watched_channels, line.asked_rows) == ([], 0)
        for k in range(10):
            signals.look(f"law.c{k}", "me")
        await turn(axis, line)
        assert line.watched_channels == [[f"law.c{k}" for k in range(8)]]
        assert told["law.c3"] == (3.5, "")  # the newest row
        assert math.isnan(told["law.c9"][0])
        assert told["law.c9"][1] == "must be 8 or fewer"
        signals.look("law.c0", "you")
        for k in range(10):
            signals.leave(f"law.c{k}", "me")
        await turn(axis, line)
        assert line.watched_channels[-1] == ["law.c0"]
        signals.leave("law.c0", "you")
        signals.leave("law.c0", "nobody")
        await turn(axis, line)
        assert line.watched_channels[-1] == []
        asked = line.asked_rows
        await turn(axis, line)
        assert line.asked_rows == asked
        assert signals.name_of("law.c0") == ":law:c0"
        following.cancel()

    asyncio.run(work())
