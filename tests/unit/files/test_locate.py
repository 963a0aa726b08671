"""Places of keys in a TOML text."""

import pytest

from detent.files.locate import Place, find_place, locate_keys

TEXT = """\
# a comment
[axis]
name = "x" # after
  deep.key = 1
[mechanics.friction.right]
coulomb = "7 N"
inline = { a = 1, b = { c = 2 } }
"quoted key" = [
  1,
  2,
]
[[list]]
[ spaced . "out" ]
umlaut = "ä"
x = "ä"
"""


@pytest.mark.parametrize(
    ("path", "line", "column", "text"),
    [
        (("axis",), 2, 1, "axis"),
        (("axis", "name"), 3, 1, '"x"'),
        (("axis", "deep", "key"), 4, 3, "1"),
        (("mechanics", "friction", "right"), 5, 1, "mechanics.friction.right"),
        (("mechanics", "friction", "right", "coulomb"), 6, 1, '"7 N"'),
        (("mechanics", "friction", "right", "inline", "a"), 7, 12, "1"),
        (("mechanics", "friction", "right", "inline", "b", "c"), 7, 25, "2"),
        (("mechanics", "friction", "right", "quoted key"), 8, 1, "[\n  1,\n  2,\n]"),
        (("list",), 12, 1, "list"),
        (("spaced", "out", "x"), 15, 1, '"ä"'),
    ],
)
def test_every_kind_of_key_is_found(path, line, column, text):
    assert locate_keys(TEXT)[path] == Place(line, column, text)


def test_columns_count_characters_not_bytes():
    assert locate_keys('a = { "ä€" = 1, b = 2 }')["a", "b"].column == 17


def test_windows_line_ends_do_not_shift_anything():
    assert locate_keys(TEXT.replace("\n", "\r\n"))["spaced", "out", "x"].line == 15


def test_the_first_of_two_places_is_kept():
    assert locate_keys("a = 1\na = 2\n")["a",].line == 1


def test_a_table_that_is_only_implied_is_found_by_what_is_inside():
    assert find_place(locate_keys(TEXT), ("mechanics", "friction")).line == 5


def test_an_absent_key_is_placed_at_its_table():
    assert find_place(locate_keys(TEXT), ("axis", "method")).line == 2


def test_nothing_at_all_is_placed_at_the_start():
    assert find_place({}, ("axis",)) == Place(1, 1, "")


@pytest.mark.parametrize("text", ["", "= 1", "[", "a = ", "a.b. = 1", '"\\q" = 1', "\x00", "[[[[", "a = {b = }"])
def test_text_that_is_no_toml_does_no_harm(text):
    assert isinstance(locate_keys(text), dict)


def test_keys_around_an_error_are_found():
    places = locate_keys("a = 1\nb = = 2\n[t]\nc = 3\n")
    assert places["a",].line == 1
    assert places["t", "c"].line == 4


def test_tables_of_a_list_are_told_apart_by_their_number():
    places = locate_keys("[[m]]\na = 1\n[m.b]\nc = 2\n[[m]]\nb.c = 3\n[x]\nl = [1, {a = 4}] # two\n")
    assert {path: (place.line, place.column) for path, place in places.items()} == {
        ("m",): (1, 1),
        ("m", "0"): (1, 1),
        ("m", "0", "a"): (2, 1),
        ("m", "0", "b"): (3, 1),
        ("m", "0", "b", "c"): (4, 1),
        ("m", "1"): (5, 1),
        ("m", "1", "b", "c"): (6, 1),
        ("x",): (7, 1),
        ("x", "l"): (8, 1),
        ("x", "l", "1"): (8, 9),
        ("x", "l", "1", "a"): (8, 10),
    }
