"""Excitations excite the lines that were asked for, within their limits, and can be read back."""

import numpy as np
import pytest

from detent.errors import DetentError
from detent.identify.analyse.measure_response import measure_response
from detent.identify.write.excitation_signals import Limits, make_chirp, make_multisine, write_excitation
from detent.logs.read_log import read_log

T = 1e-3


def lines_of(made):
    """Amplitude of each line of a period."""
    rows = round(made.period / T)
    return np.abs(np.fft.rfft(made.values[:rows])) * 2 / rows


@pytest.mark.parametrize("seed", [None, 3])
def test_a_multisine_has_its_lines_and_nothing_else(seed):
    made = make_multisine((1.0, 40.0), 2.0, T, Limits(0.5), periods=4, seed=seed)
    size = lines_of(made)
    assert made.frequency == pytest.approx(np.arange(2, 81) / 2.0)
    assert size[2:81] == pytest.approx(size[2])
    assert np.r_[size[:2], size[81:]].max() < 1e-12
    assert np.abs(made.values).max() == pytest.approx(0.5)
    assert made.t[[0, -1]] == pytest.approx([0.0, 8.0 - T])
    assert made.values[:2000] == pytest.approx(made.values[2000:4000])
    assert abs(made.values[0]) == np.abs(made.values).min()


def test_schroeder_phases_make_lower_peaks_than_random_ones():
    crest = [
        0.5 / np.std(make_multisine((1.0, 40.0), 2.0, T, Limits(0.5), seed=seed).values) for seed in (None, 1, 2, 3)
    ]
    assert crest[0] < 1.9
    assert min(crest[1:]) > 1.3 * crest[0]


def test_odd_lines_alone():
    made = make_multisine((0.5, 40.0), 2.0, T, Limits(1.0), odd=True)
    assert made.frequency == pytest.approx(np.arange(1, 80, 2) / 2.0)
    half = len(made.values) // 20
    assert made.values[:half] == pytest.approx(-made.values[half : 2 * half])


@pytest.mark.parametrize("make", [make_multisine, make_chirp])
@pytest.mark.parametrize(
    ("limits", "reached"), [(Limits(0.5), 0), (Limits(0.5, rate=2.0), 1), (Limits(0.5, bend=100.0), 2)]
)
def test_limits_are_reached_and_kept(make, limits, reached):
    made = make((1.0, 20.0), 2.0, T, limits, periods=3)
    rate = np.gradient(made.values, T)[10:-10]
    bend = np.gradient(rate, T)[10:-10]
    parts = [
        np.abs(made.values).max() / limits.size,
        np.abs(rate).max() / limits.rate,
        np.abs(bend).max() / limits.bend,
    ]
    assert max(parts) < 1.01
    assert parts[reached] > 0.85


def test_a_chirp_excites_its_band_and_meets_its_beginning():
    made = make_chirp((1.0, 40.0), 4.0, T, Limits(1.0), periods=3)
    size = lines_of(made)
    assert size[8:150].min() > 0.5 * np.median(size[8:150])
    assert size[200:].max() < 0.1 * np.median(size[8:150])
    assert made.frequency[[0, -1]] == pytest.approx([1.0, 40.0])
    assert abs(made.values[4000] - made.values[3999]) < 0.3


@pytest.mark.parametrize("make", [make_multisine, make_chirp])
def test_what_was_made_is_found_as_periodic(make):
    made = make((1.0, 40.0), 2.0, T, Limits(1.0), periods=5)
    found = measure_response(made.t, made.values, 3.0 * made.values)
    assert "mean of 4 periods of 2 s" in found.method
    assert found.response == pytest.approx(3.0)


def test_a_written_excitation_is_read_back(tmp_path):
    made = make_multisine((1.0, 40.0), 1.0, T, Limits(0.5), periods=3)
    path = tmp_path / "play.csv"
    write_excitation(path, made, "voltage [V]")
    assert path.read_text().startswith("# multisine of 40 lines from 1 to 40 Hz, 3 periods of 1 s, Schroeder phases\n")
    log = read_log(path)
    assert log.units["voltage"] == "V"
    assert log.signals["voltage"] == pytest.approx(made.values, abs=1e-8)
    assert log.t == pytest.approx(made.t)


@pytest.mark.parametrize(
    ("band", "options", "text"),
    [
        ((0.0, 10.0), {}, "a rising band above 0"),
        ((10.0, 5.0), {}, "a rising band above 0"),
        ((1.0, 600.0), {}, "below 500 Hz"),
        ((1.0, 10.0), {"periods": 2}, "3 periods or more"),
        ((1.0, 10.0), {"step": 0.0}, "samples above 0 s"),
    ],
)
@pytest.mark.parametrize("make", [make_multisine, make_chirp])
def test_excitations_that_cannot_be_are_refused(make, band, options, text):
    arguments = {"band": band, "period": 2.0, "step": T, "limits": Limits(1.0)} | options
    with pytest.raises(DetentError, match=text):
        make(**arguments)


def test_bands_without_a_line_and_bad_limits_are_refused():
    with pytest.raises(DetentError, match=r"lines 0.5 Hz apart; allowed: a band that holds a line"):
        make_multisine((1.1, 1.4), 2.0, T, Limits(1.0))
    with pytest.raises(DetentError, match="two samples"):
        make_multisine((1.0, 10.0), 1e-3, T, Limits(1.0))
    for bad in ({"size": 0.0}, {"size": np.inf}, {"size": 1.0, "rate": -1.0}, {"size": 1.0, "bend": np.nan}):
        with pytest.raises(DetentError, match="came a limit"):
            Limits(**bad)
