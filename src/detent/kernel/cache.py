"""Where compiled steps are kept between processes.

Numba stamps a cached function with the contents of its own file only, so an edit of a callee in another file would be
served stale. Here the folder itself is named by a hash over every source that a step can be made of and over the
versions that shape the machine code: any such edit means another folder, and nothing in it can be stale.

What is kept runs as code. So the folder must be the user's alone, and each file carries a checksum over its name and
its contents: one that is damaged is dropped, and compiled anew. Where nothing can be kept, that costs time only.
"""

import hashlib
import os
import re
import shutil
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path

# What a step can be made of, beside the modules of methods that declare steps or registers; nothing else is compiled.
STEP_ROOMS = ("control", "drive", "kernel", "operate", "plant", "planning", "sensing", "errors.py", "units.py")
DECLARES = re.compile(r"^from detent\.kernel\.(step|registers) import", re.MULTILINE)  # parts of a step elsewhere
PACKAGE = Path(__file__).resolve().parent.parent
KEPT_FOLDERS = 6  # compiled folders that stay: a few checkouts and versions side by side, not every edit ever made
OLD_PART = 3600.0  # age of a file that nobody writes any more; one takes milliseconds [s]
_REMEDY = "set DETENT_CACHE_DIR to a folder of yours"
AT_FIRST_COMPILING: list[Callable[[str], object]] = []  # called, once, by `tell_compiling`


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
    others = [*PACKAGE.glob("methods/*/*.py"), *PACKAGE.glob("tune/*.py")]
    return frozenset([*found, *(s for s in others if DECLARES.search(s.read_text("utf-8")))])


@cache
def compiled_folder() -> tuple[Path | None, str]:
    """Folder of this package's compiled steps, made at the first call; None where there is none, and why."""
    folder = user_cache_root() / "compiled" / source_hash()
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        for one in (folder.parents[1], folder.parents[0], folder):
            if reason := _open_to_others(one):
                return None, f"{one} {reason}; {_REMEDY}"
    except OSError as error:
        return None, f"{error.filename}: {error.strerror}; {_REMEDY}"
    with suppress(OSError):  # one that can only be read is as good
        os.utime(folder)
        _forget_old(folder.parent, keep=folder)
        for part in folder.glob("*.part"):  # of a process that was killed
            if time.time() - part.stat().st_mtime > OLD_PART:
                part.unlink()
    return folder, ""


def _open_to_others(folder: Path) -> str:
    """Who beside the user may put code into a folder; empty where nobody may."""
    if sys.platform == "win32":  # a folder of the user's profile is theirs
        return ""
    status = folder.stat()
    if status.st_uid != os.geteuid():
        return "belongs to another user"
    return "can be written by other users" if status.st_mode & 0o022 else ""


def read_kept(file: Path) -> bytes | None:
    """What `keep` wrote; None where nothing was kept. A file that holds anything else is removed."""
    try:
        whole = file.read_bytes()
    except OSError:
        return None
    mark, data = whole[: hashlib.sha256().digest_size], whole[hashlib.sha256().digest_size :]
    if mark == _checksum(file, data):
        return data
    with suppress(OSError):
        file.unlink()
    return None


def keep(file: Path, data: bytes) -> None:
    """Write what the next process may take over; a disk that is full costs its time, no more."""
    part = file.with_name(f"{file.name}.{os.getpid()}.part")
    try:
        part.write_bytes(_checksum(file, data) + data)
        part.replace(file)
    except OSError:
        with suppress(OSError):
            part.unlink()


def _checksum(file: Path, data: bytes) -> bytes:
    return hashlib.sha256(file.name.encode() + b"\0" + data).digest()


def tell_compiling(why_unkept: str) -> None:
    """Tell whoever asked, once, that a step is compiled, and why that cannot be kept."""
    while AT_FIRST_COMPILING:
        AT_FIRST_COMPILING.pop()(why_unkept)


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
