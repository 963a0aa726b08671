"""The figures of a printed job that a person wants first, as rows of text for the terminal."""

from detent.methods.print_head.run import Direction, PrintRun
from detent.page.words import GAP, count


def summary_rows(run: PrintRun) -> list[tuple[str, str]]:
    """Name and text of each figure, such as ("lines", "11 of 11, on 1 page"); what it did not come to is left out."""
    asked = len(run.job.lines)
    rows = [("lines", f"{_plain(len(run.lines))} of {_plain(asked)}, on {_plain(run.job.pages, 'page')}")]
    if run.lines:
        rows += [
            ("characters", f"{_plain(run.characters)}, {run.characters_per_second:.0f} per second"),
            ("time", f"{run.print_time:.2f} s, after {run.time_ready:.2f} s of homing and identification"),
            ("speeds", ", ".join(f"{s / 6:.4g} in/s ({_plain(n, 'line')})" for s, n in run.speeds.items())),
            ("turn-arounds", f"{_plain(run.turn_arounds)}; runs back before a line: {_plain(run.repositions)}"),
            ("column error", f"worst {run.worst_error * 1e6:.1f} µm, rms {run.rms_error * 1e6:.1f} µm"),
        ]
    rows += [(f"identified, {side}", _direction(line)) for side, line in run.identified.items() if line.speed_fast]
    return [*rows, ("motor", f"peak current {run.peak_current:.2f} A, energy {run.energy:.1f} J")]


def _direction(line: Direction) -> str:
    return (
        f"slope K {line.slope} (true {line.true_slope:.1f}), "
        f"friction {line.friction} counts (true {line.true_friction:.1f})"
    )


def _plain(value: int, word: str = "") -> str:
    """A count with ordinary spaces: what a terminal shows and a script splits."""
    return count(value, word).replace(GAP, " ")
