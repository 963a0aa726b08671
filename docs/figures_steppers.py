"""The figures of the stepper envelope: each is drawn from its tables, or from a run with a rotor.

`methods_table` writes a table in place of a picture.
"""

import math
from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np
from figures import BLUE, FOLDER, GREEN, GREY, ORANGE, label, picture

LEGEND = {"loc": "lower left", "bbox_to_anchor": (0, 1), "fontsize": 9}
MOTOR = "group_a"
OPEN = tuple(f"stepper.{MOTOR}.zone.{zone}.speed=20 mm/s" for zone in ("near", "far"))
"""The example without its zones: they allow what the axis allows."""
FOREVER = 1 << 60
SETTLING = 0.1
"""Time that a rotor is given to come to rest before its lost steps are counted [s]."""


def zoom(*overrides: str) -> Any:
    """The example of two lens groups."""
    import detent

    return detent.load(detent.example("zoom.toml"), overrides)


def standing(way: int, *overrides: str) -> Any:
    """Motor of the example at its lower end, its tables made for a run of `way` steps."""
    from detent.methods.stepper_envelope.host import StageMotor

    motor = StageMotor(zoom(*overrides).spec, MOTOR)
    motor.tables.up.move_start(0)
    motor.tables.up.move_stop(way)
    return motor


def compute(motor: Any, method: int, way: int, hz: float | None = None) -> Any:
    """Let another method drive the motor upwards over `way` steps; it begins at `hz`, or at the start frequency."""
    motor.compare(method, range(way), float(motor.tables.ramp.hz[0]) if hz is None else hz)
    c = motor.p.comparison
    c.limit[: c.zones] = [max(limit, hz or 0.0) for limit in c.limit[: c.zones]]
    return motor


def lost(motor: Any) -> int:
    """Run to rest; steps lost then."""
    from detent.control.step_rule import start_move
    from detent.plant.stepper_rotor import lost_steps

    start_move(motor.controller.rule, 1, 0)
    motor.advance_to(FOREVER, 0, until_event=True)
    motor.advance_to(motor.r.tick + round(SETTLING / motor.p.plant.rotor.dt), 0, until_event=False)
    return lost_steps(motor.p.plant.rotor, motor.r.plant.rotor)


def watch(motor: Any, names: Sequence[str], seconds: float, every: int) -> tuple[Any, Any]:
    """Start upwards and record registers: time [s], and the registers by name."""
    from detent.control.step_rule import acknowledge, start_move
    from detent.kernel.loop import advance
    from detent.methods.stepper_envelope.system import Stepper
    from detent.record.recorder import choose_leaves

    leaves = choose_leaves(Stepper, names)
    picks = np.concatenate([np.arange(leaf.offset, leaf.offset + leaf.width.size) for leaf in leaves]).astype(np.int64)
    count = round(seconds / motor.p.plant.rotor.dt / every)
    rows = np.zeros((count + 1, len(picks)), np.uint8)
    start_move(motor.controller.rule, 1, 0)
    left, feed = count * every, motor.feed
    while left > 0:
        left -= advance(motor.p, motor.r, left, rows, picks, every, *feed)
        acknowledge(motor.controller.rule)  # at rest time passes on
    found = rows.view(np.dtype([(leaf.path, "<" + leaf.width.code) for leaf in leaves]))[1:, 0]
    return np.arange(1, count + 1) * every * motor.p.plant.rotor.dt, found


def step_hz(motor: Any, period: Any) -> Any:
    """Step frequency of periods of the timer [Hz]; not a number at rest."""
    period = np.where(period > 0, period, np.nan)
    return motor.p.controller.timer.clock_hz / period


@cache
def figures_of(*overrides: str) -> Any:
    """What `detent check` works out for the motor."""
    from detent.methods.stepper_envelope.derive import MotorFigures

    return MotorFigures(zoom(*overrides).spec, MOTOR)


