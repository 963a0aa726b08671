"""How compiled code computes with a `Single`: in LLVM's float, by the rules of `kernel.single`."""

import builtins
import operator as untyped_operator
import struct
from typing import Any

import numba.extending
from llvmlite import ir
from numba.core import cgutils as untyped_cgutils
from numba.core import types as untyped_types

from detent.kernel import single as single_module
from detent.kernel.compiled import DOUBLE, FLOAT, INT32, WORD, SingleType, compiles, single_type
from detent.kernel.single import Single, alike

extending: Any = numba.extending  # they publish no types
types: Any = untyped_types
operator: Any = untyped_operator
cgutils: Any = untyped_cgutils

NUMBERS = (types.Integer, types.Boolean, types.Float)
OPERATORS: dict[str, tuple[Any, Any]] = {
    "fadd": (operator.add, operator.iadd), "fsub": (operator.sub, operator.isub), "fmul": (operator.mul, operator.imul),
    "fdiv": (operator.truediv, operator.itruediv),
}  # fmt: skip
COMPARISONS = {
    operator.lt: "<", operator.le: "<=", operator.gt: ">", operator.ge: ">=", operator.eq: "==", operator.ne: "!=",
}  # fmt: skip


@extending.register_model(SingleType)
class _SingleModel(extending.models.PrimitiveModel):
    def __init__(self, manager: Any, typ: Any) -> None:
        model: Any = super()
        model.__init__(manager, typ, FLOAT)


@extending.typeof_impl.register(Single)
def _typeof_single(_value: Single, _context: Any) -> SingleType:
    return single_type


@extending.unbox(SingleType)
def _unbox_single(_typ: SingleType, obj: Any, c: Any) -> Any:
    wide = c.pyapi.float_as_double(obj)
    return extending.NativeValue(
        c.builder.fptrunc(wide, FLOAT), is_error=cgutils.is_not_null(c.builder, c.pyapi.err_occurred())
    )


@extending.box(SingleType)
def _box_single(_typ: SingleType, value: Any, c: Any) -> Any:
    number = c.pyapi.float_from_double(c.builder.fpext(value, DOUBLE))
    kind = c.pyapi.unserialize(c.pyapi.serialize_object(Single))
    made = c.pyapi.call_function_objargs(kind, (number,))
    c.pyapi.decref(number)
    c.pyapi.decref(kind)
    return made


# ---- conversions


@extending.lower_cast(SingleType, types.Float)
def _to_float(context: Any, builder: Any, _of: Any, to: Any, value: Any) -> Any:
    return context.cast(builder, builder.fpext(value, DOUBLE), types.float64, to)


@extending.lower_cast(types.Float, SingleType)
def _from_float(context: Any, builder: Any, of: Any, _to: Any, value: Any) -> Any:
    return builder.fptrunc(context.cast(builder, value, of, types.float64), FLOAT)


@extending.lower_cast(types.Integer, SingleType)
@extending.lower_cast(types.Boolean, SingleType)
def _from_whole(context: Any, builder: Any, of: Any, _to: Any, value: Any) -> Any:
    return builder.sitofp(context.cast(builder, value, of, types.int64), FLOAT)


@extending.lower_cast(types.IntegerLiteral, SingleType)
@extending.lower_cast(types.BooleanLiteral, SingleType)
def _from_literal(context: Any, builder: Any, of: Any, to: Any, value: Any) -> Any:
    plain = types.unliteral(of)
    return _from_whole(context, builder, plain, to, context.cast(builder, value, of, plain))


def _joint(kinds: Any) -> Any:
    """Type in which two numbers of these kinds meet, of which one is a `Single`."""
    return types.float64 if types.Float in kinds else single_type


def _brought(context: Any, builder: Any, sig: Any, args: Any) -> list[Any]:
    """Two numbers in the type in which they meet."""
    to = types.float64 if any(isinstance(one, types.Float) for one in sig.args) else single_type
    return [context.cast(builder, one, of, to) for one, of in zip(args, sig.args, strict=True)]


