"""A trace: named columns over time, each with its unit, as a run records them.

Columns are called by the dotted path of the register they came from (``motor.current``). The first is always ``t`` [s].
"""

import importlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase
from typing import Any

import numpy as np
from numpy.typing import NDArray

from detent.errors import DetentError
from detent.files.screen import Block, OnScreen, Screen
from detent.files.text import nearest

Column = NDArray[Any]  # one column: a one-dimensional array of integers, floats or booleans
Attribute = str | float | int  # what is known about a trace as a whole: the axis, the job, the seed
TIME = "t"
# Of a trace that a run left which broke off: what it got, and what it expected.
BROKEN_OFF = ("the trace of an aborted run", "the trace of a completed run")


def broke_off(attributes: Mapping[str, Any]) -> bool:
    """True of a trace whose run did not come to its end."""
    return not attributes.get("complete", 1)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class Trace(OnScreen):
    """What a run recorded: columns of equal length over time, with units.

    A `DetentError` tells why columns do not make a trace: no ``t`` in front, unequal lengths, values not numbers.

    Parameters
    ----------
    columns : mapping of str to ndarray
        Name to values, each of shape (n,). The first is ``t`` [s], which never runs backwards.
    units : mapping of str to str
        Unit of each column; "" (or no entry) for a number without unit.
    docs : mapping of str to str
        What each column holds, in a few words; may be incomplete.
    attributes : mapping of str to str, float or int
        What is true of the whole trace: ``axis``, ``job``, ``seed``.
    """

    columns: dict[str, Column]
    units: dict[str, str] = field(default_factory=dict[str, str])
    docs: dict[str, str] = field(default_factory=dict[str, str])
    attributes: dict[str, Attribute] = field(default_factory=dict[str, Attribute])

    def __post_init__(self) -> None:
        check_columns(self.columns)
        for kind, mapping in (("unit", self.units), ("description", self.docs)):
            for name in mapping:
                if name not in self.columns:
                    raise DetentError(f"trace: a {kind} is given for {name!r}, which is not one of its columns")

    def screen(self) -> Screen:
        """How long it is, and each column with its unit and its range."""
        whose = ", ".join(str(self.attributes[key]) for key in ("axis", "job") if key in self.attributes)
        title = f"Trace{f' of {whose}' if whose else ''}: {len(self)} rows"
        if len(self):
            title += f", {self.time[0]:.6g} s to {self.time[-1]:.6g} s"
        rows = [(name, self.units.get(name, ""), *_range(self.columns[name]), self.docs.get(name, "")) for name in self]
        heads = ("column", "unit", "least", "largest", "what it is")
        return Screen(
            title, [Block("", heads, rows, 24, ".signals names all")], 'trace["NAME"]  .to_pandas()  .to_xarray()'
        )

    def __len__(self) -> int:
        return len(self.columns[TIME])

    def __iter__(self) -> Iterator[str]:
        return iter(self.columns)

    def __contains__(self, name: object) -> bool:
        return name in self.columns

    def __getitem__(self, name: str) -> Column:
        """Give one column."""
        if name not in self.columns:
            raise unknown_column(name, list(self.columns))
        return self.columns[name]

    @property
    def time(self) -> Column:
        """The time of each row [s], shape (n,)."""
        return self.columns[TIME]

    @property
    def signals(self) -> tuple[str, ...]:
        """The names of all columns but time, in order."""
        return tuple(name for name in self.columns if name != TIME)

    def label(self, name: str) -> str:
        """Give a column's name with its unit, such as ``motor.current [A]``; the bare name where there is no unit."""
        unit = self.units.get(name, "")
        return f"{name} [{unit}]" if unit else name

    def between(self, start: float, stop: float) -> "Trace":
        """Cut out a stretch of time, from the first to the last moment [s], both included; no copy of the columns.

        A `DetentError` says so where nothing was recorded in the stretch.
        """
        first = int(np.searchsorted(self.time, start, side="left"))
        last = int(np.searchsorted(self.time, stop, side="right"))
        if first >= last:
            held = f"{self.time[0]:g} s to {self.time[-1]:g} s" if len(self) else "nothing"
            raise DetentError(f"trace: no rows from {start:g} s to {stop:g} s; it holds {held}; choose a time in there")
        return replace(self, columns={name: values[first:last] for name, values in self.columns.items()})

    def to_pandas(self) -> Any:
        """Give the columns as a table of pandas.

        Returns
        -------
        pandas.DataFrame
            A column per signal, shape (n,), over the time ``t`` [s] as its index; `attrs` holds ``units``, ``docs`` and
            the attributes of the trace.

        Raises
        ------
        DetentError
            pandas is not installed.
        """
        pandas = _extra("pandas")
        index = pandas.Index(self.time, name=TIME)
        table = pandas.DataFrame({name: self.columns[name] for name in self.signals}, index=index)
        table.attrs = {"units": dict(self.units), "docs": dict(self.docs), **self.attributes}
        return table

    def to_xarray(self) -> Any:
        """Give the columns as a data set of xarray.

        Returns
        -------
        xarray.Dataset
            A variable per signal, shape (n,), over the dimension ``t`` [s]; each has its unit as ``units`` and what it
            is as ``long_name``, from which xarray labels its plots.

        Raises
        ------
        DetentError
            xarray is not installed.
        """
        xarray = _extra("xarray")
        described = {
            name: (TIME, values, {"units": self.units.get(name, ""), "long_name": self.docs.get(name, name)})
            for name, values in self.columns.items()
        }
        time = {TIME: (TIME, self.time, {"units": "s", "long_name": "time"})}
        return xarray.Dataset(
            {name: described[name] for name in self.signals}, coords=time, attrs=dict(self.attributes)
        )

    def match(self, patterns: Sequence[str]) -> tuple[str, ...]:
        """Find the columns that a person means by names, or by patterns with ``*`` such as ``motor.*``.

        They come in the order asked, each once, never ``t``; a pattern that fits no column is a `DetentError`.
        """
        found: dict[str, None] = {}
        for pattern in patterns:
            names = [name for name in self.signals if fnmatchcase(name, pattern)]
            if not names:
                raise unknown_column(pattern, list(self.signals))
            found.update(dict.fromkeys(names))
        return tuple(found)


