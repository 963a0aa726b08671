"""What the thread of the loop asks of the system: priority, and memory that stays."""

import ctypes
import os
import sys
import threading
from contextlib import suppress

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
    return missing


def ask_to_go_first() -> None:
    """Let the calling thread have its turn before others that only compute; what permits the loop permits it."""
    with suppress(OSError, AttributeError):
        os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), NICENESS)


def give_back() -> None:
    """What was asked for the whole process: its memory may be swapped out again."""
    with suppress(AttributeError):
        ctypes.CDLL(None).munlockall()
