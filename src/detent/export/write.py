"""`detent export firmware`: from an axis and a job to a folder of C with its golden vectors."""

import hashlib
import json
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, cast

from detent import __version__
from detent.axis import Axis
from detent.errors import DetentError, InputError
from detent.export.a2l import a2l_text
from detent.export.code import (
    FLAGS,
    PROCESSORS,
    as_json,
    drawn_text,
    parameters,
    registers,
    seconds,
    signals_of,
    texts,
)
from detent.export.drawn import FILES, ROUNDS, Chance, drawn_vectors
from detent.export.misra import DEVIATIONS
from detent.export.serial import serial_texts
from detent.export.unit import ControlUnit, options_of, outside_ranges, refuse_floats, unit_of
from detent.export.vectors import FORMATS, Golden, record
from detent.files.text import write_errors
from detent.kernel.registers import declared_of
from detent.methods.check import check_spec
from detent.translate.program import Function, Program
from detent.translate.values import RefusedError

MANIFEST = "manifest.json"
TICKS = 1_000_000  # of the golden run at most


@dataclass(frozen=True)
class Exported:
    """What was written."""

    folder: Path
    name: str  # prefix of all names in C
    manifest: Mapping[str, Any]
    unproven: Mapping[str, int]  # how many places of each kind were not proven in the earlier export; empty without one


def export_firmware(  # noqa: PLR0913 - what to export, where to, and what may be chosen
    axis: Axis,
    folder: str | Path,
    *,
    job: str | Path | None = None,
    motor: str = "",
    prefix: str = "",
    target: str = "host",
    ticks: int = TICKS,
    files: int = FILES,
    rounds: int = ROUNDS,
    tunable: Sequence[str] = (),
    fixed: Sequence[str] = (),
) -> Exported:
    """Write the controller of an axis as C99, with golden vectors of a job.

    Parameters
    ----------
    axis : Axis
        An axis of a method whose controller is firmware.
    folder : path
        A folder that is empty, that holds an earlier export and nothing else, or that is not there.
    job : path, optional
        Job whose run gives the golden vectors; default: a short one of the method.
    motor : str, optional
        Which one, of an axis with several.
    prefix : str, optional
        Of all names in C; default: from the name of the motor or the axis.
    target : str, optional
        What it is for, of `code.PROCESSORS`: decides what is refused, and the flags of build.mk; the C is the same.
    ticks : int
        Ticks of the golden run at most, 1 or more.
    files : int
        Random register files that each function is called on, 0 for none.
    rounds : int
        Ticks in which the host does anything and the lines show anything, 0 for none.
    tunable : sequence of str
        Patterns of names of options that stay parameters.
    fixed : sequence of str
        Patterns of names of parameters that become constants of the code.

    Returns
    -------
    Exported
        What was written; the same input gives the same bytes.

    Raises
    ------
    RefusedError
        The axis cannot be firmware; nothing is written.
    DetentError
        The folder holds other files (FW14), or the job made no tick.
    """
    place = Path(folder)
    if target not in PROCESSORS:
        raise DetentError(f"--target: got {target}; expected: one of {', '.join(PROCESSORS)}; name one of these")
    if ticks < 1:
        raise DetentError(f"--ticks: got {ticks}; expected: 1 or more; try: leave it out for {TICKS}")
    for option, count in (("--files", files), ("--rounds", rounds)):
        if count < 0:
            raise DetentError(f"{option}: got {count}; expected: 0 or more; try: leave it out")
    refuse_other_files(place)
    unit = unit_of(axis, prefix, motor)
    refuse_floats(unit, target)
    loaded = axis.load_job(job) if job is not None else axis.method.trial_job(axis.spec)
    golden = record(unit, axis, loaded, ticks)
    if golden.params is None or golden.ticks == 0:
        raise DetentError(f"{loaded.name}: got a job of no ticks; expected: one with motion; try: another --job")
    unit = golden.unit  # as long as the axis uses it
    for path, value, (lo, hi) in outside_ranges(golden.params, unit.shape):
        got = f"{path} = {value}"
        raise RefusedError("FW12", None, got, f"{lo} to {hi}", "change the axis file until the value fits")
    program = unit.translated(golden.params, tunable, fixed)
    code = texts(unit, program, golden, axis.name, seconds(axis.simulated.tick), target)
    code |= serial_texts(axis, unit, axis.name)
    made: dict[str, bytes] = {name: text.encode() for name, text in code.items()}
    for row in parameters(program, golden.params):
        if row.number in golden.changed and not row.expression:
            got = f"{loaded.name}, which changes {row.name}: {row.tunable}"
            raise DetentError(f"--fixed: got {got}; expected: a job that changes what is tunable; leave it tunable")
    chance = Chance(unit, program, golden.params)
    rows = ([asdict(one) for one in some] for some in (parameters(program, golden.params), registers(unit)))
    made[f"{unit.name}.a2l"] = a2l_text(unit.name, axis.name, __version__, *rows).encode()
    made[f"{unit.name}_drawn.c"] = drawn_text(chance).encode()
    made["vectors/job.vec"] = golden.vectors()
    made["vectors/params.bin"] = bytes(golden.params)
    made["vectors/drawn.vec"] = drawn_vectors(chance, files, rounds)
    manifest = _manifest(axis, loaded.name, golden, program)
    manifest["target"] = target
    manifest["drawn"] = {"files": files, "rounds": rounds}
    manifest["folding"] = {"tunable": list(tunable), "fixed": list(fixed)}
    made["README.md"] = readme(manifest, unit, seconds(axis.simulated.tick)).encode()
    manifest["files"] = {name: hashlib.sha256(data).hexdigest() for name, data in sorted(made.items())}
    made[MANIFEST] = as_json(manifest).encode()
    before = (read_manifest(place) or {}).get("not proven", {})
    _write(place, made)
    return Exported(place, unit.name, manifest, {what: len(rows) for what, rows in before.items()})


