"""A line to an axis that is none: it goes where it is told at once, and answers as a live one does."""

import asyncio
from collections.abc import Callable, Sequence
from typing import Any

from detent.errors import REFUSAL_TEXT
from detent.faces.service import AxisService

ABOUT: dict[str, Any] = {
    "name": "fake axis", "method": "cascade", "unit": "m", "count": 1e-6, "origin": 0.0, "limits": [0.0, 0.5],
    "max_speed": 0.5, "acceleration": 5.0, "simulated": True, "channels": [], "period": 1e-3,
    "commands": ["enable", "disable", "stop", "reset", "move_to", "move_by", "jog", "home", "selector"],
}  # fmt: skip


class FakeLine:
    """The client's side of the channel; `refuse` is why all but stop and disable are refused, 0 they are not."""

    def __init__(self, **about: Any) -> None:
        self.about = ABOUT | about
        self.gone, self.watched = asyncio.Event(), None
        self.refuse, self.asked, self._id = 0, list[str](), 0
        self.status: dict[str, Any] = {
            "state": "switch on disabled", "position": 0.02, "commanded": 0.02, "velocity": 0.0, "error": 0.0,
            "effort": 0.0, "rests": True, "in_window": True, "at_end": "", "trust": "referenced", "confirmed": True,
            "fault": None, "running": None, "client": 0, "ready": True, "selector": "both", "limited": False,
            "loop": {"periods": 100},
        }  # fmt: skip

    async def ask(self, message: dict[str, Any], tell: Callable[[dict[str, Any]], object] | None = None) -> Any:
        """Answer a message; a command ends in the next turn of the loop."""
        word, value = message["do"], message.get("value")
        if word == "status":
            return {"status": self.status | {"loop": dict(self.status["loop"])}}
        if word in ("keep", "watch", "name"):
            return {"id": 0}
        self._id, code = self._id + 1, self.refuse if word not in ("stop", "disable", "leave") else 0
        self.asked.append(word)
        if not code:
            self._do(word, value)
        text = REFUSAL_TEXT.get(code, "").partition("; ")
        ended = {
            "id": self._id, "how": "refused" if code else "done", "code": code, "reason": text[0], "remedy": text[2],
        }  # fmt: skip
        if tell is not None:
            asyncio.get_running_loop().call_soon(tell, {"ended": ended})
        return {"id": self._id}

    def _do(self, word: str, value: Any) -> None:
        s = self.status
        s["loop"]["periods"] += 1
        if word in ("move_to", "move_by"):
            far = 0.0 if isinstance(value, str) else value
            s["position"] = s["commanded"] = far + (s["commanded"] if word == "move_by" else 0.0)
        elif word == "home":
            s["position"] = s["commanded"] = 0.01
        elif word in ("enable", "disable"):
            s["state"] = "operation enabled" if word == "enable" else "switch on disabled"
        elif word == "reset":
            s["fault"] = None
        elif word == "selector":
            s["selector"] = value

    def close(self) -> None:
        """Leave."""
        self.gone.set()


def service(motor: str = "", *, commands: bool = True, **about: Any) -> tuple[AxisService, FakeLine]:
    """A client of such an axis, inside a running loop."""
    line = FakeLine(**about)
    axis = AxisService(line, line.about, motor, commands=commands)  # type: ignore[arg-type]
    axis._take({"status": line.status, "you": 1})
    return axis, line


class Heard:
    """A conversation in a dialect, by the bytes that come; `axis` and `line` are those of the first motor."""

    def __init__(self, dialect: Callable[..., Any], motors: Sequence[str] = ("",), **more: Any) -> None:
        from detent.faces.talk import Reader

        pairs = [service(motor, **more) for motor in motors]
        self.axis, self.line = pairs[0]
        self.lines = [line for _, line in pairs]
        self.said = bytearray()
        self.talk = dialect(tuple(axis for axis, _ in pairs), self.said.extend)
        self._answer, self._busy = self.talk.answer, 0
        self.talk.answer = self._answering
        self.reader = Reader(self.talk)
        self.said.clear()

    async def _answering(self, line: str) -> None:
        self._busy += 1
        try:
            await self._answer(line)
        finally:
            self._busy -= 1

    async def hear(self, data: bytes, turns: int = 20) -> str:
        """What is answered to these bytes."""
        self.said.clear()
        self.reader.take(data)
        idle, left = 0, 100_000
        while idle < turns:  # a start of a motion looks once in two milliseconds
            await asyncio.sleep(0)
            left -= 1
            assert left, "it waits for something that does not come"
            idle = 0 if self.reader._lines.qsize() or self._busy else idle + 1
            assert idle or not self.reader._working.done(), "the line is dead"
        assert not self.reader._working.done(), "the line is dead"
        return self.said.decode("latin-1")

    async def close(self) -> None:
        """Nothing more comes."""
        self.reader.close()
        others = asyncio.all_tasks() - {asyncio.current_task()}
        for task in others:
            task.cancel()
        await asyncio.gather(*others, return_exceptions=True)
