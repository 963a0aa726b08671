"""Foreign files read in a process of their own, within limits: a damaged one costs a message, never the program.

Libraries crash over a damaged file, never come to an end with it, or want all the memory there is. The process starts
with the first such file and serves one after the other; one that broke off is ended, and the next file gets a new one.
It hands back arrays and plain values only. Time is limited everywhere, memory where the system does it (Linux).
"""

import atexit
import math
import os
import pickle
import signal
import subprocess
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import IO, Any, Concatenate, NamedTuple, ParamSpec, TypeVar, cast

from detent.errors import DetentError, InputError

P = ParamSpec("P")
R = TypeVar("R")

SECONDS, BYTES_PER_SECOND = 60.0, 10_000_000  # time for any file, and for each second more that much of it
MEMORY, MEMORY_PER_BYTE = 4_000_000_000, 4  # memory for any file [byte], and for each byte of it that much more
RAISE = "DETENT_READ_LIMITS"  # environment: both limits are multiplied by this number
_START = "import sys; sys.path[:] = sys.argv[1:]; from detent.files.apart import serve; serve()"
# Threads of the linear algebra and arenas of Arrow would count as memory that the file wanted.
_SURROUNDINGS = {"OPENBLAS_NUM_THREADS": "1", "ARROW_DEFAULT_MEMORY_POOL": "system"}
_PLAIN = {
    ("numpy", "ndarray"), ("numpy", "dtype"), ("numpy._core.numeric", "_frombuffer"),
    ("numpy._core.multiarray", "_reconstruct"), ("numpy._core.multiarray", "scalar"),
}  # fmt: skip


class Limits(NamedTuple):
    """What the reading of one file may take."""

    seconds: float
    memory: int  # bytes
    factor: float  # by which the user has raised both


def limits_of(size: int) -> Limits:
    """Limits for a file of so many bytes: even the largest that is read stays well within them.

    >>> limits_of(2_000_000_000)
    Limits(seconds=260.0, memory=12000000000, factor=1.0)
    """
    stated = os.environ.get(RAISE, "1")
    try:
        factor = float(stated)
    except ValueError:
        factor = math.nan
    if not 0.0 < factor <= 1e6:
        raise DetentError(
            f"{RAISE}: got {stated!r}; expected: a number from above 0 to 1e6; try: set it to 4, or unset it"
        )
    seconds, memory = SECONDS + size / BYTES_PER_SECOND, MEMORY + MEMORY_PER_BYTE * size
    return Limits(seconds * factor, int(memory * factor), factor)


def read_apart(
    reader: Callable[Concatenate[Path, P], R], path: Path, allowed: str, *args: P.args, **kwargs: P.kwargs
) -> R:
    """What a reader makes of a file, in a process of its own; `allowed` says what may be in the file.

    Readers are functions of a module. What they raise but `DetentError` is their stumbling over damage.
    """
    try:
        size = path.stat().st_size
    except (OSError, ValueError):
        return reader(path, *args, **kwargs)  # it says why
    limits = limits_of(size)
    with _LOCK:
        process = _process()
        request = (_folder(), limits, (reader, path, args, kwargs))
        told, late = _ask(process, pickle.dumps(request, protocol=5), limits.seconds)
    if isinstance(told, DetentError):
        raise told
    if isinstance(told, str):
        got = f"a file that took longer to read than {limits.seconds:.3g} s" if late else told
        if got == _MEMORY:
            got = f"a file that needed more memory to read than {limits.memory / 1e9:.3g} GB"
        within = f"{allowed}, read in {limits.seconds:.3g} s and {limits.memory / 1e9:.3g} GB"
        remedy = f"save it again, or as CSV; if it is whole, set {RAISE}={4 * limits.factor:g} in the environment"
        raise InputError.of_file(str(path), got, within, f"{remedy}: both limits times {4 * limits.factor:g}")
    return told[0]


def _folder() -> Path:
    """The folder from which a relative path counts; where it is gone, such a path leads nowhere anyway."""
    try:
        return Path.cwd()
    except OSError:
        return Path()


_MEMORY = "memory"  # what the process says where it got no more


def _ask(process: "subprocess.Popen[bytes]", request: bytes, seconds: float) -> tuple[Any, bool]:
    """The answer of the process, or a text that says why it gave none; True where it ran out of time."""
    requests, answers = cast("IO[bytes]", process.stdin), cast("IO[bytes]", process.stdout)
    expired = threading.Event()

    def expire() -> None:
        expired.set()
        process.kill()

    watch = threading.Timer(seconds, expire)
    watch.daemon = True
    told: Any = ""  # no answer
    try:
        watch.start()
        requests.write(request)
        requests.flush()
        told = _Answer(answers).load()
    except pickle.UnpicklingError as error:
        told = str(error)
    except (OSError, EOFError, ValueError):
        with suppress(subprocess.TimeoutExpired):  # one that is about to end says by its status why
            process.wait(1.0)
    except BaseException:  # Ctrl-C ends the reading too
        end()
        raise
    finally:
        watch.cancel()
    if isinstance(told, str) or expired.is_set():
        status = end()
        told = _why_ended(told, status) if isinstance(told, str) and told != _MEMORY else told
    return told, expired.is_set()