# -- motor and ramp ----------------------------------------------------------------------------------------------------
def lost_steps() -> None:
    """Steps lost when 400 steps of one frequency begin and end at once."""
    from detent.control.step_comparison import CONSTANT_FREQUENCY

    m = figures_of(*OPEN)
    hz = np.geomspace(200, 4000, 60)
    found = [abs(lost(compute(standing(400, *OPEN), CONSTANT_FREQUENCY, 400, f))) for f in hz.tolist()]
    with picture("lost-steps.png", 1, 3.4) as (area,):
        area.semilogx(hz, found, "o-", color=BLUE, markersize=3.5, linewidth=1)
        for f, text, colour in ((m.natural_hz, "rotor swings", GREY), (m.start_hz, "start frequency", GREEN)):
            area.axvline(f, color=colour, linestyle="--", linewidth=1)
            label(area, f"{text}\n{f:.0f} Hz", (f, 100), (4, 0))
        first = float(hz[np.flatnonzero(found)[0]])
        area.axvspan(first, 4000, color=ORANGE, alpha=0.10, linewidth=0)
        label(area, f"steps are lost\nfrom some {round(first, -2):.0f} Hz on", (first, 100), (4, 0))
        area.set_xticks([200, 400, 800, 1000, 2000, 4000])
        area.xaxis.set_major_formatter("{x:.0f}")
        area.minorticks_off()
        area.set_xlabel("step frequency, from the first step to the last [Hz]")
        area.set_ylabel("lost of 400 steps")
        area.margins(x=0)


def torque() -> None:
    """Pull-out torque and what of it a ramp takes: the form of the specification, and a winding at three supplies."""
    import detent
    from detent.methods.stepper_envelope.build import pull_out

    m = figures_of(*OPEN)
    hz = np.linspace(0, 5000, 400)
    there = np.array([m.motor.pull_out(f) for f in hz.tolist()]) * 1e3
    used = (m.motor.friction_torque + m.acceleration_torque(1.0) * np.diff(m.ramp.hz**2, append=np.nan) / 2) * 1e3
    with picture("torque.png", 1, 3.8, columns=2, share_x=False) as (known, wound):
        known.plot(hz, there, color=BLUE, label="pull-out")
        known.plot(hz, there / m.table.drive.torque_safety, color=BLUE, linestyle="--", label="divided by SF")
        known.plot(m.ramp.hz, used, color=ORANGE, label="the ramp takes")
        known.axhline(m.motor.friction_torque * 1e3, color=GREY, linewidth=1, label="friction")
        for f, text, place in (
            (m.linear_end, "linear up to", (1300, 3.4)),
            (m.torque_end, "no torque left at", (1900, 0.9)),
        ):
            at = m.motor.pull_out(f) / m.table.drive.torque_safety * 1e3
            known.plot(f, at, "o", color=ORANGE, markersize=5)
            known.annotate(
                f"{text} {f:.0f} Hz", (f, at), place, fontsize=9,
                arrowprops={"arrowstyle": "-", "color": GREY, "linewidth": 0.8},
            )  # fmt: skip
        known.set_title("zoom.toml: first order", loc="left", fontsize=9)
        for volts, colour in ((12, ORANGE), (24, BLUE), (48, GREEN)):
            table = detent.load(detent.example("stage.toml"), (f"stepper.x.drive.supply={volts} V",)).spec.stepper["x"]
            curve = [pull_out(table)(f) * 1e3 for f in (hz * 2.4).tolist()]
            wound.plot(hz * 2.4, curve, color=colour, label=f"{volts} V")
        wound.set_title("stage.toml: winding, at three supplies", loc="left", fontsize=9)
        for area in (known, wound):
            area.set_ylim(bottom=0)
            area.set_xlim(left=0)
            area.set_xlabel("step frequency [Hz]")
            area.legend(loc="upper right", fontsize=8)
        known.set_ylabel("torque [mN·m]")


