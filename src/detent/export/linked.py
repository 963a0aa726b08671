"""Addresses of registers and parameters in a linked program, from its symbols and its debug information.

The offsets are the compiler's own: nothing is taken for granted of how it lays a structure out.
"""

import csv
import importlib
import io
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from detent.errors import DetentError, InputError
from detent.export.a2l import Row, a2l_text, variables_of
from detent.export.write import changed_files, manifest_of
from detent.files.marks import IN_C, signed
from detent.files.text import reading, write_text

PROGRAM = "a program that is linked and has debug information (ELF with DWARF)"
REMEDY = "compile with -g, and name what the linker wrote"
MOST = (1 << 32) - 1  # the largest address of ASAP2


class Linked:
    """Variables of a linked program."""

    def __init__(self, file: Path) -> None:
        self.file = file
        with reading(file, PROGRAM, REMEDY):
            data = file.read_bytes()
        try:
            reader: Any = importlib.import_module("elftools.elf.elffile")
        except ImportError:
            got = "a program, which needs pyelftools, which is not installed"
            raise InputError.of_file(str(file), got, PROGRAM, 'pip install "detent[firmware]"') from None
        try:
            elf = reader.ELFFile(io.BytesIO(data))
            linked = elf.header["e_type"] in ("ET_EXEC", "ET_DYN") and elf.has_dwarf_info(strict=True)
            table = elf.get_section_by_name(".symtab")
            symbols = [one for one in table.iter_symbols() if one["st_info"]["type"] == "STT_OBJECT"] if table else []
            self.addresses = {one.name: int(one["st_value"]) for one in symbols}
            self.types = dict(_variables(elf.get_dwarf_info())) if linked else {}
            self.little_endian = bool(elf.little_endian)
        except Exception:  # noqa: BLE001 - anybody's file, and each reader of a part of it raises its own
            raise self.refused("another file, or a damaged one") from None
        if not linked:
            raise self.refused("a file that is not linked, or without debug information")

    def refused(self, got: str, expected: str = PROGRAM, remedy: str = REMEDY) -> InputError:
        """What is wrong with the program."""
        return InputError.of_file(str(self.file), got, expected, remedy)

    def address(self, symbol: str, row: Row) -> int:
        """Where a register stands, such as ``axis_c.law.command``; refused where it has another size."""
        variable, *path = symbol.split(".")
        if variable not in self.addresses or variable not in self.types:
            remedy = "define it outside of any function, or name yours with --variables"
            raise self.refused(f"no variable {variable}", "variables of parameters, controller and lines", remedy)
        place, kind = self.addresses[variable], _bare(self.types[variable])
        for part in path:
            inner = next((one for one in kind.iter_children() if _name(one) == part), None)
            if inner is None:
                raise self.refused(f"no {symbol}", "a program of this very export", "compile and link it anew")
            place += int(inner.attributes["DW_AT_data_member_location"].value)
            kind = _bare(inner)
        wanted, got = int(row["width"][1:]) * max(int(row["length"]), 1), _size(kind)
        if got != wanted:
            raise self.refused(
                f"{symbol} of {got} bytes", f"{wanted} bytes, as of this export", "compile and link it anew"
            )
        if place > MOST:
            raise self.refused(f"{symbol} at {place:#x}", f"addresses up to {MOST:#x}", "link it for 32-bit addresses")
        return place


def _name(die: Any) -> str:
    found = die.attributes.get("DW_AT_name")
    return found.value.decode() if found else ""


def _variables(dwarf: Any) -> Iterator[tuple[str, Any]]:
    """Variables outside of functions."""
    for unit in dwarf.iter_CUs():
        for die in unit.get_top_DIE().iter_children():
            if die.tag == "DW_TAG_variable" and "DW_AT_type" in die.attributes:
                yield _name(die), die


def _bare(die: Any) -> Any:
    """Type of a variable or a member, without names that it was given and without `const` and `volatile`."""
    kind = die.get_DIE_from_attribute("DW_AT_type")
    return _bare(kind) if kind.tag in ("DW_TAG_typedef", "DW_TAG_const_type", "DW_TAG_volatile_type") else kind


def _size(kind: Any) -> int:
    """Bytes of a type."""
    if kind.tag != "DW_TAG_array_type":
        return int(kind.attributes["DW_AT_byte_size"].value) if "DW_AT_byte_size" in kind.attributes else 0
    (extent,) = (one.attributes for one in kind.iter_children())
    # gcc tells the last index, clang the number of elements.
    count = int(extent["DW_AT_count"].value) if "DW_AT_count" in extent else int(extent["DW_AT_upper_bound"].value) + 1
    return count * _size(_bare(kind))


def fill_addresses(
    folder: str | Path, elf: str | Path, output: str | Path, variables: Sequence[str] = (), *, force: bool = False
) -> dict[str, int]:
    """Write the description of an export for calibration tools with the addresses of a linked program; tell these.

    `variables` are those of parameters, controller and lines in the application, ``NAME_p``, ``NAME_c`` and ``NAME_l``
    unless told otherwise. The description in the folder stays as it is.
    """
    place = Path(folder)
    manifest = manifest_of(place)
    edited = [one for one in changed_files(place, manifest) if one.endswith(".csv")]
    if edited:
        raise InputError.of_file(str(place / edited[0]), "a file that was edited", "an export", "export it again")
    names = variables_of(manifest["name"])
    if variables and len(variables) != len(names):
        got = f"--variables: got {', '.join(variables)}; expected: three names, of parameters, controller and lines"
        raise DetentError(f"{got}; try: {','.join(names.values())}")
    names |= dict(zip(names, variables, strict=False))
    program, found = Linked(Path(elf)), dict[str, int]()

    def address(symbol: str, row: Row) -> int:
        found[symbol] = program.address(symbol, row)
        return found[symbol]

    text = a2l_text(
        manifest["name"], manifest["axis"], manifest["detent"], _rows(place / "params.csv"),
        _rows(place / "registers.csv"), variables=names, address=address, little_endian=program.little_endian,
    )  # fmt: skip
    write_text(output, signed(text, IN_C), force=force)
    return found


def _rows(file: Path) -> list[Mapping[str, str]]:
    with file.open(newline="", encoding="utf-8") as stream:
        return list(csv.DictReader(stream))
