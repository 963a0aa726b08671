"""A key whose value is a list of whole numbers: read, refused, shown and written back."""

from typing import Annotated

import pytest
from annotated_types import Ge, Le
from tests.dump import dump_spec

from detent.axisfile.tables import AxisSpec, AxisTable
from detent.errors import InputError
from detent.files.fields import Table, describe_allowed, leaf_fields, optional, required, table_of
from detent.files.problems import default_text, field_at, format_value
from detent.methods.check import check_spec
from detent.methods.method import Method
from detent.methods.registry import METHODS


class FaultTable(Table, frozen=True):
    """When the sensor fails."""

    ticks: list[int] = required("ticks without a pulse", "[3, 9]", max_length=4)
    gains: list[Annotated[int, Ge(0), Le(9)]] = optional("gain of each channel", [1, 2], min_length=1, max_length=3)
    skips: list[int] = optional("pulses left out", [])
    more: list[Annotated[int, Ge(1)]] | None = optional("further ticks", None)


class FaultSpec(AxisSpec, frozen=True):
    """An axis with faults."""

    axis: AxisTable
    fault: FaultTable


TEXT = '[axis]\nname = "x"\nmethod = "faulty"\n[fault]\nticks = [20000, 20096]\n'


@pytest.fixture(autouse=True)
def faulty(monkeypatch):
    class Faulty(Method[FaultSpec]):
        name = "faulty"
        title = "faulty: fails when told"
        spec = FaultSpec

    monkeypatch.setitem(METHODS.known, "faulty", Faulty())


def field(key):
    return field_at(FaultSpec, ("fault", key))


@pytest.mark.parametrize(
    ("key", "allowed"),
    [
        ("ticks", "a list of whole numbers, such as [3, 9], at most 4 of them"),
        ("gains", "a list of whole numbers from 0 up to 9, such as [1, 2], at least 1 and at most 3 of them"),
        ("skips", "a list of whole numbers, such as [20000, 20096]"),
        ("more", "a list of whole numbers from 1, such as [20000, 20096]"),
    ],
)
def test_what_is_allowed_tells_kind_range_example_and_length(key, allowed):
    assert describe_allowed(field(key)) == allowed


def test_a_list_is_a_value_and_not_a_table():
    assert [path[-1] for path, _ in leaf_fields(FaultTable)] == ["ticks", "gains", "skips", "more"]
    assert table_of(field("ticks")) is None
    assert table_of(field("more")) is None


def test_a_list_is_shown_as_in_the_file(load_text):
    assert format_value(field("ticks"), [20000, 20096]) == "[20000, 20096]"
    assert [default_text(field(key)) for key in ("ticks", "gains", "skips", "more")] == ["", "[1, 2]", "[]", "none"]
    rows = {row.key: row for row in check_spec(load_text(TEXT, "fault.gains=[3]")).rows}
    row = rows["fault.ticks"]
    assert (row.value, row.written, row.origin) == ("[20000, 20096]", "[20000, 20096]", "axis.toml line 5")
    assert (rows["fault.gains"].value, rows["fault.gains"].origin) == ("[3]", "--set")
    assert (rows["fault.skips"].value, rows["fault.skips"].origin) == ("[]", "default")


@pytest.mark.parametrize(
    ("override", "value"),
    [
        ("fault.ticks=[1, 2]", [1, 2]),
        ("fault.ticks = [ 1,2, ] ", [1, 2]),
        ("fault.ticks=[]", []),
        ("fault.ticks=[-1, 0x10, 1_000]", [-1, 16, 1000]),
    ],
)
def test_an_override_may_be_a_list(load_text, override, value):
    assert load_text(TEXT, override).spec.fault.ticks == value


@pytest.mark.parametrize("more", [(), ("fault.ticks=[]",), ("fault.more=[7, 8]", "fault.gains=[0, 9, 4]")])
def test_loading_what_was_dumped_gives_the_same_lists(load_text, more):
    spec = load_text(TEXT, *more).spec
    assert load_text(dump_spec(spec)).spec == spec


def test_a_default_is_not_shared_between_two_axes(load_text):
    one, other = (load_text(TEXT).spec.fault.gains for _ in range(2))
    assert one == other == [1, 2]
    assert one is not other


TICKS, GAINS = "ticks = [20000, 20096]", "gains = {}"


@pytest.mark.parametrize(
    ("key", "written", "got", "remedy"),
    [
        ("ticks", "20000", "20000", "in brackets, as in ticks = [3, 9]"),
        ("ticks", '"20000"', '"20000"', "in brackets"),
        ("ticks", "{ a = 1 }", "{ a = 1 }", "in brackets"),
        ("ticks", '[1, 2, "x"]', '"x" as element 3', "as a whole number, as in ticks = [3, 9]"),
        ("ticks", "[1.5, 2, true]", "1.5 as element 1, true as element 3", "as a whole number"),
        ("ticks", "[nan, [1], { a = 1 }, 1979-05-27]", "nan as element 1, [1] as element 2", "as a whole number"),
        ("ticks", '["a", "b", "c", "d"]', '"c" as element 3, and 1 more', "as a whole number"),
        ("ticks", f'["{"x" * 99}"]', '"xxx', "as a whole number"),
        ("ticks", "[\n1,\n1.5,\n]", "1.5 as element 2", "as a whole number"),
        ("ticks", "[1, 2, 3, 4, 5]", "5 numbers", "so many numbers (ticks without a pulse)"),
        ("gains", "[]", "0 numbers", "so many numbers"),
        ("gains", "[0, 10]", "10 as element 2", "in this range (gain of each channel)"),
        ("gains", "[-1, 10, 5]", "-1 as element 1, 10 as element 2", "every number of gains"),
        ("more", "[0]", "0 as element 1", "every number of more"),
        ("more", "1", "1", "in brackets, as in more = [20000, 20096]"),
    ],
)
def test_a_bad_list_is_one_problem_at_its_key(load_text, key, written, got, remedy):
    line = f"{key} = {written}"
    text = TEXT.replace(TICKS, line) if key == "ticks" else f"{TEXT}{line}\n"
    with pytest.raises(InputError) as caught:
        load_text(text)
    (problem,) = caught.value.problems
    assert str(problem).startswith(f"axis.toml:{5 if key == 'ticks' else 6}:1 fault.{key}: ")
    assert got in problem.got
    assert len(problem.got) < 250
    assert problem.allowed == describe_allowed(field(key))
    assert remedy in problem.remedy


@pytest.mark.parametrize(
    ("override", "got"),
    [
        ("fault.ticks=5", "5"),
        ("fault.ticks=[1, x]", "[1, x]"),
        ("fault.ticks=[1", "[1"),
        ("fault.ticks='[1]'", "'[1]'"),
        ('fault.ticks=[1, "x"]', '"x" as element 2'),
        (f"fault.ticks={'[' * 5000}", "[[["),
        ("fault.ticks=[1]\nnext = 2", "[1]"),
    ],
)
def test_a_bad_list_of_an_override_is_told_there(load_text, override, got):
    with pytest.raises(InputError) as caught:
        load_text(TEXT, override)
    (problem,) = caught.value.problems
    assert (problem.file, problem.key) == ("--set", "fault.ticks")
    assert got in problem.got


def test_a_missing_list_is_asked_for_with_its_example(load_text):
    with pytest.raises(InputError) as caught:
        load_text(TEXT.replace(TICKS, ""))
    (problem,) = caught.value.problems
    assert problem.remedy == "add ticks = [3, 9] in [fault] (ticks without a pulse)"
