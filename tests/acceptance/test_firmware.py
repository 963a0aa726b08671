"""Numbered tests of the firmware specification, as far as it is built: its control units, here and emulated."""

import ast
import csv
import ctypes
import importlib
import json
import os
import pkgutil
import re
import resource
import shutil
import subprocess
import sys
import threading
from dataclasses import replace
from functools import cache
from operator import attrgetter
from pathlib import Path

import pytest
from tests import firmware_steps
from tests.bare_calls import counted as counted_calls
from tests.bare_units import JOBS, MOTORS, axis_named, bare_code
from tests.docs.pages import blocks_of
from tests.firmware_replay import replayed
from tests.firmware_steps import REFUSED

import detent
import detent.control
import detent.drive
from detent.control.step_rule import come_to_rest, follow, next_step, take_inputs
from detent.errors import DetentError, InputError
from detent.export.code import FLAGS, PROCESSORS, WARNINGS, template
from detent.export.linked import fill_addresses
from detent.export.measure import Measured, measure, note, report_lines
from detent.export.misra import DEVIATIONS, Finding, findings, missing, tallied
from detent.export.selftest import CALLS
from detent.export.show import shown
from detent.export.teeth import mutants, reach, sites
from detent.export.unit import unit_named, unit_of
from detent.export.vectors import cut, record
from detent.export.verify import TARGETS, TRAPS, Target, exported_unit, left_out, verify
from detent.export.write import export_firmware, read_manifest
from detent.kernel.cache import user_cache_root
from detent.kernel.registers import Fit
from detent.kernel.step import step as as_step
from detent.methods.stepper_envelope.envelope_files import write_envelope_header
from detent.translate.program import Program
from detent.translate.values import RefusedError

pytestmark = [pytest.mark.compiled, pytest.mark.process]
SHORT, LONG = 2_000, 20_000  # ticks
FEW = (20, 2_000)  # random register files of each function, and ticks of misuse
FEWER = (1_000, 100_000)
MANY = (1_000, 1_000_000)
LETTER = 267_489  # ticks
WHOLE = {"zoom": 10_000_000, "print_head": 10_000_000}
"""Jobs that are done to their end: 20,000 ticks of a stepper are 40 ms, and those of a print head do not print yet."""
EMULATED = [name for name in TARGETS if not name.startswith("host-") and name != "avr"]
ON_AVR = ("zoom", "phase_servo")  # of whole numbers


@pytest.fixture(scope="session")
def exported(tmp_path_factory):
    """An export of a method with so many ticks; each is made once."""

    @cache
    def make(method: str, ticks: int = SHORT, drawn: tuple[int, int] = FEW) -> Path:
        axis = axis_named(method)
        place = tmp_path_factory.mktemp("firmware") / "out"
        files, rounds = drawn
        job, motor = detent.example(JOBS[method]), MOTORS.get(method, "")
        return export_firmware(axis, place, job=job, motor=motor, ticks=ticks, files=files, rounds=rounds).folder

    return make


DOCUMENTED = Path(__file__).parents[2] / "docs/how-to/export-a-controller-as-firmware.md"


def needs(*names: str) -> None:
    missing = [TARGETS[name].missing for name in names if TARGETS[name].missing]
    if missing:
        pytest.skip(f"not installed: {'; '.join(missing)}")


def proven(folder: Path, *names: str) -> None:
    needs(*names)
    found = verify(folder, names)
    assert len(found) == sum(len(TARGETS[name].levels) for name in names)
    wanted = read_manifest(folder)["hash"]
    assert [(one.target, one.level, one.told) for one in found if not one.equal or one.told != wanted] == []


@pytest.fixture
def at_one_level(monkeypatch):
    """The compiler here at one level only, where what is told there is no matter of the level: `test_01` has all."""

    def choose(level: str) -> None:
        monkeypatch.setitem(TARGETS, "host-gcc", replace(TARGETS["host-gcc"], levels=(level,)))

    return choose


def copied(folder: Path, place: Path) -> tuple[Path, str]:
    shutil.copytree(folder, place)
    return place, read_manifest(folder)["name"]


def unit_sources(place: Path, name: str) -> list[str]:
    return [file for part in ("", "_params", "_tables") if (place / (file := f"{name}{part}.c")).is_file()]


def sources_and_test(place: Path, name: str) -> list[str]:
    return [*unit_sources(place, name), f"{name}_selftest.c"]


def sources(place: Path, name: str) -> list[str]:
    return [*sources_and_test(place, name), f"{name}_image.c", f"{name}_replay.c", "board.c"]


