"""`detent docs`: the tables of the reference, made from the declarations in the code whenever they are asked for.

Each function returns one page's tables as Markdown; the built documentation includes the same text.
"""

from collections.abc import Iterator
from typing import Annotated, Any

import typer

from detent.cli.app import Json, app
from detent.cli.terminal import print_json, tell
from detent.errors import DetentError


def table(head: tuple[str, ...], rows: list[tuple[str, ...]]) -> str:
    """Markdown table."""
    lines = [head, tuple("---" for _ in head), *(tuple(map(plain, row)) for row in rows)]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines) + "\n"


def plain(cell: str) -> str:
    """Text of a cell as it stands: a bar would end the cell, and a star outside code would begin emphasis."""
    parts = cell.replace("|", "\\|").split("`")
    return "`".join(part.replace("*", "\\*") if k % 2 == 0 else part for k, part in enumerate(parts))


def code(text: str) -> str:
    """Text as code; nothing stays nothing."""
    return f"`{text}`" if text else ""


STATE = "What changes while the axis runs. `--signals` records any of it but the arrays."
PARAMETERS = "What the axis file decides. It does not change while the axis runs."


def method_heading(method: Any) -> str:
    """Heading of a method's section, with the word the axis file names it by."""
    return f'## {method.title[:1].upper()}{method.title[1:]}\n\n`method = "{method.name}"`\n'


def registers() -> str:
    """State and parameters of the axis of each method."""
    from detent.methods.registry import METHODS

    parts: list[str] = []
    for method in METHODS.values():
        parts.append(method_heading(method))
        for title, what, declared in (
            ("State", STATE, method.registers()),
            ("Parameters", PARAMETERS, method.parameters()),
        ):
            rows = [
                (
                    code(leaf.path),
                    leaf.width.code + (f" x {leaf.length}" if leaf.length else ""),
                    leaf.unit,
                    leaf.doc + (f"; written by the {leaf.by}" if leaf.by else ""),
                )
                for leaf in declared.leaves()
            ]
            parts.append(f"### {title}\n\n{what} Class `{declared.__name__}`.\n")
            parts.append(table(("register", "width", "unit", "meaning"), rows))
    return "\n".join(parts)


def axis_file() -> str:
    """Every key of the axis file, one section per method, in it one per table."""
    from detent.methods.registry import METHODS

    return "\n".join(f"{method_heading(method)}\n{keys_of(method)}" for method in METHODS.values())


def keys_of(method: Any) -> str:
    """Every key of a method's axis file, one section per table, those that only an axis that turns has at the end."""
    from detent.files.keys import key_rows, own_rows

    text = _sections(method.spec, key_rows(method.spec))
    if method.rotary and (rows := own_rows(method.rotary, method.spec)):
        text += "\n" + _sections(method.rotary, rows, ' with `motion = "rotary"`')
    return text


def _sections(model: Any, keys: Any, where: str = "") -> str:
    """Some keys of a model, one section per table."""
    sections: dict[str, list[tuple[str, ...]]] = {}
    for row in keys:
        place, _, key = row.key.rpartition(".")
        default = f"must be stated, such as {code(row.example)}" if row.required else row.default or "none"
        sections.setdefault(place, []).append((code(key), default, row.allowed, row.unit, row.doc))
    docs = dict(_tables(model))
    head = ("key", "default", "allowed", "SI unit inside", "meaning")
    return "\n".join(
        f"### `[{place}]`{where}\n\n{docs[place]}\n\n{table(head, rows)}" for place, rows in sections.items()
    )


def _tables(model: Any, prefix: str = "") -> Iterator[tuple[str, str]]:
    """Dotted name and first sentence of every table of the schema; a placeholder stands for a name of the user's."""
    from detent.files.fields import extra_of, file_key, is_named, table_of

    for name, field in model.model_fields.items():
        below = table_of(field)
        if below is not None:
            path = prefix + file_key(name, field)
            if is_named(field):
                path = f"{path}.{extra_of(field, 'name')}"
            yield path, (below.__doc__ or "").splitlines()[0]
            yield from _tables(below, path + ".")


def commands() -> dict[str, Any]:
    """The commands as the command line knows them, those of a group by both their words."""
    group: Any = typer.main.get_command(app)
    found: dict[str, Any] = {}
    for name, command in group.commands.items():
        inner = getattr(command, "commands", None)
        found |= {f"{name} {one}": two for one, two in inner.items()} if inner else {name: command}
    return found


def parameter_row(parameter: Any) -> tuple[str, str, str]:
    """Name, default and meaning of an argument or an option."""
    is_argument = parameter.param_type_name == "argument"
    name = parameter.name.upper() if is_argument else ", ".join(parameter.opts)
    if not is_argument and not parameter.is_flag:
        name += f" {parameter.metavar or parameter.name.upper()}"
    default = "must be given" if parameter.required else ""
    if not parameter.required and parameter.default not in (None, False):
        default = code(str(parameter.default))
    return code(name), default, parameter.help or ""


