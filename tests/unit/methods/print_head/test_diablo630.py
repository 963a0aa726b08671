"""The control codes of the Diablo 630, one by one."""

from dataclasses import astuple

import pytest

from detent.methods.print_head.diablo630 import CONTROL, ESCAPE, Ignored, parse_diablo

ESC = b"\x1b"


def hmi(n):
    return ESC + b"\x1f" + bytes([n + 1])


def vmi(n):
    return ESC + b"\x1e" + bytes([n + 1])


def places(stream):
    """Every character as (char, column, baseline)."""
    return [(c.char, c.column, line.baseline) for line in parse_diablo(stream).lines for c in line.characters]


def notes(stream):
    return [(note.offset, note.code) for note in parse_diablo(stream).notes]


# -- the table ---------------------------------------------------------------------------------------------


def test_names_say_which_byte_it_is():
    for byte, code in ESCAPE.items():
        assert code.parameters == code.name.endswith(" n"), code
        if byte > 0x20:
            assert code.name == f"ESC {chr(byte)}"
    assert (CONTROL[0x00].name, CONTROL[0x0D].name, CONTROL[0x7F].name) == ("NUL", "CR", "DEL")
    assert (ESCAPE[0x1F].name, ESCAPE[0x1E].name, ESCAPE[0x0E].name) == ("ESC US n", "ESC RS n", "ESC SO n")
    names = [code.name for code in [*CONTROL.values(), *ESCAPE.values()]]
    assert len(names) == len(set(names))


def test_every_code_that_is_not_supported_is_noted_with_its_meaning():
    unsupported = [code for code in ESCAPE.values() if code.action is Ignored.NOT_SUPPORTED]
    stream = b"".join(ESC + bytes([byte]) + b"1" * c.parameters for byte, c in ESCAPE.items() if c in unsupported)
    job = parse_diablo(stream)
    assert [note.code for note in job.notes] == [code.name for code in unsupported]
    assert all(code.meaning in note.text for note, code in zip(job.notes, unsupported, strict=True))
    assert job.account.noted == len(stream)


def test_accepted_codes_are_counted_and_change_nothing():
    job = parse_diablo(b"a\x07\x07\0b" + ESC + b"/c")
    assert job.accepted == {"BEL": 2, "NUL": 1, "ESC /": 1}
    assert [c.column for c in job.lines[0].characters] == [0, 12, 24]
    assert (job.account.printed, job.account.accepted) == (3, 5)


# -- distances and places -------------------------------------------------------------------------------------


def test_power_on_is_ten_characters_and_six_lines_per_inch():
    assert places(b"ab\r\nc") == [("a", 0, 0), ("b", 12, 0), ("c", 0, 8)]


def test_line_feed_keeps_the_carriage_and_return_keeps_the_paper():
    assert places(b"a\nb\rc") == [("a", 0, 0), ("c", 0, 8), ("b", 12, 8)]


def test_motion_indices_are_one_less_than_their_parameter():
    assert places(hmi(10) + vmi(6) + b"ab\nc") == [("a", 0, 0), ("b", 10, 0), ("c", 20, 6)]
    assert places(hmi(0) + b"ab") == [("a", 0, 0), ("b", 0, 0)]
    assert places(hmi(10) + b"a" + ESC + b"Sab") == [("a", 0, 0), ("a", 10, 0), ("b", 22, 0)]


def test_a_parameter_may_be_an_escape():
    assert places(hmi(26) + b"aa") == [("a", 0, 0), ("a", 26, 0)]  # n = 27 = ESC


@pytest.mark.parametrize("code", [b"\x1f", b"\x1e", b"\t", b"\x0b", b"\x0c"])
def test_a_parameter_of_zero_is_noted_and_ignored(code):
    stream = b"a" + ESC + code + b"\0b\n"
    assert [note[0] for note in notes(stream)] == [1]
    assert places(stream) == [("a", 0, 0), ("b", 12, 0)]


def test_absolute_tab_counts_motion_indices_from_the_left_edge():
    assert places(b"   " + ESC + b"9" + hmi(10) + ESC + b"\t\x05x") == [("x", 40, 0)]


def test_absolute_line_counts_motion_indices_from_the_top_of_the_page():
    assert places(b"\n\n\n" + ESC + b"\x0b\x02x") == [("x", 0, 8)]
    assert places(b"\x0c" + ESC + b"\x0b\x02x") == [("x", 0, 528 + 8)]
    assert notes(ESC + b"\x0b\x43") == [(0, "ESC VT n")]  # line 66 of a page that ends with line 65


def test_offset_widens_and_narrows_every_advance():
    assert places(ESC + b"\x11\x02ab") == [("a", 0, 0), ("b", 14, 0)]
    assert places(ESC + b"\x11\x43ab") == [("a", 0, 0), ("b", 9, 0)]
    assert places(ESC + b"\x11\x43\rab") == [("a", 0, 0), ("b", 12, 0)]


