"""The files of an export, as texts: header, code, parameters, replay, and the tables that say what stands where."""

import csv
import hashlib
import io
import json
import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from importlib import resources
from typing import Any

from jinja2 import Environment, StrictUndefined

from detent import __version__
from detent.export.drawn import FAR, PLACES, SEED, Chance, Row, drawn_from
from detent.export.selftest import CALLS, self_test
from detent.export.unit import LARGE, WIDTHS, ControlUnit, arguments, every, members
from detent.export.vectors import Golden
from detent.kernel.registers import Field, Leaf, Registers, Width
from detent.translate.program import Function, Program
from detent.translate.text import FLASH_INCLUDE, code_text, comment_of, signals_text, struct_texts
from detent.translate.values import Value, as_single_number, c_field, interval_of, number, type_of_local, unsigned

FLAGS = "-std=c99 -ffp-contract=off"
PROCESSORS = {
    "host": "", "cortex-m0": "-mthumb -mcpu=cortex-m0", "cortex-m4": "-mthumb -mcpu=cortex-m4",
    "cortex-m4f": "-mthumb -mcpu=cortex-m4 -mfpu=fpv4-sp-d16 -mfloat-abi=hard",
    "cortex-m7": "-mthumb -mcpu=cortex-m7 -mfpu=fpv5-d16 -mfloat-abi=hard", "rv32": "-march=rv32imac -mabi=ilp32",
    "avr": "-mmcu=atmega2560",
}  # fmt: skip
"""What an export can be for, and what its compiler must be told; the C is the same for all."""
WARNINGS = (
    "-Wall -Wextra -Wpedantic -Wconversion -Wsign-conversion -Wshadow -Wundef -Wcast-qual -Wstrict-prototypes "
    "-Wmissing-prototypes -Wdouble-promotion -Wswitch-default -Wimplicit-fallthrough"
)


@dataclass(frozen=True)
class InC:
    """One register as the code in C sees it."""

    place: str
    bits: str  # of its value, as an unsigned number of 64 bits
    ctype: str
    unsigned: str
    bytes: int
    length: int
    float: bool


def template(file: str, package: Any = "detent.export", **given: Any) -> str:
    """One file of the export from its template in a package."""
    environment = Environment(  # noqa: S701 - C, no HTML
        undefined=StrictUndefined, keep_trailing_newline=True, trim_blocks=True, lstrip_blocks=True
    )
    environment.filters["comment"] = comment_of
    environment.filters["quoted"] = _quoted
    environment.filters["number"] = _number
    text = resources.files(package).joinpath(file).read_text(encoding="utf-8")
    return environment.from_string(text).render(**given)


def _number(value: Any) -> str:
    """A number of C."""
    return number(value).text


def _quoted(text: str) -> str:
    """Text between quotation marks of ASAP2, on one line."""
    return " ".join(text.replace("\\", "\\\\").replace('"', '\\"').split())


def place_of(path: str, controller: str = "", lines: str = "", parameters: str = "") -> str:
    """A leaf of controller, lines or parameters in C."""
    root, *parts = path.split(".")
    return {"c": controller, "l": lines, "p": parameters}[root] + ".".join(c_field(part) for part in parts)


def in_c(unit: ControlUnit, leaf: Leaf, controller: str, lines: str) -> InC:
    """A leaf as C sees it."""
    place = place_of(leaf.path, controller, lines) + ("[k]" if leaf.length else "")
    unsigned = f"uint{8 * leaf.width.size}_t"
    bits = f"{unit.name}_bits_{leaf.width.code}({place})" if leaf.width.is_float else f"(uint64_t)({unsigned}){place}"
    return InC(place, bits, leaf.width.c_name, unsigned, leaf.width.size, leaf.length, leaf.width.is_float)


def short_hash(*parts: bytes) -> str:
    """First 64 bits of a hash, as hexadecimal digits."""
    return hashlib.sha256(b"\0".join(parts)).hexdigest()[:16].upper()


@dataclass(frozen=True)
class Parameter:
    """A row of params.csv."""

    number: int
    name: str
    expression: str  # empty where it is no part of the structure
    width: str
    length: int
    unit: str
    range: str
    default: str
    tunable: str  # yes where it can be changed at run time, else why not
    meaning: str


