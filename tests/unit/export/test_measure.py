"""What a measurement tells, what the manifest keeps of it, and vectors as text."""

import json

import pytest

import detent
from detent.errors import DetentError, InputError
from detent.export import measure as measuring
from detent.export.measure import Entry, Measured, clock_of, measure, note, plain, report_lines
from detent.export.show import shown
from detent.export.sizes import Sizes
from detent.export.unit import folded
from detent.export.verify import TARGETS, Target
from detent.export.write import MANIFEST, export_firmware, read_manifest
from detent.methods.cascade.build import build_cascade

pytestmark = pytest.mark.compiled
MADE = Measured(
    "cortex-m4", {"-Os": Sizes(900, 100, 0, 40, 60, 120, {"a_control": 88}, {"__divdi3": 30})},
    (Entry("a_control", 10, 12.5, 40, 7, 88, 72),), {"mean": 0.1, "most": 0.25},
)  # fmt: skip


@pytest.fixture(scope="module")
def axis():
    return detent.load(detent.example("cascade.toml"))


@pytest.fixture
def folder(axis, tmp_path):
    return export_firmware(axis, tmp_path / "out", ticks=1200, files=2, rounds=200).folder


def test_a_report_tells_every_figure_and_what_is_not_proven(folder):
    told = "\n".join(report_lines(folder, [MADE, Measured("rv32", missed="not installed: gcc")], "72MHz"))
    for part in (
        "flash 1000 bytes (900 code, 100 constants), 40 of parameters, 60 of tables, 30 of the compiler's library",
        "one instance: 120 bytes of RAM, stack 88 at most",
        "library: __divdi3 30",
        "a_control: 10 calls, mean 12.5, most 40 in tick 7; stack 88 / 72",
        "of a tick at 72MHz: mean 10 %, most 25 %, with 1.5 cycles an instruction assumed",
        "rv32: not installed: gcc",
        "detent/sensing/position_sensor.py:",
        "not proven: ",
        "parameters fixed: none",
    ):
        assert part in told, part


def test_the_manifest_keeps_what_was_measured_beside_what_was_before(folder):
    before = read_manifest(folder)
    note(folder, measured=plain([MADE, Measured("rv32", missed="gone")]), coverage=None)
    note(folder, mutants={"found": 3, "of": 4})
    found = json.loads((folder / MANIFEST).read_text())
    assert list(found["report"]["measured"]) == ["cortex-m4"]
    assert found["report"]["measured"]["cortex-m4"]["entries"][0]["painted"] == 72
    assert found["report"]["mutants"] == {"found": 3, "of": 4}
    assert {key: found[key] for key in before} == before


def test_a_share_is_of_the_tick_and_the_loops_are_of_the_entry(folder):
    manifest = read_manifest(folder)
    line = f"entry {manifest['name']}_control 10 32768000 6553600 7 72"
    lines = [line, "entry nothing 1 0 0 0 0"]
    (entry,) = measuring._entries(
        TARGETS["cortex-m4"], lines, manifest, Sizes(stack={f"{manifest['name']}_control": 88})
    )
    assert (entry.calls, entry.mean, entry.most, entry.tick, entry.stack, entry.painted) == (10, 500.0, 1000, 7, 88, 72)
    share = measuring._share([entry], manifest, 72e6)
    assert share["most"] == pytest.approx(1000 * 1.5 / (72e6 * manifest["tick"]))
    assert measuring._share([entry], manifest, 0.0) == measuring._share([], manifest, 72e6) == {}


def test_what_cannot_be_measured_is_said(folder, monkeypatch):
    absent = Target("no-such", "no-such-gcc", "gcc-no-such", memory={})
    monkeypatch.setitem(TARGETS, "no-such", absent)
    (one,) = measure(folder, ["host-gcc", "no-such"])
    assert one.missed == "not installed: no-such-gcc (Debian: apt install gcc-no-such)"
    assert plain([one]) == {}


@pytest.mark.parametrize("text", ["72", "0 MHz", "fast", "1.2.3 MHz"])
def test_a_clock_that_is_none_is_refused(text):
    with pytest.raises(DetentError, match="--clock: got"):
        clock_of(text)


# ---- vectors as text


def test_vectors_are_told_record_by_record(folder):
    told = list(shown(folder / "vectors/job.vec"))
    assert told[0].startswith("DTNV 2, layout ")
    assert "write lines.motor.count = 20000" in told
    assert "call cascade_axis_guard_axis(1)" in told
    assert any(line.startswith("signal 0: ") for line in told)
    assert f"check {read_manifest(folder)['hash']}" in told
    assert told[-1].startswith("end after 1200 ticks; hash of the file ")
    random = list(shown(folder / "vectors/drawn.vec"))
    assert random[0].startswith("DTNR 1, layout ")
    assert sum(line.startswith("function ") for line in random) == read_manifest(folder)["functions"]
    assert "misuse of cascade_axis_control: 200 ticks" in random
    assert random[-1].startswith("end; hash of the file ")


def test_a_file_that_is_no_vectors_is_refused(folder):
    (folder / "vectors/cut.vec").write_bytes((folder / "vectors/job.vec").read_bytes()[:100])
    for name, got in (
        ("cut.vec", "in the middle of a record"),
        ("params.bin", "other content"),
        ("none.vec", "No such"),
    ):
        with pytest.raises(InputError, match=got):
            list(shown(folder / "vectors" / name))


# ---- what is a constant


def test_patterns_choose_what_is_a_constant(axis):
    params = build_cascade(axis.spec).controller
    names = {key: {name for _, name in folded(params, *how)} for key, how in {
        "none": (), "tunable": (["law.position_pid", "feedback.*"],), "fixed": ((), ["limits.*"]),
    }.items()}  # fmt: skip
    assert names["none"] == {
        "position_on_load", "velocity_on_load", "position_pid", "place_on_load", "present", "unused",
    }  # fmt: skip
    assert names["tunable"] == {"place_on_load", "present", "unused"}
    assert names["fixed"] == names["none"] | {
        "following_error", "lowest", "highest", "breaking", "window", "arrival",
    }  # fmt: skip


@pytest.mark.parametrize(
    ("how", "told"),
    [(((), ["motor_sensor.resolution"]), "motor_sensor.resolution = 1e-06, load_sensor.resolution = 0.0"),
     (((), ["gain*"]), "--fixed: got gain*"), ((["gain*"], ()), "--tunable: got gain*")],
)  # fmt: skip
def test_a_pattern_that_cannot_be_followed_is_refused(axis, how, told):
    with pytest.raises(DetentError) as caught:
        folded(build_cascade(axis.spec).controller, *how)
    assert told in str(caught.value)
