"""Wall clock for compiled loops: the monotonic clock of the system, and sleep up to one of its moments.

Both are calls of the C library, so that a loop that waits holds no lock of the interpreter.
"""

import time
from typing import Any

from llvmlite import ir
from numba.core import cgutils as untyped_cgutils
from numba.core import types

from detent.kernel.compiled import INT32, WORD, compiles

cgutils: Any = untyped_cgutils

MONOTONIC, UNTIL = 1, 1  # CLOCK_MONOTONIC and TIMER_ABSTIME of POSIX
NS = 1_000_000_000


def monotonic_ns() -> int:
    """Nanoseconds of the monotonic clock."""
    return time.monotonic_ns()


def sleep_until(moment: int) -> int:
    """Sleep until a moment of the monotonic clock [ns]; gives 0, or at once another number where it may not sleep."""
    time.sleep(max(0, moment - time.monotonic_ns()) / NS)
    return 0


def _call(builder: Any, name: str, *args: Any) -> Any:
    """Call a function of the C library that gives an int."""
    kind = ir.FunctionType(INT32, [arg.type for arg in args])
    return builder.call(cgutils.get_or_insert_function(builder.module, kind, name), args)


def _moment(builder: Any) -> tuple[Any, Any, Any]:
    """A struct timespec on the stack, and the addresses of its seconds and nanoseconds."""
    slot = cgutils.alloca_once(builder, ir.ArrayType(WORD, 2))
    zero = ir.Constant(INT32, 0)
    return slot, *(builder.gep(slot, [zero, ir.Constant(INT32, k)]) for k in (0, 1))


@compiles(monotonic_ns, types.int64)
def _monotonic_ns(_context: Any, builder: Any, _sig: Any, _args: Any) -> Any:
    slot, seconds, rest = _moment(builder)
    _call(builder, "clock_gettime", ir.Constant(INT32, MONOTONIC), slot)
    return builder.add(builder.mul(builder.load(seconds), ir.Constant(WORD, NS)), builder.load(rest))


@compiles(sleep_until, types.int64, types.Integer)
def _sleep_until(_context: Any, builder: Any, _sig: Any, args: Any) -> Any:
    slot, seconds, rest = _moment(builder)
    builder.store(builder.sdiv(args[0], ir.Constant(WORD, NS)), seconds)
    builder.store(builder.srem(args[0], ir.Constant(WORD, NS)), rest)
    nowhere = ir.Constant(slot.type, None)
    clock, how = ir.Constant(INT32, MONOTONIC), ir.Constant(INT32, UNTIL)
    return builder.sext(_call(builder, "clock_nanosleep", clock, how, slot, nowhere), WORD)