def parameters(program: Program, params: Registers) -> Iterator[Parameter]:
    """Every parameter, in the order of declaration."""
    for count, (prefix, registers, field, width) in enumerate(_fields(program, params, "")):
        place = (type(registers), field.name)
        folded, word = place in program.options, "an option" if field.option else "by --fixed"
        is_table = place in program.shape.tables
        value = getattr(registers, field.name)
        default = f"{field.length} values" if field.length else repr(value)
        yield Parameter(
            count, prefix + field.name,
            "" if folded or is_table else place_of(f"p.{prefix}{field.name}", parameters="p->"),
            width.code, field.length, field.unit, range_text(field.range), default,
            f"{word}, folded into the code" if folded else "a table among the constants" if is_table else "yes",
            field.doc,
        )  # fmt: skip


def range_text(claimed: tuple[float, float] | None) -> str:
    """A range as the tables tell it; empty where none is claimed."""
    return "" if claimed is None else f"{claimed[0]} to {claimed[1]}"


def _fields(program: Program, registers: Registers, prefix: str) -> Iterator[tuple[str, Registers, Field, Width]]:
    for declared, value in members(registers):
        field = program.shape.seen(type(registers), declared)
        if field.block is not None:
            yield from _fields(program, value, f"{prefix}{field.name}.")
        elif field.width is not None:
            yield prefix, registers, field, field.width


