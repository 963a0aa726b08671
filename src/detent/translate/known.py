"""What a condition, or a store, says of the values behind it, until something else is stored there.

A fact is an interval of a place (a variable, a register) by its text in C, or an index below the length of a signal. A
store into a field drops the facts about every register of that name: two names may mean one place. A call that writes
drops those about all registers; a loop, those about everything that it writes.
"""

import ast
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from detent.translate.values import (
    ANY,
    ATOM,
    PRODUCT,
    RANK,
    SUM,
    TYPES,
    UNARY,
    UNSIGNED,
    RefusedError,
    Value,
    as_single_number,
    as_whole,
    bits_of,
    in_brackets,
    number,
    outside_language,
    real,
    unsigned,
    whole,
)

if TYPE_CHECKING:
    from detent.translate.program import Function, Program

SUFFIXES = {"int64_t": "i64", "int32_t": "i32", "int": "int"}  # of helpers that exist for several types
SHORT = SUFFIXES | {
    "int8_t": "i8", "int16_t": "i16", "uint8_t": "u8", "uint16_t": "u16", "uint32_t": "u32", "unsigned": "unsigned"
}  # fmt: skip
FLIPPED: dict[Any, Any] = {
    ast.Lt: ast.Gt,
    ast.LtE: ast.GtE,
    ast.Gt: ast.Lt,
    ast.GtE: ast.LtE,
    ast.Eq: ast.Eq,
    ast.NotEq: ast.NotEq,
}
OPPOSITE: dict[Any, Any] = {
    ast.Lt: ast.GtE,
    ast.LtE: ast.Gt,
    ast.Gt: ast.LtE,
    ast.GtE: ast.Lt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
}


@dataclass
class Facts:
    """What is known here."""

    bounds: dict[str, tuple[int, int]] = field(default_factory=dict[str, tuple[int, int]])
    below: set[tuple[str, str]] = field(
        default_factory=set[tuple[str, str]]
    )  # index, and signal whose length it is under

    def copy(self) -> "Facts":
        """Independent copy."""
        return Facts(dict(self.bounds), set(self.below))

    def drop(self, affected: Callable[[str], bool]) -> None:
        """Forget every place of which ``affected(text)`` holds."""
        self.bounds = {text: bound for text, bound in self.bounds.items() if not affected(text)}
        self.below = {pair for pair in self.below if not affected(pair[0])}

    def either(self, other: "Facts") -> "Facts":
        """What holds whichever way was gone."""
        both = self.bounds.keys() & other.bounds.keys()
        joined = {
            text: (min(self.bounds[text][0], other.bounds[text][0]), max(self.bounds[text][1], other.bounds[text][1]))
            for text in both
        }
        return Facts(joined, self.below & other.below)


def is_register(text: str) -> bool:
    """True for the text of a place in a register file."""
    return "->" in text


def field_of(text: str) -> str:
    """Name of the last field of a place in a register file."""
    return text.replace("->", ".").rpartition(".")[2]


