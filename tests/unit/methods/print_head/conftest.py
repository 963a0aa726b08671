import numpy as np
import pytest

from detent.methods.print_head.page_data import (
    ColumnErrors,
    Constant,
    HeadPath,
    IdentifiedLine,
    LineResult,
    Marks,
    ReportData,
    SpeedProfile,
    TurnAround,
)
from detent.page.parts import INCH, Event, Note


@pytest.fixture
def marks() -> Marks:
    """Two lines of two pages, right then left; the third mark is 60 µm right of its column, bold."""
    column = np.array([0.0, 0.1, 0.3, 0.2]) * INCH
    return Marks(
        characters=["H", "i", "<", "&"],
        page=np.array([1, 1, 2, 2]),
        line=np.array([1, 1, 2, 2]),
        baseline=np.array([0.5, 0.5, 1.0, 1.0]) * INCH,
        column=column,
        landed=column + np.array([1e-6, -2e-6, 60e-6, 0.0]),
        width=np.full(4, 0.1 * INCH),
        direction=np.array([1, 1, -1, -1]),
        strikes=np.array([1, 1, 2, 1]),
    )


@pytest.fixture
def errors() -> ColumnErrors:
    """The columns of those characters: eight each, but only one of the bold one is 60 µm off."""
    right, left = np.zeros(6001, dtype=np.int64), np.zeros(6001, dtype=np.int64)
    right[3000 + 10], right[3000 - 20] = 8, 8
    left[3000], left[3000 + 600] = 15, 1
    return ColumnErrors(
        bin_width=1e-7, right=right, left=left, worst=60e-6, rms=np.sqrt((8 + 8 * 4 + 3600) / 32) * 1e-6
    )


@pytest.fixture
def profile() -> SpeedProfile:
    t = np.arange(0, 0.3, 1e-4)
    speed = np.interp(t, [0, 0.1, 0.2, 0.3], [0, 40 * INCH, 40 * INCH, 0])
    return SpeedProfile(
        line=1,
        direction=1,
        t=t,
        velocity=speed,
        velocity_ref=np.where(t < 0.25, speed, np.nan),
        drive=np.where(t < 0.1, 291, 195),
        transition=(t >= 0.2) & (t < 0.25),
        print_span=(0.11, 0.19),
        events=[Event(0.0, "start", 132), Event(0.2, "stop begins <TR>", 99)],
    )


@pytest.fixture
def turn() -> TurnAround:
    t = np.arange(-0.01, 0.15, 1e-4)
    return TurnAround(
        line_from=1,
        line_to=2,
        t=t,
        current=np.where(t < 0, 0.376, -0.638),
        velocity=np.interp(t, [0, 0.133], [40 * INCH, -40 * INCH]),
        transition=(t >= 0) & (t < 0.0414),
        events=[Event(0.0, "stop begins", 99), Event(0.0668, "zero speed")],
    )


@pytest.fixture
def path() -> HeadPath:
    t = np.arange(0, 2, 1e-3)
    position = (5 + 4 * np.sin(np.pi * (t - 0.5))) * INCH
    return HeadPath(
        t=t, position=position, printing=np.abs(position - 5 * INCH) < 3 * INCH, travel=14.5 * INCH, column0=1.5 * INCH
    )


@pytest.fixture
def identified() -> tuple[IdentifiedLine, IdentifiedLine]:
    return (
        IdentifiedLine(
            direction=1, slope=170, friction=36, points=[(208, 174), (47, 67)], true_slope=170, true_friction=36,
            default_slope=152, default_friction=32,
        ),
        IdentifiedLine(direction=-1, slope=170, friction=28),
    )  # fmt: skip


@pytest.fixture
def report(
    marks: Marks,
    errors: ColumnErrors,
    profile: SpeedProfile,
    turn: TurnAround,
    path: HeadPath,
    identified: tuple[IdentifiedLine, ...],
) -> ReportData:
    return ReportData(
        axis_name="daisy & wheel",
        job_name="LETTER.TXT",
        printed=True,
        duration=0.8,
        line_count=2,
        page_count=2,
        character_count=4,
        lines=[
            LineResult(1, 1, 40 * INCH, turn_around=False, start=0.0, stop=0.3, characters=2, worst_error=2e-6,
                       rms_error=1.6e-6),
            LineResult(2, -1, 20 * INCH, turn_around=True, start=0.3, stop=0.8, characters=2, worst_error=60e-6,
                       rms_error=42e-6),
        ],
        marks=marks,
        errors=errors,
        column_limit=100e-6,
        path=path,
        profile=profile,
        turn_around=turn,
        identified=identified,
        constants=[Constant("slope K, right", "1/256 count per speed value", 171.0, 170.0, "back-EMF"),
                   Constant("tau", "ms", None, 40.16)],
        notes=[Note("note", "ESC A accepted"), Note("warning", "headroom <3 %")],
        settings={"seed": "7"},
    )  # fmt: skip
