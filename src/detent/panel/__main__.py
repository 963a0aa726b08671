"""The panel as a process: it reads what it is told on its standard input, and ends when that closes."""

import asyncio
import contextlib
import json
import socket
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import uvicorn
from uvicorn.protocols.http.h11_impl import H11Protocol

from detent.operate.realtime import going_first
from detent.panel.app import Panel
from detent.panel.gate import Here, Strangers, local_names
from detent.panel.keys import Keys
from detent.panel.sockets import LONGEST_FRAME

AT_ONCE = 1 << 14  # bytes that are read of one connection before others have their turn


def listen(addresses: Sequence[str], port: int) -> list[socket.socket]:
    """Sockets on one port of each address; one behind the first that this machine has not is left out."""
    found: list[socket.socket] = []
    for address in addresses:
        family = socket.AF_INET6 if ":" in address else socket.AF_INET
        try:
            one = socket.create_server((address, port), family=family)
        except OSError:
            if not found:
                raise
            continue
        # What is accepted inherits it; asyncio leaves it out where a socket was not made for TCP by name. Without it a
        # small message waits 40 ms for the acknowledgement of the one before it.
        one.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        one.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, AT_ONCE)
        port = one.getsockname()[1]
        found.append(one)
    return found


def watched(strangers: Strangers) -> type[H11Protocol]:
    """The protocol of a connection, by which whoever has not shown a link is counted."""

    class Watched(H11Protocol):
        def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
            super().connection_made(transport)
            strangers.come(self.client, transport)

        def connection_lost(self, exc: Exception | None) -> None:
            strangers.let_in(self.client)
            super().connection_lost(exc)

    return Watched


def make_server(told: dict[str, Any]) -> tuple[uvicorn.Server, list[socket.socket], Panel]:
    """A server, what it listens on, and what it serves."""
    tls = {"ssl_certfile": told["certificate"], "ssl_keyfile": told["key_file"]} if told["certificate"] else {}
    sockets = listen(told["addresses"], told["port"])
    port = sockets[0].getsockname()[1]
    here = Here("https" if tls else "http", local_names([s.getsockname()[0] for s in sockets], port, told["names"]))
    panel = Panel(Path(told["channel"]), Keys(told["keys"]), here, plain=told["plain"])
    config = uvicorn.Config(
        panel.app(), log_level="warning", access_log=False, proxy_headers=False, server_header=False, lifespan="on",
        ws="websockets-sansio", http=watched(panel.strangers), ws_max_size=LONGEST_FRAME, ws_per_message_deflate=False,
        ws_ping_interval=5.0, ws_ping_timeout=5.0, timeout_graceful_shutdown=1, **tls,
    )  # fmt: skip
    config.load()  # the certificate, too
    return uvicorn.Server(config), sockets, panel


async def serve(told: dict[str, Any]) -> None:
    """Serve until told to end."""
    try:
        server, sockets, panel = make_server(told)
    except OSError as error:
        sys.stdout.write(json.dumps({"error": error.strerror or str(error)}))
        return
    ending = asyncio.ensure_future(_until_told(server, panel))
    sys.stdout.write(json.dumps({"port": sockets[0].getsockname()[1]}) + "\n")
    sys.stdout.flush()
    await server.serve(sockets=sockets)
    ending.cancel()


async def _until_told(server: uvicorn.Server, panel: Panel) -> None:
    """End when whoever started this, or the axis, has gone."""
    reader = asyncio.StreamReader()
    await asyncio.get_running_loop().connect_read_pipe(lambda: asyncio.StreamReaderProtocol(reader), sys.stdin)
    closed = asyncio.ensure_future(reader.read())
    while not closed.done() and not (panel.line and panel.line.gone.is_set()):
        await asyncio.wait([closed], timeout=0.2)
    server.should_exit = True


if __name__ == "__main__":
    with contextlib.suppress(KeyboardInterrupt), going_first():
        asyncio.run(serve(json.loads(sys.stdin.readline())))
