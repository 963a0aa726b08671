"""Calls: of other steps, and of the few functions that a step may use."""

import ast
import builtins
import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from detent.kernel import compiled, single
from detent.translate.expressions import Expressions
from detent.translate.values import (
    HIGHEST,
    LOWEST,
    RefusedError,
    Value,
    as_truth,
    as_whole,
    join,
    number,
    outside_language,
    real,
    truth,
    type_of_local,
    whole,
    widen,
    wider,
)


class Calls(Expressions):
    """Everything that is called."""

    def e_Call(self, node: ast.Call) -> Value:  # noqa: N802 - as the syntax tree has it
        """A step, or a function that is known."""
        if node.keywords or any(isinstance(one, ast.Starred) for one in node.args):
            raise outside_language(node, "keywords or a star in a call", "hand the arguments over in their order")
        called = self.program.called(self.f, node)
        if called is None:
            got = f"a call of {ast.unparse(node.func)}"
            raise RefusedError("FW03", node, got, "a step", "make it one, or an input")
        if hasattr(called, "py_func") or called in self.program.steps:
            return self._step(node, getattr(called, "py_func", called))
        known = KNOWN.get(called)
        if known is not None:
            return known(self, node)
        if getattr(called, "__module__", "") == "math":
            got = f"{called.__name__} of the C library"
            raise RefusedError("FW04", node, got, "sqrt, floor", "a table, or a routine of our own")
        raise RefusedError("FW03", node, f"a call of {ast.unparse(node.func)}", "a step", "make it one, or an input")

    def _step(self, node: ast.Call, target: Callable[..., Any]) -> Value:
        g = self.program.function(target)
        self.f.calls.add(target)
        if self.final:
            self.f.reaches.add(target)
        if len(node.args) != len(g.parameters):
            raise outside_language(node, f"{len(node.args)} arguments", f"hand over {len(g.parameters)}")
        values = self.ordered(node.args)
        args = {name: self._argument(node, g, name, value) for name, value in zip(g.parameters, values, strict=True)}
        text = f"{g.cname}({', '.join(args[name] for name in self.program.arguments(g))})"
        if self.program.writes(self.f, node):
            self.written()
        if g.result_kind == "int":
            made = g.result
            return (
                whole(text, "int", 0, 0)
                if made is None
                else replace(made, text=text, ctype=type_of_local(made), literal=False)
            )
        if g.result_kind == "bool":
            return truth(text, 0)
        if g.result_kind == "float":
            return real(text, ctype=g.result.ctype if g.result is not None else "double" if self.final else "float")
        return Value(kind=g.result_kind, text=text, registers=g.result_class)

    def _argument(self, node: ast.Call, g: Any, name: str, value: Value) -> str:
        wanted: Value | None = g.names[name]
        if value.kind in ("file", "signal"):
            same = wanted is not None and (wanted.kind, wanted.registers, wanted.width) == (
                value.kind, value.registers, value.width,
            )  # fmt: skip
            if not same:
                raise outside_language(node, f"{ast.unparse(node)}, whose {name} is another", "hand over what it takes")
            return value.text
        if name in g.reals:
            return self._real_argument(node, g, name, value)
        if wanted is not None and wanted.kind == "bool":
            return as_truth(value).text
        value = as_whole(value)
        if value.kind != "int" or (wanted is not None and wanted.kind != "int"):
            raise outside_language(node, f"{value.kind} for {name}", "hand over what it takes")
        made = join(wanted, whole(name, "", value.lo, value.hi))
        made = replace(widen(wanted, made) if self.program.widens else made, text=name)
        made = replace(made, ctype=type_of_local(made))
        if wanted is None or (made.lo, made.hi) != (wanted.lo, wanted.hi):
            if g.entry:
                raise outside_language(node, f"{value.lo} to {value.hi} for {name} of an entry", "widen its annotation")
            g.names[name] = made
            self.program.changed = True
        # An entry takes the width of its declaration, any other step a type to compute in.
        return self.cast(value, wanted.ctype if g.entry and wanted is not None else type_of_local(g.names[name])).text

    def _real_argument(self, node: ast.Call, g: Any, name: str, value: Value) -> str:
        """A float as the step takes it: of the precision in which all calls hand it over."""
        value = as_whole(value)
        if value.kind not in ("int", "float"):
            raise outside_language(node, f"{value.kind} for {name}", "hand over what it takes")
        before: Value | None = g.names[name]
        given = value.ctype if value.kind == "float" else ""
        ctype = wider(before.ctype if before is not None else "", given)
        if before is None or before.ctype != ctype:
            g.names[name] = real(name, ctype=ctype)
            self.program.changed = True
        if self.final and given == "float" and ctype != "float":
            got = f"a single for {name}, of {g.py.__name__}, which is a double elsewhere"
            raise outside_language(node, got, "hand over one precision, or float(x)")
        return self.in_float(value, ctype).text

    # ---- functions that are known

    def _whole_of(self, node: ast.Call) -> Value:
        """The argument of what gives a whole number."""
        value = self._one(node)
        if value.is_single:
            raise outside_language(node, f"{ast.unparse(node)} of a single", "write float(x) in it")
        return value

    def _one(self, node: ast.Call) -> Value:
        if len(node.args) != 1:
            raise outside_language(node, f"{len(node.args)} arguments", "hand over one")
        return self.expr(node.args[0])

    def k_sqrt(self, node: ast.Call) -> Value:
        """Square root, which is rounded correctly everywhere."""
        value = self._one(node)
        if value.is_single:
            raise outside_language(node, "math.sqrt of a single", "use that of kernel.single")
        return real(f"sqrt({self.as_real(value).text})")

    def k_sqrt_alike(self, node: ast.Call) -> Value:
        """The same in the precision of its argument."""
        value = self._one(node)
        return real(f"sqrtf({value.text})", ctype="float") if value.is_single else real(f"sqrt({value.text})")

    def k_alike(self, node: ast.Call) -> Value:
        """A number in the precision of another one."""
        if len(node.args) != 2:
            raise outside_language(node, f"{len(node.args)} arguments", "hand over a model and a number")
        model, value = self.ordered(node.args)
        if model.kind != "float" or model.acts:
            raise outside_language(node, f"a model {ast.unparse(node.args[0])}", "name a register or a variable")
        return self.in_float(as_whole(value), model.ctype)

    def k_floor(self, node: ast.Call) -> Value:
        """Whole number below."""
        value = self._whole_of(node)
        if value.kind != "float":
            return as_whole(value)
        self.helper("to_i64", "")
        return whole(f"{self.helper('floor', '')}({value.text})", "int64_t", LOWEST, HIGHEST)

    def k_round(self, node: ast.Call) -> Value:
        """Nearest whole number, the even one of two as near."""
        value = self._whole_of(node)
        if value.kind != "float":
            return as_whole(value)
        for one in ("to_i64", "floor"):
            self.helper(one, "")
        return whole(f"{self.helper('round', '')}({value.text})", "int64_t", LOWEST, HIGHEST)

    def k_int(self, node: ast.Call) -> Value:
        """Whole number towards zero; outside of 64 bits the nearest there is."""
        value = self._whole_of(node)
        if value.kind != "float":
            return as_whole(value)
        return whole(f"{self.helper('to_i64', '')}({value.text})", "int64_t", LOWEST, HIGHEST)

    def k_float(self, node: ast.Call) -> Value:
        """The same number as a float."""
        return self.as_real(self._one(node))

    def k_bool(self, node: ast.Call) -> Value:
        """A truth value; what is only unlikely is as true."""
        return as_truth(self._one(node))

    def k_abs(self, node: ast.Call) -> Value:
        """Magnitude."""
        value = as_whole(self._one(node))
        if value.is_single:
            return real(f"fabsf({value.text})", ctype="float")
        return real(f"fabs({value.text})") if value.kind == "float" else self.magnitude(node, value)

    def k_len(self, node: ast.Call) -> Value:
        """Length of a signal."""
        value = self._one(node)
        if value.kind != "signal":
            raise outside_language(node, "the length of no signal", "use the number")
        if value.length:
            return number(value.length)
        return whole(f"{value.text}.length", "int32_t", 0, (1 << 31) - 1)

    def _extreme(self, node: ast.Call, name: str) -> Value:
        values = [as_whole(one) for one in self.ordered(node.args)]
        if len(values) < 2:
            raise outside_language(node, f"{name} of one argument", "hand over two or more")
        if all(one.kind == "int" for one in values):
            return self.extreme(name, values)
        if not all(one.kind in ("int", "float") for one in values):
            raise outside_language(node, f"{name} of no numbers", "use numbers")
        values, ctype = self.alike(node, *values)
        text = values[0].text
        for one in values[1:]:
            text = f"{self.helper(f'{name}_f4' if ctype == 'float' else f'{name}_f8', '')}({text}, {one.text})"
        return real(text, ctype=ctype)

    def k_min(self, node: ast.Call) -> Value:
        """The least."""
        return self._extreme(node, "min")

    def k_max(self, node: ast.Call) -> Value:
        """The largest."""
        return self._extreme(node, "max")

    def k_power_of_two(self, node: ast.Call) -> Value:
        """Two to a whole power, by the bits of its exponent."""
        value = as_whole(self._one(node))
        return real(f"{self.helper('power_of_two', '')}({self.cast(value, 'int64_t').text})")

    def k_bits_of(self, node: ast.Call) -> Value:
        """The bits of a float."""
        text = f"{self.helper('bits_of', '')}({self.as_real(self._whole_of(node)).text})"
        return whole(text, "int64_t", LOWEST, HIGHEST)


KNOWN: dict[Any, Callable[[Calls, ast.Call], Value]] = {
    math.sqrt: Calls.k_sqrt,
    single.sqrt: Calls.k_sqrt_alike,
    single.alike: Calls.k_alike,
    math.floor: Calls.k_floor,
    builtins.int: Calls.k_int,
    builtins.round: Calls.k_round,
    builtins.float: Calls.k_float,
    builtins.bool: Calls.k_bool,
    builtins.abs: Calls.k_abs,
    builtins.len: Calls.k_len,
    builtins.min: Calls.k_min,
    builtins.max: Calls.k_max,
    compiled.unlikely: Calls.k_bool,
    compiled.power_of_two: Calls.k_power_of_two,
    compiled.bits_of: Calls.k_bits_of,
}
