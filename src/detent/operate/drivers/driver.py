"""What a driver is, how one is chosen, and what holds it at the wires of a loop.

A driver has the lines as its drive has them: `open`, `read`, `write`, `close`, and the facts that a person needs before
it moves anything. It knows no loop; `Link` hands it what the controller says, and hands over what it has heard,
together with why the axis may not be enabled. The plant of the file needs none: the loop's own tick goes through it.
"""

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from operator import attrgetter
from typing import Any, Protocol

from detent.control.axis_states import FAULT, FAULT_REACTION
from detent.control.operation import UNREADY
from detent.errors import OTHER_HARDWARE, DetentError
from detent.methods.method import Wiring
from detent.operate.wires import Ends

DRIVERS = {
    "canopen": "detent.operate.drivers.canopen_drive:CanopenDrive",
    "serial": "detent.operate.drivers.serial_drive:SerialDrive",
}
SIMULATED = "sim"
STALE = 0.1  # time in which the loop must have said something, or the drive loses its enable [s]


@dataclass(frozen=True, slots=True)
class Fact:
    """What a person should know of a drive before it moves; a caution is what looks wrong about it."""

    name: str
    value: str
    caution: str = ""

    def __str__(self) -> str:
        """In a line."""
        return f"{self.name}: {self.value}" + (f"; {self.caution}" if self.caution else "")


class Driver(Protocol):
    """The lines of one motor as its drive has them."""

    mode: str  # what it is told, as in `Wiring`
    hardware: str  # what the drive says of itself, once it is open
    silence: float  # time without a word from it that is a fault [s]
    ready: bool  # it waits for its enable, or has it
    fault: int  # of the drive, `errors.REFUSAL_TEXT`; 0 none

    def open(self, wiring: Wiring) -> list[Fact]:
        """Begin; gives the facts. A `DetentError` where the drive does not fit the axis."""
        ...

    def read(self, lines: Any) -> bool:
        """Fill in what the drive writes on the lines; False where nothing new was heard."""
        ...

    def write(self, lines: Any, *, reset: bool) -> None:
        """Tell the drive what the controller writes on the lines; `reset`: it may leave a fault of its own."""
        ...

    def counted(self) -> list[Fact]:
        """What has happened on the way to it since; nothing where nobody counts."""
        ...

    def close(self) -> None:
        """Take the torque away, and end."""
        ...


def put(registers: Any, path: str, value: float) -> None:
    """Set a register by its path."""
    block, _, name = path.rpartition(".")
    setattr(attrgetter(block)(registers) if block else registers, name, value)


def driver_of(choice: str) -> Driver | None:
    """The driver that ``NAME:ADDRESS`` chooses; None for the plant of the file."""
    name, _, address = choice.partition(":")
    if name == SIMULATED and not address:
        return None
    if name not in DRIVERS:
        names = ", ".join([SIMULATED, *(f"{name}:ADDRESS" for name in DRIVERS)])
        raise DetentError(f"--drive {choice}: got the driver {name!r}; expected: one of {names}; try: name one of them")
    module, _, made = DRIVERS[name].partition(":")
    try:
        return getattr(import_module(module), made)(address)
    except ModuleNotFoundError as error:
        raise DetentError(
            f"--drive {choice}: got no package {error.name}; expected: what the extra brings; "
            "try: pip install 'detent[can]'"
        ) from error


class Link:
    """A driver at the wires of a board."""

    def __init__(self, driver: Driver, wiring: Wiring, wires: Any) -> None:
        self.driver, self.wanted, self._wires, self._wiring = driver, wiring.hardware, wires, wiring
        self._facts = driver.open(wiring)
        self._ends = Ends(wires, wiring.lines, driver.silence)
        self._said, self._quiet = 0, 0
        self._left = threading.Event()
        self._thread: threading.Thread | None = None

    @property
    def facts(self) -> list[Fact]:
        """Of the drive, and of the way to it so far."""
        return self._facts + self.driver.counted()

    @property
    def bar(self) -> int:
        """Why the axis may not be enabled; 0 where it may."""
        if self.driver.hardware != self.wanted:
            return OTHER_HARDWARE
        return 0 if self.driver.ready else UNREADY

    @property
    def told(self) -> str:
        """Both ids, where they differ."""
        if self.driver.hardware == self.wanted:
            return ""
        wanted = f"has hardware.id = {self.wanted!r}" if self.wanted else "has no hardware.id"
        return (
            f"the drive is {self.driver.hardware!r}, and the axis file {wanted}; connect the drive that belongs to the "
            f"axis, or write hardware.id = {self.driver.hardware!r} once you know that it is this one"
        )

    def exchange(self) -> None:
        """Tell the drive what the controller says, and hand over what it answers."""
        lines, said = self._ends.lines, int(self._wires.given)
        self._quiet = self._quiet + 1 if said == self._said else 0
        self._said = said
        self._ends.hear()
        if self._quiet * self._wiring.sample > STALE:  # nobody steers
            put(lines, self._wiring.enable, 0)
            if self._wiring.mode != "position":
                put(lines, self._wiring.demand, 0.0)
        self.driver.write(lines, reset=self._wires.state not in (FAULT, FAULT_REACTION))
        if self.driver.read(lines):
            self._ends.say(self.bar, self.driver.fault)

    def start(self, supervised: Callable[[Callable[[], None]], Callable[[], None]]) -> None:
        """Exchange in a thread, once in a period of the loop; `supervised` sees an error in it."""
        self._thread = threading.Thread(target=supervised(self._run), name="driver", daemon=True)
        self._thread.start()

    def _run(self) -> None:
        period = self._wiring.sample
        while not self._left.is_set():
            begun = time.monotonic()
            while self._wires.given == self._said and time.monotonic() < begun + 2.0 * period:
                time.sleep(period / 20.0)
            self.exchange()

    def close(self) -> None:
        """End; the drive is without torque."""
        self._left.set()
        if self._thread is not None:
            self._thread.join()
        self.driver.close()
