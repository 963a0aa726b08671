"""Which column is which signal and in which unit: stated or guessed, and always told."""

import numpy as np
import pytest

from detent.errors import InputError
from detent.logs.choose import choose_columns, find_column, make_draft
from detent.logs.headings import split_heading
from detent.logs.mapping import ColumnMapping, parse_options
from detent.logs.raw_table import RawTable

RNG = np.random.default_rng(1)


def table_of(*headings, count=30, **values):
    columns = {name: np.asarray(values.get(name, RNG.normal(size=count))) for name in headings}
    time = next((name for name in headings if name.startswith(("t", "T"))), None)
    if time and time not in values:
        columns[time] = np.arange(count) * 0.01
    units = {name: split_heading(name)[1] for name in headings}
    return RawTable("log.csv", columns, np.arange(1, count + 1), units)


def chosen(table, *options):
    """Columns by their roles, and what was guessed."""
    return choose_columns(table, parse_options(options)), table.notes


def draft_of(table, *options):
    mapping = parse_options(options)
    return make_draft(table, choose_columns(table, mapping), mapping)


def problem_of(call, *arguments):
    with pytest.raises(InputError) as caught:
        call(*arguments)
    (problem,) = caught.value.problems
    assert problem.file == "log.csv"
    return problem


def test_guesses_are_told():
    found, guesses = chosen(table_of("time(ms)", "enconder(steps)", "inputSignal(8bits)", "remark"))
    assert found == {"time": "time(ms)", "position": "enconder(steps)", "command": "inputSignal(8bits)"}
    assert guesses == [
        'time: column "time(ms)", by its name',
        'position: column "enconder(steps)", by its name',
        'command: column "inputSignal(8bits)", by its name',
        "columns not used: remark",
    ]


def test_a_column_whose_unit_does_not_fit_is_something_else():
    found, guesses = chosen(table_of("t [s]", "load [N]", "v [V]", "x [mm]"))
    assert found == {"time": "t [s]", "position": "x [mm]", "force": "load [N]", "voltage": "v [V]"}
    assert 'force: column "load [N]", by its unit N' in guesses


def test_two_columns_alike():
    found, guesses = chosen(table_of("t", "a.position", "b.position"))
    assert found["position"] == "a.position"
    assert 'position: column "a.position", by its name; alternatives: b.position' in guesses


def test_stated_columns_are_not_guessed_again():
    found, guesses = chosen(table_of("t", "x", "y", "force"), "position=y [mm]", "force=", "reference=x")
    assert found == {"position": "y", "reference": "x", "time": "t"}
    assert guesses == ['time: column "t", by its name', "columns not used: force"]


@pytest.mark.parametrize("wanted", ["x [mm]", "x", "X", "2", "X [um]"])
def test_names_of_columns(wanted):
    assert find_column(table_of("t", "x [mm]", "y"), wanted) == "x [mm]"


@pytest.mark.parametrize("wanted", ["z", "0", "4", "-1", ""])
def test_names_that_are_none(wanted):
    assert find_column(table_of("t", "x [mm]", "y"), wanted) is None


def test_same_name_in_two_units():
    table = table_of("t", "x [mm]", "x [deg]")
    assert find_column(table, "x") is None
    assert find_column(table, "x [deg]") == "x [deg]"


def test_missing_columns_are_refused():
    problem = problem_of(chosen, table_of("t", "motor position"), "position=motor positon")
    assert (problem.key, problem.got, problem.remedy) == (
        "position", 'the column "motor positon"', 'did you mean "motor position"?'
    )  # fmt: skip
    assert problem_of(chosen, table_of("a", "x")).allowed == "a column for the time"
    assert "state what the columns are" in problem_of(chosen, table_of("t", "a")).remedy
    assert chosen(table_of("a", "x"), "period=1 ms")[0] == {"position": "x"}


@pytest.mark.parametrize(
    ("step", "unit"),
    [(0.001, "s"), (0.19, "s"), (0.49, "ms"), (100, "ms"), (250, "us"), (1e6, "ns"), (1e12, "s"), (0, "s")],
)
def test_units_of_time(step, unit):
    draft = draft_of(table_of("t", "x [mm]", t=np.arange(30) * step))
    assert draft.sources["time"].unit == unit
    assert "time" in draft.guessed_units
    assert any(guess.startswith(f"time: no unit stated, taken as {unit}") for guess in draft.guesses)


