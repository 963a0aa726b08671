"""For every job: reading is total, every byte is accounted for, and every plan obeys the axis's rules."""

from dataclasses import astuple
from itertools import pairwise, product

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from detent.control.speed_selection import select_speed
from detent.errors import InputError
from detent.methods.print_head import line_plan
from detent.methods.print_head.diablo630 import CONTROL, ESCAPE, parse_diablo
from detent.methods.print_head.line_plan import RESERVE, STOP_TOLERANCE, Geometry, motion_time, plan_lines
from detent.methods.print_head.print_job import load_job, parse_text
from detent.methods.print_head.printed_page import PrintedCharacter, PrintLine

codes = st.sampled_from(
    [bytes([byte]) for byte in CONTROL] + [b"\x1b" + bytes([byte]) for byte in ESCAPE] + [b"\x1b", b"a", b"b ", b"_"]
)
# Random bytes seldom hold a whole control code, streams of codes seldom an unknown byte: both, and mixtures.
streams = st.one_of(
    st.binary(max_size=300),
    st.lists(st.one_of(codes, st.binary(min_size=1, max_size=2)), max_size=80).map(b"".join),
)


def assert_well_formed(job, length):
    assert job.length_bytes == sum(astuple(job.account)) == length
    assert [line.number for line in job.lines] == list(range(1, len(job.lines) + 1))
    places = [(line.page, line.baseline) for line in job.lines]
    assert places == sorted(set(places))
    assert job.pages == (job.lines[-1].page if job.lines else 0)
    for line in job.lines:
        columns = [c.column for c in line.characters]
        assert columns == sorted(columns)
        assert columns[0] == line.first_column >= 0
        assert line.last_column >= columns[-1] + 6
        assert all(c.strike >= 1 and c.width_columns >= 0 for c in line.characters)
        assert line.text
    offsets = [note.offset for note in job.notes]
    assert offsets == sorted(offsets)
    assert all(0 <= offset < length for offset in offsets)


@given(streams)
def test_reading_a_stream_is_total_and_accounts_for_every_byte(data):
    job = parse_diablo(data)
    assert_well_formed(job, len(data))
    assert bool(job.lines) == (job.account.printed > 0)
    assert job.account.noted == 0 or job.notes
    assert sum(job.accepted.values()) <= job.account.accepted
    # What is on paper was struck: one strike at least per printed code, and those of bold, shadow and accents.
    strikes = sum(c.strike for line in job.lines for c in line.characters)
    assert strikes >= job.account.printed / 3  # ESC Y and its byte of hammer force are three bytes


@given(st.text(max_size=300), st.sampled_from(["utf-8", "latin-1"]))
def test_reading_text_is_total_and_accounts_for_every_byte(text, encoding):
    job = parse_text(text, encoding=encoding)
    assert_well_formed(job, len(text.encode(encoding, errors="replace")))
    assert sum(c.strike for line in job.lines for c in line.characters) <= len(text)


@given(st.text(alphabet="abcXYZ09.,;_ \n", max_size=400))
def test_plain_text_is_the_same_job_in_both_readers(text):
    as_stream = parse_diablo(text.replace("\n", "\r\n").encode("ascii"))
    assert as_stream.lines == parse_text(text).lines


@given(st.text(alphabet="abcdefg", min_size=1, max_size=60), st.integers(1, 30))
def test_a_line_sent_backwards_is_the_line(text, spacing):
    index = b"\x1b\x1f" + bytes([spacing + 1])
    forward = parse_diablo(index + text.encode("ascii"))
    there = b"\x1b\t" + bytes([len(text)])
    backward = parse_diablo(index + there + b"\x1b6" + text[::-1].encode("ascii"))
    assert backward.lines == forward.lines


@settings(max_examples=60)
@given(data=streams)
def test_loading_any_file_gives_a_job_or_an_input_error(data, tmp_path_factory):
    file = tmp_path_factory.mktemp("jobs") / "job"
    file.write_bytes(data)
    problems, job = (), None
    try:
        job = load_job(file)
    except InputError as error:
        problems = error.problems
    if job is None:
        assert problems
        assert all(problem.got and problem.allowed and problem.remedy for problem in problems)
    else:
        assert job.lines
        assert_well_formed(job, len(data))


# -- plans ----------------------------------------------------------------------------------------------------


@st.composite
def geometries(draw):
    width = draw(st.integers(1500, 6000))
    column0 = draw(st.floats(20, 600))
    return Geometry(width, column0, max_speed=draw(st.sampled_from([18, 30, 59, 60, 90, 154, 180, 239, 240])))


@st.composite
def pages(draw, geometry, max_lines=12):
    """Lines that lie between the frames with at least the room that the lowest speed needs."""
    right = int((geometry.width_emitters - 24 - geometry.column0_emitters) / 2.5)
    lines = []
    for number in range(1, draw(st.integers(1, max_lines)) + 1):
        first = draw(st.integers(5, right - 12))
        last = draw(st.integers(first + 12, right))
        hits = (PrintedCharacter("a", first, 12), PrintedCharacter("b", last - 12, 12))
        lines.append(PrintLine(number, 8 * number, tuple(sorted(hits, key=lambda hit: hit.column))))
    return lines


