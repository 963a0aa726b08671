"""The figures of the two servos: each is drawn from a run of the simulation, or from its exact model.

`feedback_table` writes a table in place of a picture.
"""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
from figures import BLUE, FOLDER, GREEN, GREY, ORANGE, label, picture

PINK = "#CC79A7"
LEGEND = {"loc": "lower left", "bbox_to_anchor": (0, 1), "fontsize": 9}
TRACKING = ("reference", "ps_first", "ps_second", "msb_first", "msb_second", "gate", "plus")
PULSE_SIGNALS = (
    "lines.carrier", "lines.ps", *(f"controller.converters.tracking.{name}" for name in TRACKING),
    "controller.sequencer.distance", "controller.speed.count",
)  # fmt: skip
MOVE_SIGNALS = (
    "plant.train.position", "plant.train.velocity",
    *(f"controller.sequencer.{name}" for name in ("distance", "mode", "ready", "stop")),
    "controller.law.setpoint", "controller.speed.word",
)  # fmt: skip
STRAIGHT = tuple(
    f"mechanics.friction.{side}.{kind}=0 N" for side in ("right", "left") for kind in ("coulomb", "static")
)
IDEAL = (*STRAIGHT, "method.command_acceleration=0 m/s^2")
"""The example slide as the specification's plant A: no friction, a command that jumps to its rate."""
RATE = 1000.0  # command pulses per second of the worked example


def phase_axis(*overrides: str) -> Any:
    """The example axis of the phase servo."""
    import detent

    return detent.load(detent.example("phase_servo.toml"), overrides)


def slide(*overrides: str) -> Any:
    """The example axis of the filtered servo."""
    import detent

    return detent.load(detent.example("filtered_servo.toml"), overrides)


def zero_line(area: Any) -> None:
    """A thin line where nothing is off."""
    area.axhline(0, color=GREY, linewidth=0.8)


