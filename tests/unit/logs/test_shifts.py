"""Signals beside one another in time, and delays that are stated."""

import numpy as np
import pytest
from tests.synthetic_logs import Recording, kinds

from detent.logs.effort import find_lag
from detent.logs.log import Action, Kind

N = 2400
DT = 0.001


def axis(seed=1, follow=4):
    rng = np.random.default_rng(seed)
    n = N + 200
    t = np.arange(n) * DT
    x = 0.2 * np.convolve(rng.normal(size=n + 150), np.hanning(150), "same")[75:-75] / 150**0.5
    v = np.gradient(x, t)
    force = 2 * np.gradient(v, t) + 3 * v + np.sign(v)
    return {
        "time": t,
        "reference": np.roll(x, -follow),
        "position": np.round(x / 1e-7) * 1e-7,
        "position_load": np.round(x / 2e-7) * 2e-7,
        "velocity": v + rng.normal(0, 0.01 * np.std(v), n),
        "force": force + rng.normal(0, 0.05 * np.std(force), n),
    }


def recording(shifts=(), **kwargs):
    """An axis with some signals recorded so many rows late."""
    columns = axis(**kwargs)
    for role, rows in dict(shifts).items():
        columns[role] = np.roll(columns[role], rows)
    return Recording({role: values[100:-100] for role, values in columns.items()})


def test_signals_in_step(tmp_path):
    assert recording().read(tmp_path).findings == ()


@pytest.mark.parametrize("rows", [2, 5, 40, -2, -30])
def test_a_velocity_beside_the_position_is_moved(tmp_path, rows):
    log = recording({"velocity": rows}).read(tmp_path)
    (finding,) = log.findings
    assert (finding.kind, finding.signal, finding.action) == (Kind.SHIFTED, "velocity", Action.MOVED)
    assert f"comes {abs(rows):.1f} rows {'after' if rows > 0 else 'before'} the derivative" in finding.text
    true = recording().columns["velocity"]
    assert len(log) == N - abs(rows)
    assert log.rows.tolist() == (list(range(1, N - rows + 1)) if rows > 0 else list(range(1 - rows, N + 1)))
    assert log.signals["velocity"] == pytest.approx(true[: N - rows] if rows > 0 else true[-rows:])


@pytest.mark.parametrize("rows", [1, -1, 0])
def test_a_row_is_the_filter_s(tmp_path, rows):
    assert recording({"velocity": rows}).read(tmp_path).findings == ()


def test_a_late_reference(tmp_path):
    log = recording({"reference": 20}).read(tmp_path)
    (finding,) = log.findings
    assert (finding.kind, finding.signal, finding.action) == (Kind.SHIFTED, "reference", Action.LEFT)
    assert "by 16.0 rows" in finding.text
    assert 'delay = "16 ms" in [columns.reference]' in finding.advice


@pytest.mark.parametrize("follow", [1, 4, 60])
def test_following_late_is_what_loops_do(tmp_path, follow):
    assert recording(follow=follow).read(tmp_path).findings == ()


def test_two_encoders_beside_one_another(tmp_path):
    log = recording({"position_load": 6}).read(tmp_path)
    (finding,) = log.findings
    assert (finding.signal, finding.action) == ("position_load", Action.LEFT)
    assert "is shifted against the position by 6.0 rows" in finding.text


@pytest.mark.parametrize("rows", [5, 12])
def test_an_effort_after_its_effect(tmp_path, rows):
    log = recording({"force": rows}).read(tmp_path)
    (finding,) = log.findings
    assert (finding.kind, finding.signal, finding.action) == (Kind.SHIFTED, "force", Action.LEFT)
    assert abs(int(finding.text.split()[-2]) - rows) <= 1


def test_an_effort_before_its_effect_is_what_drives_do(tmp_path):
    assert recording({"force": -6}).read(tmp_path).findings == ()


def test_a_stated_delay_is_taken_out(tmp_path):
    path = tmp_path / "map.toml"
    path.write_text('[columns.force]\ncolumn = "force"\ndelay = "12 ms"\n', encoding="utf-8")
    late = recording({"force": 12})
    (tmp_path / "log.csv").write_text(late.text(), encoding="utf-8")
    from detent.logs.read_log import read_log

    log = read_log(tmp_path / "log.csv", path)
    assert kinds(log) == []
    assert len(log) == N - 12
    assert log.signals["force"] == pytest.approx(recording().columns["force"][: N - 12], rel=1e-6, abs=1e-6)


def test_lags_of_series():
    rng = np.random.default_rng(3)
    series = np.convolve(rng.normal(size=1000), np.hanning(20), "same")
    assert find_lag(np.roll(series, 7), series) == pytest.approx(7, abs=0.05)
    assert find_lag(np.roll(series, -7), series) == pytest.approx(-7, abs=0.05)
    assert find_lag(np.interp(np.arange(1000) - 2.5, np.arange(1000), series), series) == pytest.approx(2.5, abs=0.1)
    assert find_lag(rng.normal(size=1000), series) == 0.0
    assert find_lag(series + rng.normal(size=1000) * 3, series) == 0.0


def test_a_period_away_is_no_shift():
    k = np.arange(1000)
    wave = np.sin(k / 5)
    assert abs(find_lag(np.sin((k - 3) / 5), wave)) == pytest.approx(3, abs=0.1)
    assert find_lag(np.sin((k - 20) / 5), wave, prefers_earlier=True) == pytest.approx(20 - 10 * np.pi, abs=0.2)
