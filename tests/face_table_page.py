"""The page of the clients of the faces, from what `tests.face_table` has kept; nothing is run or measured here."""

import ast
import re
from collections.abc import Iterator
from typing import Any

from tests.places import ROOT

KEPT = ROOT / "docs" / "face_figures.json"
PAGE = ROOT / "docs" / "explanation" / "faces-table.md"
TESTS = ROOT / "tests" / "acceptance" / "test_faces.py"
CLIENTS: dict[str, tuple[str, tuple[str, ...]]] = {
    "test_01_ophyd_epics_motor[pyepics]": ("EPICS, Channel Access", ("ophyd", "pyepics")),
    "test_01_ophyd_epics_motor[caproto]": ("EPICS, Channel Access", ("ophyd", "caproto")),
    "test_02_03_ophyd_async_motor[epics-ca]": ("EPICS, Channel Access", ("ophyd-async", "aioca")),
    "test_02_03_ophyd_async_motor[pva-pva]": ("EPICS, PV Access", ("ophyd-async", "p4p")),
    "test_04_bluesky_scans_also_after_a_stop": ("EPICS, Channel Access", ("bluesky", "ophyd")),
    "test_09_base_node_402_on_a_virtual_bus": ("CiA 402, virtual bus", ("canopen",)),
    "test_10_the_same_on_slcan_from_another_process": ("CiA 402, slcan", ("canopen",)),
    "test_11_the_same_on_udp_multicast_with_the_filters_that_are_printed[2]": ("CiA 402, multicast", ("canopen",)),
    "test_15_through_the_process_of_the_face_in_wall_time": ("CiA 402, slcan, cyclic", ("canopen",)),
    "test_19_mbpoll": ("Modbus TCP", ("mbpoll",)),
    "test_20_modbus_serial": ("Modbus TCP", ("modbus-serial",)),
    "test_20_pymodbus": ("Modbus TCP", ("pymodbus",)),
    "test_23_pyvisa_over_a_socket": ("SCPI, TCP", ("pyvisa", "pyvisa-py")),
    "test_23_pyvisa_over_a_serial_terminal": ("SCPI, terminal", ("pyvisa", "pyvisa-py")),
    "test_24_grbl_streamer": ("grbl 1.1, terminal", ("grbl-streamer",)),
    "test_25_pipython": ("PI GCS 2.0", ("pipython",)),
    "test_26_zaber_motion": ("Zaber ASCII", ("zaber-motion",)),
    "test_27_alpyca_focuser": ("ASCOM Alpaca, focuser", ("alpyca",)),
    "test_27_alpyca_rotator": ("ASCOM Alpaca, rotator", ("alpyca",)),
    "test_30_a_stage_is_two_motors_of_epics_and_bluesky_visits_its_tiles": ("EPICS, two motors", ("bluesky", "ophyd")),
    "test_30_a_stage_is_two_axes_of_grbl": ("grbl 1.1, two axes", ("grbl-streamer",)),
    "test_30_a_stage_is_two_axes_of_gcs": ("PI GCS 2.0, two axes", ("pipython",)),
    "test_30_a_stage_is_two_axes_of_a_zaber_device": ("Zaber ASCII, two axes", ("zaber-motion",)),
}
"""Protocol and clients by test."""
LOADS = {
    "skipped": ("periods skipped", "{:.2%}"), "work": ("computing in a period", "{:.0f} us"),
    "axis": ("processor, of the axis' process", "{:.0f}%"), "faces": ("processor, of all its faces", "{:.0f}%"),
}  # fmt: skip
PASSED = "passed", "passed when run again"  # a machine that others use as well may be too slow for a client once
NUMBERS = range(1, 33)  # of the tests that are asked for
HEAD = """# Faces: clients, times and load

This page is written by `python -m tests.face_table`, run from the root of the project; do not edit it. That runs every
acceptance test of the faces but those that take minutes, with unmodified clients. The figures are those of
{processors} processors of {processor}, Linux {system}, on {day}; {load:g} processes wanted a processor in the minute
before. Run it again after a change of the tests or of a client: a test sees to it that the page belongs to both.

## Clients

The time of a question and its answer is the client's, in a process of its own: the median, and that within which 99 of
100 came.

| Protocol | Client | Test | What came of it | A question takes | 99 of 100 |
| --- | --- | --- | --- | --: | --: |
"""
COST = """
## What faces cost

SCPI, GCS, Zaber, Modbus and a panel, each asked fifty times a second while the axis moves, with the other faces there
as well (test 28); beside it the loop of the same axis without a face. A period has 10 ms.

| | alone | polled |
| --- | --: | --: |
"""
NUMBERED = """
## Tests of the specification

| Number | What is looked at | Passed |
| --: | --- | --- |
"""


