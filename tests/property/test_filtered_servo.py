"""Whatever is commanded and whatever noise comes: the filtered servo loses no pulse and keeps its limits."""

import math

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from tests.difference import values_of
from tests.filtered_servo_rig import PLANT_B, START, Rig, plant_a

from detent.control.deviation_counter import FAULT, RUN, Deviation, count_deviation
from detent.methods.filtered_servo.controller import CLOCKS
from detent.sensing.counted_speed import (
    FIXED,
    FLOAT,
    NONE,
    PulseCounter,
    PulseCounterParams,
    SpeedFilter,
    SpeedFilterParams,
    add_pulses,
    close_window,
    filter_speed,
)

RECORDED = (
    "controller.generator.command", "controller.deviation.position", "controller.deviation.deviation",
    "controller.deviation.error", "controller.deviation.state", "lines.word", "plant.amplifier.word",
    "controller.speed.word", "controller.speed.count", "controller.filter.output", "controller.clock.left",
    "plant.interference.lost", "plant.encoder.edge", "controller.busy", "plant.train.current",
)  # fmt: skip

# ------------------------------------------------------------------------------------------------------ blocks alone

pulses = st.lists(st.tuples(st.integers(-1, 1), st.integers(-1, 1), st.booleans()), max_size=200)
"""Clocks: command pulse, movement pulse, strobe."""


@given(clocks=pulses, half=st.sampled_from([128, 512, 2048]))
def test_the_counters_conserve_pulses(clocks, half):
    deviation, p, speed, words = Deviation(), PulseCounterParams(half=half), PulseCounter(), 0
    for commanded, moved, strobe in clocks:
        if strobe:
            close_window(speed)
            words += speed.word
        count_deviation(deviation, commanded, moved)
        add_pulses(p, speed, moved)
        assert -half <= speed.count < half
    commands, movements = (sum(clock[k] for clock in clocks) for k in (0, 1))
    assert deviation.deviation == commands - movements
    assert deviation.position == movements
    assert (words + speed.count - movements) % (2 * half) == 0
    assert words + speed.count == movements or abs(movements) > half - 1


@given(
    counts=st.lists(st.integers(-128, 127), min_size=1, max_size=60),
    kind=st.sampled_from([NONE, FLOAT, FIXED]),
    scale=st.integers(1, 64),
    shift=st.integers(0, 6),
    fraction_bits=st.integers(0, 12),
)
def test_the_filter_stays_between_what_it_has_been_given(counts, kind, scale, shift, fraction_bits):
    p = SpeedFilterParams(kind=kind, scale=scale, coefficient=2.0**-shift, shift=shift, fraction_bits=fraction_bits)
    r = SpeedFilter()
    for k, count in enumerate(counts):
        filter_speed(p, r, count)
        given_so_far = [0, *counts[: k + 1]]
        low, high = scale * min(given_so_far), scale * max(given_so_far)
        assert low - 1e-9 * abs(low) <= r.output <= high + 1e-9 * abs(high)


# ------------------------------------------------------------------------------------------------------ the whole axis

lengths = st.integers(1, 2500)
"""Ticks."""
actions = st.one_of(
    st.tuples(st.just("rate"), st.floats(-6000, 6000) | st.floats(-60_000, 60_000), lengths),
    st.tuples(st.just("goal"), st.integers(-400, 400), lengths),
    st.tuples(st.just("period"), st.integers(500, 10_000), lengths),
    st.tuples(st.just("wait"), st.just(0), lengths),
)
servos = st.tuples(
    st.sampled_from([plant_a(), plant_a(1500), PLANT_B]),
    st.sampled_from(
        [
            ("method.filter=float", "method.coefficient=0.3"),
            ("method.filter=fixed", "method.fraction_bits=3"),
            ("method.filter=none", "method.scale=2"),
        ]
    ),
    st.sampled_from([(), ("drive.whole_words=true",), ("drive.word_bits=6", "drive.pwm_frequency=100 kHz")]),
    st.sampled_from([(), ("method.command_acceleration=2 m/s^2",)]),
)
line_noise = st.tuples(st.integers(0, 400), st.integers(0, 400), st.integers(0, 100), st.integers(0, 400))
"""Pulses put in and removed, samples lost, samples corrupted [Hz]."""
discs = st.tuples(st.sampled_from([0.0, 12.0]), st.sampled_from([0.0, 0.01]), st.integers(0, 2**63 - 1))
"""Jitter [deg], share of missing marks, seed."""


def noisy(lines, disc):
    """Overrides for noise on the lines and faults of the disc."""
    names = ("inserted", "removed", "lost_samples", "corrupted")
    return (
        *(f"disturbance.lines.{name}={rate} Hz" for name, rate in zip(names, lines, strict=True) if rate),
        f"encoder.jitter={disc[0]} deg", f"encoder.missing_edges={disc[1]}", f"encoder.seed={disc[2]}",
    )  # fmt: skip


