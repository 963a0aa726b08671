"""The control unit of an axis: what of it is firmware, and what surrounds it.

Its state is the controller and its lines; the simulation calls the very steps that are translated.
"""

import inspect
import re
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from functools import cached_property
from typing import Any, cast, get_args

from detent.axis import Axis
from detent.errors import DetentError
from detent.kernel.loop import control_of
from detent.kernel.registers import (
    Field,
    Fit,
    Leaf,
    Registers,
    Width,
    declared_of,
    f4,
    f8,
    i1,
    i2,
    i4,
    i8,
    single,
    u1,
    u2,
    u4,
)
from detent.methods.registry import METHODS
from detent.translate.program import Program, blocks_of
from detent.translate.values import C_WORDS, RefusedError, Shape, Table

NARROW = ("avr",)  # targets whose double is not IEEE binary64
WIDTHS: dict[str, Width] = {
    one.code: one for one in (get_args(hint)[1] for hint in (u1, u2, u4, i1, i2, i4, i8, f4, f8))
}
"""What an argument of a call can be."""
AS_DECLARED = Fit()
LARGE = 64  # elements of an array that enters the hash of every 1000th tick only if it has more


@dataclass(frozen=True)
class ControlUnit:
    """Steps and registers that a microcontroller runs."""

    name: str  # prefix of all names in C
    params: type[Registers]
    controller: type[Registers]
    lines: type[Registers]
    entries: Mapping[str, Callable[..., Any]]  # by their names in C: the tick first, then what the host does
    motor: str = ""  # which of several motors of the axis it moves
    fits: Callable[[Any], Fit] | None = None  # how much of its arrays some parameters use
    fit: Fit = AS_DECLARED  # how much of them it has
    axis: type[Registers] = Registers  # state of the axis of which it is a part
    arithmetic: str = "double"  # or "single"

    @cached_property
    def shape(self) -> Shape:
        """What of its registers is other in C than it is declared."""
        narrowed = {(one, name): (one.__fields__[name].width, ends) for (one, name), ends in self.fit.ranges.items()}
        return Shape(lengths=self.fit.lengths, narrowed=cast("Any", narrowed))

    def fitted(self, params: Registers, later: Sequence[Registers] = ()) -> "ControlUnit":
        """The same with arrays as long as these parameters use them; the parameters say so from then on.

        Where other sets come `later`, as long as any of them does.
        """
        if self.fits is None:
            return self
        fit = max(map(self.fits, (params, *later)), key=lambda one: sum(one.lengths.values()))
        for _, registers, declared, _ in every(params):
            if (type(registers), declared.name) in fit.values:
                setattr(registers, declared.name, fit.values[type(registers), declared.name])
        return replace(self, fit=fit)

    def as_stated(self, params: Registers) -> Registers:
        """A copy of parameters of which none says how much of an array is used: as the axis file gives them."""
        stated = params.copy()
        for _, registers, declared, _ in every(stated):
            if (type(registers), declared.name) in self.fit.values:
                setattr(registers, declared.name, 0)
        return stated

    @property
    def told_fit(self) -> dict[str, dict[str, Any]]:
        """Its fit as plain data, by the names of class and register."""
        return {
            key: {f"{one.__name__}.{name}": value for (one, name), value in getattr(self.fit, key).items()}
            for key in ("lengths", "ranges")
        }

    def fitted_as(self, told: Mapping[str, Mapping[str, Any]]) -> "ControlUnit":
        """The unit whose `told_fit` this is."""
        classes = {one.__name__: one for root in (self.params, self.controller, self.lines) for one in blocks_of(root)}

        def found(values: Mapping[str, Any]) -> dict[tuple[type[Registers], str], Any]:
            """By the classes themselves; what is gone by now is left out."""
            places = {place: place.rpartition(".") for place in values}
            return {(classes[one], name): values[place] for place, (one, _, name) in places.items() if one in classes}

        ranges = {place: tuple(ends) for place, ends in found(told["ranges"]).items()}
        return replace(self, fit=Fit(found(told["lengths"]), cast("Any", ranges)))

    @cached_property
    def calls(self) -> dict[str, tuple[str, ...]]:
        """What may be called beside the tick, by its name in C: what it takes, a class's name in C or a width."""
        roots = {self.params: "params", self.controller: "controller", self.lines: "lines"}
        return {name: tuple(arguments(step, roots)) for name, step in list(self.entries.items())[1:]}

    @property
    def begins(self) -> str:
        """Name in C of the step that puts it on."""
        return list(self.entries)[1]

    @cached_property
    def leaves(self) -> tuple[Leaf, ...]:
        """Every register of the state, controller before lines, in the order of declaration; by number in a vector."""
        return tuple(
            replace(leaf, length=seen.length, range=seen.range)
            for registers, root in ((self.controller, "c."), (self.lines, "l."))
            for leaf, (of, declared) in zip(registers.leaves(root), places_of(registers), strict=True)
            for seen in [self.shape.seen(of, declared)]
        )

    @cached_property
    def layout_hash(self) -> int:
        """Of names, widths and order of the registers, and of what may be called."""
        rows = [f"{leaf.path} {leaf.width.code} {leaf.length}" for leaf in self.leaves]
        rows += [f"{name.removeprefix(self.name)} {' '.join(taken)}" for name, taken in self.calls.items()]
        return zlib.crc32("\n".join(rows).encode())

    def translated(self, params: Registers, tunable: Sequence[str] = (), fixed: Sequence[str] = ()) -> Program:
        """The unit in C, with the options of these parameters folded in but for `tunable`, and `fixed` too."""
        roots = {self.params: "params", self.controller: "controller", self.lines: "lines"}
        shape = replace(self.shape, tables=tables_of(params, self.name, self.shape))
        return Program(self.name, self.entries, self.params, folded(params, tunable, fixed), roots, shape)


