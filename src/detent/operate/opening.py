"""Where the channel and the store of an axis lie, and whether what lies there is of it: what is not is kept aside."""

import os
import platform
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from datetime import datetime
from hashlib import sha256
from pathlib import Path

from detent.errors import DetentError, DiskError
from detent.files.text import shown
from detent.methods.position import PositionSensor
from detent.operate.rows import KINDS, VERSION, Meaning, Position
from detent.operate.sealed import Connect, DamagedError, ForeignError, SealedFile, identity, salvage, set_aside

SUFFIX = ".state"
MOST_ASIDE = 10  # times that a store is found not to fit, by this process or another, before it is given up


@dataclass(frozen=True, slots=True)
class Aside:
    """A store that was kept aside, and why."""

    path: Path
    reason: str
    #: scale, travel, sensor as the store has them and as the axis file does, where they differ
    differs: Mapping[str, tuple[str, str]] = field(default_factory=dict[str, tuple[str, str]])
    positions: tuple[Position, ...] = ()  #: entries of its table that are as they were written

    def __str__(self) -> str:
        """Say it to a person, both sides of what differs."""
        both = "; ".join(
            f"{name}: {old} in the store, {new} in the axis file" for name, (old, new) in self.differs.items()
        )
        told = f"{self.reason} ({both})" if both else self.reason
        return (
            f"{self.path}: kept aside, {told}; the position is unknown, {len(self.positions)} taught positions can be "
            "read from it; home the axis, and import those that still hold"
        )


def runtime_folder() -> Path:
    """Folder of this user's channels, which nobody else may enter."""
    base = os.environ.get("XDG_RUNTIME_DIR")
    folder = Path(base, "detent") if base else Path("/tmp", f"detent-{os.getuid()}")  # noqa: S108 - made 0700 below
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    held = folder.stat()
    if held.st_uid != os.getuid() or held.st_mode & 0o077:
        raise DetentError(
            f"{folder}: it belongs to somebody else, or others may enter it; remove it, or set XDG_RUNTIME_DIR"
        )
    return folder


def channel_of(file: Path, motor: str = "") -> Path:
    """Socket of the axis that a file describes, or of one of its motors, of a file with several."""
    path = file.resolve()
    stem = "".join(c if c.isascii() and c.isalnum() else "-" for c in path.stem)[: 32 - len(motor[:24])]
    name = [f"{stem}-{sha256(str(path).encode()).hexdigest()[:10]}", *([motor] if motor else []), "sock"]
    return runtime_folder() / ".".join(name)


def running_channel(file: Path, motor: str = "") -> Path:
    """Socket of the motor that is named, or of the only one of a file that runs."""
    alone = channel_of(file)
    if alone.exists() or motor:
        return alone if alone.exists() else channel_of(file, motor)
    mark = alone.stem.rpartition("-")[2]
    several = {path.name.split(".")[-2]: path for path in sorted(alone.parent.glob(f"*-{mark}.*.sock"))}
    if len(several) > 1:
        got = f"{shown(str(file))}: its motors run live, each by itself"
        raise DetentError(f"{got}; expected: the name of one, {' or '.join(several)}; name it with --motor")
    return next(iter(several.values()), alone)


def store_path(axis_file: Path | str, motor: str = "") -> Path:
    """Where the store of an axis lies unless told otherwise: beside its file, under the whole name of that.

    >>> store_path("bench/stage.toml", "x").as_posix()
    'bench/stage.toml.x.state'
    """
    file = Path(axis_file)
    return file.with_name(".".join([file.name, *([motor] if motor else [])]) + SUFFIX)


def meanings(sensor: PositionSensor) -> dict[str, str]:
    """What positions mean, in words that are equal only where the meaning is."""
    unit, ends = sensor.unit, sensor.ends
    repeats = f", repeats after {sensor.band} counts" if sensor.band else ""
    held = ", held while off" if sensor.held else ""
    named = f", id {sensor.id}" if sensor.id else ""
    return {
        "scale": f"{sensor.scale!r} {unit} a count, count 0 at {sensor.origin!r} {unit}",
        "travel": f"{ends[0]!r} {unit} to {ends[1]!r} {unit}" if ends else "without ends",
        "sensor": f"{sensor.sensor} ({sensor.kind}{repeats}{held}{named})",
    }


def here(path: Path) -> str:
    """Computer and place of a file: what is copied or moved comes to another."""
    computer = platform.node()
    with suppress(OSError):
        computer = Path("/etc/machine-id").read_text(encoding="ascii").strip() or computer
    return f"{computer}:{os.path.realpath(path)}"


def open_fitting(
    path: Path, sensor: PositionSensor, place: str, clock: Callable[[], datetime], connect: Connect
) -> tuple[SealedFile, Aside | None]:
    """The store of an axis, a new one where there was none that fits, and what was kept aside for that."""
    wanted, aside = meanings(sensor), None
    for _ in range(MOST_ASIDE):
        judged = identity(path)
        try:
            file = SealedFile(path, KINDS, VERSION, connect)
        except DamagedError as error:
            if identity(path) == judged:  # else another process has kept it aside meanwhile
                aside = _put_aside(path, clock, str(error), readable=not isinstance(error, ForeignError))
            continue
        kept = {row.name: row.text for row in file.all(Meaning)}
        # Without meaning it is new, or was broken off when it was made.
        differs = {name: (kept[name], text) for name, text in wanted.items() if kept and kept[name] != text}
        if differs:
            file.close()
            aside = _put_aside(path, clock, "it does not fit the axis file", differs, readable=True)
            continue
        if not kept:
            try:
                with file.change() as change:
                    for name, text in (wanted | {"place": place}).items():
                        change.put(Meaning(name, text))
            except BaseException:
                file.close()
                raise
        return file, aside
    raise DiskError(f"{path}: cannot be opened (other processes put it aside as well); end them and start again")


def _put_aside(
    path: Path,
    clock: Callable[[], datetime],
    reason: str,
    differs: Mapping[str, tuple[str, str]] | None = None,
    *,
    readable: bool,
) -> Aside:
    kept = set_aside(path, clock().strftime("%Y%m%dT%H%M%SZ"))
    return Aside(kept, reason, differs or {}, tuple(salvage(kept, Position)) if readable else ())
