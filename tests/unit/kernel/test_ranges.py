"""Ranges that registers claim, and that plain steps can be told to check."""

import os
import subprocess
import sys

CHECKED = """
from detent.kernel.registers import Registers, register, u1, i8
class One(Registers):
    place: i8 = register("index", unit="count", range=(0, 7))
    free: u1 = register("any", unit="count")
r = One()
r.place, r.free = 7, 300
try:
    r.place = 8
except ValueError as error:
    print(error)
print(r.free)
"""


def told(check: str) -> str:
    environment = os.environ | {"DETENT_CHECK_RANGES": check}
    words = [sys.executable, "-c", CHECKED]
    return subprocess.run(words, env=environment, capture_output=True, text=True, check=True).stdout


def test_a_store_outside_a_range_raises_where_that_is_asked_for():
    assert told("1") == (
        "register One.place: got 8; expected: 0 to 7, as it is declared; correct the step, or the range of the "
        "declaration\n44\n"
    )
    assert told("0") == "44\n"