jobs = geometries().flatmap(lambda geometry: st.tuples(st.just(geometry), pages(geometry)))
small_jobs = geometries().flatmap(lambda geometry: st.tuples(st.just(geometry), pages(geometry, max_lines=4)))


def estimated_time(plans):
    return sum(plan.seconds for plan in plans)


def assert_obeys_the_axis(plan, geometry):
    d, s = plan.direction, plan.speed
    ends = [geometry.emitter(plan.line.first_column), geometry.emitter(plan.line.last_column)]
    begin, end = ends if d > 0 else ends[::-1]
    assert plan.print_from == round(begin * 256)
    assert d * (plan.print_to - end) >= 0  # the ink is inside the printed interval
    assert d * (begin - plan.start) >= 1.05 * s * s / 144  # the run-up
    assert 288 * d * (plan.stop - plan.start) > 5 * s * s  # the axis keeps the speed
    assert abs(plan.stop - (plan.print_to + d * s * s / 144)) < 1
    assert RESERVE <= plan.stop <= geometry.width_emitters - RESERVE
    assert 18 <= s <= geometry.max_speed
    if plan.run_to is not None:
        assert plan.run_to == plan.start
        assert RESERVE <= plan.run_to <= geometry.width_emitters - RESERVE


@given(jobs, st.booleans())
def test_every_plan_obeys_the_axis(job, bidirectional):
    geometry, lines = job
    plans = plan_lines(lines, geometry, bidirectional=bidirectional)
    assert [plan.line for plan in plans] == lines
    for plan in plans:
        assert_obeys_the_axis(plan, geometry)
        assert bidirectional or plan.direction == 1
    for before, after in pairwise(plans):
        assert after.start == (before.stop if after.run_to is None else after.run_to)
        opposite = before.direction == -after.direction
        assert after.turn_around == (opposite and before.speed == after.speed >= 60)
        assert after.run_to is None or not opposite  # a line the other way never needs a RUN


@given(jobs)
def test_even_a_stop_that_misses_its_place_leaves_the_run_up_and_the_frames(job):
    geometry, lines = job
    plans = plan_lines(lines, geometry)
    for before, after in pairwise(plans):
        assert STOP_TOLERANCE < before.stop < geometry.width_emitters - STOP_TOLERANCE
        d, s = after.direction, after.speed
        assert d * (after.print_from / 256 - after.start) - STOP_TOLERANCE >= 1.05 * s * s / 144 - 1 / 256
        assert 288 * (d * (after.stop - after.start) - STOP_TOLERANCE) > 5 * s * s


@given(jobs)
def test_times_are_those_of_the_motions(job):
    geometry, lines = job
    place = geometry.width_emitters
    for plan in plan_lines(lines, geometry):
        pause = 0 if plan.turn_around else 5e-3
        run = 0.0
        if plan.run_to is not None:
            way = abs(plan.run_to - place)
            run = motion_time(way, select_speed(way, geometry.max_speed)) + 5e-3
        assert plan.seconds == pytest.approx(motion_time(abs(plan.stop - plan.start), plan.speed) + run + pause)
        place = plan.stop


@given(jobs)
def test_both_ways_is_never_slower_than_to_the_right_only(job):
    geometry, lines = job
    to_the_right = estimated_time(plan_lines(lines, geometry, bidirectional=False))
    assert estimated_time(plan_lines(lines, geometry)) <= to_the_right + 1e-9


def total_of(lines, geometry, directions):
    """Time of one fixed choice of directions; infinite where a line does not fit in its own."""
    passes = [line_plan._passes(line, geometry, (d,)) for line, d in zip(lines, directions, strict=True)]
    if not all(passes):
        return float("inf")
    chosen = [each for (each,) in passes]
    return estimated_time(line_plan._plans(lines, chosen, geometry.width_emitters, geometry.max_speed))


@given(small_jobs)
def test_no_other_choice_of_directions_is_faster(job):
    geometry, lines = job
    chosen = estimated_time(plan_lines(lines, geometry))
    best = min(total_of(lines, geometry, directions) for directions in product((1, -1), repeat=len(lines)))
    assert chosen == pytest.approx(best, rel=1e-9)


@given(jobs)
def test_one_more_step_of_speed_would_not_fit(job):
    geometry, lines = job
    for plan in plan_lines(lines, geometry):
        s = plan.speed + 1
        if s > geometry.max_speed:
            continue
        ends = [geometry.emitter(plan.line.first_column), geometry.emitter(plan.line.last_column)]
        if plan.direction < 0:
            ends = [geometry.width_emitters - end for end in reversed(ends)]
        room_before = ends[0] - RESERVE - 1
        room_after = geometry.width_emitters - RESERVE - ends[1] - 1
        way = geometry.width_emitters - 2 * RESERVE - 2 * STOP_TOLERANCE - 2
        fits = room_before >= 1.05 * s * s / 144 + STOP_TOLERANCE + 1 and room_after >= s * s / 144 + 1
        assert not (fits and 288 * way > 5 * s * s)
