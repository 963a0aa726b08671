"""detent: positioning control as software.

>>> import detent
>>> axis = detent.load(detent.example("print_head.toml"))
>>> axis.name
'print head'
"""

from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from detent.axis import Axis, Run, Timing, load, load_trace
    from detent.identify.identified import identify_axis

__version__ = "0.1.0"

__all__ = ["Axis", "Run", "Timing", "__version__", "example", "examples", "identify_axis", "load", "load_trace"]


def __getattr__(name: str) -> Any:
    """The API loads when it is first used, so that `import detent` and `detent --help` stay quick."""
    if name in ("Axis", "Run", "Timing", "load", "load_trace"):
        from detent import axis

        return getattr(axis, name)
    if name == "identify_axis":
        from detent.identify.identified import identify_axis

        return identify_axis
    raise AttributeError(f"module 'detent' has no attribute {name!r}; it has {', '.join(__all__)}")


def examples() -> list[Path]:
    """The packaged example files: axis files and jobs."""
    folder = Path(__file__).resolve().parent / "examples"
    return sorted(path for path in folder.iterdir() if path.is_file() and not path.name.startswith("__"))


def example(name: str) -> Path:
    """Path of a packaged example; a `DetentError` lists those there are where there is none of that name."""
    from detent.errors import DetentError

    found = {path.name: path for path in examples()}
    if name not in found:
        raise DetentError(f"example {name!r}: there is none of that name; choose one of {', '.join(found)}")
    return found[name]