def run(command: str, place: Path, *words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([*command.split(), *words], cwd=place, capture_output=True, text=True, check=False)


@pytest.mark.parametrize("method", ["cascade", "single"])
def test_01_the_cascade_is_equal_here(exported, method):
    proven(exported(method), "host-gcc")


@pytest.mark.wide
@pytest.mark.parametrize("method", JOBS)
def test_01_06_07_10_19_each_is_equal_here_without_a_warning_or_anything_undefined(exported, method):
    folder = exported(method, WHOLE.get(method, LONG), MANY)
    assert read_manifest(folder)["ticks"] >= LONG
    assert read_manifest(folder)["ticks"] == LETTER or method != "print_head"
    proven(folder, "host-gcc")


@pytest.mark.wide
@pytest.mark.parametrize("method", JOBS)
def test_01_06_07_19_each_is_equal_by_another_compiler(exported, method):
    proven(exported(method, LONG, FEWER), "host-clang")


@pytest.mark.long
@pytest.mark.parametrize("method", JOBS)
def test_01_06_07_19_each_is_equal_by_another_compiler_as_long(exported, method):
    proven(exported(method, WHOLE.get(method, LONG), MANY), "host-clang")


@pytest.mark.parametrize("target", EMULATED)
def test_02_03_04_the_cascade_is_equal_on_each_processor(exported, target):
    proven(exported("cascade"), target)


def test_02_single_precision_is_equal_with_the_instructions_for_it(exported):
    folder = exported("single")
    proven(folder, "cortex-m4f", "rv32")
    assert read_manifest(folder)["hash"] != read_manifest(exported("cascade"))["hash"]  # another law


@pytest.mark.wide
@pytest.mark.parametrize("method", [pytest.param("cascade", marks=pytest.mark.long), *list(JOBS)[1:]])
def test_02_03_04_each_is_equal_on_each_processor(exported, method):
    proven(exported(method, LONG, FEWER), *EMULATED)


@pytest.mark.long
def test_01_the_filtered_servo_is_equal_for_a_million_clocks(exported):
    proven(exported("filtered_servo", 100_000), "host-gcc", "cortex-m4")


@pytest.mark.long
def test_01_02_03_the_whole_letter_is_equal(exported):
    folder = exported("print_head", WHOLE["print_head"])
    assert read_manifest(folder)["ticks"] == LETTER
    proven(folder, "host-gcc", "cortex-m0", "cortex-m4", "rv32")


def of_clang() -> Target:
    """A Cortex-M4 whose code clang makes, without its floats; gcc's linker and library put it together."""
    told = run("arm-none-eabi-gcc -E -Wp,-v -xc /dev/null", Path()).stderr.splitlines()
    place = next(line.strip() for line in told if line.startswith(" ") and line.endswith("arm-none-eabi/include"))
    flags = f"--target=thumbv7em-none-eabi -ffreestanding -isystem {place}"
    return replace(TARGETS["cortex-m4"], name="clang-m4", compiler="clang", flags=flags, linker="arm-none-eabi-gcc",
                   libraries=f"-mcpu=cortex-m4 -mthumb -nostartfiles {TARGETS['cortex-m4'].libraries}")  # fmt: skip


@pytest.mark.parametrize("method", ON_AVR)
def test_05_clang_makes_an_arm_of_whole_numbers_the_same(exported, monkeypatch, method):
    needs("cortex-m4", "host-clang")
    monkeypatch.setitem(TARGETS, "clang-m4", of_clang())
    proven(exported(method), "cortex-m4", "clang-m4")


@pytest.mark.parametrize("method", ON_AVR)
def test_08_whole_numbers_are_equal_where_an_int_has_16_bits(exported, method):
    """Of a longer export the first ticks are replayed, up to a check: those that have a place in its flash."""
    needs("avr")
    folder = exported(method, 6_000)
    data = (folder / "vectors/job.vec").read_bytes()
    manifest = read_manifest(folder)
    first, ticks, told = cut(unit_named(manifest["method"], manifest["name"], manifest["arithmetic"]), data, 1_999)
    assert (ticks, len(told)) == (1_000, 16)
    assert (len(first) < 0.9 * len(data), told != manifest["hash"]) == (True, True)
    assert cut(unit_named(manifest["method"], manifest["name"], manifest["arithmetic"]), data, 6_000) == (
        data,
        6_000,
        manifest["hash"],
    )
    proven(folder, "avr")


@pytest.mark.parametrize("method", ON_AVR)
def test_10_what_a_unit_takes_of_an_avr_stands_in_the_report(exported, method):
    """Section 10; cycles, since its emulator knows those of each instruction."""
    needs("avr")
    folder = exported(method, 6_000)
    name = read_manifest(folder)["name"]
    (found,) = measure(folder, ["avr"], 16e6)
    assert (found.target, found.counts, found.missed) == ("avr", "cycles", "")
    sizes, entries = found.sizes["-Os"], {one.name: one for one in found.entries}
    unit, _ = exported_unit(folder, read_manifest(folder))
    image = sum(leaf.width.size * max(leaf.length, 1) for leaf in unit.leaves)
    assert sizes.memory == image  # an AVR leaves no gaps
    assert 1_000 < sizes.flash < found.sizes["-O2"].flash < 16_384
    assert (sizes.tables > 500, sizes.written) == (True, 0)
    assert "__muldi3" in sizes.library
    control, tested = entries[f"{name}_control"], entries[f"{name}_selftest_on"]
    assert control.calls <= 6_000
    assert 100 < control.mean < control.most < 5_000
    assert 100_000 < tested.most < 250_000
    assert all(0 < one.painted <= one.stack < 512 for one in entries.values())
    assert found.share["most"] == pytest.approx(control.most / (16e6 * read_manifest(folder)["tick"]))
    lines = list(report_lines(folder, [found], "16MHz"))
    assert "  cycles of a call, over the vectors of the job; stack computed / painted" in lines
    assert not any("cycles an instruction assumed" in line for line in lines)


def test_10_a_unit_with_floats_is_not_measured_on_an_avr(exported):
    (one,) = measure(exported("cascade"), ["avr"])
    assert (one.missed[:5], one.entries) == ("FW05:", ())


def test_09_floats_are_refused_for_a_processor_whose_double_is_narrow(exported, tmp_path):
    file, wanted = detent.example("cascade.toml"), f"--target avr --output {tmp_path / 'out'}"
    done = run(f"{sys.executable} -m detent export firmware {file} {wanted}", tmp_path)
    assert done.returncode == 1
    assert "FW05: got params.motor_sensor.period, a number of 64 bits, for avr" in done.stderr
    assert list(tmp_path.iterdir()) == []
    (refused,) = verify(exported("cascade"), ["avr"])
    assert (refused.equal, refused.told[:5]) == (False, "FW05:")
    assert "avr" in left_out(exported("cascade"))


def recorded(method: str, ticks: int):
    """The packaged job of a method, with its control unit as a witness: its vectors, and the axis at the end."""
    axis = axis_named(method)
    job = axis.load_job(detent.example(JOBS[method]))
    golden = record(unit_of(axis, motor=MOTORS.get(method, "")), axis, job, ticks)
    return golden, golden.vectors()


def alone_is_equal(method: str, ticks: int) -> None:
    """In all registers that the control unit and the whole axis both have, after every tick."""
    golden, data = recorded(method, ticks)
    checks = list(replayed(golden.unit, golden.params, data))
    assert [wrong for _, wrong in checks if wrong] == []
    one, _ = checks[-1]
    assert one.ticks == golden.ticks
    assert len(checks) == -(-one.ticks // 1000)
    whole = {"c": bytes(golden.state.controller), "l": bytes(golden.state.lines)}
    for leaf in golden.unit.leaves:
        size = leaf.width.size * max(leaf.length, 1)
        assert one.bytes_of(leaf) == whole[leaf.path[0]][leaf.offset : leaf.offset + size], leaf.path


@pytest.mark.parametrize("method", JOBS)
def test_12_a_control_unit_alone_has_the_registers_of_the_whole_axis_in_its_packaged_job(method):
    """Without motor, mechanics and host: told what came along the lines, and what the host did."""
    alone_is_equal(method, SHORT)


@pytest.mark.wide
@pytest.mark.parametrize("method", JOBS)
def test_12_a_control_unit_alone_has_the_registers_of_the_whole_axis_for_long(method):
    alone_is_equal(method, LONG)


@pytest.mark.parametrize("method", ["cascade", "phase_servo"])
def test_12_a_unit_that_is_told_something_else_is_another(method):
    golden, data = recorded(method, SHORT)
    path = {"cascade": "law.cascade.position_gain", "phase_servo": "pwm.half"}[method]
    block, _, last = path.rpartition(".")
    registers = attrgetter(block)(golden.params)
    setattr(registers, last, getattr(registers, last) + 1)
    first, *_ = [wrong for _, wrong in replayed(golden.unit, golden.params, data) if wrong]
    assert first[0].startswith("hash from tick ")
    assert len(first) > 1


def test_12_ranges_hold_in_every_standard_job():
    script = "from tests.acceptance.test_golden_bits import all_bits; all_bits(whole=False)"
    environment = os.environ | {"NUMBA_DISABLE_JIT": "1", "DETENT_CHECK_RANGES": "1"}
    root = Path(__file__).parents[2]
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=root, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr[-500:]


SELFTEST = '#include "NAME.h"\nint main(void) { return (int)NAME_selftest(); }\n'


def test_13_the_self_test_finds_fast_arithmetic(exported, tmp_path):
    place, name = copied(exported("cascade"), tmp_path / "out")
    (place / "self.c").write_text(SELFTEST.replace("NAME", name))
    for flags, wanted in (("-std=c99", 0), ("-std=c99 -O2", 0), ("-std=c99 -O2 -ffast-math", 4)):
        made = run(f"gcc {flags} -w self.c", place, *sources_and_test(place, name), "-o", "self", "-lm")
        assert made.returncode == 0, made.stderr
        found = run("./self", place).returncode
        assert (found != 0) == (wanted != 0), flags


@pytest.mark.parametrize("method", ["cascade", "phase_servo"])
def test_13_the_self_test_finds_another_result_and_another_header(exported, tmp_path, method):
    needs("host-gcc")
    place, name = copied(exported(method), tmp_path / "out")
    (place / "self.c").write_text(SELFTEST.replace("NAME", name))
    header, code = (place / f"{name}.h").read_text(), (place / f"{name}.c").read_text()
    unit, *others = sources_and_test(place, name)

    def compiled(*words: str) -> None:
        made = run("gcc -std=c99 -O1 -w", place, *words)
        assert made.returncode == 0, made.stderr

    def result(*beside: str) -> int:
        compiled(unit, *beside, "-o", "self", "-lm")
        return run("./self", place).returncode

    assert result("self.c", *others) == 0
    head = re.search(rf"{name.upper()}_LAYOUT_HASH UINT32_C\(0x(\w+)\)", header)
    (place / f"{name}.h").write_text(header.replace(head[1], f"{int(head[1], 16) ^ 1:08X}"))
    assert result("self.c", *others) == 5
    (place / f"{name}.h").write_text(header)
    compiled("-r", "self.c", *others, "-o", "others.o")  # what no change touches, once
    # It is no proof: a tenth of all small changes and more leave another result in so few calls.
    found, results = sites(place, name), []
    for begin, end, other in found[:: len(found) // 40]:
        (place / f"{name}.c").write_text(code[:begin] + other + code[end:])
        results.append(result("others.o"))
    assert set(results) == {0, 6}
    assert results.count(6) >= len(results) / 10


TOLD = """#include "NAME.h"
int NAME_get(void);
void NAME_put(char one);
int NAME_replay(void);
int NAME_replay(void)
{
    NAME_put((char)('0' + NAME_selftest()));
    NAME_put('\\n');
    return 0;
}
"""


def told_on_board(processor: str, place: Path, name: str, code: str, flags: str) -> str:
    """What a program in the place of the replay says first, on an emulated processor."""
    target = TARGETS[processor]
    (place / "self.c").write_text(code)
    (place / "board.ld").write_text(template("board.ld.in", **target.memory))
    words = f"{target.compiler} {flags} -O2 -w {target.flags} -T board.ld -Wl,-e,Start self.c board.c"
    vectors = f'-DVECTORS="{place / "vectors/job.vec"}"'
    made = run(words, place, *sources_and_test(place, name), vectors, "-o", "job", *target.libraries.split())
    assert made.returncode == 0, made.stderr
    semihosting = "-nographic -monitor none -serial none -semihosting-config enable=on,target=native"
    told = run(f"{target.emulator} {target.machine} {semihosting} -kernel job", place)
    return (told.stdout + told.stderr).split()[0]


def test_13_the_self_test_finds_fused_arithmetic_and_the_replay_differs(exported, tmp_path, monkeypatch):
    """GNU C of gcc fuses products and sums where a processor can."""
    needs("cortex-m7")
    place, name = copied(exported("cascade"), tmp_path / "out")
    assert "2 products and sums are fused" in (place / f"{name}.h").read_text()
    for flags, wanted in ((FLAGS, "0"), ("-std=gnu99", "2")):
        assert told_on_board("cortex-m7", place, name, TOLD.replace("NAME", name), flags) == wanted
    monkeypatch.setattr("detent.export.verify.FLAGS", "-std=gnu99")
    (one,) = verify(exported("cascade"), ["cortex-m7"])
    assert not one.equal
    assert "differs in" in one.told


def test_14_a_constant_changed_by_hand_is_found_with_tick_and_register(exported, tmp_path, at_one_level):
    place, name = copied(exported("cascade"), tmp_path / "out")
    code = (place / f"{name}.c").read_text()
    assert "2.0 * p->limits.following_error" in code
    (place / f"{name}.c").write_text(code.replace("add_i64(c->samples, 1)", "add_i64(c->samples, 2)"))
    assert (place / f"{name}.c").read_text() != code
    needs("host-gcc")
    at_one_level("-O2")
    files, one = verify(place, ["host-gcc"])
    assert files.told == f"{name}.c is not as it was written"
    assert f"differs in call 1 of {name}_sample(): controller.samples[0] " in one.told, one
    assert "; job differs in tick 1: controller.samples[0] 668 for 334 by tick 1000" in one.told, one


def test_17_a_bit_of_the_vectors_flipped_is_found_wherever_it_is(exported, tmp_path):
    place, name = copied(exported("cascade"), tmp_path / "out")
    flags = f"gcc {FLAGS} -O1 -DON_HOST -fsanitize=undefined,address -fno-sanitize-recover=all"
    made = run(flags, place, *sources(place, name), "-o", "unit", "-lm")
    assert made.returncode == 0, made.stderr
    data = (place / "vectors/job.vec").read_bytes()
    assert run("./unit vectors/job.vec", place).returncode == 0
    for k in range(20):
        spoiled = bytearray(data)
        spoiled[len(data) * k // 20] ^= 1 << k % 8
        (place / "spoiled.vec").write_bytes(bytes(spoiled))
        done = run("./unit spoiled.vec", place)
        assert done.returncode in (1, 2), (k, done.stdout, done.stderr[:300])


@pytest.fixture(scope="session")
def ruled(exported):
    """The rules of MISRA that the sources of a method break; each is looked at once."""

    @cache
    def look(method: str) -> list[Finding]:
        return findings(exported(method), read_manifest(exported(method))["name"])

    return look


@pytest.mark.parametrize("method", [
    "cascade", "single", "phase_servo", *(pytest.param(one, marks=pytest.mark.wide) for one in (
        "filtered_servo", "rotary_table", "zoom", "print_head"))
])  # fmt: skip
def test_20_rules_of_misra_are_kept_but_for_the_advisory_ones_of_the_list(exported, ruled, method):
    if missing():
        pytest.skip(f"not installed: {missing()}")
    manifest = read_manifest(exported(method))
    assert manifest["misra deviations"] == DEVIATIONS
    found = ruled(method)
    assert [one for one in found if not one.is_deviation] == []
    count = tallied(found)
    assert (count["2.5"], count["15.5"] > 10) == (3, True)  # it has looked
    listed = re.findall(r"^\| (\d+\.\d+) \| (.*) \|$", DOCUMENTED.read_text(encoding="utf-8"), re.MULTILINE)
    assert dict(listed) == DEVIATIONS


def test_20_a_rule_that_is_broken_is_found_and_the_number_of_deviations_kept(exported, ruled, tmp_path):
    if missing():
        pytest.skip(f"not installed: {missing()}")
    place, name = copied(exported("phase_servo"), tmp_path / "out")
    code = place / f"{name}.c"
    text = code.read_text()
    kept = "    } else {\n        /* nothing */\n    }\n"
    assert kept in text
    code.write_text(text.replace(kept, "    }\n", 1))
    (other,) = [one for one in findings(place, name) if not one.is_deviation]
    assert (other.file, other.rule) == (code.name, "15.7")
    note(place, misra=tallied(ruled("phase_servo")))
    assert read_manifest(place)["report"]["misra"]["2.5"] == 3
    code.write_text(f"{text}}}\n")
    with pytest.raises(DetentError, match="expected: sources that it can read"):
        findings(place, name)


DIVISION = {f"__aeabi_{one}" for one in ("ldivmod", "uldivmod", "lmul", "llsl", "llsr", "lasr", "idiv", "uidiv")}
DOUBLES = re.compile(r"__aeabi_(d\w+|cd\w+|cfrcmple|i2d|ui2d|l2d|ul2d|f2d)")


def needed_by(place: Path, name: str, tools: str, flags: str) -> set[str]:
    """What NAME.o takes from elsewhere, without its own tables; it holds nothing that is written."""
    assert run(f"{tools}gcc {FLAGS} {flags} -Os -c {name}.c -o unit.o", place).returncode == 0
    told = run(f"{tools}size -A unit.o", place).stdout.splitlines()[2:-2]
    sections = {row.split()[0]: int(row.split()[1]) for row in told}
    assert (sections.get(".data", 0), sections.get(".bss", 0)) == (0, 0)
    undefined = {row.split()[-1] for row in run(f"{tools}nm -u unit.o", place).stdout.splitlines()}
    return {one for one in undefined if not one.startswith(f"{name}_")}


@pytest.mark.parametrize("method", ["cascade", *ON_AVR, *(pytest.param(m, marks=pytest.mark.wide) for m in
                                    ("filtered_servo", "rotary_table", "print_head"))])  # fmt: skip
def test_21_nothing_is_written_and_little_is_taken_from_a_library(exported, tmp_path, method):
    needs("cortex-m4")
    place, name = copied(exported(method), tmp_path / "out")
    here = needed_by(place, name, "", "")
    assert here <= {"memcpy", "memset", "sqrt", "__stack_chk_fail", "_GLOBAL_OFFSET_TABLE_"}
    there = needed_by(place, name, "arm-none-eabi-", PROCESSORS["cortex-m4"])
    floats = "f8" in {row["width"] for table in ("params.csv", "registers.csv") for row in rows(place / table)}
    assert floats == (method not in (*ON_AVR, "print_head"))
    allowed = {"memcpy", "memset", "sqrt"} if floats else set()
    assert {one for one in there - DIVISION - allowed if not (floats and DOUBLES.fullmatch(one))} == set()


LANGUAGE = re.compile(
    r"_((floor_div|floor_mod|shift_left|shift_down|shift_right|abs|min|max|wrap|wrap_add|wrap_sub|wrap_mul)"
    r"_(int|i\d+|f[48])|\w+_of_(int|unsigned|[iuf]\d+)|to_i64|floor|power_of_two|bits_of|claimed|check_params|selftest)$"
)
"""What is no step: an operator of Python, and the two questions about a set of parameters and a build."""


@pytest.mark.parametrize(
    "method", ["cascade", "single", "phase_servo", "zoom", pytest.param("print_head", marks=pytest.mark.wide)]
)
def test_23_every_function_has_a_row_that_leads_to_its_step(exported, method):
    folder = exported(method)
    name = read_manifest(folder)["name"]
    code = (folder / f"{name}.c").read_text().splitlines()
    heads = {k: found[1] for k, line in enumerate(code, 1) if code[k:k + 1] == ["{"]
             and (found := re.fullmatch(r"(?:static )?\w+ \*?(\w+)\(.*\)", line))}  # fmt: skip
    steps = {k: one for k, one in heads.items() if not LANGUAGE.search(one)}
    traced = rows(folder / "trace.csv")
    assert len(traced) == len({row["function"] for row in traced}) > 20
    assert {int(row["line"]): row["function"] for row in traced} == steps
    for row in traced:
        file = Path(detent.__file__).parents[1] / row["file"]
        tree = ast.parse(file.read_text(encoding="utf-8"))
        (step,) = (one for one in tree.body if getattr(one, "lineno", 0) == int(row["python_line"]))
        assert isinstance(step, ast.FunctionDef)
        assert step.name == row["step"]
        begin = max(k for k in range(int(row["line"])) if code[k].startswith("/* "))
        assert code[begin] == f"/* {row['file']}:{row['python_line']} {row['step']}"
        comment = [line.removeprefix(" *").removeprefix(" ") for line in code[begin + 2 : int(row["line"]) - 2]]
        assert "\n".join(comment) == ast.get_docstring(step)


ROOMS = (detent.control, detent.drive)
LIVE = {"detent.control.step_table.move_stop"}  # writes the tables of a live stepper, where these stand


def steps_of(*modules):
    """Every step of these modules, as a plain function."""
    for module in modules:
        for one in vars(module).values():
            step = getattr(one, "py_func", None)
            if step is not None and step.__module__ == module.__name__:
                yield step


def test_25_the_language_takes_every_step_of_the_control_rooms():
    """Alone, a step may miss a range that its unit gives it (FW08, FW09): that is no matter of the language."""
    names = [f"{room.__name__}.{one.name}" for room in ROOMS for one in pkgutil.iter_modules(room.__path__)]
    refused, count = {}, 0
    for step in steps_of(*map(importlib.import_module, names)):
        count += 1
        try:
            Program("t", {f"t_{step.__name__}": step})
        except RefusedError as one:
            if one.code not in ("FW08", "FW09"):
                refused[f"{step.__module__}.{step.__name__}"] = str(one)
    assert count > 150
    assert {name: told for name, told in refused.items() if name not in LIVE} == {}


def test_25_thirty_steps_outside_the_language_are_refused_with_file_line_and_code(monkeypatch):
    for one in (*firmware_steps.STEPS, firmware_steps.recursion):
        monkeypatch.setattr(firmware_steps, one.__name__, as_step(one))
    assert len(REFUSED) >= 30
    for step, code in REFUSED.items():
        with pytest.raises(RefusedError) as caught:
            Program("t", {"t_one": step}, firmware_steps.Limits)
        first = step.__code__.co_firstlineno
        place = re.match(r"firmware_steps\.py:(\d+): |tests\.firmware_steps\.(\w+): ", str(caught.value))
        assert place is not None, step.__name__
        assert place[2] == step.__name__ or first <= int(place[1] or 0) <= first + 8, (step.__name__, str(caught.value))
        assert (caught.value.code, f": {code}: " in str(caught.value)) == (code, True)


def test_23_the_code_is_c_plus_plus_too(exported, tmp_path):
    if not shutil.which("g++"):
        pytest.skip("not installed: g++ (Debian: apt install g++)")
    place, name = copied(exported("cascade"), tmp_path / "out")
    made = run(f"g++ -x c++ -std=c++17 -Wall -Wextra -c {name}.c -o unit.o", place)
    assert (made.returncode, made.stderr) == (0, "")


def test_24_an_export_elsewhere_is_the_same_byte_for_byte(exported, tmp_path):
    script = (
        "import sys, detent\nfrom detent.export.write import export_firmware\n"
        "axis = detent.load(detent.example('cascade.toml'))\n"
        f"export_firmware(axis, 'there', job=detent.example('slide_moves.toml'), ticks={SHORT}, files={FEW[0]}, "
        f"rounds={FEW[1]})\n"
    )
    environment = os.environ | {
        "TZ": "Asia/Tokyo", "LC_ALL": "C", "HOME": str(tmp_path), "PYTHONHASHSEED": "7",
        "DETENT_CACHE_DIR": str(user_cache_root()),
    }  # fmt: skip
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=tmp_path, env=environment, capture_output=True,
        text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-500:]
    folder = exported("cascade")
    for path in sorted(folder.rglob("*")):
        if path.is_file():
            assert path.read_bytes() == (tmp_path / "there" / path.relative_to(folder)).read_bytes(), path.name


@pytest.mark.parametrize(("method", "count"), [("cascade", 6), ("phase_servo", 16), ("rotary_table", 3)])
def test_31_a_parameter_out_of_its_range_is_told_by_its_number(exported, tmp_path, method, count):
    place, name = copied(exported(method), tmp_path / "out")
    with (place / "params.csv").open(newline="") as stream:
        found = list(csv.DictReader(stream))
    spoiled = [(row, end + by) for row in found if row["range"] and row["tunable"] == "yes"
               for end, by in zip(map(ast.literal_eval, row["range"].split(" to ")), (-1, 1), strict=True)]  # fmt: skip
    assert len(spoiled) == 2 * count
    lines = "".join(
        f"p = {name}_defaults; {row['expression'].replace('p->', 'p.')} = {value};\n"
        f'printf("%u\\n", (unsigned){name}_check_params(&p));\n'
        for row, value in spoiled
    )
    (place / "check.c").write_text(
        f'#include <stdio.h>\n#include "{name}.h"\nint main(void) {{\n{name}_params p = {name}_defaults;\n{lines}'
        f"return (int){name}_check_params(&{name}_defaults);\n}}\n"
    )
    made = run(f"gcc {FLAGS} {WARNINGS} -Werror check.c", place, *unit_sources(place, name), "-o", "check", "-lm")
    assert made.returncode == 0, made.stderr
    done = run("./check", place)
    told = [found[int(one) - 1]["name"] for one in done.stdout.split()]
    assert (done.returncode, told) == (0, [row["name"] for row, _ in spoiled])


@pytest.mark.parametrize("method", ["cascade", "single"])
def test_11_plain_steps_make_the_same_vectors_byte_for_byte(exported, tmp_path, method):
    arithmetic = "single" if method == "single" else "double"
    script = (
        "import pathlib, detent\nfrom detent.export.unit import unit_of\nfrom detent.export.vectors import record\n"
        "axis = detent.load(detent.example('cascade.toml'))"
        f".replace({{'controller.arithmetic': '{arithmetic}'}})\n"
        "golden = record(unit_of(axis), axis, axis.load_job(detent.example('slide_moves.toml')), "
        f"{SHORT})\npathlib.Path('plain.vec').write_bytes(golden.vectors())\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=tmp_path, env=os.environ | {"NUMBA_DISABLE_JIT": "1"},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-500:]
    assert (tmp_path / "plain.vec").read_bytes() == (exported(method) / "vectors/job.vec").read_bytes()


def test_17_a_bit_of_the_random_vectors_flipped_is_found_wherever_it_is(exported, tmp_path):
    place, name = copied(exported("phase_servo"), tmp_path / "out")
    parts = f"{name}_drawn.c {name}_params.c {name}_tables.c {name}_image.c board.c"
    made = run(f"gcc {FLAGS} -O1 -DON_HOST -fsanitize=undefined,address {parts} -o unit -lm", place)
    assert made.returncode == 0, made.stderr
    data = (place / "vectors/drawn.vec").read_bytes()
    assert run("./unit vectors/drawn.vec", place).stdout.startswith("drawn equal ")
    for k in range(20):
        spoiled = bytearray(data)
        spoiled[len(data) * k // 20] ^= 1 << k % 8
        (place / "spoiled.vec").write_bytes(bytes(spoiled))
        done = run("./unit spoiled.vec", place)
        assert done.returncode in (1, 2), (k, done.stdout[:300], done.stderr[:300])


@pytest.mark.wide
@pytest.mark.parametrize("method", JOBS)
def test_16_the_vectors_take_nearly_all_ways_through_each(exported, method):
    needs("host-gcc")
    found = reach(exported(method, LONG, MANY))
    assert found.outcomes > 100
    assert found.share >= 95.0, found.missed


@pytest.mark.long
@pytest.mark.parametrize("method", JOBS)
def test_15_mutants_are_found(exported, method):
    needs("host-gcc")
    found = mutants(exported(method, LONG, MANY), 100)
    assert len(found) == 100
    missed = [one for one in found if not one.found]
    assert len(missed) <= 15, missed


def size_of(field) -> int:
    """Bytes of a register or of a block."""
    return ctypes.sizeof(field.block) if field.block else field.width.size * max(field.length, 1)


def taken_by(unit) -> tuple[int, int]:
    """Bytes of a controller as its axis uses it, and of what of it the specification counts."""
    declared = replace(unit, fit=Fit())
    spared = sum(
        (was.length - now.length) * now.width.size for was, now in zip(declared.leaves, unit.leaves, strict=True)
    )
    # The figures of the specification are of units without protection and without lines. Of the rotary table it counts
    # the positioner alone: interrupts, task and composition of the angle are the unit's by now, too.
    fields, whole = unit.controller.__fields__, ctypes.sizeof(unit.controller) - spared
    if "positioner" in fields:
        return whole, size_of(fields["positioner"])
    return whole, whole - sum(size_of(fields[name]) for name in LATER & fields.keys())


BARS_27 = {
    "cascade": 400,
    "filtered_servo": 160,
    "phase_servo": 170,
    "rotary_table": 200,
    "zoom": 80,
    "print_head": 4700,
}  # of memory [byte]
BARS_27["single"] = BARS_27["cascade"]
DEEPEST_27 = {"print_head": 450}  # bytes of stack; of the others 260
LATER = {"guard", "supervision", "watched", "look", "marks", "mark", "stop_at"}
"""What the figures of the specification do not count: protection, homing by an index, a stop to look at on the way."""
BARS_26 = {
    "print_head": (6300, 7300),
    "filtered_servo": (2000, 2000),
    "zoom": (1100, 1200),
    "phase_servo": (1600, 1900),
    "rotary_table": (2600, 2900),
    "cascade": (1800, 2200),
}  # bytes of flash on M4 and M0
BARS_26["single"] = BARS_26["cascade"]
WHOLE_26 = {
    "print_head": (7600, 9100),
    "filtered_servo": (4400, 4850),
    "zoom": (1400, 1520),
    "phase_servo": (3100, 3600),
    "rotary_table": (4700, 5200),
    "cascade": (6100, 6600),
}
WHOLE_26["single"] = WHOLE_26["cascade"]
"""The same of what is exported today, with protection, homing, a hanging load, dead bands, noise on lines."""
BARS_28 = {
    "cascade": {"sample": (6500, 16000)},
    "filtered_servo": {"clock": (430, 1250)},
    "zoom": {"next": (150, 200)},
    "phase_servo": {"tick": (330, 700)},
    "rotary_table": {"interrupt": (2500, 6700)},
    "print_head": {"emitter": (750, 1800), "decide": (700, 1600), "fired": (300, 500)},
}  # instructions of the longest call
BARS_28["single"] = BARS_28["cascade"]
CALLED_28 = {"phase_servo": 5_000, "zoom": 100_000, "print_head": WHOLE["print_head"]}
"""Ticks of the job in which calls are noted, with plain steps: a stepper is then at speed, and the letter printed."""
TICKS_28 = {
    "cascade": (6500, 16000),
    "filtered_servo": (2839 + 10 * 430, 6855 + 10 * 1250),
    "zoom": (2 * 150, 2 * 200),
    "phase_servo": (330 + 100, 700 + 150),
    "rotary_table": (2500, 6700),
    "print_head": (750 + 700 + 300, 1800 + 1600 + 500),
}  # instructions of the longest tick of what is exported
TICKS_28["single"] = TICKS_28["cascade"]
"""A tick of the cascade is a sample. One of the filtered servo has ten clocks and what comes before them (2,839 and
6,855 in the prototype), of a stepper a pause of no length and the step behind it, of the phase servo a look of the
guard, which came later, of the print head an emitter, a column and a decision."""
CORTEX = ("cortex-m4", "cortex-m0")


@pytest.fixture(scope="session")
def counted(exported):
    """What a unit takes, by processor; each is measured once."""

    @cache
    def make(method: str, ticks: int = SHORT) -> tuple[Path, dict[str, Measured]]:
        needs(*CORTEX)
        folder = exported(method, ticks)
        return folder, {one.target: one for one in measure(folder, CORTEX, 72e6)}

    return make


def test_28_what_a_call_of_the_cascade_takes(counted):
    folder, found = counted("cascade")
    name = read_manifest(folder)["name"]
    for target, bar in zip(CORTEX, TICKS_28["cascade"], strict=True):
        assert found[target].missed == ""
        entries = {one.name: one for one in found[target].entries}
        control = entries[f"{name}_control"]
        assert control.calls == SHORT
        assert 0.2 * bar < control.most <= bar
        assert 0.1 * control.most < control.mean < control.most
        assert 1 <= control.tick <= SHORT
        assert found[target].share["most"] == pytest.approx(control.most * 1.5 / (72e6 * read_manifest(folder)["tick"]))


@pytest.mark.parametrize("method", [
    "cascade", "zoom", *(pytest.param(one, marks=pytest.mark.wide) for one in JOBS if one not in ("cascade", "zoom"))
])  # fmt: skip
def test_35_the_self_test_of_64_calls_takes_2_ms_at_48_mhz_at_most(counted, tmp_path, method):
    """Its result, 0, is that of the replay, which would not be equal else (`test_13`)."""
    folder, found = counted(method)
    name, (measured, _) = read_manifest(folder)["name"], (found["cortex-m0"], found["cortex-m4"])
    text = (folder / f"{name}_selftest.c").read_text()
    assert len(re.findall(rf"^    \(void\){name}_\w+\(.*\);$", text, re.MULTILINE)) == CALLS == 64
    (tested,) = (one for one in measured.entries if one.name == f"{name}_selftest_on")
    assert (measured.missed, tested.calls) == ("", 1)
    assert 10_000 < tested.most <= 96_000
    assert tested.painted <= tested.stack
    place, _ = copied(folder, tmp_path / "out")
    assert needed_by(place, f"{name}_selftest", "arm-none-eabi-", PROCESSORS["cortex-m0"]) >= {"memset"}


@pytest.mark.parametrize("k", [0, 1])
@pytest.mark.parametrize("method", [
    "cascade", "phase_servo", "rotary_table", *(pytest.param(one, marks=pytest.mark.wide) for one in (
        "filtered_servo", "zoom", "print_head"))
])  # fmt: skip
def test_26_flash_of_the_units_as_the_specification_lists_them(exported, tmp_path, method, k):
    """What is compiled without what came later keeps to the bar; what is exported holds more, and is bounded too."""
    needs("cortex-m4")
    folder, place = exported(method), tmp_path
    manifest, target = read_manifest(folder), TARGETS[CORTEX[k]]
    unit = unit_named(manifest["method"], manifest["name"], manifest["arithmetic"])
    params = unit.params.from_buffer_copy((folder / "vectors/params.bin").read_bytes())
    (place / "bare.c").write_text(bare_code(method, unit, params))
    sizes = {}
    for file in (place / "bare.c", folder / f"{manifest['name']}.c"):
        made = run(f"{target.compiler} {FLAGS} {target.flags} -Os -I{folder} -c {file} -o unit.o", place)
        assert made.returncode == 0, made.stderr
        sizes[file.stem] = int(run("arm-none-eabi-size unit.o", place).stdout.split()[6])
    bare, whole = sizes["bare"], sizes[manifest["name"]]
    assert 0.4 * BARS_26[method][k] < bare <= BARS_26[method][k], sizes
    assert bare < whole <= WHOLE_26[method][k], sizes


@pytest.mark.wide
@pytest.mark.parametrize("method", list(TICKS_28)[1:])
def test_28_what_the_longest_tick_of_each_takes(counted, method):
    folder, found = counted(method, LONG)
    for target, bar in zip(CORTEX, TICKS_28[method], strict=True):
        entries = {one.name: one for one in found[target].entries}
        assert 0.1 * bar < entries[f"{read_manifest(folder)['name']}_control"].most <= bar


# A print head's are those of a whole letter.
@pytest.mark.parametrize("method", [
    "phase_servo", pytest.param("print_head", marks=pytest.mark.long),
    *(pytest.param(one, marks=pytest.mark.wide) for one in JOBS if one not in ("phase_servo", "print_head")),
])  # fmt: skip
def test_27_28_calls_as_the_specification_lists_them(tmp_path, method):
    """Instructions and stack of each call, in every state to which the job of the simulation comes."""
    needs(*CORTEX)
    found = counted_calls(method, CALLED_28.get(method, LONG), CORTEX, tmp_path)
    for k, target in enumerate(CORTEX):
        for name, bars in BARS_28[method].items():
            assert 0.05 * bars[k] < found[target][name].most <= bars[k], (target, name)
        assert 40 <= max(one.stack for one in found[target].values()) <= DEEPEST_27.get(method, 260)


MOST_SINGLE = 830
"""The prototype's sample in single precision took 757 instructions of a Cortex-M4F at most, of 705 on average; and a
tenth. It had positions in single precision, too; here they are doubles, up to the error."""


@pytest.mark.wide
def test_28_a_sample_in_single_precision_takes_a_fifth_of_the_instructions(tmp_path):
    """Section 6, 4, on a Cortex-M4F."""
    needs("cortex-m4f")
    most = {}
    for arithmetic in ("cascade", "single"):
        (tmp_path / arithmetic).mkdir()
        most[arithmetic] = counted_calls(arithmetic, LONG, ("cortex-m4f",), tmp_path / arithmetic)["cortex-m4f"]
    single, double = (most[one]["sample"].most for one in ("single", "cascade"))
    assert 0.5 * MOST_SINGLE < single <= MOST_SINGLE
    assert 4.0 * single < double <= BARS_28["cascade"]["sample"][0]


def test_06_single_precision_is_never_promoted(exported, tmp_path):
    """Where it meets double, a cast says so; of the law nothing does. A literal without its f is found."""
    needs("cortex-m4f")
    place, name = copied(exported("single"), tmp_path / "out")
    assert read_manifest(place)["single to double"] == []
    code = (place / f"{name}.c").read_text()
    laws = re.findall(r"/\* detent/control/(?:cascade_law|guard|supervision)\.py.*?\n}\n", code, re.DOTALL)
    assert len(laws) > 20
    bodies = [law.partition("\n{\n")[2] for law in laws if " feed_forward\n" not in law]
    assert [body for body in bodies if "double" in body] == []
    strict = f"arm-none-eabi-gcc {FLAGS} {PROCESSORS['cortex-m4f']} {WARNINGS} -Werror -c {name}.c -o unit.o"
    assert run(strict, place).stderr == ""
    assert code.count("2.0f * p->limits.following_error") == 1
    (place / f"{name}.c").write_text(code.replace("2.0f * p->limits", "2.0 * p->limits"))
    assert "-Werror=double-promotion" in run(strict, place).stderr


FLUSHED = """    uint32_t mode;
    __asm volatile("vmrs %0, fpscr" : "=r"(mode));
    __asm volatile("vmsr fpscr, %0" : : "r"(mode | (1u << 24)));
"""


def test_13_the_self_test_finds_fused_and_flushed_single_precision(exported, tmp_path):
    """Of a processor that computes singles by itself, and doubles by a library, which does neither."""
    needs("cortex-m4f")
    place, name = copied(exported("single"), tmp_path / "out")
    assert "7 float is not IEEE binary32" in (place / f"{name}.h").read_text()
    told = TOLD.replace("NAME", name)
    assert told_on_board("cortex-m4f", place, name, told, FLAGS) == "0"
    assert told_on_board("cortex-m4f", place, name, told, "-std=gnu99") == "2"
    flushed = told.replace(f"    {name}_put", f"{FLUSHED}    {name}_put", 1)
    assert told_on_board("cortex-m4f", place, name, flushed, FLAGS) == "3"


def test_32_registers_of_single_precision_are_described_as_such(exported, tmp_path):
    place, name = copied(exported("single"), tmp_path / "out")
    widths = {row["name"]: row["width"] for row in rows(place / "registers.csv")}
    assert widths["controller.law.integral"] == "f4"
    assert widths["controller.reference.position"] == widths["controller.motor_sensor.position"] == "f8"
    text = (place / f"{name}.a2l").read_text()
    found = re.search(rf"/begin MEASUREMENT {name}.controller.law.integral .*?/end MEASUREMENT", text, re.DOTALL)
    assert "FLOAT32_IEEE" in found[0]
    assert "-3.4028234663852886e+38 3.4028234663852886e+38" in found[0]


@pytest.mark.wide
@pytest.mark.parametrize("method", JOBS)
def test_27_memory_and_stack_on_cortex(counted, method):
    folder, found = counted(method)
    manifest = read_manifest(folder)
    unit, _ = exported_unit(folder, manifest)
    whole, bare = taken_by(unit)
    assert 0.5 * BARS_27[method] <= bare <= BARS_27[method]
    for one in found.values():
        sizes = one.sizes["-Os"]
        assert sizes.memory == whole + ctypes.sizeof(unit.lines)
        assert sizes.written == 0
        for entry in one.entries:
            assert entry.painted <= entry.stack, entry
    control = next(e for e in found["cortex-m4"].entries if e.name == f"{manifest['name']}_control")
    assert 40 <= control.painted <= DEEPEST_27.get(method, 260)
    library = found["cortex-m4"].sizes["-Os"].library
    if method in ("zoom", "phase_servo", "print_head"):  # whole numbers alone: a division of 64 bits at most
        assert set(library) <= {"__aeabi_ldivmod", "__udivmoddi4", "__aeabi_idiv0"}
    else:
        assert "__aeabi_dmul" in library


LENGTHS = {"cascade": {"c.motor_sensor.memory": 2, "c.load_sensor.memory": 2}}  # of 64: a span of 1, and no delay
TRIMMED = {
    "cascade": {},
    "zoom": {"rule.ramp": 256},  # of 2,048: 228 are in use, and the index of any entry is masked to a power of two
    "phase_servo": {"sequencer.table": 887},  # of 4,096
    "rotary_table": {f"positioner.pdt.{one}": 5 for one in ("angle", "speed", "policy")},  # of 128
}
"""Lengths of arrays of the state, and of parameters."""


@pytest.mark.parametrize("method", TRIMMED)
def test_27_arrays_are_as_long_as_the_axis_uses_them(exported, method):
    folder = exported(method)
    manifest = read_manifest(folder)
    unit, _ = exported_unit(folder, manifest)
    declared = unit_named(manifest["method"], manifest["name"], manifest["arithmetic"])
    shorter = {now.path: now.length for was, now in zip(declared.leaves, unit.leaves, strict=True)
               if now.length != was.length}  # fmt: skip
    assert shorter == LENGTHS.get(method, {})
    lengths = {row["name"]: int(row["length"]) for row in rows(folder / "params.csv")}
    of_declared = {leaf.path: leaf.length for leaf in declared.params.leaves()}
    assert {name: length for name, length in lengths.items() if length != of_declared[name]} == TRIMMED[method]
    name = manifest["name"]
    texts = "".join((folder / one).read_text() for one in (f"{name}.h", f"{name}_params.c"))
    for path, length in (shorter | TRIMMED[method]).items():
        assert f"{path.rpartition('.')[2]}[{length}]" in texts or f"_{path.replace('.', '_')}[{length}]" in texts


def test_27_a_delay_of_1_and_a_span_of_4_take_memories_of_8(tmp_path):
    """The cascade's 400 bytes are those; as declared, with 64 places, it has 1.7 KB."""
    needs("host-gcc", "cortex-m4")
    spec = {"encoder.delay": 1, "encoder.velocity_span": 4}
    axis = detent.load(detent.example("cascade.toml")).replace(spec)
    folder = export_firmware(axis, tmp_path / "out", ticks=3000, files=5, rounds=1000).folder
    unit, params = exported_unit(folder, read_manifest(folder))
    whole, bare = taken_by(unit)
    declared = ctypes.sizeof(unit.controller)
    assert (params.motor_sensor.delay, params.motor_sensor.span, params.motor_sensor.unused) == (1, 4, 64 - 8)
    assert 1400 < declared <= 1700
    assert 0.9 * 400 < bare <= 400
    proven(folder, "host-gcc", "cortex-m4")
    found = {one["name"]: one["range"] for one in rows(folder / "params.csv")}
    assert (found["motor_sensor.delay"], found["motor_sensor.span"]) == ("0 to 3", "1 to 4")
    made = run(f"arm-none-eabi-gcc -mcpu=cortex-m4 -mthumb -c {read_manifest(folder)['name']}_replay.c", folder)
    assert made.returncode == 0, made.stderr
    told = run(f"arm-none-eabi-nm -S {read_manifest(folder)['name']}_replay.o", folder).stdout.splitlines()
    assert {int(row.split()[1], 16) for row in told if row.endswith(" c_")} == {whole}


def test_27_a_job_that_needs_more_than_there_is_room_for_is_given_it_or_refused(tmp_path):
    axis = detent.load(detent.example("cascade.toml"))
    text = '[[parameter_change]]\ntime = "{time}"\nname = "motor_sensor.{name}"\nvalue = {value}\n'
    (tmp_path / "more.toml").write_text(
        text.format(time="10 ms", name="delay", value=9) + '[[move]]\nby = "1 mm"\n'
    )  # fmt: skip
    folder = export_firmware(axis, tmp_path / "out", job=tmp_path / "more.toml", ticks=500, files=0, rounds=0).folder
    unit, _ = exported_unit(folder, read_manifest(folder))
    assert {leaf.length for leaf in unit.leaves if leaf.path.endswith(".memory")} == {16}
    (tmp_path / "both.toml").write_text(
        text.format(time="10 ms", name="delay", value=9) + text.format(time="20 ms", name="delay", value=0)
        + text.format(time="20 ms", name="span", value=9) + '[[move]]\nby = "1 mm"\n'
    )  # fmt: skip
    with pytest.raises(
        RefusedError, match=r"FW12: got a job that sets motor_sensor\.\w+ = 9; expected: \d to \d, for "
    ):
        export_firmware(axis, tmp_path / "none", job=tmp_path / "both.toml", ticks=500, files=0, rounds=0)
    assert not (tmp_path / "none").exists()


def test_22_three_axes_in_one_program_keep_to_themselves(exported, tmp_path):
    needs("host-gcc")
    made = [copied(exported(method), tmp_path / method) for method in ("cascade", "phase_servo", "rotary_table")]
    program, objects = "#include <stdio.h>\nstatic FILE *vectors;\n", []
    for place, name in made:
        for file in sources(place, name)[:-1]:
            done = run(f"gcc {FLAGS} -O1 -c {file} -o {file}.o", place)
            assert done.returncode == 0, done.stderr
            objects.append(str(place / f"{file}.o"))
        program += (
            f"int {name}_get(void);\nvoid {name}_put(char one);\nint {name}_replay(void);\n"
            f"int {name}_get(void) {{ return getc(vectors); }}\nvoid {name}_put(char one) {{ putchar(one); }}\n"
        )
    calls = [
        f'vectors = fopen("{place}/vectors/job.vec", "rb"); result |= {name}_replay(); fclose(vectors);'
        for place, name in made
    ]
    (tmp_path / "all.c").write_text(f"{program}int main(void) {{ int result = 0; {' '.join(calls)} return result; }}\n")
    linked = run(f"gcc {FLAGS} all.c", tmp_path, *objects, "-o", "all", "-lm")
    assert linked.returncode == 0, linked.stderr
    done = run("./all", tmp_path)
    wanted = [read_manifest(place) for place, _ in made]
    assert done.stdout.splitlines() == [f"equal {one['ticks']} {one['hash']}" for one in wanted]
    assert done.returncode == 0


PAIR = """#include <stdio.h>
#include "NAME.h"
typedef struct { NAME_controller c; NAME_lines l; uint64_t h; uint32_t seed; } one_t;
static uint32_t draw(uint32_t *seed) { *seed = *seed * 1664525u + 1013904223u; return *seed >> 16; }
static void begin(one_t *x, uint32_t seed)
{
    const one_t none = {0};
    *x = none;
    x->h = NAME_HASH_START;
    x->seed = seed;
}
static void tick(one_t *x)
{
    NAME_lines *l = &x->l;
WRITES    NAME_control(&NAME_defaults, &x->c, &x->l);
    x->h = NAME_image_hash(&x->c, &x->l, x->h);
}
int main(void)
{
    one_t a, b, alone;
    uint32_t order = 7, turns[2] = {0, 0};
    begin(&a, 1);
    begin(&b, 2);
    while (turns[0] < 3000 || turns[1] < 3000) {
        const uint32_t which = draw(&order) & 1u;
        if (turns[which] < 3000) { tick(which ? &b : &a); turns[which]++; }
    }
    for (uint32_t which = 0; which < 2; which++) {
        begin(&alone, which + 1);
        for (int k = 0; k < 3000; k++) { tick(&alone); }
        printf("%llx %llx\\n", (unsigned long long)alone.h, (unsigned long long)(which ? b.h : a.h));
    }
    return 0;
}
"""


@pytest.mark.parametrize("method", ["phase_servo", "rotary_table"])
def test_22_two_instances_of_one_unit_do_not_know_of_each_other(exported, tmp_path, method):
    place, name = copied(exported(method), tmp_path / "out")
    wires = [row for row in rows(place / "registers.csv") if row["written_by"] == "plant" and row["length"] == "0"]
    assert wires
    writes = "".join(f"    {row['expression']} = draw(&x->seed) & 1u;\n" for row in wires)
    text = PAIR.replace("NAME_HASH_START", f"{name.upper()}_HASH_START").replace("NAME", name)
    (place / "pair.c").write_text(text.replace("WRITES", writes))
    made = run(f"gcc {FLAGS} -O1 pair.c", place, *unit_sources(place, name), f"{name}_image.c", "-o", "pair", "-lm")
    assert made.returncode == 0, made.stderr
    (first, interleaved), (second, other) = (line.split() for line in run("./pair", place).stdout.splitlines())
    assert (first, second) == (interleaved, other)
    assert first != second


def rows(file: Path) -> list[dict[str, str]]:
    with file.open(newline="", encoding="utf-8") as stream:
        return list(csv.DictReader(stream))


READER = Path(sys.executable).with_name("pya2l")


def described(file: Path) -> dict[str, dict]:
    """What another reader finds: by its symbol everything that can be tuned or measured."""
    made = file.with_suffix(".json")
    done = run(f"{READER} -c {file} to_json -e 1 -o {made}", file.parent)
    assert (done.returncode, done.stderr) == (0, "")
    (module,) = json.loads(made.read_text())["PROJECT"]["MODULE"]
    found = [*module["CHARACTERISTIC"], *module["MEASUREMENT"]]
    by_symbol = {one["SYMBOL_LINK"]["SymbolName"]["Value"]: one for one in found}
    assert len(by_symbol) == len(found) == len({one["Name"]["Value"] for one in found})
    return by_symbol


@pytest.mark.parametrize("method", ["cascade", "single", "phase_servo", "rotary_table"])
def test_32_another_reader_finds_every_parameter_and_register_in_the_description(exported, tmp_path, method):
    place, name = copied(exported(method), tmp_path / "out")
    found = described(place / f"{name}.a2l")
    tuned = [row for row in rows(place / "params.csv") if row["tunable"] == "yes"]
    wanted = [*tuned, *rows(place / "registers.csv")]
    assert len(wanted) == len(found)
    for row in wanted:
        one = found[f"{name}_{row['expression'].replace('->', '.')}"]
        assert one["Name"]["Value"].endswith(f".{row['name']}")
        assert one["LongIdentifier"]["Value"] == row["meaning"]
        assert one["PHYS_UNIT"]["Unit"]["Value"] == row["unit"]
        if row["range"]:
            limits = [float(end) for end in row["range"].split(" to ")]
            assert [float(one[end]["Value"]) for end in ("LowerLimit", "UpperLimit")] == limits
        if row["length"] != "0":
            assert one["MATRIX_DIM"]["XDim"]["Value"] == int(row["length"])
    spoiled = place / "spoiled.a2l"
    spoiled.write_text((place / f"{name}.a2l").read_text().replace("/end MEASUREMENT", "", 1))
    assert run(f"{READER} -c {spoiled} to_json", place).returncode != 0


@pytest.mark.parametrize(("method", "compiler"), [("cascade", "gcc"), ("phase_servo", "clang -gdwarf-4")])
def test_32_addresses_are_those_of_nm(exported, tmp_path, method, compiler):
    if not shutil.which(compiler.split()[0]):
        pytest.skip(f"not installed: {compiler.split()[0]}")
    place, name = copied(exported(method), tmp_path / "out")
    found = [row for table in ("params.csv", "registers.csv") for row in rows(place / table) if row["expression"]]
    symbols = [f"{name}_{row['expression'].replace('->', '.')}" for row in found]
    lines = "".join(
        f'    printf("%zu\\n", (size_t)((char *)&{s} - (char *)&{s.partition(".")[0]}));\n' for s in symbols
    )
    (place / "app.c").write_text(
        f'#include <stdio.h>\n#include "{name}.h"\n{name}_params {name}_p;\n{name}_controller {name}_c;\n'
        f"{name}_lines {name}_l;\nint main(void) {{\n{lines}    return 0;\n}}\n"
    )
    made = run(f"{compiler} {FLAGS} -g app.c", place, *unit_sources(place, name), "-o", "app", "-lm")
    assert made.returncode == 0, made.stderr
    offsets = [int(one) for one in run("./app", place).stdout.split()]
    told = {row.split()[2]: int(row.split()[0], 16) for row in run("nm --defined-only app", place).stdout.splitlines()}
    wanted = {s: told[s.partition(".")[0]] + offset for s, offset in zip(symbols, offsets, strict=True)}
    assert fill_addresses(place, place / "app", place / "app.a2l") == wanted
    written = described(place / "app.a2l")
    for symbol, one in written.items():
        at = one["Address"] if "Address" in one else one["ECU_ADDRESS"]["Address"]
        assert int(at["Value"]) == wanted[symbol]


# ---- over a serial line


@pytest.mark.parametrize("method", ["phase_servo", "rotary_table"])
def test_34_a_serial_line_alone_carries_the_proof_and_8_kb_suffice(exported, tmp_path, method):
    needs("cortex-m4")
    folder = exported(method)
    manifest, target = read_manifest(folder), TARGETS["cortex-m4"]
    name, unit = manifest["name"], unit_named(manifest["method"], manifest["name"], manifest["arithmetic"])
    beside = ctypes.sizeof(unit.controller) + ctypes.sizeof(unit.lines) + 8192
    (tmp_path / "board.ld").write_text(template("board.ld.in", **(target.memory | {"data_length": str(beside)})))
    made = run(
        f"{target.compiler} {FLAGS} {target.flags} -Os -DON_UART -T board.ld -Wl,-e,Start -I{folder}", tmp_path,
        *(str(folder / one) for one in sources(folder, name)), "-o", "unit", *target.libraries.split(),
    )  # fmt: skip
    assert made.returncode == 0, made.stderr
    command = [target.emulator, *target.machine.split(), "-nographic", "-monitor", "none", "-serial", "stdio"]
    with (
        (folder / "vectors/job.vec").open("rb") as vectors,
        subprocess.Popen(
            [*command, "-kernel", "unit"], cwd=tmp_path, stdin=vectors, stdout=subprocess.PIPE, text=True
        ) as emulated,
    ):
        killer = threading.Timer(300.0, emulated.kill)
        killer.start()
        try:
            assert emulated.stdout.readline().split() == ["equal", str(manifest["ticks"]), manifest["hash"]]
        finally:
            killer.cancel()
            emulated.kill()


# ---- sources that go on, parameters that change


@pytest.mark.wide
def test_18_a_step_edited_after_the_export_is_named(tmp_path):
    source = Path(detent.__file__).parent
    shutil.copytree(source, tmp_path / "detent", ignore=shutil.ignore_patterns("__pycache__", "static", "*.mp4"))
    axis = detent.load(detent.example("cascade.toml"))
    folder = export_firmware(axis, tmp_path / "out", ticks=200, files=2, rounds=100).folder
    command = f"{sys.executable} -m detent verify out --on host-gcc --json --against"
    environment = os.environ | {"NUMBA_DISABLE_JIT": "1", "PYTHONPATH": str(tmp_path)}

    def verified() -> tuple[int, list[str]]:
        done = subprocess.run(
            [*command.split(), str(detent.example("cascade.toml"))], cwd=tmp_path, env=environment,
            capture_output=True, text=True, check=False,
        )  # fmt: skip
        found = json.loads(done.stdout)
        assert "differences" in found, found
        return done.returncode, found["differences"]

    needs("host-gcc")
    assert verified() == (0, [])
    law = tmp_path / "detent/control/cascade_law.py"
    text = law.read_text()
    law.write_text(text.replace("    r.integral += increment\n", "    r.integral += increment * 1.0\n", 1))
    assert law.read_text() != text
    status, told = verified()
    assert status == 1
    assert told[0] == "detent/control/cascade_law.py limit_command is another step than at the export"
    assert read_manifest(folder)["report"] == {}


@pytest.mark.parametrize("method", ["cascade", pytest.param("single", marks=pytest.mark.wide)])
def test_31_a_set_exchanged_at_tick_10000_is_simulated_and_replayed_equal(tmp_path, method):
    needs("host-gcc")
    axis = axis_named(method)
    rows_of = '[[move]]\nby = "300 mm"\ndwell = "{dwell}"\n'
    change = '[[parameter_change]]\ntime = "{time!r} s"\nname = "{name}"\nvalue = {value}\n'
    (tmp_path / "same.toml").write_text(rows_of.format(dwell="2 s"))
    at = 10_000 * axis.simulated.tick
    changed = change.format(time=at, name="law.cascade.position_gain", value=41.0)
    changed += change.format(time=at, name="motor_sensor.delay", value=2)
    (tmp_path / "changed.toml").write_text(changed + rows_of.format(dwell="2 s"))
    made = {
        name: export_firmware(
            axis, tmp_path / name, job=tmp_path / f"{name}.toml", ticks=12_000, files=0, rounds=0, fixed=["limits.*"]
        ).folder
        for name in ("same", "changed")
    }
    assert read_manifest(made["same"])["hash"] != read_manifest(made["changed"])["hash"]
    told = list(shown(made["changed"] / "vectors/job.vec"))
    (k,) = (k for k, line in enumerate(told) if line.startswith("parameters exchanged"))
    assert told[k].endswith(": law.cascade.position_gain = 41.0, motor_sensor.delay = 2") or told[k].endswith(
        ": motor_sensor.delay = 2, law.cascade.position_gain = 41.0"
    )
    assert [line for line in told[:k] if line.startswith("tick ")][-1].endswith(" 10000")
    proven(made["changed"], "host-gcc")
    fixed = [row for row in rows(made["changed"] / "params.csv") if row["name"].startswith("limits.")]
    assert {row["tunable"] for row in fixed} == {
        "by --fixed, folded into the code", "an option, folded into the code",
    }  # fmt: skip
    assert {row["expression"] for row in fixed} == {""}
    assert "following_error" not in (made["changed"] / f"{read_manifest(made['changed'])['name']}.h").read_text()


CHANGED = {
    "filtered_servo": ('[[move]]\nby = "1 mm"', "deviation.gain", 2.0),
    "phase_servo": ('[[move]]\ntarget = "0.2 in"', "pwm.half", 100),
    "rotary_table": ("[[step]]\ngo = 1", "positioner.gain", 1e-5),
    "zoom": ('[[move]]\ngroup_a = "35 mm"', "instant_ticks", 3),
    "print_head": ('print = "line.txt"', "zero_speed_us", 1000),
}
"""Of each other method a job, a parameter and what it becomes."""


@pytest.mark.parametrize("method", CHANGED)
def test_31_a_set_is_exchanged_in_a_job_of_each_method(tmp_path, method, at_one_level):
    """At all levels of the compiler the exchange of the cascade is replayed, above."""
    needs("host-gcc")
    at_one_level(TRAPS)
    axis, motor = axis_named(method), MOTORS.get(method, "")
    text, name, value = CHANGED[method]
    (tmp_path / "line.txt").write_text("a line")
    told = f"{motor}.{name}" if motor else name
    change = f'[[parameter_change]]\ntime = "{1500 * axis.simulated.tick!r} s"\nname = "{told}"\nvalue = {value}\n'
    (tmp_path / "same.toml").write_text(f"{text}\n")
    (tmp_path / "changed.toml").write_text(f"{text}\n{change}")
    made = {
        one: export_firmware(
            axis, tmp_path / one, job=tmp_path / f"{one}.toml", motor=motor, ticks=9_000, files=0, rounds=0
        ).folder
        for one in ("same", "changed")
    }
    assert read_manifest(made["same"])["hash"] != read_manifest(made["changed"])["hash"]
    lines = list(shown(made["changed"] / "vectors/job.vec"))
    (k,) = (k for k, line in enumerate(lines) if line.startswith("parameters exchanged"))
    assert lines[k] == f"parameters exchanged: {name} = {value}"
    assert [line for line in lines[:k] if line.startswith("tick ")][-1].endswith(" 1500")
    proven(made["changed"], "host-gcc")


@pytest.mark.parametrize(
    ("name", "value", "told"),
    [("motor_sensor.delay", "64", "motor_sensor.delay = 64; expected: a whole number of i8 from 0 to 63"),
     ("law.position_pid", "1", "law.position_pid, an option; expected: a tunable number"),
     ("law.gain", "1", "law.gain, which is none; expected: a tunable number")],
)  # fmt: skip
def test_31_a_change_that_does_not_fit_is_refused_with_its_line(tmp_path, name, value, told):
    job = tmp_path / "job.toml"
    job.write_text(f'[[parameter_change]]\ntime = "1 s"\nname = "{name}"\nvalue = {value}\n\n[[move]]\nby = "1 mm"\n')
    with pytest.raises(InputError, match=rf"job\.toml:1:1 .*got {re.escape(told)}"):
        detent.load(detent.example("cascade.toml")).run(job)


@pytest.mark.long
def test_29_export_and_verify_take_no_more_processor_time_than_stated(tmp_path):
    """One after the other, none of it in parallel: on a machine that does nothing else this is the time on the wall."""

    def taken(command: str) -> float:
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        done = run(f"{sys.executable} -m detent {command}", tmp_path)
        assert done.returncode == 0, done.stderr[-500:]
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime

    needs("host-gcc")
    job = f"{detent.example('print_head.toml')} --job {detent.example('letter.txt')}"
    export = f"export firmware {job} --output out"
    taken(export)  # compiled steps to the cache
    assert taken(export) <= 15.0
    assert taken("verify out --on host-gcc") <= 60.0
    assert taken("verify out") <= 600.0


# ---- in the documentation

LOOP = Path(__file__).parents[2] / "docs/how-to/cascade-on-a-microcontroller.md"


def test_30_a_program_of_60_lines_drives_the_cascade_to_the_bit_of_the_simulation(tmp_path):
    needs("host-gcc")
    blocks = blocks_of(LOOP)
    programs = {name: one.text for one in blocks if (name := one.marks.get("file", "")) in ("axis.c", "host.c")}
    assert sum(len(text.splitlines()) for text in programs.values()) <= 60
    axis = detent.load(detent.example("cascade.toml"))
    export_firmware(axis, tmp_path / "firmware", prefix="slide", ticks=100, files=0, rounds=0)
    (tmp_path / "cascade.toml").write_text(detent.example("cascade.toml").read_text())
    for name, text in programs.items():
        (tmp_path / name).write_text(text)
    made = run(
        f"gcc {FLAGS} {WARNINGS} -Wno-missing-prototypes -Werror -O2 -Ifirmware axis.c host.c firmware/slide.c "
        "firmware/slide_params.c firmware/slide_selftest.c -lm -o host", tmp_path,
    )  # fmt: skip
    assert made.returncode == 0, made.stderr
    told = run("./host", tmp_path)
    (simulated,) = [one.text for one in blocks if one.language == "python"]
    (tmp_path / "simulated.py").write_text(simulated)
    done = run(f"{sys.executable} simulated.py", tmp_path)
    assert (told.returncode, done.returncode, done.stderr) == (0, 0, "")
    assert told.stdout == done.stdout  # 17 digits tell every bit
    assert float(told.stdout.split()[0]) == pytest.approx(0.06, abs=1e-6)  # in its place


BEFORE_33 = {
    "group_a": (12_572, 13_148),
    "group_b": (9_484, 10_060),
    "x": (3_762, 4_340),
    "y": (4_740, 5_318),
    "table": (10_322, 10_896),
    "lift": (6_408, 6_986),
}
"""Flash of the packaged motors with the rule as it was written by hand [byte], at -Os: Cortex-M4, ATmega1284P."""
MOTOR_FILES = {"group_a": "zoom", "group_b": "zoom", "x": "stage", "y": "stage", "table": "photo_table",
               "lift": "photo_table"}  # fmt: skip


@pytest.mark.parametrize("motor", BEFORE_33)
def test_33_the_envelopes_header_is_translated_and_hardly_larger(tmp_path, motor):
    """Its other tests are those of before (tests/unit/methods/stepper_envelope/test_envelope_*.py)."""
    tables = detent.load(detent.example(f"{MOTOR_FILES[motor]}.toml")).envelopes()[motor].tables
    write_envelope_header(tables, tmp_path / "motor.h")
    text = (tmp_path / "motor.h").read_text()
    for one in (next_step, follow, take_inputs, come_to_rest):
        assert f"step_rule.py:{getattr(one, 'py_func', one).__code__.co_firstlineno + 1} {one.__name__}\n" in text
    calls = {"next": "", "place": ", 7", "start": ", 1, 0", "deflect": ", 7, 1"}
    head = f"void u_KEY({motor}_registers *m)"
    lines = [f"{head};\n{head} {{ {motor}_KEY(m{given}); }}\n".replace("KEY", key) for key, given in calls.items()]
    unit = "".join(lines)
    (tmp_path / "unit.c").write_text(f'#include "motor.h"\n{unit}')
    found = []
    for tools, flags in (("arm-none-eabi-", PROCESSORS["cortex-m4"]), ("avr-", "-mmcu=atmega1284p")):
        if not shutil.which(f"{tools}gcc"):
            pytest.skip(f"not installed: {tools}gcc")
        made = run(f"{tools}gcc -std=gnu99 -Os {flags} -c unit.c -o unit.o", tmp_path)
        assert made.returncode == 0, made.stderr
        sizes = run(f"{tools}size unit.o", tmp_path).stdout.splitlines()[1].split()
        found.append(int(sizes[0]) + int(sizes[1]))
    for now, before in zip(found, BEFORE_33[motor], strict=True):
        assert 0.9 * before < now <= 1.05 * before, (found, BEFORE_33[motor])
