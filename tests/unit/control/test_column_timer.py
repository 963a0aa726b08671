"""Print timing: which column, when, and how far off."""

import numpy as np
import pytest
from tests.print_head_rig import EMITTER, Rig

from detent.control.column_timer import (
    AHEAD,
    COLUMNS,
    HALF_EMITTER,
    NEVER,
    ColumnTimer,
    ColumnTimerParams,
    LineBuffer,
    fired,
    next_column,
    schedule,
    set_lead,
    start_line,
)
from detent.methods.print_head.controller import PERIOD_US

PITCH = 640  # 1/120 in = 2.5 emitters


@pytest.fixture
def p():
    return ColumnTimerParams(
        column_zero=100 * 256 - HALF_EMITTER,  # on an edge, as then every even column is
        column_pitch=PITCH,
        lead_per_speed=1147,
    )


def inked(*columns, bank=0):
    b = LineBuffer()
    for column in columns:
        b.ink[bank * COLUMNS + column] = 1
    return b


def started(first, last, direction, bank=0):
    r = ColumnTimer(bank=bank)
    start_line(r, first, last, direction)
    return r


def far_off(p, r, b, direction, emitters=1):
    """Emitters half a line before the columns."""
    for _ in range(emitters):
        schedule(p, r, b, 100 - direction * 4000, direction, 1000, 200)
    return r


@pytest.mark.parametrize(
    ("first", "last", "direction", "column"), [(0, 15, 1, 3), (15, 0, -1, 9), (4, 8, 1, 7), (8, 4, -1, 7)]
)
def test_white_columns_are_passed_at_the_first_emitter(p, first, last, direction, column):
    r = far_off(p, started(first, last, direction), inked(3, 7, 9), direction)
    assert (r.column, r.active, r.missed, r.fire_us) == (column, 1, 0, NEVER)


@pytest.mark.parametrize("direction", [1, -1])
def test_an_emitter_looks_at_no_more_than_so_many_columns(p, direction):
    """The head is 0.4 columns further at each: what is left is passed ahead of it."""
    r, b = started(*((0, 100) if direction > 0 else (100, 0)), direction), inked(*((40,) if direction > 0 else (60,)))
    places = [far_off(p, r, b, direction).column for _ in range(5)]
    passed = [min(AHEAD * (k + 1), 40) for k in range(5)]
    assert places == [k if direction > 0 else 100 - k for k in passed]
    assert r.active


def test_the_banks_are_separate(p):
    b = inked(5, bank=1)
    assert not far_off(p, started(0, 14, 1, bank=0), b, 1).active
    assert far_off(p, started(0, 14, 1, bank=1), b, 1).column == 5


@pytest.mark.parametrize(("first", "last", "direction"), [(10, 12, 1), (12, 10, -1)])
def test_a_white_line_is_done_at_its_first_emitter(p, first, last, direction):
    r = far_off(p, started(first, last, direction), inked(3), direction)
    assert (r.active, r.missed, r.fire_us) == (0, 0, NEVER)


@pytest.mark.parametrize(("first", "last", "direction"), [(20, 0, 1), (0, 20, -1)])
def test_an_empty_interval_is_done_at_once(first, last, direction):
    r = started(first, last, direction)
    assert not r.active
    assert r.fire_us == NEVER


