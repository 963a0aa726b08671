"""The step rule of one motor in C: the steps that run here, translated for what this motor needs.

All parameters are constants, ramp list and zone limits tables, and no register is wider than its values. Both tables of
the envelope are read by a function of the header, which knows where their pages are.
"""

import re
from typing import get_args

import numpy as np

from detent.control import step_rule
from detent.control.step_rule import StepRule, StepRuleParams
from detent.control.step_timer import StepTimer, StepTimerParams
from detent.kernel.registers import Registers, Width, i1, i2, i4, u2, u4
from detent.methods.stepper_envelope.controller import (
    NOWHERE,
    StepperController,
    StepperControllerParams,
    deflect,
    start,
    step_along,
)
from detent.planning.step_envelope import INDEX_BITS, INDEX_MASK, SENTINEL
from detent.translate.program import Program
from detent.translate.text import helpers_text, struct_texts, wrapped
from detent.translate.values import Shape, Table

I1, I2, I4, U2, U4 = (get_args(one)[1] for one in (i1, i2, i4, u2, u4))
TRUTH, NUMBERS = re.compile(r"\b(bool|true|false)\b"), {"bool": "uint8_t", "true": "1", "false": "0"}
LARGEST = (1 << 31) - 1
WORDS = {2: (U2, "{NAME}_READ(word, {table}, (uint16_t)({{index}}))"),
         4: (I4, "((int32_t){NAME}_READ(dword, {table}, (uint16_t)({{index}})))")}  # fmt: skip
"""Width of a word of the ramp list by its bytes, and how it is read."""

Narrowed = dict[tuple[type, str], tuple[Width, tuple[int, int] | None]]


def narrowed(steps: int, ramp: int, fastest: int) -> Narrowed:
    """Width and range of registers that are other than declared: for a travel, entries of a ramp, and a largest word.

    Only a motor in fault goes beyond the ends of its travel, by a ramp at most. What only grows wraps at 32 bits.
    """
    beyond = ramp + 1
    place = I2 if steps + beyond <= np.iinfo(np.int16).max else I4
    return {
        (StepRule, "position"): (place, (-beyond, steps + beyond)),
        (StepRule, "index"): (I2, (-1, ramp - 1)),
        (StepRule, "request"): (I2, (-1, ramp - 1)),
        (StepRule, "heading"): (I1, (-1, 1)),
        (StepRule, "direction"): (I1, (-1, 1)),
        (StepRule, "request_word"): (I4, (0, LARGEST)),
        (StepRule, "word"): (I4, (0, fastest)),
        (StepTimer, "period"): (I4, (0, LARGEST)),
        (StepTimer, "expires"): (U4, None),
        (StepTimer, "pulses"): (U4, None),
    }


def rule_program(motor: str, p: StepperControllerParams, steps: int, limits: int, at: str) -> Program:
    """The rule of a motor, with its parameters; positions go to the header's reading function as the type `at`."""
    ramp = list(p.rule.ramp[: p.rule.last + 1])
    limit = list(p.rule.limit[:limits])
    words = 2 if max(ramp + limit) <= np.iinfo(np.uint16).max else 4
    width, read = WORDS[words]
    ends = (min(ramp), max(ramp))
    name, highest = motor.upper(), (limits - 1) << INDEX_BITS | INDEX_MASK
    entries = {
        key: Table(f"{motor}_{key}", I2, steps + 1, (SENTINEL, highest), f"{motor}_read({{text}}, ({at}){{index}})")
        for key in ("up", "down")
    }
    shape = Shape(
        tables={
            (StepRuleParams, "ramp"): Table(
                f"{motor}_ramp", width, len(ramp), ends, read.format(NAME=name, table=f"{motor}_ramp")
            ),
            (StepRuleParams, "limit"): Table(f"{motor}_limit", width, limits, (min(limit), max(limit))),
        },
        laid=entries,
        narrowed=narrowed(steps, len(ramp), LARGEST if p.rule.reload else max(ramp)),
        names={getattr(step_rule.deflect, "py_func", step_rule.deflect): f"{motor}_ask"},
        constants={"AT_REST": "SENTINEL"},
        storage="static inline ",
        checks=False,
    )
    roots: dict[type[Registers], str] = {StepRule: "rule", StepTimer: "timer", StepperController: "registers"}
    calls = {"place_motor": step_rule.place_motor, "start": start, "deflect": deflect, "next": step_along}
    by_name = {f"{motor}_{key}": step for key, step in calls.items()}
    return Program(motor, by_name, StepperControllerParams, constants_of(p), roots, shape)


def constants_of(p: StepperControllerParams) -> dict[tuple[type, str], float]:
    """Every parameter that is no table, and what of the state a motor alone does not need."""
    files = {StepperControllerParams: p, StepRuleParams: p.rule, StepTimerParams: p.timer}
    found: dict[tuple[type, str], float] = {
        (cls, field.name): getattr(registers, field.name)
        for cls, registers in files.items()
        for field in cls.__fields__.values()
        if field.width is not None and not field.length
    }
    return found | {(StepperController, "now"): 0, (StepperController, "stop_at"): NOWHERE}


def structures(program: Program) -> str:
    """Registers of the motor."""
    return struct_texts(program, (StepperController,))


def rule_text(program: Program) -> str:
    """The rule: helpers, and the steps, callees first."""
    parts = [helpers_text(program), *(program.texts[f.py] for f in program.order)]
    code = wrapped("\n".join(part for part in parts if part))
    # The header includes <stdint.h> alone: a truth value is 0 or 1.
    return re.sub(
        r"^(?!/\*| \*).*", lambda line: TRUTH.sub(lambda one: NUMBERS[one[0]], line[0]), code, flags=re.MULTILINE
    )
