"""Values put into a file that somebody wrote."""

import pytest

from detent.errors import InputError
from detent.files.patch import Change, NewValue, patch


def put(text: str, key: str, value: float, unit: str = "kg") -> str:
    """The text with one value, and again: a second time changes nothing."""
    values = [NewValue(key, value, unit, "95 %, log.csv")]
    made, _ = patch(text, values, "axis.toml")
    assert patch(made, values, "axis.toml") == (made, [])
    return made


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ('x = "850 g"', 'x = "912.3 g"  # identified, 850 g before: 95 %, log.csv'),
        ("x = '0.85kg'   # weighed", "x = '0.9123kg'   # weighed; identified, 0.85kg before: 95 %, log.csv"),
        ('x = """\n850 g"""', 'x = "912.3 g"  # identified, 850 g before: 95 %, log.csv'),
        ('\tx="1 kg"\t# a "b" # c', '\tx="0.9123 kg"\t# a "b" # c; identified, 1 kg before: 95 %, log.csv'),
    ],
)
def test_a_value_keeps_its_unit_its_quotes_and_its_comment(before: str, after: str) -> None:
    assert put(f"[a]\n{before}\ny = 1\n", "a.x", 0.9123) == f"[a]\n{after}\ny = 1\n"


def test_what_an_earlier_time_said_is_replaced() -> None:
    once = put('[a]\nx = "850 g"  # weighed\n', "a.x", 0.9)
    assert put(once, "a.x", 0.8) == '[a]\nx = "800 g"  # weighed; identified, 900 g before: 95 %, log.csv\n'


@pytest.mark.parametrize(
    ("before", "key", "after"),
    [
        ("[a]\nx = 1\n\n# about b\n[b]\n", "a.z", "[a]\nx = 1\nz = 2\n\n# about b\n[b]\n"),
        ("[a]\n# none\n", "a.z", "[a]\nz = 2\n# none\n"),
        ("[a]\n  x = [1,\n2]\n[a.b]\n", "a.z", "[a]\n  x = [1,\n2]\n  z = 2\n[a.b]\n"),
        ("[a]\nb.x = 1\n[c]\n", "a.b.z", "[a]\nb.x = 1\nb.z = 2\n[c]\n"),
        ("[a]\nb.x = 1\n[c]\n", "a.b.c.z", "[a]\nb.x = 1\nb.c.z = 2\n[c]\n"),
        ("[a]\nx = 1\n\n[c]\ny = 1\n\n", "a.b.z", "[a]\nx = 1\n\n[c]\ny = 1\n\n[a.b]\nz = 2\n"),
        ("# head\n[a.b.c]\nx = 1", "a.b.z", "# head\n[a.b.c]\nx = 1\n\n[a.b]\nz = 2\n"),
        ("# head\n[a]", "z", "# head\nz = 2\n[a]"),
    ],
)
def test_a_key_that_the_file_does_not_have_stands_below_the_others_of_its_table(
    before: str, key: str, after: str
) -> None:
    assert put(before, key, 2.0, "") == after.replace("z = 2", "z = 2  # identified: 95 %, log.csv")
    windows = put(before.replace("\n", "\r\n"), key, 2.0, "")
    assert windows == put(before, key, 2.0, "").replace("\n", "\r\n")


def test_a_table_in_one_line_has_no_room_for_a_comment() -> None:
    text = '[m]\nf = {p = {c = "1 N"}, n.c = "2 N"} # both\n'
    assert put(text, "m.f.p.c", 3.0, "N") == '[m]\nf = {p = {c = "3 N"}, n.c = "2 N"} # both\n'
    assert put(text, "m.f.n.c", 3.0, "N") == '[m]\nf = {p = {c = "1 N"}, n.c = "3 N"} # both\n'
    made = put(text, "m.f.q.c", 3.0, "N")
    assert made.endswith("} # both\n")
    assert made.count("\n") == 2


def test_what_changed_is_told() -> None:
    values = [NewValue("a.x", 1.0, "kg", ""), NewValue("a.y", 2.0, "", ""), NewValue("a.z", 3.0, "N", "")]
    _, changes = patch('[a]\nx = "1 kg"\ny = 1\n', values, "axis.toml")
    assert changes == [Change("a.y", "1", "2"), Change("a.z", "", '"3 N"')]
    assert [str(one) for one in changes] == ["a.y: 1 -> 2", 'a.z: not stated -> "3 N"']


def test_an_order_of_tables_that_tomlkit_would_change_is_refused() -> None:
    text = "[[k]]\na = 1\n[m]\nx = 1\n[[k]]\na = 2\n"
    with pytest.raises(InputError, match=r"axis\.toml: got .*no values can be put into"):
        patch(text, [NewValue("m.x", 2.0, "", "")], "axis.toml")
