"""`@step`: the one place where a step's compilation is decided.

A step reads its Params, writes its own Registers, allocates nothing and never raises. With ``NUMBA_DISABLE_JIT=1`` the
same functions run as plain Python on the same memory and give the same bits.
"""

import hashlib
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, TypeVar, cast

import numba as untyped_numba
from numba.core import config as untyped_config
from numba.core import types as untyped_types
from numba.core.caching import CompileResultCacheImpl, FunctionCache, IndexDataCacheFile, UserProvidedCacheLocator

import detent.kernel.compiled  # noqa: F401  # pyright: ignore[reportUnusedImport] - registers numba's types
from detent.kernel.cache import compiled_folder, source_hash, step_sources

numba: Any = untyped_numba  # its annotations leave out an option that we use
types: Any = untyped_types
config: Any = untyped_config  # numba sets its attributes at run time

F = TypeVar("F", bound=Callable[..., Any])


class _PackageLocator(UserProvidedCacheLocator):
    """Puts a function's machine code into the folder of the package's source hash."""

    def __init__(self, py_func: Any, py_file: str) -> None:
        self._py_file = py_file
        self._lineno: int = py_func.__code__.co_firstlineno
        self._cache_path = str(compiled_folder())

    def get_source_stamp(self) -> bytes:
        """The hash that also names the folder: an index that was moved here from elsewhere does not count."""
        return source_hash().encode()

    def get_disambiguator(self) -> str:
        """The module, so that equal names in two modules do not meet."""
        return Path(self._py_file).parent.name

    @classmethod
    def from_function(cls, py_func: Any, py_file: str) -> "_PackageLocator | None":
        """None where the user's cache folder cannot be written."""
        try:
            found = cls(py_func, py_file)
            found.ensure_cache_path()
        except OSError:
            return None
        return found


class _PackageCacheImpl(CompileResultCacheImpl):
    _locator_classes = [_PackageLocator]  # noqa: RUF012 - numba's own attribute


class _PackageCache(FunctionCache):
    """Keeps what is compiled for registers of the package.

    An index names the types of all it holds: reading it imports them, and fails where one cannot be imported. So each
    set of registers has an index of its own, and `advance` of one method imports no other method; machine code for the
    registers of somebody's own script stays with the process that made it.
    """

    _impl_class = _PackageCacheImpl
    _impl: Any  # numba states no types
    _cache_path: Any
    _cache_file: Any

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """What was kept for these types; None if nothing was, or if it is not kept."""
        kept: Any = super()
        return kept.load_overload(sig, target_context) if self._choose_index(sig) else None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep what was compiled for these types."""
        kept: Any = super()
        if self._choose_index(sig):
            kept.save_overload(sig, data)

    def _choose_index(self, signature: Any) -> bool:
        """Turn to the index of the registers among the types of a call; False where not all are the package's."""
        kinds = getattr(signature, "args", signature)
        files = [kind.registers for kind in kinds if hasattr(kind, "registers")]
        if not all(one.__module__.startswith("detent.") for one in files):
            return False
        names = " ".join(f"{one.__module__}.{one.__qualname__}" for one in files)
        mark = hashlib.sha256(names.encode()).hexdigest()[:8]
        base, stamp = self._impl.filename_base, self._impl.locator.get_source_stamp()
        self._cache_file = IndexDataCacheFile(self._cache_path, f"{base}-{mark}", stamp)
        return True


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


def _compiled(function: F, *, forceinline: bool) -> F:
    # No step is called by address, so none needs the wrapper for it: a sixth less to compile.
    made: Any = numba.njit(error_model="numpy", nogil=True, forceinline=forceinline, no_cfunc_wrapper=True)(function)
    if config.DISABLE_JIT:
        return cast("F", made)
    _compile_once(made)
    if Path(function.__code__.co_filename).resolve() in step_sources():
        with suppress(RuntimeError):  # numba finds no locator where the cache cannot be written: each process compiles
            made._cache = _PackageCache(function)  # noqa: SLF001 - numba offers no public way to choose the folder
    return cast("F", made)


def _compile_once(made: Any) -> None:
    """Make a call with constants, ``stand(p, c, IDLE)``, use the same machine code as one with variables.

    Numba would compile a step, and all that takes the constant from it, again for every constant it is called with.
    """
    template_of_types = made.get_call_template

    def template(args: Any, kws: Any) -> Any:
        plain = {name: types.unliteral(kind) for name, kind in kws.items()}
        return template_of_types([types.unliteral(kind) for kind in args], plain)

    made.get_call_template = template
