"""The two files: structures and prototypes, and the code with the helpers that it needs."""

import re
from collections.abc import Iterable

from detent.kernel.registers import Registers
from detent.translate.known import SHORT
from detent.translate.program import Function, Program
from detent.translate.values import c_field

UNSIGNED = {"i1": "uint8_t", "i2": "uint16_t", "i4": "uint32_t", "i8": "uint64_t"}

HELPERS = {
    "floor_div": """{t} N(floor_div_{c})({t} a, {t} b)
{{
    {t} q;
    if (b == 0) {{
        return 0;
    }}
    if (b == -1) {{
        const {u} bits = 0U - ({u})a;
        return ({t})bits;
    }}
    q = a / b;
    if (((a % b) != 0) && ((a < 0) != (b < 0))) {{
        q = q - 1;
    }}
    return q;
}}
""",
    "floor_mod": """{t} N(floor_mod_{c})({t} a, {t} b)
{{
    {t} m;
    if ((b == 0) || (b == -1)) {{
        return 0;
    }}
    m = a % b;
    if ((m != 0) && ((m < 0) != (b < 0))) {{
        m = m + b;
    }}
    return m;
}}
""",
    "shift_left": """{t} N(shift_left_{c})({t} a, unsigned n)
{{
    const {u} bits = ({u})a << n;
    return ({t})bits;
}}
""",
    "shift_down": """{t} N(shift_down_{c})({t} a, unsigned n) /* a is not negative */
{{
    const {u} bits = ({u})a >> n;
    return ({t})bits;
}}
""",
    "shift_right": """{t} N(shift_right_{c})({t} a, unsigned n)
{{
    const {u} sign = (a < 0) ? ~({u})0 : ({u})0;
    const {u} bits = ((({u})a ^ sign) >> n) ^ sign;
    return ({t})bits;
}}
""",
    "abs": """{t} N(abs_{c})({t} a)
{{
    const {u} bits = (a < 0) ? (0U - ({u})a) : ({u})a;
    return ({t})bits;
}}
""",
    "wrap_add": """{t} N(wrap_add_{c})({t} a, {t} b)
{{
    const {u} bits = ({u})a + ({u})b;
    return ({t})bits;
}}
""",
    "wrap_sub": """{t} N(wrap_sub_{c})({t} a, {t} b)
{{
    const {u} bits = ({u})a - ({u})b;
    return ({t})bits;
}}
""",
    "wrap_mul": """{t} N(wrap_mul_{c})({t} a, {t} b)
{{
    const {u} bits = ({u})a * ({u})b;
    return ({t})bits;
}}
""",
    "min": "{t} N(min_{c})({t} a, {t} b)\n{{\n    return (b < a) ? b : a;\n}}\n",
    "max": "{t} N(max_{c})({t} a, {t} b)\n{{\n    return (b > a) ? b : a;\n}}\n",
}
WHOLE_HELPERS = {
    "min_f4": "float N(min_f4)(float a, float b)\n{\n    return (b < a) ? b : a;\n}\n",
    "max_f4": "float N(max_f4)(float a, float b)\n{\n    return (b > a) ? b : a;\n}\n",
    "min_f8": "double N(min_f8)(double a, double b)\n{\n    return (b < a) ? b : a;\n}\n",
    "max_f8": "double N(max_f8)(double a, double b)\n{\n    return (b > a) ? b : a;\n}\n",
    "to_i64": """int64_t N(to_i64)(double x)
{
    if (fabs(x) < 9223372036854775808.0) {
        return (int64_t)x;
    }
    return (x > 0.0) ? INT64_MAX : ((-INT64_MAX) - 1);
}
""",
    "shift_right_i64": """int64_t N(shift_right_i64)(int64_t a, unsigned n) /* shorter than by its sign */
{
    const uint64_t bits = (a >= 0) ? ((uint64_t)a >> n) : ~(~(uint64_t)a >> n);
    return (int64_t)bits;
}
""",
    "floor": """int64_t N(floor)(double x)
{
    int64_t t = N(to_i64)(x);
    if ((x < (double)t) && (t >= (-INT64_MAX))) {
        t = t - 1;
    }
    return t;
}
""",
    "round": """int64_t N(round)(double x)
{
    int64_t below = N(floor)(x);
    const double rest = x - (double)below;
    if ((rest > 0.5) || (!(rest < 0.5) && (((uint64_t)below & 1U) != 0U))) {
        below = below + 1;
    }
    return below;
}
""",
    "power_of_two": """double N(power_of_two)(int64_t exponent)
{
    const int64_t biased = exponent + 1023;
    const uint64_t bits = (uint64_t)biased << 52;
    double x;
    (void)memcpy((uint8_t *)&x, (const uint8_t *)&bits, sizeof x);
    return x;
}
""",
    "bits_of": """int64_t N(bits_of)(double x)
{
    int64_t bits;
    (void)memcpy((uint8_t *)&bits, (const uint8_t *)&x, sizeof bits);
    return bits;
}
""",
}
WRAP = """{t} N(wrap_{c})({w} value)
{{
    const {u} bits = ({u})value;
    return (bits > ({u}){most}) ? ({t})(-({t})({u})~bits - 1) : ({t})bits;
}}
"""
FLASH_INCLUDE = """#ifdef __AVR__
#include <avr/pgmspace.h>
#endif
"""
FLASH = """/* Tables, and what a host lays ready, stay in flash, also where that is another address space. */
#ifdef __AVR__
#define {NAME}_FLASH PROGMEM
#ifdef __AVR_HAVE_ELPM__
#define {NAME}_TABLE(table) pgm_get_far_address(table)
#else
#define {NAME}_TABLE(table) (table)
#endif
#else
#define {NAME}_FLASH
#define {NAME}_TABLE(table) (table)
#endif
"""
READS = """#if defined(__AVR__) && defined(__AVR_HAVE_ELPM__)
#define {NAME}_{CODE}(at, k) (({type})pgm_read_{word}_far((at) + ((uint_farptr_t)(k) * {bytes}U)))
#elif defined(__AVR__)
#define {NAME}_{CODE}(at, k) (({type})pgm_read_{word}(&(at)[k]))
#else
#define {NAME}_{CODE}(at, k) ((at)[k])
#endif
"""
PLACE = """#if defined(__AVR__) && defined(__AVR_HAVE_ELPM__)
typedef uint_farptr_t {name}_{code}_place;
#else
typedef const {type} *{name}_{code}_place;
#endif
"""
WORDS = {1: "byte", 2: "word", 4: "dword"}
MOST = {"i1": "INT8_MAX", "i2": "INT16_MAX", "i4": "INT32_MAX", "i8": "INT64_MAX"}
C_TYPES = {"i1": "int8_t", "i2": "int16_t", "i4": "int32_t", "i8": "int64_t"}


