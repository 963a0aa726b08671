"""Settings that every test shares."""

import gc
import os

# The matrices here are small: threads of the linear algebra only stand in one another's way. Read when numpy loads.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# Output is compared as a pipe shows it, whatever terminal the tests run in.
os.environ.pop("COLUMNS", None)
os.environ.pop("LINES", None)

import json
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

# A compiled step costs seconds the first time it is called, which says nothing about the example that met it: no
# deadline. In CI the examples are the same each time, so that a red run can be repeated.
settings.register_profile("detent", deadline=None, print_blob=True)
settings.register_profile("ci", settings.get_profile("detent"), derandomize=True)
settings.load_profile("ci" if os.environ.get("CI") else "detent")


TRIED: Counter[tuple[str, ...]] = Counter()  # see the end


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Files that take longest begin first: no process is left alone with one of them at the end."""
    if config.getoption("tried"):
        items[:] = [item for item in items if "tried" in getattr(item, "fixturenames", ())]
    items.sort(key=lambda item: item.get_closest_marker("early") is None)


@given(st.none())
def make_the_first_example(_: None) -> None:
    """Nothing; hypothesis makes its random generators with it."""


def pytest_collection_finish() -> None:
    """What was imported and collected stays: looking through it for garbage, again and again, takes time only."""
    # Hypothesis asks the collector who holds a generator it makes, and warns when that is frozen and nobody is seen.
    make_the_first_example()
    gc.collect()
    gc.freeze()
    gc.set_threshold(20_000)


# ---- what was tried against detent: docs/tried.toml, written by `make tried` and read by the page of that name


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--tried", type=Path, help="run the tests that attack, and write how often each did to this file")


@pytest.fixture
def tried(request: pytest.FixtureRequest, record_property: Callable[[str, object], None]) -> Callable[..., None]:
    """Count attacks that were withstood: what was attacked, with what outcome, and how often."""

    def count(kind: str, what: str, outcome: str, times: int = 1) -> None:
        function = request.node.nodeid.partition("[")[0]
        record_property("tried", [kind, what, outcome, function, times])

    return count


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    if report.when == "call":
        for *row, times in (value for name, value in report.user_properties if name == "tried"):
            TRIED[tuple(row)] += times


def pytest_sessionfinish(session: pytest.Session, exitstatus: int) -> None:
    """One table a row; a run in which anything failed has withstood nothing."""
    path = session.config.getoption("tried", None)
    if path is None or exitstatus or hasattr(session.config, "workerinput"):
        return
    lines = ["# Written by `make tried`: how often each attack was made, and what came of it every time.\n"]
    for (kind, what, outcome, test), times in sorted(TRIED.items()):
        told = {"kind": kind, "what": what, "outcome": outcome, "test": test}
        lines.append("[[attack]]\n" + "".join(f"{key} = {json.dumps(text)}\n" for key, text in told.items()))
        lines[-1] += f"times = {times}\n"
    path.write_text("\n".join(lines), encoding="utf-8")
