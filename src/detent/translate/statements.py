"""Statements: one line of C for one of Python, in the same order."""

import ast
import re
from dataclasses import replace
from typing import Any

from detent.kernel.registers import Width
from detent.translate.calls import Calls
from detent.translate.known import Facts
from detent.translate.values import (
    ATOM,
    INTEGERS,
    UNARY,
    RefusedError,
    Value,
    as_truth,
    as_whole,
    in_brackets,
    interval_of,
    join,
    number,
    outside_language,
    real,
    type_of_local,
    unsigned,
    whole,
    widen,
    wider,
)

ZERO = {"float": "0.0", "bool": "false", "file": "NULL", "int": "0"}


def targets_of(node: ast.AST) -> list[ast.expr]:
    """What a statement assigns to."""
    found: list[ast.expr] = []
    if isinstance(node, ast.Assign):
        found = node.targets
    elif isinstance(node, ast.AugAssign | ast.AnnAssign | ast.For):
        found = [node.target]
    return [one for target in found for one in (target.elts if isinstance(target, ast.Tuple) else [target])]


def names_written(body: list[ast.stmt]) -> set[str]:
    """Variables that a block assigns to."""
    every = (node for one in body for node in ast.walk(one))
    return {t.id for node in every for t in targets_of(node) if isinstance(t, ast.Name)}


def places_in(node: ast.AST) -> set[str]:
    """Variables and, by the last part of their names, registers that stand in an expression."""
    every = list(ast.walk(node))
    registers = {f".{one.attr}" for one in every if isinstance(one, ast.Attribute)}
    return registers | {one.id for one in every if isinstance(one, ast.Name)}


def leaves_off(body: list[ast.stmt]) -> bool:
    """True for a block behind which nothing of its surroundings comes."""
    return bool(body) and isinstance(body[-1], ast.Return | ast.Break | ast.Continue)


