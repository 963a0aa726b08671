"""`detent verify`: compile an export, replay its golden vectors, compare the hash of all registers after every tick.

On this computer by its compilers, at three levels of optimisation and once where everything undefined traps; and on
processors that qemu emulates. Compilers and emulators are found on the path; what is not installed is said.
"""

import ctypes
import re
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from detent.axis import Axis
from detent.errors import DetentError
from detent.export.code import FLAGS, PROCESSORS, WARNINGS, short_hash, template
from detent.export.drawn import Chance, Row
from detent.export.unit import ControlUnit, refuse_floats, unit_named
from detent.export.vectors import cut
from detent.export.write import changed_files, export_firmware, manifest_of
from detent.kernel.registers import Registers
from detent.translate.values import RefusedError

TIMEOUT = 600.0  # of one replay [s]
TOLD = 20  # registers that are told of a difference
TRAPS = "-O1 -g -fsanitize=undefined,address -fno-sanitize-recover=all -DFIRMWARE_CHECK"
ARM = "-ffreestanding -nostartfiles"
SMALL = {"code": "0x00000000", "code_length": "4M", "data": "0x20000000", "data_length": "4M",
         "vectors_length": "16M"}  # fmt: skip
LARGE = {"code": "0x80000000", "code_length": "64M", "data": "0x84000000", "data_length": "32M",
         "vectors": "0x86000000", "vectors_length": "32M"}  # fmt: skip


@dataclass(frozen=True)
class Target:
    """Where an export can be replayed."""

    name: str
    compiler: str
    package: str  # of Debian
    flags: str = ""
    levels: tuple[str, ...] = ("-Os",)
    emulator: str = ""
    machine: str = ""  # arguments of the emulator
    emulator_package: str = ""
    memory: dict[str, str] | None = None  # of an emulated board
    libraries: str = "-lm"
    share: int = 1  # of the random calls and ticks one in so many is done; 0: none, it has no room for them
    most: int = 0  # ticks of the job; 0: all
    back: int = 0  # what a call leaves on the stack [byte]; 0 where it does not, but in a register
    warnings: str = WARNINGS
    linker: str = ""  # where it is not the compiler

    @property
    def is_emulated(self) -> bool:
        """True for a processor on which instructions or cycles, and stack, can be counted."""
        return self.memory is not None or bool(self.emulator)

    @property
    def missing(self) -> str:
        """What is not installed; empty where all is there."""
        tools = [(self.compiler, self.package), (self.emulator, self.emulator_package)]
        absent = [
            f"{tool} (Debian: apt install {package})" for tool, package in tools if tool and not shutil.which(tool)
        ]
        return " and ".join(absent)


def _host(name: str, compiler: str, *more: str) -> Target:
    return Target(name, compiler, compiler, "-DON_HOST", ("-O0", "-O2", "-Os", *more))


def _cortex(name: str, board: str, vectors: str = "0x21000000") -> Target:
    """A board, and where it has memory for vectors."""
    return Target(
        name, "arm-none-eabi-gcc", "gcc-arm-none-eabi libnewlib-arm-none-eabi", f"{ARM} {PROCESSORS[name]}",
        emulator="qemu-system-arm", machine=f"-M {board}", emulator_package="qemu-system-arm",
        memory=SMALL | {"vectors": vectors}, libraries="-nostdlib -lm -lc -lgcc", share=10,
    )  # fmt: skip


TARGETS = {
    one.name: one
    for one in (
        _host("host-gcc", "gcc", TRAPS),
        _host("host-clang", "clang"),
        _cortex("cortex-m0", "mps2-an385"),
        _cortex("cortex-m4", "mps2-an386"),
        _cortex("cortex-m4f", "mps2-an386"),
        _cortex("cortex-m7", "mps2-an500", "0x60000000"),
        Target(
            "rv32", "riscv64-unknown-elf-gcc", "gcc-riscv64-unknown-elf picolibc-riscv64-unknown-elf",
            f"--specs=picolibc.specs {PROCESSORS['rv32']} -ffreestanding -nostartfiles",
            emulator="qemu-system-riscv32", machine="-M virt -bios none", emulator_package="qemu-system-misc",
            memory=LARGE, libraries="-nostdlib -lm -lc -lgcc", share=10,
        ),
        # simavr, since qemu 7.2 reads flash beyond 64 KB as if it began anew; gcc 5.4 knows one warning less.
        Target(
            "avr", "avr-gcc", "gcc-avr avr-libc", PROCESSORS["avr"], emulator="simavr",
            machine="-m atmega2560 -f 16000000", emulator_package="simavr", libraries="", share=0, most=6000, back=3,
            warnings=WARNINGS.replace("-Wimplicit-fallthrough", ""),
        ),
    )
}  # fmt: skip


