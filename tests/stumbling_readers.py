"""Readers as a damaged file makes them: what `read_apart` has to hold, in a module that its process can import."""

import os
import signal
import sys
import threading

import numpy as np

from detent.errors import InputError
from detent.record.trace import Trace


def never_ends(_path):
    while True:
        pass


def sleeps(_path):
    threading.Event().wait()


def takes_all(_path):
    return np.ones(40_000_000_000, dtype=np.uint8).sum()


def takes(_path, size):
    return int(np.ones(size, dtype=np.uint8).sum())


def crashes(_path):
    os.kill(os.getpid(), signal.SIGSEGV)


def leaves(_path):
    os._exit(3)


def stumbles(path):
    return {}[path.name]


def refuses(path):
    raise InputError.of_file(str(path), "this", "that", "something")


class Evil:
    """What runs a command where it is unpickled."""

    def __reduce__(self):
        return os.system, ("exit 1",)


def answers_evil(_path):
    return {"values": Evil()}


def prints(_path):
    os.write(1, b"library says hello\n")
    sys.stdout.write("and again\n")
    return Trace(columns={"t": np.arange(3.0)}, units={"t": "s"}, attributes={"seed": 3})


def whoami(path):
    return os.getpid(), str(path.resolve())


def numbers(_path, count):
    return np.random.default_rng(1).normal(size=count)
