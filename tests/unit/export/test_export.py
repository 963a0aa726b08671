"""An export of the cascade axis: its files, its vectors, and what is refused."""

import csv
import json
import struct
from types import SimpleNamespace

import pytest

import detent
from detent.errors import DetentError, InputError
from detent.export.code import range_checks, seconds, template
from detent.export.unit import options_of, outside_ranges, unit_of
from detent.export.vectors import CALL, CHECK, END, SIGNAL, TICKS, WRITE, Golden, record
from detent.export.verify import TARGETS, Target, differences, told_of, verify
from detent.export.write import MANIFEST, export_firmware, read_manifest
from detent.kernel.image import FNV_BASIS, FNV_PRIME, WHOLE, begin_hash
from detent.kernel.registers import Registers, f8, i2_array, i8, register, u1
from detent.methods.cascade.build import build_cascade
from detent.methods.cascade.controller import CascadeControllerParams, coast, guard_axis, take_event
from detent.methods.cascade.host import CascadeHost
from detent.translate.values import RefusedError, Shape

pytestmark = pytest.mark.compiled
MOST = 2200
FEW = {"files": 2, "rounds": 300}  # random vectors


@pytest.fixture(scope="module")
def axis():
    return detent.load(detent.example("cascade.toml"))


@pytest.fixture(scope="module")
def folder(axis, tmp_path_factory):
    return export_firmware(axis, tmp_path_factory.mktemp("firmware") / "out", ticks=MOST, **FEW).folder


def rows(folder, name) -> list[dict[str, str]]:
    with (folder / name).open(newline="", encoding="utf-8") as stream:
        return list(csv.DictReader(stream))


def test_the_files_are_those_of_the_manifest(folder):
    manifest = json.loads((folder / MANIFEST).read_text())
    present = {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}
    assert present == {*manifest["files"], MANIFEST}
    assert (manifest["ticks"], manifest["method"], manifest["name"]) == (MOST, "cascade", "cascade_axis")
    assert manifest["options"]["CascadeLawParams.position_pid"] == 0


def test_a_folded_option_is_a_row_of_the_parameters_without_an_expression(folder):
    found = {row["name"]: row for row in rows(folder, "params.csv")}
    assert found["law.position_pid"]["tunable"] == "an option, folded into the code"
    assert found["law.period"]["tunable"] == "yes"
    assert found["law.position_pid"]["expression"] == ""
    assert found["law.period"]["expression"] == "p->law.period"
    assert float(found["law.period"]["default"]) == 0.00025
    # Its memory has two places, so neither delay nor span may grow.
    assert (found["motor_sensor.delay"]["range"], found["motor_sensor.span"]["range"]) == ("0 to 0", "1 to 1")
    assert found["motor_sensor.unused"]["expression"] == ""
    header = (folder / "cascade_axis.h").read_text()
    assert "position_pid" not in header
    assert "position_on_load" not in header


def fitted(axis):
    return unit_of(axis).fitted(build_cascade(axis.spec).controller)


def test_every_register_has_its_number_and_its_writer(folder, axis):
    found = rows(folder, "registers.csv")
    assert [int(row["number"]) for row in found] == list(range(len(fitted(axis).leaves)))
    by = {row["name"]: row["written_by"] for row in found}
    assert by["lines.motor.count"] == "plant"
    assert by["lines.command"] == "controller"
    assert by["controller.on"] == ""
    leaves = [leaf for leaf in fitted(axis).leaves if leaf.range is not None]
    assert leaves
    for leaf in leaves:
        name = ("controller" if leaf.path[0] == "c" else "lines") + leaf.path[1:]
        row = next(one for one in found if one["name"] == name)
        assert row["range"] == f"{leaf.range[0]} to {leaf.range[1]}"
        assert (row["unit"], row["width"], row["length"]) == (leaf.unit, leaf.width.code, str(leaf.length))


