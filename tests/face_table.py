"""Which client passed over which protocol, how long a question takes, what faces cost: made by the tests themselves.

`python -m tests.face_table` runs the acceptance tests of the faces, those behind `wide` among them, keeps what it has
seen in docs/face_figures.json, and writes docs/explanation/faces-table.md from that.
"""

import json
import os
import re
import shutil
import subprocess
import sys
from typing import Any

import pytest

from tests import foreign
from tests.face_table_page import CLIENTS, KEPT, PAGE, PASSED, TESTS, names_of, page


class Seen:
    """A plugin that takes down what came of each test, and what it has measured."""

    def __init__(self) -> None:
        self.tests: dict[str, dict[str, Any]] = {}

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Note a test that has ended, or that could not begin."""
        if report.when == "call" or report.outcome != "passed":
            measured = dict(foreign.MEASURED)
            foreign.MEASURED.clear()
            self.tests[report.nodeid.rpartition("::")[2]] = {"outcome": report.outcome, **measured}


def version_of(name: str) -> str:
    """Version of a client: the one that is pinned, or what the program of the system says."""
    pinned = names_of(foreign)
    if name in pinned:
        return pinned[name]
    # What mbpoll itself says to -V is that of no release.
    packaged = [str(shutil.which("dpkg-query")), "-W", "-f", "${Version}", name]
    command = packaged if shutil.which("dpkg-query") else [str(shutil.which(name)), "-V"]
    asked = subprocess.run(command, capture_output=True, text=True, check=False)
    (found,) = re.findall(r"\d+\.\d+[\w.+-]*", asked.stdout + asked.stderr)[:1] or ["?"]
    return found


def main() -> int:
    """Run the tests, write the page; the status is theirs."""
    seen, load = Seen(), round(os.getloadavg()[0], 1)
    words = ["-q", "-p", "no:benchmark", "-m", "not long"]
    status = int(pytest.main([str(TESTS), *words], plugins=[seen]))
    failed = [name for name, one in seen.tests.items() if one["outcome"] != "passed"]
    if failed:
        status = int(pytest.main([*(f"{TESTS}::{name}" for name in failed), *words], plugins=[seen]))
        for one in (seen.tests[name] for name in failed):
            one["outcome"] = PASSED[1] if one["outcome"] == PASSED[0] else one["outcome"]
    from tests.live_figures import surroundings  # which loads what pytest wants to load first

    clients = {name for _, names in CLIENTS.values() for name in names}
    versions = {name: version_of(name) for name in sorted(clients)}
    found = {"where": surroundings() | {"load": load}, "tests": seen.tests, "versions": versions}
    KEPT.write_text(json.dumps(found, indent=1, sort_keys=True) + "\n", encoding="utf-8")
    PAGE.write_text(page(found), encoding="utf-8")
    return status


if __name__ == "__main__":
    sys.exit(main())
