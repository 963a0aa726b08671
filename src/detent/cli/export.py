"""`detent export` and `detent verify`: an axis as firmware, and the proof that it is the one that was simulated."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any

import typer

from detent.cli.app import NOT_DONE, File, Force, Job, Json, Set, Verbs, app, option
from detent.cli.terminal import print_json, progress_bar, say, split_names, tell
from detent.errors import DetentError

OUTPUT = "Folder for the export: a new one, an empty one, or that of an earlier export."
MOTOR = "Which motor, of a file that has several."
PREFIX = "Prefix of all names in C. Default: from the name of the motor or the axis."
TARGET = "What it is for: host, cortex-m0, cortex-m4, cortex-m4f, cortex-m7, rv32 or avr. The C is the same for all."
TICKS = "Ticks of the golden run at most."
FILES = "Random register files that each function is called on."
ROUNDS = "Ticks in which the host does anything and the lines show anything."
TUNABLE = "Options that stay parameters, comma-separated, * for any text. Default: options become constants."
FIXED = "Parameters that become constants of the code, comma-separated, * for any text."
CLOCK = "Clock of a processor, for the share of a tick that the controller takes: 72MHz."
PRINT = "Show a file of vectors as text: vectors/job.vec, vectors/drawn.vec. Nothing is compiled."
ON = (
    "Where to replay, comma-separated: host-gcc, host-clang, cortex-m0, cortex-m4, cortex-m4f, cortex-m7, rv32, avr. "
    "Default: all there."
)
MUTANTS = "Change one thing of the C at so many places, one at a time, and tell which changes no vector finds."
BAR = "Tell what the vectors do not reach; fail where they take fewer of the branch outcomes [%]."
EXPORTED = "What `detent export firmware` wrote."
Folder = Annotated[Path, typer.Argument(help=EXPORTED, show_default=False)]
AGAINST = "Axis file: make the export anew, with --job as then, and compare."


ELF = "The application: linked, with debug information."
VARIABLES = "Its variables of parameters, controller and lines, comma-separated. Default: NAME_p, NAME_c and NAME_l."
DESCRIPTION = "Default: the name of the application with the ending .a2l"

export = typer.Typer(cls=Verbs, no_args_is_help=True, rich_markup_mode=None)
app.add_typer(export, name="export", help="Write an axis as firmware; fill in the addresses of a linked program.")


@export.command()
def firmware(
    file: File,
    output: Annotated[Path, option("--output -o", "FOLDER", OUTPUT)],
    job: Job = None,
    motor: Annotated[str, option("--axis", "NAME", MOTOR)] = "",
    prefix: Annotated[str, option("--prefix", "NAME", PREFIX)] = "",
    target: Annotated[str, option("--target", "NAME", TARGET)] = "host",
    ticks: Annotated[int, option("--ticks", "NUMBER", TICKS)] = 1_000_000,
    files: Annotated[int, option("--files", "NUMBER", FILES)] = 1000,
    rounds: Annotated[int, option("--rounds", "NUMBER", ROUNDS)] = 1_000_000,
    tunable: Annotated[list[str] | None, option("--tunable", "PATTERNS", TUNABLE)] = None,
    fixed: Annotated[list[str] | None, option("--fixed", "PATTERNS", FIXED)] = None,
    overrides: Set = None,
    *,
    as_json: Json = False,
) -> None:
    """Write the controller of an axis as C99, with golden vectors of a simulated job.

    Exit status: 0 written, 1 refused (FW01 to FW15: why, and what to do), 2 wrong input.
    """
    from detent.axis import load
    from detent.errors import InputError
    from detent.export.write import export_firmware
    from detent.translate.values import RefusedError

    try:
        axis = load(file, overrides or [])
    except InputError as error:
        got, remedy = f"an axis that fails detent check\n{error}", "what these findings say"
        raise RefusedError("FW11", None, got, "one without findings", remedy) from error
    with progress_bar(quiet=as_json) as progress:
        progress(0.1, "simulating the job, translating the controller")
        made = export_firmware(
            axis, output, job=job, motor=motor, prefix=prefix, target=target, ticks=ticks, files=files, rounds=rounds,
            tunable=split_names(tunable), fixed=split_names(fixed),
        )  # fmt: skip
    found: dict[str, Any] = dict(made.manifest)
    if as_json:
        print_json(found | {"folder": str(made.folder)})
        return
    unproven = found["not proven"]
    say(f"{axis.name}: {found['functions']} functions in {made.folder / made.name}.c", "bold green")
    tell(f"golden run: {found['job']}, {found['ticks']} ticks, hash {found['hash']}")
    tell(f"random vectors: {files} register files for each function, {rounds} ticks of misuse")
    for what in ("options", "fixed"):
        told = ", ".join(f"{key} = {value}" for key, value in found[what].items()) or "none"
        tell(f"{'options folded' if what == 'options' else 'parameters fixed'}: {told}")
    for what, rows in unproven.items():
        grown = len(rows) > made.unproven.get(what, len(rows))
        before = f", {made.unproven[what]} before: more than in the earlier export" if grown else ""
        tell(f"not proven: {len(rows)} {what}{before}; see manifest.json")
    tell(f"next: detent verify {made.folder}")


@export.command()
def addresses(
    folder: Folder,
    elf: Annotated[Path, option("--elf", "FILE", ELF, show_default=False)],
    variables: Annotated[list[str] | None, option("--variables", "NAMES", VARIABLES)] = None,
    output: Annotated[Path | None, option("--output -o", "FILE", DESCRIPTION)] = None,
    *,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Write the description of an export for calibration tools (A2L), with the addresses of a linked program.

    Exit status: 0 written, 2 wrong input: no export, or a program that was not made with it.
    """
    from detent.export.linked import fill_addresses

    place = output or elf.with_suffix(".a2l")
    found = fill_addresses(folder, elf, place, split_names(variables), force=force)
    if as_json:
        print_json({"file": str(place), "addresses": found})
    else:
        say(f"{len(found)} addresses in {place}", "bold green")


