"""What of a stepper's envelope leaves for other tools and for firmware: the table as CSV, table and rule as a C header.

The header's registers, numbers and words are those of the control unit and the step timer that run here: they are taken
from the same declarations, so firmware and simulation cannot drift apart. Its text is step_rule.h.in.
"""

import csv
import ctypes
import re
from collections.abc import Iterator
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from string import Template
from textwrap import wrap
from typing import Any

import numpy as np
from numpy.typing import NDArray

from detent import __version__
from detent.control import step_rule
from detent.control.step_rule import StepRule
from detent.control.step_timer import StepTimer
from detent.kernel.registers import Registers
from detent.methods.stepper_envelope.build import make_tables
from detent.methods.stepper_envelope.controller import StepperControllerParams, load_rule
from detent.methods.stepper_envelope.schema import StepperEnvelopeSpec
from detent.planning.step_envelope import ENTRY_BYTES, INDEX_BITS, INDEX_MASK, StepEnvelope, envelope_memory
from detent.record.trace_store import part_of, writing
from detent.units import format_quantity

Words = NDArray[np.int64]

CSV_ROWS = 8192  # rows of text made at once: bounds the memory of a CSV file of any length
LINE = 110  # longest line of a comment in the header
PER_LINE = 16  # numbers of up to five digits in a line of the header; of longer ones, half as many
METRE_DIGITS = 12  # decimals of a position in metres: a picometre, far below any step

CODES = (
    "REST", "ACCEL", "CRUISE", "DECEL", "TURN", "FAULT", "INFEASIBLE", "OUT_OF_RANGE", "IDLE", "STEP", "PAUSE",
)  # fmt: skip
"""Names of `control.step_rule` that the header has too."""


