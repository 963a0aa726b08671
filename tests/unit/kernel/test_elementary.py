"""Exponential and sine of the kernel, against 60 digits of the decimal module."""

import math
from decimal import Decimal, localcontext

import numba
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from detent.kernel.elementary import FARTHEST, HIGHEST, LOWEST, angle_of, exp, one_less_exp, sin
from detent.kernel.step import step

DIGITS = 60
PI = Decimal("3.14159265358979323846264338327950288419716939937510582097494459230781640628620899862803482534211706798")

ULP = 1.0
"""Bound of the error, in units in the last place."""

SPREAD = 200_000
"""Arguments of one range that compiled code and plain Python are compared with."""


def true_exp(x: float) -> Decimal:
    with localcontext(prec=DIGITS):
        return Decimal(x).exp()


def true_sin(x: float) -> Decimal:
    """Taylor series of what is left of whole half turns."""
    with localcontext(prec=DIGITS):
        turns = (Decimal(x) / PI).to_integral_value()
        rest = Decimal(x) - turns * PI
        term, total, k = rest, Decimal(0), 1
        while abs(term) > Decimal(10) ** -(DIGITS + 5) * abs(rest) and term:
            total += term
            k += 2
            term *= -rest * rest / (k * (k - 1))
        return -total if int(turns) & 1 else total


def ulps(found: float, true: Decimal) -> float:
    """Error in units of the last place of the true value."""
    with localcontext(prec=DIGITS):
        return abs(float((Decimal(found) - true) / Decimal(math.ulp(float(true)))))


def worst(function, true, values) -> float:
    return max(ulps(function(x), true(x)) for x in values)


def test_the_exponential_is_within_an_ulp():
    rng = np.random.default_rng(1)
    values = [*rng.uniform(LOWEST, HIGHEST, 2000), *rng.uniform(-40, 0, 2000), *(10.0 ** rng.uniform(-30, 0, 500))]
    assert 0.6 < worst(exp, true_exp, map(float, values)) < ULP


def test_the_sine_is_within_an_ulp():
    rng = np.random.default_rng(2)
    values = [*rng.uniform(-10, 10, 2000), *rng.uniform(-FARTHEST, FARTHEST, 2000), *(10.0 ** rng.uniform(-30, 0, 500))]
    assert 0.6 < worst(sin, true_sin, map(float, values)) < ULP


def test_the_sine_is_within_an_ulp_where_it_is_nearly_zero():
    quarters = np.random.default_rng(3).integers(1, int(FARTHEST / math.pi * 2), 1000)
    assert worst(sin, true_sin, (math.pi / 2 * int(n) for n in quarters)) < ULP


def test_beyond_the_farthest_angle_the_turn_itself_is_rounded():
    for x in (2e6, -3.3e7, 1e9):
        assert sin(x) == pytest.approx(float(true_sin(x)), abs=abs(x) * 1e-16)
    assert abs(sin(1.7e308)) <= 1.0


def test_special_values():
    assert (exp(0.0), exp(-0.0), exp(-math.inf), exp(math.inf)) == (1.0, 1.0, 0.0, math.inf)
    assert (exp(HIGHEST), exp(LOWEST)) == (1.7976931348622732e308, 5e-324)
    assert (exp(math.nextafter(HIGHEST, 1e3)), exp(math.nextafter(LOWEST, -1e3))) == (math.inf, 0.0)
    assert exp(-708.5) == pytest.approx(2.006132305331306e-308, rel=1e-15, abs=0.0)
    assert math.isnan(exp(math.nan))
    assert sin(0.0) == 0.0
    assert math.copysign(1.0, sin(-0.0)) == -1.0
    assert sin(5e-324) == 5e-324
    assert all(math.isnan(sin(x)) for x in (math.inf, -math.inf, math.nan))


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_finite_arguments_give_numbers(x):
    assert exp(x) >= 0.0
    assert abs(sin(x)) <= 1.0
    assert sin(-x) == -sin(x)


@given(st.floats(-700, 700), st.floats(0, 1))
def test_the_exponential_never_falls(x, more):
    assert exp(x + more) >= exp(x) * (1.0 - 2**-52)


@step
def fill_both(x, exponentials, sines):
    """Both, one argument after the other."""
    for k in range(len(x)):
        exponentials[k] = exp(x[k])
        sines[k] = sin(x[k])


@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="compares with compiled code; NUMBA_DISABLE_JIT is set")
@pytest.mark.parametrize("size", [1.0, 40.0, 700.0, 1e6, 1e12])
def test_plain_python_gives_the_same_bits_as_compiled_code(size, monkeypatch):
    x = np.random.default_rng(int(size)).uniform(-size, size, SPREAD)
    exponentials, sines = np.empty_like(x), np.empty_like(x)
    fill_both(x, exponentials, sines)
    plain = plain_functions(monkeypatch)
    assert [plain["exp"](v) for v in x.tolist()] == exponentials.tolist()
    assert [plain["sin"](v) for v in x.tolist()] == sines.tolist()


def plain_functions(monkeypatch):
    """The functions of the module as plain Python, calling one another."""
    import detent.kernel.elementary as module

    for name, made in list(vars(module).items()):
        if hasattr(made, "py_func"):
            monkeypatch.setattr(module, name, made.py_func)
    return {name: getattr(module, name) for name in ("exp", "sin")}


@given(st.floats(1e-12, 700.0))
def test_what_an_exponential_lacks_to_one_is_exact_where_the_difference_would_cancel(x):
    with localcontext(prec=DIGITS):
        true = 1 - Decimal(-x).exp()
        error = abs(Decimal(one_less_exp(x)) - true)
    assert error <= 4 * Decimal(math.ulp(float(true)))


@given(st.floats(-1e6, 1e6), st.floats(-1e6, 1e6))
def test_an_angle_is_that_of_the_library_within_its_last_digits(y, x):
    true = math.atan2(y, x) if y else (0.0 if x >= 0.0 else math.pi)
    # Squares of shorter vectors are no longer normal numbers.
    if math.hypot(x, y) > 1e-150 or not y:
        # Below the smallest normal number a halving loses digits, which the doubling after it does not bring back.
        assert abs(angle_of(y, x) - true) <= max(8 * math.ulp(true), 16 * math.ulp(0.0))
