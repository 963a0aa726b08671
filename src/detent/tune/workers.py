"""Who computes the chunks of `detent tolerance`: threads, processes, or the workers of a Dask scheduler.

A chunk is a plain function of a question and of the numbers of its cases, so that who computes it changes no bit.
"""

import os
import platform
import sys
import threading
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor, ThreadPoolExecutor, as_completed
from contextlib import ExitStack, contextmanager
from importlib import import_module
from multiprocessing import get_context, parent_process
from multiprocessing.connection import wait
from typing import Any, cast

from detent import __version__
from detent.errors import DetentError
from detent.kernel.cache import source_hash

IN_FLIGHT = 4  # chunks that a Dask worker has, or waits for
RETRIES = 3

Span = tuple[int, int]  # first case and number of cases
Compute = Callable[[Any, int, int], Any]  # ``run_chunk(question, first, count)``
Computed = Iterator[tuple[Span, Any]]


def in_threads(run: Compute, question: Any, spans: Sequence[Span], workers: int) -> Computed:
    """Chunks as they are done, by threads: for a loop that runs without Python's lock."""
    with ThreadPoolExecutor(workers) as pool:
        yield from _pooled(pool, run, question, spans)


def in_processes(run: Compute, question: Any, spans: Sequence[Span], workers: int) -> Computed:
    """Chunks as they are done, by processes, which end with this one."""
    with ProcessPoolExecutor(workers, get_context("spawn"), initializer=_end_with_parent) as pool:
        yield from _pooled(pool, run, question, spans)


def _pooled(pool: Executor, run: Compute, question: Any, spans: Sequence[Span]) -> Computed:
    asked = {pool.submit(run, question, *span): span for span in spans}
    try:
        for done in as_completed(asked):
            yield asked[done], done.result()
    finally:
        pool.shutdown(cancel_futures=True)


def _end_with_parent() -> None:
    """A worker waits for work for ever; one whose parent was killed would stay."""
    parent = parent_process()
    if parent is not None:
        threading.Thread(target=lambda: (wait([parent.sentinel]), os._exit(1)), daemon=True).start()


def machine() -> dict[str, str]:
    """What the last bits of a result may depend on beside that: library and processor."""
    return {"python": sys.version.split()[0], "machine": platform.machine(), "library": " ".join(platform.libc_ver())}


# ---- Dask


def identity() -> dict[str, str]:
    """What decides the bits of a result: versions, and the sources of the steps."""
    import numba

    return {"detent": __version__, "numba": numba.__version__, "source hash": source_hash()}


def on_dask(run: Compute, question: Any, spans: Sequence[Span], address: str) -> Computed:
    """Chunks as they are done, by the workers of a Dask scheduler; results come here, and nothing else is shared.

    The address is that of the scheduler, as in ``tcp://host:8786``; "local:2" starts one here, with two workers. A
    worker with other sources is refused.
    """
    with _client(address) as client:
        _check_workers(client)
        left, asked = list(spans)[::-1], dict[Any, Span]()

        def ask() -> Any:
            future = client.submit(run, question, *left[-1], pure=False, retries=RETRIES)
            asked[future.key] = left.pop()
            return future

        most = IN_FLIGHT * len(client.scheduler_info(n_workers=-1)["workers"])
        running = _dask().as_completed([ask() for _ in range(min(most, len(left)))], loop=client.loop)
        for done in running:
            yield asked.pop(done.key), _result(done)
            if left:
                running.add(ask())


def _result(done: Any) -> Any:
    """What a worker gave; where all that tried it were killed, that is an error of words."""
    try:
        return done.result()
    except _dask().KilledWorker as error:
        raise DetentError(
            f"--dask: got workers that end while they compute ({error}); expected: workers with enough memory; look at "
            "their logs, and run it again: with --store what was done stays"
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
