"""The one loop: every axis is advanced by it, and every row of a trace is written in it.

A system states its tick by `ticks`, under the class of its parameters, where `advance` finds it: numba when it compiles
the loop for these parameters, plain Python at each call. A tick handed over as an argument, or kept in a closure, would
never be found in the compiled cache. In the same way a controller states by `controls` what it does in a tick, and
`replay` runs it alone, on wires that were recorded.
"""

import ctypes
from collections.abc import Callable
from operator import attrgetter
from typing import Annotated, Any, TypeVar

import numba.extending
import numpy as np
from numpy.typing import NDArray

from detent.kernel.compiled import byte_at, copy_back, local_copy, put_byte
from detent.kernel.parts import StepCompiler
from detent.kernel.registers import Registers, Width, declared_of
from detent.kernel.step import hot_step, step

Bytes = NDArray[np.uint8]
Offsets = NDArray[np.int64]
F = TypeVar("F", bound=Callable[..., object])

extending: Any = numba.extending  # it publishes no types
HostArray = Any  # a ctypes array; compiled code reads ``array[k]`` and ``len(array)``
f8_signal = Annotated[Any, Width("f8", ctypes.c_double, "double")]  # one of float64, as a controller's step takes it
i2_signal = Annotated[Any, Width("i2", ctypes.c_int16, "int16_t")]
_AS_PART = {"pipeline_class": StepCompiler}
_INLINED = {**_AS_PART, "forceinline": True}
_TICKS: dict[type[Registers], tuple[Callable[..., Any], str]] = {}

_SERVES: dict[type[Registers], Callable[..., Any]] = {}
_CONTROLS: dict[type[Registers], Callable[..., Any]] = {}
_DISTURBS: dict[type[Registers], Callable[..., Any]] = {}


def ticks(params: type[Registers], local: str = "") -> Callable[[F], F]:
    """State the tick of a system: ``tick(params, state, *feed)``.

    It counts the state's field ``tick`` up and gives True; False where nothing happens before the host has looked.
    Where a benchmark shows a gain, `local` names a block of a block, "plant.train": a stretch of ticks works on a copy
    of it in a stack slot, so that it stays in machine registers. The tick is then
    ``tick(params, state, block, *feed)``, and does not touch the one in the state.
    """

    def register(function: F) -> F:
        """Keep it for this class of parameters."""
        _TICKS[params] = function, local
        return function

    return register


def controls(params: type[Registers]) -> Callable[[F], F]:
    """State what a controller with these parameters does in a tick: ``control(params, controller, lines, *feed)``.

    It reads the wires that the plant writes, and writes the others; it knows no plant, and keeps its own time.
    """

    def register(function: F) -> F:
        """Keep it for this class of parameters."""
        _CONTROLS[params] = function
        return function

    return register


def control_of(params: type[Registers]) -> Callable[..., Any]:
    """What a controller with these parameters does in a tick, as it was stated by `controls`."""
    return _CONTROLS[declared_of(params)]


def disturbs(params: type[Registers]) -> Callable[[F], F]:
    """State the tick of a system while a fault is injected: ``tick(params, state, injection, *feed)``.

    It is the tick in the same order, with something between machine and wires, and works on no copy of a block.
    """

    def register(function: F) -> F:
        """Keep it for this class of parameters."""
        _DISTURBS[params] = function
        return function

    return register


def serves(params: type[Registers]) -> Callable[[F], F]:
    """State how a controller is operated live: ``serve(live, params, controller, lines, memory, operation, *feed)``.

    It turns what the operation demands into what a host of the controller would write, and says how the axis is. What
    the host has laid ready for the ticks is its to edit, too: between two of them.
    """

    def register(function: F) -> F:
        """Keep it for this class of parameters."""
        _SERVES[params] = function
        return function

    return register


def run_serve(q: Any, p: Any, controller: Any, lines: Any, memory: Any, operation: Any, *feed: Any) -> None:  # noqa: PLR0913 - as `serves` says
    """One look of the controller whose live parameters `q` are."""
    _SERVES[declared_of(type(q))](q, p, controller, lines, memory, operation, *feed)


@extending.overload(run_serve, jit_options=_INLINED)
def _run_serve(q: Any, p: Any, controller: Any, lines: Any, memory: Any, operation: Any, *feed: Any) -> Any:  # noqa: ARG001, PLR0913 - as above
    serve = _SERVES[declared_of(q.registers)]

    def compiled(q: Any, p: Any, controller: Any, lines: Any, memory: Any, operation: Any, *feed: Any) -> None:  # noqa: PLR0913
        """As `run_serve`, for numba."""
        serve(q, p, controller, lines, memory, operation, *feed)

    return compiled


def run_controller(p: Any, controller: Any, lines: Any, *feed: Any) -> None:
    """One tick of the controller whose parameters these are."""
    _CONTROLS[declared_of(type(p))](p, controller, lines, *feed)


