"""A drive whose clock the tests step, with its face on a virtual bus and a master that is not ours."""

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import detent
from detent.methods.cascade.host import CascadeHost
from detent.methods.load import read_axis
from detent.operate.channel import Channel
from detent.operate.session import Session
from detent.operate.start import make_host
from detent.planning.profile import Profile
from tests.face_rig import drive_on_virtual

NODE = 5
PATIENCE = 20.0  # of who waits for another thread [s]


class Stepped:
    """The cascade axis, whose periods pass when they are asked to."""

    def __init__(self, folder: Path, *overrides: str) -> None:
        self.file = detent.example("cascade.toml")
        self.host, name = make_host(self.file, overrides, wall=False)
        self.session = Session(self.host, {"name": name, "file": str(self.file), "simulated": True, "speed": 1.0})
        self.channel = Channel(self.session, folder / "axis.sock")
        self.channels = {"": self.channel.path}
        self.state: Any = self.host.axis.state
        self.operation = self.host.board.operation
        self.host.run(1)  # compiles, while nobody waits

    def step(self, periods: int = 1) -> None:
        """Let periods pass; nobody else takes note meanwhile."""
        with self.session._lock:
            self.host.run(periods)

    @contextmanager
    def running(self) -> Iterator[None]:
        """Time passes by itself, while a master waits for what comes of its words."""
        left = threading.Event()

        def run() -> None:
            while not left.wait(5e-4):
                self.step()

        clock = threading.Thread(target=run)
        clock.start()
        try:
            yield
        finally:
            left.set()
            clock.join()

    def until(self, met: Callable[[], object]) -> None:
        """Wait for another thread, while the axis stands still."""
        begin = time.monotonic()
        while not met():
            assert time.monotonic() - begin < PATIENCE, "it did not come"
            time.sleep(2e-5)


@contextmanager
def stepped(folder: Path, *overrides: str) -> Iterator[Stepped]:
    """One, with its channel."""
    axis = Stepped(folder, *overrides)
    axis.channel.start()
    try:
        yield axis
    finally:
        axis.channel.close()
        axis.session.close()


@contextmanager
def master_of(axis: Stepped, bus: str) -> Iterator[tuple[Any, Any]]:
    """A node of canopen's master, operational, and its network."""
    from canopen.profiles.p402 import BaseNode402

    from tests.clients.p402 import patient

    with drive_on_virtual(axis, bus) as (_, network, sheet):  # pyright: ignore[reportArgumentType]
        node: Any = patient(BaseNode402(NODE, sheet))
        network.add_node(node)
        node.nmt.send_command(0x80)
        node.setup_402_state_machine()
        node.nmt.send_command(0x01)
        yield node, network


class Cycle:
    """What a master sends in a period: target and control word in one message, then a SYNC."""

    def __init__(self, axis: Stepped, node: Any, network: Any) -> None:
        self._axis, self._node, self._network = axis, node, network

    def __call__(self, target: int) -> None:
        """One period of positions."""
        rpdo = self._node.rpdo[1]
        rpdo["Controlword"].raw, rpdo["Target position"].raw = 0x0F, target
        self.sent(rpdo.transmit)

    def sent(self, send: Callable[[], object]) -> None:
        """One period, from what is sent in it to its end in the axis."""
        asked = int(self._axis.host.board.inbox.written)
        send()
        self._network.sync.transmit()
        self._axis.until(lambda: self._axis.host.board.inbox.written > asked)
        self._axis.step()


def between(points: NDArray[np.float64], start: float, period: float, samples: int) -> Profile:
    """The same set-points as a reference of `detent run`: straight lines of so many samples, worked out here anew."""
    ends = np.concatenate([[start], points])
    slope = np.diff(ends) / period
    bend = np.diff(slope, prepend=slope[0]) / period
    parts = np.arange(1, samples + 1) / samples
    place = ends[:-1, None] + np.diff(ends)[:, None] * parts
    place[:, -1] = points
    return Profile(period / samples, place.ravel(), np.repeat(slope, samples), np.repeat(bend, samples))


def following_errors(profile: Profile, samples: int, before: int) -> NDArray[np.float64]:
    """Following error at the end of each period of a run that has stood for so many samples before."""
    host = CascadeHost(read_axis(detent.example("cascade.toml")).spec)
    host.pass_samples(before)
    host.follow(profile)
    rows = host.watch(profile.count)
    return rows["controller.law.position_error"][samples - 1 :: samples].copy()