def _manifest(axis: Axis, job: str, golden: Golden, program: Program) -> dict[str, Any]:
    """What an export was made from, and what is not proven of it."""
    told = {f"{declared_of(one).__name__}.{key}": value for (one, key), value in program.options.items()}
    options = [f"{declared_of(one).__name__}.{key}" for one, key in options_of(golden.params)]
    return {
        "detent": __version__, "name": golden.unit.name, "axis": axis.name, "motor": golden.unit.motor,
        "method": axis.method.name, "arithmetic": golden.unit.arithmetic, "job": job,
        "ticks": golden.ticks, "hash": f"{golden.hash.number:016x}", "flags": FLAGS,
        "values": {row.key: row.value for row in check_spec(axis.file).rows},
        "options": {key: value for key, value in told.items() if key in options},
        "fixed": {key: value for key, value in told.items() if key not in options},
        "calls": [[name, [one for one in takes if one in FORMATS]] for name, takes in golden.unit.calls.items()],
        "signals": [one.width.code for one in signals_of(golden.unit, program) if one.width],
        "fit": golden.unit.told_fit,
        "image": sum(leaf.width.size * max(leaf.length, 1) for leaf in golden.unit.leaves),
        "functions": len(program.order), "tick": axis.simulated.tick,
        "misra deviations": DEVIATIONS,
        "entries": {f.cname: {"loops": loops_of(program, f)} for f in program.order if f.entry},
        "single to double": sorted(f"{w}: {t}" for w, t in program.notes.promotions),
        "not proven": {
            "ranges that only their declaration says": sorted(f"{w}: {t}" for w, t in program.notes.claims),
            "stores and arithmetic that may wrap": sorted(f"{w}: {t}" for w, t in program.notes.wraps),
        },
    }  # fmt: skip


def loops_of(program: Program, entry: Function) -> list[str]:
    """Loops that an entry can come to, with place and bound."""
    reached = [entry]
    for f in reached:
        reached += [program.steps[g] for g in f.reaches if program.steps[g] not in reached]
    ends = [(f.where(None).rpartition(":")[0], f.first, f.first + f.source.count("\n")) for f in reached]

    def inside(where: str) -> bool:
        file, _, line = where.rpartition(":")
        return any(file == one and first <= int(line) <= last for one, first, last in ends)

    return sorted(f"{where}: {text}" for where, text in program.notes.loops if inside(where))


