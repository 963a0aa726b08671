"""All steps that some entries reach: their types and intervals to a fixed point, then their text, callees first."""

import ast
import builtins
import inspect
import re
import textwrap
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, get_args

import detent
from detent.kernel.registers import Field, Registers, Width, declared_of, i8
from detent.translate.expressions import array_of
from detent.translate.statements import Statements, names_written, targets_of
from detent.translate.values import (
    C_WORDS,
    INTEGERS,
    UNSIGNED_NAME,
    Notes,
    RefusedError,
    Shape,
    Value,
    bits_of,
    interval_of,
    number,
    real,
    truth,
    type_of_local,
    unsigned,
    whole,
)

TURNS, EXACT = 60, 24  # turns over the program at most, and of these the ones in which intervals grow as they are
PACKAGE = Path(detent.__file__).parent
KINDS = {"bool": "bool", "float": "double", "none": "void"}


Kinds = Mapping[type[Registers], type[Registers]]  # by the class of the annotations, the one that is translated


def snake(name: str) -> str:
    """Name of a class as a name in C.

    >>> snake("CascadeLawParams")
    'cascade_law_params'
    """
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name).lower()


class _Renamer(ast.NodeTransformer):
    """Names that are words of C get an underscore."""

    def __init__(self, own: set[str]) -> None:
        self.own = own

    def visit_Name(self, node: ast.Name) -> ast.Name:
        """Of a variable."""
        node.id = f"{node.id}_" if node.id in self.own else node.id
        return node

    def visit_arg(self, node: ast.arg) -> ast.arg:
        """Of a parameter."""
        node.arg = f"{node.arg}_" if node.arg in self.own else node.arg
        return node


class Function:
    """One step: its text in Python, and what is known of its parameters, variables and result."""

    def __init__(self, py: Callable[..., Any], cname: str, kinds: Kinds, *, entry: bool) -> None:
        self.py, self.cname, self.entry, self.kinds = py, cname, entry, kinds
        lines, self.first = inspect.getsourcelines(py)
        self.source = textwrap.dedent("".join(lines))
        tree = ast.parse(self.source).body[0]
        if not isinstance(tree, ast.FunctionDef):
            raise RefusedError("FW02", tree, "no function with a name", "a step", "write def")
        own = {a.arg for a in tree.args.args} | names_written(tree.body)
        hints = inspect.get_annotations(py, eval_str=True)
        self.file = Path(inspect.getsourcefile(py) or "")
        if tree.args.vararg or tree.args.kwonlyargs or tree.args.defaults:
            raise RefusedError("FW02", tree, "a star, keywords or defaults", "plain parameters", "write them out")
        self.globals: Mapping[str, Any] = {**vars(builtins), **inspect.getmodule(py).__dict__}
        originals = [a.arg for a in tree.args.args]
        self.tree: ast.FunctionDef = _Renamer(own & C_WORDS).visit(tree)
        self.parameters = [a.arg for a in self.tree.args.args]
        self.reals = set[str]()  # parameters that are floats
        self.names: dict[str, Value | None] = {
            name: self._parameter(name, hints.get(original))
            for name, original in zip(self.parameters, originals, strict=True)
        }
        hint = hints.get("return")
        self.result_class: type[Registers] | None = (
            self.kinds.get(hint, hint) if isinstance(hint, type) and issubclass(hint, Registers) else None
        )
        results: dict[Any, str] = {None: "none", type(None): "none", bool: "bool", float: "float", int: "int"}
        self.result_kind = "file" if self.result_class else results.get(hint, "")
        if not self.result_kind:
            raise RefusedError("FW02", tree, f"a result {hint}", "int, float, bool, registers or None", "store it")
        self.result: Value | None = None
        self.assigned = names_written(self.tree.body)
        body = self.tree.body
        self.doc = ast.get_docstring(self.tree) or ""
        self.body = body[1:] if self.doc else body
        self.hoisted = hoisted(self.body, self.parameters)
        self.calls: set[Callable[..., Any]] = set()  # in any turn over the program
        self.reaches: set[Callable[..., Any]] = set()  # in what is left of it in C
        self.stores = False

    def _parameter(self, name: str, hint: Any) -> Value | None:
        if isinstance(hint, type) and issubclass(hint, Registers):
            return Value(kind="file", text=name, registers=self.kinds.get(hint, hint))
        width = next((one for one in get_args(hint)[1:] if isinstance(one, Width)), None)
        if width is not None and get_args(hint)[0] is Any:
            return Value(kind="signal", text=name, width=width)
        if width is not None and not width.is_float:
            return whole(name, INTEGERS[width.code], *interval_of(width))
        if hint is int:
            return whole(name, "int64_t", *interval_of(get_args(i8)[1])) if self.entry else None
        if hint is float or (width is not None and width.is_float):
            self.reals.add(name)
            return real(name) if self.entry else None
        if hint is bool:
            return truth(name, 0)
        raise RefusedError("FW02", None, f"{name}: {hint}", "registers, int, float, bool or a signal", "annotate it so")

    @property
    def line(self) -> int:
        """Line of its ``def``."""
        return self.first + self.tree.lineno - 1

    @property
    def place(self) -> str:
        """File and line, from the package on."""
        file = self.file.resolve()
        inside = file.relative_to(PACKAGE.parent).as_posix() if file.is_relative_to(PACKAGE.parent) else file.name
        return f"{inside}:{self.line}"

    def where(self, node: ast.AST | None) -> str:
        """File and line of a part of it."""
        return f"{self.place.rpartition(':')[0]}:{self.first + getattr(node, 'lineno', 1) - 1}"


