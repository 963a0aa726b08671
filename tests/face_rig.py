"""`detent live` with faces, for clients of other people."""

import asyncio
import os
import select
import shutil
import socket
import subprocess
import threading
import tty
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest

import detent
from detent.axisfile.tables import FacesTable
from tests import foreign
from tests.live_processes import STARTED, Running

FACE_KEYS = {f"faces.{name}" for name in FacesTable.model_fields}  # which no register hears
PERIOD = "10 ms"  # of the loop: this machine has no real-time priority, and two processors for all


class Faced(Running):
    """An axis that runs, and where its faces are."""

    def place(self, face: str, number: int = 0) -> str:
        """What is printed of a face."""
        return self.started["faces"][face][number]

    @property
    def channels(self) -> dict[str, Path]:
        """Of each motor that runs."""
        axes = self.started.get("axes", {"": self.started})
        return {motor: Path(one["channel"]) for motor, one in axes.items()}

    def port(self, face: str) -> str:
        """Port of a face that listens on TCP."""
        return next(place for place in self.started["faces"][face] if "::" not in place).rpartition(":")[2]

    def process_of(self, face: str) -> int:
        """Process of a face."""
        return self.started["face_processes"][face]


@contextmanager
def faced(
    folder: Path, *options: str, example: str = "cascade.toml", commands: bool = True, more: Sequence[str] = ()
) -> Iterator[Faced]:
    """`detent live` on a copy of an example, with options that ask for faces."""
    file = folder / example
    shutil.copy(detent.example(example), file)
    folder.chmod(0o700)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_RUNTIME_DIR", str(folder))
        words = ["--period", PERIOD, "--no-store", *options, *(["--commands"] if commands else []), *more]
        live = Faced(file, *words)
        STARTED.remove(live.process)
        try:
            yield live
        finally:
            live.process.terminate()
            try:
                live.process.communicate(timeout=15)
            except subprocess.TimeoutExpired:
                live.process.kill()
                live.process.communicate()


def connected(live: Faced, motor: str = "") -> Any:
    """A client of detent's own, to see what happens, and to command beside."""
    return detent.connect(live.channels[motor])


def free_port() -> int:
    """A port that nobody has now, nor as one of datagrams, nor the one behind it, where PV Access hears searches."""
    while True:
        with socket.socket() as one, ExitStack() as others:
            one.bind(("127.0.0.1", 0))
            port = one.getsockname()[1]
            with suppress(OSError, OverflowError):
                for beside in (port, port + 1):
                    other = others.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
                    other.bind(("0.0.0.0", beside))  # noqa: S104 - to see that it can be had
                return port


@contextmanager
def repeater() -> Iterator[None]:
    """Somebody else's repeater of Channel Access, so that no client leaves one of its own behind."""
    quiet = {"stdin": subprocess.DEVNULL, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    process = subprocess.Popen([str(foreign.environment("epics").parent / "caproto-repeater")], **quiet)
    try:
        yield
    finally:
        process.terminate()
        process.wait()


def listening(*processes: int) -> set[tuple[str, str]]:
    """Addresses at which processes listen, or take datagrams, from /proc/net: protocol and address with port."""
    inodes: set[str] = set()
    for process in processes:
        for link in Path(f"/proc/{process}/fd").iterdir():
            try:
                target = str(link.readlink())
            except OSError:
                continue
            if target.startswith("socket:["):
                inodes.add(target[8:-1])
    found: set[tuple[str, str]] = set()
    for kind, waits in (("tcp", "0A"), ("tcp6", "0A"), ("udp", "07"), ("udp6", "07")):
        for line in Path(f"/proc/net/{kind}").read_text(encoding="ascii").splitlines()[1:]:
            words = line.split()
            if words[9] in inodes and words[3] == waits:
                found.add((kind, words[1]))
    return found


def family(process: int) -> list[int]:
    """A process and all that it has started."""
    children = Path(f"/proc/{process}/task/{process}/children").read_text(encoding="ascii").split()
    return [process, *(one for child in children for one in family(int(child)))]


@contextmanager
def wire() -> Iterator[tuple[str, str]]:
    """A serial line between two terminals."""
    ours, theirs = zip(*(os.openpty() for _ in range(2)), strict=True)
    for end in theirs:
        tty.setraw(end)
    left = threading.Event()

    def carry() -> None:
        while not left.is_set():
            for end in select.select(ours, [], [], 0.05)[0]:
                os.write(ours[1 - ours.index(end)], os.read(end, 4096))

    carrier = threading.Thread(target=carry)
    carrier.start()
    try:
        yield os.ttyname(theirs[0]), os.ttyname(theirs[1])
    finally:
        left.set()
        carrier.join()
        for end in (*ours, *theirs):
            os.close(end)


@contextmanager
def drive_on_virtual(live: Faced, channel: str, *, commands: bool = True) -> Iterator[tuple[Any, Any, str]]:
    """The face of a CiA 402 drive in this process, where python-can's virtual bus is; its node, a network, its EDS."""
    canopen = pytest.importorskip("canopen")
    from detent.faces import node402
    from detent.faces.service import Desk

    loop = asyncio.new_event_loop()
    thread = threading.Thread(target=loop.run_forever, daemon=True)
    thread.start()
    desk = Desk(live.channels, "canopen", commands)
    network = canopen.Network()
    network.connect(interface="virtual", channel=channel)
    try:
        places = asyncio.run_coroutine_threadsafe(node402.serve(desk, f"virtual:{channel}@5"), loop).result(60)
        yield desk, network, places[2].removeprefix("EDS ")
    finally:
        network.disconnect()
        if desk.server is not None:
            desk.server.disconnect()

        async def leave() -> None:
            desk.close()
            others = asyncio.all_tasks() - {asyncio.current_task()}
            for task in others:
                task.cancel()
            await asyncio.gather(*others, return_exceptions=True)

        asyncio.run_coroutine_threadsafe(leave(), loop).result(60)
        loop.call_soon_threadsafe(loop.stop)
        thread.join()
        loop.close()