def test_tab_stops():
    assert places(b"\tx") == [("x", 96, 0)]
    assert places(b"  " + ESC + b"1\r\tx") == [("x", 24, 0)]
    assert places(ESC + b"2  " + ESC + b"1  " + ESC + b"1\r  " + ESC + b"8\r\tx") == [("x", 48, 0)]
    assert notes(ESC + b"2\tx") == [(2, "HT")]


def test_vertical_tab_stops():
    assert places(b"\n\n" + ESC + b"-" + ESC + b"\x0b\x01\x0bx") == [("x", 0, 16)]
    assert notes(b"\x0b") == [(0, "VT")]


def test_left_margin():
    assert places(b"  " + ESC + b"9x\r\ny") == [("x", 24, 0), ("y", 24, 8)]


def test_small_motions():
    assert places(b"a\bb") == [("a", 0, 0), ("b", 0, 0)]
    assert places(b"a" + ESC + b"\bb") == [("a", 0, 0), ("b", 11, 0)]
    assert places(b"a" + ESC + b"Ub" + ESC + b"Dc") == [("a", 0, 0), ("c", 24, 0), ("b", 12, 4)]
    assert places(b"\n\na" + ESC + b"\nb") == [("b", 12, 8), ("a", 0, 16)]


def test_two_half_feeds_are_a_line_even_where_the_half_is_odd():
    assert places(vmi(7) + b"a" + ESC + b"U" + ESC + b"Ub") == [("a", 0, 0), ("b", 12, 7)]


def test_the_carriage_stops_at_the_left_and_says_so():
    job = parse_diablo(b"\bx")
    assert [(n.offset, n.code) for n in job.notes] == [(0, "BS")]
    assert "left stop" in job.notes[0].text
    assert job.lines[0].first_column == 0


def test_the_paper_stops_at_the_top_of_the_job_and_says_so():
    job = parse_diablo(ESC + b"\nx")
    assert "top of the job" in job.notes[0].text
    assert job.lines[0].baseline == 0


# -- pages ----------------------------------------------------------------------------------------------------


def test_form_feed_keeps_the_carriage():
    job = parse_diablo(b"a\x0cb")
    assert [(line.page, line.baseline, line.first_column) for line in job.lines] == [(1, 0, 0), (2, 528, 12)]


def test_lines_per_page_begin_a_form_here():
    job = parse_diablo(b"\n" + ESC + b"\x0c\x0a" + b"a\x0cb")
    assert [(line.page, line.baseline) for line in job.lines] == [(2, 8), (3, 88)]


def test_margins_of_the_page():
    top_at_2 = b"\n\n" + ESC + b"T"
    bottom_at_4 = b"\n\n" + ESC + b"L"
    job = parse_diablo(top_at_2 + bottom_at_4 + b"a\nb")
    assert [(line.page, line.baseline) for line in job.lines] == [(1, 32), (2, 528 + 16)]
    job = parse_diablo(top_at_2 + bottom_at_4 + ESC + b"Ca\nb")
    assert [(line.page, line.baseline) for line in job.lines] == [(1, 32), (1, 40)]


# -- direction ------------------------------------------------------------------------------------------------


def test_backward_printing_strikes_and_then_moves_left():
    assert places(b"    " + ESC + b"6cba") == [("a", 24, 0), ("b", 36, 0), ("c", 48, 0)]


def test_backward_printing_turns_blanks_and_backspaces_round_but_not_tabs():
    assert places(b"    " + ESC + b"6 x") == [("x", 36, 0)]
    assert places(ESC + b"6\bx") == [("x", 12, 0)]
    assert places(ESC + b"6" + ESC + b"\bx") == [("x", 1, 0)]
    assert places(ESC + b"6\tx") == [("x", 96, 0)]
    assert places(ESC + b"6" + ESC + b"\t\x03x") == [("x", 24, 0)]


@pytest.mark.parametrize("end", [b"\r" + ESC + b"\t\x03", ESC + b"\t\x03" + ESC + b"5"], ids=["CR", "ESC 5"])
def test_backward_printing_ends(end):
    assert places(ESC + b"6" + end + b"ab") == [("a", 24, 0), ("b", 36, 0)]


def test_new_line_of_itself_at_the_right_end():
    stream = ESC + b"?" + ESC + b"\t\x84" + b"ab"
    assert places(stream) == [("a", 1572, 0), ("b", 0, 8)]
    assert places(ESC + b"!" + ESC + b"\t\x84" + b"ab") == [("a", 1572, 0), ("b", 1584, 0)]


# -- looks ----------------------------------------------------------------------------------------------------


def struck(stream):
    return [(c.char, c.column, c.strike) for c in parse_diablo(stream).lines[0].characters]