def _range(values: Column) -> tuple[str, str]:
    """Least and largest value as text; NaN counts for nothing."""
    if not len(values) or (values.dtype.kind == "f" and np.isnan(values).all()):
        return "", ""
    return f"{float(np.nanmin(values)):.5g}", f"{float(np.nanmax(values)):.5g}"


def _extra(name: str) -> Any:
    """A module that an extra of the same name installs."""
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise DetentError(
            f'this needs {name}, which is not installed; try: pip install "detent[{name}]", or take the columns as '
            'they are: trace["NAME"]'
        ) from error


def unknown_column(name: str, known: Sequence[str]) -> DetentError:
    """Make the error for a column that is not there."""
    near = nearest(name, known, 0.5)
    hint = f"; did you mean {near!r}?" if near else ""
    return DetentError(f"trace: no signal {name!r}{hint}; it holds: {', '.join(known) or 'none'}")


def check_columns(columns: Mapping[str, Column], index: str = TIME) -> None:
    """Refuse columns that do not make a trace, or a table whose first column is another `index`."""
    if next(iter(columns), None) != index:
        first = next(iter(columns), "nothing")
        raise DetentError(f"trace: the first column must be 't' (time in s), got {first!r}; put the time first")
    rows = columns[index].shape
    for name, values in columns.items():
        if values.ndim != 1 or values.shape != rows:
            raise DetentError(
                f"trace: column {name!r} has shape {values.shape}, {index!r} has {rows}; give one value per row"
            )
        if values.dtype.kind not in "biuf":
            raise DetentError(
                f"trace: column {name!r} holds {values.dtype}; expected: integers, floats, booleans; convert it"
            )
    time = columns[index]
    backwards = np.flatnonzero(~(np.diff(time) >= 0)) if time.size > 1 else np.empty(0, dtype=np.intp)
    if backwards.size:
        row = int(backwards[0])
        raise DetentError(
            f"trace: time runs backwards or is not a number after row {row + 1} "
            f"({time[row]!s} s, then {time[row + 1]!s} s); sort the rows by time"
        )
