"""Addresses of a linked program in the description for calibration tools, and what is refused."""

import json
import shutil
import subprocess
import sys

import pytest
from tests.unit.test_cli import call

import detent
from detent.errors import DetentError, InputError
from detent.export.a2l import a2l_text
from detent.export.linked import Linked, fill_addresses
from detent.export.write import export_firmware

pytestmark = [
    pytest.mark.compiled,
    pytest.mark.process,
    pytest.mark.skipif(not shutil.which("gcc"), reason="not installed: gcc (Debian: apt install gcc)"),
]
NAME = "cascade_axis"
APPLICATION = f"""#include "{NAME}.h"
{NAME}_params mine;
{NAME}_controller {NAME}_c;
{NAME}_lines {NAME}_l;
int main(void) {{ return 0; }}
"""
VARIABLES = ("mine", f"{NAME}_c", f"{NAME}_l")
SAMPLES = f"{NAME}_c.samples"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    axis = detent.load(detent.example("cascade.toml"))
    return export_firmware(axis, tmp_path_factory.mktemp("linked") / "out", ticks=10, files=0, rounds=0).folder


@pytest.fixture(scope="module")
def compiled(folder, tmp_path_factory):
    """Compile the application, as these flags say."""
    place = tmp_path_factory.mktemp("application")

    def make(flags: str, text: str = APPLICATION, name: str = "app.elf"):
        (place / "app.c").write_text(text)
        command = f"gcc -std=c99 {flags} -I{folder} app.c -o {name}"
        subprocess.run(command.split(), cwd=place, check=True, capture_output=True)
        return place / name

    return make


@pytest.fixture(scope="module")
def application(compiled):
    return compiled("-g", name="whole.elf")


def test_addresses_are_written_beside_the_program_and_the_export_stays(folder, application, tmp_path):
    shutil.copy(application, tmp_path / "app.elf")
    before = {path: path.read_bytes() for path in folder.glob("*.*")}
    words = ("export", "addresses", folder, "--elf", tmp_path / "app.elf", "--variables", ",".join(VARIABLES))
    answer = call(*words)
    assert answer.status == 0
    found = call(*words, "--json").data
    assert found["file"] == str(tmp_path / "app.a2l")
    assert answer.out == f"{len(found['addresses'])} addresses in {tmp_path / 'app.a2l'}\n"
    text = (tmp_path / "app.a2l").read_text()
    assert f'ECU_ADDRESS 0x{found["addresses"][SAMPLES]:08X}\n      PHYS_UNIT "count"\n' in text
    assert "0x00000000 of_" not in text
    assert 'SYMBOL_LINK "mine.sample_ticks" 0' in text
    assert {path: path.read_bytes() for path in folder.glob("*.*")} == before
    (tmp_path / "app.a2l").write_text(text.replace("0x", "0X"))
    assert call(*words).status == 2
    assert call(*words, "--force").status == 0


def test_a_program_of_other_registers_is_refused(folder, application, compiled, tmp_path):
    def refused(program, match, variables=VARIABLES):
        with pytest.raises(InputError, match=match) as caught:
            fill_addresses(folder, program, tmp_path / "out.a2l", variables)
        assert (caught.value.exit_status, (tmp_path / "out.a2l").exists()) == (2, False)

    refused(application, f"no variable {NAME}_p; .*--variables", ())
    refused(compiled("-g -c"), "not linked, or without debug information")
    refused(compiled("-s"), "not linked, or without debug information")
    refused(tmp_path / "none.elf", "no such file")
    other, narrow = (
        APPLICATION.replace(f"{NAME}_params mine", f"struct {{ int {one}; }} mine") for one in ("other", "sample_ticks")
    )
    refused(compiled("-g", other), "got no mine.sample_ticks; .*anew")
    refused(compiled("-g", narrow), "mine.sample_ticks of 4 bytes; expected: 8 bytes")


def test_what_is_no_program_is_refused_wherever_it_is_damaged(application, tmp_path):
    data = application.read_bytes()
    for k in range(1, 20):
        (tmp_path / "cut.elf").write_bytes(data[: len(data) * k // 20])
        with pytest.raises(InputError, match="expected: a program that is linked"):
            Linked(tmp_path / "cut.elf")


def test_an_address_beyond_32_bits_is_refused(application):
    program = Linked(application)
    row = {"width": "i8", "length": "0"}
    place = program.address(SAMPLES, row)
    program.addresses[f"{NAME}_c"] += 1 << 32
    with pytest.raises(InputError, match=f"at {place + (1 << 32):#x}; expected: addresses up to 0xffffffff"):
        program.address(SAMPLES, row)


def test_an_edited_table_and_two_variables_are_refused(folder, application, tmp_path):
    with pytest.raises(DetentError, match="--variables: got a, b; expected: three names"):
        fill_addresses(folder, application, tmp_path / "out.a2l", ("a", "b"))
    shutil.copytree(folder, tmp_path / "copy")
    (tmp_path / "copy/params.csv").write_text("edited")
    with pytest.raises(InputError, match=r"params\.csv: got a file that was edited"):
        fill_addresses(tmp_path / "copy", application, tmp_path / "out.a2l", VARIABLES)
    with pytest.raises(InputError, match=r"without manifest\.json"):
        fill_addresses(tmp_path, application, tmp_path / "out.a2l", VARIABLES)


def test_without_its_reader_it_says_what_to_install(application, monkeypatch):
    monkeypatch.setitem(sys.modules, "elftools.elf.elffile", None)
    with pytest.raises(InputError, match=r"detent\[firmware\]"):
        Linked(application)


def test_a_description_holds_what_cannot_be_said_plainly():
    row = {"name": "a", "expression": "p->a", "width": "i2", "length": 3, "unit": "", "range": ""}
    row |= {"meaning": 'the "first"\nof \\ all'}
    text = a2l_text("n", "an */ axis", "1", [row, row | {"expression": ""}], [], little_endian=False)
    assert '/begin CHARACTERISTIC n.params.a "the \\"first\\" of \\\\ all"\n' in text
    assert "VAL_BLK 0x00000000 of_SWORD 0 NO_COMPU_METHOD -32768 32767\n      MATRIX_DIM 3 1 1\n" in text
    assert text.count("/begin CHARACTERISTIC") == 1
    assert ("BYTE_ORDER MSB_FIRST" in text, "an * / axis" in text) == (True, True)


def test_the_manifest_knows_the_description(folder):
    assert f"{NAME}.a2l" in json.loads((folder / "manifest.json").read_text())["files"]
