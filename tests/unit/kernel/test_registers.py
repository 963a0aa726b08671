import ctypes
import math
import shutil
import subprocess

import numpy as np
import pytest
from tests.c_struct import c_struct
from tests.difference import diff, values_of

from detent.kernel.registers import (
    Field,
    Registers,
    block,
    f8,
    f8_array,
    i1,
    i2,
    i4,
    i8,
    register,
    u1,
    u1_array,
    u2,
    u4,
)
from detent.methods.print_head.system import PrintHead, PrintHeadParams


class Widths(Registers):
    """One field of every width, in an order that needs padding."""

    flag: u1 = register("a flag")
    level: i1 = register("a signed byte", unit="count")
    word: u2 = register("a word", unit="count")
    offset: i2 = register("a signed word", unit="count")
    stamp: u4 = register("a long", unit="us")
    small: u1 = register("before a wide one")
    position: i8 = register("position", unit="count")
    angle: i4 = register("a signed long", unit="count")
    speed: f8 = register("speed", unit="m/s")


class Inner(Registers):
    """Used twice, at two depths."""

    count: u1 = register("pulses", unit="count")
    gain: f8 = register("gain", unit="V/m")


class Middle(Registers):
    """Holds an inner block."""

    inner: Inner = block("inner block")
    tail: u1 = register("last byte")


class Outer(Registers):
    """Holds blocks and arrays."""

    inner: Inner = block("the same class again")
    middle: Middle = block("nested deeper")
    queue: u1_array = register("bytes", unit="code", length=5)
    table: f8_array = register("curve", unit="V", length=20)


WIDTHS = [
    ("flag", 0, 256),
    ("level", -128, 256),
    ("word", 0, 1 << 16),
    ("offset", -(1 << 15), 1 << 16),
    ("stamp", 0, 1 << 32),
    ("angle", -(1 << 31), 1 << 32),
    ("position", -(1 << 63), 1 << 64),
]


@pytest.mark.parametrize(("name", "least", "span"), WIDTHS)
def test_a_store_wraps_at_the_width_of_the_field(name, least, span):
    r = Widths()
    greatest = least + span - 1
    for written, read in ((least, least), (greatest, greatest), (greatest + 1, least), (least - 1, greatest)):
        setattr(r, name, written)
        assert getattr(r, name) == read


def test_fields_are_zero_at_first_and_independent():
    r = Widths()
    assert r.snapshot() == bytes(ctypes.sizeof(Widths))
    r.word, r.speed = 65535, -1.5
    assert {k: v for k, v in values_of(r).items() if v} == {"word": 65535, "speed": -1.5}


def test_fields_know_their_declaration():
    assert Widths.__fields__["speed"] == Field(
        name="speed", doc="speed", unit="m/s", offset=32, width=Widths.__fields__["speed"].width, block=None, length=0
    )
    assert Outer.__fields__["middle"].block is Middle
    assert Outer.__fields__["table"].length == 20


def test_a_register_without_a_width_is_refused_with_its_name():
    with pytest.raises(TypeError, match="register 'speed': got <class 'float'>; expected: a width"):
        type("Wrong", (Registers,), {"__annotations__": {"speed": float}, "speed": register("no width")})


def test_leaves_give_paths_and_offsets_of_nested_blocks():
    r = Outer()
    r.middle.inner.count = 7
    r.queue[4] = 9
    paths = {leaf.path: leaf for leaf in Outer.leaves()}
    assert list(paths) == [
        "inner.count",
        "inner.gain",
        "middle.inner.count",
        "middle.inner.gain",
        "middle.tail",
        "queue",
        "table",
    ]
    state = r.snapshot()
    assert state[paths["middle.inner.count"].offset] == 7
    assert state[paths["queue"].offset + 4] == 9


def test_snapshot_and_restore():
    r = Outer()
    r.inner.gain, r.table[3] = 2.5, math.pi
    state = r.snapshot()
    r.inner.gain = 0.0
    r.table[3] = 0.0
    r.restore(state)
    assert (r.inner.gain, r.table[3]) == (2.5, math.pi)
    assert r.snapshot() == state


def test_restoring_another_size_is_refused():
    with pytest.raises(ValueError, match="snapshot of Inner: got 3 bytes; expected: 16"):
        Inner().restore(b"abc")


def test_a_copy_is_independent():
    r = Outer()
    other = r.copy()
    other.middle.tail = 1
    assert r.middle.tail == 0
    assert isinstance(other, Outer)


def test_diff_names_what_differs_against_state_or_snapshot():
    r = Outer()
    before = r.snapshot()
    r.middle.inner.count, r.queue[1] = 4, 8
    expected = {"middle.inner.count": (4, 0), "queue": ([0, 8, 0, 0, 0], [0, 0, 0, 0, 0])}
    assert diff(r, before) == expected
    assert diff(r, Outer()) == expected
    assert diff(r, r.copy()) == {}


def test_numpy_dtype_is_that_of_the_memory():
    r = Outer()
    view = np.frombuffer(r, dtype=Outer)
    view["middle"]["inner"]["gain"][0] = 4.5
    r.queue[2] = 17
    assert r.middle.inner.gain == 4.5
    assert view["queue"][0, 2] == 17
    assert np.dtype(Outer).itemsize == ctypes.sizeof(Outer)
    assert np.dtype(np.dtype(Outer)["table"].base) == np.float64


@pytest.mark.process
@pytest.mark.parametrize("registers", [Widths, Outer, PrintHeadParams, PrintHead], ids=lambda c: c.__name__)
@pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler (cc) on this machine")
def test_the_c_compiler_lays_the_structure_out_the_same(registers, tmp_path):
    leaves = list(registers.leaves())
    lines = [
        "#include <stdint.h>",
        "#include <stddef.h>",
        "#include <stdio.h>",
        c_struct(registers),
        "int main(void) {",
    ]
    lines.append(f'printf("%zu\\n", sizeof({registers.__name__}));')
    lines += [f'printf("%zu\\n", offsetof({registers.__name__}, {leaf.path}));' for leaf in leaves]
    source, program = tmp_path / "layout.c", tmp_path / "layout"
    source.write_text("\n".join([*lines, "return 0;", "}", ""]))
    done = subprocess.run(
        ["cc", "-std=c11", "-Wall", "-Werror", "-o", program, source],  # noqa: S607 - the system's compiler
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    numbers = [int(row) for row in subprocess.run([program], capture_output=True, text=True, check=True).stdout.split()]
    assert numbers == [ctypes.sizeof(registers), *(leaf.offset for leaf in leaves)]