@dataclass(frozen=True)
class Proof:
    """What a replay on a target said."""

    target: str
    level: str
    equal: bool
    told: str  # the hash, or what differs


def verify(
    folder: str | Path, on: Sequence[str] = (), progress: Callable[[float, str], None] = lambda _share, _text: None
) -> list[Proof]:
    """Replay an export.

    Parameters
    ----------
    folder : path
        What `export_firmware` wrote.
    on : sequence of str, optional
        Names of `TARGETS`; default: all that are installed.
    progress : callable, optional
        ``progress(share, text)``.

    Returns
    -------
    list of Proof
        One for each target and level; one that is not `equal` for a target of `on` that is not installed.

    Raises
    ------
    InputError
        The folder is no export, or a target is none.
    """
    place = Path(folder)
    manifest = manifest_of(place)
    unknown = [name for name in on if name not in TARGETS]
    if unknown:
        raise DetentError(f"--on: got {', '.join(unknown)}; expected: {', '.join(TARGETS)}; name some of these")
    out = left_out(place)
    chosen = [TARGETS[name] for name in on] or [one for one in TARGETS.values() if one.name not in out]
    edited = changed_files(place, manifest)
    found = [Proof("files", "", equal=False, told=f"{name} is not as it was written") for name in edited]
    runs = [(target, level) for target in chosen for level in target.levels]
    for k, (target, level) in enumerate(runs):
        progress(k / len(runs), f"{target.name} {level.split()[0]}")
        if target.name in out:
            found.append(Proof(target.name, level, equal=False, told=absent(out[target.name])))
        else:
            found.append(_replayed(place, manifest, target, level))
    return found


def absent(why: str) -> str:
    """What a proof says that could not be tried: a refusal as it is, or the tools that are missing."""
    return why if why.startswith("FW") else f"not installed: {why}"


def left_out(folder: str | Path) -> dict[str, str]:
    """Targets on which an export cannot be replayed, and why."""
    manifest, found = manifest_of(Path(folder)), dict[str, str]()
    unit = unit_named(manifest["method"], manifest["name"], manifest.get("arithmetic", "double"))
    for name, target in TARGETS.items():
        try:
            if unit is not None:
                refuse_floats(unit, name)
        except RefusedError as refused:
            found[name] = str(refused)
        if target.missing:
            found.setdefault(name, target.missing)
    return found


def _replayed(folder: Path, manifest: dict[str, str], target: Target, level: str) -> Proof:
    """Compile for a target, and run there."""
    name, source = manifest["name"], folder.resolve()
    with tempfile.TemporaryDirectory() as made:
        work = Path(made)
        job_file, ticks, wanted = job_for(folder, manifest, target, work)
        strict = f"{target.compiler} {FLAGS} {level} {target.flags} {target.warnings} -Werror -I{source} -c"
        told = run_tool([*strict.split(), str(source / f"{name}.c"), "-o", "unit.o"], work)
        told = told or run_tool([*strict.split(), str(source / f"{name}_selftest.c"), "-o", "selftest.o"], work)
        told = told or compile_parts(source, name, target, level, work, job=job_file)
        # The program of the random vectors holds the unit's own text, and sees its inner functions.
        programs = {"job": ("unit", "replay", "selftest")} | ({"drawn": ("drawn",)} if target.share else {})
        for program, parts in programs.items():
            told = told or link(work, target, level, program, (*parts, f"board_{program}"))
        if told:
            return Proof(target.name, level, equal=False, told=f"does not compile: {told}")
        drawn = answer(target, work, source, "drawn").splitlines() if target.share else ["drawn equal 0"]
        job = answer(target, work, source, "job").splitlines()
    told = [told_of_drawn(folder, manifest, drawn)] if not any(one.startswith("drawn equal ") for one in drawn) else []
    told += [told_of(folder, job)] if f"equal {ticks} {wanted}" not in job else []
    return Proof(target.name, level, not told, "; job ".join(told) or wanted)


