"""What the thread of the loop asks of the system: priority, memory that stays, and a processor of its own."""

import ctypes
import os
import sys
import threading
from collections.abc import Generator
from contextlib import contextmanager, suppress
from pathlib import Path

ISOLATED = Path("/sys/devices/system/cpu/isolated")  # processors that the system gives to nobody by itself
PRIORITY = 80  # of SCHED_FIFO
NICENESS = -10  # of what brings a person's Stop to the loop: before all that only computes, behind the loop itself
MCL_CURRENT_AND_FUTURE = 3
PR_SET_TIMERSLACK = 29


def ask_for_time() -> list[str]:
    """Ask for the calling thread; gives what was not permitted, each with what permits it."""
    libc = ctypes.CDLL(None, use_errno=True)
    missing: list[str] = []
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
    except (OSError, AttributeError):
        missing.append(f"real-time priority; permit it with: sudo setcap cap_sys_nice,cap_ipc_lock+ep {sys.executable}")
        with suppress(AttributeError):
            libc.prctl(PR_SET_TIMERSLACK, 1, 0, 0, 0)
    if not hasattr(libc, "mlockall") or libc.mlockall(MCL_CURRENT_AND_FUTURE) != 0:
        missing.append("memory that is never swapped out; permit it with: ulimit -l unlimited")
    return missing + take_processor()


def take_processor() -> list[str]:
    """Take a processor that is kept free of others, where the system has one (isolcpus); what was not permitted."""
    try:
        kept = ISOLATED.read_text(encoding="ascii").strip()
    except OSError:
        return []
    if not kept:
        return []
    number = int(kept.replace("-", ",").rpartition(",")[2])
    try:
        os.sched_setaffinity(0, {number})
    except OSError:
        return [f"processor {number}, kept free of others; permit it with: taskset -c 0-{number} detent live"]
    return []


@contextmanager
def going_first() -> Generator[None]:
    """Let the calling thread, and what it starts, have its turn before others that only compute, where permitted.

    What permits the priority of the loop permits it. All threads of a process need it: one that waits for its turn
    while it has the interpreter's lock keeps the others waiting, too.
    """
    thread = threading.get_native_id()
    try:
        before = os.getpriority(os.PRIO_PROCESS, thread)
        os.setpriority(os.PRIO_PROCESS, thread, min(before, NICENESS))
    except (OSError, AttributeError):
        yield
    else:
        try:
            yield
        finally:
            os.setpriority(os.PRIO_PROCESS, thread, before)


def give_back() -> None:
    """What was asked for the whole process: its memory may be swapped out again."""
    with suppress(AttributeError):
        ctypes.CDLL(None).munlockall()
