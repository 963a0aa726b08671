"""Which column is which signal, and in which unit: as the user says, otherwise guessed by name, unit and numbers."""

from itertools import product

import numpy as np

from detent.errors import FileProblem, InputError
from detent.files.text import did_you_mean, short
from detent.logs.headings import BITS, EFFORTS, ROLES, Conversion, find_conversion, rank, split_heading, words_of
from detent.logs.log import Action, Draft, Kind, Severity, Source
from detent.logs.mapping import Choice, ColumnMapping
from detent.logs.raw_table import RawTable, tell
from detent.logs.rotation import is_clock

# Signals that a unit alone tells.
_BY_UNIT = ("force", "torque", "current", "voltage", "temperature", "acceleration", "velocity")
_MOTION = ("position", "reference", "position_load", "velocity", "acceleration")
_ANGLE_WORDS = frozenset({"angle", "theta", "phi", "rpm", "omega", "rad", "deg", "turn", "turns"})
_TIME_UNITS = (("s", 1e-7, 0.2), ("ms", 0.2, 200.0), ("us", 200.0, 2e5), ("ns", 2e5, 2e8))
"""Time between two rows, in numbers of a column without a unit, from which to which a unit is believed: recordings of
servos are made with 5 to 5000 rows a second, seldom more."""

Chosen = dict[str, str]  # from a role to the name of its column


def choose_columns(table: RawTable, mapping: ColumnMapping) -> Chosen:
    """Find the column of each signal; what was guessed is among the notes of the table."""
    chosen: Chosen = {}
    problems: list[FileProblem] = []
    held = f"columns {tell([short(name) for name in table.columns])}"
    silent = {role for role, choice in mapping.columns.items() if not choice.column}
    for role, choice in mapping.columns.items():
        name = find_column(table, choice.column) if role not in silent else None
        if name is not None:
            chosen[role] = name
        elif role not in silent:
            names = [split_heading(name)[0] for name in table.columns]
            remedy = did_you_mean(choice.column, names, "name one of these, or its number from 1")
            got = f'the column "{short(choice.column)}"'
            problems.append(FileProblem(table.file, 0, 0, role, got, held, remedy))
    if problems:
        raise InputError(problems)
    if mapping.file.period is not None and "time" not in chosen:
        silent.add("time")
    _guess(table, chosen, silent)
    if "time" not in chosen and mapping.file.period is None:
        remedy = "state it as time=COLUMN [UNIT], or the time between rows as period=1 ms"
        raise InputError.of_file(table.file, held, "a column for the time", remedy)
    if not set(chosen) - {"time"}:
        remedy = "state what the columns are, as in position=COLUMN [mm]"
        raise InputError.of_file(table.file, held, f"signals: {', '.join(ROLES)}", remedy)
    return chosen


def find_column(table: RawTable, wanted: str) -> str | None:
    """Name of the column that a person means: its whole heading, its heading without the unit, or its number."""
    if wanted in table.columns:
        return wanted
    same = [name for name in table.columns if split_heading(name)[0] == wanted]
    alike = [name for name in table.columns if _plain(name) == _plain(wanted)]
    for found in (same, alike):
        if len(found) == 1:
            return found[0]
    number = int(wanted) if wanted.isascii() and wanted.isdigit() and len(wanted) < 6 else 0
    return list(table.columns)[number - 1] if 1 <= number <= len(table.columns) else None


def _plain(name: str) -> str:
    return split_heading(name)[0].casefold()


