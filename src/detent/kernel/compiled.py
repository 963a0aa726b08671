"""How compiled code sees register files.

In compiled code a register file is the address of its memory. Reading a field widens it to int64 or float64, writing
one truncates to the field's width, exactly as plain Python on a `ctypes.Structure` does; numba's own records would
compute ``u1 - u1`` in uint64 and differ. `local_copy` moves a whole file into a stack slot, from which LLVM keeps the
fields in machine registers.
"""

import ctypes
import math
import operator
import struct
from collections.abc import Callable
from typing import Any, get_args

import numba.extending
from llvmlite import ir
from numba.core import cgutils as untyped_cgutils
from numba.core import types
from numba.core.typing import templates as untyped_templates

from detent.kernel.registers import Registers, Width, declared_of, f8, i2, single

# Numba's extension interface publishes no types.
extending: Any = numba.extending
templates: Any = untyped_templates
cgutils: Any = untyped_cgutils

BYTE = ir.IntType(8)
INT32, WORD = ir.IntType(32), ir.IntType(64)
FLOAT, DOUBLE = ir.FloatType(), ir.DoubleType()


class RegistersType(types.Type):
    """Numba type of one class of registers; a value is the address of the structure."""

    def __init__(self, registers: type[Registers]) -> None:
        self.registers = registers
        super().__init__(name=f"Registers({registers.__module__}.{registers.__qualname__})")

    def __reduce__(self) -> Any:
        """By its declaration: a class that `single` made has no name in its module."""
        return _type_of, (declared_of(self.registers), self.registers.__declared__ is not None)


def _type_of(registers: type[Registers], singly: bool) -> RegistersType:  # noqa: FBT001 - as it is kept
    return RegistersType(single(registers) if singly else registers)


class SingleType(types.Type):
    """Numba type of a `Single`; its own float32 beside a whole number would be a float64."""

    def __init__(self) -> None:
        super().__init__(name="single")

    def unify(self, typingctx: Any, other: Any) -> Any:
        """What a variable is that is one here and another there: as an operator between both gives it."""
        del typingctx
        if isinstance(other, types.Integer | types.Boolean):
            return self
        return types.float64 if isinstance(other, types.Float) else None


single_type = SingleType()


class RegisterArrayType(types.Type):
    """Numba type of an array field; a value is the address of its first element."""

    def __init__(self, width: Width, length: int) -> None:
        self.width = width
        self.length = length
        super().__init__(name=f"RegisterArray({width.code} x {length})")


class HostArrayType(types.Type):
    """Numba type of an array of the host, as ctypes shows it; a value is its address and length.

    Unlike a numpy array it is not counted as a reference whenever a step hands it on, which took longer than a tick.
    """

    def __init__(self, width: Width) -> None:
        self.width = width
        super().__init__(name=f"HostArray({width.code})")


@extending.register_model(HostArrayType)
class _HostArrayModel(extending.models.StructModel):
    def __init__(self, manager: Any, typ: Any) -> None:
        model: Any = super()
        model.__init__(manager, typ, [("address", types.voidptr), ("length", types.int64)])


extending.register_model(RegistersType)(extending.models.OpaqueModel)
extending.register_model(RegisterArrayType)(extending.models.OpaqueModel)


@extending.typeof_impl.register(Registers)
def _typeof_registers(value: Registers, _context: Any) -> RegistersType:
    return RegistersType(type(value))


@extending.typeof_impl.register(ctypes.Array)
def _typeof_host_array(value: Any, _context: Any) -> HostArrayType | None:
    kind: Any = value.__class__
    width = _HOST_WIDTHS.get(kind._type_)
    return None if width is None else HostArrayType(width)


# What a host lays ready: table entries and signals.
_HOST_WIDTHS: dict[Any, Width] = {part.ctype: part for part in (get_args(i2)[1], get_args(f8)[1])}


def _called(function: Any, obj: Any, c: Any) -> Any:
    """What a function of Python gives for an object when a compiled loop is entered: an address or a length."""
    called = c.pyapi.unserialize(c.pyapi.serialize_object(function))
    number = c.pyapi.call_function_objargs(called, (obj,))
    value = c.pyapi.long_as_voidptr(number)
    c.pyapi.decref(number)
    c.pyapi.decref(called)
    return value


def _native(value: Any, c: Any) -> Any:
    return extending.NativeValue(value, is_error=cgutils.is_not_null(c.builder, c.pyapi.err_occurred()))


@extending.unbox(RegistersType)
def _unbox_registers(_typ: RegistersType, obj: Any, c: Any) -> Any:
    """The address of the structure; the caller's reference keeps the memory alive during the call."""
    return _native(_called(ctypes.addressof, obj, c), c)


@extending.unbox(HostArrayType)
def _unbox_host_array(typ: HostArrayType, obj: Any, c: Any) -> Any:
    """Address and length; the caller's reference keeps the memory alive during the call."""
    value = c.context.get_constant_undef(typ)
    value = c.builder.insert_value(value, _called(ctypes.addressof, obj, c), 0)
    length = c.builder.ptrtoint(_called(len, obj, c), WORD)
    return _native(c.builder.insert_value(value, length, 1), c)