# ---- operators


def _operator(function: Any, instruction: str, kinds: tuple[Any, Any]) -> None:
    @compiles(function, _joint(kinds), *kinds)
    def _instructions(context: Any, builder: Any, sig: Any, args: Any) -> Any:  # pyright: ignore[reportUnusedFunction] - numba keeps it
        return getattr(builder, instruction)(*_brought(context, builder, sig, args))


def _comparison(function: Any, sign: str, kinds: tuple[Any, Any]) -> None:
    @compiles(function, types.boolean, *kinds)
    def _instructions(context: Any, builder: Any, sig: Any, args: Any) -> Any:  # pyright: ignore[reportUnusedFunction] - as above
        compare = builder.fcmp_unordered if sign == "!=" else builder.fcmp_ordered
        return compare(sign, *_brought(context, builder, sig, args))


def _extreme(function: Any, sign: str, kinds: tuple[Any, Any]) -> None:
    @compiles(function, _joint(kinds), *kinds)
    def _instructions(context: Any, builder: Any, sig: Any, args: Any) -> Any:  # pyright: ignore[reportUnusedFunction] - as above
        first, second = _brought(context, builder, sig, args)
        return builder.select(builder.fcmp_ordered(sign, second, first), second, first)


for _kinds in (
    (SingleType, SingleType),
    *((SingleType, one) for one in NUMBERS),
    *((one, SingleType) for one in NUMBERS),
):
    for _instruction, _functions in OPERATORS.items():
        for _function in _functions:
            _operator(_function, _instruction, _kinds)
    for _function, _sign in COMPARISONS.items():
        _comparison(_function, _sign, _kinds)
    _extreme(builtins.min, "<", _kinds)
    _extreme(builtins.max, ">", _kinds)


@compiles(operator.neg, single_type, SingleType)
def _negative(_context: Any, builder: Any, _sig: Any, args: Any) -> Any:
    return builder.fneg(args[0])


def _called(builder: Any, name: str, value: Any) -> Any:
    """A function of LLVM that takes and gives a number of one precision."""
    return builder.call(builder.module.declare_intrinsic(name, [value.type]), [value])


@compiles(builtins.abs, single_type, SingleType)
def _magnitude(_context: Any, builder: Any, _sig: Any, args: Any) -> Any:
    return _called(builder, "llvm.fabs", args[0])


@compiles(builtins.bool, types.boolean, SingleType)
def _truth(_context: Any, builder: Any, _sig: Any, args: Any) -> Any:
    return builder.fcmp_unordered("!=", args[0], ir.Constant(FLOAT, 0.0))


@compiles(builtins.float, types.float64, SingleType)
def _float(_context: Any, builder: Any, _sig: Any, args: Any) -> Any:
    return builder.fpext(args[0], DOUBLE)


def _first(kind: Any) -> Any:
    """The type of the first argument."""
    return kind


def single_bits_of(value: float) -> int:
    """The four bytes of the nearest `Single` as a whole number without a sign."""
    return int.from_bytes(struct.pack("<f", Single(value)), "little")


@compiles(single_bits_of, types.int64, types.Float)
def _single_bits_of(_context: Any, builder: Any, _sig: Any, args: Any) -> Any:
    return builder.zext(builder.bitcast(builder.fptrunc(args[0], FLOAT), INT32), WORD)


for _kind in (SingleType, types.Float):

    @compiles(single_module.sqrt, _first, _kind)
    def _sqrt(_context: Any, builder: Any, _sig: Any, args: Any) -> Any:
        return _called(builder, "llvm.sqrt", args[0])

    for _value in (SingleType, *NUMBERS):

        @compiles(alike, _first, _kind, _value)
        def _alike(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            return context.cast(builder, args[1], sig.args[1], sig.args[0])
