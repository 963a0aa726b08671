"""The supervisor's choices for a print-head carriage of 14.5 inches (spec print-head 3.4, 3.13, 7.2)."""

import math
from itertools import pairwise

import pytest

from detent.control.speed_selection import select_speed
from detent.errors import InputError
from detent.methods.print_head.line_plan import RESERVE, Geometry, motion_time, plan_lines, run_up, shortest_way
from detent.methods.print_head.print_job import parse_text
from detent.methods.print_head.printed_page import PrintedCharacter, PrintLine

CARRIAGE = Geometry(width_emitters=4350, column0_emitters=450)


def line(first, last, number=1):
    """A line with ink from column `first` to column `last` [1/120 in]."""
    return PrintLine(number, 8 * number, (PrintedCharacter("a", first, 12), PrintedCharacter("b", last - 12, 12)))


# -- the numbers of the specification -------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("distance", "milliseconds"),
    [(4000, 402), (2000, 235), (1200, 167), (1001, 151), (1000, 202), (600, 135), (200, 85), (100, 52)],
)
def test_estimated_times_are_those_of_the_specification(distance, milliseconds):
    assert motion_time(distance, select_speed(distance, 240)) * 1000 == pytest.approx(milliseconds, rel=0.04)


@pytest.mark.parametrize("s", range(18, 241))
def test_run_up_and_shortest_way_are_the_least_whole_numbers_that_do(s):
    assert run_up(s) - 8 - 1 < 1.05 * s * s / 144 <= run_up(s) - 8 + 1e-9
    assert 5 * s * s < 288 * (shortest_way(s) - 16)
    assert not 5 * s * s < 288 * (shortest_way(s) - 17)


# -- single lines ---------------------------------------------------------------------------------------------


def test_one_line_is_printed_from_the_side_where_the_head_stands():
    (from_right,) = plan_lines([line(0, 960)], CARRIAGE)
    assert (from_right.direction, from_right.speed, from_right.run_to) == (-1, 240, None)
    assert (from_right.start, from_right.print_from, from_right.print_to) == (4350, (450 + 2400) * 256, 450)
    assert from_right.stop == 50
    (from_left,) = plan_lines([line(0, 960)], CARRIAGE, head=0)
    assert (from_left.direction, from_left.print_from, from_left.print_to) == (1, 450 * 256, 2850)
    assert not from_left.turn_around


def test_a_head_too_near_its_line_runs_back_first():
    (plan,) = plan_lines([line(0, 960)], CARRIAGE, head=300, bidirectional=False)
    assert plan.run_to == plan.start == 450 - run_up(240)
    back = 300 - plan.run_to
    assert plan.seconds == pytest.approx(
        motion_time(back, select_speed(back, 240)) + motion_time(plan.stop - plan.start, 240) + 2 * 5e-3
    )


def test_a_head_far_enough_back_does_not_run():
    (plan,) = plan_lines([line(0, 960)], CARRIAGE, head=15, bidirectional=False)
    assert (plan.run_to, plan.start) == (None, 15)


def test_places_between_emitters_are_kept_in_the_fraction():
    (plan,) = plan_lines([line(1, 961)], Geometry(4350, 450.25), head=0)
    assert plan.print_from == round((450.25 + 2.5) * 256)
    assert plan.print_to == math.ceil(450.25 + 961 * 2.5)


def test_a_short_line_gets_a_longer_way_and_keeps_its_speed():
    (plan,) = plan_lines([line(480, 492)], CARRIAGE, bidirectional=False, head=4350)
    assert plan.speed == 240
    assert 288 * abs(plan.stop - plan.start) > 5 * 240**2


def test_a_short_line_near_the_left_frame_takes_its_way_beyond_its_end():
    (plan,) = plan_lines([line(0, 12)], CARRIAGE, bidirectional=False, head=4350)
    assert (plan.speed, plan.start) == (240, 12)
    assert plan.print_to > 450 + 30
    assert 288 * (plan.stop - plan.start) > 5 * 240**2


def test_a_wide_line_is_printed_at_the_highest_speed_that_fits():
    width = 1584  # 13.2 inches, the print line of the specification
    centred = Geometry(4350, (4350 - width * 2.5) / 2)
    (plan,) = plan_lines([line(0, width)], centred, head=0, bidirectional=False)
    free = 195 - RESERVE
    assert run_up(plan.speed) <= free < run_up(plan.speed + 1)


