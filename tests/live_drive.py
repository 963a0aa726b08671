"""A cascade axis on a CiA 402 drive: the drive is detent's own face before the amplifier and mechanics of the file."""

import os
import select
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from typing import Any

import canopen

from detent.errors import AxisError
from detent.faces.cia402 import Drive, drive_of
from detent.methods.cascade.led import LedCascade, led_wiring
from detent.methods.cascade.wired import CascadeMachine, wiring
from detent.methods.load import load_spec
from detent.methods.method import Plant
from detent.operate.drivers.canopen_drive import HEARTBEAT, CanopenDrive
from tests.acceptance.test_golden_bits import EXAMPLES
from tests.live_bench import Bench

FILE = EXAMPLES / "cascade.toml"
NODE = 5
__all__ = ["HEARTBEAT"]
IDENTITY = (0x2A, 1, 3, 7)
HARDWARE = 'hardware.id="canopen 0x2a.0x1.0x3.0x7"'
SAMPLE = 0.25e-3  # of the example [s]
RATED = 2.8  # torque of the example's motor at its largest command [N*m]


@contextmanager
def drive(channel: str, **more: Any) -> Iterator[Drive]:
    """A drive on a virtual bus of this process."""
    with joined(drive_of(FILE, NODE, **{"identity": IDENTITY, "rated": RATED, **more}), channel) as made:
        yield made


@contextmanager
def joined(made: Drive, channel: str) -> Iterator[Drive]:
    """A drive as a node of a virtual bus."""
    network = canopen.Network()
    network.NOTIFIER_CYCLE = 0.01
    network.connect(interface="virtual", channel=channel)
    made.join(network)
    try:
        yield made
    finally:
        if network.bus is not None:
            network.disconnect()


@contextmanager
def driven(address: str, *overrides: str) -> Iterator[Bench]:
    """The controller of the example on a drive, exchange by exchange: what is told waits for what is answered."""
    bench = Bench("cascade", *(overrides or [HARDWARE]), driver=CanopenDrive(address, 5.0), period=SAMPLE)
    try:
        yield bench
    finally:
        bench.host.close()


@contextmanager
def wire() -> Iterator[tuple[str, str]]:
    """Two terminals, what is written to one comes from the other: a serial line without a machine."""
    pairs = [os.openpty(), os.openpty()]
    left = threading.Event()

    def carry() -> None:
        masters = [master for master, _ in pairs]
        while not left.is_set():
            for ready in select.select(masters, [], [], 0.05)[0]:
                os.write(masters[1 - masters.index(ready)], os.read(ready, 4096))

    thread = threading.Thread(target=carry)
    thread.start()
    try:
        yield os.ttyname(pairs[0][1]), os.ttyname(pairs[1][1])
    finally:
        left.set()
        thread.join()
        for pair in pairs:
            for end in pair:
                os.close(end)


def still_drive(channel: str, mode: str = "torque", **more: Any) -> AbstractContextManager[Drive]:
    """The same before a machine that does not move: nothing is compiled for it."""
    state = CascadeMachine() if mode == "torque" else LedCascade()
    return joined(Drive(Plant(state, state, lambda: None), machine_wiring(mode), NODE, **more), channel)


SERVED = """
import sys, threading
from detent.errors import AxisError
from detent.faces.cia402 import serve
left = threading.Event()
threading.Thread(target=lambda: (sys.stdin.read(), left.set()), daemon=True).start()
serve(sys.argv[1], sys.argv[2], left, identity=(0x2A, 1, 3, 7), rated=2.8)
"""


@contextmanager
def served(address: str) -> Iterator[None]:
    """The drive in a process of its own."""
    process = subprocess.Popen([sys.executable, "-c", SERVED, str(FILE), address], stdin=subprocess.PIPE)
    try:
        yield
    finally:
        assert process.stdin is not None
        process.stdin.close()
        assert process.wait(timeout=60) == 0


def open_late(address: str) -> CanopenDrive:
    """A driver whose drive may still be starting."""
    for _ in range(100):
        found = CanopenDrive(address, 5.0)
        with suppress(AxisError):
            found.open(machine_wiring(found.mode))
            found.close()
            break
    return CanopenDrive(address, 5.0)


def machine_wiring(mode: str = "torque") -> Any:
    """The lines of the example."""
    spec = load_spec(FILE, ())
    return wiring(spec) if mode == "torque" else led_wiring(spec, mode)
