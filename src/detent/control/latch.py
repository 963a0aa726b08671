"""One-byte latches with an interrupt flag, and the small queue before the status latch (specification 2.2, 3.1)."""

from detent.kernel.registers import Registers, block, register, u1, u1_array
from detent.kernel.step import step

QUEUE_LENGTH = 32  # status bytes that can wait; a power of two
ROOM = QUEUE_LENGTH + 1  # and the latch itself: of more at once the rest is lost


class Latch(Registers):
    """Eight bits and the flag that interrupts the reader."""

    byte: u1 = register("the byte", unit="code")
    flag: u1 = register("1 from write to read: the reader's interrupt")


class StatusPort(Registers):
    """Status latch with its queue: a byte is never overwritten before the supervisor has read it."""

    latch: Latch = block("the latch the supervisor reads")
    queue: u1_array = register("bytes that wait", unit="code", length=QUEUE_LENGTH)
    first: u1 = register("index of the oldest waiting byte", unit="count", range=(0, QUEUE_LENGTH - 1))
    waiting: u1 = register("number of waiting bytes", unit="count", range=(0, QUEUE_LENGTH))
    lost: u1 = register("bytes lost because the supervisor did not read; must stay 0", unit="count")


@step
def write_latch(r: Latch, byte: int) -> None:
    """Writer's side: store and raise the reader's interrupt."""
    r.byte = byte
    r.flag = 1


@step
def read_latch(r: Latch) -> int:
    """Reader's side: take the byte and clear the flag."""
    r.flag = 0
    return r.byte


@step
def pass_on(r: StatusPort) -> None:
    """Move the oldest waiting byte into the latch if the supervisor has read the last one."""
    if r.waiting > 0 and r.latch.flag == 0:
        write_latch(r.latch, r.queue[r.first])
        r.first = (r.first + 1) & (QUEUE_LENGTH - 1)
        r.waiting -= 1


@step
def send(r: StatusPort, byte: int) -> None:
    """Queue a status byte and pass it on if the latch is free."""
    if r.waiting >= QUEUE_LENGTH:
        r.lost += 1
        return
    r.queue[(r.first + r.waiting) & (QUEUE_LENGTH - 1)] = byte
    r.waiting += 1
    pass_on(r)
