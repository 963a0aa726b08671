"""Everything that has a value, but for calls."""

import ast
import math
from dataclasses import replace

import numpy as np

from detent.kernel.registers import Field, Registers
from detent.kernel.single import Single
from detent.translate.integers import Integers
from detent.translate.known import FLIPPED
from detent.translate.values import (
    ANY,
    ATOM,
    INTEGERS,
    PRODUCT,
    RANK,
    SUM,
    UNARY,
    UNSIGNED,
    RefusedError,
    Table,
    Value,
    as_single_number,
    as_truth,
    as_whole,
    bits_of,
    c_field,
    decided,
    in_brackets,
    interval_of,
    number,
    outside_language,
    real,
    truth,
    type_of_local,
    unsigned,
    whole,
)

SIGNS = {ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!="}
REAL_SIGNS: dict[type[ast.operator], tuple[str, int]] = {
    ast.Add: ("+", SUM),
    ast.Sub: ("-", SUM),
    ast.Mult: ("*", PRODUCT),
}
ORDER = "split the expression into lines"


class Expressions(Integers):
    """Names, registers, operators, conditions."""

    # ---- order of effects

    def is_impure(self, node: ast.AST) -> bool:
        """True for what holds a call that writes registers."""
        return any(isinstance(one, ast.Call) and self.program.writes(self.f, one) for one in ast.walk(node))

    def suppose(self, node: ast.AST, *, holds: bool) -> None:
        """A condition holds from here on, or does not; one whose calls write says nothing of what they wrote."""
        if not self.is_impure(node):
            self.learn(node, holds=holds)

    def keep(self, value: Value) -> Value:
        """A value in a variable, as it is now."""
        if value.kind in ("file", "array", "signal") or value.is_constant or value.truth is not None:
            return value
        name, ctype = self.temporary(), type_of_local(value)
        text = self.cast(value, ctype).text if value.kind == "int" else value.text
        self.pre.append(f"const {ctype} {name} = {text};")
        return replace(value, text=name, level=ATOM, ctype=ctype, of=None)

    def ordered(self, nodes: list[ast.expr]) -> list[Value]:
        """Values from left to right: what stands beside a call that writes is kept before it, as is its result."""
        impure = [self.is_impure(node) for node in nodes]
        reads = [any(isinstance(x, ast.Attribute | ast.Subscript | ast.Call) for x in ast.walk(n)) for n in nodes]
        values: list[Value] = []
        for k, node in enumerate(nodes):
            value = self.expr(node)
            later, earlier = any(impure[k + 1 :]), any(impure[:k])
            beside = later or (impure[k] and (earlier or any(reads[k + 1 :])))
            if beside and len(nodes) > 1 and not isinstance(node, ast.Constant):
                if self.guarded:
                    raise RefusedError("FW10", node, "a call that writes beside what reads", "one of them", ORDER)
                value = self.keep(value)
            values.append(value)
        return values

    # ---- names and registers

    def e_Constant(self, node: ast.Constant) -> Value:  # noqa: N802 - as the syntax tree has it
        """A number."""
        if isinstance(node.value, bool | int | float):
            return number(node.value)
        raise outside_language(node, f"the constant {node.value!r}", "use numbers")

    def e_Name(self, node: ast.Name) -> Value:  # noqa: N802
        """A variable, an alias, or a number of the module."""
        value = self.f.names.get(node.id)
        if value is not None:
            return self.refined(value)
        if node.id in self.f.names or node.id in self.f.assigned:
            # Nothing is known of it yet: a later turn over the program does.
            return whole(node.id, "int", 0, 0)
        constant = self.f.globals.get(node.id)
        if isinstance(constant, bool | float):
            return number(constant)
        if isinstance(constant, int):
            made = number(constant)
            return replace(made, text=self.program.constant(node.id, constant, made.text)) if self.final else made
        raise outside_language(
            node, f"the name {node.id}", "use parameters, registers, numbers of the module, and steps"
        )

    def member(self, base: Value, name: str) -> str:
        """Text of a field of a register file."""
        made = c_field(name)
        return f"{base.text[1:]}.{made}" if base.text.startswith("&") else f"{base.text}->{made}"

    def e_Attribute(self, node: ast.Attribute) -> Value:  # noqa: N802
        """A register, or a block of registers."""
        base = self.expr(node.value)
        known: dict[str, Field] = base.registers.__fields__ if base.registers else {}
        found = known.get(node.attr)
        if base.registers is None or found is None:
            raise outside_language(node, f"{ast.unparse(node)}, which is no register", "use registers")
        return self.read(base.registers, found, self.member(base, node.attr))

    def read(self, registers: type[Registers], found: Field, place: str) -> Value:
        """What stands in a field."""
        if found.block is not None:
            return Value(kind="file", text="&" + place, registers=found.block)
        found = self.program.shape.seen(registers, found)
        if found.width is None:
            raise outside_language(ast.Pass(), f"{place}, which has no width", "declare one")
        table = self.program.shape.tables.get((registers, found.name))
        if table is not None:
            return array_of(table, "array")
        if found.length:
            return Value(kind="array", text=place, width=found.width, length=found.length, within=found.range)
        fixed = self.program.options.get((registers, found.name))
        if fixed is not None:
            return number(fixed)
        if found.width.is_float:
            return real(place, ctype=found.width.c_name)
        width, claimed = self.program.stored(registers, found)
        lo, hi = interval_of(width)
        if claimed is not None:
            lo, hi = max(lo, int(claimed[0])), min(hi, int(claimed[1]))
        return self.refined(whole(place, INTEGERS[width.code], lo, hi))

    def check_index(self, node: ast.AST, array: Value, index: Value) -> None:
        """Refuse an index that may lie outside."""
        if index.kind != "int" or array.kind not in ("array", "signal"):
            raise outside_language(node, f"{ast.unparse(node)}", "index an array of registers with an integer")
        inside = index.lo >= 0 and (
            index.hi < array.length if array.length else (index.text, array.text) in self.facts.below
        )
        if self.final and not inside:
            length = str(array.length) if array.length else f"len({array.text})"
            got = f"an index from {index.lo} to {index.hi}: {ast.unparse(node)}"
            raise RefusedError("FW09", node, got, f"one from 0 to below {length}", "declare a range of the register")

    def e_Subscript(self, node: ast.Subscript) -> Value:  # noqa: N802
        """An element."""
        found = self.f.globals.get(node.value.id) if isinstance(node.value, ast.Name) else None
        if isinstance(found, tuple):
            return self._of_a_tuple(node, [number(one) for one in found])  # pyright: ignore[reportUnknownVariableType, reportUnknownArgumentType]
        array, index = self.expr(node.value), self.expr(node.slice)
        self.check_index(node, array, index)
        text = array.element.format(text=array.text, index=index.text)
        if array.width is None:
            raise outside_language(node, f"{text}, which has no width", "declare one")
        if array.width.is_float:
            return real(text, ctype=array.width.c_name)
        lo, hi = interval_of(array.width)
        if array.within is not None:
            lo, hi = max(lo, int(array.within[0])), min(hi, int(array.within[1]))
        return whole(text, INTEGERS[array.width.code], lo, hi)

    def _of_a_tuple(self, node: ast.Subscript, items: list[Value]) -> Value:
        """An element of a tuple of whole numbers of the module."""
        index = self.expr(node.slice)
        if not items or any(one.kind != "int" for one in items):
            raise outside_language(node, f"an element of {ast.unparse(node.value)}", "use a tuple of whole numbers")
        ends = min(one.lo for one in items), max(one.hi for one in items)
        element = whole("", "", *ends)
        name, ctype = self.temporary(), type_of_local(element)
        self.check_index(node, Value(kind="array", text=name, length=len(items)), index)
        self.pre.append(f"static const {ctype} {name}[{len(items)}] = {{{', '.join(one.text for one in items)}}};")
        return whole(f"{name}[{index.text}]", ctype, *ends)

    # ---- operators

    def e_BinOp(self, node: ast.BinOp) -> Value:  # noqa: N802
        """An operator between two numbers."""
        a, b = (as_whole(one) for one in self.ordered([node.left, node.right]))
        if isinstance(node.op, ast.Div):
            a, b, ctype = self.met(node, a, b) if "float" in (a.kind, b.kind) else (
                self.as_real(a), self.as_real(b), "double"
            )  # fmt: skip
            return real(f"{self.beside(a, PRODUCT)} / {in_brackets(b, UNARY)}", PRODUCT, ctype)
        if "float" in (a.kind, b.kind):
            if type(node.op) not in REAL_SIGNS:
                raise outside_language(node, f"{type(node.op).__name__} of floats", "use + - * /")
            sign, level = REAL_SIGNS[type(node.op)]
            a, b, ctype = self.met(node, a, b)
            return real(f"{self.beside(a, level)} {sign} {in_brackets(b, UNARY)}", level, ctype)
        if not a.kind == b.kind == "int":
            raise outside_language(node, f"an operator of {a.kind} and {b.kind}", "use numbers")
        return self.integer(node, a, b)

    def e_UnaryOp(self, node: ast.UnaryOp) -> Value:  # noqa: N802
        """``-`` and ``not``."""
        if isinstance(node.op, ast.USub) and isinstance(node.operand, ast.Constant):
            return self._negated(node.operand)
        value = self.expr(node.operand)
        if isinstance(node.op, ast.Not):
            value = as_truth(value)
            return decided(not value.truth) if value.truth is not None else truth(f"!{in_brackets(value, ATOM)}", UNARY)
        if isinstance(node.op, ast.USub):
            value = as_whole(value)
            if value.kind == "float":
                return real(f"-{in_brackets(value, ATOM)}", UNARY, value.ctype)
            return self.negative(node, value)
        raise outside_language(node, f"the operator {type(node.op).__name__}", "use - or not")

    def _negated(self, node: ast.Constant) -> Value:
        if isinstance(node.value, int | float):
            return number(-node.value)
        raise outside_language(node, f"- before {node.value!r}", "use numbers")

    def e_BoolOp(self, node: ast.BoolOp) -> Value:  # noqa: N802
        """``and`` and ``or`` of truth values; each part knows that those before it held, or did not."""
        both = isinstance(node.op, ast.And)
        before, mark, parts = self.facts.copy(), len(self.pre), list[Value]()
        for k, one in enumerate(node.values):
            self.guarded += k > 0
            value = as_truth(self.expr(one))
            self.guarded -= k > 0
            if k > 0 and len(self.pre) > mark:
                raise RefusedError("FW10", node, "a call that writes inside and, or", "conditions that read", ORDER)
            mark = len(self.pre)
            self.suppose(one, holds=both)
            if value.truth is None:
                parts.append(value)
            elif value.truth != both:  # it decides
                if not any(self.is_impure(other) for other in node.values[:k]):
                    self.facts = before
                    return decided(not both)
                parts.append(value)
                break
        self.facts = before
        if self.is_impure(node):
            self.written()
        return self._linked(both, parts) if parts else decided(both)

    def _linked(self, both: bool, parts: list[Value]) -> Value:  # noqa: FBT001 - a truth value
        if len(parts) == 1:
            return parts[0]
        return truth((" && " if both else " || ").join(in_brackets(one, UNARY) for one in parts))

    def e_IfExp(self, node: ast.IfExp) -> Value:  # noqa: N802
        """``a if test else b``."""
        test = as_truth(self.expr(node.test))
        if test.truth is not None:
            return self.expr(node.body if test.truth else node.orelse)
        before, mark = self.facts.copy(), len(self.pre)
        self.guarded += 1
        self.suppose(node.test, holds=True)
        a = self.expr(node.body)
        self.facts = before.copy()
        self.suppose(node.test, holds=False)
        b = self.expr(node.orelse)
        self.facts = before
        self.guarded -= 1
        if len(self.pre) > mark or self.is_impure(node.body) or self.is_impure(node.orelse):
            raise RefusedError("FW10", node, "a call that writes inside if-else", "values that are read", ORDER)
        return self._chosen(node, test, a, b)

    def _chosen(self, node: ast.AST, test: Value, a: Value, b: Value) -> Value:
        if a.kind == b.kind == "bool":
            return truth(f"({test.text}) ? {in_brackets(a, UNARY)} : {in_brackets(b, UNARY)}", ANY + 1)
        if a.kind == b.kind == "signal" and a.width is b.width:
            text = f"(({test.text}) ? {a.text} : {b.text})"
            below = {one: {place for place, signal in self.facts.below if signal == one.text} for one in (a, b)}
            self.facts.below |= {(place, text) for place in below[a] & below[b]}
            return replace(a, text=text, length=min(a.length, b.length))
        if a.kind == b.kind == "file" and a.registers is b.registers:
            return replace(a, text=f"({test.text}) ? {a.text} : {b.text}", level=ANY + 1)
        a, b = as_whole(a), as_whole(b)
        if "float" in (a.kind, b.kind):
            (a, b), ctype = self.alike(node, a, b)
            return real(f"({test.text}) ? {in_brackets(a, UNARY)} : {in_brackets(b, UNARY)}", ANY + 1, ctype)
        if not a.kind == b.kind == "int":
            raise outside_language(node, f"a choice between {a.kind} and {b.kind}", "choose between numbers")
        lo, hi = min(a.lo, b.lo), max(a.hi, b.hi)
        ctype, (a, b) = self.brought_to(bits_of(a.lo, a.hi, b.lo, b.hi), a, b)
        if a.literal and b.literal:  # numbers are of the least type that holds them (MISRA C 10.6)
            a = self.converted(a, ctype)
        return whole(f"({test.text}) ? {in_brackets(a, UNARY)} : {in_brackets(b, UNARY)}", ctype, lo, hi, ANY + 1)

    # ---- comparisons

    def e_Compare(self, node: ast.Compare) -> Value:  # noqa: N802
        """A comparison, a chain of them, or membership in a tuple of numbers."""
        if len(node.ops) == 1 and isinstance(node.ops[0], ast.In | ast.NotIn):
            return self._membership(node, node.ops[0])
        values = self.ordered([node.left, *node.comparators])
        if len(node.ops) > 1:  # what stands in the middle is looked at twice
            middle = zip(values[1:-1], node.comparators[:-1], strict=True)
            kept = [self.keep(value) if self.is_impure(one) else value for value, one in middle]
            values = [values[0], *kept, values[-1]]
        pairs = zip(node.ops, values, values[1:], strict=False)
        parts = [self.compared(node, type(op), a, b) for op, a, b in pairs]
        if any(part.truth is False for part in parts):
            return decided(value=False)
        open_parts = [part for part in parts if part.truth is None]
        if len(open_parts) < 2:
            return open_parts[0] if open_parts else decided(value=True)
        return truth(" && ".join(f"({part.text})" for part in open_parts))

    def _membership(self, node: ast.Compare, op: ast.cmpop) -> Value:
        if not isinstance(node.comparators[0], ast.Tuple):
            raise outside_language(node, "membership in no tuple", "write the numbers in brackets")
        value = self.expr(node.left)
        value = self.keep(value) if self.is_impure(node.left) else value
        parts = [self.compared(node, ast.Eq, value, self.expr(one)) for one in node.comparators[0].elts]
        if any(part.truth for part in parts):
            return decided(isinstance(op, ast.In))
        texts = [f"({part.text})" for part in parts if part.truth is None]
        if not texts:
            return decided(isinstance(op, ast.NotIn))
        text = " || ".join(texts)
        return truth(text, ANY if len(texts) > 1 else ATOM) if isinstance(op, ast.In) else truth(f"!({text})", UNARY)

    def compared(self, node: ast.AST, op: type[ast.cmpop], a: Value, b: Value) -> Value:
        """One comparison; known where the intervals settle it."""
        if op not in SIGNS:
            raise outside_language(node, f"the comparison {op.__name__}", "use < <= > >= == != in")
        if "float" in (a.kind, b.kind):
            a, b, _ = self.met(node, *beside_single(op, a, b))
            return truth(f"{in_brackets(a, UNARY)} {SIGNS[op]} {in_brackets(b, UNARY)}")
        if a.kind == b.kind == "bool" and a.truth is None and b.truth is None:
            return truth(f"{in_brackets(a, UNARY)} {SIGNS[op]} {in_brackets(b, UNARY)}")
        a, b = as_whole(a), as_whole(b)
        if not a.kind == b.kind == "int":
            raise outside_language(node, f"a comparison of {a.kind} and {b.kind}", "compare numbers")
        settled = None if a.acts or b.acts else _settled(op, a, b)
        if settled is not None:
            return decided(settled)
        beside = a if b.literal and b.lo >= 0 else b if a.literal and a.lo >= 0 else None
        if beside is not None and beside.ctype in UNSIGNED:
            a, b = (unsigned(one) if one.literal else one for one in (a, b))
        elif beside is not None and beside.lo >= 0 and RANK[beside.ctype] < 32:
            pass
        elif not {a.ctype, b.ctype} <= UNSIGNED or (a.ctype != b.ctype and (a.is_composite or b.is_composite)):
            bits = 64 if RANK[a.ctype] == 64 or RANK[b.ctype] == 64 else bits_of(a.lo, a.hi, b.lo, b.hi)
            _, (a, b) = self.brought_to(bits, a, b)
        return truth(f"{in_brackets(a, UNARY)} {SIGNS[op]} {in_brackets(b, UNARY)}")


def beside_single(op: type[ast.cmpop], a: Value, b: Value) -> tuple[Value, Value]:
    """Both sides of a comparison: a number beside a single as the next single on the side that keeps its truth.

    Where no single is equal to it, ``==`` stays one of doubles.
    """
    if b.is_single and a.given is not None and not a.is_single:
        b, a = beside_single(FLIPPED[op], b, a)
        return a, b
    if not a.is_single or b.given is None or b.is_single:
        return a, b
    near = Single(b.given)
    if near == b.given:
        return a, as_single_number(b.given)
    if op in (ast.Eq, ast.NotEq):
        return a, b
    upward = op in (ast.Lt, ast.GtE)  # x < c holds for the same singles as x < the least single above c
    if (near < b.given) == upward:
        near = float(np.nextafter(np.float32(near), np.float32(math.inf if upward else -math.inf)))
    return a, as_single_number(near)


def array_of(table: Table, kind: str) -> Value:
    """A table, as an array of registers or as a signal."""
    return Value(
        kind=kind, text=table.name, width=table.width, length=table.length, element=table.element, within=table.within
    )


def _settled(op: type[ast.cmpop], a: Value, b: Value) -> bool | None:
    """Truth of a comparison that the intervals settle."""
    if op in (ast.Gt, ast.GtE):
        a, b, op = b, a, ast.Lt if op is ast.Gt else ast.LtE
    if op is ast.Lt:
        return True if a.hi < b.lo else False if a.lo >= b.hi else None
    if op is ast.LtE:
        return True if a.hi <= b.lo else False if a.lo > b.hi else None
    same = True if a.lo == a.hi == b.lo == b.hi else False if a.hi < b.lo or b.hi < a.lo else None
    return same if op is ast.Eq or same is None else not same
