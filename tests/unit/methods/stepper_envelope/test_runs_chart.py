import numpy as np
import pytest
from tests.unit.methods.stepper_envelope.samples import MM, STEP

import detent
from detent.methods.load import load_spec
from detent.methods.stepper_envelope.schema import StepperTable
from detent.methods.stepper_envelope.stage_trace import Arc, Envelope, Runs, runs_chart


@pytest.fixture(scope="module")
def table() -> StepperTable:
    """40 mm in steps of 5 um, up to 4 kHz, with one zone of 1 kHz upwards from 10 to 13 mm."""
    table = load_spec(detent.example("zoom.toml")).stepper["group_a"]
    return table.model_copy(update={"zone": {"near": table.zone["near"].model_copy(update={"direction": "up"})}})


def envelope(*, up: bool = True, down: bool = True) -> Envelope:
    return Envelope(
        position=np.array([0.0, STEP, 10 * MM, 13 * MM, 40 * MM - STEP, 40 * MM]),
        up=up * np.array([400.0, 4000.0, 1000.0, 4000.0, 400.0, 0.0]),
        down=down * np.array([400.0, 4000.0, 4000.0, 4000.0, 400.0, 0.0]),
    )


def arc(direction: int = 1, low: float = 0.0, high: float = 30 * MM) -> Arc:
    """From rest over 2 kHz to rest."""
    places = np.array([low, low + STEP / 2, high - STEP / 2, high])
    return Arc(direction=direction, position=places[::direction], hz=np.array([0.0, 2000.0, 2000.0, 0.0]))


def curves_of(chart: dict) -> dict:
    return {series["label"]: series["y"] for series in chart["series"]}


def test_up_is_above_zero_and_down_below_it(table) -> None:
    chart = runs_chart(Runs("x", table, envelope(), [arc(), arc(-1)]), "runs-0")
    drawn = curves_of(chart)
    at = chart["x"].index(10.0)
    assert (drawn["permissible, up"][at], drawn["permissible, down"][at]) == (1000.0, -4000.0)
    assert (chart["x"][0], chart["x"][-1]) == (0.0, 40.0)
    up, down = chart["loops"]
    assert (up["colour"], up["y"]) == ("right", [0.0, 2000.0, 2000.0, 0.0])
    assert (down["colour"], down["y"]) == ("left", [0.0, -2000.0, -2000.0, 0.0])
    assert down["x"] == up["x"][::-1]
    assert [series["label"] for series in chart["series"][2:]] == ["steps made, up", "steps made, down"]
    assert chart["yRange"] == [-5000.0, 5000.0]
    assert [level["y"] for level in chart["levels"]] == [4000.0, -4000.0]
    assert chart["levels"][0]["label"].replace("\u202f", " ") == "limit 4 000 Hz, 20 mm/s"
    assert all(series.get("fill") for series in chart["series"][:2])


def test_zones_are_shaded_where_they_are_and_say_for_which_direction(table) -> None:
    (band,) = runs_chart(Runs("x", table, envelope(), [arc()]), "a")["bands"]
    assert band == {"spans": [[10.0, 13.0]], "colour": "brake", "label": "near: 5 mm/s, up only"}
    far = Runs("x", table, envelope(), [arc(low=20 * MM, high=21 * MM)])
    assert far.zones == {}
    assert runs_chart(far, "a")["bands"] == []


def test_short_runs_are_drawn_with_their_neighbourhood_only(table) -> None:
    runs = Runs("x", table, envelope(), [arc(low=20 * MM, high=30 * MM)])
    assert runs.window == (pytest.approx(18.8 * MM), pytest.approx(31.2 * MM))
    chart = runs_chart(runs, "a")
    assert (chart["x"][0], chart["x"][-1]) == (18.8, 31.2)
    assert curves_of(chart)["permissible, up"] == [4000.0, 4000.0]
    assert Runs("x", table, envelope(), [arc(high=10 * MM)]).window == (0.0, pytest.approx(11.2 * MM))
    assert Runs("x", table, envelope(), [arc()]).window == (0.0, table.upper_end)


def test_a_direction_without_steps_has_little_room(table) -> None:
    chart = runs_chart(Runs("x", table, envelope(down=False), [arc()]), "a")
    assert chart["yRange"] == [-500.0, 5000.0]
    assert list(curves_of(chart)) == ["permissible, up", "steps made, up"]
    chart = runs_chart(Runs("x", table, envelope(up=False), [arc(-1)]), "a")
    assert chart["yRange"] == [-5000.0, 500.0]
    assert chart["levels"][1]["label"].startswith("limit")


def test_high_frequencies_are_written_in_kilohertz(table) -> None:
    fast = table.model_copy(update={"limits": table.limits.model_copy(update={"speed": 0.1})})
    chart = runs_chart(Runs("x", fast, envelope(), [arc()]), "a")
    assert "[kHz]" in chart["yLabel"]
    assert chart["loops"][0]["y"] == [0.0, 2.0, 2.0, 0.0]
    assert curves_of(chart)["permissible, up"][1] == 4.0
    assert chart["levels"][0]["y"] == 20.0
