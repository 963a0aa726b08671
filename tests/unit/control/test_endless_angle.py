import pytest

from detent.control.endless_angle import (
    FLAG,
    RAW,
    TURN_COUNTER,
    EndlessAngle,
    EndlessAngleParams,
    extend,
    first_angle,
    read_angle,
    shift_back,
    start_raw,
)

T = 1000


def angle_at(d: int) -> EndlessAngle:
    r = EndlessAngle(turn=5, flg=1, position=77)
    first_angle(r, d)
    return r


def test_the_first_angle_is_present_and_record():
    r = angle_at(321)
    assert (r.dar, r.d_prev, r.aar, r.position, r.flg, r.turn, r.crossings) == (321, 321, 321, 321, 0, 0, 0)


@pytest.mark.parametrize(
    ("before", "now", "turn"),
    [(990, 10, 1), (10, 990, -1), (0, 500, 0), (500, 0, 0), (0, 501, -1), (501, 0, 1), (999, 0, 1), (0, 999, -1)],
)
def test_a_change_of_more_than_half_a_period_is_a_crossing(before, now, turn):
    r = angle_at(before)
    read_angle(EndlessAngleParams(period=T), r, now, True)
    assert (r.turn, r.crossings, r.flg) == (turn, abs(turn), abs(turn))
    assert (r.dar, r.d_prev) == (now, now)
    assert r.position == now + turn * T


@pytest.mark.parametrize("manual", [True, False])
def test_the_flag_is_set_in_manual_feed_only(manual):
    r = angle_at(999)
    read_angle(EndlessAngleParams(period=T), r, 1, manual)
    assert (r.flg, r.turn) == (manual, 1)


@pytest.mark.parametrize(
    ("form", "turn", "flg", "z", "present"),
    [
        (TURN_COUNTER, 0, 1, 1, 10),
        (TURN_COUNTER, -2, 0, 1, 10 - 2 * T),
        (FLAG, 3, 0, -1, 10),
        (FLAG, 0, 1, -1, 10 - T),
        (FLAG, 0, 1, 1, 10 + T),
        (RAW, 4, 1, 1, 10),
    ],
)
def test_present_angle_of_each_form(form, turn, flg, z, present):
    r = EndlessAngle(dar=10, turn=turn, flg=flg)
    extend(EndlessAngleParams(period=T, form=form), r, z)
    assert r.aar == present


def test_start_and_shift():
    r = EndlessAngle(dar=10, turn=2, flg=1, aar=2010)
    shift_back(r, 1)
    assert (r.flg, r.turn) == (0, 1)
    shift_back(r, -1)
    assert r.turn == 2
    r.flg = 1
    start_raw(r)
    assert (r.flg, r.turn, r.aar) == (0, 0, 10)
