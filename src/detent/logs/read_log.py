"""Read a recording: the file, what its columns are, what is wrong with them, and the log that comes of it."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np

from detent.errors import InputError
from detent.files.apart import read_apart
from detent.files.text import kind_of, short
from detent.logs.agreement import find_disagreements
from detent.logs.choose import choose_columns, make_draft
from detent.logs.effort import find_shifts, find_wrong_effort
from detent.logs.jumps import find_copies, mend_jumps
from detent.logs.log import Action, Draft, Finding, Kind, Log, Severity, row_ranges, tell_count
from detent.logs.mapping import ColumnMapping, FileOptions, load_mapping, parse_options
from detent.logs.parts import find_tests, lay_behind
from detent.logs.raw_table import RawTable
from detent.logs.read_arrays import read_hdf5, read_mat, read_npz, read_parquet
from detent.logs.read_csv import read_csv
from detent.logs.read_json import read_json
from detent.logs.rotation import mend_rotation
from detent.logs.stamps import look_at_clock, mend_clock, mend_counters
from detent.logs.stuck import find_saturation, find_stuck

EPOCH = 1e8  # a time from which on it counts from some year, and is counted from the first sample instead [s]
READERS: dict[str, Callable[[Path, FileOptions], RawTable]] = {
    ".csv": read_csv, ".tsv": read_csv, ".txt": read_csv, ".dat": read_csv, ".log": read_csv,
    ".json": read_json, ".jsonl": read_json, ".ndjson": read_json,
    ".h5": read_hdf5, ".hdf5": read_hdf5, ".mat": read_mat, ".npz": read_npz, ".npy": read_npz,
    ".parquet": read_parquet,
}  # fmt: skip
"""Reader of each kind of file, by the ending of its name."""

ALLOWED = "a recording"
_TEXTS = frozenset(kind for kind, reader in READERS.items() if reader in {read_csv, read_json})
_ORDER = (Severity.ERROR, Severity.WARNING, Severity.NOTE)
SLOW = frozenset({"supply", "temperature", "enabled"})  # recorded only now and then: they keep their last value
MOST = 0.1  # share of empty cells from which a signal is left out: with more, too many rows would go with them


def read_log(path: str | Path, mapping: ColumnMapping | str | Path | None = None, options: Sequence[str] = ()) -> Log:
    """Read a recording of a machine, and find what is wrong with it."""
    stated = load_mapping(mapping) if isinstance(mapping, str | Path) else mapping or ColumnMapping()
    stated = stated.overridden(parse_options(options))
    table = read_table(path, stated.file, apart=True)
    chosen = choose_columns(table, stated)
    if "time" in chosen:
        is_stated = any(choice.column for choice in stated.columns.values())
        mend_rotation(table, chosen["time"], is_stated=is_stated, is_accepted=stated.file.rotated)
    if table.broken:
        reasons = list(dict.fromkeys(broken.reason for broken in table.broken))
        more = f" and {len(reasons) - 3} more reasons" if len(reasons) > 3 else ""
        text = f"{tell_count(len(table.broken), 'row')} cannot be read: {'; '.join(reasons[:3])}{more}"
        rows = row_ranges([broken.row for broken in table.broken])
        table.findings.append(Finding(Kind.BROKEN_ROWS, "", rows, text, Action.REMOVED))
    draft = make_draft(table, chosen, stated)
    if "time" in chosen:
        draft.tests = find_tests(table, chosen["time"], list(chosen.values()))
    left = tuple(name for name in table.columns if name not in chosen.values())
    table.columns = {}  # the draft has what was chosen of them
    if not draft.values:
        raise InputError.of_file(str(path), _nothing_left(draft), "at least one signal", "state what the columns are")
    clean(draft)
    if not draft.values:
        raise InputError.of_file(str(path), _nothing_left(draft), "at least one signal", "record the signals again")
    return replace(_finish(Path(path).name, table, draft), unread=left)


def read_table(path: str | Path, options: FileOptions | None = None, *, apart: bool = False) -> RawTable:
    """Read the columns of a recording; `apart`: in a process of its own, but for text tables, which have no need."""
    path = Path(path)
    kind = kind_of(path)
    is_packed = path.suffix.lower() == ".gz"
    if kind not in READERS or (is_packed and kind not in _TEXTS):
        got = f'a name that ends in "{path.suffix}"' if path.suffix else "a name without an ending"
        remedy = "give the file the ending of its kind, or save it as one of these"
        raise InputError.of_file(str(path), got, f"{', '.join(READERS)}; text also with .gz", remedy)
    reader, options = READERS[kind], options or FileOptions()
    if not apart or reader is read_csv:
        return reader(path, options)
    # What checks options takes as long to load as some libraries that read files: the other process gets them checked.
    return read_apart(reader, path, ALLOWED, cast("FileOptions", SimpleNamespace(**options.model_dump())))


def clean(draft: Draft) -> None:
    """Find and mend what is wrong with a recording: the clock, the cells, the counters, then what physics says."""
    # Each check works on what the ones before have mended. Counters wrap and clocks tick in the numbers of the file.
    lay_behind(draft)
    mend_clock(draft)
    mend_missing(draft)
    mend_counters(draft)
    draft.convert()
    take_out_delays(draft)
    look_at_clock(draft)
    mend_jumps(draft)
    find_copies(draft)
    find_stuck(draft)
    find_saturation(draft)
    find_disagreements(draft)
    find_shifts(draft)
    find_wrong_effort(draft)


def take_out_delays(draft: Draft) -> None:
    """Take stated delays out, by straight lines between samples; samples without values on both sides are removed."""
    if not draft.delays:
        return
    inside = np.ones(len(draft), dtype=np.bool_)
    for role, delay in draft.delays.items():
        if role in draft.values:
            moments = draft.t + delay
            draft.values[role] = np.interp(moments, draft.t, draft.values[role])
            inside &= (moments >= draft.t[0]) & (moments <= draft.t[-1])
    draft.keep(inside)


def mend_missing(draft: Draft) -> None:
    """Deal with empty cells."""
    # A signal of `SLOW` keeps its last value. Of others one with more than `MOST` of its cells empty is left out; rows
    # with empty cells of the rest are removed, so that what is left was measured.
    absent = {role: np.isnan(values) for role, values in draft.values.items()}
    for role, gone in absent.items():
        if not gone.any():
            continue
        count = tell_count(int(gone.sum()), "cell")
        if gone.all() or (role not in SLOW and gone.mean() > MOST):
            advice = f"record {role} in every row" if not gone.all() else ""
            draft.note(Kind.MISSING_VALUES, role, gone, f"{count} of {len(draft)} empty", Action.LEFT_OUT, advice)
            del draft.values[role]
        elif role in SLOW:
            last = np.maximum.accumulate(np.where(gone, 0, np.arange(len(draft))))
            # Before the first value there is none to keep: that one it becomes.
            last[: int(np.argmin(gone))] = int(np.argmin(gone))
            draft.values[role] = draft.values[role][last]
            text = f"{count} empty, filled with the last value before"
            draft.note(Kind.MISSING_VALUES, role, gone, text, Action.INTERPOLATED, "", Severity.NOTE)
        else:
            draft.note(Kind.MISSING_VALUES, role, gone, f"{count} empty", Action.REMOVED)
    left = [absent[role] for role in draft.values if role not in SLOW]
    if left:
        draft.keep(~np.logical_or.reduce(left))


def _nothing_left(draft: Draft) -> str:
    """What was found, where nothing is left of it."""
    return short("no usable signal: " + "; ".join(f"{finding.signal} {finding.text}" for finding in draft.findings))


def _finish(name: str, table: RawTable, draft: Draft) -> Log:
    """The log of a draft."""
    t = draft.t
    sources = {role: draft.sources[role] for role in ("time", *draft.values) if role in draft.sources}
    if abs(t[0]) > EPOCH:
        draft.guesses.append(f"time: counted from the first sample, {t[0]:.0f} s")
        sources["time"] = replace(sources["time"], offset=sources["time"].offset - float(t[0]))
        t = t - t[0]
    units = {role: draft.units[role] for role in sources}
    findings = sorted(draft.findings, key=lambda finding: _ORDER.index(finding.severity))
    values = {role: np.ascontiguousarray(found) for role, found in draft.values.items()}
    return Log(
        name,
        t,
        values,
        units,
        sources,
        draft.rows,
        tuple(findings),
        tuple(draft.guesses),
        table.constants,
        tuple(draft.tests),
    )