def hoisted(body: list[ast.stmt], parameters: Sequence[str]) -> list[str]:
    """Variables that are used outside of the block in which they are first assigned: they are declared on top."""
    uses: dict[str, list[tuple[Any, ...]]] = {}
    firsts: dict[str, tuple[tuple[Any, ...], bool]] = {}

    def walk(block: list[ast.stmt], path: tuple[Any, ...]) -> None:
        """Note where each name first gets a value, by the path of branches that leads there."""
        for k, one in enumerate(block):
            parts = [("b", one.body), ("e", one.orelse)] if isinstance(one, ast.If | ast.While | ast.For) else []
            own: list[ast.AST] = [one]
            if isinstance(one, ast.If | ast.While):
                own = [one.test]
            elif isinstance(one, ast.For):
                own = [one.iter]
            for name in (x.id for part in own for x in ast.walk(part) if isinstance(x, ast.Name)):
                uses.setdefault(name, []).append(path)
            for t in targets_of(one):
                if isinstance(t, ast.Name) and t.id not in parameters and not isinstance(one, ast.For):
                    firsts.setdefault(t.id, (path, isinstance(one, ast.AugAssign)))
            for tag, part in parts:
                walk(part, (*path, k, tag))

    walk(body, ())
    return [
        name
        for name, (path, adds) in firsts.items()
        if adds or any(use[: len(path)] != path for use in uses.get(name, []))
    ]


