"""Axes far from power-on and far from zero: every clock and count moved by as much, and what is left the same.

`python -m tests.endurance` writes its figures, and those of `tests.energy`, into docs/explanation/endurance-table.md.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import reduce
from typing import Any

from tests import energy
from tests.acceptance import test_golden_bits as golden
from tests.difference import values_of
from tests.filtered_servo_rig import Rig as SlideRig
from tests.phase_servo_rig import Rig as CarriageRig
from tests.places import ROOT

PAGE = ROOT / "docs" / "explanation" / "endurance-table.md"
FAR = 1 << 61  # from here on a moment is none: it never comes
DIVIDED = 1 << 13  # ticks by which a start is moved are whole multiples: the periods of all dividers
LEAD = 1000  # ticks from the start, at least, until the boundary is crossed, in the midst of a motion
SAMPLES, TICKS = 25, 2000  # of each command, sampled every so many ticks
DAY = 86_400.0  # seconds


@dataclass(frozen=True)
class Clocks:
    """What of a method's registers tells the time, and what counts without end."""

    job: Callable[[], golden.Job]
    tick: float  # base tick [s]
    times: Mapping[str, int]  # units that each register goes on in a tick
    counts: Mapping[str, int]  # how far each goes when all go on by one unit
    place: str  # where the axis stands, as the controller counts it
    bounds: tuple[str, ...] = ()  # parameters that are places of such a count
    dither: int = 0  # by how much what it counts may change at rest
    quiet: Callable[[], golden.Job] | None = None  # the job without noise that adds up at rest


def slide(*noise: str) -> golden.Job:
    """The filtered servo, command pulses there and back."""
    rig = SlideRig("encoder.jitter=5 deg", *noise)
    commands = (lambda: rig.go(900, 2000.0), lambda: rig.go(-850, 1234.0))
    return golden.Job({"": rig.p}, {"": rig.r}, commands, rig.run_ticks, rig.acknowledge)


def noisy_slide() -> golden.Job:
    """The same on lines that pick pulses up."""
    return slide("disturbance.lines.inserted=20 Hz")


def carriage() -> golden.Job:
    """The phase servo, a pitch there and back, with as much noise on its detector as leaves it its way."""
    rig = CarriageRig("detector.jitter=20 ns", "detector.gain_error=2 %", "detector.offset_error=1 %", locked=True)
    commands = (lambda: rig.command(1), lambda: rig.command(-1))
    return golden.Job({"": rig.p}, {"": rig.r}, commands, rig.run_ticks, rig.acknowledge)


CLOCKS = {
    "print head": Clocks(
        golden.print_head, 40e-6,
        {"tick": 1} | dict.fromkeys(
            (f"controller.head.{name}_us" for name in (
                "now", "wake", "last_emitter", "next_ramp", "next_trim", "window", "columns.fire",
            )), 40,
        ),
        {"controller.quadrature.count": 4, "controller.cycle": 1},
        "controller.head.emitter",
    ),
    "phase servo": Clocks(
        carriage, 250e-9,
        {"controller.clocks.divider": 2} | dict.fromkeys((
            "tick", "controller.wake", "plant.interference.next_tick", "plant.interference.next_random",
            "plant.gauge.outside", *(f"controller.sequencer.{name}" for name in (
                "switched", "ready_at", "stop_at", "last_pulse",
            )),
        ), 1),
        {"controller.sequencer.position": 1},
        "controller.sequencer.position", dither=1,
    ),
    "filtered servo": Clocks(
        noisy_slide, 10e-6,
        dict.fromkeys((
            "tick", "plant.interference.next_tick", "plant.interference.next_random", "plant.gauge.outside",
        ), 1),
        dict.fromkeys((
            "controller.generator.goal", "controller.generator.command", "controller.deviation.position",
            "controller.watched", "controller.mark",
        ), 1),
        "controller.deviation.position", ("controller.lowest", "controller.highest"), quiet=slide,
    ),
    "rotary table": Clocks(
        golden.rotary_table, 100e-6,
        dict.fromkeys((
            "tick", "controller.tick", *(f"controller.clocks.{n}" for n in ("strobe", "interrupt", "task", "wake")),
        ), 1),
        dict.fromkeys(("controller.positioner.angle.position", "controller.watched"), 1),
        "controller.positioner.angle.position",
    ),
    "stepper envelope": Clocks(
        golden.stepper_envelope, 2e-6,
        {"tick": 1, "plant.gauge.outside": 1, "controller.now": 2, "controller.timer.expires": 2},
        {"controller.timer.pulses": 1},
        "controller.rule.position",
    ),
    "cascade": Clocks(
        golden.cascade, 1e-3 / 12,
        {"tick": 1, "plant.gauge.outside": 1}, {"controller.samples": 1}, "lines.motor.count",
    ),
}  # fmt: skip


def move(files: Mapping[str, Any], registers: Mapping[str, int], by: int) -> None:
    """Let these registers go on by so many of their units."""
    for name, units in registers.items():
        *blocks, own = name.split(".")
        for registers_of in files.values():
            block = reduce(getattr, blocks, registers_of)
            held = getattr(block, own)
            if isinstance(held, int):
                setattr(block, own, moved(held, units * by))
            else:
                held[:] = [moved(one, units * by) for one in held]


def moved(value: int, by: int) -> int:
    """A moment or a count later by so much, but for one that never comes."""
    return value + by if abs(value) < FAR else value


