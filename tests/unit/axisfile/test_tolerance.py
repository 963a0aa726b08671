"""The table ``[tolerance]``: what it says, and what is told where it makes no sense."""

import numpy as np
import pytest
from tests.acceptance.test_golden_bits import EXAMPLES

from detent.axisfile.tolerance import Tolerance, cholesky, joint
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
        ('"mechanics.load_mass" = { interval = "9 %", correlation = 3 }', "3", 'correlation = { "KEY" = R }'),
        ('"mechanics.load_mass" = { interval = "9 %", correlation = { "drive.delay" = 1 } }', "1", "above -1"),
        (
            '"mechanics.load_mass" = { interval = "9 %", correlation = { "drive.delay" = 0.5 } }',
            "drive.delay",
            "state its interval",
        ),
        (
            '"drive.delay" = { interval = [0, 2], correlation = { "mechanics.load_mass" = 0.5 } }',
            "correlation",
            "leave distribution and correlation out",
        ),
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


# ---- keys that are drawn jointly, and such as nobody knows


LOAD, MOTOR, GAP = "mechanics.load_mass", "mechanics.motor_mass", "mechanics.coupling.stiffness"


def with_partner(key: str, other: str, number: float) -> str:
    return f'"{key}" = {{ interval = "9 %", distribution = "normal", correlation = {{ "{other}" = {number} }} }}'


def test_shares_go_together_as_the_table_says_and_others_stay():
    table = read('"mechanics.load_mass" = "10 %"', with_partner(MOTOR, LOAD, -0.8), f'"{GAP}" = "9 %"')
    chance = np.random.default_rng(1)
    shares = {key: chance.random(20_000) for key in table}
    drawn = joint(table, shares)
    assert drawn[LOAD].tobytes() == shares[LOAD].tobytes()
    assert drawn[GAP].tobytes() == shares[GAP].tobytes()
    # Of the shares of two normal numbers: 6/pi asin(r/2).
    assert np.corrcoef(drawn[LOAD], drawn[MOTOR])[0, 1] == pytest.approx(6 / np.pi * np.arcsin(-0.4), abs=0.01)
    assert np.histogram(drawn[MOTOR], 10, (0.0, 1.0))[0] == pytest.approx([2000] * 10, abs=200)
    alone = joint({LOAD: table[LOAD], MOTOR: table[MOTOR]}, {key: shares[key] for key in (LOAD, MOTOR)})
    assert alone[MOTOR].tobytes() == drawn[MOTOR].tobytes()


@pytest.mark.parametrize(
    ("entries", "told"),
    [
        ([with_partner(LOAD, MOTOR, 0.5), with_partner(MOTOR, LOAD, 0.4)], "two correlations"),
        ([with_partner(LOAD, MOTOR, 0.9), with_partner(MOTOR, GAP, 0.9), with_partner(GAP, LOAD, -0.9)],
         "positive definite"),
        ([with_partner(LOAD, LOAD, 0.5)], "another key"),
        ([with_partner(LOAD, MOTOR, 0.5), f'"{MOTOR}" = "not trusted"'], "another key"),
    ],
)  # fmt: skip
def test_correlations_that_no_numbers_have_are_told(entries, told):
    with pytest.raises(InputError, match=told):
        read(*entries)


def test_a_factor_gives_its_matrix_back():
    matrix = [[1.0, 0.3, -0.5], [0.3, 1.0, 0.2], [-0.5, 0.2, 1.0]]
    factor = np.array(cholesky(matrix))
    assert factor @ factor.T == pytest.approx(np.array(matrix))
    assert cholesky([[1.0, 1.0], [1.0, 1.0]]) is None


def test_what_is_not_trusted_is_no_interval():
    text = "\n".join([TEXT, "[tolerance]", f'"{MOTOR}" = "not trusted"', f'"{LOAD}" = "10 %"'])
    file = axis_of(parse_source("axis.toml", text))
    assert list(file.tolerance) == [LOAD]
    assert file.untrusted == (MOTOR,)
