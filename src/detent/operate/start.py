"""An axis file made live: `detent live`, `detent.live` and `detent.connect` begin here."""

import ctypes
import fcntl
import os
import tempfile
from collections.abc import Sequence
from mmap import mmap
from pathlib import Path
from typing import IO, Any

from detent.errors import AxisError, DetentError
from detent.methods.load import AxisFile, read_axis
from detent.methods.registry import METHODS
from detent.operate.audit import Audit
from detent.operate.channel import Channel, Connection
from detent.operate.client import LiveAxis
from detent.operate.drivers.driver import SIMULATED, driver_of
from detent.operate.host import PERIOD, Host, operation_params
from detent.operate.loop import Board
from detent.operate.opening import channel_of, running_channel, store_path
from detent.operate.session import Session
from detent.operate.store import Store

SPEEDS = 0.1, 10.0
PERIODS = 1e-4, 0.1  # of the loop [s]


def shared_memory() -> tuple[int, mmap]:
    """Memory for a board that processes started from this one can map: a file without a name, that none else opens."""
    if hasattr(os, "memfd_create"):
        file = os.memfd_create("detent board")
    else:
        with tempfile.TemporaryFile() as unnamed:
            file = os.dup(unnamed.fileno())
    os.ftruncate(file, ctypes.sizeof(Board))
    return file, mmap(file, 0)


def motors_of(read: AxisFile, motor: str = "") -> list[str]:
    """Motors of a file that run live: the one that is named, else all of them; of a file with one, "" means it."""
    method = METHODS[read.spec.axis.method]
    motors = list(method.sensors(read.spec)) if method.senses else [""]
    if motor and motor not in motors:
        method.live(read.spec, operation_params(), motor)  # says what there is
    return [""] if len(motors) == 1 else [motor] if motor else motors


def make_host(  # noqa: PLR0913 - a file, and what is chosen of it
    file: Path | str,
    overrides: Sequence[str] = (),
    *,
    motor: str = "",
    speed: float = 1.0,
    wall: bool = True,
    period: float = PERIOD,
    store: Path | str | None = None,
    memory: mmap | None = None,
    drive: str = SIMULATED,
) -> tuple[Host, str]:
    """Host of the axis of a file, simulated or on a drive, and its name.

    `store` is where it keeps what survives, None nowhere.
    """
    if not SPEEDS[0] <= speed <= SPEEDS[1]:
        raise DetentError(
            f"speed {speed:g}: time may pass {SPEEDS[0]:g} to {SPEEDS[1]:g} times as fast; choose between"
        )
    if not PERIODS[0] <= period <= PERIODS[1]:
        raise DetentError(
            f"period {period:g} s: it must be from {PERIODS[0]:g} s to {PERIODS[1]:g} s; choose one between"
        )
    read = read_axis(file, overrides)
    method = METHODS[read.spec.axis.method]
    if not method.lives:
        raise DetentError(f"{file}: the method {method.name} has no operator yet; simulate it with: detent run")
    driver = driver_of(drive)
    if driver is not None and speed != 1.0:
        raise DetentError(f"--drive {drive}: got --speed {speed:g}; expected: none, for a machine keeps its own time")
    chosen: dict[str, Any] = {"motor": motor, "period": period, "speed": speed, "wall": wall, "memory": memory}
    chosen |= {"driver": driver, "stated": driver is None}
    if store is None:
        return Host(method, read.spec, **chosen), read.spec.axis.name
    motors = method.sensors(read.spec)
    one = next(iter(motors)) if not motor and len(motors) == 1 else motor
    if one not in motors:
        method.live(read.spec, operation_params(), motor)  # says what there is
    opened = Store(Path(store) if store else store_path(file, one), motors[one])
    try:
        spec = stand(read, one, opened).spec if driver is None else read.spec
        return Host(method, spec, store=opened, **chosen), read.spec.axis.name
    except BaseException:
        opened.close()
        raise


