"""The page about an identification: the verdict in its first lines, every section, and nothing from elsewhere."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.page_reader import Reader, charts_of
from tests.places import DATA
from tests.unit.identify.page.samples import identified, number, partly, refused, rigid, trusted, unfitted

from detent.errors import DetentError
from detent.identify.analyse.resonances import Resonances
from detent.identify.fit.identification import Identification, identify
from detent.identify.page.identify_report import render_identify_report, write_identify_report
from detent.logs.read_log import read_log

pytestmark = pytest.mark.compiled

EMPS = DATA / "emps" / "DATA_EMPS.mat"

HEADINGS = [
    "Constants", "What was found in the log", "Measured and simulated", "Force, measured and fitted",
    "Friction over the speed", "Which model", "What the recording separates", "Frequency response",
    "How this run was made",
]  # fmt: skip


def headings(html: str) -> list[str]:
    return re.findall(r"<h2>(.*?)</h2>", html)


def read(found: Identification) -> str:
    return Reader(render_identify_report(found)).text


def test_a_trusted_one_says_so_and_how_it_was_tested() -> None:
    text = read(trusted())
    assert "Constants of an axis, identified from 1 recording ✔ Trusted run <1>.csv" in text
    assert f"All {len(identified().estimates)} constants can be trusted. Tested on the last quarter" in text
    h = next(h for h in identified().horizons if h.name == "1 s")
    assert f"simulated for 1 s, the axis ends {1e6 * h.rms:.0f} µm from where it was" in text
    assert "✘" not in text
    assert "Mass0.98" in text


def test_its_sections_stand_in_their_order() -> None:
    assert headings(render_identify_report(trusted())) == HEADINGS
    assert headings(render_identify_report(partly())) == [*HEADINGS[:2], "What to record instead", *HEADINGS[2:]]


def test_a_partly_trusted_one_says_what_is_not_and_why() -> None:
    text = read(partly())
    assert "! Partly trusted run <1>.csv" in text
    assert (
        f"{len(identified().estimates) - 2} constants can be trusted; not viscous friction in both directions." in text
    )
    assert text.count("✘ no: not told by the data") == 2
    assert "it is & stays unknownrecord slow movesviscous friction in positive direction; viscous friction in" in text
    assert "For diagnosis only" not in text


def test_a_refused_one_says_what_to_record_at_once() -> None:
    text = read(refused())
    assert "✘ Refused run <1>.csv No constant of this log can be trusted: too short. Below stands" in text
    assert "ErrorToo short: it moves for <0.3> s. Do: record 10 s." in text
    assert "For diagnosis only: none of these is to be used." in text
    assert "✔ yes" not in text
    assert 'class="cards"' not in render_identify_report(refused())


def test_one_without_constants_shows_the_log_and_what_to_record() -> None:
    html = render_identify_report(unfitted())
    assert headings(html) == ["What was found in the log", "What to record instead", "How this run was made"]
    assert [chart["id"] for chart in charts_of(html)] == ["recorded-position", "recorded-effort"]
    text = Reader(html).text
    assert "too shortit moves for <0.3> srecord 10 sall constants" in text


def test_findings_have_rows_action_and_advice_the_worst_first() -> None:
    text = read(unfitted())
    assert "warningrows 17-19, 40alldropped rows: 4 rows < 5 are goneleft as it isrecord & save faster" in text
    assert text.index("errorall rows") < text.index("warningrows 17-19")
    assert "FaultsNone found in the file: no gaps" in read(trusted())
    assert "None found in the file: what the motion itself tells stands below" in read(refused())
    assert " at 500 Hz" in text
    assert 'time: column "t [s]", by its name' in text


def test_correlated_constants_are_named() -> None:
    found = identified()
    assert found.constants is not None
    covariance = found.constants.covariance.copy()
    error = np.sqrt(np.diag(covariance))
    covariance[1, 3] = covariance[3, 1] = -0.97 * error[1] * error[3]
    covariance[0, 2] = covariance[2, 0] = 0.5 * error[0] * error[2]
    names = found.constants.names
    assert (names[1], names[3]) == ("coulomb.positive", "viscous.positive")
    text = read(replace(trusted(), constants=replace(found.constants, covariance=covariance)))
    assert (
        "Coulomb friction in positive direction and viscous friction in positive direction (\u22120.97): "
        "if one is too large, the other is too small"
    ) in text
    free = replace(found.constants, covariance=np.diag(error**2))
    assert "None above 0.9: the recording tells all constants apart." in read(replace(trusted(), constants=free))


def test_an_unknown_constant_has_no_number() -> None:
    found = refused()
    wild = tuple(replace(e, low=-1e20, high=1e20) if e.name == "mass" else e for e in found.estimates)
    text = read(replace(found, estimates=wild))
    assert "mass masseffort per accelerationnot knownfrom nothing to anything" in text


def test_the_chosen_model_is_marked() -> None:
    text = read(trusted())
    rung = identified().rung
    assert rung is not None
    assert text.count("✔ chosen") == 1
    assert f"Model: {rung.text}" in text
    assert "the simplest" in text


def test_a_response_that_is_given_is_drawn_with_what_was_fitted() -> None:
    response = rigid()
    fitted = Resonances(
        {"resonance": number(13.5, 0.4, "Hz", "resonance")}, response.frequency, response.response[None, :],
        ("motor",), 0.12, "the coherence is <low>",
    )  # fmt: skip
    html = render_identify_report(trusted(), response=response, resonances=fitted)
    text = Reader(html).text
    assert "Method: mean of 5 <periods>." in text
    assert "magnitude [m/N]" in text
    assert "resonance13.50 ± 0.40 Hz" in text
    assert "Not trustedthe coherence is <low>" in text
    assert "12 % of the response is not explained" in text
    assert "two masses" in text


def test_without_a_response_it_says_what_would_tell_one() -> None:
    assert "A recording with a multisine or a chirp" in read(trusted())
    assert "Frequency response" not in read(unfitted())


@pytest.mark.parametrize("make", [trusted, partly, refused, unfitted])
def test_the_page_is_well_formed_and_fetches_nothing(make: object) -> None:
    assert callable(make)
    html = render_identify_report(make(), "slide <1> & more", response=rigid())
    page = Reader(html)
    assert page.open == []
    assert page.fetched == []
    assert not re.findall(r"https?://|@import|url\(", html.partition("<script>")[0])
    assert len(page.ids) == len(set(page.ids))
    for chart in charts_of(html):
        assert chart["id"] in page.ids
    slots = {name for name in page.ids if re.match("recorded-|held-|effort-|residual-|friction-", name)}
    assert slots == {chart["id"] for chart in charts_of(html)}
    assert "slide <1> & more" in page.text


def test_the_same_identification_gives_the_same_bytes(tmp_path: Path) -> None:
    for name in ("a", "b"):
        write_identify_report(trusted(), tmp_path / f"{name}.html")
    assert (tmp_path / "a.html").read_bytes() == (tmp_path / "b.html").read_bytes()
    assert (tmp_path / "a.html").read_text(encoding="utf-8") == render_identify_report(trusted())


def test_a_place_that_cannot_be_written_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(DetentError, match="cannot be written"):
        write_identify_report(trusted(), tmp_path / "missing" / "r.html")


def test_several_logs_are_listed_and_the_drawn_one_is_named() -> None:
    found = unfitted()
    other = replace(found.logs[0], name="second.csv", findings=())
    text = read(replace(found, logs=(found.logs[0], other), runs=found.runs * 2))
    assert "identified from 2 recordings" in text
    assert "Figures over time show run <1>.csv." in text
    assert "second.csv" in text
    assert "run <1>.csv: rows 17-19, 40" in text


@pytest.mark.skipif(not EMPS.exists(), reason="the EMPS recording is not here")
def test_a_page_about_25_s_at_1_khz_stays_small(tmp_path: Path) -> None:
    found = identify([read_log(EMPS, options=["force=vir [35.15065 N]"])])
    write_identify_report(found, tmp_path / "emps.html")
    assert (tmp_path / "emps.html").stat().st_size < 1_000_000
    (position,) = (
        c for c in charts_of((tmp_path / "emps.html").read_text(encoding="utf-8")) if c["id"] == "held-position"
    )
    assert position["x"][0] > 18.0
    assert position["x"][-1] > 24.8
