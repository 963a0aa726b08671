"""Which lines of detent the unit tests reach, seen while all tests run: the plugin of `make test MEASURED=yes`.

Coverage slows Python down by half and more. So it looks on while the files of the tests are imported, and while a unit
test runs; not while any other does, nor one that starts programs of its own, of which it would see nothing, nor those
of the blocks, which `make coverage` runs as plain Python. Each process of the tests writes a file, `COVERAGE_FILE` and
its own name; `make coverage` puts all together.
"""

import os
from collections.abc import Generator
from pathlib import Path

import pytest
from coverage import Coverage

UNIT = Path(__file__).parent / "unit"
BLOCKS = {"control", "drive", "planning", "plant", "sensing"}
PLAIN = "NUMBA_DISABLE_JIT" in os.environ


class Measured:
    """One process of the tests, and what it reaches."""

    def __init__(self, process: str) -> None:
        self.coverage = Coverage(data_file=Path(f"{os.environ['COVERAGE_FILE']}.{process}").absolute())
        self.looks = False

    def look(self, *, on: bool) -> None:
        """Begin to look on, or cease to."""
        if on != self.looks:
            (self.coverage.start if on else self.coverage.stop)()
            self.looks = on

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Generator[None, object, object]:
        place = item.path.relative_to(UNIT).parts if item.path.is_relative_to(UNIT) else ()
        self.look(on=bool(place) and (PLAIN or place[0] not in BLOCKS) and item.get_closest_marker("process") is None)
        return (yield)

    def pytest_sessionfinish(self) -> None:
        self.look(on=False)
        self.coverage.save()


def pytest_configure(config: pytest.Config) -> None:
    """Look on from here; the process that hands the files of the tests to others runs none."""
    if config.getoption("numprocesses") and not hasattr(config, "workerinput"):
        return
    measured = Measured(os.environ.get("PYTEST_XDIST_WORKER", "alone"))
    measured.look(on=True)
    config.pluginmanager.register(measured)
