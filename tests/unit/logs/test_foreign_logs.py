"""Recordings as the programs of others write them: read with at most one statement, and right."""

import sys

import numpy as np
import pytest

pytest.importorskip("matio", reason="mat-io is not installed: pip install 'detent[matlab]'")

from tests.foreign_logs import KINDS, TRUTH, motion

from detent.errors import InputError
from detent.identify.identified import identify_axis
from detent.logs.headings import find_conversion, rank, split_heading, words_of
from detent.logs.read_log import read_log, read_table

EFFORTS = {"sysid": "voltage", "per_cent": "torque"}


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
def test_every_kind_of_file_is_read_with_at_most_one_statement(kind, tmp_path):
    recorded = motion(400)
    path = tmp_path / f"log{kind.suffix}"
    kind.write(path, recorded)
    log = read_log(path, options=kind.options)
    assert len(kind.options) <= 1
    assert len(log) == 400, log.findings
    np.testing.assert_allclose(log.t - log.t[0], recorded.t, atol=2e-9)
    np.testing.assert_allclose(log.signals[EFFORTS.get(kind.name, "current")], recorded.current, atol=1e-6)
    if kind.name == "velocity_only":
        np.testing.assert_allclose(log.signals["velocity"], recorded.velocity, atol=1e-8)
    else:
        np.testing.assert_allclose(log.signals["position"], recorded.position, atol=1e-8)


@pytest.mark.wide
@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
def test_every_kind_of_file_gives_the_constants_of_its_axis(kind, tmp_path):
    path = tmp_path / f"log{kind.suffix}"
    kind.write(path, motion())
    trusted = {one.name: one for one in identify_axis(path, columns=kind.options).found.trusted}
    for name, value in TRUTH.items():
        one = trusted[name if name in trusted else f"{name}.positive"]
        assert one.value == pytest.approx(value, rel=0.005), name


def test_a_velocity_alone_tells_the_constants(tmp_path):
    recorded, kind = motion(), next(kind for kind in KINDS if kind.name == "velocity_only")
    kind.write(path := tmp_path / "log.csv", recorded)
    found = identify_axis(path).found
    mass = next(one for one in found.estimates if one.name == "mass")
    assert mass.low <= TRUTH["mass"] <= mass.high
    assert "the integral of the velocity is taken" in " ".join(found.logs[0].guesses)


def test_a_share_of_a_rating_that_nothing_states_is_a_word_to_the_drive_and_the_line_to_paste_is_told(tmp_path):
    kind = next(kind for kind in KINDS if kind.name == "per_cent")
    kind.write(path := tmp_path / "log.csv", motion(400))
    log = read_log(path)
    np.testing.assert_allclose(log.signals["command"], motion(400).current / 10, atol=1e-8)
    assert any("torque=torque [% of 2.4 N*m]" in guess for guess in log.guesses)
    pasted = read_log(path, options=["torque=torque [% of 2.4 N*m]"])
    np.testing.assert_allclose(pasted.signals["torque"], motion(400).current * 0.24, atol=1e-8)


def test_a_matlab_object_that_nothing_reads_here_says_what_to_install(tmp_path, monkeypatch):
    kind = next(kind for kind in KINDS if kind.name == "matlab_table_v7")
    kind.write(path := tmp_path / "log.mat", motion(50))
    monkeypatch.setitem(sys.modules, "matio", None)
    with pytest.raises(InputError, match="table2struct"):
        read_table(path)


@pytest.mark.parametrize(
    ("heading", "role"),
    [("Lageistwert", "position"), ("Positionssollwert", "reference"), ("Drehzahl_Istwert", "velocity"),
     ("Drehmoment", "torque"), ("Vitesse mesurée", "velocity"), ("Consigne de position", "reference"),
     ("Couple moteur", "torque"), ("velocidad real", "velocity"), ("Tensión", "voltage"), ("电机电流", "current"),
     ("目标位置", "reference"), ("转矩", "torque"), ("时间戳", "time"), ("トルク", "torque"),
     ("Stellgröße", "command")],
)  # fmt: skip
def test_headings_in_other_languages_say_what_ours_do(heading, role):
    assert rank(heading, role) is not None
    for other in ("position", "velocity", "torque", "current"):
        assert other == role or rank(heading, other) is None, other


def test_an_error_of_position_in_another_language_is_no_position():
    assert rank("Schleppfehler", "position") is None
    assert rank("Lageregelabweichung", "position") is None
    assert rank("位置偏差", "position") is None


def test_words_of_our_own_stay_whole():
    assert words_of("controlsignal") == ("controlsignal",)
    assert words_of("mainland") == ("mainland",)


def test_units_stand_in_wide_brackets_and_behind_in():
    assert split_heading("位置（mm）") == ("位置", "mm")
    assert split_heading("Weg in mm") == ("Weg", "mm")
    assert split_heading("travel in bits and pieces") == ("travel in bits and pieces", "")


@pytest.mark.parametrize(
    ("unit", "factor"), [("% of 2.4 N*m", 0.024), ("0.1 % of 2 N*m", 0.002), ("‰ of 3 N*m", 0.003), ("% of 3 A", None)]
)
def test_a_share_of_a_rating_has_its_unit(unit, factor):
    found = find_conversion(unit, "N*m")
    assert (found and found.factor) == (factor and pytest.approx(factor))
