"""Operators of integers: in 32 bits where operands and result fit by their intervals, else in 64, with Python's result.

Beyond 64 bits, where the intervals cannot rule it out, C computes without a sign and takes it back, as the compiled
step wraps. Nothing relies on what C leaves to the compiler.
"""

import ast
from dataclasses import replace
from typing import Any

from detent.translate.known import Known
from detent.translate.values import (
    ANY,
    HIGHEST,
    LOWEST,
    PRODUCT,
    RANK,
    SUM,
    UNARY,
    UNSIGNED,
    RefusedError,
    Value,
    bits_of,
    in_brackets,
    number,
    outside_language,
    unsigned,
    whole,
)

WRAPPED = {"+": "add", "-": "sub", "*": "mul"}
BITS = {"uint8_t": 8, "uint16_t": 16, "uint32_t": 32}
LONGEST: dict[type[ast.operator], int] = {ast.LShift: 62, ast.RShift: 63}  # shift that is defined in 64 bits


class Integers(Known):
    """Arithmetic of whole numbers."""

    def integer(self, node: ast.BinOp, a: Value, b: Value) -> Value:
        """Result of an operator."""
        method = getattr(self, f"i_{type(node.op).__name__}", None)
        if method is None:
            raise outside_language(node, f"the operator {type(node.op).__name__}", "use + - * // % << >> & | ^")
        return method(node, a, b)

    def wraps(self, node: ast.AST, why: str) -> None:
        """Note what is not proven to fit."""
        if self.final:
            self.program.notes.wraps.add((self.f.where(node), f"{why}: {ast.unparse(node)}"))

    def beside(self, value: Value, level: int) -> str:
        """Text of a left operand: in brackets but for a chain of operators of one kind."""
        return value.text if value.level == level else in_brackets(value, UNARY)

    def wrapped(self, sign: str, a: Value, b: Value) -> Value:
        """What may go beyond 64 bits: computed without a sign there, and taken back."""
        texts = ", ".join(self.cast(one, "int64_t").text for one in (a, b))
        operation = self.helper(f"wrap_{WRAPPED[sign]}", "int64_t")
        return replace(whole(f"{operation}({texts})", "int64_t", LOWEST, HIGHEST), of=(sign, a, b))

    def _sum(self, node: ast.AST, sign: str, level: int, a: Value, b: Value, ends: tuple[int, int]) -> Value:  # noqa: PLR0913
        lo, hi = ends
        bits = bits_of(lo, hi, a.lo, a.hi, b.lo, b.hi)
        if bits == 128:
            self.wraps(node, "may go beyond 64 bits")
            return self.wrapped(sign, a, b)
        of = (sign, a, b)
        ctype, (a, b) = self.brought_to(bits, a, b)
        return replace(whole(f"{self.beside(a, level)} {sign} {in_brackets(b, UNARY)}", ctype, lo, hi, level), of=of)

    def i_Add(self, node: ast.BinOp, a: Value, b: Value) -> Value:  # noqa: N802 - as the syntax tree has it
        """``a + b``."""
        if b.literal and b.lo == 0:
            return a
        return self._sum(node, "+", SUM, a, b, (a.lo + b.lo, a.hi + b.hi))

    def i_Sub(self, node: ast.BinOp, a: Value, b: Value) -> Value:  # noqa: N802
        """``a - b``."""
        return self._sum(node, "-", SUM, a, b, (a.lo - b.hi, a.hi - b.lo))

    def i_Mult(self, node: ast.BinOp, a: Value, b: Value) -> Value:  # noqa: N802
        """``a * b``."""
        corners = [x * y for x in (a.lo, a.hi) for y in (b.lo, b.hi)]
        return self._sum(node, "*", PRODUCT, a, b, (min(corners), max(corners)))

    def i_FloorDiv(self, node: ast.BinOp, a: Value, b: Value) -> Value:  # noqa: N802
        """``a // b``: rounded down; 0 for a divisor 0."""
        divisors = {b.lo, b.hi, *(one for one in (-1, 1) if b.lo <= one <= b.hi)} - {0}
        corners = [x // y for x in (a.lo, a.hi) for y in divisors] + ([0] if b.lo <= 0 <= b.hi or not divisors else [])
        lo, hi = min(corners), max(corners)
        if hi > HIGHEST:
            self.wraps(node, "may go beyond 64 bits")
            lo, hi = LOWEST, HIGHEST
        ctype, (a, b) = self.brought_to(bits_of(a.lo, a.hi, b.lo, b.hi, lo, hi), a, b)
        if a.lo >= 0 and b.lo > 0:
            return whole(f"{self.beside(a, PRODUCT)} / {in_brackets(b, UNARY)}", ctype, lo, hi, PRODUCT)
        return whole(f"{self.helper('floor_div', ctype)}({a.text}, {b.text})", ctype, lo, hi)

    def i_Mod(self, node: ast.BinOp, a: Value, b: Value) -> Value:  # noqa: N802
        """``a % b``: with the sign of the divisor; 0 for a divisor 0."""
        del node
        lo, hi = min(0, b.lo + 1), max(0, b.hi - 1)
        ctype, (a, b) = self.brought_to(bits_of(a.lo, a.hi, b.lo, b.hi), a, b)
        if a.lo >= 0 and b.lo > 0:
            return whole(f"{self.beside(a, PRODUCT)} % {in_brackets(b, UNARY)}", ctype, 0, min(hi, a.hi), PRODUCT)
        return whole(f"{self.helper('floor_mod', ctype)}({a.text}, {b.text})", ctype, lo, hi)

    def _check_shift(self, node: ast.BinOp, b: Value) -> tuple[int, int]:
        most = LONGEST[type(node.op)]
        if not 0 <= b.lo <= b.hi <= most:
            if self.final:
                got = f"a shift by {b.lo} to {b.hi}: {ast.unparse(node)}"
                raise RefusedError("FW08", node, got, f"one by 0 to {most}", "declare a range of the register")
            return 0, most
        return b.lo, b.hi

    def i_LShift(self, node: ast.BinOp, a: Value, b: Value) -> Value:  # noqa: N802
        """``a << b``, by way of a number without a sign."""
        corners = [x << n for x in (a.lo, a.hi) for n in self._check_shift(node, b)]
        lo, hi = min(corners), max(corners)
        bits = bits_of(lo, hi, a.lo, a.hi)
        if bits == 128:
            self.wraps(node, "may go beyond 64 bits")
            bits, lo, hi = 64, LOWEST, HIGHEST
        ctype, (a,) = self.brought_to(bits, a)
        text = f"{self.helper('shift_left', ctype)}({a.text}, {self._count_of(b)})"
        return whole(text, ctype, lo, hi)

    def _count_of(self, value: Value) -> str:
        """By how much to shift, without a sign."""
        if value.literal:
            return value.text
        plain = value.ctype in UNSIGNED and not value.is_composite
        return (value if plain else self.converted(value, "unsigned")).text

    def i_RShift(self, node: ast.BinOp, a: Value, b: Value) -> Value:  # noqa: N802
        """``a >> b``, rounded down whatever the compiler does with a sign."""
        corners = [x >> n for x in (a.lo, a.hi) for n in self._check_shift(node, b)]
        # In C a shift by the width or more is not defined: 32 bits only where the count is below that.
        bits = max(bits_of(a.lo, a.hi), 16 if b.hi < 16 else 32 if b.hi < 32 else 64)
        ctype, (a,) = self.brought_to(bits, a)
        way = "shift_down" if a.lo >= 0 else "shift_right"
        text = f"{self.helper(way, ctype)}({a.text}, {self._count_of(b)})"
        return whole(text, ctype, min(corners), max(corners))

    def _bitwise(self, sign: str, a: Value, b: Value, lo: int, hi: int) -> Value:
        of, ctype = (sign, a, b), _type_without_sign(a, b)
        if ctype:
            a, b = (unsigned(one) if one.literal else one for one in (a, b))
        else:  # with a sign in it, C's small types would give another type than that of the result
            ctype, (a, b) = self.brought_to(bits_of(a.lo, a.hi, b.lo, b.hi), a, b)
        return replace(whole(f"{in_brackets(a, UNARY)} {sign} {in_brackets(b, UNARY)}", ctype, lo, hi, ANY), of=of)

    def i_BitAnd(self, node: ast.BinOp, a: Value, b: Value) -> Value:  # noqa: N802
        """``a & b``: of a mask without a sign no more than its own bits are needed of the other."""
        del node
        if b.lo >= 0 or a.lo >= 0:
            hi = min(one.hi for one in (a, b) if one.lo >= 0)
            bits = bits_of(hi)
            if bits < 64 and not _type_without_sign(a, b) and any(RANK[one.ctype] > bits + 1 for one in (a, b)):
                return self.masked(a, b, bits, hi)
            return self._bitwise("&", a, b, 0, hi)
        return self._bitwise("&", a, b, LOWEST, HIGHEST)

    def i_BitOr(self, node: ast.BinOp, a: Value, b: Value) -> Value:  # noqa: N802
        """``a | b``."""
        del node
        return self._bitwise("|", a, b, *_of_same_bits(a, b))

    def i_BitXor(self, node: ast.BinOp, a: Value, b: Value) -> Value:  # noqa: N802
        """``a ^ b``."""
        del node
        return self._bitwise("^", a, b, *_of_same_bits(a, b))

    def masked(self, a: Value, b: Value, bits: int, hi: int) -> Value:
        """What two numbers have in common, in so many bits without a sign."""
        made = self.modular(replace(whole("", "int64_t", LOWEST, HIGHEST, ANY), of=("&", a, b)), bits)
        return replace(made, lo=0, hi=hi)

    def negative(self, node: ast.AST, value: Value) -> Value:
        """``-value``."""
        bits = bits_of(-value.hi, -value.lo, value.lo, value.hi)
        if bits == 128:
            self.wraps(node, "may go beyond 64 bits")
            return self.wrapped("-", number(0), value)
        of = ("-", number(0), value)
        ctype, (value,) = self.brought_to(bits, value)
        return replace(whole(f"-{in_brackets(value, 0)}", ctype, -value.hi, -value.lo, UNARY), of=of)

    def magnitude(self, node: ast.AST, value: Value) -> Value:
        """``abs(value)``."""
        lo = 0 if value.lo <= 0 <= value.hi else min(abs(value.lo), abs(value.hi))
        hi = max(abs(value.lo), abs(value.hi))
        if hi > HIGHEST:
            self.wraps(node, "may go beyond 64 bits")
            lo, hi = LOWEST, HIGHEST
        ctype, (value,) = self.brought_to(bits_of(lo, hi, value.lo, value.hi), value)
        return whole(f"{self.helper('abs', ctype)}({value.text})", ctype, lo, hi)

    def extreme(self, name: str, values: list[Value]) -> Value:
        """The least or the largest of some integers."""
        of: Any = min if name == "min" else max
        first, *others = values
        for other in others:
            lo, hi = of(first.lo, other.lo), of(first.hi, other.hi)
            ctype, (a, b) = self.brought_to(bits_of(first.lo, first.hi, other.lo, other.hi), first, other)
            first = whole(f"{self.helper(name, ctype)}({a.text}, {b.text})", ctype, lo, hi)
        return first


def _type_without_sign(a: Value, b: Value) -> str:
    """The type of both operands where they have no sign and one type; a number has any that holds it."""
    known = {one.ctype for one in (a, b) if not one.literal}
    ctype = known.pop() if len(known) == 1 else ""
    fits = all(0 <= one.lo <= one.hi < 1 << BITS.get(ctype, 0) for one in (a, b) if one.literal)
    return ctype if ctype in BITS and fits else ""


def _of_same_bits(a: Value, b: Value) -> tuple[int, int]:
    """Interval of a number made of the bits of two."""
    bits = max(one.bit_length() for one in (a.lo, a.hi, b.lo, b.hi))
    return (0 if a.lo >= 0 and b.lo >= 0 else -(1 << bits)), (1 << bits) - 1
