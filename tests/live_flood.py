"""A client that floods a panel, in a process of its own: `python -m tests.live_flood BASE COOKIES MARK KIND`."""

import json
import sys
import threading
from contextlib import suppress
from random import Random
from typing import Any

import httpx
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

RNG = Random(52)


def malformed() -> str | bytes:
    """What no page would send."""
    return RNG.choice(["{", "[" * 5000, '{"do": 1}', '{"do": "jog", "as": []}', RNG.randbytes(300), "null", "\0"])


def flood(base: str, cookies: dict[str, str], mark: str, kind: str) -> int:
    """Send until nobody listens any more, coming back whenever the panel closes it; gives how many."""
    sent, address, ending = 0, base.replace("http", "ws", 1) + "/ws", threading.Event()
    threading.Thread(target=lambda: (sys.stdin.read(), ending.set()), daemon=True).start()
    more: Any = {"Cookie": "; ".join(f"{name}={value}" for name, value in cookies.items())}
    with httpx.Client(base_url=base, cookies=cookies, headers={"x-csrf-token": mark, "origin": base}) as client:
        while not ending.is_set() or sent < 1000:
            ticket = client.post("/api/ticket").text
            dialled = connect(address, origin=base, additional_headers=more, max_queue=None)  # type: ignore[arg-type]
            with suppress(ConnectionClosed, OSError), dialled as ws:
                ws.send(ticket)
                ws.recv()
                for _ in range(5000):
                    ws.send(malformed() if kind == "malformed" else '{"do": "confirm"}')
                    sent += 1
                ws.socket.sendall(RNG.randbytes(100))  # no frame at all
    return sent


if __name__ == "__main__":
    print("floods", flush=True)  # noqa: T201 - whoever has started it waits for it
    told = {"sent": flood(sys.argv[1], json.loads(sys.argv[2]), sys.argv[3], sys.argv[4])}
    print(json.dumps(told))  # noqa: T201
