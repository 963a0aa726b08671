import pytest

from detent.sensing.angle_composition import AbsoluteAngle, CompositionParams, compose


def composed(p: CompositionParams, theta: int, coarse_error: int = 0) -> tuple[int, int]:
    """Angle and turns of exact words at `theta`, as the shaft's zeros lie; the error in coarse counts."""
    r = AbsoluteAngle()
    period = p.ratio * p.fine
    compose(p, r, (theta + p.fine_zero) % p.fine, theta * p.coarse // period + p.coarse_zero + coarse_error)
    return r.theta, r.turns


@pytest.mark.parametrize(("ratio", "fine", "coarse"), [(90, 4096, 4096), (7, 100, 64), (1, 16, 16), (360, 1000, 5000)])
def test_every_angle_of_exact_words(ratio, fine, coarse):
    p = CompositionParams(ratio=ratio, fine=fine, coarse=coarse)
    for theta in range(0, ratio * fine, max(1, ratio * fine // 3001)):
        assert composed(p, theta) == (theta, theta // fine)


def test_an_error_below_half_a_motor_turn_less_one_count_does_no_harm():
    p = CompositionParams(ratio=90, fine=4096, coarse=4096)
    # A motor turn is 45.5 coarse counts.
    for theta in range(0, 90 * 4096, 101):
        assert composed(p, theta, 21)[0] == composed(p, theta, -21)[0] == theta
    assert any(composed(p, theta, 24)[0] != theta for theta in range(0, 90 * 4096, 101))


def test_zeros_are_taken_off_first():
    p = CompositionParams(ratio=90, fine=4096, coarse=4096, fine_zero=1234, coarse_zero=4000)
    for theta in (0, 1, 4095, 4096, 200_000, 90 * 4096 - 1):
        assert composed(p, theta)[0] == theta
    # Zeros that do not belong together make whole motor turns wrong (trap 7).
    p.coarse_zero = 4000 - 45
    r = AbsoluteAngle()
    compose(p, r, 1234, 4000)
    assert r.theta == 4096


def test_the_truncating_form_is_wrong_near_a_fine_zero():
    p = CompositionParams(ratio=90, fine=4096, coarse=4096, truncating=1)
    assert composed(p, 90 * 2000)[0] == 90 * 2000
    assert composed(p, 4096 * 3) == (4096 * 2, 2)  # the coarse word lags by its rounding