def test_bold_strikes_twice_and_shadow_strikes_beside():
    assert struck(ESC + b"Oa" + ESC + b"&b") == [("a", 0, 2), ("b", 12, 1)]
    assert struck(ESC + b"Wa" + ESC + b"&b") == [("a", 0, 1), ("a", 1, 1), ("b", 12, 1)]


def test_overstriking_the_same_letter_is_bold():
    assert struck(b"a\ba\ba") == [("a", 0, 3)]


def test_underscore_marks_letters_and_fills_blanks():
    (line,) = parse_diablo(b"x" + ESC + b"Ea b" + ESC + b"Rc d").lines
    assert [(c.char, c.column, c.underline) for c in line.characters] == [
        ("x", 0, False),
        ("a", 12, True),
        ("_", 24, False),
        ("b", 36, True),
        ("c", 48, False),
        ("d", 72, False),
    ]


@pytest.mark.parametrize("mode", [b"O", b"W", b"E", b"7", b"3", b"6"])
def test_a_carriage_return_ends_the_modes_of_the_line(mode):
    assert parse_diablo(ESC + mode + b"\rab").lines == parse_diablo(b"ab").lines


@pytest.mark.parametrize("mode", [b"O", b"W", b"E", b"\x11\x05", b"\x0eM"])
def test_esc_x_ends_word_processing(mode):
    assert parse_diablo(ESC + mode + ESC + b"Xab").lines == parse_diablo(b"ab").lines


def test_ribbon_colour_outlives_the_line():
    (line,) = parse_diablo(ESC + b"A\ra" + ESC + b"Bb").lines
    assert [c.red for c in line.characters] == [True, False]


def test_suppressed_characters_move_the_carriage_only():
    assert places(ESC + b"7ab\rc") == [("c", 0, 0)]
    assert parse_diablo(ESC + b"7ab").account.interpreted == 4


def test_characters_under_blank_and_filler():
    assert places(ESC + b"Y" + ESC + b"Z") == [("¢", 0, 0), ("¬", 12, 0)]
    assert parse_diablo(ESC + b"Y").account.printed == 2


def test_graphics_has_its_own_distances():
    assert places(ESC + b"3. .\n." + ESC + b"4ab") == [
        (".", 0, 0),
        (".", 2, 0),
        (".", 2, 1),
        ("a", 2, 1),
        ("b", 14, 1),
    ]
    assert places(ESC + b"3 \b.") == [(".", 0, 0)]
    assert places(vmi(0) + ESC + b"3\n.") == [(".", 0, 1)]


def test_program_mode_takes_a_byte_after_every_character():
    job = parse_diablo(ESC + b"\x0eMaHbH" + ESC + b"Xc")
    assert [(c.char, c.column) for c in job.lines[0].characters] == [("a", 0), ("b", 12), ("c", 24)]
    assert sum(astuple(job.account)) == job.length_bytes


def test_reset_restores_power_on_and_keeps_the_paper():
    settings = hmi(5) + vmi(3) + b"  " + ESC + b"9" + ESC + b"2" + ESC + b"A" + ESC + b"?" + ESC + b"O\n"
    (line,) = parse_diablo(settings + ESC + b"\rP" + b"ab\tc").lines
    assert [(c.char, c.column, c.strike, c.red) for c in line.characters] == [
        ("a", 0, 1, False),
        ("b", 12, 1, False),
        ("c", 96, 1, False),
    ]
    assert line.baseline == 3
    assert parse_diablo(settings + ESC + b"\x1aIab\tc").lines == (line,)


# -- what is not understood ---------------------------------------------------------------------------------


def test_unknown_bytes_and_codes_are_noted_with_their_offset():
    assert notes(b"a\x05b\xe9c" + ESC + b"z" + ESC + b"\x01") == [
        (1, "05 hex"),
        (3, "E9 hex"),
        (5, "ESC z"),
        (7, "ESC 01 hex"),
    ]


def test_an_escape_before_an_escape_is_ignored():
    assert notes(b"a" + ESC + ESC + b"6b") == [(1, "ESC")]


@pytest.mark.parametrize("tail", [ESC, ESC + b"\x1f", ESC + b"\t"])
def test_a_job_may_end_inside_a_code(tail):
    job = parse_diablo(b"ab" + tail)
    assert [(n.offset, job.account.noted) for n in job.notes] == [(2, len(tail))]


def test_other_functions_of_a_selecting_code_are_noted():
    assert notes(ESC + b"\rQ" + ESC + b"\x1aZ" + ESC + b"\x0eX") == [(0, "ESC CR n"), (3, "ESC SUB n"), (6, "ESC SO n")]


def test_sub_ends_the_job_and_says_how_much_is_left():
    (note,) = parse_diablo(b"ab\x1a\x1a\x1a").notes
    assert (note.offset, note.text) == (2, "end of a CP/M file; the last 3 bytes are not read")
    (note,) = parse_diablo(b"ab\x1acd").notes
    assert "not all padding" in note.text