def ramp() -> None:
    """The ramp list over its index and over time."""
    m = figures_of(*OPEN)
    n = np.arange(len(m.ramp))
    straight = np.sqrt(m.start_hz**2 + 2 * m.linear * n)
    t = np.cumsum(1 / m.ramp.hz) * 1e3
    bend = int(np.searchsorted(m.ramp.hz, m.linear_end))
    with picture("ramp.png", 1, 3.4, columns=2, share_x=False) as (index, time):
        index.plot(n, straight, "--", color=GREY, label="constant acceleration")
        index.plot(n, m.ramp.hz, color=BLUE, label="ramp list")
        index.set_xlabel("index: steps since the start")
        index.set_ylabel("step frequency [Hz]")
        time.plot(np.cumsum(1 / straight) * 1e3, straight, "--", color=GREY)
        time.plot(t, m.ramp.hz, color=BLUE)
        time.set_xlabel("time since the start [ms]")
        for area, x in ((index, n), (time, t)):
            area.plot(x[bend], m.ramp.hz[bend], "o", color=ORANGE, markersize=5)
            area.set_xlim(0, float(x[-1]) * 1.02)
            area.set_ylim(0, 4400)
        label(index, f"{bend} entries linear,\n{len(n) - bend} by the torque", (bend, m.ramp.hz[bend]), (-22, -40))
        index.legend(**LEGEND, ncols=2)


# -- tables ------------------------------------------------------------------------------------------------------------
def turn_envelope() -> None:
    """A run from start to turn and back to stop: the permissible frequency of every step, with its sections."""
    extremes = (f"stepper.{MOTOR}.extremes.turn=30 mm", f"stepper.{MOTOR}.extremes.stop=7.5 mm")
    tables = zoom(*OPEN, *extremes).envelopes()[MOTOR].tables
    reach = len(tables.up.ramp)
    with picture("envelope-turn.png", 1, 4.0) as (area,):
        area.axhline(0, color="black", linewidth=0.9)
        for table, colour, names in ((tables.up, BLUE, "abc"), (tables.down, ORANGE, "def")):
            low, high = sorted((table.start, table.stop))
            hz = table.direction * table.permissible_hz()[low:high]
            area.stairs(hz, np.arange(low, high + 1), color=colour, linewidth=1.6)
            area.stairs(hz, np.arange(low, high + 1), fill=True, color=colour, alpha=0.13, linewidth=0)
            places = [table.start, table.start + table.direction * reach, table.stop - table.direction * reach]
            for name, begin, end in zip(names, places, [*places[1:], table.stop], strict=True):
                area.text((begin + end) / 2, table.direction * 4600, name, ha="center", va="center", fontsize=11)
            for edge in places[1:]:
                area.plot([edge, edge], [0, table.direction * 4900], color=GREY, linewidth=0.8, linestyle=":")
        marks = (
            (tables.up.start, "start", (6, -6)),
            (tables.up.stop, "turn", (8, 18)),
            (tables.down.stop, "stop", (-12, 18)),
        )
        for place, name, offset in marks:
            area.plot(place, 0, "o", color="black", markersize=7, clip_on=False, zorder=5)
            label(area, f"{name} {place}", (place, 0), offset)
        area.set_ylim(-5200, 5200)
        area.set_xlim(-100, 7100)
        area.set_yticks(range(-4000, 4001, 2000))
        area.set_xlabel("position [step of 5 µm]")
        area.set_ylabel("permissible frequency [Hz]\ndown < 0 < up")


def zones() -> None:
    """The zones of the example: what `detent envelope` draws."""
    zoom().envelopes()[MOTOR].save(FOLDER / "zones.png")