class Program:
    """The steps that `entries`, by their names in C, reach; refused with file and line where C cannot have them.

    `options` are values of parameters that become constants, by class and name of the register; `roots` names in C of
    classes of registers that are not those of the classes. All names begin with `name`.
    """

    def __init__(  # noqa: PLR0913 - what is translated, and what of it is other in C
        self,
        name: str,
        entries: Mapping[str, Callable[..., Any]],
        params: type[Registers] | None = None,
        options: Mapping[tuple[type[Registers], str], float] | None = None,
        roots: Mapping[type[Registers], str] | None = None,
        shape: Shape | None = None,
    ) -> None:
        self.name, self.options, self.roots = name, dict(options or {}), dict(roots or {})
        self.shape = shape or Shape()
        self.kinds: Kinds = {declared_of(one): one for root in (*self.roots, *([params] if params else []))
                             for one in blocks_of(root)}  # fmt: skip
        self.steps: dict[Callable[..., Any], Function] = {}
        self.notes = Notes()
        self.changed, self.widens = False, False
        self.fixed = blocks_of(params) if params else set[type[Registers]]()
        self.structs: dict[str, type[Registers]] = {}
        for cname, entry in entries.items():
            self.function(getattr(entry, "py_func", entry), cname)
        self._settle()
        self._refuse_recursion()
        self.notes = Notes()
        self.texts: dict[Callable[..., Any], str] = {}
        waiting = [f for f in self.steps.values() if f.entry]
        for f in waiting:
            if f.py not in self.texts:
                self.texts[f.py] = self._text(f)
                waiting += [self.steps[g] for g in f.reaches]
        self.order = self._callees_first()
        self._sign_constants()

    # ---- what a translation asks for

    def function(self, py: Callable[..., Any], cname: str = "") -> Function:
        """The step that is this function of Python."""
        if py not in self.steps:
            taken = {f.cname for f in self.steps.values()}
            made = cname or self.shape.names.get(py, f"{self.name}_{py.__name__}")
            if made in taken:
                made = f"{self.name}_{py.__module__.rpartition('.')[2]}_{py.__name__}"
            if made in taken:
                raise RefusedError("FW13", None, f"two functions {made}", "names that differ", "rename a step")
            try:
                self.steps[py] = f = Function(py, made, self.kinds, entry=bool(cname))
                for name, value in f.names.items():
                    if value is not None and value.kind == "signal":
                        f.names[name] = self._signal(name, value)
            except RefusedError as refused:
                raise refused.at(f"{py.__module__}.{py.__qualname__}") from None
            self.changed = True
        return self.steps[py]

    def _signal(self, name: str, value: Value) -> Value:
        """A signal that an argument is: a table of its own, or what the host lays ready."""
        table = self.shape.laid.get(name)
        if table is not None:
            return array_of(table, "signal")
        eight = value.width is not None and value.width.size == 8
        read = (
            "{text}.at[{index}]"
            if eight or value.width is None
            else (f"{self.name.upper()}_{value.width.code.upper()}({{text}}.at, {{index}})")
        )
        return replace(value, element=read)

    def arguments(self, f: Function) -> list[str]:
        """Parameters of a step that its function in C has: of what is a constant here nothing is handed over."""
        found: list[str] = []
        for name in f.parameters:
            value = f.names[name]
            if value is None or not (
                (value.kind == "signal" and value.length)
                or (value.kind == "file" and value.registers is not None and self.is_folded(value.registers))
            ):
                found.append(name)
        return found

    def width(self, registers: type[Registers], field: Field) -> Width | None:
        """Width of a register in C."""
        return self.shape.narrowed.get((registers, field.name), (field.width, None))[0]

    def stored(self, registers: type[Registers], field: Field) -> tuple[Width, tuple[float, float] | None]:
        """Width of a register, and the range of what is ever stored there."""
        if field.width is None:
            raise RefusedError("FW02", None, f"{field.name}, which has no width", "a register", "declare one")
        return self.shape.narrowed.get((registers, field.name), (field.width, field.range))

    def called(self, f: Function, node: ast.Call) -> Any:
        """What a call calls; None for what is no name of the module."""
        if isinstance(node.func, ast.Attribute) and isinstance(node.func.value, ast.Name):
            return getattr(f.globals.get(node.func.value.id), node.func.attr, None)
        if isinstance(node.func, ast.Name) and node.func.id not in f.names:
            return f.globals.get(node.func.id)
        return None

    def writes(self, f: Function, node: ast.Call) -> bool:
        """True for a call that writes registers, itself or by what it calls."""
        called = self.called(f, node)
        target = self.steps.get(getattr(called, "py_func", called)) if callable(called) else None
        return target is not None and self._writes(target, set())

    def _writes(self, f: Function, seen: set[Any]) -> bool:
        if f.stores:
            return True
        seen.add(f.py)
        return any(g not in seen and self._writes(self.steps[g], seen) for g in f.calls)

    def constant(self, name: str, value: float, text: str) -> str:
        """Name in C of a number of a module."""
        made = f"{self.name.upper()}_{self.shape.constants.get(name, name).lstrip('_').upper()}"
        known = self.notes.constants
        while known.get(made, (value,))[0] != value:
            made += "_"
        known[made] = (value, text)
        return made

    def struct(self, registers: type[Registers]) -> str:
        """Name in C of a class of registers."""
        made = f"{self.name}_{self.roots.get(registers) or snake(declared_of(registers).__name__)}"
        if self.structs.setdefault(made, registers) is not registers:
            raise RefusedError(
                "FW13", None, f"two structures {made}", "names that differ", "rename a class of registers"
            )
        return made

    def is_folded(self, registers: type[Registers]) -> bool:
        """True for a class of which no register is left in the structure."""
        return all(
            self.is_folded(field.block) if field.block else self._is_elsewhere(registers, field)
            for field in registers.__fields__.values()
        )

    def fields(self, registers: type[Registers]) -> list[Field]:
        """Fields of a class that its structure in C has."""
        return [
            self.shape.seen(registers, field)
            for field in registers.__fields__.values()
            if not (self.is_folded(field.block) if field.block else self._is_elsewhere(registers, field))
        ]

    def _is_elsewhere(self, registers: type[Registers], field: Field) -> bool:
        """True for a register that is a constant in C, or a table."""
        return (registers, field.name) in self.options or (registers, field.name) in self.shape.tables

    def _sign_constants(self) -> None:
        """A number that only stands beside what has no sign has none itself; one that is nowhere is left out."""
        every = "\n".join(self.texts.values())
        used = {name for name, mark in re.findall(rf"\b([A-Z]\w*)({UNSIGNED_NAME})?", every) if not mark}
        marked = set(re.findall(rf"\b([A-Z]\w*){UNSIGNED_NAME}", every))
        alone = set[str]() if self.shape.storage else marked - used  # a header has its own numbers
        constants = self.notes.constants
        for name, (value, _) in list(constants.items()):
            if name in alone:
                constants[name] = (value, unsigned(number(value)).text)
            elif name not in used | marked:
                del constants[name]

        def resolved(found: re.Match[str]) -> str:
            """The constant by its name, converted where it is signed elsewhere."""
            name = found[1]
            wide = "uint32_t" if bits_of(constants[name][0]) > 16 else "unsigned"
            return name if name in alone else f"({wide}){name}"

        for py, text in self.texts.items():
            self.texts[py] = re.sub(rf"\b([A-Z]\w*){UNSIGNED_NAME}", resolved, text)

    # ---- to a fixed point

    def _settle(self) -> None:
        """Go over all steps until no interval grows any more."""
        for turn in range(TURNS):
            self.changed, self.widens = False, turn >= EXACT
            for f in list(self.steps.values()):
                if all(f.names[name] is not None for name in f.parameters):
                    self._translated(f, final=False)
            if not self.changed:
                return
        raise RefusedError(
            "FW02", None, f"intervals that still grow after {TURNS} turns", "ones that end", "add a range"
        )

    def _translated(self, f: Function, *, final: bool) -> Statements:
        made = Statements(self, f, final=final)
        try:
            made.run(f.body)
        except RefusedError as refused:
            raise refused.at(f.where(refused.node)) from None
        return made

    def _refuse_recursion(self) -> None:
        def visit(f: Function, path: tuple[Function, ...]) -> None:
            """Follow the calls of a step; one that is on the path already calls itself."""
            if f in path:
                cycle = " -> ".join(one.py.__name__ for one in (*path[path.index(f) :], f))
                refused = RefusedError("FW06", None, f"recursion: {cycle}", "calls that end", "write a loop")
                raise refused.at(f.place)
            for g in f.calls:
                visit(self.steps[g], (*path, f))

        for f in self.steps.values():
            visit(f, ())

    # ---- text

    def signature(self, f: Function) -> str:
        """Head of a function."""
        if f.result_kind == "int":
            result = "int" if f.result is None else type_of_local(f.result)
        elif f.result_class is not None:
            result = f"{self.struct(f.result_class)} *"
        else:
            result = f.result.ctype if f.result_kind == "float" and f.result is not None else KINDS[f.result_kind]
        parts: list[str] = []
        for name in self.arguments(f):
            value = f.names[name]
            if value is None:  # only what is called has a text, and then it is known
                continue
            if value.kind == "file" and value.registers is not None:
                const = "const " if value.registers in self.fixed else ""
                parts.append(f"{const}{self.struct(value.registers)} *{name}")
            elif value.kind == "signal" and value.width is not None:
                parts.append(f"{self.name}_{value.width.code}_signal {name}")
            else:
                parts.append(f"{value.ctype if f.entry else type_of_local(value)} {name}")
        hot = self.shape.storage or ("" if f.entry else "static ")
        return f"{hot}{result}{'' if result.endswith('*') else ' '}{f.cname}({', '.join(parts) or 'void'})"

    def _text(self, f: Function) -> str:
        made = self._translated(f, final=True)
        doc = [f" * {line}".rstrip() for line in f.doc.replace("*/", "* /").splitlines()]
        head = "\n".join([f"/* {f.place} {f.py.__name__}", " *", *doc, " */"])
        return f"{head}\n{self.signature(f)}\n{{\n" + "\n".join(made.lines) + "\n}\n"

    def _callees_first(self) -> list[Function]:
        order: list[Function] = []

        def visit(py: Callable[..., Any]) -> None:
            """Put a step behind those that it calls."""
            f = self.steps[py]
            if f in order:
                return
            for g in sorted(f.reaches, key=lambda one: self.steps[one].cname):
                visit(g)
            order.append(f)

        for f in self.steps.values():
            if f.entry:
                visit(f.py)
        return order


def blocks_of(registers: type[Registers]) -> set[type[Registers]]:
    """A class of registers, and those of all blocks in it."""
    inner = (field.block for field in registers.__fields__.values() if field.block is not None)
    return {registers}.union(*(blocks_of(one) for one in inner))