def places_of(registers: type[Registers]) -> Iterator[tuple[type[Registers], Field]]:
    """Class and declaration of every stored quantity, in the order of `Registers.leaves`."""
    for declared in registers.__fields__.values():
        if declared.block is not None:
            yield from places_of(declared.block)
        else:
            yield registers, declared


def arguments(step: Callable[..., Any], roots: Mapping[type[Registers], str]) -> Iterator[str]:
    """What a step takes: registers by the names of `roots`, a signal laid ready as "signal", numbers by their width."""
    plain, roots = getattr(step, "py_func", step), {declared_of(one): name for one, name in roots.items()}
    for name, hint in inspect.get_annotations(plain, eval_str=True).items():
        width = next((one for one in get_args(hint)[1:] if isinstance(one, Width)), None)
        if name == "return":
            continue
        if width is not None:
            yield "signal" if get_args(hint)[0] is Any else width.code
        elif hint in roots:
            yield roots[hint]
        else:
            yield {float: "f8", bool: "u1"}.get(hint, "i8")


def signal_widths(step: Callable[..., Any]) -> Iterator[Width]:
    """Widths of the elements of what a host lays ready for a step."""
    for hint in inspect.get_annotations(getattr(step, "py_func", step), eval_str=True).values():
        width = next((one for one in get_args(hint)[1:] if isinstance(one, Width)), None)
        if width is not None and get_args(hint)[0] is Any:
            yield width


def options_of(params: Registers) -> dict[tuple[type[Registers], str], float]:
    """Values of the parameters that choose a variant, where their class has one value wherever it occurs."""
    found: dict[tuple[type[Registers], str], set[float]] = {}
    for _, registers, field, value in every(params):
        if field.option:
            found.setdefault((type(registers), field.name), set()).add(value)
    return {place: values.pop() for place, values in found.items() if len(values) == 1}


def folded(
    params: Registers, tunable: Sequence[str] = (), fixed: Sequence[str] = ()
) -> dict[tuple[type[Registers], str], float]:
    """Values of the parameters that become constants: options but for `tunable`, and those of the patterns `fixed`.

    Refused: a pattern that meets none, a table, and a parameter whose class occurs elsewhere with another value.
    """
    found, paths = options_of(params), dict[tuple[type[Registers], str], list[tuple[str, Any, int]]]()
    for path, registers, field, value in every(params):
        paths.setdefault((type(registers), field.name), []).append((path, value, field.length))
    for option, patterns in (("--tunable", tunable), ("--fixed", fixed)):
        for pattern in patterns:
            places = [key for key, rows in paths.items() if any(fnmatchcase(path, pattern) for path, _, _ in rows)]
            if not places:
                raise DetentError(f"{option}: got {pattern}; expected: names of params.csv, such as law.*; correct it")
            for key in places:
                if option == "--tunable":
                    found.pop(key, None)
                else:
                    found[key] = _one_value(pattern, paths[key])
    return found


def _one_value(pattern: str, rows: Sequence[tuple[str, Any, int]]) -> float:
    """The value of a parameter that is to be a constant, wherever its class occurs."""
    others = [path for path, _, _ in rows if not fnmatchcase(path, pattern)]
    if others or rows[0][2] or len({value for _, value, _ in rows}) > 1:
        got = "a table" if rows[0][2] else f"{', '.join(f'{path} = {value}' for path, value, _ in rows)}"
        raise DetentError(
            f"--fixed {pattern}: got {got}; expected: a number that is the same wherever its class is used, all of "
            "them meant; leave it tunable, or widen the pattern"
        )
    return rows[0][1]