@app.command()
def verify(
    folder: Annotated[Path | None, typer.Argument(help=EXPORTED, show_default=False)] = None,
    on: Annotated[list[str] | None, option("--on", "NAMES", ON)] = None,
    against: Annotated[Path | None, option("--against", "FILE", AGAINST)] = None,
    mutants: Annotated[int, option("--mutants", "NUMBER", MUTANTS)] = 0,
    coverage_bar: Annotated[float | None, option("--coverage-bar", "PERCENT", BAR)] = None,
    clock: Annotated[str, option("--clock", "FREQUENCY", CLOCK)] = "",
    printed: Annotated[Path | None, option("--print", "FILE", PRINT)] = None,
    job: Job = None,
    overrides: Set = None,
    *,
    as_json: Json = False,
) -> None:
    """Compile an export, replay its vectors here and on emulated processors, and compare all registers every tick.

    Exit status: 0 all equal, 1 something differs, a bar is missed or a tool is not installed, 2 wrong input.
    """
    from detent.axis import load
    from detent.export import measure as measuring
    from detent.export import misra, teeth
    from detent.export import verify as proving
    from detent.export.show import shown
    from detent.export.write import manifest_of

    if printed is not None:
        for line in shown(printed):
            tell(line)
        return
    if folder is None:
        raise DetentError("got no FOLDER; expected: an export; try: detent verify firmware, or --print FILE")
    chosen, frequency = split_names(on), measuring.clock_of(clock)
    with progress_bar(quiet=as_json) as progress:
        axis = load(against, overrides or []) if against is not None else None
        other = list(proving.differences(folder, axis, job)) if axis is not None else []
        found = _Found(
            proving.verify(folder, chosen, progress), other,
            measuring.measure(folder, chosen, frequency, progress),
            teeth.reach(folder) if coverage_bar is not None else None, coverage_bar or 0.0,
            teeth.mutants(folder, mutants, progress) if mutants else [],
            {} if on else proving.left_out(folder) | ({misra.TOOL: misra.missing()} if misra.missing() else {}),
            [] if on or misra.missing() else misra.findings(folder, manifest_of(folder)["name"]),
        )  # fmt: skip
    measuring.note(folder, **found.kept(), clock=clock)
    if as_json:
        print_json(found.plain())
    else:
        for line in measuring.report_lines(folder, found.measured, clock):
            tell(line)
        found.tell()
    if not found.done:
        raise typer.Exit(NOT_DONE)


