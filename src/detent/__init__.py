"""detent: positioning control as software.

>>> import detent
>>> axis = detent.load(detent.example("print_head.toml"))
>>> axis.name
'print head'
"""

from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from detent.axis import Axis, load
    from detent.errors import DetentError, InputError
    from detent.identify.analysed import Analysed, analyse
    from detent.identify.identified import Identified, identify_axis
    from detent.identify.records import Compared, compare_records
    from detent.operate.client import LiveAxis
    from detent.operate.start import connect, live
    from detent.record.trace_files import load_trace
    from detent.runs import Run, Timing
    from detent.tune.hunted import Hunted
    from detent.tune.searched import Searched
    from detent.tune.tolerated import Tolerated
    from detent.tune.tuned import Tuned

__version__ = "0.1.0"

_PLACES = {
    "detent.axis": ("Axis", "load"),
    "detent.errors": ("DetentError", "InputError"),
    "detent.identify.analysed": ("Analysed", "analyse"),
    "detent.identify.identified": ("Identified", "identify_axis"),
    "detent.identify.records": ("Compared", "compare_records"),
    "detent.operate.start": ("connect", "live"),
    "detent.operate.client": ("LiveAxis",),
    "detent.record.trace_files": ("load_trace",),
    "detent.runs": ("Run", "Timing"),
    "detent.tune.hunted": ("Hunted",),
    "detent.tune.tolerated": ("Tolerated",),
    "detent.tune.searched": ("Searched",),
    "detent.tune.tuned": ("Tuned",),
}
"""Where the words of the API stand; each loads at its first use: `import detent` and `detent --help` stay quick."""

__all__ = [
    "Analysed", "Axis", "Compared", "DetentError", "Hunted", "Identified", "InputError", "LiveAxis", "Run", "Searched",
    "Timing", "Tolerated", "Tuned",
    "__version__",
    "analyse", "compare_records", "connect", "example", "examples", "identify_axis", "live", "load", "load_trace",
]  # fmt: skip


def __getattr__(name: str) -> Any:
    """Load a word of the API at its first use."""
    place = next((place for place, names in _PLACES.items() if name in names), None)
    if place is None:
        raise AttributeError(f"module 'detent' has no attribute {name!r}; it has {', '.join(__all__)}")
    globals()[name] = found = getattr(import_module(place), name)
    return found


def __dir__() -> list[str]:
    """Give the words of the API, for completion; the rooms inside are not for typing."""
    return sorted([*__all__, "__doc__", "__file__", "__name__", "__path__"])


def examples() -> list[Path]:
    """The packaged example files: axis files, jobs, and a notebook."""
    folder = Path(__file__).resolve().parent / "examples"
    return sorted(path for path in folder.iterdir() if path.is_file() and not path.name.startswith("__"))


def example(name: str) -> Path:
    """Path of a packaged example; a `DetentError` lists those there are where there is none of that name."""
    from detent.errors import DetentError

    found = {path.name: path for path in examples()}
    if name not in found:
        raise DetentError(f"example {name!r}: there is none of that name; choose one of {', '.join(found)}")
    return found[name]
