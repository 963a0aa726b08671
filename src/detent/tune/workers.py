"""Who computes the chunks of `detent tolerance`: threads, processes, or the workers of a Dask scheduler.

A chunk is a plain function of a question and of the numbers of its cases, so that who computes it changes no bit.
"""

import os
import platform
import sys
import threading
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor, wait
from contextlib import AbstractContextManager, ExitStack, contextmanager
from importlib import import_module
from itertools import islice
from multiprocessing import connection, get_context, parent_process
from typing import Any, cast

from detent import __version__
from detent.errors import DetentError
from detent.kernel.cache import source_hash

IN_FLIGHT = 4  # chunks that a worker has, or waits for: so many results at most wait to be taken
RETRIES = 3

Span = tuple[int, int]  # first case and number of cases
Compute = Callable[[Any, int, int], Any]  # ``run_chunk(question, first, count)``
Crew = AbstractContextManager[tuple[Executor, int]]  # who computes, and how many they are


def computed(crew: Crew, run: Compute, question: Any, spans: Sequence[Span]) -> Generator[tuple[Span, Any]]:
    """Chunks as they are done, by a crew that is let go at the end; few wait for a worker, so that few are held."""
    with crew as (pool, workers):
        left, running = iter(spans), dict[Future[Any], Span]()
        try:
            while True:
                for span in islice(left, IN_FLIGHT * workers - len(running)):
                    running[pool.submit(run, question, *span)] = span
                if not running:
                    return
                for one in wait(running, return_when=FIRST_COMPLETED).done:
                    yield running.pop(one), one.result()
        finally:
            for one in running:
                one.cancel()


@contextmanager
def threads(number: int) -> Generator[tuple[Executor, int]]:
    """Threads of this process: for a loop that runs without Python's lock."""
    with ThreadPoolExecutor(number) as pool:
        yield pool, number


@contextmanager
def processes(number: int) -> Generator[tuple[Executor, int]]:
    """Processes of this machine, which end with this one."""
    with ProcessPoolExecutor(number, get_context("spawn"), initializer=_end_with_parent) as pool:
        yield pool, number


def _end_with_parent() -> None:
    """A worker waits for work for ever; one whose parent was killed would stay."""
    parent = parent_process()
    if parent is not None:
        threading.Thread(target=lambda: (connection.wait([parent.sentinel]), os._exit(1)), daemon=True).start()


def machine() -> dict[str, str]:
    """What the last bits of a result may depend on beside that: library and processor."""
    return {"python": sys.version.split()[0], "machine": platform.machine(), "library": " ".join(platform.libc_ver())}


# ---- Dask


def identity() -> dict[str, str]:
    """What decides the bits of a result: versions, and the sources of the steps."""
    import numba

    return {"detent": __version__, "numba": numba.__version__, "source hash": source_hash()}


@contextmanager
def dask(address: str) -> Generator[tuple[Executor, int]]:
    """The workers of a Dask scheduler; results come here, and nothing else is shared.

    The address is that of the scheduler, as in ``tcp://host:8786``; "local:2" starts one here, with two workers. A
    worker with other sources is refused.
    """
    with _client(address) as client:
        _check_workers(client)
        number = len(client.scheduler_info(n_workers=-1)["workers"])
        try:
            yield client.get_executor(pure=False, retries=RETRIES), number
        except _dask().KilledWorker as error:
            raise DetentError(
                f"--dask: got workers that end while they compute ({error}); expected: workers with enough memory; "
                "look at their logs, and run it again: with --store what was done stays"
            ) from error


def _dask() -> Any:
    try:
        return import_module("distributed")
    except ImportError:
        raise DetentError(
            "--dask: got a Python without Dask; expected: the extra `dask`; pip install 'detent[dask]'"
        ) from None


@contextmanager
def _client(address: str) -> Generator[Any]:
    """A client of a scheduler, or of one that is started here."""
    distributed, local = _dask(), address.removeprefix("local:")
    is_local = local != address
    if is_local and not (local.isdecimal() and int(local) > 0):
        raise DetentError(f"--dask: got {address!r}; expected: local:2 or an address; write how many workers")
    with ExitStack() as stack:
        if is_local:
            address = stack.enter_context(
                distributed.LocalCluster(
                    n_workers=int(local), threads_per_worker=1, dashboard_address=None, silence_logs=50
                )
            ).scheduler_address
        try:
            client = distributed.Client(address, timeout=10, set_as_default=False)
        except (OSError, ValueError) as error:
            raise DetentError(
                f"--dask: got {address!r}, where no scheduler answers ({error}); expected: an address such as "
                "tcp://host:8786; start one with `dask scheduler`, or use local:2"
            ) from error
        yield stack.enter_context(client)


def _check_workers(client: Any) -> None:
    """Refuse workers whose bits may differ, by name."""
    try:
        theirs: dict[str, Any] = client.run(identity, on_error="return")
    except Exception as error:  # noqa: BLE001 - whatever another Python raises there
        theirs = {"a worker": error}
    if not theirs:
        raise DetentError("--dask: got a scheduler without workers; expected: one or more; start `dask worker`")
    own = identity()
    for worker, one in theirs.items():
        known = cast("dict[str, str]", one) if isinstance(one, dict) else {}
        if not known:
            raise DetentError(f"--dask: the worker {worker} cannot load detent ({one}); install {own} there")
        for name, value in own.items():
            if known.get(name) != value:
                raise DetentError(
                    f"--dask: the worker {worker} has {name} {known.get(name)}; expected: {value}, as here; install "
                    "the same on every worker: other steps give other bits"
                )