CLAIMED = """{storage}int64_t N(claimed)(int64_t value, int64_t lowest, int64_t highest)
{{
#ifdef FIRMWARE_CHECK
    if ((value < lowest) || (value > highest)) {{
        __builtin_trap();
    }}
#else
    (void)lowest;
    (void)highest;
#endif
    return value;
}}
"""
CONVERTED = "{to} N({name})({of} value)\n{{\n    return ({to})value;\n}}\n"
LONG = {short: ctype for ctype, short in SHORT.items()} | {"f64": "double", "f32": "float"}


def helper_text(name: str, prefix: str, storage: str = "static ") -> str:
    """One helper in C."""
    kind, _, of = name.rpartition("_")
    if name == "claimed":
        return re.sub(r"\bN\((\w+)\)", rf"{prefix}_\1", CLAIMED.format(storage=storage))
    if name in WHOLE_HELPERS:
        text = WHOLE_HELPERS[name]
    elif kind.endswith("_of"):
        text = CONVERTED.format(name=name, to=LONG[kind.removesuffix("_of")], of=LONG[of])
    elif kind == "wrap":
        wide = "uint32_t" if of == "i4" else "unsigned"
        text = WRAP.format(t=C_TYPES[of], u=UNSIGNED[of], w=wide, c=of, most=MOST[of])
    else:
        t, u = {"i64": ("int64_t", "uint64_t"), "i32": ("int32_t", "uint32_t")}.get(of, ("int", "unsigned"))
        text = HELPERS[kind].format(t=t, u=u, c=of)
    return storage + re.sub(r"\bN\((\w+)\)", rf"{prefix}_\1", text)


def helpers_text(program: Program) -> str:
    """All helpers that a program needs, the ones that others call first."""
    needed = _used(program)
    storage = program.shape.storage or "static "
    order = sorted(needed, key=lambda one: (one in ("floor", "round"), one))
    return "\n".join(helper_text(one, program.name, storage) for one in order)


def _used(program: Program) -> set[str]:
    """Helpers that the functions call, and those that these call; a sum may have been made in another way."""
    found, waiting = set[str](), [program.texts[f.py] for f in program.order]
    for text in waiting:
        called = set(re.findall(rf"\b{program.name}_(\w+)\(", text)) & program.notes.helpers
        waiting += [helper_text(one, program.name) for one in called - found]
        found |= called
    return found