def names_of(pins: Any) -> dict[str, str]:
    """Version by client, as `tests.foreign` pins them."""
    pinned = [one.split("==") for packages in pins.PACKAGES.values() for one in packages]
    name, _, version = pins.NPM.partition("@")
    return {**dict(pinned), name: version}


def present_tests() -> set[str]:
    """Names of the acceptance tests that there are."""
    tree = ast.parse(TESTS.read_text(encoding="utf-8"))
    return {one.name for one in tree.body if isinstance(one, ast.FunctionDef) and one.name.startswith("test_")}


def kept_tests(kept: dict[str, Any]) -> set[str]:
    """Names of those that were run."""
    return {name.partition("[")[0] for name in kept["tests"]}


def about(name: str) -> str:
    """What a test looks at.

    >>> about("test_02_03_ophyd_async_motor[epics-ca]")
    'ophyd async motor'
    """
    return re.sub(r"^test_(\d\d_)+", "", name.partition("[")[0]).replace("_", " ")


def numbers_of(name: str) -> list[int]:
    """Numbers of the specification that a test is of.

    >>> numbers_of("test_02_03_ophyd_async_motor[epics-ca]"), numbers_of("test_20_pymodbus")
    ([2, 3], [20])
    """
    return [int(one) for one in re.findall(r"_(\d\d)(?=_)", name.partition("[")[0])]


def client_rows(kept: dict[str, Any]) -> Iterator[str]:
    """Protocol, client, what passed, how long a question takes."""
    for test, (protocol, names) in CLIENTS.items():
        one = kept["tests"].get(test, {"outcome": "not run"})
        client = ", ".join(f"{name} {kept['versions'][name]}" for name in names)
        trip = one.get("round_trips")
        times = f"{trip['p50']:.2f} ms | {trip['p99']:.2f} ms" if trip else " | "
        number = ", ".join(map(str, numbers_of(test)))
        yield f"| {protocol} | {client} | {number} | {one['outcome']} | {times} |"


def load_rows(kept: dict[str, Any]) -> Iterator[str]:
    """The loop alone, and with four faces and a panel that are asked fifty times a second."""
    loop = next((one["loop"] for one in kept["tests"].values() if "loop" in one), None)
    if loop is None:
        yield "| not measured | | |"
        return
    for key, (what, form) in LOADS.items():
        shown = " | ".join(form.format(loop[when][key]).replace("%", " %") for when in ("alone", "polled"))
        yield f"| {what} | {shown} |"


def rows_by_number(kept: dict[str, Any]) -> Iterator[str]:
    """Of each number what was run, and what came of it."""
    for number in NUMBERS:
        of_it = {name: one["outcome"] for name, one in kept["tests"].items() if number in numbers_of(name)}
        passed = sum(outcome in PASSED for outcome in of_it.values())
        others = [f"`{name}` {outcome}" for name, outcome in of_it.items() if outcome != PASSED[0]]
        told = "; ".join([f"{passed} of {len(of_it)}" if of_it else "**not run**", *others])
        names = sorted({about(name) for name in of_it})
        yield f"| {number} | {'; '.join(names)} | {told} |"


def page(kept: dict[str, Any]) -> str:
    """The page."""
    parts = (HEAD.format(**kept["where"]), client_rows(kept)), (COST, load_rows(kept)), (NUMBERED, rows_by_number(kept))
    return "".join(head + "\n".join(rows) + "\n" for head, rows in parts)