def boundary() -> None:
    """Into a zone and out of it: the envelope, and two methods that know the zone's limit only."""
    from detent.control.step_comparison import BRAKING_DISTANCE, PERMISSIBLE_FREQUENCY

    names = ("controller.rule.position", "controller.timer.period", "plant.rotor.lag")
    cases = (
        ("envelope", BLUE, 0, "-"), ("A: braking distance", GREEN, BRAKING_DISTANCE, "-"),
        ("B: speed per step", ORANGE, PERMISSIBLE_FREQUENCY, "--"),
    )  # fmt: skip
    with picture("boundary.png", 2, 5.0) as (speed, lag):
        for text, colour, method, style in cases:
            motor = standing(8000)
            if method:
                compute(motor, method, 8000)
            _, found = watch(motor, names, 1.6, 10)
            shown = found[(found["controller.rule.position"] > 1700) & (found["controller.rule.position"] <= 2950)]
            place = shown["controller.rule.position"]
            speed.plot(
                place, step_hz(motor, shown["controller.timer.period"]), color=colour, linestyle=style, label=text
            )
            # One value per step, at the end of its period: what the rotor is behind when the next pulse comes.
            last = np.flatnonzero(np.diff(place))
            lag.plot(place[last], shown["plant.rotor.lag"][last], color=colour, linestyle=style)
        speed.set_ylabel("step frequency [Hz]")
        speed.legend(**LEGEND, ncols=3)
        lag.set_ylim(-9, 9)
        lag.set_yticks(range(-8, 9, 4))
        lag.set_ylabel("rotor behind its field\n[steps]")
        lag.set_xlabel("position of the field [step]")
        label(lag, "overshoots by a tooth pitch", (2000, -5.4), (12, 0))
        for area in (speed, lag):
            area.axvspan(2000, 2600, color=GREY, alpha=0.14, linewidth=0)
            area.set_xlim(1700, 2950)


def stop_moved() -> None:
    """A run whose stop is moved on the way: outwards, inwards, and nearer than it can stop."""
    from detent.methods.stepper_envelope.stage_job import StageJob, StageMove, StopChange

    cases = ((15.5e-3, ORANGE, 3.5), (16.135e-3, GREEN, 1.4), (20e-3, BLUE, 1.4))
    signals = tuple(
        f"{MOTOR}.{name}"
        for name in ("controller.rule.position", "controller.rule.direction", "controller.timer.period")
    )
    axis = zoom(*OPEN)
    with picture("stop-moved.png", 1, 3.8) as (area,):
        area.axhline(0, color=GREY, linewidth=0.8)
        for to, colour, width in cases:
            change = StopChange(15e-3, to)
            move = StageMove(1, 1, {MOTOR: 40e-3}, change=change)
            done = axis.run(StageJob("moved", "moves", (move,), (MOTOR,)), signals=signals, every=25)
            trace = done.trace
            period = trace[f"{MOTOR}.controller.timer.period"]
            hz = np.where(period > 0, 1e6 / np.maximum(period, 1), 0) * trace[f"{MOTOR}.controller.rule.direction"]
            place = trace[f"{MOTOR}.controller.rule.position"] * 5e-3
            area.plot(place, hz, color=colour, linewidth=width, label=f"stop moved to {to * 1e3:g} mm")
        area.axvline(15, color=GREY, linestyle="--", linewidth=1)
        label(area, "stop moved here", (15, 2000), (-92, 0))
        label(area, "overrun: stops as soon as it can,\nand comes back", (16.2, -900), (6, 0))
        area.set_xlim(13, 21)
        area.set_xlabel("position [mm]")
        area.set_ylabel("step frequency [Hz]\ndown < 0 < up")
        area.legend(**LEGEND, ncols=3)


