"""Jobs of a rotary table, read from TOML: the steps of its sequence controller, and when its input signals come."""

from collections.abc import Callable, Mapping
from os import PathLike
from pathlib import PurePath
from typing import Any

from detent.errors import FileProblem, InputError
from detent.files.job_text import read_text
from detent.files.job_toml import JobTables, unknown_key
from detent.files.job_values import RefusedValueError, read_text_quantity, read_whole_number
from detent.methods.rotary_table.sequence_faults import find_faults
from detent.methods.rotary_table.sequence_job import (
    LAST_NUMBER,
    LONGEST_TIME,
    MOST_STEPS,
    SIGNAL_NAME,
    WHAT_A_NAME_IS,
    Go,
    Jog,
    Output,
    Repeat,
    SequenceJob,
    Step,
    Stretches,
    Wait,
    join_stretches,
)

MOST_PROBLEMS = 20
"""Problems of one file reported at most."""

WHAT_A_JOB_IS = "a sequence of steps (.toml)"

ACTIONS: dict[str, tuple[str, ...]] = {
    "go": ("label",),
    "jog": ("speed", "while", "for", "label"),
    "wait": ("label",),
    "wait_for": ("level", "label"),
    "set": ("label",),
    "clear": ("label",),
    "repeat": ("times",),
}
"""What a step can be, and the keys that it may have beside."""

INPUT_KEYS = ("name", "from", "to")

_STEP_KEYS = tuple(dict.fromkeys([*ACTIONS, *(key for keys in ACTIONS.values() for key in keys)]))
_ONE_ACTION = f"exactly one of {', '.join(ACTIONS)}"

_Reader = Callable[[str, object], Any]


def load_sequence(path: str | PathLike[str]) -> SequenceJob:
    """Read the job of a rotary table."""
    return parse_sequence(str(path), read_text(path, (".toml",), WHAT_A_JOB_IS))


def parse_sequence(file: str, text: str) -> SequenceJob:
    """Read a sequence of steps from TOML.

    Each ``[[step]]`` is one of these: ``go = 2`` sends the table to a position number; ``jog = "+"`` or ``"-"`` holds
    a button down, ``for`` a time or ``while`` an input signal is on, where wanted with a ``speed``; ``wait`` lets time
    pass; ``wait_for`` waits for an input signal, with ``level = false`` until it is off; ``set`` and ``clear`` switch
    an output signal on and off; ``repeat`` names the ``label`` of an earlier step and does the steps from there to here
    ``times`` times altogether. Each ``[[input]]`` is a stretch of time in which the signal ``name`` is on, ``from`` and
    ``to`` counted from the start of the sequence.
    """
    problems: list[FileProblem] = []
    tables = JobTables(file, text, ("input", "step"), problems)
    _check_top(tables)
    inputs = _read_inputs(tables)
    steps = _read_steps(tables)
    if not problems and not steps:
        remedy = "add a step, such as [[step]] with go = 1"
        raise InputError.of_file(file, "no steps", "a sequence of at least one step", remedy)
    if not problems:
        for fault in find_faults(steps, inputs):
            error = RefusedValueError(fault.came, fault.allowed, fault.remedy)
            tables.refuse("step", fault.index, fault.key, None, error)
    if problems:
        raise InputError(InputError(problems).problems[:MOST_PROBLEMS])
    return SequenceJob(PurePath(file).name, tuple(steps), inputs)


def _check_top(tables: JobTables) -> None:
    """Refuse what stands outside the tables."""
    inside = dict.fromkeys(INPUT_KEYS, "input") | dict.fromkeys(_STEP_KEYS, "step")
    for key, value in tables.top.items():
        if key not in ("input", "step"):
            tables.refuse_top(key, value, tables.unknown(key, value, (), inside))


def _read_inputs(tables: JobTables) -> dict[str, Stretches]:
    """Stretches of each input signal, in the order in which the file names them first."""
    found: dict[str, list[tuple[float, float]]] = {}
    for index, table in enumerate(tables.tables("input")):
        values = _read_values(tables, "input", index, table)
        if values is None:
            continue
        if values["from"] < values["to"]:
            found.setdefault(values["name"], []).append((values["from"], values["to"]))
        else:
            error = RefusedValueError("", f"a time after from, {values['from']:g} s", "correct one of the two")
            tables.refuse("input", index, "to", table["to"], error)
    return {name: join_stretches(stretches) for name, stretches in found.items()}


def _read_steps(tables: JobTables) -> list[Step]:
    """All steps that could be read."""
    steps: list[Step] = []
    for index, table in enumerate(tables.tables("step")):
        if len(tables.problems) >= MOST_PROBLEMS:
            break
        values = _read_values(tables, "step", index, table)
        if values is not None:
            steps.append(_make_step(values, tables.line("step", index)))
    return steps


def _read_values(tables: JobTables, name: str, index: int, table: dict[str, Any]) -> dict[str, Any] | None:
    """Values of a table, by key; None, and problems, where it will not do."""
    known = len(tables.problems)
    values: dict[str, Any] = {}
    keys = INPUT_KEYS if name == "input" else _STEP_KEYS
    for key, value in table.items():
        try:
            if key not in keys:
                raise unknown_key(key, keys, f"in [[{name}]]")
            values[key] = _READERS[key](key, value)
        except RefusedValueError as error:
            tables.refuse(name, index, key, value, error)
    wrong = _missing_input if name == "input" else _wrong_together
    # What a key that cannot be read, or is not known, was to say is not missed as well.
    for key, error in wrong(table, is_whole=tables.is_whole and set(table) <= set(keys)):
        tables.refuse(name, index, key, None, error)
    return values if len(tables.problems) == known and tables.is_whole else None


# ------------------------------------------------------------------------------------------------- keys together