def tables_of(params: Registers, name: str, shape: Shape) -> dict[tuple[type[Registers], str], Table]:
    """Arrays of the parameters that are tables, where their class occurs once: constants of a unit of this name."""
    found: dict[tuple[type[Registers], str], list[Table]] = {}
    for path, registers, declared, value in every(params):
        seen = shape.seen(type(registers), declared)
        if seen.table and seen.width is not None:
            read = f"{name}_{seen.width.code}".upper() + f"({name.upper()}_TABLE({{text}}), {{index}})"
            used = value[: seen.length]
            made = Table(f"{name}_{path.replace('.', '_')}", seen.width, seen.length, (min(used), max(used)), read)
            found.setdefault((type(registers), seen.name), []).append(made)
    return {place: tables[0] for place, tables in found.items() if len(tables) == 1}


def every(registers: Registers, prefix: str = "") -> Iterator[tuple[str, Registers, Field, Any]]:
    """Every register: its path, the register file that it stands in, its declaration and its value."""
    for field, value in members(registers):
        if field.block is not None:
            yield from every(value, f"{prefix}{field.name}.")
        else:
            yield prefix + field.name, registers, field, value


def members(registers: Registers) -> Iterator[tuple[Field, Any]]:
    """Every field of a register file with what stands in it."""
    for field in type(registers).__fields__.values():
        yield field, getattr(registers, field.name)


def refuse_floats(unit: ControlUnit, target: str) -> None:
    """Refuse a unit with floats for a processor whose `double` has 32 bits (FW05): single ones meet double ones."""
    roots = {"params": unit.params, "controller": unit.controller, "lines": unit.lines}
    for root, registers in roots.items() if target in NARROW else ():
        for leaf in registers.leaves():
            if leaf.width.is_float:
                bits = 8 * leaf.width.size
                got = f"{root}.{leaf.path}, a number of {bits} bits, for {target}, whose double has 32"
                expected = "a controller of whole numbers"
                raise RefusedError("FW05", None, got, expected, "a variant in whole numbers, or another --target")


def outside_ranges(params: Registers, shape: Shape | None = None) -> Iterator[tuple[str, float, tuple[float, float]]]:
    """Parameters outside the ranges of their registers: path, value, range."""
    for path, value, claimed in ranged(params, shape or Shape()):
        if not claimed[0] <= value <= claimed[1]:
            yield path, value, claimed


def ranged(params: Registers, shape: Shape) -> Iterator[tuple[str, float, tuple[float, float]]]:
    """Every value of which a range is declared: path, value, range."""
    for path, registers, declared, value in every(params):
        seen = shape.seen(type(registers), declared)
        if seen.range is not None:
            for k, one in enumerate(value[: seen.length] if seen.length else [value]):
                yield path + (f"[{k}]" if seen.length else ""), one, seen.range


def unit_of(axis: Axis, prefix: str = "", motor: str = "") -> ControlUnit:
    """The control unit of an axis, or of one of its motors.

    Refused where its method has none (FW01), or the prefix is no name in C (FW13).
    """
    method = axis.method
    if not method.actions:
        able = ", ".join(name for name, one in METHODS.items() if one.actions)
        got = f"{axis.name}, an axis of the method {method.name}"
        raise RefusedError("FW01", None, got, f"one of {able}", "export an axis of such a method")
    motor = method.motor(axis.spec, motor)
    name = prefix or re.sub(r"\W+", "_", (motor or axis.name).lower(), flags=re.ASCII).strip("_") or "axis"
    name = name if prefix or not name[0].isdigit() else f"axis_{name}"
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", name) or name in C_WORDS:
        raise RefusedError("FW13", None, f"the prefix {name!r}", "a name in C", "name another with --prefix")
    return _unit(method, name, motor, method.arithmetic(axis.spec))


def unit_named(method: str, name: str, arithmetic: str = "double") -> ControlUnit | None:
    """The control unit of a method with this prefix; None where the method is not there, or has none."""
    found = METHODS.get(method)
    return _unit(found, name, arithmetic=arithmetic) if found is not None and found.actions else None


def _unit(method: Any, name: str, motor: str = "", arithmetic: str = "double") -> ControlUnit:
    kinds = [method.parameters(), method.registers()]
    whole, axis = map(single, kinds) if arithmetic == "single" else kinds
    params, state = whole.__fields__["controller"].block, axis.__fields__
    controller, lines = state["controller"].block, state["lines"].block
    if params is None or controller is None or lines is None:
        raise DetentError(f"the method {method.name} has no controller of its own; name another axis")
    steps = {f"{name}_control": control_of(params)}
    steps |= {f"{name}_{one}": method.brought(f"controller:{one}") for one in (*method.actions, *method.interrupts)}
    return ControlUnit(
        name, params, controller, lines, steps, motor, method.brought(method.fits) if method.fits else None,
        axis=axis, arithmetic=arithmetic,
    )  # fmt: skip