def job_for(folder: Path, manifest: Mapping[str, Any], target: Target, work: Path) -> tuple[Path, int, str]:
    """Vectors of the job as far as a target has room for them: the file, its ticks, and the hash behind them."""
    file = folder.resolve() / "vectors/job.vec"
    known = exported_unit(folder, manifest) if target.most else None
    if known is None:
        return file, int(manifest["ticks"]), str(manifest["hash"])
    data, ticks, wanted = cut(known[0], file.read_bytes(), target.most)
    (work / "job.vec").write_bytes(data)
    return work / "job.vec", ticks, wanted


def compile_parts(  # noqa: PLR0913 - what, for which processor, and where
    source: Path, name: str, target: Target, level: str, work: Path, more: str = "", job: Path | None = None
) -> str:
    """Compile all around the unit; what the compiler says where it refuses, else nothing."""
    command = f"{target.compiler} {FLAGS} {level} {target.flags} -DSHARE={target.share} -I{source} {more} -c".split()
    programs = {"job": job or source / "vectors/job.vec", "drawn": source / "vectors/drawn.vec"}
    parts = ["params", "tables", "image", "selftest", "replay", "drawn"]
    if not target.share:
        del programs["drawn"]
        parts.remove("drawn")
    files = {f"{part}.o": (source / f"{name}_{part}.c", list[str]()) for part in parts}
    files |= {f"board_{kind}.o": (source / "board.c", [f'-DVECTORS="{file}"']) for kind, file in programs.items()}
    told = ""
    for made, (file, given) in files.items():
        if file.is_file():
            told = told or run_tool([*command, *given, str(file), "-o", made], work)
    return told


def link(work: Path, target: Target, level: str, program: str, parts: Sequence[str]) -> str:
    """Link a program of these parts with parameters and image; what the linker says where it refuses, else nothing."""
    more: list[str] = []
    if target.memory is not None:
        (work / "board.ld").write_text(template("board.ld.in", **target.memory), encoding="utf-8")
        more = ["-T", "board.ld", "-Wl,-e," + ("entry_" if target.name == "rv32" else "Start")]
    tables = ["tables"] if (work / "tables.o").is_file() else []
    objects = [f"{part}.o" for part in (*parts, *tables, "params", "image")]
    compiled_for = [] if target.linker else target.flags.split()
    command = [target.linker or target.compiler, *level.split(), *compiled_for, *more]
    return run_tool([*command, *objects, "-o", program, *target.libraries.split()], work)


def run_tool(command: list[str], work: Path) -> str:
    """Run a compiler; what it says where it refuses, else nothing."""
    done = subprocess.run(command, cwd=work, capture_output=True, text=True, check=False)  # noqa: S603 - found on the path
    return "" if done.returncode == 0 else (done.stderr or done.stdout or "no word").strip().splitlines()[0]


