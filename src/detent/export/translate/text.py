"""The two files: structures and prototypes, and the code with the helpers that it needs."""

import re
from collections.abc import Iterable

from detent.export.translate.program import Function, Program
from detent.export.translate.values import c_field
from detent.kernel.registers import Registers

UNSIGNED = {"i1": "uint8_t", "i2": "uint16_t", "i4": "uint32_t", "i8": "uint64_t"}

HELPERS = {
    "floor_div": """{t} N(floor_div_{c})({t} a, {t} b)
{{
    {t} q;
    if (b == 0) {{
        return 0;
    }}
    if (b == -1) {{
        return ({t})(({u})0 - ({u})a);
    }}
    q = a / b;
    return (((a % b) != 0) && ((a < 0) != (b < 0))) ? (q - 1) : q;
}}
""",
    "floor_mod": """{t} N(floor_mod_{c})({t} a, {t} b)
{{
    {t} m;
    if ((b == 0) || (b == -1)) {{
        return 0;
    }}
    m = a % b;
    return ((m != 0) && ((m < 0) != (b < 0))) ? (m + b) : m;
}}
""",
    "shift_right": """{t} N(shift_right_{c})({t} a, int32_t n)
{{
    return (a >= 0) ? (a >> n) : ({t})~(~({u})a >> n);
}}
""",
    "abs": """{t} N(abs_{c})({t} a)
{{
    return (a < 0) ? ({t})(({u})0 - ({u})a) : a;
}}
""",
    "min": "{t} N(min_{c})({t} a, {t} b)\n{{\n    return (b < a) ? b : a;\n}}\n",
    "max": "{t} N(max_{c})({t} a, {t} b)\n{{\n    return (b > a) ? b : a;\n}}\n",
}
WHOLE_HELPERS = {
    "min_f8": "double N(min_f8)(double a, double b)\n{\n    return (b < a) ? b : a;\n}\n",
    "max_f8": "double N(max_f8)(double a, double b)\n{\n    return (b > a) ? b : a;\n}\n",
    "to_i64": """int64_t N(to_i64)(double x)
{
    if (x >= 9223372036854775808.0) {
        return INT64_MAX;
    }
    return (x >= -9223372036854775808.0) ? (int64_t)x : INT64_MIN;
}
""",
    "floor": """int64_t N(floor)(double x)
{
    const int64_t t = N(to_i64)(x);
    return ((x < (double)t) && (t > INT64_MIN)) ? (t - 1) : t;
}
""",
    "power_of_two": """double N(power_of_two)(int64_t exponent)
{
    const uint64_t bits = (uint64_t)(exponent + 1023) << 52;
    double x;
    memcpy(&x, &bits, sizeof x);
    return x;
}
""",
    "bits_of": """int64_t N(bits_of)(double x)
{
    int64_t bits;
    memcpy(&bits, &x, sizeof bits);
    return bits;
}
""",
    "claimed": """int64_t N(claimed)(int64_t value, int64_t lowest, int64_t highest)
{
#ifdef FIRMWARE_CHECK
    if ((value < lowest) || (value > highest)) {
        __builtin_trap();
    }
#else
    (void)lowest;
    (void)highest;
#endif
    return value;
}
""",
}
WRAP = """{t} N(wrap_{c})(int64_t value)
{{
    const {u} bits = ({u})value;
    return (bits > ({u}){most}) ? ({t})(-({t})({u})~bits - 1) : ({t})bits;
}}
"""
MOST = {"i1": "INT8_MAX", "i2": "INT16_MAX", "i4": "INT32_MAX", "i8": "INT64_MAX"}
C_TYPES = {"i1": "int8_t", "i2": "int16_t", "i4": "int32_t", "i8": "int64_t"}


def helper_text(name: str, prefix: str) -> str:
    """One helper in C."""
    kind, _, of = name.rpartition("_")
    if name in WHOLE_HELPERS:
        text = WHOLE_HELPERS[name]
    elif kind == "wrap":
        text = WRAP.format(t=C_TYPES[of], u=UNSIGNED[of], c=of, most=MOST[of])
    else:
        bits = "64" if of == "i64" else "32"
        text = HELPERS[kind].format(t=f"int{bits}_t", u=f"uint{bits}_t", c=of)
    return "static " + re.sub(r"\bN\((\w+)\)", rf"{prefix}_\1", text)


def helpers_text(program: Program) -> str:
    """All helpers that a program needs, the ones that others call first."""
    needed = program.notes.helpers | ({"to_i64"} if "floor" in program.notes.helpers else set[str]())
    return "\n".join(helper_text(one, program.name) for one in sorted(needed, key=lambda one: (one == "floor", one)))


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
            kind = program.struct(field.block) if field.block else (field.width.c_name if field.width else "")
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
    widths = {
        v.width for f in program.order for v in f.names.values() if v is not None and v.kind == "signal" and v.width
    }
    return "".join(
        f"/* What the host lays ready: where it is, and how much. */\ntypedef struct {{\n    const {one.c_name} *at;\n"
        f"    int32_t length;\n}} {program.name}_{one.code}_signal;\n\n"
        for one in sorted(widths, key=lambda one: one.code)
    )


def header_of(function: Function, program: Program) -> str:
    """Prototype of an entry."""
    return f"{program.signature(function)};\n"


def code_text(program: Program) -> str:
    """Constants, helpers and functions, callees first."""
    constants = "".join(f"#define {name} {text}\n" for name, (_, text) in sorted(program.notes.constants.items()))
    functions = "\n".join(program.texts[f.py] for f in program.order)
    body = "\n".join(part for part in (constants, helpers_text(program), functions) if part)
    needs_math = any(word in functions for word in ("sqrt(", "fabs(", "INFINITY"))
    includes = ["<math.h>"] if needs_math else []
    includes += ["<stddef.h>"] if "NULL" in functions else []
    includes += ["<string.h>"] if "memcpy(" in body else []
    return "".join(f"#include {one}\n" for one in includes) + "\n" + body