class Statements(Calls):
    """The body of a step."""

    def run(self, body: list[ast.stmt]) -> None:
        """Translate a body."""
        self.declared = set(self.f.parameters)
        for name in self.f.hoisted:
            value = self.f.names.get(name)
            if value is not None:
                self.declared.add(name)
                zero = "0.0f" if value.is_single else ZERO[value.kind]
                self.line(f"{self.declaration(value, name)} = {zero};")
        self.block(body)
        text = "\n".join(self.lines)
        unused = [name for name in self.program.arguments(self.f) if not re.search(rf"\b{name}\b", text)]
        self.lines[:0] = [f"    (void){name};" for name in unused]

    def block(self, body: list[ast.stmt]) -> None:
        """Translate the statements of a block; those behind its end are never reached."""
        for one in body:
            method = getattr(self, f"s_{type(one).__name__}", None)
            try:
                if method is None:
                    raise outside_language(
                        one, f"the statement {type(one).__name__}", "write it with what a step may hold"
                    )
                method(one)
            except RefusedError as refused:
                refused.node = refused.node if getattr(refused.node, "lineno", 0) else one
                raise
            if leaves_off([one]):
                break

    def inside(self, body: list[ast.stmt]) -> Facts:
        """Translate a block within braces; what is known at its end."""
        declared = set(self.declared)
        self.depth += 1
        self.block(body)
        self.depth -= 1
        self.declared = declared
        return self.facts

    def declaration(self, value: Value, name: str) -> str:
        """Declaration of a variable."""
        if value.kind == "file" and value.registers is not None:
            const = "const " if value.registers in self.program.fixed else ""
            return f"{const}{self.program.struct(value.registers)} *{name}"
        return f"{type_of_local(value)} {name}"

    # ---- simple ones

    def s_Pass(self, node: ast.Pass) -> None:  # noqa: N802 - as the syntax tree has it
        """Nothing."""

    def s_Break(self, node: ast.Break) -> None:  # noqa: N802
        """Leave a loop."""
        del node
        self.line("break;")

    def s_Continue(self, node: ast.Continue) -> None:  # noqa: N802
        """Begin its next turn."""
        del node
        self.line("continue;")

    def s_Expr(self, node: ast.Expr) -> None:  # noqa: N802
        """A call for what it does."""
        value = self.expr(node.value)
        self.flush()
        self.line(f"{'' if value.kind == 'none' else '(void)'}{value.text};")

    def s_Return(self, node: ast.Return) -> None:  # noqa: N802
        """The result."""
        if node.value is None:
            self.line("return;")
            return
        value, kind = self.expr(node.value), self.f.result_kind
        if kind == "bool":
            value = as_truth(value)
        elif kind == "float":
            value = self._returned(value)
        elif kind == "int":
            value = as_whole(value)
        if value.kind != kind:
            raise outside_language(node, f"a result of kind {value.kind}", f"return what is announced, {kind}")
        if kind == "int":
            old = self.f.result
            made = join(old, replace(value, text="", level=ATOM, literal=False, of=None))
            made = widen(old, made) if self.program.widens else made
            if old is None or (old.lo, old.hi) != (made.lo, made.hi):
                self.f.result, self.program.changed = made, True
            value = self.cast(value, type_of_local(made))
        self.flush()
        self.line(f"return {value.text};")

    def _returned(self, value: Value) -> Value:
        """A float as the result: a single where all that is returned are singles, or whole numbers."""
        value, old = as_whole(value), self.f.result
        if value.kind == "float":
            ctype = wider(old.ctype if old is not None else "", value.ctype)
            if old is None or old.ctype != ctype:
                self.f.result, self.program.changed = real("", ctype=ctype), True
        if value.kind not in ("int", "float"):
            return value
        return self.in_float(value, self.f.result.ctype if self.f.result is not None else "double")

    # ---- branches and loops

    def s_If(self, node: ast.If) -> None:  # noqa: N802
        """``if``, ``elif``, ``else``; a branch that is never taken is left out."""
        test = as_truth(self.expr(node.test))
        self.flush()
        self._branch(node, test, "if")

    def _branch(self, node: ast.If, test: Value, word: str) -> None:
        if test.truth is not None:
            body = node.body if test.truth else node.orelse
            if word == "if":
                self.block(body)
                return
            self.line("} else {")
            if body:
                self.inside(body)
            else:
                self.line("    /* nothing */")
            self.line("}")
            return
        self.line(f"{word} ({test.text}) {{")
        before = self.facts.copy()
        self.suppose(node.test, holds=True)
        after = self.inside(node.body)
        self.facts = before
        self.suppose(node.test, holds=False)
        if len(node.orelse) == 1 and isinstance(node.orelse[0], ast.If):
            self._else_if(node.orelse[0])
        else:
            if node.orelse:
                self.line("} else {")
                self.inside(node.orelse)
            elif word != "if":
                self.line("} else {")
                self.line("    /* nothing */")
            self.line("}")
        if leaves_off(node.orelse) and not leaves_off(node.body):
            self.facts = after
        elif not leaves_off(node.body):
            self.facts = self.facts.either(after)

    def _else_if(self, node: ast.If) -> None:
        test = as_truth(self.expr(node.test))
        if not self.pre:
            self._branch(node, test, "} else if")
            return
        self.line("} else {")
        self.depth += 1
        self.flush()
        self._branch(node, test, "if")
        self.depth -= 1
        self.line("}")

    def s_While(self, node: ast.While) -> None:  # noqa: N802
        """``while``, with the bound that is declared for it."""
        if node.orelse:
            raise outside_language(node, "else of a loop", "write it behind the loop")
        bound = getattr(self.f.py, "__bounded__", None)
        if bound is None:
            raise RefusedError("FW07", node, "a loop without a bound", "one with", "state it: @bounded(turns, why)")
        self.looped(names_written(node.body))
        begin = self.facts.copy()
        test = as_truth(self.expr(node.test))
        if self.pre:
            raise RefusedError(
                "FW10", node, "a call that writes beside what reads", "one of them", "split the condition"
            )
        self._bound(node, f"at most {bound[0]} turns: {bound[1]}")
        self.line(f"while ({test.text}) {{")
        self.suppose(node.test, holds=True)
        self.inside(node.body)
        self.line("}")
        self.facts = begin
        if not any(isinstance(one, ast.Break) for stmt in node.body for one in ast.walk(stmt)):
            self.suppose(node.test, holds=False)

    def _bound(self, node: ast.AST, text: str) -> None:
        """Note how often a loop turns."""
        if self.final:
            self.program.notes.loops.add((self.f.where(node), text))

    def s_For(self, node: ast.For) -> None:  # noqa: N802
        """``for`` over a range, or over a tuple of numbers."""
        if node.orelse or not isinstance(node.target, ast.Name):
            raise outside_language(node, "a loop with else, or over several names", "use one name")
        self.looped(names_written(node.body) | {node.target.id})
        begin = self.facts.copy()
        name = node.target.id if node.target.id != "_" else self.temporary()
        if isinstance(node.iter, ast.Call) and getattr(node.iter.func, "id", "") == "range":
            self._count(node, name, [as_whole(self.expr(one)) for one in node.iter.args])
        else:
            self._run_over(node, name)
        self.facts = begin
        self.declared.discard(name)

    def _count(self, node: ast.For, name: str, ends: list[Value]) -> None:
        if len(ends) > 2 or any(one.kind != "int" for one in ends):
            raise outside_language(node, ast.unparse(node.iter), "use range(stop) or range(start, stop)")
        start, stop = ends if len(ends) == 2 else (number(0), ends[0])
        lo, hi = start.lo, max(start.lo, stop.hi - 1)
        self._bound(node, f"at most {max(0, stop.hi - start.lo)} turns: {ast.unparse(node.iter)}")
        counter = self.note(name, whole(name, "", min(lo, stop.lo), stop.hi))
        ctype = type_of_local(counter)
        text = in_brackets(stop, UNARY)
        if not stop.is_constant:
            end = self.temporary()
            self.pre.append(f"const {ctype} {end} = {self.cast(stop, ctype).text};")
            text = end
        self.flush()
        self.line(f"for ({ctype} {name} = {self.cast(start, ctype).text}; {name} < {text}; {name}++) {{")
        self.declared.add(name)
        self.facts.bounds[name] = (lo, hi)
        self.inside(node.body)
        self.line("}")

    def _run_over(self, node: ast.For, name: str) -> None:
        if isinstance(node.iter, ast.Tuple):
            items = [self.expr(one) for one in node.iter.elts]
        else:
            known: Any = self.f.globals.get(node.iter.id) if isinstance(node.iter, ast.Name) else None
            items = [number(one) for one in known] if isinstance(known, tuple) else []  # pyright: ignore[reportUnknownArgumentType, reportUnknownVariableType]
        if not items or not all(one.is_constant for one in items):
            raise outside_language(
                node, f"a loop over {ast.unparse(node.iter)}", "use range, or a tuple of whole numbers"
            )
        value = self.note(name, whole(name, "", min(one.lo for one in items), max(one.hi for one in items)))
        self._bound(node, f"{len(items)} turns: {ast.unparse(node.iter)}")
        ctype, array, k = type_of_local(value), self.temporary(), self.temporary()
        self.line(f"static const {ctype} {array}[{len(items)}] = {{{', '.join(one.text for one in items)}}};")
        self.line(f"for (int32_t {k} = 0; {k} < {len(items)}; {k}++) {{")
        self.line(f"    const {ctype} {name} = {array}[{k}];")
        self.declared.add(name)
        self.inside(node.body)
        self.line("}")

    # ---- stores

    def s_Assign(self, node: ast.Assign) -> None:  # noqa: N802
        """``a = b = x``, and ``a, b = x, y``."""
        target = node.targets[0]
        if isinstance(target, ast.Tuple):
            self._unpack(node, target)
            return
        value = self.expr(node.value)
        if len(node.targets) > 1 and value.level > ATOM:
            value = self.keep(value)
        self.flush()
        for one in node.targets:
            self.store(one, value)

    def _unpack(self, node: ast.Assign, target: ast.Tuple) -> None:
        if len(node.targets) > 1 or not isinstance(node.value, ast.Tuple) or len(target.elts) != len(node.value.elts):
            raise outside_language(node, "a tuple on one side only", "write as many values as names")
        values = self.ordered(node.value.elts)
        written = [one.value if isinstance(one, ast.Subscript) else one for one in target.elts]
        left = {f".{one.attr}" if isinstance(one, ast.Attribute) else ast.unparse(one) for one in written}
        right = places_in(node.value)
        calls = any(isinstance(one, ast.Call) for one in ast.walk(node.value))
        if left & right or (calls and len(values) > 1):
            values = [self.keep(one) for one in values]
        self.flush()
        for one, value in zip(target.elts, values, strict=True):
            self.store(one, value)

    def s_AugAssign(self, node: ast.AugAssign) -> None:  # noqa: N802
        """``a += x``."""
        loaded = ast.parse(ast.unparse(node.target), mode="eval").body
        made = ast.copy_location(ast.BinOp(left=loaded, op=node.op, right=node.value), node)
        value = self.expr(ast.fix_missing_locations(made))
        self.flush()
        self.store(node.target, value)

    def note(self, name: str, value: Value) -> Value:
        """A variable holds this value, too; what it is in all."""
        old = self.f.names.get(name)
        made = join(old, replace(value, text=name, level=ATOM, truth=None, literal=False, of=None))
        made = widen(old, made) if self.program.widens else made
        if made.kind == "int":
            made = replace(made, ctype=type_of_local(made))
        if made.kind == "float":
            made = replace(made, given=None)
        grown = old is None or (old.kind, old.lo, old.hi) != (made.kind, made.lo, made.hi)
        if old is None or grown or (made.kind == "float" and old.ctype != made.ctype):
            self.program.changed = True
        made = self.f.names[name] = replace(made, text=name)
        return made

    def store(self, target: ast.expr, value: Value) -> None:
        """Write a variable or a register."""
        if value.kind in ("none", "array", "signal"):
            raise outside_language(target, f"an assignment of kind {value.kind}", "assign a number or an alias")
        if isinstance(target, ast.Name):
            self._store_local(target, value)
            return
        if isinstance(target, ast.Attribute):
            base = self.expr(target.value)
            written = base.registers
            field = written.__fields__.get(target.attr) if written else None
            if written is None or field is None or field.width is None or field.length:
                raise outside_language(target, f"a store to {ast.unparse(target)}", "store to single registers")
            if self._is_settled(target, written, value):
                return
            place = self.member(base, target.attr)
            width, claimed = self.program.stored(written, field)
        elif isinstance(target, ast.Subscript):
            array, index = self.expr(target.value), self.expr(target.slice)
            self.check_index(target, array, index)
            if array.kind == "signal" or array.width is None:
                raise outside_language(target, f"a store to {ast.unparse(target)}", "store to registers")
            place, width, claimed, written = f"{array.text}[{index.text}]", array.width, array.within, None
        else:
            raise outside_language(target, f"a store to {ast.unparse(target)}", "store to names and registers")
        if written in self.program.fixed:
            raise outside_language(
                target, f"a store to a parameter, {ast.unparse(target)}", "store to a state register"
            )
        if not self.f.stores:
            self.f.stores = self.program.changed = True
        self.line(f"{place} = {self.narrowed(value, width, claimed, target)};")
        self.stored(place, self._fitting(value, width))

    def _is_settled(self, target: ast.Attribute, written: Any, value: Value) -> bool:
        """True for a store to a register of the state that is a constant here: it must be that one."""
        fixed = self.program.options.get((written, target.attr))
        if fixed is None or written in self.program.fixed:
            return False
        if not (value.is_constant and value.lo == fixed):
            raise outside_language(target, f"a store to {target.attr}, which is {fixed} here", "store nothing else")
        return True

    def _store_local(self, target: ast.Name, value: Value) -> None:
        value = value if value.kind != "int" or value.ctype else replace(value, ctype=type_of_local(value))
        have = self.note(target.id, value)
        if have.kind == "int":
            text = self.cast(as_whole(value), type_of_local(have)).text
        elif have.kind == "float":
            if self.final and value.kind == "float" and value.ctype != have.ctype:
                got = f"{target.id} for single and for double precision"
                raise outside_language(target, got, "use two names, or alike(model, value)")
            text = self.in_float(value, have.ctype).text
        else:
            text = value.text
        if target.id in self.declared:
            if text != target.id:  # what is left of a choice that was folded
                self.line(f"{target.id} = {text};")
        else:
            self.declared.add(target.id)
            self.line(f"{self.declaration(have, target.id)} = {text};")
        self.stored(target.id, value)

    def _fitting(self, value: Value, width: Width) -> Value:
        """What a register reads after a store, where that is known."""
        value = as_whole(value)
        lo, hi = interval_of(width) if not width.is_float else (0, 0)
        return (
            value if value.kind == "int" and lo <= value.lo and value.hi <= hi else real("")
        )  # of which nothing is known

    def narrowed(self, value: Value, width: Width, claimed: tuple[float, float] | None, node: ast.AST) -> str:
        """Text of a value as a register takes it: wrapped to its width; a claim that is not proven can be checked."""
        if width.is_float:
            return self.in_float(value, width.c_name).text
        given, value = value, as_whole(value)
        if value.kind != "int":
            raise outside_language(node, "a float in an integer register", "write int()")
        ctype = INTEGERS[width.code]
        lo, hi = interval_of(width)
        if not (lo <= value.lo and value.hi <= hi) and self.final:
            self.program.notes.wraps.add((self.f.where(node), f"a store that may wrap: {ast.unparse(node)}"))
        if claimed is not None and not claimed[0] <= value.lo <= value.hi <= claimed[1]:
            if self.final:
                self.program.notes.claims.add((self.f.where(node), f"the range of {ast.unparse(node)}"))
            if not self.program.shape.checks:
                return value.text if value.ctype == ctype else self.converted(value, ctype).text
            text = f"{self.helper('claimed', '')}({value.text}, {number(int(claimed[0])).text}, "
            return f"({ctype}){text}{number(int(claimed[1])).text})"
        if given.kind == "bool" and given.truth is None:
            return f"{in_brackets(given, UNARY)} ? {'1 : 0' if width.is_signed else '1U : 0U'}"
        if value.literal and lo <= value.lo <= hi:
            return value.text if width.is_signed else unsigned(value).text
        return self._in_width(value, width)

    def _in_width(self, value: Value, width: Width) -> str:
        """Text of an integer in a width: as it is, wrapped, or cast where it fits, or wraps without a sign."""
        ctype, (lo, hi) = INTEGERS[width.code], interval_of(width)
        if value.ctype == ctype:
            return value.text
        if width.is_signed and width.size < 8 and not (lo <= value.lo and value.hi <= hi):
            made = self.modular(value, 16 if width.size < 4 else 32)
            return f"{self.helper(f'wrap_{width.code}', '')}({made.text})"
        return self.converted(value, ctype).text