def _guess(table: RawTable, chosen: Chosen, silent: set[str]) -> None:
    """Guess the signals that the user does not name: by the names of columns, then by their units."""
    for role in ROLES:
        if role in chosen or role in silent:
            continue
        ranks = {name: place for name in _free(table, chosen) if (place := _rank(table, name, role)) is not None}
        if role == "time":  # a column that does not run is none, whatever it is called, where another one runs
            ranks = {name: place for name, place in ranks.items() if is_clock(table.columns[name])} or ranks
        if ranks:
            best = min(ranks, key=lambda name: ranks[name])
            chosen[role] = best
            others = [short(name) for name in ranks if name != best and ranks[name] == ranks[best]]
            alike = f"; alternatives: {tell(others)}" if others else ""
            table.notes.append(f'{role}: column "{short(best)}", by its name{alike}')
    for role in _BY_UNIT:
        fitting = [name for name in _free(table, chosen) if _fits_unit(table.units[name], role)]
        if len(fitting) == 1 and role not in chosen and role not in silent:
            chosen[role] = fitting[0]
            table.notes.append(f'{role}: column "{short(fitting[0])}", by its unit {table.units[fitting[0]]}')
    _guess_share(table, chosen, silent)
    rest = [short(name) for name in _free(table, chosen)]
    if rest:
        table.notes.append(f"columns not used: {tell(rest)}")


def _guess_share(table: RawTable, chosen: Chosen, silent: set[str]) -> None:
    """Take a torque, a current or a force in per cent of a rating that nothing states as the word to the drive."""
    if chosen.keys() & set(EFFORTS) or "command" in silent:
        return
    for role in EFFORTS:
        for name in _free(table, chosen):
            plain = split_heading(name)[0]
            if role not in silent and _fits_unit(table.units[name], "command") and rank(plain, role) is not None:
                chosen["command"] = name
                rating = f"{role}={short(plain)} [{table.units[name]} of 2.4 {ROLES[role].units[0]}]"
                told = f"a {role} in {table.units[name]}: its rating is stated as in {rating}"
                table.notes.append(f'command: column "{short(name)}", {told}')
                return


def _free(table: RawTable, chosen: Chosen) -> list[str]:
    return [name for name in table.columns if name not in chosen.values()]


def _rank(table: RawTable, name: str, role: str) -> int | None:
    """How well a column fits a role: None where its name or its unit says that it does not."""
    unit = table.units[name]
    if unit and not _fits_unit(unit, role) and any(_fits_unit(unit, other) for other in ROLES):
        return None
    return rank(split_heading(name)[0], role)


def _fits_unit(unit: str, role: str) -> bool:
    return bool(unit) and any(find_conversion(unit, target) for target in ROLES[role].units)


def make_draft(table: RawTable, chosen: Chosen, mapping: ColumnMapping) -> Draft:
    """Put the chosen columns into a draft, with what their numbers mean."""
    draft = Draft(table.file, table.rows, np.empty(0), {}, {}, {}, findings=table.findings)
    draft.guesses = [*table.notes]
    constants = {**table.constants, **mapping.constants}
    if "time" not in chosen and mapping.file.period is not None:
        draft.t = (table.rows - 1).astype(np.float64)
        draft.units["time"], draft.sources["time"] = "s", Source("", "rows", mapping.file.period)
    units = _find_units(table, chosen, mapping, draft)
    for role in sorted(chosen, key=list(ROLES).index):
        name, (unit, conversion) = chosen[role], units[role]
        choice = mapping.columns.get(role, Choice(column=name))
        factor = choice.sign * _number_of(table.file, role, choice.factor, constants)
        # Behind the border: unit factor * (sign * factor * number + offset) + unit offset.
        total = conversion.factor * choice.offset + conversion.offset
        draft.units[role] = conversion.unit
        draft.sources[role] = Source(name, unit, conversion.factor * factor, total)
        if role == "time":
            draft.t = table.columns[name]
        else:
            draft.values[role] = table.columns[name].copy()
        draft.bits |= {role: choice.bits} if choice.bits else {}
        draft.delays |= {role: choice.delay} if choice.delay else {}
    for role in [role for role in draft.values if role not in mapping.columns]:  # what the user states is believed
        if match := BITS.fullmatch(table.units[chosen[role]].strip()):  # a width for a unit, as ``8bits``
            _check_width(draft, role, chosen[role], int(match[1]))
    return draft


