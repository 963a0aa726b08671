"""The table ``[tolerance]``: what it says, and what is told where it makes no sense."""

import pytest
from tests.acceptance.test_golden_bits import EXAMPLES

from detent.axisfile.tolerance import Tolerance
from detent.errors import InputError
from detent.files.source import parse_source
from detent.methods.load import axis_of

TEXT = (EXAMPLES / "cascade.toml").read_text(encoding="utf-8")


def read(*entries: str) -> dict[str, Tolerance]:
    return dict(axis_of(parse_source("axis.toml", "\n".join([TEXT, "[tolerance]", *entries]))).tolerance)


@pytest.mark.parametrize(
    ("entry", "low", "high"),
    [
        ('"mechanics.load_mass" = "10 %"', 27.0, 33.0),
        ('mechanics.load_mass = "10 %"', 27.0, 33.0),
        ('"mechanics.coupling.stiffness" = ["51 N/um", "69 N/um"]', 51e6, 69e6),
        ('"method.position_gain" = [80, 95.5]', 80.0, 95.5),
        ('"drive.delay" = [1, 2]', 1, 2),
        ('"mechanics.coupling.stiffness" = { interval = "10 %", distribution = "normal" }', 54e6, 66e6),
    ],
)
def test_an_entry_is_an_interval(entry, low, high):
    (one,) = read(entry).values()
    assert (one.low, one.high) == (pytest.approx(low), pytest.approx(high))
    assert one.normal == ("normal" in entry)


def test_a_table_of_its_own_reads_the_same():
    assert read("[tolerance.mechanics]", 'load_mass = "10 %"') == read('"mechanics.load_mass" = "10 %"')


def test_what_is_not_known_changes_nothing_of_the_axis():
    plain = axis_of(parse_source("axis.toml", TEXT))
    with_it = axis_of(parse_source("axis.toml", f'{TEXT}\n[tolerance]\n"mechanics.load_mass" = "10 %"\n'))
    assert with_it.spec == plain.spec
    assert plain.tolerance == {}


@pytest.mark.parametrize(
    ("entry", "got", "expected"),
    [
        ('"mechanics.load_mas" = "10 %"', "unknown key", "mechanics.load_mass"),
        ('"mechanics.load_mass" = "200 %"', "200 %", "below 100 %"),
        ('"mechanics.load_mass" = "ten %"', "ten %", "below 100 %"),
        ('"mechanics.load_mass" = 3', "3", "in brackets"),
        ('"mechanics.load_mass" = ["33 kg", "27 kg"]', "33 kg", "smaller value first"),
        ('"mechanics.load_mass" = ["31 kg", "33 kg"]', "31 kg", "30 kg"),
        ('"mechanics.load_mass" = ["30 kg", "30 kg"]', "30 kg", "holds the value"),
        ('"mechanics.load_mass" = ["-1 kg", "33 kg"]', "-1 kg", "from 0 kg"),
        ('"mechanics.load_mass" = ["27 mm", "33 kg"]', "27 mm", "a mass"),
        ('"mechanics.load_mass" = { interval = "10 %", distribution = "gauss" }', "gauss", '"normal"'),
        ('"mechanics.load_mass" = { distribution = "normal" }', "normal", "interval"),
        ('"drive.delay" = "10 %"', "10 %", "in brackets"),
        ('"drive.delay" = [0.5, 2]', "0.5", "as the key itself"),
        ('"drive.delay" = { interval = [0, 2], distribution = "normal" }', "normal", "uniform"),
        ('"axis.name" = "10 %"', "axis.name, which is none", "number"),
        ('"load_encoder.resolution" = "10 %"', "which has none", "state load_encoder.resolution"),
        ('"method.position_gain" = [nan, 50]', "nan", "as the key itself"),
    ],
)
def test_what_makes_no_sense_is_told_with_its_line(entry, got, expected):
    with pytest.raises(InputError) as refused:
        read(entry)
    (problem,) = refused.value.problems
    assert problem.line == TEXT.count("\n") + 3
    assert got in problem.got
    assert expected in f"{problem.allowed} {problem.remedy}"


def test_it_is_a_table():
    with pytest.raises(InputError, match="a table"):
        axis_of(parse_source("axis.toml", f"tolerance = 3\n{TEXT}"))


@pytest.mark.parametrize("share", [0.025, 0.5, 0.975])
def test_a_normal_distribution_has_95_percent_inside(share):
    one = Tolerance("a", 1.0, 3.0, normal=True)
    assert one.at(share) == pytest.approx({0.025: 1.0, 0.5: 2.0, 0.975: 3.0}[share])


def test_whole_numbers_are_equally_likely():
    one = Tolerance("drive.delay", 1, 3, whole=True)
    found = [one.at((k + 0.5) / 300) for k in range(300)]
    assert [found.count(k) for k in (1, 2, 3)] == [100, 100, 100]
    assert one.at(0.999999999) == 3
