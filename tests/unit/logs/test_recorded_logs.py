"""Recordings of real machines: what is known to be wrong with them is found, and nothing else."""

import numpy as np
import pytest
from tests.places import DATA

from detent.logs.log import Action, Kind, Severity
from detent.logs.read_log import read_log

pytestmark = pytest.mark.skipif(
    not DATA.exists(), reason="the recordings of real machines (../shared/data) are not here"
)


def arduino(name, *options):
    return read_log(DATA / "arduino_dc_motor" / f"{name}.csv", options=options)


def pendulum(servo, name):
    return read_log(DATA / "servo_pendulum_bam" / servo / f"{name}.json.gz", options=["position=position [rad]"])


def found(log, kind):
    return [finding for finding in log.findings if finding.kind == kind]


def serious(log):
    return [(finding.kind, finding.signal) for finding in log.findings if finding.severity != Severity.NOTE]


# -- EMPS: a ball-screw axis, MATLAB 5 ------------------------------------------------------------------------


def test_emps_is_clean(tmp_path):
    path = tmp_path / "emps.toml"
    path.write_text(
        """
        [columns]
        time = "t [s]"
        position = "qm [m]"
        reference = "qg [m]"
        voltage = "vir [V]"
        force = {column = "vir", unit = "N", factor = "gtau"}
        """,
        encoding="utf-8",
    )
    log = read_log(DATA / "emps/DATA_EMPS.mat", path)
    assert (len(log), log.findings, log.guesses) == (24841, (), ())
    assert log.units == {"time": "s", "reference": "m", "position": "m", "voltage": "V", "force": "N"} | log.units
    assert log.constants == pytest.approx({"gtau": 35.15065, "kp": 160.18, "kv": 243.45}, rel=1e-6)
    assert log.signals["force"] == pytest.approx(log.signals["voltage"] * log.constants["gtau"])
    assert log.period == pytest.approx(1e-3, rel=1e-4)


def test_emps_by_its_names_alone():
    log = read_log(DATA / "emps/DATA_EMPS.mat")
    assert set(log.signals) == {"position", "reference"}
    assert "columns not used: vir" in log.guesses
    assert serious(log) == []


# -- Arduino: rotated columns, broken rows, crossed leads -----------------------------------------------------


@pytest.mark.parametrize(
    ("name", "rows"),
    [
        ("expdata_20201126_204516", 600),
        ("expdata_20201126_204834_kp050", 600),
        ("expdata_20201126_211734_kp0250", 1000),
    ],
)
def test_arduino_lines_broken_in_the_wrong_places(name, rows):
    log = arduino(name)
    (finding,) = found(log, Kind.ROTATED_COLUMNS)
    assert (finding.rows, finding.action) == (((1, rows),), Action.REORDERED)
    assert "line breaks are misplaced" in finding.text
    assert found(log, Kind.BROKEN_ROWS) == []
    assert np.diff(log.t) == pytest.approx(np.full(rows - 1, 0.1))
    assert (log.signals["command"].min(), log.signals["command"].max()) == (0.0, 255.0)


def test_arduino_is_mended_as_its_owner_mended_it():
    # The owner put this recording right by hand, under another name.
    options = ("reference=inputSignal(8bits) [steps]",)
    mended, by_hand = arduino("expdata_20201126_211734_kp0250", *options), arduino("expdata_20201126_212205", *options)
    assert set(mended.signals) == set(by_hand.signals) == {"position", "reference", "command"}
    assert (mended.t == by_hand.t).all()
    assert all((mended.signals[role] == by_hand.signals[role]).all() for role in mended.signals)
    assert found(by_hand, Kind.ROTATED_COLUMNS) == []


def test_arduino_position_loop_drives_by_size_only():
    log = arduino("expdata_20201126_212205")
    (finding,) = found(log, Kind.LOST_SIGN)
    assert (finding.signal, finding.severity) == ("command", Severity.ERROR)
    saturated = found(log, Kind.SATURATED)
    assert "stays at 255 (a full scale)" in saturated[0].text
    assert (log.signals["command"][np.isin(log.rows, range(1, 7))] == 255).all()
    assert saturated[0].rows[0] == (1, 6)