def test_the_preselected_speed_is_not_exceeded():
    (plan,) = plan_lines([line(0, 960)], Geometry(4350, 450, max_speed=90))
    assert plan.speed == 90


# -- several lines --------------------------------------------------------------------------------------------


def test_lines_go_to_and_fro_and_the_axis_turns_around():
    plans = plan_lines([line(0, 960, n) for n in range(1, 6)], CARRIAGE)
    assert [plan.direction for plan in plans] == [-1, 1, -1, 1, -1]
    assert [plan.turn_around for plan in plans] == [False, True, True, True, True]
    assert all(plan.run_to is None for plan in plans)


def test_the_end_of_a_short_line_is_moved_out_to_the_run_up_of_a_long_one():
    short, long = plan_lines([line(0, 700, 1), line(0, 960, 2)], CARRIAGE, head=12)
    assert (short.direction, long.direction) == (1, -1)
    assert short.stop == long.start == 2850 + run_up(240)
    assert short.print_to == short.stop - 400


def test_printing_to_the_right_only_runs_back_before_every_line():
    lines = [line(0, 960, n) for n in range(1, 5)]
    plans = plan_lines(lines, CARRIAGE, bidirectional=False)
    assert [plan.direction for plan in plans] == [1] * 4
    assert [plan.run_to for plan in plans] == [450 - run_up(240)] * 4
    assert not any(plan.turn_around for plan in plans)
    assert sum(plan.seconds for plan in plans) > 1.5 * sum(plan.seconds for plan in plan_lines(lines, CARRIAGE))


def test_a_run_between_lines_keeps_to_the_highest_speed():
    slow = Geometry(4350, 450, max_speed=60)
    plans = plan_lines([line(0, 960, n) for n in (1, 2)], slow, bidirectional=False, head=12)
    way = plans[0].stop - plans[1].start
    forth = motion_time(plans[1].stop - plans[1].start, 60)
    assert plans[1].seconds == pytest.approx(motion_time(way, 60) + forth + 2 * 5e-3)


def test_two_lines_on_the_same_way_are_printed_without_turning_back():
    plans = plan_lines([line(0, 120, 1), line(1000, 1100, 2)], CARRIAGE, head=12)
    assert [plan.direction for plan in plans] == [1, 1]
    assert plans[1].run_to is None


def test_below_ten_inches_per_second_there_is_no_turn_around():
    plans = plan_lines([line(0, 960, n) for n in (1, 2)], Geometry(4350, 450, max_speed=59))
    assert [plan.direction for plan in plans] == [-1, 1]
    assert not plans[1].turn_around


def test_lines_of_different_speed_do_not_turn_around():
    geometry = Geometry(4350, 195)
    slow, fast = plan_lines([line(0, 1584, 1), line(200, 1000, 2)], geometry)
    assert slow.speed < fast.speed == 240
    assert not fast.turn_around


def test_each_line_begins_where_the_one_before_ended_or_after_a_run():
    text = "one\n" + " " * 50 + "two\n" + "three " * 12 + "\n" + " " * 70 + "4\nfive\n"
    plans = plan_lines(parse_text(text).lines, CARRIAGE)
    for before, after in pairwise(plans):
        assert after.start == (before.stop if after.run_to is None else after.run_to)


def test_no_lines_no_plans():
    assert plan_lines([], CARRIAGE) == ()


# -- what is refused --------------------------------------------------------------------------------------------


def test_lines_that_fit_nowhere_are_all_named_with_what_would_fit():
    job = parse_text("x" * 200 + "\nfits\n" + "y" * 155)
    with pytest.raises(InputError) as caught:
        plan_lines(job.lines, CARRIAGE, job_name="wide.txt")
    first, second = caught.value.problems
    assert (first.file, first.key, first.got) == ("wide.txt", "printed line 1", "ink from 0.00 in to 20.00 in")
    assert second.key == "printed line 3"
    assert "between 0.00 in and 12.95 in" in first.allowed
    assert "print.left_margin" in first.remedy


def test_what_is_said_to_fit_does_fit():
    assert plan_lines([line(0, 1554)], CARRIAGE)[0].speed == 20  # 12.95 in; 20 stops in 3 emitters as 18 does
    with pytest.raises(InputError):
        plan_lines([line(0, 1555)], CARRIAGE)


def test_a_paper_beyond_the_left_frame_is_refused():
    with pytest.raises(InputError, match=r"between 0\.08 in and"):
        plan_lines([line(0, 100)], Geometry(4350, 0))