def _scalar_type(width: Width) -> types.Type:
    if width.is_float:
        return single_type if width.size == 4 else types.float64
    return types.int64


def _storage(width: Width) -> ir.Type:
    if width.is_float:
        return FLOAT if width.size == 4 else DOUBLE
    return ir.IntType(8 * width.size)


def _load(builder: Any, address: Any, width: Width, place: str) -> Any:
    value = builder.load(builder.bitcast(address, _storage(width).as_pointer()))
    _mark(builder, value, place)
    if width.is_float or width.size == 8:
        return value
    widen = builder.sext if width.is_signed else builder.zext
    return widen(value, WORD)


def _store(builder: Any, address: Any, width: Width, value: Any, place: str) -> None:
    if not width.is_float and width.size < 8:
        value = builder.trunc(value, _storage(width))
    _mark(builder, builder.store(value, builder.bitcast(address, _storage(width).as_pointer())), place)


def _mark(builder: Any, access: Any, place: str) -> None:
    """Tell LLVM that fields of different names or classes never share memory (type-based alias analysis).

    So it keeps a field in a machine register while others are written, as in C where the structures are distinct.
    """
    module = builder.module
    root = module.add_metadata([ir.MetaDataString(module, "detent registers")])
    kind = module.add_metadata([ir.MetaDataString(module, place), root, ir.Constant(WORD, 0)])
    access.set_metadata("tbaa", module.add_metadata([kind, kind, ir.Constant(WORD, 0)]))


def _place(registers: type[Registers], attr: str) -> str:
    """Name of a field's memory: that of the class which declares it."""
    owner = next(c for c in registers.__mro__ if attr in vars(c).get("__fields__", ()))
    return f"{owner.__module__}.{owner.__qualname__}.{attr}"


def _field_address(builder: Any, base: Any, offset: int) -> Any:
    return builder.gep(base, [ir.Constant(INT32, offset)], source_etype=BYTE)


@templates.infer_getattr
class _RegistersAttributes(templates.AttributeTemplate):
    key = RegistersType

    def generic_resolve(self, value: RegistersType, attr: str) -> types.Type | None:
        """A field reads as int64, float64, an array of these, or the nested file."""
        field = value.registers.__fields__.get(attr)
        if field is None:
            return None
        if field.block is not None:
            return RegistersType(field.block)
        if field.width is not None and field.length:
            return RegisterArrayType(field.width, field.length)
        return _scalar_type(field.width) if field.width is not None else None


@extending.lower_getattr_generic(RegistersType)
def _read_field(_context: Any, builder: Any, typ: RegistersType, value: Any, attr: str) -> Any:
    field = typ.registers.__fields__[attr]
    address = _field_address(builder, value, field.offset)
    if field.width is None or field.length:
        return address
    return _load(builder, address, field.width, _place(typ.registers, attr))


@extending.lower_setattr_generic(RegistersType)
def _write_field(context: Any, builder: Any, sig: Any, args: Any, attr: str) -> None:
    target, value = args
    field = sig.args[0].registers.__fields__[attr]
    wide = context.cast(builder, value, sig.args[1], _scalar_type(field.width))
    place = _place(sig.args[0].registers, attr)
    _store(builder, _field_address(builder, target, field.offset), field.width, wide, place)


def compiles(function: Any, gives: types.Type | Callable[[Any], Any], *kinds: Any) -> Any:
    """What is decorated writes the instructions of a call of `function` with arguments of these kinds.

    It takes whole numbers as int64, the rest as it comes; `gives` is the type of the result, or finds it from that of
    the first argument.
    """

    def register(instructions: Any) -> Any:
        """Tell numba the types of the function, and the instructions that stand for its call."""

        @templates.infer_global(function)
        class _Typing(templates.AbstractTemplate):  # pyright: ignore[reportUnusedClass] - numba keeps it
            def generic(self, args: Any, _kws: Any) -> Any:
                """The signature; None where the call is somebody else's."""
                if len(args) != len(kinds) or not all(map(isinstance, args, kinds)):
                    return None
                taken = (types.int64 if isinstance(one, types.Integer) else one for one in args)
                return templates.signature(gives if isinstance(gives, types.Type) else gives(args[0]), *taken)

        return extending.lower_builtin(function, *kinds)(instructions)

    return register


def _element_address(builder: Any, array: Any, width: Width, index: Any) -> Any:
    offset = builder.mul(index, ir.Constant(WORD, width.size))
    return builder.gep(array, [offset], source_etype=BYTE)


@compiles(operator.getitem, lambda array: _scalar_type(array.width), RegisterArrayType, types.Integer)
def _read_element(_context: Any, builder: Any, sig: Any, args: Any) -> Any:
    typ = sig.args[0]
    return _load(builder, _element_address(builder, args[0], typ.width, args[1]), typ.width, str(typ))