def test_arduino_a_set_point_under_the_heading_of_eight_bits():
    log = arduino("expdata_20201126_204228_kp025")
    (finding,) = found(log, Kind.WRONG_UNIT)
    assert "the heading says 8 bits, but the numbers go from 6 to 982" in finding.text
    assert list(log.signals) == ["position"]
    assert serious(arduino("expdata_20201126_204228_kp025", "reference=inputSignal(8bits) [steps]", "command=")) == []


@pytest.mark.parametrize(
    "name", ["exp1", "expdata_20201120_214756", "expdata_20201120_215727", "expdata_20201120_220230"]
)
def test_arduino_motor_leads_crossed(name):
    log = arduino(name)
    assert serious(log) == [(Kind.WRONG_SIGN, "command")]
    assert serious(arduino(name, "command=-inputSignal(8bits)")) == []
    assert log.units["position"] == "count"


@pytest.mark.parametrize("name", ["expdata_20201124_215819", "expdata_20201124_220716"])
def test_arduino_motor_leads_straight(name):
    assert arduino(name).findings == ()


def test_arduino_uneven_stamps():
    (finding,) = arduino("expdata_20201120_215030").findings
    assert (finding.kind, finding.severity) == (Kind.IRREGULAR_TIME, Severity.NOTE)


# -- Servos with a pendulum: 16 bits without their sign, uneven stamps, a late speed --------------------------

XL330 = sorted(path.name.removesuffix(".json.gz") for path in (DATA / "servo_pendulum_bam/xl330").glob("*.json.gz"))
STS3250 = sorted(path.name.removesuffix(".json.gz") for path in (DATA / "servo_pendulum_bam/sts3250").glob("*.json.gz"))


@pytest.mark.parametrize("name", XL330)
def test_xl330(name):
    log = pendulum("xl330", name)
    assert log.units["velocity"] == "rad/s"
    assert log.constants["motor"] == "xl330"
    assert np.abs(log.signals["command"]).max() <= 885  # the largest duty that the servo allows
    unsigned = found(log, Kind.UNSIGNED)
    assert len(unsigned) == (log.constants["trajectory"] != "up_and_down")  # which only ever lifts
    assert (log.signals["command"] < 0).sum() == (log.mask(Kind.UNSIGNED)).sum()
    assert len(found(log, Kind.IRREGULAR_TIME)) <= 1
    assert {kind for kind, _ in serious(log)} <= {Kind.UNSIGNED, Kind.SHIFTED, Kind.SATURATED}


def test_xl330_speed_comes_twenty_milliseconds_late():
    lags = []
    for name in XL330:
        log = pendulum("xl330", name)
        lags += [float(finding.text.split()[1]) * log.period for finding in found(log, Kind.SHIFTED)]
    assert len(lags) == 9
    assert all(0.017 < lag < 0.022 for lag in lags)


@pytest.mark.parametrize("name", STS3250)
def test_sts3250(name):
    log = pendulum("sts3250", name)
    assert serious(log) == [(Kind.STUCK, "command")]
    assert "command" not in log.signals
    assert len(found(log, Kind.IRREGULAR_TIME)) == 1
    assert found(log, Kind.DROPPED_ROWS) == []


# -- two encoders, and a stepper ------------------------------------------------------------------------------


def test_lsb250_amplifier_counts_the_other_way():
    log = read_log(DATA / "lsb250_two_mass/exp1.npz")
    assert len(log) == 100_610
    assert log.units == {"time": "s", "position": "m", "position_load": "m", "voltage": "V"}
    assert serious(log) == [(Kind.WRONG_SIGN, "voltage")]
    assert serious(read_log(DATA / "lsb250_two_mass/exp1.npz", options=["voltage=-input_V"])) == []


def test_duet_step():
    path = DATA / "duet_closed_loop_step/step16-stable-converged_first-97ms.csv"
    log = read_log(path)
    assert set(log.signals) == {"position", "reference"}
    assert log.units["position"] == "count"
    assert log.period == pytest.approx(0.49e-3)
    assert serious(log) == []
    turned = read_log(
        path, options=["position=Measured Motor Steps [1.8 deg]", "reference=Target Motor Steps [1.8 deg]"]
    )
    assert turned.units["position"] == "rad"
    assert np.ptp(turned.signals["position"]) == pytest.approx(np.ptp(log.signals["position"]) * np.pi / 100)