@dataclass(frozen=True, slots=True, kw_only=True)
class EnvelopeTables:
    """Both tables of one motor, and what firmware must know to use them."""

    motor: str  # name of the motor, the prefix of all names in C
    axis: str  # name of the axis, for people
    # up, down: tables towards growing and towards falling positions: one ramp, one travel, one numbering of the zone
    # limits
    up: StepEnvelope
    down: StepEnvelope
    clock_hz: int  # ticks of the step timer per second [Hz]
    reload: bool  # words are periods of the timer in ticks instead of frequencies in Hz
    travel_per_step: float  # travel of the moved mass per step [m]
    first_position: float = 0.0  # place of step boundary 0 [m]
    pause: int = 1  # waiting time of a reversal, in periods of the start frequency, 0..255

    @property
    def steps(self) -> int:
        """N, steps of the whole travel."""
        return self.up.steps

    def ramp_words(self) -> Words:
        """Word of each ramp index as the control unit holds it, shape (L,) [Hz, or tick with reload words]."""
        return np.array(self._loaded().rule.ramp[: len(self.up.ramp)], np.int64)

    def limit_words(self) -> Words:
        """Word of each zone limit as the control unit holds it, shape (Z,) [Hz, or tick with reload words]."""
        return np.array(self._loaded().rule.limit[: len(self.up.zones.limits)], np.int64)

    @property
    def word_bytes(self) -> int:
        """Memory of a word of the ramp list or of a zone limit in firmware: 2, or 4 where a period needs it."""
        return 2 if max(*self.ramp_words(), *self.limit_words()) <= 0xFFFF else 4

    def periods(self, table: StepEnvelope) -> Words:
        """Period that the timer loads for every step i of one of the tables, 0 at a sentinel, shape (N,) [tick]."""
        slower = np.maximum if self.reload else np.minimum
        words = table.of_steps(self.ramp_words(), self.limit_words(), slower)
        return words if self.reload else np.where(words, (self.clock_hz + words // 2) // np.maximum(words, 1), 0)

    def _loaded(self) -> StepperControllerParams:
        """Parameters of the motor's control unit, as a simulation has them."""
        p = StepperControllerParams()
        load_rule(p, self.up.ramp, self.up.zones.limits, self.clock_hz, reload=self.reload)
        return p


# ---- CSV


def write_envelope_csv(tables: EnvelopeTables, path: str | Path) -> None:
    """Write both tables as CSV, one row per step.

    Step i lies between the boundaries i and i + 1; `position` is that of boundary i. `permissible` is the frequency
    that ramp and zone allow; `period` is what the timer loads for it, words rounded. A step that is not allowed (a
    sentinel) has index -1, and 0 for permissible and period.
    """
    path = Path(path)
    steps, part = np.arange(tables.steps), part_of(path)
    position = tables.first_position + steps * tables.travel_per_step
    columns: dict[str, NDArray[Any]] = {"step": steps, "position [m]": np.round(position, METRE_DIGITS)}
    for name, table in (("up", tables.up), ("down", tables.down)):
        columns[f"{name}.index"] = table.indices()
        columns[f"{name}.zone_limit [Hz]"] = table.zones.hz
        columns[f"{name}.permissible [Hz]"] = table.permissible_hz()
        columns[f"{name}.period [tick]"] = tables.periods(table)
    with writing(path):
        with part.open("w", encoding="utf-8", newline="") as stream:
            out = csv.writer(stream, lineterminator="\n")
            out.writerow(columns)
            for first in range(0, tables.steps, CSV_ROWS):
                rows = (values[first : first + CSV_ROWS].tolist() for values in columns.values())
                out.writerows(zip(*rows, strict=True))
        part.replace(path)


# ---- C header


def write_envelope_header(tables: EnvelopeTables, path: str | Path) -> None:
    """Write tables, ramp list, registers and step rule of one motor as a C99 header that needs only <stdint.h>.

    Every name in it begins with that of the motor, so that one firmware can include several. The rule is the
    ramp-limited one; the same calls leave the same bits in the same registers as in a simulation. The tables are
    arguments of the rule: firmware may run on the constants of the header, or on copies in RAM that it edits.
    """
    path = Path(path)
    part = part_of(path)
    with writing(path):
        # A name need not be valid UTF-8; the header must be.
        part.write_text(_header(tables), encoding="utf-8", errors="replace", newline="\n")
        part.replace(path)


def _header(tables: EnvelopeTables) -> str:
    ramp, limit = tables.ramp_words(), tables.limit_words()
    title = f'Stepper envelope of motor "{tables.motor}", axis "{tables.axis}": tables and step rule in C99.'
    template = resources.files("detent.methods.stepper_envelope").joinpath("step_rule.h.in").read_text(encoding="utf-8")
    return Template(template).substitute(
        motor=tables.motor,
        MOTOR=tables.motor.upper(),
        title=_comment(title),
        version=__version__,
        facts="\n".join(_facts(tables)),
        steps=tables.steps,
        up_start=tables.up.start,
        up_stop=tables.up.stop,
        down_start=tables.down.start,
        down_stop=tables.down.stop,
        ramp_length=len(ramp),
        limit_length=len(limit),
        clock_hz=tables.clock_hz,
        reload=int(tables.reload),
        pause=tables.pause,
        word_unit="periods of the timer [tick]" if tables.reload else "frequencies [Hz]",
        word_type="uint16_t" if tables.word_bytes == 2 else "int32_t",
        index_mask=f"0x{INDEX_MASK:04X}",
        index_bits=INDEX_BITS,
        rule_registers=_members(StepRule),
        timer_registers=_members(StepTimer),
        ramp=_numbers(ramp),
        limit=_numbers(limit),
        up=_numbers(tables.up.entries),
        down=_numbers(tables.down.entries),
        **{name: getattr(step_rule, name) for name in CODES},
    )


def _facts(tables: EnvelopeTables) -> Iterator[str]:
    """What the numbers below mean, one fact per line of the opening comment."""
    up, down, step = tables.up, tables.down, tables.travel_per_step
    ramp, limits = up.ramp, up.zones.limits
    memory = envelope_memory(ramp, up.zones)
    lists = tables.word_bytes * (len(ramp) + len(limits))
    registers = ctypes.sizeof(StepRule) + ctypes.sizeof(StepTimer)
    first = format_quantity(tables.first_position, "m", 6)
    travel = format_quantity(tables.steps * step, "m", 6)
    rows = {
        "Travel": f"{tables.steps} steps of {format_quantity(step, 'm', 6)}: {travel}; boundary 0 lies at {first}",
        "Up": f"leaves {up.start}, stops at {up.stop}",
        "Down": f"leaves {down.start}, stops at {down.stop}",
        "Ramp": f"{len(ramp)} entries, {ramp.hz[0]:.6g} Hz to {ramp.hz[-1]:.6g} Hz",
        "Limits": ", ".join(f"{hz:g} Hz" for hz in limits),
        "Words": f"{'periods [tick]' if tables.reload else 'frequencies [Hz]'} of a timer at {tables.clock_hz} Hz",
        "Memory": f"tables {memory.tables + 2 * ENTRY_BYTES} bytes, ramp and limits {lists}, registers {registers}",
    }
    if memory.compact:
        rows["Memory"] += f"; with 8-bit ramp indices and no zone numbers a table would take {memory.compact}"
    for name, text in rows.items():
        yield _comment(text, f"{name:<7} ")


def _comment(text: str, heading: str = "") -> str:
    """Lines of a block comment that no name can end, begin again or continue."""
    printable = "".join(one if one.isprintable() else " " for one in text)
    safe = re.sub(r"[*](?=/)|/(?=[*])", r"\g<0> ", printable).replace("??", "? ?")
    lines = wrap(safe, LINE - len(heading)) or [""]
    return "\n".join(f" * {heading if row == 0 else ' ' * len(heading)}{line}" for row, line in enumerate(lines))


def _members(registers: type[Registers]) -> str:
    """Members of the C structure of a register file, each with its meaning."""
    lines: list[str] = []
    for field in registers.__fields__.values():
        width: Any = field.width
        unit = f" [{field.unit}]" if field.unit not in {"", "count", "code"} else ""
        lines.append(f"    {width.c_name} {field.name}; /* {field.doc}{unit} */")
    return "\n".join(lines)


def _numbers(values: NDArray[Any]) -> str:
    """Initialiser of an array."""
    texts = list(map(str, values.tolist()))
    per_line = PER_LINE if max(map(len, texts)) <= 5 else PER_LINE // 2
    rows = (texts[first : first + per_line] for first in range(0, len(texts), per_line))
    return ",\n".join("    " + ", ".join(row) for row in rows)


def envelope_tables(spec: StepperEnvelopeSpec, name: str) -> EnvelopeTables:
    """Tables of one motor as its file describes it."""
    table, tables = spec.stepper[name], make_tables(spec.stepper[name])
    return EnvelopeTables(
        motor=name,
        axis=spec.axis.name,
        up=tables.up,
        down=tables.down,
        clock_hz=round(spec.controller.timer),
        reload=spec.controller.words == "reload",
        travel_per_step=table.step,
        first_position=table.mechanics.lower_end,
        pause=table.drive.reversal_pause,
    )


@dataclass(frozen=True)
class Envelope:
    """Tables of one stepper.

    Attributes
    ----------
    tables : EnvelopeTables
        Both directions, and what firmware must know to use them.
    """

    tables: EnvelopeTables

    def save(self, path: str | Path) -> Path:
        """Write the tables; the suffix chooses CSV (.csv), a C99 header with the step rule (.h), or a figure.

        Raises
        ------
        DetentError
            The suffix is another, or the file cannot be written.
        """
        from detent.methods.stepper_envelope.envelope_figure import plot_envelope

        path = Path(path)
        writers = {".csv": write_envelope_csv, ".h": write_envelope_header}
        writers.get(path.suffix.lower(), plot_envelope)(self.tables, path)
        return path

    def to_dict(self) -> dict[str, Any]:
        """Plain data: size and memory of the tables."""
        t = self.tables
        return {
            "motor": t.motor,
            "steps": t.steps,
            "step": t.travel_per_step,
            "ramp": len(t.up.ramp),
            "start_hz": float(t.up.ramp.hz[0]),
            "top_hz": float(t.up.ramp.hz[-1]),
            "run_up": t.up.ramp.duration,
            "bytes": t.up.entries.nbytes + t.down.entries.nbytes + len(t.up.ramp) * t.word_bytes,
        }
