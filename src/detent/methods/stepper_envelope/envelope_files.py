"""What of a stepper's envelope leaves for other tools and for firmware: tables as CSV or as a figure, a C header.

The header's registers, numbers and words are those of the control unit and the step timer that run here: they are taken
from the same declarations, so firmware and simulation cannot drift apart. Its text, with the rule, is step_rule.h.in.
"""

import re
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from importlib import resources
from pathlib import Path
from textwrap import wrap
from typing import Any

import numpy as np
from jinja2 import Environment, StrictUndefined
from numpy.typing import NDArray

from detent.axisfile.motion import unit_in
from detent.control import step_rule
from detent.files.marks import IN_C, signed
from detent.files.screen import OnScreen
from detent.files.text import check_target, shown, write_text
from detent.kernel.registers import Registers
from detent.methods.stepper_envelope.build import make_tables
from detent.methods.stepper_envelope.controller import StepperControllerParams, load_rule
from detent.methods.stepper_envelope.rule_in_c import narrowed, rule_program, rule_text, structures
from detent.methods.stepper_envelope.schema import StepperEnvelopeSpec
from detent.methods.stepper_envelope.summary import units_of
from detent.page.parts import Numbers
from detent.page.plots import COLOURS, new_figure
from detent.planning.step_envelope import ENTRY_BYTES, INDEX_BITS, INDEX_MASK, SENTINEL, StepEnvelope
from detent.record.trace_files import write_csv
from detent.units import format_quantity

Words = NDArray[np.int64]
# matplotlib's stubs leave every **kwargs untyped, so that strict checking would refuse each call.
Axes = Any

LINE = 110  # longest line of a comment in the header
PER_LINE = 16  # numbers of up to five digits in a line of the header; of longer ones, half as many
MARK = "\0mark"  # stands for the checksum of a header's code, until that is known
PAGE = 256  # entries of a table that firmware keeps together: the low byte of a position is the place in its page
PER_OBJECT = 63  # pages in one object in C: avr-gcc takes 32767 bytes at most
PLACE_DIGITS = 12  # decimals of a position in metres or radians: a picometre, far below any step

BLUE, ORANGE = COLOURS[:2]
GREY = "#7d8996"
INK = "#17202a"

HEADROOM = 1.32  # height of each half over its largest limit: room for the limits and, further out, the direction
UPRIGHT, NONE = 0.07, 0.015  # parts of the travel: narrower zones have their limit written upright, or not at all
BESIDE = 0.17  # part of the travel that the name of an extreme may take, beside its point

