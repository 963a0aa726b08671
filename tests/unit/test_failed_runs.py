"""Reports of runs that failed, in every way that an axis can: the sentence first, and nothing empty or misleading."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from tests.page_reader import Reader, charts_of

import detent

pytestmark = pytest.mark.compiled

MOVES = "target [mm],dwell [ms]\n60,50\n90,50\n"
PITCHES = "target [in],dwell [ms]\n0.2,20\n1.5,20\n"
AFTER_A_JOG = '[[move]]\njog = "group_a"\nspeed = "5 mm/s"\nduration = "0.1 s"\n[[move]]\nby = {group_a = "-10.7 mm"}\n'
STATIONS = "[[step]]\ngo = 1\n[[step]]\ngo = 2\n"
FAST = ("limits.acceleration=8 m/s^2", "limits.speed=60 mm/s", "drive.torque_safety=1")


class Failure(NamedTuple):
    """A run that fails."""

    axis: str
    job: str  # an example, or the text of one
    says: str  # in the lead
    overrides: tuple[str, ...] = ()


def push(force: str, at: str) -> tuple[str, ...]:
    """A force from a moment on."""
    return tuple(f"disturbance.push.{key}" for key in (f"force={force}", f"at={at}", "duration=20 s"))


def sticky(force: str) -> tuple[str, ...]:
    """Friction to both sides."""
    return tuple(
        f"mechanics.friction.{side}.{kind}={force}" for side in ("right", "left") for kind in ("static", "coulomb")
    )


def drawn_curves(chart: dict[str, Any]) -> Iterator[tuple[str, list[Any]]]:
    """Label and values of every curve; what is drawn as loops has its values there, the series is for the legend."""
    loops = chart.get("loops", [])
    yield from (("loop", loop["y"]) for loop in loops)
    in_legend = len({loop["colour"] for loop in loops})
    for curve in chart["series"][: len(chart["series"]) - in_legend]:
        yield curve["label"], curve["y"]


# One of each method in the ordinary tests, the others in the wide ones.
ORDINARY = {
    "slide, following error": Failure("filtered_servo.toml", MOVES, "0 of 2 moves", ("limits.effort=20 N",)),
    "carriage, never ready": Failure(
        "phase_servo.toml", PITCHES, "before the first of 2 moves", ("detector.jitter=0.6 us",)
    ),
    "head, obstacle": Failure(
        "print_head.toml", "letter.txt", "before the first of 11 lines", ("disturbance.obstacle.position=6 in",)
    ),
    "zoom, refused on its way": Failure("zoom.toml", AFTER_A_JOG, "Stopped after 1 of 2 moves"),
    "table, held back": Failure(
        "rotary_table.toml", STATIONS, "of 2 steps",
        tuple(f"disturbance.load.{key}" for key in ("torque=-270 N*m", "at=0 s", "duration=100 s")),
    ),
    "cascade, stuck": Failure("cascade.toml", MOVES, "0 of 2 moves", ("limits.effort=1 N",)),
}  # fmt: skip
WIDE = {
    "slide, stuck": Failure("filtered_servo.toml", MOVES, "blocked axis", sticky("900 N")),
    "slide, too fast": Failure("filtered_servo.toml", MOVES, "force that exceeds the effort", push("500 N", "0.7 s")),
    "slide, late": Failure(
        "filtered_servo.toml", MOVES, "did not arrive within",
        ("method.in_position=0", "method.position_gain=0.2", "method.timeout=0.5 s", *sticky("9 N")),
    ),
    "slide, noise": Failure(
        "filtered_servo.toml", MOVES, "signals arrival but rests", ("disturbance.lines.inserted=200 Hz",)
    ),
    "carriage, stuck": Failure("phase_servo.toml", PITCHES, "blocked axis", sticky("90 N")),
    "head, carried away in a line": Failure(
        "print_head.toml", "letter.txt", "Stopped after 1 of 11 lines", push("-60 N", "8.1 s")
    ),
    "head, runaway": Failure("print_head.toml", "letter.txt", "obstructed", push("200 N", "8.1 s")),
    "head, lost edges": Failure("print_head.toml", "letter.txt", "obstructed", ("encoder.missing_edges=0.02",)),
    "head, never moves": Failure("print_head.toml", "letter.txt", "before the first", sticky("60 N")),
    "head, pushed while homing": Failure("print_head.toml", "letter.txt", "before the first", push("60 N", "0.1 s")),
    "head, pushed in a pass": Failure("print_head.toml", "letter.txt", "before the first", push("60 N", "4.5 s")),
    "stage, lost steps": Failure(
        "stage.toml", "tiles.csv", "motor x lost 32 steps", tuple(f"stepper.x.{key}" for key in FAST)
    ),
}  # fmt: skip


@pytest.mark.parametrize(
    "failure",
    [
        *(pytest.param(one, id=name) for name, one in ORDINARY.items()),
        *(pytest.param(one, id=name, marks=pytest.mark.wide) for name, one in WIDE.items()),
    ],
)
def test_a_report_of_a_failed_run_says_what_happened_and_shows_nothing_empty(failure: Failure, tmp_path: Path) -> None:
    job = failure.job
    if "\n" in job:
        (tmp_path / f"job.{'toml' if '[[' in job else 'csv'}").write_text(job, encoding="utf-8")
        (job,) = map(str, tmp_path.glob("job.*"))
    else:
        job = str(detent.example(job))
    run = detent.load(detent.example(failure.axis), failure.overrides).run(job)
    assert not run.done
    page = run.report(tmp_path / "report.html").read_text(encoding="utf-8")
    text = Reader(page).text
    # The verdict, how far it came, and why: before any figure, warning or table.
    lead = text[: text.index("of 11" if "lines" in failure.says else "of ", text.index(run.failure[1:40]) + 40)]
    assert re.search(r"✘ Not (done|printed)", lead)
    assert failure.says in lead
    assert "0 s into the job" not in re.sub(r"\d\.\d+ s", "", lead)
    assert not re.search(r"\b(nan|inf|None)\b", text, flags=re.IGNORECASE)
    for chart in charts_of(page):
        for label, values in drawn_curves(chart):
            assert any(y is not None for y in values), (chart["id"], label)
        assert len(chart["x"]) > 1
    # No card without its figure, and none that a run cannot have that never came to rest.
    assert "–" not in text[: text.find("Results")] if "Results" in text else True
    given_up = re.search("did not arrive|drive is off", run.failure)
    if given_up and failure.axis == "filtered_servo.toml":
        assert "Off its target in the end" in text
        assert "Worst error at rest" not in text


def test_the_end_of_a_print_run_that_failed_is_drawn(tmp_path: Path) -> None:
    axis = detent.load(detent.example("print_head.toml"), ["disturbance.obstacle.position=6 in"])
    run = axis.run(detent.example("letter.txt"))
    page = run.report(tmp_path / "report.html").read_text(encoding="utf-8")
    text = Reader(page).text
    assert "How the run ended: speed and drive" in text
    assert "the run ends here" in text
    assert "the run ended before, with the defaults in force" in text
    assert "Throughput" not in text
    assert "No line was printed." in text
    (end,) = (chart for chart in charts_of(page) if chart["id"] == "end-drive")
    assert end["x"][-1] <= 1000