def stand(read: AxisFile, motor: str, store: Store) -> AxisFile:
    """The simulated axis where its store saw it last; where ``--set`` says another place, it was pushed there."""
    key = METHODS[read.spec.axis.method].begins.replace("*", motor)
    saved, sensor = store.saved, store.sensor
    if saved is None or saved.elsewhere or key in {one.partition("=")[0].strip() for one in read.overrides}:
        return read
    place = sensor.position(saved.counts)
    return read.replaced({key: min(max(place, sensor.ends[0]), sensor.ends[1]) if sensor.ends else place})


def beside(file: Path | str) -> str | None:
    """Where a store lies unless told otherwise: "" beside the axis file; None, nowhere, of a packaged example."""
    examples = Path(__file__).resolve().parents[1] / "examples"
    return None if Path(file).resolve().parent == examples else ""


def live(  # noqa: PLR0913 - as `make_host`
    file: Path | str,
    overrides: Sequence[str] = (),
    *,
    motor: str = "",
    speed: float = 1.0,
    wall: bool = True,
    store: Path | str | None = "",
    period: float = PERIOD,
    drive: str = SIMULATED,
) -> LiveAxis:
    """Run the axis of a file live, in this process.

    Parameters
    ----------
    file : path
        Axis file.
    overrides : sequence of str, optional
        Values in place of those of the file, as ``"method.position_gain=30"``.
    motor : str, optional
        Which motor, of a file with several.
    speed : float, optional
        How fast time passes on the simulated axis, 0.1 to 10.
    wall : bool, optional
        False: time passes only while a command is waited for, as fast as it can.
    store : path, optional
        Where it keeps what survives; by default beside the axis file, of a packaged example nowhere. None: nothing is
        kept, and the axis begins where its file puts it.
    period : float, optional
        Time between two periods of the loop [s]; on a drive its samples.
    drive : str, optional
        What is at the other end of the lines, as ``--drive`` of ``detent live`` takes it; default: the simulated plant.

    Returns
    -------
    LiveAxis
        To be used in a ``with`` block, behind which the axis is at rest and without torque.
    """
    where = beside(file) if store == "" else store
    host, name = make_host(
        file, overrides, motor=motor, speed=speed, wall=wall, store=where, period=period, drive=drive
    )
    if wall:
        host.start()
    else:
        host.run_until_ready()
    return LiveAxis(Session(host, {"name": name, "file": str(file), "simulated": host.link is None, "speed": speed}))


def connect(file: Path | str, motor: str = "") -> LiveAxis:
    """The axis of a file that another process runs live, or the one behind a socket.

    Parameters
    ----------
    file : path
        Axis file that was given to ``detent live``, or the socket that it has printed.
    motor : str, optional
        Which motor, of a file with several that run.

    Returns
    -------
    LiveAxis
        Closing it gives the command back, and stops what it had under way; the axis stays live.
    """
    path = Path(file)
    link = Connection(path if path.suffix == ".sock" else running_channel(path, motor))
    try:
        return LiveAxis(link)
    except DetentError:
        link.close()
        raise


class Place:
    """The right to run an axis, or one motor of a file with several: one process at a time."""

    def __init__(self, file: Path, motor: str = "") -> None:
        self.channel = channel_of(file, motor)
        self._lock: IO[str] = self.channel.with_suffix(".lock").open("a+")
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            self._lock.seek(0)
            who = self._lock.read().strip() or "another process"
            self._lock.close()
            told = f"process {who} runs it live already; end that one, or use: detent connect {file}"
            raise AxisError(f"{file}: {told}") from error
        self._lock.truncate(0)
        self._lock.write(str(os.getpid()))
        self._lock.flush()

    def serve(self, session: Session, audit: Audit | None = None) -> Channel:
        """Open its channel."""
        channel = Channel(session, self.channel, audit)
        channel.start()
        return channel

    def leave(self) -> None:
        """Let others run it."""
        self._lock.close()