def lived(clocks: Clocks, ticks: int = 0, counts: int = 0) -> Iterator[dict[str, Any]]:
    """Registers through a job that begins so many ticks and counts later; what was later is told as it would be."""
    job = clocks.job()
    for registers, by in ((clocks.times, ticks), (clocks.counts, counts)):
        move(job.state, registers, by)
    move(job.params, dict.fromkeys(clocks.bounds, 1), counts)
    job.later(ticks)
    for command in job.commands:
        command()
        for _ in range(SAMPLES):
            job.run(TICKS)
            seen = {name: type(file).from_buffer_copy(file) for name, file in job.state.items()}
            for registers, by in ((clocks.times, ticks), (clocks.counts, counts)):
                move(seen, registers, -by)
            yield {f"{name}.{path}": value for name, file in seen.items() for path, value in values_of(file).items()}


def before(boundary: int) -> int:
    """Ticks to begin at so that the boundary [tick] is crossed in the midst of a motion."""
    return (boundary - LEAD) // DIVIDED * DIVIDED


def boundaries(clocks: Clocks) -> dict[str, int]:
    """Where counters of 32 bits, of doubles and of a day are over [tick]."""
    return {
        "2^31 ticks": 2**31,
        "2^32 ticks": 2**32,
        "2^53 ticks": 2**53,
        "2^31 us": round(2**31 * 1e-6 / clocks.tick),
        "2^32 us": round(2**32 * 1e-6 / clocks.tick),
        "24 h": round(DAY / clocks.tick),
    }


COUNTS = {f"2^{bits} counts": 2**bits - 10 for bits in (29, 31, 32, 53)}
"""So many units each count is moved by: the first motion crosses the boundary; 2^29 is that of 2^31 quarter cycles."""


def first_difference(clocks: Clocks, ticks: int = 0, counts: int = 0) -> dict[str, tuple[Any, Any]]:
    """Registers of the first sample that differ from those of a start at zero; empty where none ever does."""
    for near, far in zip(lived(clocks), lived(clocks, ticks, counts), strict=True):
        if near != far:
            return {path: (near[path], far[path]) for path in near if near[path] != far[path]}
    return {}


def stood(clocks: Clocks, seconds: float) -> tuple[list[int], list[int], list[int]]:
    """Places of all motors after a motion, so much later, and after the next motion."""
    job, rest = (clocks.quiet or clocks.job)(), 8 * SAMPLES * TICKS

    def places() -> list[int]:
        return [reduce(getattr, clocks.place.split("."), file) for file in job.state.values()]

    job.commands[0]()
    job.run(rest)
    before_it = places()
    job.run(round(seconds / clocks.tick))
    after_it = places()
    job.commands[1]()
    job.run(rest)
    return before_it, after_it, places()


# ---- the page


def clock_rows() -> Iterator[str]:
    """Of each method: its tick and a day of it, its registers, and what differs across the boundaries."""
    for name, clocks in CLOCKS.items():
        found = [first_difference(clocks, ticks=before(tick)) for tick in boundaries(clocks).values()]
        found += [first_difference(clocks, counts=sign * counts) for counts in COUNTS.values() for sign in (1, -1)]
        registers, differ = len(next(lived(clocks))), len({path for one in found for path in one})
        ticks = round(DAY / clocks.tick)
        yield f"| {name} | {clocks.tick * 1e6:.4g} us | {ticks} | {registers} | {len(found)} | {differ} |"


def share(value: float) -> str:
    """A share of an energy, to a digit or a percent; what is within a rounding of 0 is 0."""
    small = "0" if abs(value) < 1e-12 else f"{value:.0e}"
    return f"{100 * value:.0f} %" if value >= 0.01 else small


def page() -> str:
    """All figures, as Markdown."""
    driven = [f"| {name} | {share(abs(missing))} |" for name, missing in energy.driven().items()]
    alone = [
        f"| {name} | {first:.3g} J | {share(max(most / first - 1, 0.0))} | {share(max(1 - last / first, 0.0))} |"
        for name, (first, most, last) in energy.alone().items()
    ]
    return "\n".join([
        "# Long runs: figures",
        "",
        "This page is written by `python -m tests.endurance`, run from the root of the project; do not edit it.",
        "`make test-wide` makes all of it again, and compares.",
        "",
        "## Clocks and counts",
        "",
        "Before a job with a motion there and back, all clocks of the axis are moved so that the first motion",
        f"crosses a boundary: {', '.join(boundaries(CLOCKS['print head']))}.",
        "Then, in jobs of their own, all counts that never end are moved, in both directions:",
        f"{', '.join(COUNTS)}.",
        "Every register is compared with that of a start at zero, bit for bit,",
        f"{2 * SAMPLES} times in each job.",
        "",
        "| method | tick | ticks of 24 h | registers | starts | registers that differ |",
        "| --- | --: | --: | --: | --: | --: |",
        *clock_rows(),
        "",
        "The extended angle of a rotary table and the encoder of a cascade axis are driven across 2^31 and 2^32, too.",
        "A day at rest is simulated tick by tick by `make test-long` for all but the phase servo and the stepper",
        "envelope, whose ticks are too short: the axis stands where it stood, and its next motion ends where it would",
        "have ended.",
        "",
        "## Energy",
        "",
        f"Each plant is driven to and fro for {energy.LONG} ticks. What of the energy put in is neither lost to",
        "friction, winding and damping nor held at the end:",
        "",
        "| plant | share of the energy put in |",
        "| --- | --: |",
        *driven,
        "",
        "Left alone for as many ticks, no plant holds more at any tick than at first:",
        "",
        "| plant | energy at first | gained at most | lost at the end |",
        "| --- | --: | --: | --: |",
        *alone,
        "",
        "What the carriage misses goes where it turns round: it stands for the rest of that tick. Without any friction",
        "that takes 4e-6 of its energy each time, 20 000 times in this run; with friction it stands there anyway.",
        "",
    ])  # fmt: skip


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
