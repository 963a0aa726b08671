"""Questions of the tolerance tests, and machines of one file built one by one."""

import random
from collections.abc import Iterable, Mapping
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

import detent
from detent.errors import InputError
from detent.files.fields import held_leaves
from detent.files.source import parse_source
from detent.methods.batch import refusal_of
from detent.methods.cascade.batch import COLUMNS, CascadeBatch
from detent.methods.cascade.build import build_cascade
from detent.methods.load import axis_of
from detent.methods.moves.job import MoveJob, one_move
from detent.tune.batch import Chunk, Question, make_cases
from detent.tune.cases import draw
from tests.acceptance.test_golden_bits import EXAMPLES
from tests.cascade_rig import by_hand

EXAMPLE = by_hand((EXAMPLES / "cascade.toml").read_text(encoding="utf-8"))
SLIDE = """
[tolerance]
"mechanics.load_mass" = "10 %"
"mechanics.motor_mass" = ["6.4156 kg", "9.5844 kg"]            # 5 % of all on this side, with the rotor 31.69 kg
"mechanics.coupling.stiffness" = "10 %"
"mechanics.friction.positive.coulomb" = "30 %"
"mechanics.friction.negative.coulomb" = "30 %"
"mechanics.load_friction.positive.coulomb" = "30 %"
"drive.current_per_volt" = "5 %"
"mechanics.friction.positive.viscous" = "30 %"
"""
MOVE = one_move("50 mm", 0.05, 0.2)
SHORT = one_move("short", 0.0005, 0.002)

FORCE_PID = """
[axis]
name = "linear motor"
method = "cascade"
[limits]
travel = "0.4 m"
speed = "1 m/s"
acceleration = "10 m/s^2"
effort = "200 N"
[drive]
effort_per_volt = "20 N/V"
delay = 2
[mechanics]
load_mass = "12 kg"
transmission_loss = 0.02
[mechanics.friction]
offset = "1 N"
positive = { coulomb = "6 N", static = "8 N", stribeck = "2 mm/s", viscous = "15 N*s/m" }
negative = { coulomb = "5 N", viscous = "12 N*s/m" }
[encoder]
resolution = "0.5 um"
delay = 1
velocity_span = 20
[method]
structure = "pid"
proportional = "300 kV/m"
derivative = "3 kV*s/m"
feed_forward = { velocity = 1, acceleration = 0.9, coulomb = 0.5, viscous = 1, weight = 0.5 }
[home]
by = "contact"
[disturbance.push]
force = "30 N"
at = "0.3 s"
duration = "0.1 s"
"""


def asked(folder: Path, tolerance: str = SLIDE, job: MoveJob = MOVE, text: str = "", **more: Any) -> Question:
    """A question of the example, which begins at 100 mm, or of another text."""
    text = text or EXAMPLE.replace('"20 mm"', '"100 mm"', 1)
    file = folder / "slide.toml"
    file.write_text(text + tolerance, encoding="utf-8")
    return Question.of(detent.load(file).file, job, **more)


def quick(text: str = "") -> str:
    """A file whose axis is in position soon."""
    text = text or EXAMPLE
    return text.replace("[method]\n", '[method]\nin_position_time = "1 ms"\ntimeout = "0.1 s"\n')


def widened(text: str, chance: random.Random) -> str:
    """A table that tolerates every key that can be built as a column, some by so much that variants are refused."""
    lines = ["", "[tolerance]"]
    for path, _, value in held_leaves(axis_of(parse_source("axis.toml", text)).spec):
        key = ".".join(path)
        if key in COLUMNS and isinstance(value, int):
            lines.append(f'"{key}" = [{value}, {chance.randint(value + 1, 62)}]')
        elif key in COLUMNS and value:
            shares = [5, 15] if key.endswith(("coulomb", "static")) else [5, 20, 40]
            lines.append(f'"{key}" = "{chance.choice(shares)} %"')
    return "\n".join(lines) + "\n"


def one_by_one(question: Question, count: int) -> tuple[list[bytes], dict[int, str]]:
    """Parameters of each machine, built from a file of its own, and why some files are refused."""
    found, refused, values = list[bytes](), dict[int, str](), draw(question, 0, count)
    for k in range(count):
        try:
            found.append(bytes(build_cascade(machine(question, values, k).spec)))
        except InputError as error:
            found.append(b"")
            refused[k] = refusal_of(error.problems)
    return found, refused


def machine(question: Question, values: Mapping[str, Any], k: int) -> Any:
    """The axis file of a case."""
    return question.machine({key: float(each[k]) for key, each in values.items()})


def as_arrays(question: Question, count: int) -> tuple[list[bytes], dict[int, str]]:
    """The same from the builder of arrays."""
    values = draw(question, 0, count)
    fleet = CascadeBatch(question.file.spec, question.job).fleet(
        question.variant(values), lambda k: machine(question, values, k), count
    )
    assert len(fleet.specs) == 1  # built as columns
    made = [b"" if k in fleet.reasons else bytes(fleet.params[k]) for k in range(count)]
    return made, fleet.reasons


def spread_of(results: np.ndarray) -> tuple[float, float, float, float]:
    """Mean, standard deviation, 5 and 95 %."""
    low, high = np.quantile(results, [0.05, 0.95])
    return float(results.mean()), float(results.std()), float(low), float(high)


def gathered(chunks: Iterable[Chunk]) -> dict[str, np.ndarray]:
    """Results of many chunks in one, in the order of their cases."""
    each = sorted(chunks, key=lambda one: one.first)
    return {name: np.concatenate([one.results[name] for one in each]) for name in each[0].results}


def case_of(chunk: Chunk, number: int) -> tuple[dict[str, float], dict[str, float], str]:
    """Values, results and reason of one case."""
    k = number - chunk.first
    values, results = ({key: float(x[k]) for key, x in one.items()} for one in (chunk.values, chunk.results))
    return values, results, str(chunk.reason[k])


def corners(question: Question) -> dict[str, np.ndarray]:
    """What all machines do whose values are all at an end."""
    ends = np.array(list(product(*((one.low, one.high) for one in question.tolerance))))
    values = {one.key: ends[:, k].copy() for k, one in enumerate(question.tolerance)}
    return make_cases(question, values, len(ends))[0]
