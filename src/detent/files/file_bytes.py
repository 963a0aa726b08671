"""The bytes of a recording, unpacked where it is packed, up to a limit."""

import gzip
import zlib
from pathlib import Path

from detent.errors import InputError

PACKED = ".gz"  # ending of a packed text file, after that of its kind: ``run.csv.gz``
_REMEDY = "check the name of the recording"


def kind_of(path: Path) -> str:
    """Ending of a file's name in small letters, that of the packing left out.

    >>> kind_of(Path("run.CSV")), kind_of(Path("run.json.gz"))
    ('.csv', '.json')
    """
    suffix = path.suffix.lower()
    return path.with_suffix("").suffix.lower() if suffix == PACKED else suffix


def check_file(path: Path, limit: int, allowed: str) -> None:
    """Refuse a file that is absent, empty, too large, or no file."""
    try:
        size = path.stat().st_size
        if path.is_dir():
            raise InputError.of_file(str(path), "a folder", allowed, "name a file in it")
    except FileNotFoundError:
        raise InputError.of_file(str(path), "no such file", allowed, _REMEDY) from None
    except OSError as error:
        came = f"a file that cannot be read ({(error.strerror or str(error)).lower()})"
        raise InputError.of_file(str(path), came, allowed, _REMEDY) from None
    except ValueError:
        raise InputError.of_file(repr(str(path)), "a name no file can have", allowed, _REMEDY) from None
    if not size:
        raise InputError.of_file(str(path), "an empty file", allowed, _REMEDY)
    if size > limit:
        raise _too_large(path, limit)


def read_bytes(path: Path, limit: int, allowed: str) -> bytes:
    """Read a file, unpacked if its name ends in ``.gz``."""
    check_file(path, limit, allowed)
    is_packed = path.suffix.lower() == PACKED
    try:
        with gzip.open(path, "rb") if is_packed else path.open("rb") as stream:
            data = stream.read(limit + 1)
    except (gzip.BadGzipFile, EOFError, zlib.error) as error:
        came = f"a damaged packed file ({error})"
        raise InputError.of_file(str(path), came, allowed, "unpack it with gunzip, or record again") from None
    except OSError as error:
        came = f"a file that cannot be read ({(error.strerror or str(error)).lower()})"
        raise InputError.of_file(str(path), came, allowed, _REMEDY) from None
    if len(data) > limit:
        raise _too_large(path, limit)
    if not data.strip():
        raise InputError.of_file(str(path), "an empty file", allowed, _REMEDY)
    return data


def _too_large(path: Path, limit: int) -> InputError:
    """The error for a file beyond the limit."""
    size = f"{limit // 1_000_000} MB"
    remedy = "cut the recording into pieces, or save it as HDF5 or Parquet"
    return InputError.of_file(str(path), f"more than {size}", f"up to {size}", remedy)
