"""What the report of an identification draws within its tables: intervals, bars, the heat map of correlations."""

from collections.abc import Sequence
from html import escape

from detent.identify.fit.estimate import Estimate
from detent.identify.page.identify_words import is_known, relative_half
from detent.page.parts import Numbers
from detent.page.words import number, table

WIDTH, HEIGHT = 170.0, 18.0
"""Of the drawing of an interval [px]."""

REACHES = (0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0)
"""Ends of the scale on which intervals are drawn, over the value."""

LONGEST = 220
"""Longest bar of the ladder [px]."""


# ---- intervals


UNSCALED = ("delay", "stribeck", "loss")
"""Constants that may be near 0 or are hardly ever known well: they do not set the scale."""


def reach_of(estimates: Sequence[Estimate]) -> float:
    """End of the scale on which all intervals are drawn: as wide as the widest needs, delays and the like left out."""
    halves = [relative_half(one) for one in estimates if one.name not in UNSCALED]
    widest = max(halves, default=REACHES[-1])
    return next((reach for reach in REACHES if reach >= widest), REACHES[-1])


def interval_bar(found: Estimate, reach: float, *, trusted: bool) -> str:
    """Draw an interval about its value, on a scale that all constants of a table share."""
    if not is_known(found):
        return '<span style="color:var(--bad)">from nothing to anything</span>'
    half = relative_half(found) / reach
    colour = "var(--good)" if trusted else "var(--bad)"
    middle, room = WIDTH / 2, WIDTH / 2 - 8
    x = min(half, 1.0) * room
    shape = f'x="{middle - x:.1f}" width="{max(2 * x, 1.5):.1f}" y="4" height="10" rx="2"'
    parts = [
        f'<line x1="4" x2="{WIDTH - 4:.0f}" y1="9" y2="9" style="stroke:var(--rule);stroke-width:2"/>',
        f'<rect {shape} style="fill:{colour};opacity:.55"/>',
        f'<line x1="{middle:.0f}" x2="{middle:.0f}" y1="1" y2="17" style="stroke:var(--ink);stroke-width:2"/>',
    ]
    if half > 1.0:
        parts += [
            f'<path d="M{middle + side * (room + 7):.0f} 9l{-side * 8} -6v12z" style="fill:{colour}"/>'
            for side in (-1, 1)
        ]
    label = f"plus or minus {number(100 * relative_half(found), 2)} percent"
    return (
        f'<svg width="{WIDTH:.0f}" height="{HEIGHT:.0f}" role="img" aria-label="{label}" style="display:block">'
        + "".join(parts)
        + "</svg>"
    )


# ---- bars and the heat map


def long_bar(share: float, text: str, *, chosen: bool) -> str:
    """Draw a bar with its figure."""
    colour = "var(--good)" if chosen else "var(--muted)"
    width = max(round(LONGEST * min(max(share, 0.0), 1.0)), 1)
    bar = f'<span class="bar" style="width:{width}px;background:{colour}"></span>'
    return f'{bar}<span class="nowrap">{escape(text)}</span>'


def heat_map(names: Sequence[str], correlation: Numbers, *, limit: float) -> str:
    """Write a correlation table whose cells are the darker the closer they come to 1 or -1."""
    heads = [("", False), *((str(k), True) for k in range(1, len(names) + 1))]
    rows = [
        [f"{k + 1} {escape(name)}", *(_heat_cell(float(r), limit, own=k == j) for j, r in enumerate(correlation[k]))]
        for k, name in enumerate(names)
    ]
    return table(heads, rows)


def signed(value: float) -> str:
    """Write a correlation with its sign.

    >>> signed(0.917), signed(-0.001)
    ('+0.92', '0.00')
    """
    text = f"{value:+.2f}"
    return "0.00" if text in {"+0.00", "-0.00"} else text.replace("-", "\u2212")


def _heat_cell(value: float, limit: float, *, own: bool) -> str:
    if own:
        return '<td class="n" style="color:var(--muted)">1</td>'
    base = "var(--right)" if value > 0 else "var(--left)"
    look = f"background:color-mix(in srgb, {base} {round(70 * abs(value))}%, transparent)"
    if abs(value) > limit:
        look += ";font-weight:700;outline:2px solid var(--bad);outline-offset:-2px"
    return f'<td class="n" style="{look}">{signed(value)}</td>'
