"""Where compiled steps are kept between processes.

Numba stamps a cached function with the contents of its own file only, so an edit of a callee in another file would be
served stale. Here the folder itself is named by a hash over every source that a step can be made of and over the
versions that shape the machine code: any such edit means another folder, and nothing in it can be stale.
"""

import hashlib
import os
import re
import shutil
import sys
from functools import cache
from pathlib import Path

# What a step can be made of, beside the modules of methods that declare steps or registers; nothing else is compiled.
STEP_ROOMS = ("control", "drive", "kernel", "plant", "planning", "sensing", "errors.py", "units.py")
DECLARES = re.compile(r"^from detent\.kernel\.(step|registers) import", re.MULTILINE)  # a method's part of a step
PACKAGE = Path(__file__).resolve().parent.parent
KEPT_FOLDERS = 6  # compiled folders that stay: a few checkouts and versions side by side, not every edit ever made


def user_cache_root() -> Path:
    """Detent's folder in the user's cache folder; ``DETENT_CACHE_DIR`` overrides it."""
    stated = os.environ.get("DETENT_CACHE_DIR")
    if stated:
        return Path(stated)
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA", Path.home() / "AppData" / "Local")) / "detent" / "Cache"
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches" / "detent"
    return Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "detent"


@cache
def source_hash() -> str:
    """Hash of every source that a step can be made of, with the interpreter's and the compiler's versions."""
    import llvmlite
    import numba

    digest = hashlib.sha256(f"{sys.version} {numba.__version__} {llvmlite.__version__}".encode())
    for source in sorted(step_sources()):
        digest.update(str(source.relative_to(PACKAGE)).encode())
        digest.update(source.read_bytes())
    return digest.hexdigest()[:20]


@cache
def step_sources() -> frozenset[Path]:
    """The files whose edits change the hash: only their functions may be cached."""
    rooms = [PACKAGE / room for room in STEP_ROOMS]
    found = [s for room in rooms for s in ([room] if room.is_file() else room.rglob("*.py"))]
    methods = [s for s in PACKAGE.glob("methods/*/*.py") if DECLARES.search(s.read_text("utf-8"))]
    return frozenset([*found, *methods])


@cache
def compiled_folder() -> Path:
    """Folder of this package's compiled steps; made, and old ones of other sources removed, at the first call."""
    root = user_cache_root() / "compiled"
    folder = root / source_hash()
    folder.mkdir(parents=True, exist_ok=True)
    os.utime(folder)
    _forget_old(root, keep=folder)
    return folder


def is_warm() -> bool:
    """True when a process with the same sources has compiled before."""
    try:
        return any(compiled_folder().glob("*.nbi"))
    except OSError:  # no folder can be made: nothing is ever kept
        return False


def _forget_old(root: Path, keep: Path) -> None:
    def age(folder: Path) -> float:
        """Time of the last use."""
        try:
            return folder.stat().st_mtime
        except OSError:  # another process removed it meanwhile
            return 0.0

    others = sorted((f for f in root.iterdir() if f.is_dir() and f != keep), key=age, reverse=True)
    for folder in others[KEPT_FOLDERS - 1 :]:
        shutil.rmtree(folder, ignore_errors=True)