def test_columns_beyond_the_buffer_are_cut_off(p):
    b = inked(0, COLUMNS - 1)
    r = started(-50, 5000, 1)
    assert (r.column, r.end_column) == (0, COLUMNS - 1)
    next_column(r)
    assert far_off(p, r, b, 1, COLUMNS // AHEAD).column == COLUMNS - 1
    next_column(r)
    assert not r.active


def test_white_is_passed_up_to_the_end_column(p):
    r = started(0, 10, 1)
    far_off(p, r, inked(3, 30), 1)
    next_column(r)
    far_off(p, r, inked(3, 30), 1)
    assert (r.column, r.active) == (10, 0)
    assert far_off(p, r, inked(3, 30), 1).column == 10


def test_lead_is_speed_times_flight_time(p):
    r = ColumnTimer()
    for s in (18, 240):
        set_lead(p, r, s)
        # s/6 in/s for 350 us, in 1/256 emitter; lead_per_speed itself is rounded to 1/65536 emitter
        assert r.lead == pytest.approx(s / 6 * 350e-6 * 300 * 256, rel=1e-3, abs=0.5)


@pytest.mark.parametrize(("direction", "column", "emitter"), [(1, 4, 109), (-1, 4, 111)])
def test_a_column_is_fired_between_the_emitters(p, direction, column, emitter):
    r = started(*((0, 15) if direction > 0 else (15, 0)), direction)
    # Column 4 lies where emitter 110 begins; the head passes its neighbour with 200 us per emitter.
    r.lead = 64
    schedule(p, r, inked(column), emitter, direction, 1000, 200)
    assert r.fire_us == 1000 + 200 * (256 - 64) // 256


def test_a_column_beyond_the_next_emitter_waits(p):
    b = inked(4)
    r = started(0, 15, 1)
    schedule(p, r, b, 108, 1, 1000, 200)
    assert (r.fire_us, r.missed) == (NEVER, 0)
    schedule(p, r, b, 109, 1, 1200, 200)
    # Exactly one emitter ahead belongs to the next emitter.
    assert r.fire_us == NEVER
    schedule(p, r, b, 110, 1, 1400, 200)
    assert r.fire_us == 1400


def test_a_due_column_is_not_scheduled_again(p):
    b = inked(4)
    r = started(0, 15, 1)
    schedule(p, r, b, 110, 1, 1400, 200)
    schedule(p, r, b, 111, 1, 1600, 200)
    assert (r.fire_us, r.missed) == (1400, 0)


def test_columns_behind_the_head_or_without_an_interval_are_missed(p):
    b = inked(2, 4, 8)
    r = started(0, 15, 1)
    schedule(p, r, b, 112, 1, 1000, 200)  # columns 2 and 4 lie at 105 and 110, column 8 at 120
    assert (r.missed, r.column, r.fire_us) == (2, 8, NEVER)
    schedule(p, r, b, 120, 1, 1000, 0)
    assert (r.missed, r.active) == (3, 0)


@pytest.mark.parametrize("direction", [1, -1])
def test_behind_a_fired_column_the_next_one_waits_for_its_emitter(p, direction):
    b = inked(4, 8)
    r = started(*((0, 15) if direction > 0 else (15, 0)), direction)
    column = far_off(p, r, b, direction).column
    schedule(p, r, b, 100 + column * 5 // 2, direction, 1000, 200)
    assert r.fire_us == 1000
    fired(r)
    assert (r.fired, r.column, r.fire_us, r.active) == (1, column + direction, NEVER, 1)
    schedule(p, r, b, 101 + column * 5 // 2 if direction > 0 else 99 + column * 5 // 2, direction, 1200, 200)
    assert (r.column, r.fire_us) == (12 - column, NEVER)
    fired(r)
    assert (r.fired, r.active) == (2, 1)
    assert not far_off(p, r, b, direction).active


def printed(rig, start, end):
    """Run a print, recorded at every tick."""
    rig.send_print(start, end)
    rows = rig.record(5, ["controller.head.columns.fired", "controller.head.columns.column", "plant.train.velocity"])
    assert rig.read_status() == 0
    return rows


@pytest.mark.parametrize("s", [18, 42, 60, 120, 240])
def test_every_inked_column_of_a_line_is_fired_once_and_in_order(s):
    rig = Rig().pretend_identified(emitter=1500)
    rig.set_speed(s)
    columns = np.sort(np.random.default_rng(s).choice(np.arange(480, 760), 150, replace=False))
    fired_before = 0
    for start, end, order in (
        (450 + 475 * 2.5, 450 + 765 * 2.5, columns),
        (450 + 765 * 2.5, 450 + 475 * 2.5, columns[::-1]),
    ):
        bank = 1 - rig.head.columns.bank
        rig.head.buffer.ink[:] = [0] * (2 * COLUMNS)
        for column in columns:
            rig.head.buffer.ink[bank * COLUMNS + int(column)] = 1
            rig.r.plant.paper.landed[bank * COLUMNS + int(column)] = 1 << 30
        rows = printed(rig, start, round(end))
        assert rig.head.speed == s
        c = rig.head.columns
        assert (c.bank, c.active, c.missed, c.fired - fired_before) == (bank, 0, 0, 150)
        steps = np.flatnonzero(np.diff(rows["controller.head.columns.fired"], prepend=fired_before))
        assert len(steps) == 150, "two columns in one period"
        np.testing.assert_array_equal(rows["controller.head.columns.column"][steps - 1], order)
        fired_before = c.fired
        landed = np.array(rig.r.plant.paper.landed[bank * COLUMNS : (bank + 1) * COLUMNS])
        assert np.all(landed[columns] != 1 << 30)
        # What is left is speed error x flight time, the extrapolation, and the microseconds of the times.
        direction = 1 if order is columns else -1
        speed_error = rows["plant.train.velocity"][steps - 1] - direction * s / 6 * 0.0254
        rounding = EMITTER / 50 + 2e-6 * s / 6 * 0.0254
        np.testing.assert_allclose(landed[order] * 1e-9, speed_error * 350e-6, rtol=0, atol=rounding)
        assert np.abs(speed_error).max() < 0.1 * s / 6 * 0.0254
        assert rig.r.plant.paper.offset * 1e9 == pytest.approx(landed[order[-1]], abs=1)


@pytest.mark.parametrize("order", [1, -1], ids=["right", "left"])
@pytest.mark.parametrize("s", [60, 240])
def test_columns_land_at_the_left_margin_and_every_120th_of_an_inch_from_there(s, order):
    """Taken from the carriage itself, whose zero is the left frame, where it is when the wires leave."""
    rig = Rig().pretend_identified(emitter=1500)
    rig.set_speed(s)
    columns = [500, 501, 540, 543, 600]
    places = [450 + 2.5 * column for column in columns[::order]]
    for column in columns:
        rig.head.buffer.ink[COLUMNS * (1 - rig.head.columns.bank) + column] = 1
    rig.send_print(places[0] - order * 5, round(places[-1] + order * 5))
    lines, plant, margin, off = rig.r.lines, rig.r.plant, rig.spec.printing.left_margin, []
    while len(off) < len(columns):
        before, now, v = plant.sampled, plant.train.position, plant.train.velocity
        rig.run(1)
        for k in range(lines.fired):
            assert lines.fired_us[k] < PERIOD_US
            landed = before + (now - before) * lines.fired_us[k] / PERIOD_US + v * 350e-6
            off.append(landed - margin - (lines.place[k] % COLUMNS) * 0.0254 / 120)
    assert np.abs(off).max() < 0.1 * s / 6 * 0.0254 * 350e-6 + EMITTER / 50
    # No constant of the order of an emitter is left in either direction.
    assert abs(np.mean(off)) < EMITTER / 10