def _number_of(file: str, role: str, factor: float | str, constants: dict[str, float | str]) -> float:
    """A factor, looked up where it is the name of a constant."""
    if not isinstance(factor, str):
        return factor
    value = constants.get(factor)
    if isinstance(value, float) and abs(value) > 0 and np.isfinite(value):
        return value
    numbers = [name for name, constant in constants.items() if isinstance(constant, float)]
    allowed = f"a number, or one of the constants {tell(numbers) or '(there are none)'}"
    problem = FileProblem(file, 0, 0, role, f'the factor "{short(factor)}"', allowed, "state the number as factor")
    raise InputError([problem])


def _find_units(
    table: RawTable, chosen: Chosen, mapping: ColumnMapping, draft: Draft
) -> dict[str, tuple[str, Conversion]]:
    """Unit of each signal, guessed where none is stated, those of a motion alike; with how it becomes SI."""
    found: dict[str, tuple[str, Conversion]] = {}
    for role, name in chosen.items():
        stated = (mapping.columns[role].unit if role in mapping.columns else "", table.units[name])
        for unit, target in product(filter(None, stated), ROLES[role].units):
            conversion = find_conversion(unit, target)
            if conversion is not None and role not in found:
                found[role] = unit, conversion
    base = next((found[role][1].unit.partition("/")[0] for role in _MOTION if role in found), "")
    for role in sorted(chosen.keys() - found.keys(), key=list(ROLES).index):
        odd = table.units[chosen[role]]
        unit, reason = _guess_unit(table, chosen, role, base)
        base = base or (unit.partition("/")[0] if role in _MOTION else "")
        why = f'"{short(odd)}" is no unit of {ROLES[role].meaning}' if odd else "no unit stated"
        if unit:
            draft.guesses.append(f"{role}: {why}, taken as {unit}{reason}")
        draft.guessed_units.add(role)
        target = next(target for target in ROLES[role].units if not unit or find_conversion(unit, target))
        found[role] = unit, find_conversion(unit, target) or Conversion(target, 1.0)
    return found


def _guess_unit(table: RawTable, chosen: Chosen, role: str, base: str) -> tuple[str, str]:
    """Unit of a signal that has none, and the reason; the base is the unit of other positions."""
    name, units = chosen[role], ROLES[role].units
    values, turns = table.columns[name], {"rad": 1, "count": 2}
    if role == "time":
        # The one in which its rows are as far apart as recordings are made.
        steps = np.diff(values[np.isfinite(values)])
        step = float(np.median(steps[steps > 0])) if np.any(steps > 0) else 0.0
        unit = next((unit for unit, low, high in _TIME_UNITS if low <= step < high), "s")
        return unit, f": its rows are {step:.4g} apart"
    if role not in _MOTION:
        return "degC" if role == "temperature" else units[0], ""
    if base:
        return units[turns.get(base, 0)], f", as the other signals in {base}"
    known = values[np.isfinite(values)]
    is_count = len(known) > 0 and bool(np.all(known == np.rint(known))) and float(np.ptp(known)) > 20
    if is_count and role not in {"velocity", "acceleration"}:
        return "count", f": whole numbers; say how long one is, as in {role}={short(name)} [0.5 um]"
    is_angle = bool(_ANGLE_WORDS & set(words_of(name))) or "torque" in chosen
    other = "moves straight" if is_angle else "turns"
    said = f"; for an axis that {other} state it, as in {role}={short(name)} [{'mm' if is_angle else 'rad'}]"
    return units[1 if is_angle else 0], said


def _check_width(draft: Draft, role: str, name: str, bits: int) -> None:
    """Leave out words whose heading states a width in bits that they do not fit: they are something else."""
    values, unit = draft.values[role], draft.units.get("position", "m")
    beyond = np.flatnonzero(np.abs(values) >= 2**bits)
    if len(beyond):
        low, high = np.nanmin(values), np.nanmax(values)
        text = f"the heading says {bits} bits, but the numbers go from {low:g} to {high:g}: they are something else"
        example = {"count": "steps", "m": "mm"}.get(unit, unit)
        advice = f"state what the column is, as in reference={short(name)} [{example}]"
        draft.note(Kind.WRONG_UNIT, role, beyond, text, Action.LEFT_OUT, advice, Severity.WARNING)
        del draft.values[role]