class Known:
    """What a translation of one step knows at the line at which it is."""

    def __init__(self, program: "Program", function: "Function", *, final: bool) -> None:
        self.program, self.f, self.final = program, function, final
        self.facts = Facts()
        self.lines: list[str] = []
        self.pre: list[str] = []  # lines that must come before the one that is being made
        self.depth = 1
        self.temporaries = 0
        self.guarded = 0  # inside of what is not always evaluated

    # ---- lines

    def line(self, text: str) -> None:
        """Write a line."""
        self.lines.append("    " * self.depth + text)

    def flush(self) -> None:
        """Write what must come before the next line."""
        for text in self.pre:
            self.line(text)
        self.pre = []

    def temporary(self) -> str:
        """A name that no step uses."""
        self.temporaries += 1
        return f"t{self.temporaries}_"

    def expr(self, node: ast.AST) -> Value:
        """Value of an expression."""
        method = getattr(self, f"e_{type(node).__name__}", None)
        if method is None:
            raise outside_language(node, f"the expression {type(node).__name__}", "write it with what a step may hold")
        return method(node)

    # ---- types

    def helper(self, name: str, ctype: str) -> str:
        """Name of a function that every program has which needs it."""
        made = f"{name}_{SUFFIXES[ctype]}" if ctype else name
        self.program.notes.helpers.add(made)
        return f"{self.program.name}_{made}"

    def converted(self, value: Value, ctype: str) -> Value:
        """An integer in another type that holds it: by a cast, or by a function where it is an operator's result.

        Of a result whose lower bits are enough, or whose operands have no sign, the operands are converted instead.
        """
        bits, before = 32 if ctype == "uint32_t" else 16, value.ctype
        if value.of is not None and (ctype in UNSIGNED) != (before in UNSIGNED):
            if before in UNSIGNED and value.is_composite:
                sign, *operands = value.of
                ends = [end for one in operands for end in (one.lo, one.hi)]
                made, (a, b) = self.brought_to(bits_of(*ends), *operands)
                text = f"{in_brackets(a, UNARY)} {sign} {in_brackets(b, UNARY)}"
                value = replace(value, text=text, ctype=made, of=None)
            elif before not in UNSIGNED and RANK[before] >= bits:
                value = self.modular(value, bits)
            if value.ctype == ctype:
                return value
        if value.is_composite and (RANK[value.ctype] < RANK[ctype] or (ctype in UNSIGNED) != (value.ctype in UNSIGNED)):
            text = f"{self.helper(f'{SHORT[ctype]}_of_{SHORT[value.ctype]}', '')}({value.text})"
            return replace(value, text=text, ctype=ctype, level=ATOM)
        return replace(value, text=f"({ctype}){in_brackets(value, UNARY)}", ctype=ctype, level=UNARY)

    def cast(self, value: Value, ctype: str) -> Value:
        """An integer in another type that holds it; C widens small ones by itself."""
        if value.ctype == ctype or value.literal or (RANK[value.ctype] < RANK[ctype] and not value.is_composite):
            return value
        return self.converted(value, ctype)

    def modular(self, value: Value, bits: int) -> Value:
        """The lower 16 or 32 bits of an integer, without a sign: of a sum, made of those of its operands alone."""
        ctype = {16: "unsigned", 32: "uint32_t"}[bits]
        if value.ctype in UNSIGNED and RANK[value.ctype] <= RANK[ctype]:
            return value
        if value.literal and 0 <= value.lo < 1 << bits - 1:
            return unsigned(value)
        if value.of is None or RANK[value.ctype] < bits or value.ctype in UNSIGNED:
            return self.converted(replace(value, of=None), ctype)
        sign, *operands = value.of
        level = {"+": SUM, "-": SUM, "*": PRODUCT}.get(sign, ANY)
        a, b = (self.modular(one, bits) for one in operands)
        if ctype not in (a.ctype, b.ctype):
            a = self.converted(a, ctype)
        left = a.text if a.level == level < ANY else in_brackets(a, UNARY)
        return whole(f"{left} {sign} {in_brackets(b, UNARY)}", ctype, 0, (1 << bits) - 1, level)

    def brought_to(self, bits: int, *values: Value) -> tuple[str, list[Value]]:
        """Operands such that C computes in the type of so many bits, all of them with a sign; that type, and they."""
        if bits == 16 and any(RANK[one.ctype] >= 32 and not one.literal for one in values):
            bits = 32
        ctype = TYPES[min(bits, 64)]
        made = [
            self.converted(one, ctype)
            if RANK[one.ctype] > RANK[ctype] or one.ctype in UNSIGNED or (one.is_composite and one.ctype != ctype)
            else one
            for one in values
        ]
        if bits > 16 and not any(one.ctype == ctype and not (one.literal and bits == 32) for one in made):
            k = next((n for n, one in enumerate(made) if not one.literal), 0)
            made[k] = self.converted(made[k], ctype)
        return ctype, made

    def as_real(self, value: Value) -> Value:
        """A number as a float, as Python takes it beside one."""
        if value.is_single:
            return self.in_other_float(value, "double")
        if value.kind == "float":
            return value
        if value.kind == "bool" and value.truth is None:
            return real(f"{in_brackets(value, UNARY)} ? 1.0 : 0.0", ANY + 1)
        value = as_whole(value)
        if value.is_constant and bits_of(value.lo) <= 32:
            return number(float(value.lo))
        if value.is_composite:
            return real(f"{self.helper(f'f64_of_{SHORT[value.ctype]}', '')}({value.text})")
        return real(f"(double){in_brackets(value, UNARY)}", UNARY)

    def as_single(self, value: Value) -> Value:
        """A number as one of single precision; a whole number beside such a one, a float where it is stored."""
        if value.kind == "float":
            return value if value.is_single else self.in_other_float(value, "float")
        if value.kind == "bool" and value.truth is None:
            return real(f"{in_brackets(value, UNARY)} ? 1.0f : 0.0f", ANY + 1, "float")
        value = as_whole(value)
        if value.is_constant and bits_of(value.lo) <= 32:
            return as_single_number(value.lo)
        if value.is_composite:
            return real(f"{self.helper(f'f32_of_{SHORT[value.ctype]}', '')}({value.text})", ctype="float")
        return real(f"(float){in_brackets(value, UNARY)}", UNARY, "float")

    def in_float(self, value: Value, ctype: str) -> Value:
        """A number as a float of this type."""
        return self.as_single(value) if ctype == "float" else self.as_real(value)

    def in_other_float(self, value: Value, ctype: str) -> Value:
        """A float in the other precision: a cast, or a function where it is an operator's result (MISRA C 10.8)."""
        if value.given is not None:
            return as_single_number(value.given) if ctype == "float" else number(value.given)
        if value.is_composite:
            name = "f32_of_f64" if ctype == "float" else "f64_of_f32"
            return real(f"{self.helper(name, '')}({value.text})", ctype=ctype)
        return real(f"({ctype}){in_brackets(value, UNARY)}", UNARY, ctype)

    def met(self, node: ast.AST, a: Value, b: Value) -> tuple[Value, Value, str]:
        """Two numbers, one of them a float, in the precision in which they meet: single beside single or whole ones."""
        if not any(one.kind == "float" and not one.is_single for one in (a, b)):
            return self.as_single(a), self.as_single(b), "float"
        if self.final and (a.is_single or b.is_single):
            self.program.notes.promotions.add((self.f.where(node), ast.unparse(node)))
        return self.as_real(a), self.as_real(b), "double"

    def alike(self, node: ast.AST, *values: Value) -> tuple[list[Value], str]:
        """Numbers, one of them a float, of which one is chosen: all of one precision, or whole."""
        kinds = {one.ctype for one in values if one.kind == "float"}
        if len(kinds) > 1 and self.final:
            remedy = "a constant as a whole number, or alike(model, value)"
            raise outside_language(node, f"a choice between single and double precision, {ast.unparse(node)}", remedy)
        ctype = "float" if kinds == {"float"} else "double"
        return [self.in_float(one, ctype) for one in values], ctype

    # ---- facts

    def stored(self, text: str, value: Value) -> None:
        """A place has got a value."""
        name = field_of(text)
        register = is_register(text)

        def affected(one: str) -> bool:
            return is_register(one) and field_of(one) == name if register else one == text

        self.facts.drop(affected)
        if value.kind == "int":
            self.facts.bounds[text] = (value.lo, value.hi)

    def written(self) -> None:
        """A call has written registers."""
        self.facts.drop(is_register)

    def looped(self, names: set[str]) -> None:
        """A loop begins or ends that writes these variables, and any register."""

        def affected(one: str) -> bool:
            return is_register(one) or one in names

        self.facts.drop(affected)

    def refined(self, value: Value) -> Value:
        """A value with what is known of its place."""
        bound = self.facts.bounds.get(value.text)
        if value.kind != "int" or bound is None:
            return value
        lo, hi = max(value.lo, bound[0]), min(value.hi, bound[1])
        return replace(value, lo=lo, hi=hi) if lo <= hi else value

    def learn(self, node: ast.AST, *, holds: bool) -> None:
        """A condition holds from here on, or does not."""
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
            self.learn(node.operand, holds=not holds)
        elif isinstance(node, ast.BoolOp) and isinstance(node.op, ast.And) == holds:
            for part in node.values:
                self.learn(part, holds=holds)
        elif isinstance(node, ast.Compare) and (holds or len(node.ops) == 1):
            places = [node.left, *node.comparators]
            for op, left, right in zip(node.ops, places, places[1:], strict=False):
                self._learn_pair(type(op) if holds else OPPOSITE.get(type(op), type(op)), left, right)
        elif isinstance(node, ast.Name | ast.Attribute):
            self._learn_pair(ast.NotEq if holds else ast.Eq, node, ast.Constant(0))

    def _learn_pair(self, op: Any, left: ast.AST, right: ast.AST) -> None:
        if op not in FLIPPED:
            return
        for how, place, limit in ((op, left, right), (FLIPPED[op], right, left)):
            known = self._simple(place)
            if known is None or known.kind != "int":
                continue
            if isinstance(limit, ast.Call) and getattr(limit.func, "id", "") == "len":
                with suppress(RefusedError):
                    signal = self.expr(limit.args[0])
                    if signal.length:
                        self._bind(how, known, number(signal.length))
                    elif how is ast.Lt:
                        self.facts.below.add((known.text, signal.text))
            bound = self._simple(limit)
            if bound is not None and bound.kind == "int":
                self._bind(how, known, bound)

    def _simple(self, node: ast.AST) -> Value | None:
        """Value of what can be read again without any effect."""
        if isinstance(node, ast.UnaryOp) and isinstance(node.operand, ast.Constant):
            return self.expr(node)
        inner = node
        while isinstance(inner, ast.Attribute):
            inner = inner.value
        return self.expr(node) if isinstance(inner, ast.Name | ast.Constant) else None

    def _bind(self, op: Any, place: Value, limit: Value) -> None:
        lo, hi = place.lo, place.hi
        if op in (ast.Lt, ast.LtE):
            hi = min(hi, limit.hi - (op is ast.Lt))
        elif op in (ast.Gt, ast.GtE):
            lo = max(lo, limit.lo + (op is ast.Gt))
        elif op is ast.Eq:
            lo, hi = max(lo, limit.lo), min(hi, limit.hi)
        elif limit.is_constant:
            lo, hi = lo + (lo == limit.lo), hi - (hi == limit.lo)
        if lo <= hi and not place.is_constant:
            self.facts.bounds[place.text] = (lo, hi)