LABEL: dict[str, Any] = {"facecolor": "white", "edgecolor": "none", "alpha": 0.85, "pad": 1.5}


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class EnvelopeTables(OnScreen):
    """Both tables of one motor, and what firmware must know to use them."""

    motor: str  # name of the motor, the prefix of all names in C
    axis: str  # name of the axis, for people
    up: StepEnvelope  # table towards growing positions
    down: StepEnvelope  # and towards falling ones: the same ramp, travel and numbering of the zone limits
    clock_hz: int  # ticks of the step timer per second [Hz]
    reload: bool  # words are periods of the timer in ticks instead of frequencies in Hz
    travel_per_step: float  # travel of what is moved per step [m]
    first_position: float = 0.0  # place of step boundary 0 [m]
    pause: int = 1  # waiting time of a reversal, in periods of the start frequency, 0..255
    motion: str = "linear"  # "rotary" where the motor turns what it moves: rad for m

    @property
    def steps(self) -> int:
        """N, steps of the whole travel."""
        return self.up.steps

    def words(self) -> tuple[Words, Words]:
        """Word of each ramp index, shape (L,), and of each zone limit, shape (Z,), as the control unit holds them.

        They are frequencies [Hz], or with reload words periods [tick].
        """
        p = self.parameters()
        ramp, limit = p.rule.ramp[: len(self.up.ramp)], p.rule.limit[: len(self.up.zones.limits)]
        return np.array(ramp, np.int64), np.array(limit, np.int64)

    def parameters(self) -> StepperControllerParams:
        """What the control unit of this motor is set to."""
        p = StepperControllerParams(pause=self.pause)
        load_rule(p, self.up.ramp, self.up.zones.limits, self.clock_hz, reload=self.reload)
        return p

    @property
    def word_bytes(self) -> int:
        """Memory of a word of the ramp list or of a zone limit in firmware: 2, or 4 where a period needs it."""
        return 2 if max(words.max() for words in self.words()) <= 0xFFFF else 4

    def periods(self, table: StepEnvelope) -> Words:
        """Period that the timer loads for every step i of one of the tables, 0 at a sentinel, shape (N,) [tick]."""
        slower = np.maximum if self.reload else np.minimum
        words = table.of_steps(*self.words(), slower)
        return words if self.reload else np.where(words, -(-self.clock_hz // np.maximum(words, 1)), 0)


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
        motion=table.motion,
    )


# ---- CSV


def write_envelope_csv(tables: EnvelopeTables, path: str | Path, *, force: bool = False) -> None:
    """Write both tables as CSV, one row per step.

    Step i lies between the boundaries i and i + 1; `position` is that of boundary i, in rad for a motor that turns.
    `permissible` is the frequency that ramp and zone allow; `period` is what the timer loads for it, words rounded. A
    step that is not allowed (a sentinel) has index -1, and 0 for permissible and period.
    """
    steps = np.arange(tables.steps)
    position = tables.first_position + steps * tables.travel_per_step
    unit = unit_in(tables.motion, "m")
    columns: dict[str, NDArray[Any]] = {"step": steps, f"position [{unit}]": np.round(position, PLACE_DIGITS)}
    for name, table in (("up", tables.up), ("down", tables.down)):
        columns[f"{name}.index"] = table.indices()
        columns[f"{name}.zone_limit [Hz]"] = table.zones.hz
        columns[f"{name}.permissible [Hz]"] = table.permissible_hz()
        columns[f"{name}.period [tick]"] = tables.periods(table)
    write_csv(Path(path), columns, force=force)


# ---- C header


@dataclass(frozen=True)
class Paged:
    """Both tables as firmware keeps them: pages of entries, those that are alike once, and their order."""

    pages: NDArray[np.int16]  # shape (P, PAGE)
    up: Words  # number of the page of each PAGE positions
    down: Words
    own: int  # pages that two stops need which move: the ramp down to each, and the stop

    @property
    def objects(self) -> list[NDArray[np.int16]]:
        """The pages, as many together as every compiler takes."""
        return [self.pages[first : first + PER_OBJECT] for first in range(0, len(self.pages), PER_OBJECT)]

    @property
    def bytes(self) -> int:
        """Memory of the pages."""
        return self.pages.nbytes

    @property
    def number_bytes(self) -> int:
        """Width of a page's number."""
        return 1 if len(self.pages) + self.own <= 1 << 8 else 2

    @property
    def order_bytes(self) -> int:
        """Memory of the order of the pages, both directions."""
        return self.number_bytes * (len(self.up) + len(self.down))


def paged(tables: EnvelopeTables) -> Paged:
    """Both tables in pages; beyond the travel, where nothing is read, are sentinels."""
    steps, reach = tables.steps, len(tables.up.ramp)
    flat = np.full((2, -(-(steps + 1) // PAGE) * PAGE), SENTINEL, np.int16)
    flat[:, : steps + 1] = tables.up.entries, tables.down.entries
    pages, numbers = np.unique(flat.reshape(-1, PAGE), axis=0, return_inverse=True)
    up, down = numbers.reshape(2, -1).astype(np.int64)
    return Paged(pages, up, down, own=2 * (1 + -(-reach // PAGE)))


def register_types(tables: EnvelopeTables, registers: type[Registers]) -> dict[str, str]:
    """C type of each register, as wide as its values need."""
    needed = narrowed(tables.steps, len(tables.up.ramp), 0)
    return {leaf.path: needed.get((registers, leaf.path), (leaf.width,))[0].c_name for leaf in registers.leaves()}


def write_envelope_header(tables: EnvelopeTables, path: str | Path, *, force: bool = False) -> None:
    """Write tables, ramp list, registers and step rule of one motor as a C99 header that needs only <stdint.h>.

    Every name in it begins with that of the motor, so that one firmware can include several; two headers of one motor,
    as of two axes that call theirs alike, do not compile together. The rule is the ramp-limited one; the same calls
    leave the same values in the same registers as in a simulation. On AVR tables and ramp list stay in flash; stops
    that move take pages in RAM.
    """
    text = _header(tables)
    code = text.partition("\n#ifndef")[2]  # without the comment in front: it may name another axis
    text = text.replace(MARK, f"0x{zlib.crc32(code.encode()):08X}")
    write_text(path, signed(text, IN_C), force=force)


def _header(tables: EnvelopeTables) -> str:
    environment = Environment(undefined=StrictUndefined, keep_trailing_newline=True, trim_blocks=True)  # noqa: S701 - C
    places = partial(format_quantity, unit=unit_in(tables.motion, "m"), digits=6)
    environment.filters |= {"comment": _comment, "numbers": _numbers, "place": places}
    template = resources.files("detent.methods.stepper_envelope").joinpath("step_rule.h.in").read_text(encoding="utf-8")
    ramp, limit = tables.words()
    wide = tables.word_bytes > 2
    parts, at = paged(tables), "uint16_t" if tables.steps <= np.iinfo(np.uint16).max else "uint32_t"
    program = rule_program(tables.motor, tables.parameters(), tables.steps, len(limit), at)
    return environment.from_string(template).render(
        tables=tables,
        motor=tables.motor,
        MOTOR=tables.motor.upper(),
        ramp=ramp,
        limit=limit,
        limits=[f"{hz:g} Hz" for hz in tables.up.zones.limits],
        paged=parts,
        page=PAGE,
        page_bytes=PAGE * ENTRY_BYTES,
        per_object=PER_OBJECT,
        table_bytes=2 * ENTRY_BYTES * (tables.steps + 1),
        number=f"uint{8 * parts.number_bytes}_t",
        word="int32_t" if wide else "uint16_t",
        read="dword" if wide else "word",
        structures=structures(program),
        rule=rule_text(program),
        at=at,
        index_mask=f"0x{INDEX_MASK:04X}",
        index_bits=INDEX_BITS,
        code=step_rule,
        mark=MARK,
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


# ---- figure


def plot_envelope(tables: EnvelopeTables, path: str | Path, *, force: bool = False) -> None:
    """Draw the permissible frequency over the position: upwards above the axis, downwards below it.

    The run between a direction's extremes is filled; outside of them a dashed line shows what the table allows there.
    What the zones forbid is grey. Steps and Hz are at the left and below, mm and mm/s at the right and
    above, or degrees of a motor that turns.
    """
    path = check_target(path, force=force)
    top = HEADROOM * max(tables.up.zones.limits)
    with new_figure(path, 9.0, 5.4, force=force) as figure:
        area = figure.subplots()
        outside = False
        for table, colour in ((tables.up, BLUE), (tables.down, ORANGE)):
            _shade_zones(area, table, top)
            outside = _draw_table(area, table, colour) or outside
            way, place = ("up →", 0.968) if table.direction > 0 else ("← down", 0.032)
            area.text(
                0.008, place, way, transform=area.transAxes, color=colour, fontsize=11, fontweight="bold", va="center",
                bbox=LABEL,
            )  # fmt: skip
        if outside:
            area.plot([], [], "--", color=INK, linewidth=0.9, label="permissible outside of the run")
        area.axhline(0, color=INK, linewidth=0.9)
        _mark_extremes(area, tables)
        area.set_xlim(0, tables.steps)
        area.set_ylim(-top, top)
        area.xaxis.get_major_locator().set_params(integer=True)
        area.set_xlabel("position [step]")
        area.set_ylabel("permissible step frequency [Hz]")
        # The same in mm and mm/s, or in degrees.
        units = units_of(tables)
        step, first = (way * units.place.factor for way in (tables.travel_per_step, tables.first_position))
        area.secondary_xaxis("top", functions=_line(first, step)).set_xlabel(f"position [{units.place.name}]")
        per_step = format_quantity(tables.travel_per_step, unit_in(tables.motion, "m"), 4).replace("um", "µm")
        speed = f"speed [{units.speed.name}], {per_step} a step"
        area.secondary_yaxis("right", functions=_line(0.0, step)).set_ylabel(speed)
        area.set_title(shown(f"How fast may every step be? Motor {tables.motor}, axis {tables.axis}"), pad=12)
        figure.legend(loc="outside lower center", ncols=2, fontsize=9)


def _shade_zones(area: Axes, table: StepEnvelope, top: float) -> None:
    """Grey over the frequencies that a zone forbids, and the zone's limit in figures."""
    zones, sign = table.zones, table.direction
    hz = np.array(zones.limits)[zones.numbers]
    name = "faster than the zone allows" if sign > 0 else None
    area.stairs(sign * hz, zones.edges, baseline=sign * top, fill=True, color=GREY, alpha=0.22, linewidth=0, label=name)
    area.stairs(sign * hz, zones.edges, baseline=None, color=GREY, linewidth=0.9)
    for begin, end, limit in zip(zones.edges[:-1], zones.edges[1:], hz, strict=True):
        part = (end - begin) / zones.steps
        if part >= NONE:
            area.annotate(
                f"{limit:g} Hz", ((begin + end) / 2, sign * limit), (0, 4 * sign), textcoords="offset points",
                ha="center", va="bottom" if sign > 0 else "top", fontsize=9, color="#3d4751",
                rotation=0 if part >= UPRIGHT else 90,
            )  # fmt: skip


def _draw_table(area: Axes, table: StepEnvelope, colour: str) -> bool:
    """The steps of the run filled, all others as a thin dashed line; True if there are others."""
    hz = table.direction * table.permissible_hz()
    low, high = sorted((table.start, table.stop))
    if (table.stop - table.start) * table.direction <= 0:
        low = high = 0
    for begin, end in ((0, low), (high, table.steps)):
        if begin < end:
            values, edges = _corners(hz[begin:end], begin)
            area.stairs(values, edges, baseline=None, color=colour, linewidth=0.9, alpha=0.6, linestyle="--")
    if low < high:
        values, edges = _corners(hz[low:high], low)
        area.stairs(values, edges, fill=True, color=colour, alpha=0.16, linewidth=0)
        area.stairs(values, edges, color=colour, linewidth=1.8)
    return high - low < table.steps


def _corners(hz: Numbers, first: int) -> tuple[Numbers, NDArray[np.int64]]:
    """Values that follow one another, each once, and the places where they begin and the last one ends."""
    begins = np.concatenate(([0], np.flatnonzero(np.diff(hz)) + 1)).astype(np.int64)
    return hz[begins], np.append(begins, len(hz)) + first


def _mark_extremes(area: Axes, tables: EnvelopeTables) -> None:
    """Points on the axis where a run begins, turns and ends, each named in its own half, outside of the run.

    Names stand above or below (1, -1), and right or left of the point.
    """
    up, down = tables.up, tables.down
    marks = [("start", up.start, (1, -1)), ("stop", down.stop, (-1, -1))]
    if up.start == down.stop:
        marks = [("start and stop", up.start, (1, -1))]
    marks += [("stop", up.stop, (1, 1)), ("start", down.start, (-1, 1))]
    if up.stop == down.start:
        marks[-2:] = [("turn", up.stop, (1, 1))]
    across = area.get_yaxis_transform()
    for name, place, (vertical, outer) in marks:
        part = place / tables.steps
        side = outer if BESIDE < part < 1 - BESIDE else 1 if part < 0.5 else -1
        area.plot(part, 0, "o", color=INK, markersize=7, clip_on=False, zorder=5, transform=across)
        area.annotate(
            f"{name} {place}", (part, 0), (4 * side, 8 * vertical), xycoords=across, textcoords="offset points",
            ha="left" if side > 0 else "right", va="bottom" if vertical > 0 else "top", fontsize=9, fontweight="bold",
            bbox=LABEL, zorder=6,
        )  # fmt: skip


def _line(begin: float, slope: float) -> tuple[Callable[[Numbers], Numbers], Callable[[Numbers], Numbers]]:
    """A straight line, there and back, as matplotlib wants a second scale."""
    return lambda there: begin + slope * np.asarray(there), lambda back: (np.asarray(back) - begin) / slope


# ---- all of them


@dataclass(frozen=True, repr=False)
class Envelope(OnScreen):
    """Tables of one stepper.

    Attributes
    ----------
    tables : EnvelopeTables
        Both directions, and what firmware must know to use them.
    """

    tables: EnvelopeTables

    def save(self, path: str | Path, *, force: bool = False) -> Path:
        """Write the tables; the suffix chooses CSV (.csv), a C99 header with the step rule (.h), or a figure.

        A file that detent did not write, or that was edited since, is replaced by `force` only.

        Raises
        ------
        DetentError
            The suffix is another, or the file cannot be written.
        """
        path = Path(path)
        writers = {".csv": write_envelope_csv, ".h": write_envelope_header}
        writers.get(path.suffix.lower(), plot_envelope)(self.tables, path, force=force)
        return path

    def to_dict(self) -> dict[str, Any]:
        """Plain data: size and memory of the tables."""
        t = self.tables
        return {
            "motor": t.motor,
            "steps": t.steps,
            "step": t.travel_per_step,
            "motion": t.motion,
            "ramp": len(t.up.ramp),
            "start_hz": float(t.up.ramp.hz[0]),
            "top_hz": float(t.up.ramp.hz[-1]),
            "run_up": t.up.ramp.duration,
            "bytes": (pages := paged(t)).bytes + pages.order_bytes + len(t.up.ramp) * t.word_bytes,
        }
