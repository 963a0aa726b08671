import pytest

from detent.control.phase_law import Law, LawParams, drive_word, integrate, shape
from detent.control.phase_sequencer import POSITION_MODE, SPEED_MODE


def law(**changes: int) -> tuple[LawParams, Law]:
    """Gains that tell every factor from every other."""
    p = LawParams(speed_k1=2, speed_k2=3, speed_k3=5, position_k1=7, position_k2=11, position_k3=13)
    p.dead_band, p.integral_limit, p.corrector, p.integrator, p.word_limit = 1, 4, 1, 1, 1 << 14
    for name, value in changes.items():
        setattr(p, name, value)
    return p, Law()


@pytest.mark.parametrize("half_width", [0, 1, 2, 5])
def test_the_corrector_is_odd_about_the_boundary_and_rises_by_one_outside_its_band(half_width):
    shaped = {error: shape(error, half_width) for error in range(-20, 20)}
    assert all(shaped[-1 - error] == -shaped[error] for error in range(20))  # the target lies between -1 and 0
    assert [error for error in shaped if shaped[error] == 0] == list(range(-half_width, half_width))
    assert [shaped[error] for error in range(half_width, 20)] == list(range(1, 21 - half_width))


def test_both_sums_have_their_own_gains():
    p, r = law(corrector=0)
    r.setpoint, r.integral = 17, 19
    drive_word(p, r, SPEED_MODE, 0, -23)
    assert r.word == 5 * (2 * 17 + 19 - 3 * -23)
    drive_word(p, r, POSITION_MODE, 0, -23)
    assert r.word == 13 * (7 * 17 + 19 - 11 * -23)


def test_the_corrector_acts_in_position_mode_with_a_dead_band_at_stop_only():
    p, r = law(dead_band=3)
    r.setpoint = 4
    words = {}
    for mode in (SPEED_MODE, POSITION_MODE):
        for stop in (0, 1):
            drive_word(p, r, mode, stop, 0)
            words[mode, stop] = r.shaped
    assert words == {(SPEED_MODE, 0): 4, (SPEED_MODE, 1): 4, (POSITION_MODE, 0): 5, (POSITION_MODE, 1): 2}


@pytest.mark.parametrize("stop", [0, 1])
def test_without_the_corrector_the_error_passes(stop):
    p, r = law(corrector=0, dead_band=3)
    for error in range(-5, 6):
        r.setpoint = error
        drive_word(p, r, POSITION_MODE, stop, 0)
        assert (r.shaped, r.word) == (error, 13 * 7 * error)


@pytest.mark.parametrize("limit", [8, 128, 2048])
def test_the_word_saturates_at_its_width(limit):
    p, r = law(word_limit=limit)
    for setpoint, word in ((10_000, limit - 1), (-10_000, -limit)):
        r.setpoint = setpoint
        drive_word(p, r, SPEED_MODE, 0, 0)
        assert r.word == word


def test_the_integral_counts_to_its_limit_and_back_and_holds_in_the_band():
    p, r = law(dead_band=2)
    integrals = []
    for error in [2] * 6 + [1, 0, -1, -2] + [-3] * 10 + [5]:
        integrate(p, r, error)
        integrals.append(r.integral)
    assert integrals == [1, 2, 3, 4, 4, 4, 4, 4, 4, 4, 3, 2, 1, 0, -1, -2, -3, -4, -4, -4, -3]
