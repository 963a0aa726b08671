import asyncio
import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from detent.errors import AxisError
from detent.operate.line import Line
from detent.panel.keys import Keys, Pass, make_keys
from detent.panel.sockets import MOST_WAITING, Sockets

WHO = Pass("operator", "0123456789", 0.0)


class Page:
    """A socket of a page: what it says, and what it hears."""

    def __init__(self, *said: dict[str, Any]) -> None:
        self._said, self.heard = [*said], list[dict[str, Any]]()
        self.client, self.scope = SimpleNamespace(host="127.0.0.1"), {"pass": WHO}

    async def receive(self) -> dict[str, Any]:
        if not self._said:
            return {"type": "websocket.disconnect"}
        return {"type": "websocket.receive", "text": json.dumps(self._said.pop(0))}

    async def send_text(self, text: str) -> None:
        self.heard.append(json.loads(text))


class Axis:
    """The panel's own line: it answers, and tells the ending."""

    def __init__(self, *, gone: bool = False) -> None:
        self.asked, self._gone = list[dict[str, Any]](), gone

    async def ask(self, message: dict[str, Any], tell: Any) -> dict[str, Any]:
        if self._gone:
            raise AxisError("the live axis does not answer")
        self.asked.append(message)
        tell({"ended": {"id": 9}})
        return {"as": "line 4", "id": 9}


async def hear(page: Page, axis: Axis, waiting: int = 0) -> list[bytes]:
    """Let an operator's page say its words; what went to the page's own connection."""
    sent: list[bytes] = []
    writer: Any = SimpleNamespace(write=sent.append, transport=SimpleNamespace(get_write_buffer_size=lambda: waiting))
    sockets = Sockets(Path("axis.sock"), Keys(make_keys()))
    sockets.line = axis  # type: ignore[assignment]
    await sockets._to_axis(page, writer, WHO)  # type: ignore[arg-type]
    await asyncio.sleep(0)
    return sent


def test_a_stop_does_not_wait_for_what_its_page_has_asked_before() -> None:
    page, axis = Page({"do": "enable", "as": 1}, {"do": "stop", "as": 2}, {"do": "disable"}), Axis()
    sent = asyncio.run(hear(page, axis, MOST_WAITING + 1))
    assert sent == []
    assert axis.asked == [{"do": word, "who": "operator 012345 from 127.0.0.1"} for word in ("stop", "disable")]
    assert "busy" in page.heard[0]["error"]
    assert {"as": 2, "id": 9} in page.heard
    assert page.heard.count({"ended": {"id": 9}}) == 2


def test_commands_go_over_the_connection_of_their_page() -> None:
    page, axis = Page({"do": "move_to", "value": "5 mm", "as": 1, "who": "somebody else"}), Axis()
    sent = asyncio.run(hear(page, axis))
    assert [json.loads(line) for line in sent] == [{"do": "move_to", "value": "5 mm", "as": 1}]
    assert (axis.asked, page.heard) == ([], [])


def test_a_stop_that_the_axis_does_not_answer_is_told() -> None:
    page = Page({"do": "stop", "as": 5})
    asyncio.run(hear(page, Axis(gone=True)))
    assert page.heard == [{"as": 5, "error": "the live axis does not answer"}]


def test_an_ending_that_comes_with_its_answer_is_not_missed() -> None:
    async def ask() -> list[dict[str, Any]]:
        ended: list[dict[str, Any]] = []
        reader, sent = asyncio.StreamReader(), list[bytes]()
        line = Line(reader, SimpleNamespace(write=sent.append, close=lambda: None))  # type: ignore[arg-type]
        asking = asyncio.ensure_future(line.ask({"do": "stop"}, ended.append))
        await asyncio.sleep(0)
        mark = json.loads(sent[0])["as"]
        for message in ({"as": mark, "id": 3}, {"ended": {"id": 3}}, {"ended": {"id": 4}}):
            reader.feed_data(json.dumps(message).encode() + b"\n")
        assert (await asking)["id"] == 3
        line.close()
        assert line._tell == {}
        return ended

    assert asyncio.run(ask()) == [{"ended": {"id": 3}}]