def table(rows: Iterable[Any]) -> str:
    """Rows of one dataclass as CSV."""
    made = io.StringIO()
    listed = [asdict(one) for one in rows]
    writer = csv.DictWriter(made, list(listed[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(listed)
    return made.getvalue()


@dataclass(frozen=True)
class Register:
    """A row of registers.csv."""

    number: int
    name: str
    expression: str
    width: str
    length: int
    unit: str
    range: str
    written_by: str
    meaning: str


def registers(unit: ControlUnit) -> Iterator[Register]:
    """Every register of the state by its number."""
    for count, leaf in enumerate(unit.leaves):
        expression = place_of(leaf.path, "c->", "l->")
        name = ("controller" if leaf.path[0] == "c" else "lines") + leaf.path[1:]
        claimed = range_text(leaf.range)
        yield Register(count, name, expression, leaf.width.code, leaf.length, leaf.unit, claimed, leaf.by, leaf.doc)


@dataclass(frozen=True)
class Traced:
    """A row of trace.csv: a function in C, and the step that it is."""

    function: str
    line: int
    file: str
    python_line: int
    step: str
    hash: str


def traced(program: Program, code: str) -> Iterator[Traced]:
    """Every function that is a step, with its line in the code."""
    lines = code.splitlines()
    for f in program.order:
        head = program.signature(f)
        file, _, line = f.place.rpartition(":")
        yield Traced(f.cname, lines.index(head) + 1, file, int(line), f.py.__qualname__, short_hash(f.source.encode()))


def _initialiser(program: Program, registers: Registers, depth: int = 1) -> str:
    rows: list[str] = []
    for field in program.fields(type(registers)):
        value = getattr(registers, field.name)
        if field.block is not None:
            text = _initialiser(program, value, depth + 1)
        elif field.length:
            text = "{" + ", ".join(number(one).text for one in value[: field.length]) + "}"
        else:
            text = number(value).text
        unit = f" /* {field.unit} */" if field.unit and field.block is None else ""
        rows.append(f"{'    ' * depth}.{c_field(field.name)} = {text},{unit}\n")
    return "{\n" + "".join(rows) + "    " * (depth - 1) + "}"


def range_checks(program: Program, params: Registers) -> Iterator[dict[str, Any]]:
    """Conditions of the parameters with a range, for each element of an array; what a width cannot hold needs none."""
    for row, (_, _, field, width) in zip(parameters(program, params), _fields(program, params, ""), strict=True):
        if field.range is None or not row.expression:
            continue
        place, (lo, hi) = row.expression + ("[k]" if row.length else ""), field.range
        least, most = (-math.inf, math.inf) if width.is_float else interval_of(width)
        ends = [as_single_number(lo), as_single_number(hi)] if width.code == "f4" else [number(lo), number(hi)]
        if not width.is_float and not width.is_signed:
            ends = [unsigned(one) for one in ends]
        parts = [f"({place} >= {ends[0].text})"] if lo > least else []
        parts += [f"({place} <= {ends[1].text})"] if hi < most else []
        if parts:
            yield {"text": " && ".join(parts), "number": row.number + 1, "length": row.length}


def texts(  # noqa: PLR0913 - what the files tell of
    unit: ControlUnit, program: Program, golden: Golden, about: str, tick: str, target: str
) -> dict[str, str]:
    """All texts of an export by the names of their files, but for what tells of these files."""
    name, params = unit.name, golden.params
    source_hash = short_hash(*(f.source.encode() for f in program.order))
    leaves = [in_c(unit, leaf, "c_.", "l_.") for leaf in unit.leaves]
    images = {
        kind: [in_c(unit, leaf, "c->", "l->") for leaf in unit.leaves if (leaf.length > LARGE) == large]
        for kind, large in (("image", False), ("large", True))
    }
    code = code_text(program)
    floats = sorted({leaf.ctype for leaf in leaves if leaf.float})
    signals = [
        {"code": value.width.code, "ctype": value.width.c_name, "bytes": value.width.size, "most": golden.signals[k][0]}
        for k, value in enumerate(signals_of(unit, program))
        if value.width is not None
    ]
    calls = [
        {"name": one, "takes": taken, "texts": list(_arguments(taken))}
        for one, codes in unit.calls.items()
        for taken in [[WIDTHS.get(code, code) for code in codes]]
    ]
    given = {
        "name": name, "NAME": name.upper(), "begins": unit.begins, "version": __version__,
        "about": about, "tick": tick, "large": LARGE,
        "source_hash": source_hash, "layout_hash": f"{unit.layout_hash:08X}",
        "axis_hash": short_hash(bytes(unit.as_stated(params))),
        "structs": struct_texts(program, (unit.params, unit.controller, unit.lines)), "signals": signals_text(program),
        "flash": FLASH_INCLUDE if f"#define {name.upper()}_FLASH" in signals_text(program) else "",
        "prototypes": "".join(_prototype(program, f) for f in program.steps.values() if f.entry),
        "code": code, "checks": list(range_checks(program, params)), "floats": floats, "images": list(images.items()),
        "tested": CALLS,
    }  # fmt: skip
    made = {f"{name}.h": template("unit.h.in", **given), f"{name}.c": template("unit.c.in", **given)}
    if program.shape.tables:
        values = {one: getattr(registers, field.name)[: one.length] for _, registers, field, _ in every(params)
                  for one in [program.shape.tables.get((type(registers), field.name))] if one}  # fmt: skip
        made[f"{name}_tables.c"] = template("tables.c.in", name=name, NAME=name.upper(), tables=list(values.items()))
    made[f"{name}_image.c"] = template("image.c.in", **given)
    made[f"{name}_selftest.c"] = _selftest_text(unit, params, given)
    initialiser = _initialiser(program, params)
    text = template("params.c.in", name=name, initialiser=initialiser)
    made[f"{name}_params.c"] = f"#include <math.h>\n{text}" if "INFINITY" in initialiser else text
    replay = given | {
        "exchanged": [
            {"number": row.number, "length": row.length, "float": width.is_float, "ctype": width.c_name,
             "place": row.expression + ("[k]" if row.length else "")}
            for row, (_, _, _, width) in zip(parameters(program, params), _fields(program, params, ""), strict=True)
            if row.number in golden.changed
        ],
        "signals": signals, "leaves": leaves, "calls": calls,
        "call_floats": any("f8" in codes for codes in unit.calls.values()),
        "most_numbers": max(1, *(sum(not isinstance(code, str) for code in one["takes"]) for one in calls)),
    }  # fmt: skip
    made[f"{name}_replay.c"] = template("replay.c.in", **replay)
    made["board.c"] = template("board.c.in", name=name)
    made["params.csv"] = table(parameters(program, params))
    made["registers.csv"] = table(registers(unit))
    made["trace.csv"] = table(traced(program, made[f"{name}.c"]))
    parts = ("", "_params", "_tables", "_selftest")
    sources = [f"{name}{part}.c" for part in parts if f"{name}{part}.c" in made]
    flags = f"{FLAGS} {PROCESSORS[target]}".strip()
    made["build.mk"] = f"{name}_CFLAGS := {flags}\n{name}_SOURCES := {' '.join(sources)}\n"
    return made


def _selftest_text(unit: ControlUnit, params: Registers, given: Mapping[str, Any]) -> str:
    """The calls of the self-test, with the hash that the compiled steps make of them."""
    found = self_test(unit, params)
    roots = {"params": f"&{unit.name}_defaults", "controller": "c", "lines": "l"}
    calls = list[dict[str, Any]]()
    for one in found.calls:
        step = unit.entries[one.name]
        numbers, signals = iter(one.numbers), (f"s{k}" for k in range(len(found.laid)))
        codes = arguments(step, {unit.params: "params", unit.controller: "controller", unit.lines: "lines"})
        texts = [roots.get(code) or (next(signals) if code == "signal" else number(next(numbers)).text)
                 for code in codes]  # fmt: skip
        shown = [(place_of(leaf.path, "c->", "l->"), number(value).text) for leaf, value in one.shown]
        calls.append({"name": one.name, "texts": texts, "shown": shown})
    small = [(leaf.path[0], in_c(unit, leaf, "", "")) for leaf in unit.leaves if leaf.length <= LARGE]
    places = {root: [replace(one, place=one.place.removesuffix("[k]")) for of, one in small if of == root]
              for root in "cl"}  # fmt: skip
    sizes = {root: sum(leaf.width.size * max(leaf.length, 1) for leaf in unit.leaves if leaf.path[0] == root)
             for root in "cl"}  # fmt: skip
    given = dict(given) | {"laid": found.laid, "calls": calls, "sizes": sizes, "places": places}
    return template("selftest.c.in", **given, hash=f"{found.hash:016X}")


def _arguments(taken: Iterable[str | Width]) -> Iterator[str]:
    """Arguments of a call in the replay: registers, what is laid ready, and numbers as they came."""
    numbers = signals = 0
    for one in taken:
        if isinstance(one, Width):
            yield f"as_double(a[{numbers}])" if one.is_float else f"({one.c_name})a[{numbers}]"
            numbers += 1
        elif one == "signal":
            yield f"laid{signals}_"
            signals += 1
        else:
            yield {"params": "p_", "controller": "&c_", "lines": "&l_"}[one]


# ---- random vectors


def _row_in_c(row: Row) -> dict[str, Any]:
    place = f"{row.root}_." + ".".join(c_field(part) for part in row.path.split(".")) + ("[0]" if row.length else "")
    numbers = {key: number(getattr(row, key)).text for key in ("lo", "hi", "span", "low", "high", "given")}
    return numbers | {"place": place, "length": row.length, "bytes": row.width.size, "real": int(row.width.is_float)}


def _call_in_c(chance: Chance, f: Function) -> list[str]:
    """Statements that draw the arguments of a function, call it, and return the bits of its result."""
    program, lines, told, signals = chance.program, list[str](), list[str](), 0
    for k, name in enumerate(program.arguments(f)):
        value: Any = f.names[name]
        if value.kind == "file":
            kind = ("const " if value.registers in program.fixed else "") + program.struct(value.registers)
            found = [f"&{root}_" + "".join(f".{c_field(one)}" for one in path.split(".") if one)
                     for root, path in chance.places[value.registers]]  # fmt: skip
            lines.append(f"{kind} *const places{k}[{len(found)}] = {{{', '.join(found)}}};")
            lines.append(f"{kind} *const a{k} = places{k}[draw() % {len(found)}];")
        elif value.kind == "signal":
            code = value.width.code
            lines.append(f"const {program.name}_{code}_signal a{k} = lay_{code}(laid_{code}_{signals}_);")
            signals += 1
        elif value.kind == "bool":
            lines.append(f"const bool a{k} = (draw() & 1) == 1;")
        elif value.kind == "float":
            lines.append(f"const {value.ctype} a{k} = ({value.ctype})draw_real({-FAR}, {FAR}, 0.0);")
            told.append(f"real_bits((double)a{k})")
        else:
            lo, hi = drawn_from(value.lo, value.hi)
            least, most, count = (number(one).text for one in (lo, hi, hi - lo + 1))
            kind = value.ctype if f.entry else type_of_local(value)
            lines.append(f"const {kind} a{k} = ({kind})draw_whole({least}, {most}, {count});")
            told.append(f"(uint64_t)a{k}")
    lines += [f"told_[{k}] = {one};" for k, one in enumerate(told)] + [f"arguments_ = {len(told)};"]
    call = f"{f.cname}({', '.join(f'a{k}' for k in range(len(program.arguments(f))))})"
    forms = {"int": "return (uint64_t){};", "bool": "return {} ? 1u : 0u;", "float": "return real_bits((double){});"}
    return [*lines, *forms.get(f.result_kind, "(void){};\nreturn 0;").format(call).splitlines()]


def drawn_text(chance: Chance) -> str:
    """The program that draws what `chance` draws, in C."""
    program, name = chance.program, chance.unit.name
    laid: dict[str, dict[str, str]] = {}
    for f in program.order:
        found = [value for value in f.names.values() if value is not None and value.kind == "signal" and value.width]
        for k, width in enumerate(value.width for value in found if value.width):
            label = f"laid_{width.code}_{k}_"
            laid[label] = {"name": label, "code": width.code, "ctype": width.c_name}
    feed = [f"laid_{value.width.code}_{k}_" for k, value in enumerate(chance.signals) if value.width]
    widths = {value.width for f in program.order for value in f.names.values() if value and value.kind == "signal"}
    kinds = [
        {"code": one.code, "ctype": one.c_name, "lo": interval_of(one)[0], "hi": interval_of(one)[1]}
        for one in sorted((one for one in widths if one), key=lambda one: one.code)
    ]
    roots = {chance.unit.params: "&p_", chance.unit.controller: "&c_", chance.unit.lines: "&l_"}
    values: list[Any] = [chance.tick.names[one] for one in program.arguments(chance.tick)]
    given = [roots[value.registers] for value in values if value.kind == "file"]
    given += [f"feed{k}_" for k in range(len(feed))]
    functions = [{"name": f.cname, "lines": _call_in_c(chance, f)} for f in program.order]
    rows = {"parameters": chance.rows["p"], "controller": chance.rows["c"], "lines": chance.rows["l"]}
    rows |= {"wires": chance.wires}
    return template(
        "drawn.c.in", name=name, NAME=name.upper(), most=PLACES, seed=SEED, large=LARGE, functions=functions,
        told=max(1, *(len(f.parameters) for f in program.order)), laid=list(laid.values()), kinds=kinds,
        feed=[laid[one] for one in feed], tick=f"{chance.tick.cname}({', '.join(given)})",
        actions=[program.order.index(one) for one in chance.actions],
        **{key: [_row_in_c(row) for row in found] for key, found in rows.items()},
    )  # fmt: skip


def signals_of(unit: ControlUnit, program: Program) -> list[Value]:
    """What a host lays ready for the tick."""
    tick: Any = next(iter(unit.entries.values()))
    names = program.steps[getattr(tick, "py_func", tick)].names
    return [one for one in names.values() if one and one.kind == "signal" and one.width]


def _prototype(program: Program, f: Any) -> str:
    doc = comment_of(f.doc.partition("\n")[0])
    return f"/* {doc} */\n{program.signature(f)};\n"


def as_json(data: Any) -> str:
    """Plain data as a text that is the same every time."""
    return json.dumps(data, indent=2, sort_keys=True) + "\n"


def seconds(tick: float) -> str:
    """A tick for people.

    >>> seconds(1e-5)
    '10 us'
    """
    unit, factor = next(((u, f) for u, f in (("s", 1.0), ("ms", 1e3), ("us", 1e6)) if tick * f >= 1.0), ("ns", 1e9))
    value = tick * factor
    return f"{round(value) if math.isclose(value, round(value)) else round(value, 3)} {unit}"