class Ranged(Registers):
    """Parameters of which each has another reason for its check."""

    free: i8 = register("no range")
    share: f8 = register("both ends", range=(0.5, 1.0))
    low: u1 = register("its width holds the lower end", range=(0, 9))
    whole: u1 = register("its width holds both ends", range=(0, 255))
    table: i2_array = register("of several", length=3, range=(-32768, 5))
    folded: u1 = register("no part of the structure", range=(0, 1), option=True)


def test_a_range_is_checked_where_its_width_does_not_hold_it_anyway():
    found = range_checks(SimpleNamespace(options={(Ranged, "folded"): 1}, shape=Shape()), Ranged())
    assert [(one["number"], one["text"], one["length"]) for one in found] == [
        (2, "(p->share >= 0.5) && (p->share <= 1.0)", 0), (3, "(p->low <= 9U)", 0), (5, "(p->table[k] <= 5)", 3),
    ]  # fmt: skip
    text = template("unit.c.in", name="n", code="", floats=False, checks=[{"text": "a[k]", "number": 5, "length": 3}])
    assert "for (uint32_t k = 0; k < 3U; k++) {\n        if (!(a[k])) {\n            return 5;" in text


def parsed(data: bytes, leaves, signals=(8, 8, 8, 8), calls=()):
    """Records of a file of vectors: (kind, content)."""
    k, image = 9, sum(leaf.width.size * max(leaf.length, 1) for leaf in leaves)
    while k < len(data):
        kind = data[k]
        if kind == WRITE:
            yield kind, struct.unpack_from("<HHq", data, k + 1)
            k += 13
        elif kind == TICKS:
            (n,) = struct.unpack_from("<H", data, k + 1)
            yield kind, data[k + 3 : k + 3 + n]
            k += 3 + n
        elif kind == CHECK:
            yield kind, (struct.unpack_from("<Q", data, k + 1)[0], data[k + 9 : k + 9 + image])
            k += 9 + image
        elif kind == SIGNAL:
            number, length = struct.unpack_from("<BI", data, k + 1)
            yield kind, (number, length)
            k += 6 + length * signals[number]
        elif kind == CALL:
            yield kind, (data[k + 1],)
            k += 2 + sum(int(code[1]) for code in calls[data[k + 1]] if code[1:].isdigit())
        else:
            assert kind == END
            yield kind, struct.unpack_from("<Q", data, k + 1)[0]
            k += 17


