"""What a run carries along so that it can be repeated, and how two runs are compared."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from detent.errors import InputError
from detent.record import evidence as evidence_module
from detent.record.evidence import ELEMENT, Kept, RunEvidence, first_difference, hash_figures, now, read_evidence


@pytest.fixture
def evidence() -> RunEvidence:
    return RunEvidence(
        version="1", date="2026-01-01", axis=Kept.of("a.toml", b"x = 1\n"), overrides=["x=2"], changes={},
        effective={"x": "2"},
        job=Kept.of("job.prn", b"\x1b\x00\xff"), seed=3, signals=["a"], every=1,
        figures=hash_figures({"moves": [1.5]}), trace={"t": "11", "a": "22"},
    )  # fmt: skip


@pytest.mark.parametrize("content", [b"a = 1\n", b"a = 1\r\n", b"\x1b[2J", b"\xff\xfe", "å µ\n".encode(), b""])
def test_every_byte_of_a_file_comes_back(content: bytes) -> None:
    assert (
        Kept(**json.loads(json.dumps({k: getattr(Kept.of("f", content), k) for k in Kept.__slots__}))).content
        == content
    )


def test_a_file_that_is_not_carried_along_is_told_by_its_hash(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_bytes(b"0123456789" * 3)
    whole = Kept.of_file(tmp_path / "log.csv")
    assert whole.content == b"0123456789" * 3
    monkeypatch.setattr(evidence_module, "LARGEST", 29)
    told = Kept.of_file(tmp_path / "log.csv")
    assert (told.sha256, told.text, told.base64) == (whole.sha256, "", "")


def test_of_a_report_no_more_is_read_than_one_has(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    page = tmp_path / "report.html"
    page.write_bytes(b"<p>" * 1000)
    monkeypatch.setattr(evidence_module, "LONGEST_REPORT", 2000)
    with pytest.raises(InputError, match="more than 2 kB"):
        read_evidence(page)


def test_a_text_that_was_changed_is_refused(evidence: RunEvidence) -> None:
    with pytest.raises(InputError, match="does not match its hash"):
        _ = replace(evidence.axis, text="x = 2\n").content


def test_a_report_gives_back_what_was_put_into_it(evidence: RunEvidence, tmp_path: Path) -> None:
    page = tmp_path / "report.html"
    text = json.dumps(evidence.to_dict()).replace("<", "\\u003c")
    page.write_text(f'<p>\n<script type="application/json" id="{ELEMENT}">{text}</script>')
    assert first_difference(evidence, read_evidence(page)) == ""
    assert read_evidence(page) == evidence
    page.write_text(f'<script type="application/json" id="{ELEMENT}">{{}}</script>')
    with pytest.raises(InputError, match="cannot be read"):
        read_evidence(page)


def test_the_first_difference_is_named(evidence: RunEvidence) -> None:
    other = replace(evidence, figures=hash_figures({"moves": [1.6]}), trace={"t": "11", "a": "23"}, date="2027-01-01")
    assert first_difference(evidence, other) == "moves, of the figures"
    assert first_difference(evidence, replace(other, figures=evidence.figures)) == "a, of the columns of the trace"
    assert first_difference(evidence, replace(evidence, effective={})) == "x, of the effective values"
    assert first_difference(evidence, replace(evidence, date="2027-01-01")) == ""


def test_a_build_that_states_its_date_has_that_one(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "0")
    assert now().isoformat() == "1970-01-01T00:00:00+00:00"
