"""How compiled code sees register files.

In compiled code a register file is the address of its memory. Reading a field widens it to int64 or float64, writing
one truncates to the field's width, exactly as plain Python on a `ctypes.Structure` does; numba's own records would
compute ``u1 - u1`` in uint64 and differ. `local_copy` moves a whole file into a stack slot, from which LLVM keeps the
fields in machine registers.
"""

import ctypes
import operator
from typing import Any

import numba.extending
from llvmlite import ir
from numba.core import cgutils as untyped_cgutils
from numba.core import types
from numba.core.typing import templates as untyped_templates

from detent.kernel.registers import Registers, Width

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


extending.register_model(RegistersType)(extending.models.OpaqueModel)
extending.register_model(RegisterArrayType)(extending.models.OpaqueModel)


@extending.typeof_impl.register(Registers)
def _typeof_registers(value: Registers, _context: Any) -> RegistersType:
    return RegistersType(type(value))


@extending.unbox(RegistersType)
def _unbox_registers(_typ: RegistersType, obj: Any, c: Any) -> Any:
    """The address of the structure; the caller's reference keeps the memory alive during the call."""
    address_of = c.pyapi.unserialize(c.pyapi.serialize_object(ctypes.addressof))
    number = c.pyapi.call_function_objargs(address_of, (obj,))
    address = c.pyapi.long_as_voidptr(number)
    c.pyapi.decref(number)
    c.pyapi.decref(address_of)
    return extending.NativeValue(address, is_error=cgutils.is_not_null(c.builder, c.pyapi.err_occurred()))


def _scalar_type(width: Width) -> types.Type:
    return types.float64 if width.is_float else types.int64


def _storage(width: Width) -> ir.Type:
    return ir.DoubleType() if width.is_float else ir.IntType(8 * width.size)


def _load(builder: Any, address: Any, width: Width) -> Any:
    value = builder.load(builder.bitcast(address, _storage(width).as_pointer()))
    if width.is_float or width.size == 8:
        return value
    widen = builder.sext if width.is_signed else builder.zext
    return widen(value, ir.IntType(64))


def _store(builder: Any, address: Any, width: Width, value: Any) -> None:
    if not width.is_float and width.size < 8:
        value = builder.trunc(value, _storage(width))
    builder.store(value, builder.bitcast(address, _storage(width).as_pointer()))


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
    return _load(builder, address, field.width)


@extending.lower_setattr_generic(RegistersType)
def _write_field(context: Any, builder: Any, sig: Any, args: Any, attr: str) -> None:
    target, value = args
    field = sig.args[0].registers.__fields__[attr]
    wide = context.cast(builder, value, sig.args[1], _scalar_type(field.width))
    _store(builder, _field_address(builder, target, field.offset), field.width, wide)


@templates.infer_global(operator.getitem)
class _ArrayRead(templates.AbstractTemplate):
    def generic(self, args: Any, _kws: Any) -> Any:
        """``array[int]`` is a wide value."""
        array, index = args
        if isinstance(array, RegisterArrayType) and isinstance(index, types.Integer):
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
    width = sig.args[0].width
    return _load(builder, _element_address(builder, args[0], width, args[1]), width)


@extending.lower_builtin(operator.setitem, RegisterArrayType, types.Integer, types.Any)
def _write_element(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    array, index, value = args
    width = sig.args[0].width
    wide = context.cast(builder, value, sig.args[2], _scalar_type(width))
    _store(builder, _element_address(builder, array, width, index), width, wide)
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


def local_copy(registers: Any) -> Any:
    """Copy of a register file in a stack slot of the compiled caller (a fresh structure in plain Python)."""
    return registers.copy()


def copy_back(target: Any, source: Any) -> None:
    """Write the whole of `source` over `target` of the same class."""
    ctypes.memmove(ctypes.addressof(target), ctypes.addressof(source), ctypes.sizeof(target))


def byte_at(registers: Any, offset: int) -> int:
    """Raw byte of the register memory: what a trace copies."""
    return ctypes.c_uint8.from_buffer(registers, offset).value


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