def command_line() -> str:
    """Every command with its arguments and options."""
    parts: list[str] = []
    for name, command in commands().items():
        needed = [parameter_row(p)[0].strip("`") for p in command.params if p.required]
        usage = " ".join(["detent", name, *needed, "[OPTIONS]"])
        rows = table(("", "default", "meaning"), [parameter_row(p) for p in command.params])
        parts.append(f"## {name}\n\n```text\n{usage}\n```\n\n{command.help}\n\n{rows}")
    return "\n".join(parts)


PRINT_HEAD_STATUS = """## Print head: status byte SB1

The axis computer answers every command with one status byte, SB1. `00` means done; each bit that is set means one
thing. During a command of several bytes `FF` means: byte accepted, send the next.
"""
SERVO_FAULTS = """## Filtered servo: faults

The cause stands in the register `deviation.cause`. A phase servo knows no faults: it settles, or it is never ready.
"""
TABLE_REFUSALS = """## Rotary table: refused starts

The register `controller.positioner.refused` counts starts that were not taken, `controller.positioner.reason` says why
the last was not.
"""
STEP_FAULTS = """## Stepper envelope: faults

The cause stands in the register `controller.rule.cause` of the motor. `controller.rule.reset`, once the motor stands,
leaves the fault.
"""


def status_codes() -> str:
    """Bits of the status byte SB1, and the numbers in the registers that say why something was not done."""
    from detent.errors import SB1_TEXT, SERVO_FAULT_TEXT, STEP_FAULT_TEXT, TABLE_REFUSAL_TEXT

    head = "what happened; what to do"
    bits = [(code("00"), "done")] + [(code(f"{bit:02X}"), text) for bit, text in SB1_TEXT.items()]
    parts = [f"{PRINT_HEAD_STATUS}\n{table(('bit', head), bits)}"]
    for heading, number, texts in (
        (SERVO_FAULTS, "cause", SERVO_FAULT_TEXT),
        (TABLE_REFUSALS, "reason", TABLE_REFUSAL_TEXT),
        (STEP_FAULTS, "cause", STEP_FAULT_TEXT),
    ):
        rows = [(code(str(value)), text) for value, text in texts.items()]
        parts.append(f"{heading}\n{table((number, head), rows)}")
    return "\n".join(parts)


DC_COLUMNS = (
    "nominal_voltage",
    "torque_constant",
    "resistance",
    "inductance",
    "rotor_inertia",
    "max_current",
)
STEPPER_COLUMNS = (
    "frame",
    "steps_per_turn",
    "holding_torque",
    "rotor_inertia",
    "resistance",
    "inductance",
    "rated_current",
    "detent_torque",
)


def motors() -> str:
    """The motors of the catalogues with the source of their constants."""
    from detent.axisfile.catalogue import DC_MOTORS, STEPPER_MOTORS

    parts = [
        motor_section("Brush DC motors", DC_MOTORS.entries(), DC_COLUMNS),
        motor_section("Stepper motors", STEPPER_MOTORS.entries(), STEPPER_COLUMNS),
    ]
    return "\n".join(parts)


def motor_section(title: str, entries: dict[str, dict[str, Any]], columns: tuple[str, ...]) -> str:
    """Constants of one catalogue's motors, then where each comes from."""
    head = ("name", *(column.replace("_", " ") for column in columns))
    constants = [(code(name), *(str(entry.get(key, "")) for key in columns)) for name, entry in entries.items()]
    sources = [(code(name), entry["source"]) for name, entry in entries.items()]
    return (
        f"## {title}\n\n{table(head, constants)}\n"
        f"### Where the constants of {title[0].lower()}{title[1:]} come from\n\n{table(('name', 'source'), sources)}"
    )


PAGES = {
    "registers": registers,
    "axis-file": axis_file,
    "command-line": command_line,
    "status-codes": status_codes,
    "motors": motors,
}


ABOUT = "The page. Default: a list of them."


@app.command("docs")
def docs_command(page: Annotated[str, typer.Argument(help=ABOUT)] = "", *, as_json: Json = False) -> None:
    """Print a page of the reference as Markdown: keys, registers, commands, status codes, motors."""
    if page and page not in PAGES:
        from detent.files.text import did_you_mean

        remedy = did_you_mean(page, PAGES, "name one of these")
        raise DetentError(f"docs: got {page!r}; expected: {', '.join(PAGES)}; {remedy}")
    texts = {name: make() for name, make in PAGES.items() if page in {name, ""}}
    if as_json:
        print_json([{"page": name, "markdown": text} for name, text in texts.items()])
    elif page:
        tell(texts[page])
    else:
        for name, text in texts.items():
            tell(f"{name:<14} {text.count(chr(10))} lines: detent docs {name}")
