"""Compiled steps and plain Python work on the same memory by the same rules."""

import hashlib
import os
import subprocess
import sys

import numba
import pytest
from tests.difference import diff
from tests.places import ROOT
from tests.print_head_rig import Rig

from detent.kernel.compiled import byte_at, copy_back, local_copy, nth
from detent.kernel.registers import (
    Registers,
    block,
    f8,
    f8_array,
    i1,
    i2,
    i4,
    i4_array,
    i8,
    register,
    u1,
    u1_array,
    u2,
    u4,
)
from detent.kernel.step import hot_step, step

pytestmark = pytest.mark.skipif(
    numba.config.DISABLE_JIT, reason="compares with compiled code; NUMBA_DISABLE_JIT is set"
)


class Small(Registers):
    """Narrow fields."""

    a: u1 = register("unsigned byte")
    b: i1 = register("signed byte")
    c: u2 = register("unsigned word")
    d: i2 = register("signed word")
    e: u4 = register("unsigned long")
    f: i4 = register("signed long")
    g: i8 = register("wide")
    h: f8 = register("real")


class Whole(Registers):
    """Blocks and arrays."""

    lead: u1 = register("before the block")
    small: Small = block("narrow fields")
    bytes_: u1_array = register("bytes", length=3)
    longs: i4_array = register("longs", length=3)
    reals: f8_array = register("reals", length=3)


@step
def store_everywhere(r: Small, x: int, y: float) -> None:
    """One number into every width."""
    r.a = x
    r.b = x
    r.c = x
    r.d = x
    r.e = x
    r.f = x
    r.g = x
    r.h = y


@step
def mixed_expression(r: Small) -> float:
    """Sums that unsigned or narrow arithmetic would get wrong."""
    r.g = (r.a - r.c) * r.b + (r.e << 3) - (r.d >> 1) + (r.f & 0xFF)
    r.f = r.g
    r.b -= 1
    return r.h * (r.a - r.c) / 3.0


@step
def through_blocks(w: Whole, k: int) -> int:
    """Nested fields and array elements, read and written."""
    w.small.a += 200
    w.bytes_[k] += 250
    w.longs[k] = w.bytes_[k] - w.small.a
    w.reals[k] = w.longs[k] / 4
    return w.longs[k]


@hot_step
def bump(r: Small) -> None:
    """A callee that takes a block."""
    r.c += 1


@step
def on_a_copy(w: Whole) -> int:
    """Work on a copy, then write one of two copies back."""
    kept, thrown = local_copy(w.small), local_copy(w.small)
    bump(kept)
    bump(kept)
    bump(thrown)
    seen_outside = w.small.c
    copy_back(w.small, kept)
    return seen_outside * 1000 + w.small.c


@step
def bytes_of(w: Whole, first: int) -> int:
    """Two raw bytes."""
    return byte_at(w, first) | byte_at(w, first + 1) << 8


NUMBERS = [0, 1, -1, 127, 128, 255, 256, -129, 32768, 65535, 65536, 2**31, 2**32 + 5, -(2**31) - 1, 2**63 - 1, -(2**63)]


@pytest.mark.parametrize("x", NUMBERS)
def test_a_compiled_store_wraps_as_plain_python_does(x):
    compiled, plain = Small(), Small()
    store_everywhere(compiled, x, x / 7)
    store_everywhere.py_func(plain, x, x / 7)
    assert diff(compiled, plain) == {}


@pytest.mark.parametrize("seed", NUMBERS)
def test_expressions_are_of_full_integers(seed):
    compiled = Small(a=seed, b=seed * 3, c=seed * 5, d=seed * 7, e=seed * 11, f=seed * 13, h=seed / 17)
    plain = compiled.copy()
    assert mixed_expression(compiled) == mixed_expression.py_func(plain)
    assert diff(compiled, plain) == {}


def test_unsigned_difference_is_negative():
    r = Small(a=1, c=2, h=3.0)
    assert mixed_expression(r) == -1.0


@pytest.mark.parametrize("k", range(3))
def test_blocks_and_arrays(k):
    compiled = Whole()
    compiled.small.a, compiled.bytes_[k] = 100, 10
    plain = compiled.copy()
    assert through_blocks(compiled, k) == through_blocks.py_func(plain, k) == 4 - 44
    assert compiled.snapshot() == plain.snapshot()
    assert compiled.reals[k] == -10.0


def test_a_local_copy_is_independent_until_copied_back():
    compiled, plain = Whole(), Whole()
    compiled.small.c = plain.small.c = 65535
    assert on_a_copy(compiled) == on_a_copy.py_func(plain) == 65535 * 1000 + 1  # 65535 + 2 wraps to 1
    assert compiled.snapshot() == plain.snapshot()


def test_byte_at_reads_raw_memory():
    w = Whole()
    w.small.c = 0xBEEF
    offset = next(leaf.offset for leaf in Whole.leaves() if leaf.path == "small.c")
    assert bytes_of(w, offset) == bytes_of.py_func(w, offset) == 0xBEEF


@step
def add_at(first: Whole, place: int, more: int) -> None:
    """Write into one of several files in a row."""
    one = nth(first, place)
    one.small.c = one.small.c + more


def test_a_register_file_in_an_array_is_reached_by_its_place():
    for add in (add_at, add_at.py_func):
        many = (Whole * 3)()
        add(many[0], 2, 5)
        add(many[0], 1, 70000)
        assert [one.small.c for one in many] == [0, 70000 % 65536, 5]


def test_registers_of_another_class_are_another_type():
    with pytest.raises(Exception, match="Unknown attribute 'small' of type Registers"):
        through_blocks(Small(), 0)


@pytest.mark.process
@pytest.mark.parametrize("fidelity", ["averaged", "switch-level"])
def test_identification_and_a_run_give_the_same_bytes_compiled_and_plain(fidelity):
    program = f"from tests.unit.kernel.test_compiled import run_hash; print(run_hash({fidelity!r}))"
    environment = os.environ | {"PYTHONPATH": f"{ROOT / 'src'}{os.pathsep}{ROOT}", "NUMBA_DISABLE_JIT": "1"}
    done = subprocess.run(
        [sys.executable, "-c", program], env=environment, cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == run_hash(fidelity)


def run_hash(fidelity: str) -> str:
    """Hash of parameters and state along an identification and a move, with jitter and missing edges on the way."""
    faults = ["encoder.jitter=5 deg", "encoder.missing_edges=0.0001"]
    rig = Rig(overrides=[f"axis.fidelity={fidelity}", *faults])
    digest = hashlib.sha256(rig.p.snapshot())
    answers = [rig.calculate()]
    digest.update(rig.r.snapshot())
    answers.append(rig.run_to(1200))
    digest.update(rig.r.snapshot())
    assert answers == [0, 0]
    return digest.hexdigest()
