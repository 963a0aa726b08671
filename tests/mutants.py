"""Steps as plain Python from their source, and mutants of them: the same source with one thing wrong.

Registers are declarations: what mutates is the steps and the numbers that they use.
"""

import ast
import copy
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

STEP = "detent.kernel.step"
COMPARED = {
    ast.Lt: (ast.LtE, ast.Gt), ast.LtE: (ast.Lt, ast.Gt), ast.Gt: (ast.GtE, ast.Lt), ast.GtE: (ast.Gt, ast.Lt),
    ast.Eq: (ast.NotEq,), ast.NotEq: (ast.Eq,), ast.In: (ast.NotIn,),
}  # fmt: skip
REPLACED = {
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.And: ast.Or, ast.Or: ast.And,
    ast.BitXor: ast.BitAnd,
}  # fmt: skip
NAMED = {"min": "max", "max": "min", "abs": "float"}


def source_of(*files: Path) -> ast.Module:
    """Steps of some files as one plain module, without what compiles them; the first files serve the later ones."""
    names = {STEP, *(".".join(file.with_suffix("").parts[-3:]) for file in files)}
    body = [node for file in files for node in ast.parse(file.read_text(encoding="utf-8")).body]
    body = [node for node in body if not (isinstance(node, ast.ImportFrom) and node.module in names)]
    for node in body:
        if isinstance(node, ast.FunctionDef):
            node.decorator_list = []
    return ast.Module(body, [])


def load(source: ast.Module) -> SimpleNamespace:
    """What the module holds."""
    space = {"__name__": "plain"}
    exec(compile(ast.fix_missing_locations(source), "plain", "exec"), space)  # noqa: S102 - the project's own source
    return SimpleNamespace(**space)


def changed(node: ast.AST, **fields: object) -> ast.AST:
    """The node with other fields."""
    new = copy.copy(node)
    for name, value in fields.items():
        setattr(new, name, value)
    return new


def changes(node: ast.AST) -> Iterator[tuple[str, ast.AST]]:
    """What could be wrong with an expression, and the expression with that."""
    match node:
        case ast.Compare(ops=ops):
            for k, op in enumerate(ops):
                for other in COMPARED[type(op)]:
                    yield other.__name__, changed(node, ops=[*ops[:k], other(), *ops[k + 1 :]])
        case ast.BinOp(op=op) | ast.BoolOp(op=op) | ast.AugAssign(op=op) if type(op) in REPLACED:
            yield REPLACED[type(op)].__name__, changed(node, op=REPLACED[type(op)]())
        case ast.UnaryOp(op=ast.USub() | ast.Not()):
            yield "without its sign", node.operand
        case ast.Constant(value=bool()):
            yield "the other truth", changed(node, value=not node.value)
        case ast.Constant(value=int() | float()):
            yield "another number", changed(node, value=node.value * 2 or type(node.value)(1))
        case ast.Call(func=ast.Name(id=name)) if name in NAMED:
            yield NAMED[name], changed(node, func=ast.Name(NAMED[name], ast.Load()))


def lacks(node: ast.AST) -> Iterator[tuple[str, ast.AST]]:
    """What could be wrong with a statement or a condition as a whole, and what stands there then."""
    if isinstance(node, ast.If | ast.IfExp):
        yield "negated", changed(node, test=ast.UnaryOp(ast.Not(), node.test))
    done = isinstance(node, ast.Expr) and not isinstance(node.value, ast.Constant)
    leaves = isinstance(node, ast.Return) and node.value is None
    if done or leaves or isinstance(node, ast.Assign | ast.AugAssign):
        yield "removed", ast.Pass()


def sites(tree: ast.AST) -> Iterator[tuple[ast.AST, str, int | None]]:
    """Every place of a node below this one: its parent, the field, and the place in the field's list."""
    for name, value in ast.iter_fields(tree):
        for k, child in enumerate(value) if isinstance(value, list) else [(None, value)]:
            if isinstance(child, ast.AST) and not isinstance(child, ast.ClassDef | ast.arguments | ast.Import):
                yield tree, name, k
                yield from sites(child)


def mutants(source: ast.Module) -> Iterator[tuple[str, ast.Module]]:
    """Each module with one thing wrong, and what that is. The tree is put right when the next one is asked for."""
    for k, top in enumerate(source.body):
        where = getattr(top, "name", "top")
        for parent, name, at in [(source, "body", k), *sites(top)] if not isinstance(top, ast.ClassDef) else ():
            held = getattr(parent, name)
            node = held if at is None else held[at]
            for what, other in (*changes(node), *lacks(node)):
                put(parent, name, at, ast.copy_location(other, node))
                yield f"{where}:{getattr(node, 'lineno', 0)}: {what}: {ast.unparse(node)}", source
                put(parent, name, at, node)


def put(parent: ast.AST, name: str, k: int | None, node: ast.AST) -> None:
    """Place a node."""
    if k is None:
        setattr(parent, name, node)
    else:
        getattr(parent, name)[k] = node