def test_units_of_a_motion_follow_those_that_are_stated():
    draft = draft_of(table_of("t [s]", "ref", "x [deg]", "speed", "acc"))
    assert {role: draft.units[role] for role in draft.values} == {
        "reference": "rad", "position": "rad", "velocity": "rad/s", "acceleration": "rad/s^2",
    }  # fmt: skip
    assert "reference: no unit stated, taken as rad, as the other signals in rad" in draft.guesses


@pytest.mark.parametrize(
    ("headings", "unit"), [(("t [s]", "x"), "m"), (("t [s]", "theta"), "rad"), (("t [s]", "x", "torque"), "rad")]
)
def test_units_of_a_motion_without_any(headings, unit):
    draft = draft_of(table_of(*headings))
    assert draft.units["position"] == unit
    assert any("position: no unit stated" in guess and "state it, as in position=" in guess for guess in draft.guesses)


def test_whole_numbers_are_counts():
    draft = draft_of(table_of("t [s]", "x", "v", x=np.arange(30)))
    assert (draft.units["position"], draft.units["velocity"]) == ("count", "count/s")
    draft = draft_of(table_of("t [s]", "x", x=np.arange(30) % 4))
    assert draft.units["position"] == "m"


def test_other_units_without_any():
    draft = draft_of(table_of("t [s]", "force", "current", "vbus", "temp", "pwm"))
    assert {role: draft.units[role] for role in draft.values} == {
        "force": "N", "current": "A", "supply": "V", "temperature": "K", "command": "",
    }  # fmt: skip
    assert "temperature: no unit stated, taken as degC" in draft.guesses
    assert not any(guess.startswith("command: no unit") for guess in draft.guesses)


def test_a_unit_that_is_none_is_told():
    draft = draft_of(table_of("t [s]", "position [apples]"))
    assert draft.units["position"] == "m"
    assert any('"apples" is no unit of position as measured' in guess for guess in draft.guesses)


def test_numbers_become_values():
    mapping = ColumnMapping(
        {
            **parse_options(["time=t [s]"]).columns,
            **parse_options(["temperature=c [degC]"]).columns,
            **parse_options(["force=-f [2 N]"]).columns,
        }
    )
    table = table_of("t", "c", "f", count=12, c=np.full(12, 20.0), f=np.full(12, 3.0))
    draft = make_draft(table, choose_columns(table, mapping), mapping)
    draft.convert()
    assert draft.values["temperature"][0] == 293.15
    assert draft.values["force"][0] == -6.0
    assert (draft.sources["force"].factor, draft.sources["temperature"].offset) == (-2.0, 273.15)


def test_factors_that_are_constants(tmp_path):
    path = tmp_path / "map.toml"
    path.write_text('[columns.force]\ncolumn = "f"\nunit = "N"\nfactor = "k"\noffset = 1\n', encoding="utf-8")
    from detent.logs.mapping import load_mapping

    mapping = load_mapping(path)
    table = table_of("t", "f", f=np.ones(30))
    table.constants["k"] = 2.5
    draft = make_draft(table, choose_columns(table, mapping), mapping)
    draft.convert()
    assert draft.values["force"][0] == 3.5
    table.constants = {"other": 1.0, "k": "text"}
    problem = problem_of(make_draft, table, choose_columns(table, mapping), mapping)
    assert problem.got == 'the factor "k"'
    assert "other" in problem.allowed


def test_a_column_for_two_signals():
    draft = draft_of(table_of("t [s]", "vir"), "force=vir [35 N]", "voltage=vir [V]")
    assert (draft.values["force"] == draft.values["voltage"]).all()


def test_words_wider_than_their_heading_says():
    table = table_of("t [s]", "x", "inputSignal(8bits)", **{"inputSignal(8bits)": np.r_[np.zeros(28), 255, 982]})
    draft = draft_of(table)
    assert "command" not in draft.values
    (finding,) = draft.findings
    assert finding.rows == ((30, 30),)
    assert "8 bits, but the numbers go from 0 to 982" in finding.text
    assert "reference=inputSignal(8bits)" in finding.advice


def test_time_by_the_period():
    draft = draft_of(table_of("x [mm]"), "period=2 ms")
    draft.convert()
    assert draft.t.tolist() == pytest.approx(np.arange(30) * 0.002)


def test_a_duration_was_taken_for_the_clock_and_all_columns_moved():
    """Logs of a robot: the last column says how long each cycle took, and the clock is called timestamp."""
    names = ["timestamp", "actual_current_0", "actual_q_0", "actual_qd_0", "actual_execution_time"]
    table = table_of(*names)
    found, _ = chosen(table)
    assert found == {"time": "timestamp", "position": "actual_q_0", "velocity": "actual_qd_0",
                     "current": "actual_current_0"}  # fmt: skip
    assert list(table.columns) == names
