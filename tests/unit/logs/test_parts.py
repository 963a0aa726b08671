"""Several tests in one file: told apart by a column where the recording breaks, and identified as one axis."""

from pathlib import Path

import numpy as np
import pytest

from detent.identify.identified import identify_axis
from detent.logs.parts import split_tests
from detent.logs.read_log import read_log

STEP = 5e-3
TRUTH = {"mass": 0.4, "coulomb.positive": 0.3, "coulomb.negative": 0.3, "viscous.positive": 2.0}
Row = tuple[float, float, float, str]


def driven(volts: np.ndarray) -> np.ndarray:
    """Positions of an axis of these constants under held voltages, from rest, counted in millimetres."""
    velocity = place = 0.0
    places: list[float] = []
    for u in volts.tolist():
        for _ in range(10):
            force = u - TRUTH["viscous.positive"] * velocity
            sense = np.sign(velocity) or np.sign(force) * (abs(force) > TRUTH["coulomb.positive"])
            faster = velocity + (force - TRUTH["coulomb.positive"] * sense) / TRUTH["mass"] * STEP / 10 * abs(sense)
            velocity = 0.0 if faster * velocity < 0.0 else float(faster)
            place += velocity * STEP / 10
        places.append(place)
    return np.round(np.array(places), 3)


def characterised(*, restarts: bool, gap: float = 3.0) -> list[Row]:
    """A ramp and a step of the voltage, each forward and backward, as drives are characterised."""
    ramp, step = 0.9 * np.arange(0.0, 6.0, STEP), np.full(500, 7.0)
    words = ("quasistatic-forward", "quasistatic-reverse", "dynamic-forward", "dynamic-reverse")
    rows: list[Row] = []
    begin = 0.0
    for word, volts in zip(words, (ramp, -ramp, step, -step), strict=True):
        t = np.arange(len(volts)) * STEP + (0.0 if restarts else begin)
        rows += [(*row, word) for row in zip(t.tolist(), volts.tolist(), driven(volts).tolist(), strict=True)]
        begin += len(volts) * STEP + gap
    return rows


def written(path: Path, rows: list[Row], *, numbered: bool = False) -> Path:
    words = list(dict.fromkeys(row[3] for row in rows))
    cells = [(*row[:3], words.index(row[3]) if numbered else row[3]) for row in rows]
    lines = ["time [s],voltage [V],position [m],test", *(f"{t:.4f},{u:.6g},{x:.6g},{word}" for t, u, x, word in cells)]
    path.write_text("\n".join(lines), encoding="utf-8")
    return path


@pytest.mark.compiled
@pytest.mark.parametrize(("restarts", "numbered"), [(False, False), (False, True), (True, False), (True, True)])
def test_four_tests_in_a_file_are_one_identification(restarts: bool, numbered: bool, tmp_path: Path) -> None:
    """No sign is called wrong, no step saturated, no constant changing: two of the tests hold one voltage each."""
    found = identify_axis(written(tmp_path / "log.csv", characterised(restarts=restarts), numbered=numbered))
    assert found.verdict == "trusted", found.refusals
    assert len(found.found.logs) == 4
    for name, value in TRUTH.items():
        one = found.constants[name]
        assert one.low <= value <= one.high, one
    assert not any(finding for log in found.found.logs for finding in log.findings)


@pytest.mark.compiled
def test_a_voltage_of_two_levels_is_not_saturated(tmp_path: Path) -> None:
    volts = np.where(np.arange(0.0, 20.0, STEP) % 2.0 < 1.0, 4.0, -4.0)
    rows = [(k * STEP, u, x, "a") for k, (u, x) in enumerate(zip(volts.tolist(), driven(volts).tolist(), strict=True))]
    found = identify_axis(written(tmp_path / "log.csv", rows))
    assert found.constants["mass"].value == pytest.approx(TRUTH["mass"], rel=0.02)
    # In positions rounded to millimetres, at two speeds, the friction is a quarter too small by windows of 80 ms, and
    # was trusted so; by wider ones it is right, and what depends on the window is refused. The mass does not, but seems
    # to change with the speed: friction is as open as that leaves the effort.
    assert {refusal.subject for refusal in found.refusals} == {"depends on the window", "not determined by the data"}
    assert {one.name for one in found.found.trusted} == {"mass"}
    assert all(found.constants[name].value < 0.85 * TRUTH[name] for name in ("coulomb.positive", "coulomb.negative"))
    assert all(one.low <= TRUTH[one.name] <= one.high for one in found.found.trusted)


def test_a_column_that_changes_while_rows_follow_one_another_tells_no_tests_apart(tmp_path: Path) -> None:
    log = read_log(written(tmp_path / "log.csv", characterised(restarts=False, gap=0.0)))
    assert log.tests == ()
    assert split_tests(log) == [log]


def test_a_clock_that_starts_again_without_such_a_column_is_that_of_another_recording(tmp_path: Path) -> None:
    rows = [(*row[:3], "same") for row in characterised(restarts=True)]
    log = read_log(written(tmp_path / "log.csv", rows))
    assert any("the longest is read" in finding.text for finding in log.findings)
    assert len(log) == 1200


def test_each_test_keeps_its_own_findings(tmp_path: Path) -> None:
    rows = characterised(restarts=False)
    del rows[1500:1510]
    first, second, *_ = split_tests(read_log(written(tmp_path / "log.csv", rows)))
    assert first.findings == ()
    (gap,) = second.findings
    assert gap.rows == ((1501, 1501),)
