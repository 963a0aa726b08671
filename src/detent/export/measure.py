"""What a unit takes on a processor: flash, memory, stack, instructions of each entry; and what is not proven of it.

The instructions are counted by an emulator whose clock goes on with each of them (qemu ``-icount``), over the vectors
of the job. They are instructions, not cycles; of an AVR, whose emulator knows the cycles of each, they are cycles.
"""

import csv
import json
import re
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from detent.errors import DetentError
from detent.export.code import FLAGS, as_json, template
from detent.export.sizes import Sizes, sizes_of
from detent.export.verify import TARGETS, Target, absent, answer, compile_parts, job_for, left_out, link, run_tool
from detent.export.write import MANIFEST, manifest_of
from detent.files.text import write_errors

SHIFT = 10  # an instruction takes 2^10 ns of the emulator's clock
COUNTS = {"cortex": 40 / (1 << SHIFT + 8), "rv32": 1 / (1 << SHIFT), "avr": 1 / (1 << 10)}
"""Instructions in a count: SysTick counts 40 ns in its upper 24 bits, the counter of RISC-V 1 ns; cycles of an AVR."""
LEVELS = ("-Os", "-O2")
CYCLES = 1.5  # of an instruction, as assumed for the share of a tick


@dataclass(frozen=True)
class Entry:
    """What a call of an entry takes."""

    name: str
    calls: int
    mean: float  # instructions
    most: int
    tick: int  # of the call that took most
    stack: int  # deepest as computed from the machine code [byte]
    painted: int  # deepest as measured by painting [byte]
    loops: tuple[str, ...] = ()  # in all that it calls: place and bound


@dataclass(frozen=True)
class Measured:
    """What a unit takes on one processor."""

    target: str
    sizes: Mapping[str, Sizes] = field(default_factory=dict[str, Sizes])  # by level of optimisation
    entries: tuple[Entry, ...] = ()
    share: Mapping[str, float] = field(default_factory=dict[str, float])
    """Part of a tick that `control` takes, mean and most, at the clock that was asked for."""
    missed: str = ""  # why there is nothing
    counts: str = "instructions"  # what the entries count


def measurable() -> list[str]:
    """Names of the processors on which instructions and stack can be counted here."""
    return [one.name for one in TARGETS.values() if one.is_emulated and not one.missing]


def measure(
    folder: str | Path,
    on: Sequence[str] = (),
    clock: float = 0.0,
    progress: Callable[[float, str], None] = lambda _share, _text: None,
) -> list[Measured]:
    """What the unit of an export takes, on each of these processors.

    Parameters
    ----------
    folder : path
        What `export_firmware` wrote.
    on : sequence of str, optional
        Names of emulated processors; others are left out. Default: all that are installed.
    clock : float, optional
        Clock of the processor [Hz], for the share of a tick; 0 for none.
    progress : callable, optional
        ``progress(share, text)``.

    Returns
    -------
    list of Measured
        One for each processor.

    Raises
    ------
    InputError
        The folder is no export.
    """
    place = Path(folder)
    manifest = manifest_of(place)
    out = left_out(place)
    told = [name for name in measurable() if not out.get(name, "").startswith("FW")]
    chosen = [name for name in on or told if name in TARGETS and TARGETS[name].is_emulated]
    found: list[Measured] = []
    for k, name in enumerate(chosen):
        progress(k / len(chosen), f"counting instructions on {name}")
        target = TARGETS[name]
        if name in out:
            found.append(Measured(name, missed=absent(out[name])))
        else:
            found.append(_measured(place, manifest, target, clock))
    return found


def _measured(folder: Path, manifest: Mapping[str, Any], target: Target, clock: float) -> Measured:
    """Compile with the counter, and replay the job."""
    name, source, tools = manifest["name"], folder.resolve(), (target.linker or target.compiler).removesuffix("gcc")
    entries, tables = [*manifest["entries"], f"{name}_selftest_on"], tables_of(folder)
    with tempfile.TemporaryDirectory() as made:
        work, sizes = Path(made), dict[str, Sizes]()
        (work / "count.h").write_text(template("count.h.in", NAME=name.upper()), encoding="ascii")
        job_file, ticks, wanted = job_for(folder, manifest, target, work)
        told = ""
        for level in reversed(LEVELS):  # what is compiled last is run
            unit = f"{target.compiler} {FLAGS} {level} {target.flags} -I{source} -c {source}/{name}.c -o unit.o"
            told = told or run_tool(unit.split(), work)
            told = told or compile_parts(source, name, target, level, work, "-include count.h", job_file)
            told = told or link(work, target, level, "job", ("unit", "replay", "selftest", "board_job"))
            if told:
                return Measured(target.name, missed=f"does not compile: {told}")
            sizes[level] = sizes_of(tools, work, entries, "job", tables, target.back)
        lines = answer(target, work, source, "job", f"-icount shift={SHIFT}").splitlines()
    if f"equal {ticks} {wanted}" not in lines:
        return Measured(target.name, sizes, missed=" ".join(lines[-3:]) or "no answer")
    counted = list(_entries(target, lines, manifest, sizes[LEVELS[0]]))
    is_avr = target.name == "avr"
    share = _share(counted, manifest, clock, 1.0 if is_avr else CYCLES)
    return Measured(target.name, sizes, tuple(counted), share, counts="cycles" if is_avr else "instructions")


