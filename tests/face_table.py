"""Which client passed over which protocol, and how long a question takes: made by the tests themselves.

`python -m tests.face_table` runs the acceptance tests of the faces, those that take long among them, and writes
docs/explanation/faces-table.md.
"""

import re
import sys

import pytest

from tests import foreign
from tests.places import ROOT

CLIENTS = {
    "test_01_ophyd_epics_motor[pyepics]": ("EPICS, Channel Access", "ophyd 1.11.2, pyepics 3.5.10"),
    "test_01_ophyd_epics_motor[caproto]": ("EPICS, Channel Access", "ophyd 1.11.2, caproto 1.3.0"),
    "test_02_03_ophyd_async_motor[epics-ca]": ("EPICS, Channel Access", "ophyd-async 0.21.3, aioca 2.1"),
    "test_02_03_ophyd_async_motor[pva-pva]": ("EPICS, PV Access", "ophyd-async 0.21.3, p4p 4.3.0"),
    "test_04_bluesky_scans_also_after_a_stop": ("EPICS, Channel Access", "bluesky 1.15.1"),
    "test_09_base_node_402_on_a_virtual_bus": ("CiA 402, virtual bus", "canopen 2.4.1"),
    "test_10_the_same_on_slcan_from_another_process": ("CiA 402, slcan", "canopen 2.4.1"),
    "test_11_the_same_on_udp_multicast_with_the_filters_that_are_printed[2]": ("CiA 402, multicast", "canopen 2.4.1"),
    "test_19_mbpoll": ("Modbus TCP", "mbpoll 1.4.11"),
    "test_20_modbus_serial": ("Modbus TCP", "modbus-serial 8.0.25"),
    "test_20_pymodbus": ("Modbus TCP", "pymodbus 3.16.1"),
    "test_23_pyvisa_over_a_socket": ("SCPI, TCP", "pyvisa 1.16.2, pyvisa-py 0.8.1"),
    "test_23_pyvisa_over_a_serial_terminal": ("SCPI, terminal", "pyvisa 1.16.2, pyvisa-py 0.8.1"),
    "test_24_grbl_streamer": ("grbl 1.1, terminal", "grbl-streamer 2.0.2"),
    "test_25_pipython": ("PI GCS 2.0", "pipython 2.11.0.6"),
    "test_26_zaber_motion": ("Zaber ASCII", "zaber-motion 10.2.0"),
    "test_27_alpyca_focuser": ("ASCOM Alpaca, focuser", "alpyca 3.1.3"),
    "test_27_alpyca_rotator": ("ASCOM Alpaca, rotator", "alpyca 3.1.3"),
}
"""Protocol and client by test."""


class Seen:
    """A plugin that takes down what came of each test, and what its scripts have measured."""

    def __init__(self) -> None:
        self.rows: dict[str, tuple[str, str]] = {}

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Note a test that has ended."""
        if report.when == "call" or report.outcome != "passed":
            measured, foreign.MEASURED[:] = foreign.MEASURED[:], []
            trip = f"{min(measured):.2f} ms" if measured else ""
            self.rows[report.nodeid.rpartition("::")[2]] = (report.outcome, trip)


def main() -> int:
    """Run the tests, write the page; the status is theirs."""
    seen = Seen()
    words = [str(ROOT / "tests" / "acceptance" / "test_faces.py"), "-q", "-p", "no:benchmark", "-m", "not long"]
    status = int(pytest.main(words, plugins=[seen]))
    lines = ["| Protocol | Client | What passed | A question takes |", "|---|---|---|---|"]
    for test, (protocol, client) in CLIENTS.items():
        outcome, trip = seen.rows.get(test, ("not run", ""))
        number = re.sub(r"^test_(\d\d(?:_\d\d)?).*", r"\1", test).replace("_", ", ")
        lines.append(f"| {protocol} | {client} | test {number}: {outcome} | {trip} |")
    page = ROOT / "docs" / "explanation" / "faces-table.md"
    page.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return status


if __name__ == "__main__":
    sys.exit(main())