def comment_of(text: str) -> str:
    """Text inside a comment, which it cannot end."""
    return text.replace("*/", "* /").replace("/*", "/ *")


def struct_texts(program: Program, files: Iterable[type[Registers]]) -> str:
    """Structures of these register files, inner ones first; what became a constant has no place in them."""
    done: dict[type[Registers], str] = {}

    def declare(registers: type[Registers]) -> None:
        """Write a structure behind those that it holds."""
        if registers in done:
            return
        rows: list[str] = []
        for field in program.fields(registers):
            if field.block is not None:
                declare(field.block)
            width = program.width(registers, field)
            kind = program.struct(field.block) if field.block else (width.c_name if width else "")
            array = f"[{field.length}]" if field.length else ""
            unit = f" [{field.unit}]" if field.unit else ""
            rows.append(f"    {kind} {c_field(field.name)}{array}; /* {comment_of(field.doc)}{unit} */\n")
        name = program.struct(registers)
        about = comment_of((registers.__doc__ or "").strip().splitlines()[0])
        done[registers] = f"/* {about} */\ntypedef struct {{\n{''.join(rows)}}} {name};\n\n"

    for one in files:
        declare(one)
    return "".join(done.values())


def signals_text(program: Program) -> str:
    """Types of what a host lays ready."""
    laid = [v for f in program.order for v in f.names.values() if v and v.kind == "signal" and not v.length]
    widths = sorted({v.width for v in laid if v.width}, key=lambda one: one.code)
    kept = {t.width for t in program.shape.tables.values()} | {one for one in widths if one.size < 8}
    parts = [FLASH.format(NAME=program.name.upper())] if kept else []
    parts += [READS.format(NAME=program.name.upper(), CODE=one.code.upper(),
                           type=one.c_name, bytes=one.size, word=WORDS[one.size])
              for one in sorted(kept, key=lambda one: one.code)]  # fmt: skip
    parts += ["\n"] if kept else []
    for one in widths:
        at = f"const {one.c_name} *at" if one.size == 8 else f"{program.name}_{one.code}_place at"
        if one.size < 8:
            parts.append(PLACE.format(name=program.name, code=one.code, type=one.c_name))
        parts.append(
            f"/* What the host lays ready: where it is, and how much. */\ntypedef struct {{\n    {at};\n"
            f"    int32_t length;\n}} {program.name}_{one.code}_signal;\n\n"
        )
    parts += [
        f"/* {comment_of(field.doc)}{f' [{field.unit}]' if field.unit else ''} */\n"
        f"extern const {table.width.c_name} {table.name}[{table.length}] {program.name.upper()}_FLASH;\n\n"
        for (registers, name), table in program.shape.tables.items()
        for field in [registers.__fields__[name]]
    ]
    return "".join(parts)


def header_of(function: Function, program: Program) -> str:
    """Prototype of an entry."""
    return f"{program.signature(function)};\n"


def code_text(program: Program) -> str:
    """Constants, helpers and functions, callees first."""
    constants = "".join(f"#define {name} {text}\n" for name, (_, text) in sorted(program.notes.constants.items()))
    functions = "\n".join(program.texts[f.py] for f in program.order)
    body = "\n".join(part for part in (constants, helpers_text(program), functions) if part)
    needs_math = any(word in body for word in ("sqrt(", "fabs(", "sqrtf(", "fabsf(", "INFINITY"))
    includes = ["<math.h>"] if needs_math else []
    includes += ["<stddef.h>"] if "NULL" in functions else []
    includes += ["<string.h>"] if "memcpy(" in body else []
    return "".join(f"#include {one}\n" for one in includes) + "\n" + body


LONGEST = 118
BREAKS = (" && ", " || ", " ? ", " : ", ", ")


def wrapped(code: str) -> str:
    """The same code in lines that are not too long, broken behind and, or, a comma, and before what a choice gives."""
    made: list[str] = []
    for whole_line in code.split("\n"):
        line, indent = whole_line, " " * (len(whole_line) - len(whole_line.lstrip()) + 8)
        while len(line) > LONGEST:
            places = [(line.rfind(one, len(indent) + 1, LONGEST - 2), one) for one in BREAKS]
            at, one = max(places)
            if at < 0:
                break
            at += 1 if one in (" ? ", " : ") else len(one)
            made.append(line[:at].rstrip())
            line = indent + line[at:]
        made.append(line)
    return "\n".join(made)