@extending.overload(run_controller, jit_options=_INLINED)
def _run_controller(p: Any, controller: Any, lines: Any, *feed: Any) -> Any:  # noqa: ARG001 - numba hands over all types
    control = _CONTROLS[declared_of(p.registers)]

    def compiled(p: Any, controller: Any, lines: Any, *feed: Any) -> None:
        """As `run_controller`, for numba."""
        control(p, controller, lines, *feed)

    return compiled


def run_stretch(p: Any, r: Any, most: int, *feed: Any) -> int:
    """Up to `most` ticks of the system whose parameters these are, without a row; returns how many."""
    tick, local = _TICKS[declared_of(type(p))]
    blocks = (attrgetter(local)(r),) if local else ()
    n = 0
    while n < most and tick(p, r, *blocks, *feed):
        n += 1
    return n


@extending.overload(run_stretch, jit_options=_INLINED)
def _run_stretch(p: Any, r: Any, most: Any, *feed: Any) -> Any:  # noqa: ARG001 - numba hands over the types of all
    tick, local = _TICKS[declared_of(p.registers)]
    outer, _, inner = local.partition(".")

    def plain(p: Any, r: Any, most: Any, *feed: Any) -> int:
        """As `run_stretch`, for numba."""
        n = 0
        while n < most and tick(p, r, *feed):
            n += 1
        return n

    def on_a_copy(p: Any, r: Any, most: Any, *feed: Any) -> int:
        """The same with one block of the plant on the stack, where the compiler keeps it in registers."""
        block = local_copy(getattr(getattr(r, outer), inner))
        n = 0
        while n < most and tick(p, r, block, *feed):
            n += 1
        copy_back(getattr(getattr(r, outer), inner), block)
        return n

    return on_a_copy if local else plain


def run_disturbed(p: Any, r: Any, f: Any, most: int, *feed: Any) -> int:
    """The same as `run_stretch` while a fault is injected; where nothing can be, it is that."""
    if declared_of(type(p)) not in _DISTURBS:
        return run_stretch(p, r, most, *feed)
    tick, n = _DISTURBS[declared_of(type(p))], 0
    while n < most and tick(p, r, f, *feed):
        n += 1
    return n


@extending.overload(run_disturbed, jit_options=_AS_PART)
def _run_disturbed(p: Any, r: Any, f: Any, most: Any, *feed: Any) -> Any:  # noqa: ARG001 - as above
    tick: Any = _DISTURBS.get(declared_of(p.registers))

    def undisturbed(p: Any, r: Any, f: Any, most: Any, *feed: Any) -> int:  # noqa: ARG001 - as above
        """As `run_stretch`: nothing of the axis can be injected."""
        return run_stretch(p, r, most, *feed)

    def compiled(p: Any, r: Any, f: Any, most: Any, *feed: Any) -> int:
        """As `run_disturbed`, for numba."""
        n = 0
        while n < most and tick(p, r, f, *feed):
            n += 1
        return n

    return compiled if tick else undisturbed


def lay_ready(values: NDArray[Any]) -> HostArray:
    """An array of the host, float64 or int16, as steps read along it; the memory is shared where it can be."""
    return np.ctypeslib.as_ctypes(np.require(values, requirements=["C", "W"]))


@hot_step
def until_row(count: int, most: int, every: int) -> int:
    """Of at most so many ticks from `count` on, those up to the next row; all of them where `every` is 0."""
    return min(most, every - count % every) if every > 0 else most


@hot_step
def write_row(r: Any, count: int, trace: Bytes, picks: Offsets, every: int) -> None:
    """Write the row of this count, number ``count // every`` modulo rows, if it has one."""
    if every > 0 and count % every == 0:
        row = (count // every) % trace.shape[0]
        for k in range(picks.shape[0]):
            trace[row, k] = byte_at(r, picks[k])


@step
def advance(  # noqa: PLR0913 - an axis, how long, and where its rows go
    p: Any, r: Any, most: int, trace: Bytes, picks: Offsets, every: int, *feed: Any
) -> int:
    """Run up to `most` ticks; stops early where the axis waits for its host."""
    done = 0
    while done < most:
        stretch = until_row(r.tick, most - done, every)
        n = run_stretch(p, r, stretch, *feed)
        done += n
        if n > 0:
            write_row(r, r.tick, trace, picks, every)
        if n < stretch:
            break
    return done


@step
def replay(p: Any, controller: Any, lines: Any, rows: Bytes, picks: Offsets, *feed: Any) -> None:
    """Run a controller alone, a tick per row of `rows`: the bytes at `picks` of the lines, as the plant wrote them."""
    for row in range(rows.shape[0]):
        for k in range(picks.shape[0]):
            put_byte(lines, picks[k], rows[row, k])
        run_controller(p, controller, lines, *feed)