# -- phase servo -------------------------------------------------------------------------------------------------------
def plus_pulse() -> None:
    """The third + pulse of a move, clock by clock."""
    from detent.page.timing import plot_timing

    axis = phase_axis()
    plus = axis.timing(4e-3, 2e-3, signals=["controller.converters.tracking.plus"]).waveforms.signals[-1]
    third = int(plus.times[np.flatnonzero(plus.values)[2]])
    tick = round(axis.simulated.tick * 1e12)
    shown = axis.timing((third // tick - 4) * tick * 1e-12, 9 * tick * 1e-12, signals=PULSE_SIGNALS).waveforms
    plot_timing(shown, FOLDER / "plus-pulse.png", marks=((third, "+ pulse"),))


def absolute_word() -> None:
    """Absolute word, and the error made of it, against the displacement from a positioning point."""
    from detent.methods.phase_servo.build import build_phase_servo
    from detent.sensing.phase_converters import Converters, absolute_error, reset_carrier, run_converters

    spec = phase_axis().spec
    n, p = spec.detector.counts, build_phase_servo(spec)
    converters, detector = p.controller.converters, p.plant.detector
    steps = np.arange(-n - 8, n + 8, 0.25) + 0.125
    words, errors = [], []
    for d in steps:
        r = Converters()
        reset_carrier(r.carrier)
        phase = detector.offset + round(float(d) * detector.turns_per_metre * spec.step)
        run_converters(converters, r, phase, 0, 3 * n)
        words.append(r.absolute.word)
        errors.append(absolute_error(converters.absolute, r.absolute))
    with picture("absolute-word.png", 2, 5.2) as (word, error):
        word.plot(steps, words, color=BLUE, drawstyle="steps-mid")
        word.set_ylabel("absolute word R604")
        word.set_yticks([0, n // 2, n])
        error.plot(steps, errors, color=ORANGE, drawstyle="steps-mid")
        error.set_ylabel("error word e [steps]")
        error.set_xlabel("position − target [steps]")
        error.set_yticks([-n // 4, 0, n // 4])
        zero_line(error)
        for area in (word, error):
            area.axvspan(-n / 2, n / 2, color=GREEN, alpha=0.10, linewidth=0)
            area.axvspan(-n / 4, n / 4, color=GREEN, alpha=0.14, linewidth=0)
            area.axvline(0, color=GREY, linewidth=0.8)
            area.set_xticks(range(-n, n + 1, n // 4))
            area.margins(x=0)
        above = word.get_xaxis_transform()
        for part, text in ((0, "right to the step"), (3 / 8, "right sign"), (0.8, "the next pitch")):
            for x in sorted({part * n, -part * n}):
                word.text(x, 1.02, text, ha="center", fontsize=9, transform=above)


def phase_move() -> None:
    """A move of six pitches: speed, distance, the last steps, and the lines to the host."""
    axis = phase_axis()
    spec = axis.spec
    done = axis.run(axis.simulated.sample_job(), signals=MOVE_SIGNALS, every=32)
    move = done.result.moves[0]
    part = done.trace.between(move.begin + 2 * spec.tick, move.begin + 45e-3)
    t = (part.time - move.begin) * 1e3
    switched = (move.switched - move.begin) * 1e3
    in_speed = (t > 0.05) & (t < switched)
    with picture("phase-move.png", 4, 8.4) as (speed, way, end, lines):
        one = spec.step / spec.sample_period
        speed.plot(t, part["plant.train.velocity"] / one, color=GREY, linewidth=1, label="true speed")
        speed.step(t, part["controller.speed.word"], where="post", color=BLUE, label="speed word")
        speed.step(
            t[in_speed], part["controller.law.setpoint"][in_speed], where="post", color=ORANGE, label="velocity table"
        )
        speed.set_ylabel(f"pulses per {spec.sample_period * 1e6:.0f} µs")
        speed.legend(**LEGEND, ncols=3)
        way.plot(t[in_speed], part["controller.sequencer.distance"][in_speed], color=BLUE)
        way.set_ylabel("distance counter\n[steps]")
        threshold = spec.method.threshold
        way.axhline(threshold, color=ORANGE, linewidth=1, linestyle="--")
        label(way, f"threshold {threshold}: position mode", (switched, threshold), (8, 22))
        displacement = (part["plant.train.position"] - move.target) / spec.step
        end.plot(t, displacement, color=BLUE)
        end.set_ylabel("position − target\n[steps]")
        end.set_ylim(-12, 4)
        zero_line(end)
        for place, name in enumerate(("stop", "ready", "mode")):
            level = part[f"controller.sequencer.{name}"].astype(float)
            lines.step(t, 1.5 * place + level, where="post", color=BLUE)
            lines.fill_between(t, 1.5 * place, 1.5 * place + level, step="post", color=BLUE, alpha=0.12, linewidth=0)
        lines.set_yticks([0.5, 2.0, 3.5], ["stop", "ready", "mode"])
        lines.grid(visible=False, axis="y")
        lines.set_xlabel("time since the set strobe [ms]")
        lines.set_xlim(0, 45)
        for area in (speed, way, end, lines):
            area.axvline(switched, color=ORANGE, linewidth=1, linestyle="--")


def noise() -> None:
    """Spurious pulses: what `detent compare --figure` draws."""
    from detent.methods.phase_servo.comparison import compare_noise
    from detent.page.draw import draw_figures

    draw_figures(compare_noise(phase_axis().spec).figures(), FOLDER / "noise.png")


def hold() -> None:
    """Standing at the target: the other figure of `detent compare`."""
    from detent.methods.phase_servo.comparison import compare_hold
    from detent.page.draw import draw_figures

    draw_figures(compare_hold(phase_axis().spec).figures(), FOLDER / "hold.png")


def clock_order() -> None:
    """A push of 3 N: robust clocks, the literal set, and literal clocks with the robust gains."""
    from detent.methods.moves.job import MoveJob

    cases = (
        ("robust (default)", BLUE, ()),
        ("literal, with gains of its own", GREEN, ("clock.order=literal",)),
        ("integration clock too fast for the robust gains", ORANGE, ("clock.integrate_tap=11",)),
    )
    push = ("disturbance.push.force=3 N", "disturbance.push.at=35 ms", "disturbance.push.duration=10 s")
    with picture("clock-order.png", 1, 3.4) as (area,):
        for text, colour, overrides in cases:
            axis = phase_axis(*push, *overrides)
            sample = axis.simulated.sample_job().moves[0]
            job = MoveJob("pushed", "moves", (replace(sample, dwell=0.25),))
            done = axis.run(job, signals=("plant.train.position",), every=64)
            displacement = (done.trace["plant.train.position"] - done.result.moves[0].target) / axis.spec.step
            area.plot(done.trace.time * 1e3, displacement, color=colour, linewidth=1.2, label=text)
        area.axvline(35, color=GREY, linestyle="--", linewidth=1)
        label(area, "push", (35, -3.0), (4, 0))
        area.axhspan(-1, 1, color=GREEN, alpha=0.12, linewidth=0)
        area.set_xlim(25, 225)
        area.set_ylim(-3.5, 3.5)
        area.set_ylabel("position − target [steps]")
        area.set_xlabel("time since power-on [ms]")
        area.legend(**LEGEND, ncols=3)


# -- filtered servo ----------------------------------------------------------------------------------------------------
@cache
def feedback() -> Any:
    """The four ways to feed the speed back, compared on the example slide."""
    from detent.methods.filtered_servo.comparison import compare_feedback

    return compare_feedback(slide().spec)


def lumpy_speed() -> None:
    """Counted pulses of each window, and the drive word that they make with and without the filter."""
    found = feedback()
    conventional, filtered = found.cases[:2]
    with picture("lumpy-speed.png", 3, 5.8) as (count, plain, smooth):
        t = (conventional.t - conventional.t[0]) * 1e3
        keep = t < 100
        n = conventional.speed_word / conventional.scale
        count.step(t[keep], n[keep], where="post", color=GREY)
        mean = found.rate * conventional.sample_period
        count.axhline(mean, color=GREEN, linewidth=1, linestyle="--", label=f"true mean {mean:.3f}")
        count.set_ylabel("counted pulses n")
        count.set_yticks(np.unique(n[keep]))
        count.legend(**LEGEND)
        for area, case, colour in ((plain, conventional, ORANGE), (smooth, filtered, BLUE)):
            shown = (case.t - case.t[0]) * 1e3
            kept = shown < 100
            area.step(shown[kept], case.error[kept], where="post", color=colour, linewidth=1)
            area.set_ylabel("drive word [count]")
            area.set_title(f"{case.name}: standard deviation {case.std_error:.2f}", fontsize=9, color=colour)
            area.set_ylim(-6, 6)
            zero_line(area)
        smooth.set_xlabel("time [ms]")
        smooth.set_xlim(0, 100)


def filter_answer() -> None:
    """One window that counts a pulse too many, and the filter's gain over frequency."""
    from detent.analysis.first_order_filter import cutoff_hz
    from detent.methods.filtered_servo.build import build_filtered_servo
    from detent.sensing.counted_speed import SpeedFilter, filter_speed

    spec = slide().spec
    p, r, method = build_filtered_servo(spec).controller.filter, SpeedFilter(), spec.method
    mean = round(RATE * method.sample_period)
    r.output = float(method.scale * mean)
    counts = [mean, mean, mean + 1] + [mean] * 11
    words = []
    for n in counts:
        filter_speed(p, r, n)
        words.append(r.output)
    with picture("filter-answer.png", 1, 3.4, columns=2, share_x=False) as (pulse, gain):
        k = np.arange(len(counts)) - 2
        pulse.step(k, [method.scale * n for n in counts], where="post", color=ORANGE, label="B × n")
        pulse.step(k, words, where="post", color=BLUE, label="filtered")
        pulse.set_xlabel("sample")
        pulse.set_ylabel("speed word [count]")
        pulse.legend(**LEGEND, ncols=2)
        a, ts = method.coefficient, method.sample_period
        f = np.linspace(0, 0.5 / ts, 400)
        h = a / np.abs(1 - (1 - a) * np.exp(-2j * np.pi * f * ts))
        gain.plot(f, h, color=BLUE, label="this filter")
        analogue = 1 / np.sqrt(1 + (2 * np.pi * f * ts / a) ** 2)
        gain.plot(f, analogue, color=GREY, linestyle="--", label=f"analogue lag of {ts / a * 1e3:.0f} ms")
        corner = cutoff_hz(a, ts)
        gain.plot(corner, np.sqrt(0.5), "o", color=BLUE)
        label(gain, f"−3 dB at {corner:.2f} Hz", (corner, np.sqrt(0.5)), (9, 8))
        gain.set_ylim(0, 1.05)
        gain.set_xlabel("frequency [Hz]")
        gain.set_ylabel("gain")
        gain.legend(**LEGEND, ncols=2)
        gain.margins(x=0)


def model_of(spec: Any) -> Any:
    """The exact sampled-loop model of an axis."""
    from detent.methods.filtered_servo.derive import FilteredFigures

    return FilteredFigures(spec).loop


def run_and_stop(seconds: float, rest: float, overrides: tuple[str, ...]) -> tuple[Any, Any]:
    """The ideal slide at 1000 pulses/s for so long, then at rest: time since the stop [s], following error [pulse]."""
    from detent.methods.moves.job import Move, MoveJob

    axis = slide(*IDEAL, *overrides)
    speed = RATE * axis.spec.pulse
    job = MoveJob("worked example", "moves", (Move(number=1, row=0, by=speed * seconds, speed=speed, dwell=rest),))
    done = axis.run(job, signals=("controller.deviation.deviation",), every=10)
    begin = done.result.moves[0].begin
    return done.trace.time - begin - seconds, done.trace["controller.deviation.deviation"]


def sample_clock() -> None:
    """One knob: the filter's answer and the following error for three sample periods."""
    from detent.analysis.first_order_filter import filter_step

    spec = slide().spec
    scale, a = spec.method.scale, spec.method.coefficient
    current = spec.drive.current_per_count * 1500 / spec.gain  # K = 1500: stable with each of the three
    with picture("sample-clock.png", 2, 5.4) as (word, error):
        for ms, colour in ((2.5, GREEN), (5, BLUE), (10, ORANGE)):
            level = scale * RATE * ms * 1e-3
            samples = round(400 / ms)
            rising = np.concatenate([[0.0], level * filter_step(a, samples)])
            word.step(np.arange(samples + 1) * ms, rising, where="post", color=colour, label=f"TS = {ms:g} ms")
            label(word, f"KV = {RATE / level:.0f} 1/s", (398, level), (-64, -3))
            overrides = (
                f"method.sample_period={ms} ms", f"drive.current_per_count={current!r} A", "limits.speed=50 mm/s",
            )  # fmt: skip
            t, p = run_and_stop(1.0, 0.1, overrides)
            error.plot((t + 1.0) * 1e3, p, color=colour, linewidth=1)
            error.axhline(level, color=colour, linestyle=":", linewidth=1)
        word.set_ylabel("filtered speed word\n[count]")
        word.legend(**LEGEND, ncols=3)
        error.set_ylabel("following error\n[pulses]")
        error.set_xlabel("time since the speed rose to 1000 pulses/s [ms]")
        error.set_xlim(0, 400)
        error.set_ylim(-3, 48)


def loop_model() -> None:
    """Stop of the simulated axis and of its exact model; how the model loses its stability."""
    with picture("loop-model.png", 1, 3.6) as (area,):
        for name, colour, overrides in (
            ("conventional", ORANGE, ("method.filter=none",)),
            ("with filter", BLUE, ()),
        ):
            t, p = run_and_stop(2.0, 0.4, overrides)
            keep = (t > -0.02) & (t < 0.25)
            area.step(t[keep] * 1e3, p[keep], where="post", color=colour, linewidth=1, label=f"{name}: simulation")
            spec = slide(*IDEAL, *overrides).spec
            windows = round(2.0 / spec.method.sample_period)
            answer = model_of(spec).respond([RATE] * windows + [0.0] * 60, points=10)
            kept = (answer.t > 1.98) & (answer.t < 2.25)
            model_t, model_p = (answer.t[kept] - 2.0) * 1e3, answer.following_error[kept]
            area.plot(model_t, model_p, color=colour, linewidth=3.5, alpha=0.35, label=f"{name}: model")
        zero_line(area)
        area.set_ylabel("following error [pulses]")
        area.set_xlabel("time since the command stopped [ms]")
        area.legend(**LEGEND, ncols=2)
        area.margins(x=0)


def stability() -> None:
    """Largest mode against the gain, for each kind of speed feedback."""
    from detent.methods.filtered_servo.comparison import feedback_variants

    spec = slide(*IDEAL).spec
    gains = np.geomspace(500, 60_000, 300)
    with picture("stability.png", 1, 3.6) as (area,):
        for (name, variant), colour in zip(feedback_variants(spec).items(), (ORANGE, BLUE, PINK, GREEN), strict=True):
            loop = model_of(variant)
            radius = [replace(loop, gain=float(gain)).spectral_radius() for gain in gains]
            # Per 5 ms, so that windows of different length can be compared.
            mode = np.array(radius) ** (spec.method.sample_period / loop.sample_period)
            shown = np.logical_and.accumulate(mode < 1.12)
            area.semilogx(gains[shown], mode[shown], color=colour, label=name)
            limit = loop.stability_limit()
            area.plot(limit, 1, "o", color=colour)
            label(area, f"{limit:.0f}", (limit, 1), (-10, 17))
        area.axhline(1, color=GREY, linewidth=1)
        area.axvline(spec.gain, color=GREY, linestyle="--", linewidth=1)
        label(area, "this slide", (spec.gain, 0.6), (8, 0))
        area.set_ylim(0.5, 1.15)
        area.set_xticks([500, 1000, 2000, 5000, 10_000, 20_000, 50_000])
        area.xaxis.set_major_formatter("{x:.0f}")
        area.set_ylabel("largest mode, per 5 ms")
        area.set_xlabel("gain K [1/s²]")
        area.legend(**LEGEND, ncols=4)
        area.margins(x=0)


def damping() -> None:
    """Stops with the worked numbers and with better damped ones."""
    with picture("damping.png", 1, 3.6) as (area,):
        for text, colour, overrides in (
            ("worked numbers: 5 ms, B 4, A 1/4", BLUE, ()),
            ("5 ms, B 4, A 1/2", GREEN, ("method.coefficient=0.5",)),
            ("1 ms, B 20, A 1/4", ORANGE, ("method.sample_period=1 ms", "method.scale=20")),
        ):
            t, p = run_and_stop(2.0, 0.4, overrides)
            keep = (t > -0.02) & (t < 0.3)
            area.step(t[keep] * 1e3, p[keep], where="post", color=colour, linewidth=1.2, label=text)
        zero_line(area)
        area.set_ylim(-5, 23)
        area.set_ylabel("following error [pulses]")
        area.set_xlabel("time since the command stopped [ms]")
        area.legend(**LEGEND, ncols=3)
        area.margins(x=0)


def feedback_table() -> None:
    """The comparison as a table, for the page."""
    from detent.cli.docs import table

    _, heads, rows = feedback().table
    text = table(("", *heads[1:]), [tuple(row) for row in rows])
    (FOLDER / "feedback-table.md").write_text(text, encoding="utf-8")


FIGURES = (
    plus_pulse, absolute_word, phase_move, noise, hold, clock_order, lumpy_speed, filter_answer, sample_clock,
    loop_model, stability, damping, feedback_table,
)  # fmt: skip