def test_the_vectors_hold_every_tick_and_a_check_every_thousand(folder, axis):
    leaves = fitted(axis).leaves
    data, unit_calls = (folder / "vectors/job.vec").read_bytes(), axis.method.actions
    assert data[:5] == b"DTNV\2"
    found = list(parsed(data, leaves, calls=list(unit_of(axis).calls.values())))
    assert sum(len(one) for kind, one in found if kind == TICKS) == MOST == found[-1][1]
    checks = [one for kind, one in found if kind == CHECK]
    assert len(checks) == 3
    assert f"{checks[-1][0]:016x}" == read_manifest(folder)["hash"]
    assert checks[-1][0] & 0xFF == [one for kind, one in found if kind == TICKS][-1][-1]
    inputs = {leaf.path for leaf in leaves if leaf.by == "plant"}
    later = [leaves[one[0]].path for kind, one in found[len(found) // 2 :] if kind == WRITE]
    assert set(later) <= inputs
    calls = [unit_calls[one[0]] for kind, one in found if kind == CALL]
    assert calls[:4] == ["power_on", "guard_axis", "arrive_within", "take_event"]
    assert {"begin", "forget_peaks", "take_event"} <= set(calls)
    assert {number for kind, (number, _) in ((k, o) for k, o in found if k == SIGNAL)} == {0, 1, 2, 3}


def test_the_hash_is_fnv_1a_over_the_image_of_the_state(axis):
    unit = unit_of(axis)
    golden = record(unit, axis, axis.method.trial_job(axis.spec), 1)
    found = dict(parsed(golden.vectors(), golden.unit.leaves, calls=list(unit.calls.values())))
    wanted = FNV_BASIS
    for byte in found[CHECK][1]:
        wanted = (wanted ^ byte) * FNV_PRIME & WHOLE
    assert found[CHECK][0] == wanted == golden.hash.number
    assert begin_hash().number == FNV_BASIS


def test_what_a_host_does_is_a_call_and_nothing_else(axis):
    unit, host = unit_of(axis), CascadeHost(axis.spec)
    golden = Golden(unit, axis.method.registers(), 10)
    host.machine.recorder = golden
    with pytest.raises(DetentError, match=r"c\.left|c\.on|c\.known|c\.guarded.*written by a host from outside"):
        host.act(coast)  # it was switched on before anybody looked
    fresh = CascadeHost(axis.spec, golden)
    assert int(fresh.act(take_event)) == 0
    fresh.controller.known = 0
    with pytest.raises(DetentError, match=r"c\.known is written by a host"):
        fresh.pass_samples(1)
    fresh.controller.known = 1
    with pytest.raises(DetentError, match=r"guard_axis: got 256; expected: numbers in the widths"):
        fresh.act(guard_axis, 256)
    assert unit.calls["cascade_axis_power_on"] == ("params", "controller", "lines", "f8")
    assert unit.calls["cascade_axis_guard_axis"] == ("controller", "u1")


def test_the_same_input_gives_the_same_bytes(folder, axis, tmp_path):
    again = export_firmware(axis, tmp_path / "another name", ticks=MOST, **FEW).folder
    for name in [*read_manifest(folder)["files"], MANIFEST]:
        assert (again / name).read_bytes() == (folder / name).read_bytes(), name


def test_every_function_is_traced_to_its_step(folder):
    code = (folder / "cascade_axis.c").read_text().splitlines()
    found = rows(folder, "trace.csv")
    assert len(found) == read_manifest(folder)["functions"] == len({row["function"] for row in found})
    source = __import__("pathlib").Path(detent.__file__).parents[1]
    for row in found:
        assert f"{row['function']}(" in code[int(row["line"]) - 1]
        python = (source / row["file"]).read_text().splitlines()[int(row["python_line"]) - 1]
        assert python.startswith(f"def {row['step'].rpartition('.')[2]}(")


# ---- refusals


def test_an_earlier_export_is_replaced_and_other_files_are_not(axis, tmp_path):
    place = tmp_path / "out"
    export_firmware(axis, place, ticks=10, files=0, rounds=0)
    export_firmware(axis, place, ticks=20, **FEW)
    assert read_manifest(place)["ticks"] == 20
    (place / "mine.txt").write_text("mine")
    with pytest.raises(InputError, match=r"FW14: a folder with mine\.txt") as caught:
        export_firmware(axis, place, ticks=10)
    assert caught.value.exit_status == 2
    (place / "mine.txt").unlink()
    (place / "cascade_axis.c").write_text("edited")
    with pytest.raises(InputError, match=r"FW14: a folder with cascade_axis\.c"):
        export_firmware(axis, place, ticks=10)
    assert (place / "cascade_axis.c").read_text() == "edited"
    with pytest.raises(InputError, match="FW14: a file"):
        export_firmware(axis, place / "cascade_axis.h")


def test_a_method_without_a_control_unit_is_refused(axis, monkeypatch):
    monkeypatch.setattr(type(axis.method), "actions", ())
    with pytest.raises(RefusedError, match=r"FW01: .*cascade.*expected: one of .*phase_servo"):
        unit_of(axis)


def test_a_unit_is_of_one_motor():
    zoom = detent.load(detent.example("zoom.toml"))
    with pytest.raises(DetentError, match="got no motor; expected: one of group_a, group_b"):
        unit_of(zoom)
    unit = unit_of(zoom, motor="group_b")
    assert (unit.name, unit.motor, unit.begins) == ("group_b", "group_b", "group_b_place")
    assert list(unit.entries)[0::8] == ["group_b_control", "group_b_next_period"]
    golden = record(unit, zoom, zoom.load_job(detent.example("zoom_sequence.toml")), 50)
    assert (golden.motor, golden.ticks) == ("group_b", 50)
    assert [length for length, _ in golden.signals] == [zoom.spec.stepper["group_b"].steps + 1] * 2


@pytest.mark.parametrize("prefix", ["1st", "a b", "int", "ä"])
def test_a_prefix_that_is_no_name_in_c_is_refused(axis, prefix):
    with pytest.raises(RefusedError, match="FW13"):
        unit_of(axis, prefix)


def test_a_parameter_outside_its_range_is_found(axis):
    p = build_cascade(axis.spec).controller
    p.motor_sensor.delay = 64
    assert list(outside_ranges(p)) == [("motor_sensor.delay", 64, (0, 63))]


def test_an_option_that_differs_between_two_blocks_stays_a_parameter():
    p = CascadeControllerParams()
    assert {name for _, name in options_of(p)} == {
        "position_on_load", "velocity_on_load", "position_pid", "place_on_load", "present", "unused",
    }  # fmt: skip


def test_ticks_must_be_some(axis, tmp_path):
    with pytest.raises(DetentError, match="--ticks: got 0"):
        export_firmware(axis, tmp_path / "out", ticks=0)


# ---- proof


@pytest.mark.parametrize(("tick", "text"), [(1e-5, "10 us"), (0.002, "2 ms"), (2.0, "2 s"), (6.25e-5, "62.5 us")])
def test_a_tick_is_told_in_its_unit(tick, text):
    assert seconds(tick) == text


def test_what_is_not_installed_is_said_with_its_package(folder, monkeypatch):
    absent = Target("no-such", "no-such-gcc", "gcc-no-such", emulator="no-such-qemu", emulator_package="qemu-no")
    monkeypatch.setitem(TARGETS, "no-such", absent)
    (proof,) = verify(folder, ["no-such"])
    assert not proof.equal
    assert "no-such-gcc (Debian: apt install gcc-no-such) and no-such-qemu" in proof.told


def test_a_folder_or_a_target_that_is_none_is_refused(folder, tmp_path, axis):
    with pytest.raises(InputError, match="an export"):
        verify(tmp_path)
    with pytest.raises(DetentError, match="--on: got z80; expected: host-gcc"):
        verify(folder, ["z80"])
    with pytest.raises(InputError, match="an export"):
        list(differences(tmp_path, axis))


def test_what_a_replay_says_is_told_by_names(folder, axis):
    number = [leaf.path for leaf in unit_of(axis).leaves].index("c.law.command")
    told = told_of(folder, [f"register {number} 0 5 6 1000", "differs 17"])
    assert told == "differs in tick 17: controller.law.command[0] 5 for 6 by tick 1000"
    assert told_of(folder, ["differs 3"]) == "differs in tick 3: the hash alone"
    assert told_of(folder, ["bad vectors"]) == "bad vectors"
    assert told_of(folder, []) == "no answer"


def test_an_edited_step_and_another_axis_are_found(folder, axis, tmp_path):
    assert list(differences(folder, axis)) == []
    other = axis.replace({"method.position_gain": 41.0})
    told = list(differences(folder, other))
    assert "cascade_axis_params.c is another file" in told
    assert not any("step" in one for one in told)
    copy = export_firmware(axis, tmp_path / "out", ticks=MOST, **FEW).folder
    text = (copy / "trace.csv").read_text()
    old = next(row["hash"] for row in rows(copy, "trace.csv") if row["step"] == "limit_command")
    (copy / "trace.csv").write_text(text.replace(old, "0" * 16))
    assert list(differences(copy, axis)) == [
        "detent/control/cascade_law.py limit_command is another step than at the export"
    ]