def _why_ended(told: str, status: int | None) -> str:
    """Why a process ended without an answer."""
    if told:
        return f"a file that crashed its reader ({told})"
    if status is not None and -status in {signal.SIGKILL, getattr(signal, "SIGXCPU", 0)}:
        return "a file whose reader was killed by the system: it used too much memory or time"
    name = signal.Signals(-status).name if status is not None and status < 0 else f"status {status}"
    return f"a file that crashed its reader ({name})"


class _Answer(pickle.Unpickler):
    """What came from the process: arrays, plain values and detent's own classes, whatever a file has made of it."""

    def find_class(self, module: str, name: str, /) -> Any:
        """A class by its name."""
        if (module, name) in _PLAIN:
            return super().find_class(module, name)
        if module.startswith("detent.") and "." not in name:
            found = super().find_class(module, name)
            if isinstance(found, type) and found.__module__ == module:
                return found
        raise pickle.UnpicklingError(f"{module}.{name} is no plain value")


# ---- the process as seen from here

_LOCK = threading.RLock()
_RUNNING: dict[int, "subprocess.Popen[bytes]"] = {}  # by the process that started it: a fork of that one starts its own


def _process() -> "subprocess.Popen[bytes]":
    """The process that reads; started where there is none."""
    running = _RUNNING.get(os.getpid())
    if running is not None and running.poll() is None:
        return running
    end()
    command = [sys.executable, "-P", "-c", _START, *sys.path]
    pipe, gone = subprocess.PIPE, subprocess.DEVNULL
    try:
        made = subprocess.Popen(  # noqa: S603 - this interpreter, and this module
            command, stdin=pipe, stdout=pipe, stderr=gone, env={**os.environ, **_SURROUNDINGS}
        )
    except OSError as error:
        why = error.strerror or str(error)
        told = f"{sys.executable}: cannot be started ({why}); recordings are read in a process of their own"
        raise DetentError(told) from error
    if sys.platform == "linux":
        import fcntl

        with suppress(OSError):  # large answers come in fewer pieces
            fcntl.fcntl(cast("IO[bytes]", made.stdout), fcntl.F_SETPIPE_SZ, 1 << 20)
    _RUNNING[os.getpid()] = made
    return made


def end() -> int | None:
    """End the process and wait for its end: its exit status, if there was one."""
    running = _RUNNING.pop(os.getpid(), None)
    if running is None:
        return None
    if running.poll() is None:
        running.kill()
    with running, suppress(OSError):  # closes the pipes, and waits
        return running.wait()
    return running.returncode


atexit.register(end)


# ---- the process as seen from inside


def serve() -> None:
    """Read files until nobody asks any more."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches who asked, and that one ends this process
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what libraries print is no answer
    while True:
        try:
            folder, limits, request = pickle.load(sys.stdin.buffer)  # noqa: S301 - from detent itself
        except EOFError:
            return
        with suppress(OSError):
            os.chdir(folder)
        pickle.dump(_answer(limits, request), answers, protocol=5)
        answers.flush()


def _answer(limits: Limits, request: tuple[Callable[..., Any], Path, tuple[Any, ...], dict[str, Any]]) -> Any:
    """The result in a list of one, or the error, or a text that says why there is neither."""
    reader, path, args, kwargs = request
    try:
        _limit(limits)
        return [reader(path, *args, **kwargs)]
    except DetentError as error:
        return error
    except MemoryError:
        return _MEMORY
    except Exception as error:  # noqa: BLE001 - whatever damage makes a library stumble over
        return f"{type(error).__name__}: {error}"[:200]


def _limit(limits: Limits) -> None:
    """Tell the system what this process may take from here on."""
    if sys.platform != "linux":
        return  # macOS takes a limit of the memory and does not hold to it; the time is watched by who asked
    import resource

    held = int(Path("/proc/self/statm").read_text("ascii").split()[0]) * resource.getpagesize()
    used = resource.getrusage(resource.RUSAGE_SELF)
    # The processor's time too: if the one who watches is gone, the reading still ends.
    wanted = {
        resource.RLIMIT_AS: held + limits.memory,
        resource.RLIMIT_CPU: math.ceil(used.ru_utime + used.ru_stime + limits.seconds) + 5,
    }
    for what, value in wanted.items():
        most = resource.getrlimit(what)[1]
        resource.setrlimit(what, (value if most == resource.RLIM_INFINITY else min(value, most), most))
