"""The comparisons of a phase servo as tables for the terminal."""

from typing import Any

from detent.methods.method import Table
from detent.methods.phase_servo.hold_comparison import HoldComparison
from detent.methods.phase_servo.noise_comparison import NoiseComparison
from detent.units import format_quantity


def comparison_table(found: NoiseComparison | HoldComparison) -> Table:
    """Title, heads and rows."""
    return _noise_table(found) if isinstance(found, NoiseComparison) else _hold_table(found)


def _noise_table(found: NoiseComparison) -> Table:
    heads = ("pulses put in", "this servo, + pulses", "- pulses", "incremental servo, + pulses", "- pulses")
    rows = [
        (str(n), *(_range(rest[k, sign]) for rest in (found.absolute, found.incremental) for sign in (0, 1)))
        for k, n in enumerate(found.pulses)
    ]
    title = (
        f"Where a move of {found.pitches} pitches ends, in steps of {format_quantity(found.step, 'm')} from its target "
        f"(right / left; a pitch off from {found.margin} pulses on)"
    )
    return title, heads, rows


def _range(pair: Any) -> str:
    """Right and left, as whole numbers where they are far, else with two digits."""
    return " / ".join(f"{value:+.0f}" if abs(value) >= 10 else f"{value:+.2f}" for value in pair)


def _hold_table(found: HoldComparison) -> Table:
    rows: list[tuple[str, ...]] = []
    for case in (*found.still, *found.loaded):
        late = case.t > case.t[-1] - 0.1
        last = case.displacement[late]
        rows.append((case.name, f"{last.max() - last.min():.2f}", f"{last.mean():+.2f}", f"{case.integral[-1]:g}"))
    return "Standing still, last 0.1 s, in steps", ("servo", "peak to peak", "mean displacement", "integral"), rows
