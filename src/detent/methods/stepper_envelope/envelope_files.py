"""What of a stepper's envelope leaves for other tools and for firmware: the table as CSV, table and rule as a C header.

The header's registers, numbers and words are those of the control unit and the step timer that run here: they are taken
from the same declarations, so firmware and simulation cannot drift apart. Its text is step_rule.h.in.
"""

import ctypes
import re
from dataclasses import dataclass
from functools import partial
from importlib import resources
from pathlib import Path
from textwrap import wrap
from typing import Any

import numpy as np
from jinja2 import Environment, StrictUndefined
from numpy.typing import NDArray

from detent import __version__
from detent.control import step_rule
from detent.control.step_rule import StepRule
from detent.control.step_timer import StepTimer
from detent.files.text import write_text
from detent.methods.stepper_envelope.build import make_tables
from detent.methods.stepper_envelope.controller import StepperControllerParams, load_rule
from detent.methods.stepper_envelope.schema import StepperEnvelopeSpec
from detent.planning.step_envelope import ENTRY_BYTES, INDEX_BITS, INDEX_MASK, StepEnvelope, envelope_memory
from detent.record.trace_files import write_csv
from detent.units import format_quantity

Words = NDArray[np.int64]

LINE = 110  # longest line of a comment in the header
PER_LINE = 16  # numbers of up to five digits in a line of the header; of longer ones, half as many
METRE_DIGITS = 12  # decimals of a position in metres: a picometre, far below any step


@dataclass(frozen=True, slots=True, kw_only=True)
class EnvelopeTables:
    """Both tables of one motor, and what firmware must know to use them."""

    motor: str  # name of the motor, the prefix of all names in C
    axis: str  # name of the axis, for people
    up: StepEnvelope  # table towards growing positions
    down: StepEnvelope  # and towards falling ones: the same ramp, travel and numbering of the zone limits
    clock_hz: int  # ticks of the step timer per second [Hz]
    reload: bool  # words are periods of the timer in ticks instead of frequencies in Hz
    travel_per_step: float  # travel of the moved mass per step [m]
    first_position: float = 0.0  # place of step boundary 0 [m]
    pause: int = 1  # waiting time of a reversal, in periods of the start frequency, 0..255

    @property
    def steps(self) -> int:
        """N, steps of the whole travel."""
        return self.up.steps

    def words(self) -> tuple[Words, Words]:
        """Word of each ramp index, shape (L,), and of each zone limit, shape (Z,), as the control unit holds them.

        They are frequencies [Hz], or with reload words periods [tick].
        """
        p, limits = StepperControllerParams(), self.up.zones.limits
        load_rule(p, self.up.ramp, limits, self.clock_hz, reload=self.reload)
        return np.array(p.rule.ramp[: len(self.up.ramp)], np.int64), np.array(p.rule.limit[: len(limits)], np.int64)

    @property
    def word_bytes(self) -> int:
        """Memory of a word of the ramp list or of a zone limit in firmware: 2, or 4 where a period needs it."""
        return 2 if max(words.max() for words in self.words()) <= 0xFFFF else 4

    def periods(self, table: StepEnvelope) -> Words:
        """Period that the timer loads for every step i of one of the tables, 0 at a sentinel, shape (N,) [tick]."""
        slower = np.maximum if self.reload else np.minimum
        words = table.of_steps(*self.words(), slower)
        return words if self.reload else np.where(words, (self.clock_hz + words // 2) // np.maximum(words, 1), 0)


# ---- CSV


def write_envelope_csv(tables: EnvelopeTables, path: str | Path) -> None:
    """Write both tables as CSV, one row per step.

    Step i lies between the boundaries i and i + 1; `position` is that of boundary i. `permissible` is the frequency
    that ramp and zone allow; `period` is what the timer loads for it, words rounded. A step that is not allowed (a
    sentinel) has index -1, and 0 for permissible and period.
    """
    steps = np.arange(tables.steps)
    position = tables.first_position + steps * tables.travel_per_step
    columns: dict[str, NDArray[Any]] = {"step": steps, "position [m]": np.round(position, METRE_DIGITS)}
    for name, table in (("up", tables.up), ("down", tables.down)):
        columns[f"{name}.index"] = table.indices()
        columns[f"{name}.zone_limit [Hz]"] = table.zones.hz
        columns[f"{name}.permissible [Hz]"] = table.permissible_hz()
        columns[f"{name}.period [tick]"] = tables.periods(table)
    write_csv(Path(path), columns)


# ---- C header


def write_envelope_header(tables: EnvelopeTables, path: str | Path) -> None:
    """Write tables, ramp list, registers and step rule of one motor as a C99 header that needs only <stdint.h>.

    Every name in it begins with that of the motor, so that one firmware can include several. The rule is the
    ramp-limited one; the same calls leave the same bits in the same registers as in a simulation. The tables are
    arguments of the rule: firmware may run on the constants of the header, or on copies in RAM that it edits.
    """
    write_text(path, _header(tables))


def _header(tables: EnvelopeTables) -> str:
    environment = Environment(undefined=StrictUndefined, keep_trailing_newline=True, trim_blocks=True)  # noqa: S701 - C
    metres = partial(format_quantity, unit="m", digits=6)
    environment.filters |= {"comment": _comment, "numbers": _numbers, "metres": metres}
    template = resources.files("detent.methods.stepper_envelope").joinpath("step_rule.h.in").read_text(encoding="utf-8")
    ramp, limit = tables.words()
    memory = envelope_memory(tables.up.ramp, tables.up.zones)
    return environment.from_string(template).render(
        tables=tables,
        motor=tables.motor,
        MOTOR=tables.motor.upper(),
        version=__version__,
        ramp=ramp,
        limit=limit,
        limits=[f"{hz:g} Hz" for hz in tables.up.zones.limits],
        table_bytes=memory.tables + 2 * ENTRY_BYTES,
        register_bytes=ctypes.sizeof(StepRule) + ctypes.sizeof(StepTimer),
        compact=memory.compact,
        index_mask=f"0x{INDEX_MASK:04X}",
        index_bits=INDEX_BITS,
        rule=StepRule,
        timer=StepTimer,
        code=step_rule,
    )


def _comment(text: str, heading: str = "") -> str:
    """Lines of a block comment that no name can end, begin again or continue."""
    printable = "".join(one if one.isprintable() else " " for one in text)
    safe = re.sub(r"[*](?=/)|/(?=[*])", r"\g<0> ", printable).replace("??", "? ?")
    lines = wrap(safe, LINE - len(heading)) or [""]
    return "\n".join(f" * {heading if row == 0 else ' ' * len(heading)}{line}" for row, line in enumerate(lines))


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