def read_manifest(folder: Path) -> dict[str, Any] | None:
    """The manifest of an export; None where there is none that can be read."""
    try:
        found: Any = json.loads((folder / MANIFEST).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return cast("dict[str, Any]", found) if isinstance(found, dict) and "files" in found else None


def manifest_of(folder: Path) -> dict[str, Any]:
    """The manifest of an export; refused where there is none."""
    found = read_manifest(folder)
    if found is None:
        raise InputError.of_file(str(folder), f"a folder without {MANIFEST}", "an export", "detent export firmware")
    return found


def changed_files(folder: Path, manifest: Mapping[str, Any]) -> list[str]:
    """Files of an export that are absent, or are not as it wrote them."""
    found: list[str] = []
    for name, wanted in manifest["files"].items():
        file = folder / name
        if not file.is_file() or hashlib.sha256(file.read_bytes()).hexdigest() != wanted:
            found.append(name)
    return found


def refuse_other_files(folder: Path) -> None:
    """Refuse a folder that holds what no export wrote (FW14)."""
    if not folder.exists():
        return
    if not folder.is_dir():
        raise InputError.of_file(str(folder), "FW14: a file", "a folder", "name another --output")
    present = sorted(p.relative_to(folder).as_posix() for p in folder.rglob("*") if p.is_file())
    manifest = read_manifest(folder) or {"files": {}}
    others = [name for name in present if name not in {*manifest["files"], MANIFEST}]
    edited = [name for name in changed_files(folder, manifest) if name in present]
    if others or edited:
        got = f"FW14: a folder with {', '.join((others or edited)[:5])}, which no export wrote or somebody has edited"
        raise InputError.of_file(str(folder), got, "an empty folder, or an earlier export", "name another --output")


def _write(folder: Path, made: Mapping[str, bytes]) -> None:
    """Write all files beside the folder, then put it in its place: never a part of an export."""
    part = folder.with_name(f"{folder.name}.part")
    with write_errors(folder):
        shutil.rmtree(part, ignore_errors=True)
        for name, data in made.items():
            file = part / name
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_bytes(data)
        if folder.exists():
            shutil.rmtree(folder)
        part.rename(folder)


def readme(manifest: Mapping[str, Any], unit: ControlUnit, tick: str) -> str:
    """One page: what to call when."""
    name, whose = unit.name, f"Motor {unit.motor} of {manifest['axis']}" if unit.motor else manifest["axis"]
    return f"""# {whose} as firmware

Written by detent {manifest["detent"]} from an axis of the method {manifest["method"]}. C99, no heap, no globals.

1. Compile the sources of `build.mk` with its flags, `{manifest["flags"]}` among them. Never `-ffast-math`.
2. At power-on: check `{name}_selftest() == 0`, which makes 64 calls with the flags of this very build (where memory is
   short, `{name}_selftest_on` uses registers that you have), and `{name}_check_params(&{name}_defaults) == 0`, set a
   `{name}_controller` and a `{name}_lines` to zero bytes, write what the sensors show into the lines, and call
   `{unit.begins}`.
3. Every {tick}: write the lines that the plant writes, call `{name}_control`, and put the others out. Calls with the
   same pointers must not interrupt one another; two axes have two sets of registers.
4. Between two ticks the main program may call {", ".join(f"`{one}`" for one in unit.calls)}; their comments in
   `{name}.h` say what for.
5. `registers.csv` names every register and `params.csv` every parameter. A `{name}_params` in RAM may be exchanged
   between two ticks, by its pointer.
6. `{name}.a2l` says the same to calibration tools. It takes `{name}_p`, `{name}_c` and `{name}_l` for the variables of
   parameters, controller and lines; `detent export addresses` on this folder fills in where a linked program has them.

The simulation handles what happened in a tick at its end: equal bits need the same calls in the same order.

`detent verify` on this folder replays `vectors/job.vec`: {manifest["ticks"]} ticks of {manifest["job"]}, and compares
the hash of all registers after every one. On a board, compile `{name}_image.c` and `{name}_replay.c` too, give them
`{name}_get` and `{name}_put`, and call `{name}_replay()`: 0 is equal.
"""
