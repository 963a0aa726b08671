"""No log is trusted beside a simulation that is far off: over the recordings of machines, and simulated logs."""

from collections.abc import Callable
from pathlib import Path

import pytest
from tests.places import DATA
from tests.trust.judge import write_csv
from tests.trust.plants import make_case

from detent.identify.fit.free_run import Horizon
from detent.identify.fit.identification import Identification, identify
from detent.identify.fit.verdict import WORST_ANY, WORST_MISSED, missed, shares_missed
from detent.logs.read_log import read_log

pytestmark = pytest.mark.compiled

SERVO = ("position=position [rad]", "reference=goal_position [rad]", "velocity=")
SOURCES = {
    "emps/*.mat": ("position=qm [m]", "reference=qg [m]", "force=vir [35.15 N]"),
    "arduino_dc_motor/exp*.csv": ("command=-inputSignal",),
    "servo_pendulum_bam/xl330/*.json.gz": SERVO,
}
"""Recordings, and how their columns are stated."""

NEAR_BORDER = (78, 118, 123, 162, 198, 343)
"""Simulated logs, good ones, of which some are simulated badly."""


def is_kept(found: Identification) -> bool:
    """True where all, or a mass, is trusted only beside a simulation that follows the log."""
    if not any(e.name == "mass" for e in found.trusted):
        return found.verdict != "trusted"
    shares = shares_missed(found.horizons)
    return missed(found.horizons) <= WORST_MISSED and all(share <= WORST_ANY for _, share in shares)


def recordings() -> list[tuple[Path, tuple[str, ...]]]:
    return [(path, columns) for glob, columns in SOURCES.items() for path in sorted(DATA.glob(glob))]


@pytest.mark.wide
@pytest.mark.skipif(not DATA.exists(), reason="the recordings of real machines (../shared/data) are not here")
def test_recordings_of_machines():
    verdicts = {}
    for path, columns in recordings():
        found = identify([read_log(path, options=columns)])
        verdicts[path.name] = found.verdict
        assert is_kept(found), (path.name, found.verdict, found.horizons)
    assert set(verdicts.values()) >= {"trusted", "partly trusted", "refused"}


@pytest.mark.long
@pytest.mark.parametrize("number", NEAR_BORDER)
def test_simulated_logs_near_the_border(number: int, tmp_path: Path):
    case, path = make_case(number), tmp_path / "log.csv"
    write_csv(case, path)
    assert is_kept(identify([read_log(path)]))


@pytest.mark.parametrize("spoil", [lambda force: 1.6 * force, lambda force: force + 0.6 * abs(force).max()])
def test_an_effort_that_does_not_move_the_axis_so(spoil: Callable, tmp_path: Path):
    """The effort of the last quarter is another one: what the first part tells does not simulate it."""
    case, path = make_case(7), tmp_path / "log.csv"
    force = case.columns["force [N]"]
    force[-len(force) // 4 :] = spoil(force[-len(force) // 4 :])
    write_csv(case, path)
    found = identify([read_log(path)])
    assert is_kept(found)
    assert found.verdict == "refused"


def test_an_axis_that_comes_back_has_travelled():
    """To and fro in a second: over two seconds it moves nowhere, and an error there is none of the travel."""
    ways = {"0.1 s": 9.0, "0.5 s": 2.0, "1 s": 4.0, "2 s": 0.01}
    horizons = [Horizon(1.0, name, 10, 0.1, 0.2, moved, 1.0) for name, moved in ways.items()]
    assert shares_missed(horizons) == [("0.5 s", 0.05), ("1 s", 0.025), ("2 s", 0.025)]