@dataclass(frozen=True)
class _Found:
    """What a verification found."""

    proofs: list[Any]
    differences: list[str]
    measured: list[Any]
    reach: Any
    bar: float  # of branch outcomes [%]
    mutants: list[Any]
    left_out: dict[str, str]
    broken: list[Any]  # rules of MISRA C

    @property
    def done(self) -> bool:
        """True where all was run and equal, and no bar is missed."""
        equal = bool(self.proofs) and all(one.equal for one in self.proofs) and not self.differences
        kept = all(one.is_deviation for one in self.broken)
        return equal and kept and (self.reach is None or self.reach.share >= self.bar)

    @property
    def reached(self) -> dict[str, Any] | None:
        """The reach as plain data."""
        return asdict(self.reach) | {"share": self.reach.share} if self.reach else None

    def kept(self) -> dict[str, Any]:
        """What the manifest keeps."""
        from detent.export.measure import plain
        from detent.export.misra import tallied

        hits = {"found": sum(bool(one.found) for one in self.mutants), "of": len(self.mutants)}
        kept = {"measured": plain(self.measured), "coverage": self.reached, "mutants": hits if self.mutants else None}
        return kept | {"misra": tallied(self.broken)}

    def plain(self) -> dict[str, Any]:
        """All of it as plain data."""
        rows = {"equal": self.done, "proofs": [asdict(p) for p in self.proofs], "differences": self.differences}
        rows |= {"not run": self.left_out, "reach": self.reached, "mutants": [asdict(m) for m in self.mutants]}
        kept = self.kept()
        return rows | {"measured": kept["measured"], "misra": kept["misra"]}

    def tell(self) -> None:
        """Say it, the verdict last."""
        from detent.export.misra import DEVIATIONS

        if self.reach is not None:
            share = self.reach.share
            say(f"branch outcomes taken: {share:.1f} % of {self.reach.outcomes}", wrong=share < self.bar)
            for one in self.reach.missed:
                tell(f"  line {one.line}, way {one.way} never taken: {one.text}")
        if self.mutants:
            tell(f"mutants found: {sum(bool(one.found) for one in self.mutants)} of {len(self.mutants)}")
            for one in (one for one in self.mutants if not one.found):
                tell(f"  line {one.line}, {one.becomes} not found: {one.text}")
        for one in self.proofs:
            said = f"equal, hash {one.told}" if one.equal else one.told
            say(f"{one.target:<11} {one.level.split()[0] if one.level else '':<4} {said}", wrong=not one.equal)
        for text in self.differences:
            say(text, wrong=True)
        for one in (one for one in self.broken if not one.is_deviation):
            say(f"{one.file}:{one.line} breaks rule {one.rule} of MISRA C:2012", wrong=True)
        for rule, count in self.kept()["misra"].items():
            tell(f"MISRA C:2012, rule {rule}: {count} times; {DEVIATIONS.get(rule, 'not to be broken')}")
        for name, tools in self.left_out.items():
            tell(f"{name:<11} not run: {'' if tools.startswith('FW') else 'needs '}{tools}")
        if not self.proofs:
            say("nothing was run: no compiler is installed", wrong=True)
