"""How compiled code sees register files.

In compiled code a register file is the address of its memory. Reading a field widens it to int64 or float64, writing
one truncates to the field's width, exactly as plain Python on a `ctypes.Structure` does; numba's own records would
compute ``u1 - u1`` in uint64 and differ. `local_copy` moves a whole file into a stack slot, from which LLVM keeps the
fields in machine registers.
"""

import ctypes
import math
import operator
from typing import Any, get_args

import numba.extending
from llvmlite import ir
from numba.core import cgutils as untyped_cgutils
from numba.core import types
from numba.core.typing import templates as untyped_templates

from detent.kernel.registers import Registers, Width, f8, i2

# Numba's extension interface publishes no types.
extending: Any = numba.extending
templates: Any = untyped_templates
cgutils: Any = untyped_cgutils

BYTE = ir.IntType(8)
INT32 = ir.IntType(32)


class RegistersType(types.Type):
    """Numba type of one class of registers; a value is the address of the structure."""

    def __init__(self, registers: type[Registers]) -> None:
        self.registers = registers
        super().__init__(name=f"Registers({registers.__module__}.{registers.__qualname__})")


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
    length = c.builder.ptrtoint(_called(len, obj, c), ir.IntType(64))
    return _native(c.builder.insert_value(value, length, 1), c)


def _scalar_type(width: Width) -> types.Type:
    return types.float64 if width.is_float else types.int64


def _storage(width: Width) -> ir.Type:
    return ir.DoubleType() if width.is_float else ir.IntType(8 * width.size)


def _load(builder: Any, address: Any, width: Width, place: str) -> Any:
    value = builder.load(builder.bitcast(address, _storage(width).as_pointer()))
    _mark(builder, value, place)
    if width.is_float or width.size == 8:
        return value
    widen = builder.sext if width.is_signed else builder.zext
    return widen(value, ir.IntType(64))


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
    kind = module.add_metadata([ir.MetaDataString(module, place), root, ir.Constant(ir.IntType(64), 0)])
    access.set_metadata("tbaa", module.add_metadata([kind, kind, ir.Constant(ir.IntType(64), 0)]))


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


@templates.infer_global(operator.getitem)
class _ArrayRead(templates.AbstractTemplate):
    def generic(self, args: Any, _kws: Any) -> Any:
        """``array[int]`` is a wide value."""
        array, index = args
        if isinstance(array, (RegisterArrayType, HostArrayType)) and isinstance(index, types.Integer):
            return templates.signature(_scalar_type(array.width), array, types.int64)
        return None


@templates.infer_global(operator.setitem)
class _ArrayWrite(templates.AbstractTemplate):
    def generic(self, args: Any, _kws: Any) -> Any:
        """``array[int] = value`` takes a wide value."""
        array, index, _value = args
        if isinstance(array, RegisterArrayType) and isinstance(index, types.Integer):
            return templates.signature(types.none, array, types.int64, _scalar_type(array.width))
        return None


def _element_address(builder: Any, array: Any, width: Width, index: Any) -> Any:
    offset = builder.mul(index, ir.Constant(ir.IntType(64), width.size))
    return builder.gep(array, [offset], source_etype=BYTE)


@extending.lower_builtin(operator.getitem, RegisterArrayType, types.Integer)
def _read_element(_context: Any, builder: Any, sig: Any, args: Any) -> Any:
    typ = sig.args[0]
    return _load(builder, _element_address(builder, args[0], typ.width, args[1]), typ.width, str(typ))


@extending.lower_builtin(operator.getitem, HostArrayType, types.Integer)
def _read_host_array(_context: Any, builder: Any, sig: Any, args: Any) -> Any:
    typ = sig.args[0]
    address = builder.extract_value(args[0], 0)
    return _load(builder, _element_address(builder, address, typ.width, args[1]), typ.width, str(typ))


@extending.intrinsic
def host_array_length(_typingctx: Any, array: Any) -> Any:
    """Number of entries."""

    def codegen(_context: Any, builder: Any, _sig: Any, args: Any) -> Any:
        return builder.extract_value(args[0], 1)

    return types.int64(array), codegen


@extending.overload(len)
def _length(array: Any) -> Any:
    def compiled(array: Any) -> Any:
        return host_array_length(array)

    return compiled if isinstance(array, HostArrayType) else None