def tables_of(folder: Path) -> int:
    """Bytes of the arrays among the parameters."""
    with (folder / "params.csv").open(newline="", encoding="utf-8") as stream:
        rows = [row for row in csv.DictReader(stream) if row["expression"]]
    return sum(int(row["width"][1:]) * int(row["length"]) for row in rows)


def _entries(target: Target, lines: Sequence[str], manifest: Mapping[str, Any], sizes: Sizes) -> Iterator[Entry]:
    """What the replay counted, less what counting takes."""
    words = {line.split()[1]: line.split()[1:] for line in lines if line.startswith("entry ")}
    unit = COUNTS[target.name.partition("-")[0]]
    nothing = int(words["nothing"][3])
    for name, calls, total, most, tick, painted in words.values():
        if name != "nothing":
            count = int(calls)
            yield Entry(
                name, count, round((int(total) - count * nothing) * unit / count, 1),
                round((int(most) - nothing) * unit), int(tick), sizes.stack.get(name, 0), int(painted),
                tuple(manifest["entries"].get(name, {}).get("loops", ())),
            )  # fmt: skip


def _share(
    entries: Sequence[Entry], manifest: Mapping[str, Any], clock: float, cycles: float = CYCLES
) -> dict[str, float]:
    control = next((one for one in entries if one.name.endswith("_control")), None)
    if control is None or clock <= 0.0:
        return {}
    of_tick = cycles / (clock * float(manifest["tick"]))
    return {"mean": control.mean * of_tick, "most": control.most * of_tick}


def note(folder: str | Path, **found: Any) -> None:
    """Write what was measured into the manifest of an export, beside what an earlier call wrote."""
    place = Path(folder) / MANIFEST
    manifest = manifest_of(Path(folder))
    report = dict(manifest.get("report", {}))
    report |= json.loads(as_json({key: value for key, value in found.items() if value}))
    with write_errors(place):
        place.write_text(as_json(manifest | {"report": report}), encoding="utf-8")


def plain(measured: Sequence[Measured]) -> dict[str, Any]:
    """As plain data, by processor."""
    return {one.target: asdict(one) for one in measured if not one.missed}


def clock_of(text: str) -> float:
    """A clock in Hz.

    >>> clock_of("72MHz"), clock_of("32.768 kHz"), clock_of("")
    (72000000.0, 32768.0, 0.0)
    """
    if not text:
        return 0.0
    told = re.fullmatch(r"\s*([0-9.]+)\s*(Hz|kHz|MHz|GHz)\s*", text)
    scale = {"Hz": 1.0, "kHz": 1e3, "MHz": 1e6, "GHz": 1e9}
    try:
        value = float(told[1]) * scale[told[2]] if told else 0.0
    except ValueError:
        value = 0.0
    if value <= 0.0:
        raise DetentError(f"--clock: got {text}; expected: a frequency above 0; try: 72MHz")
    return value


def report_lines(folder: str | Path, measured: Sequence[Measured], clock: str = "") -> Iterator[str]:
    """The report for people."""
    manifest = manifest_of(Path(folder))
    for one in measured:
        yield f"{one.target}{': ' + one.missed if one.missed else ''}"
        for level, s in one.sizes.items():
            yield (
                f"  {level}  flash {s.flash} bytes ({s.code} code, {s.constants} constants), {s.parameters} of "
                f"parameters, {s.tables} of tables, {sum(s.library.values())} of the compiler's library"
            )
        if one.sizes:
            s = one.sizes[LEVELS[0]]
            yield f"  one instance: {s.memory} bytes of RAM, stack {max(s.stack.values(), default=0)} at most"
            routines = ", ".join(f"{name} {size}" for name, size in s.library.items())
            yield f"  library: {routines or 'none'}"
        if one.entries:
            what = "cycles" if one.counts == "cycles" else "instructions (not cycles)"
            yield f"  {what} of a call, over the vectors of the job; stack computed / painted"
        for e in one.entries:
            yield (
                f"    {e.name}: {e.calls} calls, mean {e.mean:g}, most {e.most} in tick {e.tick}; "
                f"stack {e.stack} / {e.painted}"
            )
        if one.share:
            mean, most = (f"{100.0 * one.share[key]:.3g} %" for key in ("mean", "most"))
            assumed = "" if one.counts == "cycles" else f", with {CYCLES} cycles an instruction assumed"
            yield f"  of a tick at {clock}: mean {mean}, most {most}{assumed}"
    loops = sorted({loop for one in manifest["entries"].values() for loop in one["loops"]})
    yield f"loops: {len(loops) or 'none'}"
    yield from (f"  {loop}" for loop in loops)
    if manifest.get("arithmetic") == "single":
        rows = manifest["single to double"]
        yield f"single precision that meets double: {len(rows) or 'nowhere'}"
        yield from (f"  {row}" for row in rows)
    for what, rows in manifest["not proven"].items():
        yield f"not proven: {len(rows)} {what}"
        yield from (f"  {row}" for row in rows)
    yield f"options folded: {_listed(manifest['options'])}; parameters fixed: {_listed(manifest['fixed'])}"


def _listed(values: Mapping[str, Any]) -> str:
    return ", ".join(f"{key} = {value}" for key, value in values.items()) or "none"
