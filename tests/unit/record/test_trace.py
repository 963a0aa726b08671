import sys

import numpy as np
import pytest

from detent.errors import DetentError
from detent.record.trace import Trace


def make_trace() -> Trace:
    return Trace(
        columns={
            "t": np.array([0.0, 0.1, 0.2, 0.3]),
            "motor.current": np.array([0.0, 1.0, 1.5, -0.5]),
            "motor.voltage": np.array([0.0, 12.0, 18.0, -6.0]),
            "head.drive_cmd": np.array([0, 100, 150, -50], dtype=np.int16),
        },
        units={"t": "s", "motor.current": "A", "motor.voltage": "V"},
        docs={"motor.current": "winding current"},
        attributes={"axis": "demo"},
    )


def test_a_trace_gives_its_columns_length_and_names() -> None:
    trace = make_trace()
    assert len(trace) == 4
    assert trace["motor.current"].tolist() == [0.0, 1.0, 1.5, -0.5]
    assert list(trace) == ["t", "motor.current", "motor.voltage", "head.drive_cmd"]
    assert trace.signals == ("motor.current", "motor.voltage", "head.drive_cmd")
    assert "motor.current" in trace
    assert "motor.power" not in trace


def test_label_carries_the_unit_and_is_bare_without_one() -> None:
    trace = make_trace()
    assert trace.label("motor.current") == "motor.current [A]"
    assert trace.label("head.drive_cmd") == "head.drive_cmd"


def test_a_wrong_name_gets_the_nearest_and_all_names() -> None:
    with pytest.raises(DetentError) as caught:
        make_trace()["motor.curent"]
    assert str(caught.value) == (
        "trace: no signal 'motor.curent'; did you mean 'motor.current'?; "
        "it holds: t, motor.current, motor.voltage, head.drive_cmd"
    )
    assert caught.value.exit_status == 2


def test_between_keeps_both_ends_and_copies_nothing() -> None:
    trace = make_trace()
    part = trace.between(0.1, 0.2)
    assert part.time.tolist() == [0.1, 0.2]
    assert part["head.drive_cmd"].tolist() == [100, 150]
    assert np.shares_memory(part["motor.current"], trace["motor.current"])
    assert part.units == trace.units
    assert part.attributes == trace.attributes


def test_between_refuses_a_stretch_without_rows() -> None:
    with pytest.raises(DetentError, match=r"no rows from 1 s to 2 s; it holds 0 s to 0\.3 s"):
        make_trace().between(1.0, 2.0)


def test_match_takes_names_and_patterns_once_each_in_the_order_asked() -> None:
    trace = make_trace()
    assert trace.match(["motor.*"]) == ("motor.current", "motor.voltage")
    assert trace.match(["head.drive_cmd", "motor.current", "*"]) == ("head.drive_cmd", "motor.current", "motor.voltage")


def test_match_refuses_a_pattern_that_fits_nothing() -> None:
    with pytest.raises(DetentError, match=r"no signal 'carriage\.\*'"):
        make_trace().match(["motor.current", "carriage.*"])


@pytest.mark.parametrize(
    ("columns", "says"),
    [
        ({}, "the first column must be 't' .* got 'nothing'"),
        ({"a": np.zeros(2), "t": np.zeros(2)}, "the first column must be 't' .* got 'a'"),
        ({"t": np.zeros(2), "a": np.zeros(3)}, r"column 'a' has shape \(3,\), 't' has \(2,\)"),
        ({"t": np.zeros((2, 2))}, r"column 't' has shape \(2, 2\)"),
        ({"t": np.zeros(1), "a": np.array(["x"])}, "column 'a' holds <U1; expected: integers, floats, booleans"),
        ({"t": np.zeros(1), "a": np.array([1j])}, "column 'a' holds complex128"),
        ({"t": np.array([0.0, 2.0, 1.0])}, r"after row 2 \(2.0 s, then 1.0 s\)"),
        ({"t": np.array([0.0, np.nan])}, "is not a number after row 1"),
    ],
)
def test_columns_that_make_no_trace_are_refused(columns: dict[str, np.ndarray], says: str) -> None:
    with pytest.raises(DetentError, match=says):
        Trace(columns=columns)


@pytest.mark.parametrize(("kind", "word"), [("units", "unit"), ("docs", "description")])
def test_a_unit_or_description_of_no_column_is_refused(kind: str, word: str) -> None:
    with pytest.raises(DetentError, match=f"a {word} is given for 'motor.speed'"):
        Trace(columns={"t": np.zeros(1)}, **{kind: {"motor.speed": "rad/s"}})


def test_rows_at_one_moment_are_allowed() -> None:
    assert len(Trace(columns={"t": np.array([0.0, 0.0, 1.0])})) == 3


def test_pandas_gets_the_columns_over_time_with_units() -> None:
    trace = make_trace()
    table = trace.to_pandas()
    assert table.index.name == "t"
    assert table.index.tolist() == trace.time.tolist()
    assert list(table.columns) == list(trace.signals)
    assert table["head.drive_cmd"].dtype == np.int16
    assert table.attrs == {"units": trace.units, "docs": trace.docs, "axis": "demo"}


def test_xarray_gets_variables_with_units() -> None:
    trace = make_trace()
    found = trace.to_xarray()
    assert found.sizes == {"t": 4}
    assert found["motor.current"].values.tolist() == trace["motor.current"].tolist()
    assert found["motor.current"].attrs == {"units": "A", "long_name": "winding current"}
    assert found["t"].attrs["units"] == "s"
    assert found.attrs == {"axis": "demo"}


@pytest.mark.parametrize("name", ["pandas", "xarray"])
def test_what_is_not_installed_is_said_with_what_installs_it(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(
        DetentError, match=rf'needs {name}, which is not installed; try: pip install "detent\[{name}\]"'
    ):
        getattr(make_trace(), f"to_{name}")()
