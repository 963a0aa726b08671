"""The command `detent`: its verbs register themselves here, and its errors become one message and an exit status."""

import io
import sys
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any, NoReturn, cast

import typer
from typer.core import TyperCommand, TyperGroup

from detent import __version__
from detent.cli.terminal import be_quiet, discard_output, print_json, say_compiling
from detent.errors import DetentError
from detent.files.text import shown
from detent.kernel.cache import AT_FIRST_COMPILING

DONE, NOT_DONE = 0, 1
UsageError: Any = typer.BadParameter.__base__  # typer brings a click of its own, or uses the one that is installed
QUIET = "Print only warnings and errors, and the output of --json: `detent -q run ...`"
LOGS = "(.csv, .h5, .parquet, .mat, .npz, .jsonl)"  # recordings that can be read


class Verbs(TyperGroup):
    """Verbs, each of which the help tells with its whole first sentence."""

    def format_commands(self, ctx: Any, formatter: Any) -> None:  # noqa: ARG002 - click hands it over
        """The list of verbs."""
        rows = [(name, verb.get_short_help_str(limit=1000)) for name, verb in self.commands.items()]
        with formatter.section("Commands"):
            formatter.write_dl(rows)


class Commands(Verbs):
    """The verbs. Errors that detent raises on purpose become one message and an exit status, never a traceback."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Note whether the answer is for a program: its problems then are, too."""
        ctx.meta["json"] = "--json" in args
        return super().parse_args(ctx, args)

    def invoke(self, ctx: Any) -> Any:
        """Run the verb."""
        status = DONE
        try:
            try:
                super().invoke(ctx)
            except DetentError as error:
                status = error.exit_status
                _tell_problem(error, as_json=ctx.meta["json"])
            except UsageError as error:
                if not ctx.meta["json"]:
                    raise
                status = error.exit_code
                _tell_problem(DetentError(error.format_message()), as_json=True)
            except typer.Exit as left:
                status = left.exit_code
            sys.stdout.flush()
        except BrokenPipeError:
            discard_output()
        except OSError as error:
            discard_output()
            place = shown(str(error.filename or "standard output"))
            sys.stderr.write(f"{place}: cannot be written ({error.strerror}); choose another place or make room\n")
            status = NOT_DONE
        raise typer.Exit(status)

    def main(self, *args: Any, **more: Any) -> NoReturn:
        """As click has it, but that no word of the command line steers the terminal that it is shown on."""
        try:
            status = super().main(*args, **more | {"standalone_mode": False})
        except UsageError as error:
            told = io.StringIO()
            error.show(told)
            sys.stderr.write(shown(told.getvalue()))
            status = error.exit_code
        sys.exit(status)


def _tell_problem(error: DetentError, *, as_json: bool) -> None:
    """What is wrong, as sentences, or for a program as data on the standard output."""
    if as_json:
        problems = [asdict(problem) for problem in getattr(error, "problems", ())]
        print_json({"error": str(error), "exit_status": error.exit_status, "problems": problems})
    else:
        sys.stderr.write(f"{shown(str(error))}\n")


class ListsMethods(TyperCommand):
    """A verb whose help ends in what each installed method takes as a job, and how fast it ticks."""

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Add the methods, which load only here."""
        from detent.methods.registry import METHODS

        told = [f"{m.name}: {m.jobs}; {m.pace}." for m in METHODS.usable()]
        refused = [shown(f"Warning: {text}.") for text in METHODS.refused]
        self.epilog = " ".join(["Jobs and base ticks:", *told, *refused])
        super().format_help(ctx, formatter)


app = typer.Typer(
    name="detent",
    cls=Commands,
    help="Positioning control as software: describe an axis in one file, check it, run a job on it.",
    epilog="Exit status: 0 done, 1 the axis did not do it (the reason is shown), 2 wrong input. 130 Ctrl-C, "
    "143 `kill`: no file is left incomplete.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,  # its imports take longer than the help
    context_settings={"help_option_names": ["-h", "--help"]},
)


def option(names: str, metavar: str, about: str, **more: Any) -> Any:
    """An option: its names with spaces between them, what stands for its value in the help, and what it does."""
    return typer.Option(*names.split(), metavar=metavar or None, help=about, **more)


File = Annotated[Path, typer.Argument(help="Axis file (TOML).", show_default=False)]
Set = Annotated[list[str] | None, option("--set", "KEY=VALUE", "Replace or add a value of the file; repeat for more.")]
Json = Annotated[bool, option("--json", "", "Print machine-readable JSON instead of text.")]
Force = Annotated[bool, option("--force", "", "Replace files that detent did not write, or that were edited since.")]
Job = Annotated[
    Path | None, option("--job", "", "The job: a file of a kind that the axis's method accepts, see below.")
]
Mapping = Annotated[Path | None, option("--map", "FILE", "Mapping file (TOML) for the columns of a recording.")]
COLUMNS = (
    "Assign a column of a recording, as in 'force=vir [35.15 N]'; repeat for more. Roles: time, position, reference, "
    "velocity, force, torque, current, voltage, command, position_load; columns not assigned are guessed, and "
    "the guesses are reported."
)
Columns = Annotated[list[str] | None, option("--column", "ROLE=COLUMN", COLUMNS)]


def unknown_method(verb: str, word: str, also: str = "") -> DetentError:
    """What to say where neither a method nor what else would do was named."""
    from detent.files.text import did_you_mean
    from detent.methods.registry import METHODS

    remedy = did_you_mean(word.replace("-", "_").replace(" ", "_"), METHODS, "name one of these")
    return DetentError(f"{verb}: got {word!r}; expected: {', '.join(METHODS)}{also and f', or {also}'}; {remedy}")


def main() -> NoReturn:
    """Entry point."""
    for stream in (sys.stdout, sys.stderr):
        # A file name may hold bytes, and a letter signs, that the terminal's encoding does not know.
        with suppress(AttributeError):
            cast("Any", stream).reconfigure(errors="backslashreplace")
    AT_FIRST_COMPILING[:] = [say_compiling]
    app()
    raise SystemExit(DONE)


def _version(wanted: bool) -> None:
    if wanted:
        print(f"detent {__version__}")
        raise typer.Exit


@app.callback()
def common(
    version: Annotated[
        bool, option("--version -V", "", "Print the version.", callback=_version, is_eager=True)
    ] = False,
    quiet: Annotated[bool, option("--quiet -q", "", QUIET)] = False,
) -> None:
    """Options before the verb."""
    del version  # its callback has told it
    be_quiet(quiet)
