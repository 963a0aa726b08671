"""Figures as files: signals of a trace.

matplotlib is loaded when a figure is drawn, never when this module is imported, and draws without a display.
"""

import importlib
import io
import warnings
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any, cast

import numpy as np

from detent.errors import DetentError
from detent.files.marks import WROTE
from detent.files.text import check_target, shown, writing
from detent.page.chart import thin_indices
from detent.record.trace import Trace

# matplotlib's stubs leave every **kwargs untyped, so that strict checking would refuse each call.
Axes = Any
Figure = Any

POINTS = 8000  # points of one curve: more than a printed page resolves

# Okabe and Ito's colours, told apart by colour-blind readers, with the yellow that is too light on white left out.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", "#000000")

ABOVE: dict[str, Any] = {"loc": "lower left", "bbox_to_anchor": (0.0, 1.0), "borderaxespad": 0.2}
"""Place of a legend: above the curves, never over them."""

STYLE: dict[str, Any] = {
    "font.size": 10,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#e3e6ea",
    "axes.edgecolor": "#7d8996",
    "axes.titlesize": 11,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "legend.frameon": False,
    "svg.fonttype": "none",  # text stays text: searchable and editable
    "svg.hashsalt": "detent",  # the same figure gives the same file
    "savefig.dpi": 150,
    "text.parse_math": False,  # a dollar sign in a name or a description is one
}


def plot_signals(
    trace: Trace,
    signals: Sequence[str],
    path: str | Path | None = None,
    t_range: tuple[float, float] | None = None,
    *,
    force: bool = False,
) -> Figure:
    """Draw signals over time, one plot area per unit, above one another; into a file too where one is named."""
    path = None if path is None else check_target(path, force=force)
    names = trace.match(signals)
    if not names:
        raise DetentError(f"{path or 'plot'}: no signal was asked for; name one of: {', '.join(trace.signals)}")
    if t_range:
        trace = trace.between(*t_range)
    if not len(trace):
        raise DetentError(f"{path or 'plot'}: the trace holds no rows, so there is nothing to draw")
    groups: dict[str, list[str]] = {}
    for name in names:
        groups.setdefault(trace.units.get(name, ""), []).append(name)
    with new_figure(path, 9.0, 1.0 + 2.1 * len(groups), force=force) as figure:
        axes: list[Axes] = list(figure.subplots(len(groups), sharex=True, squeeze=False)[:, 0])
        scale, unit = (1e3, "ms") if trace.time[-1] - trace.time[0] < 1.0 else (1.0, "s")
        for area, (group_unit, members) in zip(axes, groups.items(), strict=True):
            _draw_group(area, trace, members, group_unit, scale)
            area.margins(x=0)
        axes[-1].set_xlabel(f"time [{unit}]")
        title = " · ".join(str(trace.attributes[key]) for key in ("axis", "job") if key in trace.attributes)
        if title:
            figure.suptitle(shown(title), x=0.01, ha="left", fontsize=11, fontweight="bold")
        figure.align_ylabels(axes)
    return figure


def _draw_group(area: Axes, trace: Trace, names: Sequence[str], unit: str, scale: float) -> None:
    labels, unit = [shown(name) for name in names], shown(unit)
    for index, name in enumerate(names):
        values = trace[name]
        kept = thin_indices(values, POINTS)
        # Whole numbers and flags hold until they change: a slope between them would be an invention.
        style = "steps-post" if values.dtype.kind in "biu" else "default"
        colour = COLOURS[index % len(COLOURS)]
        dash = ("-", "--", ":")[index // len(COLOURS) % 3]
        drawn = np.asarray(values[kept], dtype=np.float64)
        times = trace.time[kept] * scale
        area.plot(times, drawn, dash, color=colour, linewidth=1.2, label=labels[index], drawstyle=style)
    if len(names) == 1:
        area.set_ylabel(f"{labels[0]}\n[{unit}]" if unit else labels[0])  # two lines, for the side of a low plot area
    else:
        area.set_ylabel(f"[{unit}]" if unit else "")
        area.legend(**ABOVE, ncols=3, fontsize=9)
    if all(trace[name].dtype.kind == "b" for name in names):
        area.set_yticks([0, 1], ["off", "on"])


@cache
def _kind() -> Any:
    """Class of the figures: matplotlib's, which keeps its look when it is written and shows itself in a notebook."""
    from matplotlib.figure import Figure as Plain

    mpl: Any = importlib.import_module("matplotlib")

    base = cast("Any", Plain)  # its stubs leave **kwargs untyped

    class StyledFigure(base):
        def savefig(self, fname: Any, **options: Any) -> None:
            """Write the figure in its own style."""
            # matplotlib looks some settings up only when it writes.
            with mpl.rc_context(STYLE):
                base.savefig(self, fname, **options)

        def _repr_png_(self) -> bytes:
            picture = io.BytesIO()
            self.savefig(picture, format="png", dpi=100)
            return picture.getvalue()

    return StyledFigure


@contextmanager
def new_figure(path: Path | None, width: float, height: float, *, force: bool = False) -> Generator[Figure]:
    """Give an empty figure [in] and write it at the end, without pyplot: no window, no global state."""
    mpl: Any = importlib.import_module("matplotlib")
    with mpl.rc_context(STYLE), warnings.catch_warnings():
        # A letter that the font has not is drawn as a box.
        warnings.filterwarnings("ignore", message="Glyph .* missing from", category=UserWarning)
        figure = _kind()(figsize=(width, height), layout="constrained")
        yield figure
        if path is None:
            return
        # The same figure gives the same file: no date inside, and places free of the last bits, in which the solver of
        # the layout goes by where its variables lie in memory.
        figure.get_layout_engine().execute(figure)
        figure.set_layout_engine("none")
        for area in figure.axes:
            area.set_position(area.get_position().from_extents(area.get_position().extents.round(6)))
        kind = path.suffix.lower().removeprefix(".")
        made = f"{WROTE}, Matplotlib {mpl.__version__}"
        metadata = {"svg": {"Date": None, "Creator": made}, "pdf": {"CreationDate": None, "Creator": made}}
        with writing(path, force=force) as part:
            figure.savefig(part, format=kind, metadata=metadata.get(kind, {"Software": made}))
