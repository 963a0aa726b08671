"""The tails of Student's and Fisher's distributions, beside SciPy's."""

import math

import numpy as np
import pytest
from scipy import special

from detent.identify.fit.chance import beta_share, fisher_tail, student_reach, student_tail

DEGREES = (1.0, 1.3, 2.0, 3.7, 4.0, 10.0, 33.3, 100.0, 587.2, 1e4)


@pytest.mark.parametrize("degrees", DEGREES)
@pytest.mark.parametrize("chance", [0.3, 0.025, 5e-3, 2e-5, 1e-9])
def test_students_variable_reaches_as_far_as_scipys(chance, degrees):
    assert student_reach(chance, degrees) == pytest.approx(-float(special.stdtrit(degrees, chance)), rel=1e-11)
    assert student_tail(student_reach(chance, degrees), degrees) == pytest.approx(chance, rel=1e-12)


@pytest.mark.parametrize("chance", [0.4, 0.025, 2e-5, 1e-9])
def test_without_limit_of_degrees_it_is_the_normal_one(chance):
    assert student_reach(chance, math.inf) == pytest.approx(-float(special.ndtri(chance)), rel=1e-13)
    assert student_reach(chance, 1e5) == pytest.approx(-float(special.ndtri(chance)), rel=2e-4)


def test_one_degree_is_cauchys():
    """Whose tail is ``1/2 - atan(t) / pi``."""
    for t in (0.0, 0.1, 1.0, 12.706, 1e3):
        assert student_tail(t, 1.0) == pytest.approx(math.atan2(1.0, t) / math.pi, rel=1e-13)


@pytest.mark.parametrize("above", [1, 2, 7, 40])
@pytest.mark.parametrize("below", [1.0, 4.5, 60.0, 3e3])
@pytest.mark.parametrize("ratio", [1e-3, 0.7, 1.0, 4.0, 60.0])
def test_fishers_ratio_is_as_rare_as_scipys(ratio, above, below):
    assert fisher_tail(ratio, above, below) == pytest.approx(float(special.fdtrc(above, below, ratio)), rel=1e-10)


def test_a_ratio_of_nothing_is_exceeded_for_certain():
    assert fisher_tail(0.0, 2.0, 3.0) == 1.0
    assert fisher_tail(-1.0, 2.0, 3.0) == 1.0


def test_the_beta_function_runs_from_0_to_1():
    for a, b in ((0.5, 0.5), (2.0, 9.0), (300.0, 0.5)):
        shares = [beta_share(a, b, x) for x in np.linspace(0.0, 1.0, 50).tolist()]
        assert shares[0] == 0.0
        assert shares[-1] == 1.0
        assert (np.diff(shares) >= 0.0).all()