def answer(target: Target, work: Path, source: Path, program: str, more: str = "") -> str:
    """What a replay says; `more` are arguments of the emulator."""
    command = [f"./{program}", str(source / f"vectors/{program}.vec")]
    if target.emulator:
        rest = "-nographic -monitor none -serial none -semihosting-config enable=on,target=native"
        rest = f"{rest} {more} -kernel" if target.emulator.startswith("qemu") else ""
        command = [target.emulator, *target.machine.split(), *rest.split(), program]
    try:
        done = subprocess.run(  # noqa: S603 - found on the path
            command, cwd=work, capture_output=True, text=True, errors="replace", check=False, timeout=TIMEOUT,
            stdin=subprocess.DEVNULL,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return f"no answer within {TIMEOUT:g} s"
    if target.emulator == "simavr":  # it prints what it hears in colour, with a dot for the end of a line
        return re.sub(r"\x1b\[[\d;]*m|\.$", "", done.stdout + done.stderr, flags=re.MULTILINE)
    return done.stdout + done.stderr


def told_of(folder: Path, lines: Sequence[str]) -> str:
    """A replay's own words for people: tick, and registers by their names."""
    rows = (folder / "registers.csv").read_text(encoding="utf-8").splitlines()[1:]
    names = [row.split(",", 2)[1] for row in rows]
    tick = next((line.split()[1] for line in lines if line.startswith("differs ")), "")
    found: list[str] = []
    for line in lines:
        words = line.split()
        if words[:1] == ["register"] and len(words) == 6:
            got, wanted, at = words[3:]
            found.append(f"{names[int(words[1])]}[{words[2]}] {got} for {wanted} by tick {at}")
    if not tick:
        return " ".join(lines[-3:]) or "no answer"
    return f"differs in tick {tick}: {'; '.join(found) or 'the hash alone'}"


def exported_unit(folder: Path, manifest: Mapping[str, Any]) -> tuple[ControlUnit, Registers] | None:
    """The unit of an export, and its parameters at power-on; None where its registers are others by now."""
    unit = unit_named(manifest["method"], manifest["name"], manifest.get("arithmetic", "double"))
    data = (folder / "vectors/params.bin").read_bytes()
    if unit is None or "fit" not in manifest or len(data) != ctypes.sizeof(unit.params):
        return None
    return unit.fitted_as(manifest["fit"]), unit.params.from_buffer_copy(data)


def chance_of(folder: Path, manifest: Mapping[str, Any]) -> Chance | None:
    """What the random vectors of an export were drawn from; None where the steps are others by now."""
    known = exported_unit(folder, manifest)
    if known is None:
        return None
    unit, params = known
    program = unit.translated(params, **manifest["folding"])
    steps = {f"{one.place.rpartition(':')[0]} {one.py.__qualname__}": one.source for one in program.order}
    hashes = {name: short_hash(source.encode()) for name, source in steps.items()}
    return Chance(unit, program, params) if hashes == _steps(folder) else None


def told_of_drawn(folder: Path, manifest: Mapping[str, Any], lines: Sequence[str]) -> str:
    """Where random vectors differ, for people: function, call, its arguments, and registers by their names."""
    words = [line.split() for line in lines]
    number, at = next(((int(one[1]), int(one[2])) for one in words if one[:1] == ["drawn"] and len(one) == 3), (-1, 0))
    chance = chance_of(folder, manifest) if number >= 0 else None
    if chance is None:
        return f"differs in call {at} of function {number}" if number >= 0 else " ".join(lines[-3:]) or "no answer"
    chance.run(number, at)
    if number < len(chance.program.order):
        f = chance.program.order[number]
        told = ", ".join(f"{name} {one}" for name, one in zip(f.parameters, chance.told, strict=True) if _is_plain(one))
        place = f"call {at} of {f.cname}({told})"
    else:
        place = f"tick {at} of misuse"
    found: list[str] = []
    for _, root, row, k, got in (one for one in words if one[:1] == ["state"] and len(one) == 5):
        name = ("c", "l")[int(root)]
        register = chance.rows[name][int(row)]
        wanted = chance.bits(register, int(k))
        if wanted != int(got):
            full = {"c": "controller", "l": "lines"}[name]
            found.append(f"{full}.{register.path}[{k}] {_value(register, int(got))} for {_value(register, wanted)}")
    return f"differs in {place}: {'; '.join(found[:TOLD]) or 'its result'}"


def _is_plain(one: Any) -> bool:
    return isinstance(one, int | float)


def _value(row: Row, bits: int) -> str:
    """What these bits are in a register."""
    return repr(row.width.ctype.from_buffer_copy(bits.to_bytes(row.width.size, "little")).value)


def differences(folder: str | Path, axis: Axis, job: str | Path | None = None) -> Iterator[str]:
    """Make an export anew, and tell where it is another: the steps that were edited, and the files.

    Parameters
    ----------
    folder : path
        What `export_firmware` wrote.
    axis : Axis
        What it was written from.
    job : path, optional
        The job of its vectors; default: as of `export_firmware`.

    Yields
    ------
    str
        A sentence for each difference.
    """
    place = Path(folder)
    manifest = manifest_of(place)
    with tempfile.TemporaryDirectory() as made:
        new = export_firmware(
            axis, Path(made) / "new", job=job, motor=manifest["motor"], prefix=manifest["name"],
            target=manifest["target"], ticks=max(1, int(manifest["ticks"])), **manifest["drawn"], **manifest["folding"],
        )  # fmt: skip
        before, after = (_steps(one) for one in (place, new.folder))
        for step in sorted(before.keys() | after.keys()):
            if before.get(step) != after.get(step):
                yield f"{step} is another step than at the export"
        files: dict[str, str] = dict(new.manifest["files"])
        for name in sorted(files.keys() | manifest["files"].keys()):
            if files.get(name) != manifest["files"].get(name):
                yield f"{name} is another file"


def _steps(folder: Path) -> dict[str, str]:
    """Hash of every step by its file and name."""
    rows = [row.split(",") for row in (folder / "trace.csv").read_text(encoding="utf-8").splitlines()[1:]]
    return {f"{row[2]} {row[4]}": row[5] for row in rows}