@compiles(operator.getitem, lambda array: _scalar_type(array.width), HostArrayType, types.Integer)
def _read_host_array(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    return _read_element(context, builder, sig, (builder.extract_value(args[0], 0), args[1]))


@compiles(len, types.int64, HostArrayType)
def _length(_context: Any, builder: Any, _sig: Any, args: Any) -> Any:
    return builder.extract_value(args[0], 1)


@compiles(operator.setitem, types.none, RegisterArrayType, types.Integer, types.Type)
def _write_element(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    array, index, value = args
    typ = sig.args[0]
    wide = context.cast(builder, value, sig.args[2], _scalar_type(typ.width))
    _store(builder, _element_address(builder, array, typ.width, index), typ.width, wide, str(typ))
    return context.get_dummy_value()


@compiles(operator.setitem, types.none, HostArrayType, types.Integer, types.Type)
def _write_host_array(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    return _write_element(context, builder, sig, (builder.extract_value(args[0], 0), *args[1:]))


def _copy_memory(builder: Any, target: Any, source: Any, size: int) -> None:
    cgutils.raw_memcpy(builder, target, source, ir.Constant(WORD, size), 1)


def local_copy(registers: Any) -> Any:
    """Copy of a register file in a stack slot of the compiled caller (a fresh structure in plain Python)."""
    return registers.copy()


@compiles(local_copy, lambda registers: registers, RegistersType)
def _local_copy(_context: Any, builder: Any, sig: Any, args: Any) -> Any:
    size = ctypes.sizeof(sig.args[0].registers)
    slot = cgutils.alloca_once(builder, ir.ArrayType(WORD, (size + 7) // 8))
    address = builder.bitcast(slot, BYTE.as_pointer())
    _copy_memory(builder, address, args[0], size)
    return address


def copy_back(target: Any, source: Any) -> None:
    """Write the whole of `source` over `target` of the same class."""
    ctypes.memmove(ctypes.addressof(target), ctypes.addressof(source), ctypes.sizeof(target))


@compiles(copy_back, types.none, RegistersType, RegistersType)
def _copy_back(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    _copy_memory(builder, args[0], args[1], ctypes.sizeof(sig.args[0].registers))
    return context.get_dummy_value()


def nth(registers: Any, index: int) -> Any:
    """The register file so many places behind this one in an array of them."""
    kind: Any = registers.__class__
    return kind.from_address(ctypes.addressof(registers) + index * ctypes.sizeof(kind))


@compiles(nth, lambda registers: registers, RegistersType, types.Integer)
def _nth(_context: Any, builder: Any, sig: Any, args: Any) -> Any:
    size = ir.Constant(WORD, ctypes.sizeof(sig.args[0].registers))
    return builder.gep(args[0], [builder.mul(args[1], size)], source_etype=BYTE)


def byte_at(registers: Any, offset: int) -> int:
    """Raw byte of the register memory: what a trace copies."""
    return ctypes.c_uint8.from_buffer(registers, offset).value


@compiles(byte_at, types.int64, RegistersType, types.Integer)
def _byte_at(_context: Any, builder: Any, _sig: Any, args: Any) -> Any:
    return builder.zext(builder.load(builder.gep(args[0], [args[1]], source_etype=BYTE)), WORD)


def put_byte(registers: Any, offset: int, value: int) -> None:
    """Set a raw byte of the register memory: what a replay copies."""
    ctypes.c_uint8.from_buffer(registers, offset).value = value


@compiles(put_byte, types.none, RegistersType, types.Integer, types.Integer)
def _put_byte(context: Any, builder: Any, _sig: Any, args: Any) -> Any:
    place = builder.gep(args[0], [args[1]], source_etype=BYTE)
    builder.store(builder.trunc(args[2], BYTE), place)
    return context.get_dummy_value()


def power_of_two(exponent: int) -> float:
    """Two to a whole power from -1022 to 1023, exactly; compiled, the bits of its exponent alone, no call."""
    return math.ldexp(1.0, exponent)


@compiles(power_of_two, types.float64, types.Integer)
def _power_of_two(_context: Any, builder: Any, _sig: Any, args: Any) -> Any:
    biased = builder.add(args[0], ir.Constant(WORD, 1023))
    return builder.bitcast(builder.shl(biased, ir.Constant(WORD, 52)), ir.DoubleType())


def bits_of(value: float) -> int:
    """The eight bytes of a float as a whole number."""
    return int.from_bytes(struct.pack("<d", value), "little", signed=True)


@compiles(bits_of, types.int64, types.Float)
def _bits_of(_context: Any, builder: Any, _sig: Any, args: Any) -> Any:
    return builder.bitcast(args[0], WORD)


def unlikely(condition: bool) -> bool:  # noqa: FBT001 - a condition
    """The condition itself; compiled code is laid out for the case that it does not hold."""
    return condition


@compiles(unlikely, types.boolean, types.Boolean)
def _unlikely(_context: Any, builder: Any, _sig: Any, args: Any) -> Any:
    bit = ir.IntType(1)
    hint = cgutils.get_or_insert_function(builder.module, ir.FunctionType(bit, [bit, bit]), "llvm.expect.i1")
    return builder.call(hint, [args[0], ir.Constant(bit, 0)])
