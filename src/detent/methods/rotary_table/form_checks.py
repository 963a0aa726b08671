"""Cautions about forms of the rotary table's method that are known to fail, and where.

The literal forms of the patent, the conventional angle and the halves of a rollover are cautions and no errors: they
can be simulated, and the comparison of the method does so. Traps and tests are those of the rotary-table specification.
"""

import math
from collections.abc import Iterator

from detent.files.findings import Caution
from detent.files.nearest import put
from detent.methods.rotary_table.derive import TICK, TableFigures, counted
from detent.units import format_quantity as text

TURN_COUNTER = put("method.form", '"turn counter"')


def form_caution(key: str, got: str, sound: str, consequence: str) -> Caution:
    """Look at a form that is known to fail, where another value of its key is sound."""
    return Caution(key, got, sound, consequence, put(key, sound))


def _angle(m: TableFigures) -> Iterator[Caution]:
    """The angle goes on beyond a turn."""
    if m.spec.method.form == "raw":
        ends = "the deviation jumps by a turn and the table runs away (test 11); a jog ends after two turns at most"
        got = '"raw", the conventional angle of one turn'
        yield form_caution("method.form", got, '"turn counter"', f"at the boundary {ends}")
    if m.spec.method.form == "flag" and m.spec.detector.fine.noise > 0:
        yield Caution(
            "noise at the boundary",
            f"up to {counted(m.noise)} with the flag",
            'none, or method.form = "turn counter"',
            "a crossing backwards sets the flag as well, or keeps it set, and the angle is wrong by a turn (trap 2)",
            TURN_COUNTER,
        )


def _start_angles(m: TableFigures) -> Iterator[Caution]:
    """With the flag a jog succeeds from wherever it starts."""
    method, latency, lag = m.spec.method, m.latency_way, m.following_error(m.speed)
    if method.form != "flag" or (method.guarded and method.judge == "theoretical"):
        return
    if method.judge == "actual":
        # The second crossing comes before a pass has seen less than a turn.
        where = f"a - jog at less than {text(latency, 'rad')}, a + jog as little below 360 deg"
        result = "the angle falls back, no rollover comes, and the table runs away (traps 1 and 2, test 13)"
    else:
        sure = f"{text(lag - latency, 'rad')} to " if lag > latency else ""
        where = f"a + jog at less than {sure}{text(lag, 'rad')}, a - jog as little below 360 deg"
        result = (
            "the first rollover comes before the lagging table has crossed the boundary, and throws it back a turn "
            "(trap 1, test 12)"
        )
    yield Caution(
        "start angle of a jog", f"at limits.speed it fails for {where}", "none that fails", result, TURN_COUNTER
    )


def _race(m: TableFigures) -> Iterator[Caution]:
    """No interrupt comes between the halves of a rollover."""
    method = m.spec.method
    if method.update == "atomic" or method.form == "raw":
        return
    strobe, task = round(method.strobe_period / TICK), round(method.task_period / TICK)
    common = math.gcd(strobe, task)
    apart = (round(method.interrupt_delay / TICK) - round(method.task_phase / TICK)) % common
    many = "each pass" if common == strobe else f"one pass in {strobe // common}"
    value = (
        f"{many} is interrupted between its halves" if apart == 0 else "no interrupt comes between as the clocks are"
    )
    lag = m.following_error(m.speed)
    jump = math.tau + lag if method.update == "flag first" else lag - math.tau
    seen = f"an interrupt there sees a deviation of {text(jump, 'rad')}, and the drive is at its limit for a sample"
    yield form_caution("method.update", f'"{method.update}": {value}', '"atomic"', f"{seen} (trap 3, test 15)")


def _remaining(m: TableFigures) -> Iterator[Caution]:
    """The remaining angle has a sign, and the position is controlled."""
    spec = m.spec
    if not spec.method.signed_remaining:
        driven = (
            "a table that passes its target by a count, in a positioning or at rest, is driven on and away (trap 4)"
        )
        yield form_caution("method.signed_remaining", "false: the remaining angle is |M - R|", "true", driven)
    if not spec.method.position_control:
        got, half_word = (
            "false: the speed signal is the commanded speed alone",
            text(0.5 * spec.speed_per_word, "rad/s"),
        )
        wrong = f"speeds are wrong by the droop, {text(spec.drive.droop, '%')}, and by up to half a word, {half_word}"
        yield form_caution("method.position_control", got, "true", f"{wrong}, and no place is kept (test 19)")


def _near_boundary(m: TableFigures) -> Iterator[Caution]:
    """Without the turn counter no position is near the boundary."""
    spec = m.spec
    if spec.method.form == "turn counter" or not m.is_stable:
        return
    for number, entry in spec.position.items():
        margin = m.overshoot(entry.speed) + (m.resting_error + m.noise + 1) * spec.count
        if not margin <= entry.angle <= math.tau - margin:
            yield Caution(
                f"position.{number}.angle",
                text(entry.angle, "rad"),
                f"{text(margin, 'rad')} to {text(math.tau - margin, 'rad')} without the counter",
                "the table meets the boundary on its way or by its overshoot, and runs away (test 11)",
                TURN_COUNTER,
            )


FORMS = (_angle, _start_angles, _race, _remaining, _near_boundary)  # looks at the form of the method
