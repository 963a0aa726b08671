"""`@step`: the one place where a step's compilation is decided.

A step reads its Params, writes its own Registers, allocates nothing and never raises. With ``NUMBA_DISABLE_JIT=1`` the
same functions run as plain Python on the same memory and give the same bits.
"""

import gc
import hashlib
import pickle
from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar, cast

import numba as untyped_numba
from numba.core import config as untyped_config
from numba.core import serialize as untyped_serialize
from numba.core import sigutils as untyped_sigutils
from numba.core import types as untyped_types
from numba.core.caching import NullCache
from numba.core.compiler import CompileResult as UntypedCompileResult
from numba.core.compiler_lock import global_compiler_lock as untyped_compiler_lock
from numba.core.runtime.nrt import rtsys as untyped_rtsys

import detent.kernel.compiled_single  # noqa: F401  # pyright: ignore[reportUnusedImport] - registers numba's types
from detent.kernel.cache import compiled_folder, keep, read_kept, step_sources, tell_compiling
from detent.kernel.parts import StepCompiler, StepLibrary, is_part

numba: Any = untyped_numba  # its annotations leave out an option that we use
types: Any = untyped_types
config: Any = untyped_config  # numba sets its attributes at run time
CompileResult: Any = UntypedCompileResult
serialize: Any = untyped_serialize
sigutils: Any = untyped_sigutils
global_compiler_lock: Any = untyped_compiler_lock
rtsys: Any = untyped_rtsys

F = TypeVar("F", bound=Callable[..., Any])
Act = Callable[..., Any]  # lets a host do something to its controller: ``act(action, *args)`` is ``action(*args)``


class _Kept(NullCache):
    """Keeps what is compiled of a step for registers of the package, a file for each set of types and each processor.

    Machine code for the registers of somebody's own script stays with the process that made it: the hash that names
    the folder does not cover them.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        self._name = f"{function.__module__.removeprefix('detent.')}.{function.__qualname__}"

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """What was kept for these types; None if nothing was, or if it is not kept."""
        # Machine code needs what counts references; what compiling needs, which loads slowly, it fetches by itself.
        rtsys.initialize(target_context)
        file, why = self._file(sig, target_context.codegen())
        kept = read_kept(file) if file else None
        if kept is None:
            tell_compiling(why)
            return None
        return CompileResult._rebuild(target_context, *pickle.loads(kept))  # noqa: SLF001, S301 - as numba does; ours

    def save_overload(self, sig: Any, cres: Any) -> None:
        """Keep what was compiled for these types."""
        file, _ = self._file(sig, cres.codegen)
        # Parts are in what calls them; an address in code means nothing in another process.
        if file and not is_part(cres.library) and not cres.library.has_dynamic_globals:
            keep(file, serialize.dumps(cres._reduce()))  # noqa: SLF001 - as numba's own cache does

    def _file(self, signature: Any, codegen: Any) -> tuple[Path | None, str]:
        """Where code for these types and this processor is kept; None where it is not, and why."""
        kinds = getattr(signature, "args", signature)
        if not all(kind.registers.__module__.startswith("detent.") for kind in kinds if hasattr(kind, "registers")):
            return None, "registers of another package"
        folder, why = compiled_folder()
        told = " ".join([*map(str, kinds), *map(str, codegen.magic_tuple())])
        return folder and folder / f"{self._name}-{hashlib.sha256(told.encode()).hexdigest()[:16]}.code", why


def step(function: F) -> F:
    """Compile a step.

    ``error_model="numpy"`` keeps divisions from raising and lets loops vectorise; ``nogil`` lets a live loop run beside
    the panel; floating-point rules stay strict, so that every machine gives the same bits. Only the package's own steps
    are cached: the hash that names the cache folder covers no other source.
    """
    return _compiled(function, forceinline=False)


def hot_step(function: F) -> F:
    """`step` for what runs in every tick: always inlined, so that a caller's registers stay in machine registers."""
    return _compiled(function, forceinline=True)


def do(action: Callable[..., Any], *args: Any) -> Any:
    """An action of a host that nobody notes."""
    return action(*args)


def bounded(turns: int, why: str) -> Callable[[F], F]:
    """State how often each ``while`` of a step turns at most, and why: firmware has no loop without a bound."""

    def note(function: F) -> F:
        """Keep it with the function."""
        function.__bounded__ = (turns, why)  # pyright: ignore[reportFunctionMemberAccess]
        return function

    return note


def _compiled(function: F, *, forceinline: bool) -> F:
    # No step is called by address, so none needs the wrapper for it: a sixth less to compile.
    options = {"error_model": "numpy", "nogil": True, "forceinline": forceinline, "no_cfunc_wrapper": True}
    made: Any = numba.njit(pipeline_class=StepCompiler, **options)(function)
    if config.DISABLE_JIT:
        made.py_func = made  # so that a plain step is known as one, too: an export translates no other functions
        return cast("F", made)
    _compile_parts(made)
    if Path(function.__code__.co_filename).resolve() in step_sources():
        made._cache = _Kept(function)  # noqa: SLF001 - numba offers no public way to choose a cache
    return cast("F", made)


@contextmanager
def _uncollected() -> Generator[None]:
    """Let the collector of garbage rest: a compiler makes millions of objects that it would look through in vain."""
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()


def _compile_parts(made: Any) -> None:
    """Make a call by another step compile a part, and a call by Python what can be called, with the parts in it.

    A call with constants, ``stand(p, c, IDLE)``, uses the same code as one with variables: numba would compile a step,
    and all that takes the constant from it, again for every constant it is called with.
    """
    template_of_types, compile_one, add_overload = made.get_call_template, made.compile, made.add_overload

    def template(args: Any, kws: Any) -> Any:
        """For another step."""
        plain = {name: types.unliteral(kind) for name, kind in kws.items()}
        with global_compiler_lock:
            made.targetoptions["no_cpython_wrapper"] = True
            try:
                return template_of_types([types.unliteral(kind) for kind in args], plain)
            finally:
                del made.targetoptions["no_cpython_wrapper"]

    def compile_for(signature: Any) -> Any:
        """For whoever calls."""
        with global_compiler_lock, _uncollected():
            kinds, _ = sigutils.normalize_signature(signature)
            for_steps = "no_cpython_wrapper" in made.targetoptions
            known = made.overloads.get(tuple(kinds))
            if known is not None and is_part(known.library) and not for_steps:
                del made.overloads[tuple(kinds)]  # until now only steps called it
            return compile_one(signature)

    def add(result: Any) -> None:
        """Where its callers find it."""
        if is_part(result.library):
            made.overloads[tuple(result.signature.args)] = result  # Python must not find it
            return
        add_overload(result)
        if isinstance(result.library, StepLibrary):
            result.library.place_environments()

    made.get_call_template, made.compile, made.add_overload = template, compile_for, add
