import pytest
from tests.print_head_rig import EXAMPLE

from detent.methods.load import load_spec
from detent.methods.print_head.print_job import parse_text
from detent.methods.print_head.run import PrintRun, print_job
from detent.methods.print_head.summary import summary_rows

pytestmark = pytest.mark.compiled


def rows_of(text: str, *overrides: str) -> tuple[PrintRun, dict[str, str]]:
    run = print_job(load_spec(EXAMPLE, overrides), parse_text(text))
    return run, dict(summary_rows(run))


def test_a_printed_job_shows_every_figure_with_its_unit() -> None:
    run, rows = rows_of("word\n" + " " * 120 + "edge\n")
    assert list(rows) == [
        "lines", "characters", "time", "speeds", "turn-arounds", "column error", "identified, right",
        "identified, left", "motor",
    ]  # fmt: skip
    assert rows["lines"] == "2 of 2, on 1 page"
    assert rows["characters"] == f"8, {8 / run.print_time:.0f} per second"
    assert rows["time"] == f"{run.print_time:.2f} s, after {run.time_ready:.2f} s of homing and identification"
    slower = min(run.speeds)
    assert rows["speeds"] == f"40 in/s (1 line), {slower / 6:.4g} in/s (1 line)"
    assert rows["column error"] == f"worst {run.worst_error * 1e6:.1f} µm, rms {run.rms_error * 1e6:.1f} µm"
    assert rows["identified, left"].startswith(
        f"slope K {run.identified['left'].slope} (true 170.0), friction 28 counts"
    )
    assert rows["motor"] == f"peak current {run.peak_current:.2f} A, energy {run.energy:.1f} J"


def test_thousands_are_grouped_with_plain_spaces() -> None:
    _, rows = rows_of(("x" * 70 + "\n") * 20)
    assert rows["characters"].startswith("1 400, ")


@pytest.mark.parametrize("place", ["7 in", "2 in"])
def test_of_a_run_that_came_to_nothing_only_what_happened_is_shown(place: str) -> None:
    _, rows = rows_of("word\n", f"disturbance.obstacle.position={place}")
    assert list(rows) == ["lines", "motor"]
    assert rows["lines"] == "0 of 1, on 1 page"
