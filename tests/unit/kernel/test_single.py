"""Single precision: against NumPy's float32, plain and compiled, and the registers that hold it."""

import ctypes
import math
import operator
import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests import single_steps
from tests.single_steps import Law, Mixed

from detent.kernel.compiled import RegistersType
from detent.kernel.registers import Registers, declared_of, f4, register, single, u1
from detent.kernel.single import Single, alike, sqrt
from detent.kernel.step import step

SINGLES = st.floats(width=32)
OPERATORS = (operator.add, operator.sub, operator.mul, operator.truediv)
COMPARISONS = (operator.lt, operator.le, operator.gt, operator.ge, operator.eq, operator.ne)
WHOLE = st.integers(-(1 << 63), (1 << 63) - 1)


def bits(value: float) -> bytes:
    """Of a number; all that are none are alike."""
    return b"nan" if math.isnan(value) else bytes(ctypes.c_double(value))


@given(SINGLES, SINGLES)
def test_operators_round_once_as_float32_does(a, b):
    for of in OPERATORS:
        if of is operator.truediv and b == 0.0:
            continue  # plain Python refuses it, of floats too
        with np.errstate(all="ignore"):
            wanted = of(np.float32(a), np.float32(b))
        found = of(Single(a), Single(b))
        assert isinstance(found, Single)
        assert bits(found) == bits(float(wanted))


@given(SINGLES, SINGLES)
def test_comparisons_are_those_of_float32(a, b):
    for of in COMPARISONS:
        assert of(Single(a), Single(b)) == bool(of(np.float32(a), np.float32(b)))
    if not math.isnan(a):
        assert hash(Single(a)) == hash(a)


@given(SINGLES)
def test_sign_magnitude_and_root(a):
    assert (bits(-Single(a)), bits(abs(Single(a)))) == (bits(-a), bits(abs(a)))
    if a >= 0.0:
        found = sqrt(Single(a))
        assert isinstance(found, Single)
        assert bits(found) == bits(float(np.sqrt(np.float32(a))))


@given(st.floats())
def test_a_double_is_rounded_to_the_nearest(a):
    with np.errstate(all="ignore"):
        assert bits(Single(a)) == bits(float(np.float32(a)))


@given(WHOLE)
def test_a_whole_number_is_rounded_once(n):
    """By way of a double it would be twice: 2^60 + 2^36 + 1 lies above the middle of two singles."""
    low, high = (int(float(one)) for one in (np.nextafter(np.float32(n), np.float32(side)) for side in (-3e38, 3e38)))
    near = int(Single(n))
    assert low <= near <= high
    assert abs(near - n) <= min(abs(low - n), abs(high - n))
    assert int(Single((1 << 60) + (1 << 36) + 1)) == (1 << 60) + (1 << 37)
    assert int(Single((1 << 60) + (1 << 36))) == 1 << 60


@given(SINGLES, st.integers(-(1 << 40), 1 << 40))
def test_a_whole_number_beside_it_is_a_single_and_a_float_makes_a_float(a, n):
    for found, wanted in (
        (Single(a) * n, Single(a) * Single(n)),
        (n - Single(a), Single(n) - Single(a)),
        (True + Single(a), Single(1) + Single(a)),
    ):
        assert isinstance(found, Single)
        assert bits(found) == bits(wanted)
    for found, wanted in ((Single(a) * 0.1, a * 0.1), (0.1 - Single(a), 0.1 - a)):
        assert not isinstance(found, Single)
        assert bits(found) == bits(wanted)
    assert (Single(a) < n) == (Single(a) < Single(n))


def test_what_it_is_beside_neither_is_refused():
    with pytest.raises(TypeError):
        Single(1.0) + "1"  # pyright: ignore[reportUnusedExpression]


def test_alike_follows_its_model():
    assert isinstance(alike(Single(0), 0.1), Single)
    assert type(alike(0.5, 3)) is float
    assert alike(Single(0), 0.1) == Single(0.1) != 0.1


# ---- registers


def test_a_register_rounds_what_is_stored_and_reads_as_a_single():
    r = Mixed()
    r.x = 0.1
    assert isinstance(r.x, Single)
    assert r.x == float(np.float32(0.1))
    r.x = 1e39
    assert r.x == math.inf
    assert [(leaf.path, leaf.width.code, leaf.offset) for leaf in Mixed.leaves()] == [
        ("x", "f4", 0), ("y", "f4", 4), ("z", "f8", 8), ("n", "i8", 16),
    ]  # fmt: skip
    assert np.dtype(Mixed)["x"] == np.float32


def test_an_array_of_them_is_refused():
    with pytest.raises(TypeError, match="got an array of f4"):
        type(Registers)("Bad", (Registers,), {"__annotations__": {"x": f4}, "x": register("x", length=3)})


def test_one_declaration_gives_the_registers_of_both_precisions():
    kind = single(Law)
    assert [leaf.width.code for leaf in Law.leaves()] == ["f8", "f8", "f8"]
    assert [leaf.width.code for leaf in kind.leaves()] == ["f4", "f4", "f8"]
    assert (kind.__name__, kind.__doc__, declared_of(kind), declared_of(Law)) == ("SingleLaw", Law.__doc__, Law, Law)
    assert single(Law) is kind
    assert kind.__fields__["limit"].range == (float(Single(1e-6)), float(Single(0.1)))
    assert kind(limit=0.1).limit == kind.__fields__["limit"].range[1]

    class Plain(Registers):
        """Nothing in it follows."""

        flag: u1 = register("a flag")

    assert single(Plain) is Plain


def test_a_type_for_compiled_code_is_kept_by_its_declaration():
    """What is kept of compiled steps is read by other processes, which make the class anew."""
    for kind in (Law, single(Law)):
        made = RegistersType(kind)
        assert pickle.loads(pickle.dumps(made)) is made  # noqa: S301 - our own


# ---- compiled


COMPILED = {one: step(one) for one in (*single_steps.ACCEPTED, single_steps.halved)}


@pytest.fixture
def called_are_steps(monkeypatch):
    monkeypatch.setattr(single_steps, "halved", COMPILED[single_steps.halved])


@pytest.mark.usefixtures("called_are_steps")
@pytest.mark.parametrize("one", single_steps.ACCEPTED, ids=lambda one: one.__name__)
def test_compiled_steps_have_the_bits_of_plain_ones(one):
    rng = np.random.default_rng(3)
    for _ in range(2000):
        scale = 10.0 ** rng.integers(-42, 18)
        r = Mixed(x=rng.normal() * scale, y=rng.normal() * rng.choice([1.0, scale]), z=rng.normal(),
                  n=int(rng.integers(-(1 << 62), 1 << 62) >> int(rng.integers(0, 62))))  # fmt: skip
        a, plain, made = int(rng.integers(-3, 4)), r.copy(), r.copy()
        wanted, found = one(plain, a), COMPILED[one](made, a)
        assert bytes(plain) == bytes(made)
        assert type(wanted) is type(found)
        assert wanted is None or bits(wanted) == bits(found)