@extending.lower_builtin(operator.setitem, RegisterArrayType, types.Integer, types.Any)
def _write_element(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    array, index, value = args
    typ = sig.args[0]
    wide = context.cast(builder, value, sig.args[2], _scalar_type(typ.width))
    _store(builder, _element_address(builder, array, typ.width, index), typ.width, wide, str(typ))
    return context.get_dummy_value()


def _copy_memory(builder: Any, target: Any, source: Any, size: int) -> None:
    cgutils.raw_memcpy(builder, target, source, ir.Constant(ir.IntType(64), size), 1)


@extending.intrinsic
def stack_copy(_typingctx: Any, registers: Any) -> Any:
    """Copy a register file into a stack slot."""

    def codegen(_context: Any, builder: Any, sig: Any, args: Any) -> Any:
        """Reserve the slot and fill it."""
        size = ctypes.sizeof(sig.args[0].registers)
        slot = cgutils.alloca_once(builder, ir.ArrayType(ir.IntType(64), (size + 7) // 8))
        address = builder.bitcast(slot, BYTE.as_pointer())
        _copy_memory(builder, address, args[0], size)
        return address

    return registers(registers), codegen


@extending.intrinsic
def copy_over(_typingctx: Any, target: Any, source: Any) -> Any:
    """Copy one register file over another."""

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        _copy_memory(builder, args[0], args[1], ctypes.sizeof(sig.args[0].registers))
        return context.get_dummy_value()

    return types.none(target, source), codegen


@extending.intrinsic
def read_byte(_typingctx: Any, registers: Any, _offset: Any) -> Any:
    """Load one byte."""

    def codegen(_context: Any, builder: Any, _sig: Any, args: Any) -> Any:
        return builder.zext(builder.load(builder.gep(args[0], [args[1]], source_etype=BYTE)), ir.IntType(64))

    return types.int64(registers, types.int64), codegen


@extending.intrinsic
def write_byte(_typingctx: Any, registers: Any, _offset: Any, _value: Any) -> Any:
    """Store one byte."""

    def codegen(context: Any, builder: Any, _sig: Any, args: Any) -> Any:
        place = builder.gep(args[0], [args[1]], source_etype=BYTE)
        builder.store(builder.trunc(args[2], BYTE), place)
        return context.get_dummy_value()

    return types.none(registers, types.int64, types.int64), codegen


@extending.intrinsic
def shifted_one(_typingctx: Any, _exponent: Any) -> Any:
    """The float whose exponent this is: its bits alone, no call."""

    def codegen(_context: Any, builder: Any, _sig: Any, args: Any) -> Any:
        wide = ir.IntType(64)
        biased = builder.add(args[0], ir.Constant(wide, 1023))
        return builder.bitcast(builder.shl(biased, ir.Constant(wide, 52)), ir.DoubleType())

    return types.float64(types.int64), codegen


def power_of_two(exponent: int) -> float:
    """Two to a whole power from -1022 to 1023, exactly."""
    return math.ldexp(1.0, exponent)


@extending.overload(power_of_two, inline="always")
def _power_of_two(exponent: Any) -> Any:
    def compiled(exponent: Any) -> Any:
        return shifted_one(exponent)

    return compiled


@extending.intrinsic
def expect_false(_typingctx: Any, condition: Any) -> Any:
    """Hand a condition on with LLVM's hint that it seldom holds."""

    def codegen(_context: Any, builder: Any, _sig: Any, args: Any) -> Any:
        bit = ir.IntType(1)
        hint = cgutils.get_or_insert_function(builder.module, ir.FunctionType(bit, [bit, bit]), "llvm.expect.i1")
        return builder.call(hint, [args[0], ir.Constant(bit, 0)])

    return types.boolean(condition), codegen


def unlikely(condition: bool) -> bool:  # noqa: FBT001 - a condition
    """The condition itself; compiled code is laid out for the case that it does not hold."""
    return condition


@extending.overload(unlikely, inline="always")
def _unlikely(condition: Any) -> Any:
    def compiled(condition: Any) -> bool:
        return expect_false(condition)

    return compiled


def local_copy(registers: Any) -> Any:
    """Copy of a register file in a stack slot of the compiled caller (a fresh structure in plain Python)."""
    return registers.copy()


def copy_back(target: Any, source: Any) -> None:
    """Write the whole of `source` over `target` of the same class."""
    ctypes.memmove(ctypes.addressof(target), ctypes.addressof(source), ctypes.sizeof(target))


def byte_at(registers: Any, offset: int) -> int:
    """Raw byte of the register memory: what a trace copies."""
    return ctypes.c_uint8.from_buffer(registers, offset).value


def put_byte(registers: Any, offset: int, value: int) -> None:
    """Set a raw byte of the register memory: what a replay copies."""
    ctypes.c_uint8.from_buffer(registers, offset).value = value


@extending.overload(local_copy, inline="always")
def _local_copy(registers: Any) -> Any:
    def compiled(registers: Any) -> Any:
        return stack_copy(registers)

    return compiled


@extending.overload(copy_back, inline="always")
def _copy_back(target: Any, source: Any) -> Any:
    def compiled(target: Any, source: Any) -> Any:
        return copy_over(target, source)

    return compiled


@extending.overload(byte_at, inline="always")
def _byte_at_overload(registers: Any, offset: Any) -> Any:
    def compiled(registers: Any, offset: Any) -> Any:
        return read_byte(registers, offset)

    return compiled


@extending.overload(put_byte, inline="always")
def _put_byte_overload(registers: Any, offset: Any, value: Any) -> Any:
    def compiled(registers: Any, offset: Any, value: Any) -> None:
        write_byte(registers, offset, value)

    return compiled
