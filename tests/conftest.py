"""Settings that every test shares."""

import gc
import os

# The matrices here are small: threads of the linear algebra only stand in one another's way. Read when numpy loads.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# Output is compared as a pipe shows it, whatever terminal the tests run in.
os.environ.pop("COLUMNS", None)
os.environ.pop("LINES", None)

import pytest
from hypothesis import settings

# A compiled step costs seconds the first time it is called, which says nothing about the example that met it: no
# deadline. In CI the examples are the same each time, so that a red run can be repeated.
settings.register_profile("detent", deadline=None, print_blob=True)
settings.register_profile("ci", settings.get_profile("detent"), derandomize=True)
settings.load_profile("ci" if os.environ.get("CI") else "detent")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Files that take longest begin first: no process is left alone with one of them at the end."""
    items.sort(key=lambda item: item.get_closest_marker("early") is None)


def pytest_collection_finish() -> None:
    """What was imported and collected stays: looking through it for garbage, again and again, takes time only."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(20_000)
