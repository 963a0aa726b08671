"""What else a log can tell, asked for by name."""

import json

import numpy as np
import pytest
from tests.log_rig import make_log
from tests.places import DATA

from detent.cli.terminal import print_json
from detent.errors import DetentError
from detent.identify.analyse.analyses import ANALYSES, analyse
from detent.logs.log import Log
from detent.logs.read_log import read_log

STEP = 1e-3


@pytest.fixture(scope="module")
def steady() -> Log:
    """Two speeds each way: effort 3 N + 20 N s/m times speed one way, 4 N + 25 N s/m the other, some noise."""
    rng = np.random.default_rng(4)
    speeds = np.repeat([0.1, 0.2, -0.1, -0.2, 0.1, 0.2, -0.1, -0.2], 2000)
    force = np.where(speeds > 0, 3.0 + 20.0 * speeds, -4.0 + 25.0 * speeds) + 0.05 * rng.normal(size=len(speeds))
    position = np.round(np.cumsum(speeds) * STEP / 1e-6) * 1e-6
    return make_log(np.arange(len(speeds)) * STEP, position=position, force=force)


def test_two_speeds_by_its_name(steady: Log):
    found = analyse(steady, "two-speeds")
    assert found.reason == ""
    by_name = {e.name: e for e in found.estimates}
    assert by_name["slope.positive"].value == pytest.approx(20.0, rel=0.02)
    assert by_name["coulomb.negative"].value == pytest.approx(4.0, rel=0.02)


def test_the_friction_map_names_its_bins_by_their_speed(steady: Log):
    found = analyse(steady, "friction-map")
    at = {e.name: e.value for e in found.estimates}
    assert at["at 0.2 m/s"] == pytest.approx(7.0, rel=0.01)
    assert at["at -0.1 m/s"] == pytest.approx(-6.5, rel=0.01)


def test_the_step_of_the_encoder(steady: Log):
    """The counts of 1 um show only in steps of 100: the log cannot tell more."""
    found = analyse(steady, "sensors")
    assert found.estimates[0].value == pytest.approx(1e-4, rel=1e-6)


@pytest.mark.parametrize("name", ["winding", "steps"])
def test_what_a_log_does_not_hold_is_a_reason_and_no_error(steady: Log, name: str):
    found = analyse(steady, name)
    assert found.estimates == ()
    assert "expected" in found.reason


@pytest.mark.parametrize("name", ANALYSES)
def test_every_answer_is_plain_data(steady: Log, name: str, capsys: pytest.CaptureFixture[str]):
    print_json(analyse(steady, name).to_dict())
    assert json.loads(capsys.readouterr().out)["analysis"] == name


def test_an_unknown_name_lists_the_known_ones(steady: Log):
    with pytest.raises(DetentError, match="two-speeds, friction-map"):
        analyse(steady, "speeds")


@pytest.mark.skipif(not DATA.exists(), reason="the recordings are not at hand")
def test_two_masses_from_both_encoders():
    """Published: anti-resonance 11 to 12 Hz, resonance 13 to 14.6 Hz; the amplifier turns the command round."""
    path = DATA / "lsb250_two_mass" / "exp1.npz"
    for options in (["voltage=-input_V [V]"], ["voltage=-input_V [V]", "position_load="]):
        found = {e.name: e for e in analyse(read_log(path, options=options), "frequency").estimates}
        assert 11.0 < found["antiresonance"].low < found["antiresonance"].high < 12.0
        assert 13.0 < found["resonance"].low < found["resonance"].high < 14.6


@pytest.mark.skipif(not DATA.exists(), reason="the recordings are not at hand")
def test_the_load_encoder_alone_shows_the_resonance_and_no_anti_resonance():
    path = DATA / "lsb250_two_mass" / "exp1.npz"
    log = read_log(path, options=["voltage=-input_V [V]", "position="])
    found = {e.name: e for e in analyse(log, "frequency").estimates}
    assert "antiresonance" not in found
    assert 13.0 < found["resonance"].value < 14.6