def by_hand() -> None:
    """A joystick held over into the end of the travel, and half over on the way back."""
    from detent.methods.stepper_envelope.stage_job import StageJob, StageJog

    jogs = (StageJog(1, 1, MOTOR, 20e-3, 3.6, dwell=0.2), StageJog(2, 2, MOTOR, -10e-3, 1.5, dwell=0.2))
    signals = tuple(
        f"{MOTOR}.{name}"
        for name in ("controller.rule.position", "controller.rule.direction", "controller.timer.period")
    )
    done = zoom().run(StageJob("by hand", "moves", jogs, (MOTOR,)), signals=signals, every=250)
    trace, t = done.trace, done.trace.time
    period = trace[f"{MOTOR}.controller.timer.period"]
    hz = np.where(period > 0, 1e6 / np.maximum(period, 1), 0) * trace[f"{MOTOR}.controller.rule.direction"]
    asked = np.zeros_like(t)
    for move, jog in zip(done.result.moves, jogs, strict=True):
        asked[(t >= move.begin) & (t < move.begin + jog.duration)] = jog.speed / 5e-6
    with picture("by-hand.png", 2, 5.0) as (speed, place):
        speed.plot(t, asked, color=GREY, linestyle="--", linewidth=1.2, label="joystick")
        speed.plot(t, hz, color=BLUE, label="motor")
        speed.set_ylabel("step frequency [Hz]")
        speed.legend(**LEGEND, ncols=2)
        place.plot(t, trace[f"{MOTOR}.controller.rule.position"] * 5e-3, color=BLUE)
        for low, high in ((10, 13), (25, 30)):
            place.axhspan(low, high, color=GREY, alpha=0.16, linewidth=0)
        place.axhline(40, color="black", linewidth=0.9)
        place.set_ylabel("position [mm]")
        place.set_ylim(0, 43)
        place.set_xlabel("time since power-on [s]")
        label(place, "end of the travel", (0.1, 40), (0, -3))
        place.margins(x=0)


# -- judged by the rotor -----------------------------------------------------------------------------------------------
def still_follows(inertia: float, friction: float) -> bool:
    """Whether the rotor loses nothing over 1000 steps with so many times its inertia, and a friction [N m]."""
    motor = standing(1000, *OPEN)
    rotor = motor.p.plant.rotor
    rotor.inertia *= inertia
    rotor.damping *= math.sqrt(inertia)
    rotor.friction = friction
    return lost(motor) == 0


def margin() -> None:
    """How much more inertia and friction the ramp of the example bears."""
    from detent.methods.stepper_envelope.checks import MOST_FRICTION, MOST_USED, START_RESERVE

    m = figures_of(*OPEN)
    factors = np.array([0.5, 1, 1.5, 2, 3, 4, 5, 6, 7, 8, 9, 10, 10.5, 11])
    most: list[float] = []
    for factor in factors.tolist():
        low, high = 0.0, 20e-3
        while high - low > 0.1e-3:
            middle = (low + high) / 2
            low, high = (middle, high) if still_follows(factor, middle) else (low, middle)
        most.append(low * 1e3)
    fine = np.linspace(0.5, 11.5, 300)
    torque = m.torque_there(m.ramp.hz[1:])
    step = m.acceleration_torque(1.0) * np.diff(m.ramp.hz**2) / 2
    bound = np.array([(torque - f * step).min() for f in fine]) * 1e3
    # What the property tests promise; beyond 1 the start frequency is too high for the natural one.
    safe = np.linspace(0.5, START_RESERVE**2 / (m.start_hz / m.natural_hz) ** 2, 60)
    promised = np.array([(MOST_USED * torque - 2 * f * step).min() for f in safe])
    promised = np.minimum(promised, MOST_FRICTION * m.motor.holding_torque) * 1e3
    with picture("step-margin.png", 1, 4.0) as (area,):
        area.plot(fine, bound, "--", color=GREY, label="torque of the rotor − inertia × acceleration")
        area.plot(factors, most, "o-", color=BLUE, markersize=4, label="no step lost below")
        area.fill_between(safe, 0, promised, color=GREEN, alpha=0.35, linewidth=0, label="reserve of the random tests")
        area.plot(1, m.motor.friction_torque * 1e3, "*", color=ORANGE, markersize=13, label="the example")
        area.set_xlim(0.5, 11.5)
        area.set_ylim(0, 18)
        area.set_xlabel("inertia, as a multiple of that of rotor and load")
        area.set_ylabel("friction torque [mN·m]")
        area.legend(loc="upper right", fontsize=9)


