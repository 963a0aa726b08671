"""A recording from the file to the log: everything together, in the right order."""

import numpy as np
import pytest
from tests.synthetic_logs import clean, kinds, refused

from detent.errors import InputError
from detent.logs.log import Action, Kind, Severity
from detent.logs.mapping import Choice, ColumnMapping
from detent.logs.read_log import read_log


@pytest.fixture
def write(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def write_file(text, name="log.csv"):
        (tmp_path / name).write_text(text, encoding="utf-8")
        return name

    return write_file


def table(rows, header="t [ms],enc [0.5 um],i [mA]"):
    return "\n".join([header, *(",".join(f"{cell:g}" for cell in row) for row in rows)]) + "\n"


ROWS = [(10 * k, round(200 * np.sin(k / 9)), round(500 * np.cos(k / 9), 1)) for k in range(100)]


def test_a_log(write):
    log = read_log(write(table(ROWS)))
    assert (log.name, len(log), log.period) == ("log.csv", 100, pytest.approx(0.01))
    assert log.units == {"time": "s", "position": "m", "current": "A"}
    assert log.signals["position"] == pytest.approx([row[1] * 0.5e-6 for row in ROWS])
    assert log.signals["current"] == pytest.approx([row[2] * 1e-3 for row in ROWS])
    assert log.columns["position"].column == "enc [0.5 um]"
    assert log.columns["position"].factor == 0.5e-6
    assert log.findings == ()
    assert log.rows.tolist() == list(range(1, 101))


def test_rows_keep_their_numbers_through_everything(write):
    lines = table(ROWS).splitlines()
    lines[31] = "300,garbage,1"
    lines[41] = lines[40]
    lines[51] = "500,,1"
    log = read_log(write("\n".join(lines)))
    gone = {31, 41, 51}
    assert log.rows.tolist() == [row for row in range(1, 101) if row not in gone]
    assert {(finding.kind, finding.rows) for finding in log.findings} == {
        (Kind.BROKEN_ROWS, ((31, 31),)),
        (Kind.DUPLICATED_ROWS, ((41, 41),)),
        (Kind.MISSING_VALUES, ((51, 51),)),
        (Kind.DROPPED_ROWS, ((32, 32), (42, 42), (52, 52))),
    }
    assert log.t[29:32] == pytest.approx([0.29, 0.31, 0.32])
    assert (log.rows[log.mask(Kind.DROPPED_ROWS)] == [32, 42, 52]).all()


def test_errors_come_first(tmp_path):
    recording = clean(11)
    recording.columns["velocity"] = -np.gradient(recording.columns["position"], recording.columns["time"])
    rows = recording.rows_of()
    del rows[50]
    log = recording.read(tmp_path, rows)
    assert [finding.severity for finding in log.findings] == sorted(
        (finding.severity for finding in log.findings), key=["error", "warning", "note"].index
    )
    assert kinds(log)[0] == ("wrong sign", "velocity")


def test_wrapped_counters_with_rotated_columns(write):
    count = [round(60_000 + 900 * k) % 65536 for k in range(100)]
    log = read_log(write(table([(k % 7, 10 * j, c) for j, (k, c) in enumerate(zip(range(100), count, strict=True))],
                               "t [ms],enc [steps],pwm")))  # fmt: skip
    assert {finding.kind for finding in log.findings} == {Kind.ROTATED_COLUMNS, Kind.WRAPPED_COUNTER}
    assert np.diff(log.signals["position"]) == pytest.approx(np.full(99, 900.0))
    assert log.signals["command"].tolist() == [k % 7 for k in range(100)]


def test_time_since_1970_counts_from_the_first_sample(write):
    rows = [(1.7e9 + k * 0.5, np.sin(k), 0.0) for k in range(50)]
    text = "\n".join(["t [s],x [mm]", *(f"{t:.1f},{x:.9f}" for t, x, _ in rows)])
    log = read_log(write(text))
    assert log.t.tolist() == [k * 0.5 for k in range(50)]
    assert "time: counted from the first sample, 1700000000 s" in log.guesses
    assert log.columns["time"].offset == -1.7e9


def test_a_mapping_may_be_made_in_the_program(write):
    mapping = ColumnMapping({"position": Choice(column="enc", unit="0.5 um"), "current": Choice(column="")})
    log = read_log(write(table(ROWS)), mapping)
    assert list(log.signals) == ["position"]


def test_options_override_a_mapping_file(write):
    write('[columns]\nposition = "enc [1 um]"\n', "map.toml")
    assert read_log(write(table(ROWS)), "map.toml").columns["position"].factor == 1e-6
    assert read_log(write(table(ROWS)), "map.toml", ["position=enc [2 um]"]).columns["position"].factor == 2e-6


def test_guesses_are_told(write):
    log = read_log(write(table(ROWS, "t;position;i").replace(",", ";")))
    assert log.guesses[0] == "separator semicolon"
    assert "time: no unit stated, taken as ms: its rows are 10 apart" in log.guesses
    assert any(guess.startswith("position: no unit stated, taken as count") for guess in log.guesses)


def test_a_file_without_a_clock(write):
    text = table([row[1:] for row in ROWS], "enc [um],i [mA]")
    (problem,) = refused(write(text))
    assert "period=1 ms" in problem.remedy
    log = read_log("log.csv", options=["period=2 ms"])
    assert log.t == pytest.approx(np.arange(100) * 0.002)
    lines = text.splitlines()
    lines[5] = "x"
    log = read_log(write("\n".join(lines)), options=["period=2 ms"])
    assert {finding.kind for finding in log.findings} == {Kind.DROPPED_ROWS, Kind.BROKEN_ROWS}
    assert log.t[4] == pytest.approx(0.01)


def test_nothing_usable(write):
    assert "at least 10 rows" in refused(write(table(ROWS[:5])))[0].allowed
    zeros = table([(10 * k, 0.0) for k in range(50)], "t [ms],i [A]")
    assert "no usable signal: current 0 A in each of 50 rows" in refused(write(zeros))[0].got
    wide = table([(10 * k, 900 * k) for k in range(50)], "t [ms],pwm(8bits)")
    assert "no usable signal: command the heading says 8 bits" in refused(write(wide))[0].got


def test_bad_options_come_before_the_file():
    with pytest.raises(InputError, match="unknown key"):
        read_log("gone.csv", options=["postion=q"])
    with pytest.raises(InputError, match="no such file"):
        read_log("gone.csv", "gone.toml")


def test_what_was_left_out_is_not_in_the_log(write):
    rows = [(10 * k, round(200 * np.sin(k / 9)), 3.0) for k in range(100)]
    log = read_log(write(table(rows)))
    assert list(log.signals) == list(set(log.units) - {"time"}) == ["position"]
    (finding,) = log.findings
    assert (finding.action, finding.severity) == (Action.LEFT_OUT, Severity.WARNING)


def test_a_refusal_names_the_columns_that_were_not_read(tmp_path):
    path = tmp_path / "log.csv"
    rows = "\n".join(f"{k},{k * k},{k % 3},{k % 5}" for k in range(30))
    path.write_text(f"t [s],position [mm],AX:P17,probe [A]\n{rows}\n", encoding="utf-8")
    with pytest.raises(InputError) as caught:
        read_log(path, None, ("current=",)).effort("force")
    assert "--column 'force=AX:P17 [N]', or one of probe [A]" in str(caught.value)
    named = read_log(path, None, ("force=AX:P17 [N]", "current="))
    assert named.effort() == "force"
    assert named.unread == ("probe [A]",)
