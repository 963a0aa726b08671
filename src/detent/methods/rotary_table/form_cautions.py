"""Forms of the rotary table's method that are known to fail, and where.

The literal forms of the patent, the conventional angle and the halves of a rollover are cautions and no errors: they
can be simulated, and the comparison of the method does so. Traps and tests are those of the rotary-table specification.
"""

import math
from collections.abc import Callable, Iterator

from detent.files.findings import Caution
from detent.files.nearest import either, put
from detent.methods.rotary_table.derive import FULL_TURN, Machine, counted
from detent.methods.rotary_table.rules import TICK
from detent.units import format_quantity


def _raw_angle(machine: Machine) -> Iterator[Caution]:
    if machine.spec.method.form == "raw":
        yield Caution(
            "method.form",
            '"raw", the conventional angle of one turn',
            '"turn counter"',
            "at the boundary the deviation jumps by a turn and the table runs away (test 11); a jog ends after two "
            "turns at most",
            put("method.form", '"turn counter"'),
        )


def _start_angles(machine: Machine) -> Iterator[Caution]:
    method = machine.spec.method
    if method.form != "flag" or (method.guarded and method.judge == "theoretical"):
        return
    latency, lag = machine.latency_way, machine.following_error(machine.speed)
    if method.judge == "actual":
        # The second crossing comes before a pass has seen less than a turn.
        where = f"a - jog at less than {format_quantity(latency, 'rad')}, a + jog as little below 360 deg"
        result = "the angle falls back, no rollover comes, and the table runs away (traps 1 and 2, test 13)"
        remedies = put("method.form", '"turn counter"')
    else:
        sure = format_quantity(lag - latency, "rad") if lag > latency else ""
        reach = f"{sure} to {format_quantity(lag, 'rad')}" if sure else format_quantity(lag, "rad")
        where = f"a + jog at less than {reach}, a - jog as little below 360 deg"
        result = (
            "the first rollover comes before the lagging table has crossed the boundary, and throws it back a turn "
            "(trap 1, test 12)"
        )
        remedies = either(put("method.form", '"turn counter"'), put("method.guarded", "true"))
    yield Caution("start angle of a jog", f"at limits.speed it fails for {where}", "none that fails", result, remedies)


def _flicker(machine: Machine) -> Iterator[Caution]:
    noise = machine.spec.detector.fine.noise
    if machine.spec.method.form == "flag" and noise > 0:
        yield Caution(
            "noise at the boundary",
            f"up to {counted(machine.noise)} with the flag",
            'none, or method.form = "turn counter"',
            "a crossing backwards sets the flag as well, or keeps it set, and the angle is wrong by a turn (trap 2)",
            put("method.form", '"turn counter"'),
        )


def _race(machine: Machine) -> Iterator[Caution]:
    method = machine.spec.method
    if method.update == "atomic" or method.form == "raw":
        return
    strobe, task = round(method.strobe_period / TICK), round(method.task_period / TICK)
    common = math.gcd(strobe, task)
    apart = (round(method.interrupt_delay / TICK) - round(method.task_phase / TICK)) % common
    many = "each pass" if common == strobe else f"one pass in {strobe // common}"
    value = (
        f"{many} is interrupted between its halves" if apart == 0 else "no interrupt comes between as the clocks are"
    )
    lag = machine.following_error(machine.speed)
    jump = FULL_TURN + lag if method.update == "flag first" else lag - FULL_TURN
    yield Caution(
        "method.update",
        f'"{method.update}": {value}',
        '"atomic"',
        f"an interrupt there sees a deviation of {format_quantity(jump, 'rad')}, and the drive is at its limit for a "
        "sample (trap 3, test 15)",
        put("method.update", '"atomic"'),
    )


def _unsigned(machine: Machine) -> Iterator[Caution]:
    if not machine.spec.method.signed_remaining:
        yield Caution(
            "method.signed_remaining",
            "false: the remaining angle is |M - R|",
            "true",
            "a table that passes its target by a count, in a positioning or at rest, is driven on and away (trap 4)",
            put("method.signed_remaining", "true"),
        )


def _open_loop(machine: Machine) -> Iterator[Caution]:
    spec = machine.spec
    if not spec.method.position_control:
        droop = spec.drive.droop
        yield Caution(
            "method.position_control",
            "false: the speed signal is the commanded speed alone",
            "true",
            f"speeds are wrong by the droop, {format_quantity(droop, '%')}, and by up to half a word, "
            f"{format_quantity(0.5 * spec.speed_per_word, 'rad/s')}, and no place is kept (test 19)",
            put("method.position_control", "true"),
        )


def _near_boundary(machine: Machine) -> Iterator[Caution]:
    spec = machine.spec
    if spec.method.form == "turn counter" or not machine.is_stable:
        return
    for number, entry in spec.position.items():
        margin = machine.overshoot(entry.speed) + (machine.resting_error + machine.noise + 1) * spec.count
        if not margin <= entry.angle <= FULL_TURN - margin:
            yield Caution(
                f"position.{number}.angle",
                format_quantity(entry.angle, "rad"),
                f"{format_quantity(margin, 'rad')} to {format_quantity(FULL_TURN - margin, 'rad')} without the counter",
                "the table meets the boundary on its way or by its overshoot, and runs away (test 11)",
                put("method.form", '"turn counter"'),
            )


FORMS: tuple[Callable[[Machine], Iterator[Caution]], ...] = (
    _raw_angle,
    _start_angles,
    _flicker,
    _race,
    _unsigned,
    _open_loop,
    _near_boundary,
)
"""Looks at the form of the method, in the order in which their warnings are told."""