def smooth_ramp(found: Any, step: float) -> Any:
    """The rising part of a jerk-limited profile as a ramp list: the frequency of each of its steps."""
    from detent.planning.step_ramp import StepRamp

    v, a, j = found.speed, found.acceleration, found.jerk
    rise, straight = a / j, v / a
    t = np.linspace(0, rise + straight, 200_001)
    speed = np.where(t < straight, a * (t - rise / 2), v - j * (rise + straight - t) ** 2 / 2)
    speed[t < rise] = j * t[t < rise] ** 2 / 2
    x = np.cumsum(speed) * t[1] / step
    moments = np.interp(np.arange(int(x[-1]) + 1), x, t)
    return StepRamp(np.append(1 / np.diff(moments), v / step))


def jerk() -> None:
    """Start by the envelope and by a jerk-limited profile, each as a ramp list, on the rotor."""
    from detent.methods.stepper_envelope.comparison import compare_jerk
    from detent.methods.stepper_envelope.controller import load_rule
    from detent.methods.stepper_envelope.system import tables
    from detent.planning.step_envelope import StepEnvelope

    way = 1000
    spec = zoom(*OPEN).spec
    listed = smooth_ramp(compare_jerk(spec, MOTOR), spec.stepper[MOTOR].step)
    names = ("controller.timer.period", "plant.rotor.angle", "plant.rotor.commanded")
    with picture("jerk.png", 1, 3.8, columns=2, share_x=False) as (speed, start):
        for text, colour, ramp_list in (("envelope", BLUE, None), ("jerk-limited", ORANGE, listed)):
            motor = standing(way, *OPEN)
            if ramp_list is not None:
                table = motor.tables.up.zones
                load_rule(motor.p.controller, ramp_list, table.limits, motor.p.controller.timer.clock_hz, reload=True)
                motor.tables.ramp, motor.tables.up = ramp_list, StepEnvelope(ramp_list, table, 1, 0, way)
                motor.feed = tables(motor.tables.up.entries, motor.tables.down.entries)
            t, found = watch(motor, names, 0.13, 5)
            speed.plot(t * 1e3, step_hz(motor, found["controller.timer.period"]), color=colour, label=text)
            first = t < 25e-3
            start.plot(t[first] * 1e3, found["plant.rotor.commanded"][first], color=colour, linewidth=1, alpha=0.6)
            rotor = found["plant.rotor.angle"][first] / motor.p.plant.rotor.step_angle
            start.plot(t[first] * 1e3, rotor, color=colour, linewidth=1.8)
        speed.set_ylabel("step frequency [Hz]")
        speed.set_xlim(0, 130)
        speed.legend(**LEGEND, ncols=2)
        start.set_ylabel("position [steps]")
        start.set_xlim(0, 25)
        for area in (speed, start):
            area.set_ylim(bottom=0)
            area.set_xlabel("time since the start [ms]")


def methods_table() -> None:
    """The comparison with the other methods as a table, for the page."""
    from detent.cli.docs import table
    from detent.methods.stepper_envelope.comparison import compare_steps

    spec = zoom().spec
    only = spec.model_copy(update={"stepper": {MOTOR: spec.stepper[MOTOR]}})
    _, heads, rows = compare_steps(only)[0].table
    text = table(tuple(heads), [tuple(row) for row in rows])
    (FOLDER / "step-methods-table.md").write_text(text, encoding="utf-8")


FIGURES = (
    lost_steps, torque, ramp, turn_envelope, zones, boundary, stop_moved, by_hand, margin, jerk, methods_table,
)  # fmt: skip