_Wrong = list[tuple[str, RefusedValueError]]


def _missing_input(table: Mapping[str, Any], *, is_whole: bool) -> _Wrong:
    """Keys that an input lacks."""
    absent = [key for key in INPUT_KEYS if key not in table and is_whole]
    example = {"name": '"feed"', "from": '"1 s"', "to": '"4 s"'}
    return [("", RefusedValueError(f"no {key}", "name, from and to", f"add {key} = {example[key]}")) for key in absent]


def _wrong_together(table: Mapping[str, Any], *, is_whole: bool) -> _Wrong:
    """Keys of a step that do not go together, or that it lacks."""
    actions = [key for key in table if key in ACTIONS]
    if len(actions) > 1:
        remedy = "write a [[step]] for each"
        return [(actions[1], RefusedValueError(" and ".join(actions), _ONE_ACTION, remedy))]
    if not actions:
        came, remedy = "a step that does nothing", "add go = 1, or another of these"
        return [("", RefusedValueError(came, _ONE_ACTION, remedy))] if is_whole else []
    action = actions[0]
    wrong = [
        (key, _beside(key, action)) for key in table if key in _STEP_KEYS and key not in (action, *ACTIONS[action])
    ]
    return wrong + (_missing_beside(action, table) if is_whole else [])


def _beside(key: str, action: str) -> RefusedValueError:
    """Error for a key that does not belong to the action."""
    owners = [name for name, keys in ACTIONS.items() if key in keys]
    remedy = "remove it"
    if action == "go" and key == "speed":
        remedy = "remove it; the speed to a position stands in the axis file, in [position.NUMBER]"
    elif action == "repeat" and key == "label":
        remedy = "remove it; put the label on a step that does something"
    allowed = f"beside {action}: {', '.join(ACTIONS[action])} ({key} belongs to {' or '.join(owners)})"
    return RefusedValueError(f"{key} beside {action}", allowed, remedy)


def _missing_beside(action: str, table: Mapping[str, Any]) -> _Wrong:
    """Keys that an action needs."""
    if action == "repeat" and "times" not in table:
        came, allowed = "repeat without times", "a whole number of times, the first counted"
        return [("repeat", RefusedValueError(came, allowed, "add times = 2"))]
    held = [key for key in ("while", "for") if key in table]
    if action == "jog" and len(held) != 1:
        came = "jog with while and for" if held else "jog without an end"
        remedy = "remove one of the two" if held else 'add for = "2 s", or while with the name of an input'
        return [("jog", RefusedValueError(came, "exactly one of while (a signal) and for (a time)", remedy))]
    return []


# -------------------------------------------------------------------------------------------------------- values


def _read_number(key: str, value: object) -> int:
    number = read_whole_number(key, value)
    if not 0 <= number <= LAST_NUMBER:
        allowed = f"a position number from 0 to {LAST_NUMBER}"
        raise RefusedValueError("", allowed, "name an entry of the axis's position table")
    return number


def _read_direction(key: str, value: object) -> int:
    if value not in ("+", "-"):
        raise RefusedValueError("", '"+" (to larger angles) or "-"', f'write {key} = "+" or {key} = "-"')
    return 1 if value == "+" else -1


def _read_speed(key: str, value: object) -> float:
    speed = read_text_quantity(key, value, "rad/s")
    if speed <= 0:
        raise RefusedValueError("", "more than 0 deg/s", 'raise it; write jog = "-" for the other direction')
    return speed


def _read_time(key: str, value: object) -> float:
    time = read_text_quantity(key, value, "s", "2 s")
    if not 0 <= time <= LONGEST_TIME or (key == "for" and time == 0):
        allowed = f"{'more than ' if key == 'for' else ''}0 s, up to {LONGEST_TIME:g} s"
        raise RefusedValueError("", allowed, "correct the time")
    return time


def _read_name(key: str, value: object) -> str:
    if isinstance(value, str) and SIGNAL_NAME.fullmatch(value):
        return value
    what = "the label of an earlier step" if key == "repeat" else "a name"
    remedy = f'write it in quotes, such as {key} = "{"again" if key in ("repeat", "label") else "feed"}"'
    raise RefusedValueError("", f"{what}: {WHAT_A_NAME_IS}", remedy)


def _read_times(key: str, value: object) -> int:
    times = read_whole_number(key, value)
    if not 1 <= times <= MOST_STEPS:
        remedy = "leave the repeat out to do it once" if times < 1 else "lower it"
        raise RefusedValueError("", f"a whole number from 1 to {MOST_STEPS}", remedy)
    return times


def _read_level(key: str, value: object) -> bool:
    if isinstance(value, bool):
        return value
    raise RefusedValueError("", "true (on) or false (off), without quotes", f"write {key} = false")


_READERS: dict[str, _Reader] = {
    **dict.fromkeys(("wait", "for", "from", "to"), _read_time),
    **dict.fromkeys(("while", "wait_for", "set", "clear", "repeat", "label", "name"), _read_name),
    "go": _read_number,
    "jog": _read_direction,
    "speed": _read_speed,
    "times": _read_times,
    "level": _read_level,
}


def _make_step(values: Mapping[str, Any], row: int) -> Step:
    """The step that a table's values make."""
    label = values.get("label", "")
    if "go" in values:
        return Go(values["go"], row, label)
    if "jog" in values:
        return Jog(values["jog"], values.get("speed"), values.get("while"), values.get("for"), row, label)
    if "wait" in values or "wait_for" in values:
        return Wait(values.get("wait"), values.get("wait_for"), values.get("level", True), row, label)
    if "repeat" in values:
        return Repeat(values["repeat"], values["times"], row)
    on = "set" in values
    return Output(values["set" if on else "clear"], on, row, label)