def make_rig(servo, *overrides):
    """A rig after reset."""
    plant, *others = servo
    return Rig(*(text for part in others for text in part), *overrides, plant=plant)


def play(rig, script):
    """Do what the script says and record every tick of it."""
    columns = [rig.record(1e-5, RECORDED)]
    for what, value, ticks in script:
        if what == "rate":
            rig.command_rate(value)
        elif what == "goal":
            rig.c.generator.goal = rig.c.generator.command + value
        elif what == "period":
            rig.c.clock.demanded = value
        columns.append(rig.record(ticks * 1e-5, RECORDED))
    run = {name: np.concatenate([column[name] for column in columns]) for name in RECORDED}
    # After a fault nothing is promised but that the drive is off.
    running = run["controller.deviation.state"] == RUN
    alive = int(np.argmin(running)) if not running.all() else len(running)
    return run, alive


whole_axis = settings(max_examples=60, suppress_health_check=[HealthCheck.too_slow])


@pytest.mark.compiled
@whole_axis
@given(servo=servos, lines=line_noise, disc=discs, script=st.lists(actions, min_size=1, max_size=8))
def test_pulses_are_conserved(servo, lines, disc, script):
    run, alive = play(make_rig(servo, *noisy(lines, disc)), script)
    command, position = run["controller.generator.command"], run["controller.deviation.position"]
    # Noise puts pulses in and takes them away on the line; what is counted is counted in both counters.
    assert np.array_equal((command - position)[:alive], run["controller.deviation.deviation"][:alive])
    left, lost = run["controller.clock.left"][:alive], run["plant.interference.lost"][:alive]
    strobes = np.flatnonzero(np.diff(left) != -CLOCKS) + 1
    read = strobes[np.diff(lost)[strobes - 1] == 0]
    words = np.zeros(alive, int)
    words[read] = run["controller.speed.word"][read]
    assert np.array_equal(np.cumsum(words) + run["controller.speed.count"][:alive], position[:alive])


@pytest.mark.compiled
@whole_axis
@given(
    servo=servos,
    jitter=st.sampled_from([0.0, 5.0, 12.0]),
    seed=st.integers(0, 2**63 - 1),
    script=st.lists(actions, min_size=1, max_size=8),
)
def test_without_noise_every_edge_of_the_disc_is_counted_once(servo, jitter, seed, script):
    rig = make_rig(servo, *noisy((0, 0, 0, 0), (jitter, 0.0, seed)))
    before = rig.plant.encoder.edge
    run, alive = play(rig, script)
    assert before == math.floor((START - rig.p.plant.encoder.origin) / rig.p.plant.encoder.edge_pitch)
    settled = run["controller.busy"][:alive] == 0
    assert settled.any()
    assert np.array_equal(
        run["controller.deviation.position"][:alive][settled], (run["plant.encoder.edge"][:alive] - before)[settled]
    )
    # Before it has settled the decoder owes an edge, or at high speed one in each of its two stages.
    assert np.abs(run["controller.deviation.position"] - run["plant.encoder.edge"] + before)[:alive].max() <= 2


@pytest.mark.compiled
@whole_axis
@given(
    servo=servos,
    effort=st.sampled_from([1e5, 150.0, 20.0]),
    lines=line_noise,
    disc=discs,
    script=st.lists(actions, min_size=1, max_size=8),
)
def test_the_drive_keeps_its_limits_and_no_number_is_lost(servo, effort, lines, disc, script):
    rig = make_rig(servo, *noisy(lines, disc), f"limits.effort={effort} N")
    run, alive = play(rig, script)
    most = min((1 << (rig.spec.drive.word_bits - 1)) - 1, effort / rig.spec.force_per_count)
    if rig.spec.drive.whole_words:
        most = math.floor(most)
    assert rig.p.controller.deviation.word_limit == pytest.approx(most)
    for name in ("lines.word", "plant.amplifier.word"):
        assert np.abs(run[name]).max() <= most
        assert not run[name][alive:].any()
    assert not run["plant.train.current"][alive:].any()
    word, error = run["lines.word"][:alive], run["controller.deviation.error"][:alive]
    if rig.spec.drive.whole_words:
        assert np.array_equal(word, np.round(word))
        assert np.abs(word - np.clip(error, -most, most)).max() <= 0.5
    else:
        assert np.array_equal(word, np.clip(error, -most, most))
    assert set(run["controller.deviation.state"][alive:]) <= {FAULT}
    numbers = [value for value in values_of(rig.r).values() if isinstance(value, float)]
    assert len(numbers) > 20
    assert all(math.isfinite(value) for value in numbers)
