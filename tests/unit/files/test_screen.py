import numpy as np
import pytest

from detent.files.screen import LINES, WIDTH, Block, Screen, brief

ROWS = [(f"row {k}", "x" * k) for k in range(200)]


def test_a_long_table_is_cut_where_the_screen_ends_and_says_how_much_is_left() -> None:
    made = Screen("title", [Block("first", ("a", "b"), ROWS, 100, ".all"), Block("second", (), ROWS)], "foot").text
    lines = made.split("\n")
    assert len(lines) <= LINES
    assert max(map(len, lines)) <= WIDTH
    assert lines[0] == "title"
    assert lines[-1] == "foot"
    (told,) = [line for line in lines if "more" in line]
    shown = sum("row " in line for line in lines)
    assert told == f"  ... {200 - shown} more: .all"


def test_a_notebook_gets_all_rows_escaped_and_folds_what_a_screen_leaves_out() -> None:
    page = Screen("<b>", [Block("all", ("a", "b"), ROWS, 4), Block("folded", (), [("<i>", "1")], 0)]).html
    assert page.startswith("<p><b>&lt;b&gt;</b></p>")
    assert page.count("<tr>") == 1 + 200 + 1
    assert "&lt;i&gt;" in page.partition("<details>")[2]


def test_what_would_steer_a_terminal_is_told_by_its_escape() -> None:
    screen = Screen("a\x1b[2J", [Block("", (), [("\x9b", "\u202e")])])
    for text in (screen.text, screen.html):
        assert not set(text) & set("\x1b\x9b\u202e")


@pytest.mark.parametrize(
    ("value", "told"),
    [
        (np.zeros((3, 2)), "float64 array, shape (3, 2)"),
        ([1, 2.0, "a"], "[1, 2.0, 'a']"),
        (tuple(range(1000)), "1000 int"),
        ({"a": np.zeros(2), "b": object()}, "2 ndarray or object"),
        (None, "None"),
    ],
)
def test_a_value_in_a_few_words(value: object, told: str) -> None:
    assert brief(value) == told
