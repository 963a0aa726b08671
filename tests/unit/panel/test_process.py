"""The process of the panel, run in this one: where it listens, what it answers, when it ends."""

import asyncio
import io
import json
import os
import socket
import sys
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
from tests.live_bench import Bench

from detent.operate.channel import Channel
from detent.operate.session import Session
from detent.panel.__main__ import listen, serve
from detent.panel.keys import make_keys


def told(port: int, folder: Path) -> dict[str, Any]:
    """What the process is told on its standard input."""
    return {"channel": str(folder / "axis.sock"), "keys": make_keys(), "port": port, "names": [], "plain": False,
            "addresses": ["127.0.0.1"], "certificate": "", "key_file": ""}  # fmt: skip


def test_it_tells_its_port_and_ends_with_whoever_started_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    channel = Channel(Session(Bench("cascade").host, {"name": "axis"}), tmp_path / "axis.sock")
    channel.start()
    ours, theirs = os.pipe()
    said = io.StringIO()
    monkeypatch.setattr(sys, "stdout", said)
    with os.fdopen(ours) as stdin, closing(channel):
        monkeypatch.setattr(sys, "stdin", stdin)
        os.close(theirs)
        asyncio.run(serve(told(0, tmp_path)))
    assert 1024 <= json.loads(said.getvalue())["port"] < 1 << 16


def test_a_port_that_is_taken_is_the_answer(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    said = io.StringIO()
    monkeypatch.setattr(sys, "stdout", said)
    with socket.create_server(("127.0.0.1", 0)) as taken:
        asyncio.run(serve(told(taken.getsockname()[1], tmp_path)))
    assert "in use" in json.loads(said.getvalue())["error"]


def test_an_address_that_this_machine_has_not_is_left_out_behind_the_first() -> None:
    (only,) = listen(["127.0.0.1", "192.0.2.1"], 0)  # of the addresses for documentation
    only.close()
    with pytest.raises(OSError, match="assign"):
        listen(["192.0.2.1"], 0)
