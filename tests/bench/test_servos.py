"""How many times faster than real time both servos run on one core, and what part of a servo takes how much of it."""

import pytest
from tests.bench.race import Race, timed
from tests.filtered_servo_rig import EXAMPLE as SLIDE
from tests.filtered_servo_rig import NO_TRACE
from tests.phase_servo_rig import START, Rig

from detent.control.clocks import SawtoothPwm, count_sawtooth
from detent.control.pulse_generator import PER_PULSE
from detent.drive.split_bridge import SplitBridge, drive_two, sense_current
from detent.kernel.compiled import copy_back, local_copy
from detent.kernel.loop import advance
from detent.kernel.step import step
from detent.methods.filtered_servo.build import build_filtered_servo
from detent.methods.filtered_servo.controller import RUN, go_to
from detent.methods.filtered_servo.system import TICK, FilteredServo, switch_on
from detent.methods.load import load_spec
from detent.plant.drive_train import move_averaged
from detent.sensing.gauge import read_gauge
from detent.sensing.phase_converters import run_converters
from detent.sensing.phase_detector import compare

PHASE_BAR = 4.0
FILTERED_BAR = 500.0
"""Simulated time over processor time."""

PARTS_TICKS = 500_000
LONGEST = 10_000_000

JOBS = {"one move of 13.2 in": (792,), "twelve moves of 6 pitches": (6, 6, -6, 6, 6, 6, -6, -6, 6, -6, -6, -6)}
"""Lengths of the moves [pitches]."""


class Moves:
    """A locked phase servo that makes a chain of moves, each commanded as soon as the axis is ready."""

    def __init__(self, pitches):
        self.pitches = pitches
        self.rig = Rig(pitch_index=10, locked=True)
        self.rig.run_until(START)
        self.begin = self.rig.r.snapshot(), self.rig.target

    def run(self):
        """From the first command to the last ready; returns the ticks."""
        rig, ticks = self.rig, 0
        state, rig.target = self.begin
        rig.r.restore(state)
        for pitches in self.pitches:
            rig.command(pitches)
            ticks += advance(rig.p, rig.r, LONGEST, *NO_TRACE)
            assert rig.r.controller.sequencer.event == 1
            assert abs(rig.error) < 2
            rig.acknowledge()
        return ticks


class Slide:
    """The slide as shipped, following command pulses of a steady rate [pulses/s]."""

    def __init__(self, rate, *overrides):
        spec = load_spec(SLIDE, overrides)
        self.p, self.r = build_filtered_servo(spec), FilteredServo()
        switch_on(
            self.p, self.r, spec.mechanics.start_position, round(spec.method.sample_period * 1e6), spec.encoder.seed
        )
        self.advance(1)
        go_to(self.r.controller, 1_000_000, rate * PER_PULSE)
        self.advance(round(0.5 / TICK))
        self.begin, self.rate = self.r.snapshot(), rate

    def advance(self, ticks):
        """Run so many ticks."""
        assert advance(self.p, self.r, ticks, *NO_TRACE) == ticks

    def run(self):
        """The next second; returns the ticks."""
        self.r.restore(self.begin)
        before, ticks = self.r.controller.deviation.position, round(1 / TICK)
        self.advance(ticks)
        assert self.r.controller.deviation.state == RUN
        assert self.r.controller.deviation.position - before == pytest.approx(self.rate, rel=0.02, abs=3)
        return ticks


def real_time(race, name, period):
    """How many times faster than real time, at `period` [s] per tick."""
    return period * 1e9 / race.nanoseconds()[name]


@pytest.mark.parametrize("job", JOBS)
def test_phase_servo_in_real_time(benchmark, job):
    moves = Moves(JOBS[job])
    race = Race({job: timed(moves.run)})
    if race.hold(benchmark, job, 25):
        factor = real_time(race, job, moves.rig.tick)
        benchmark.extra_info["times real time"] = round(factor, 2)
        assert factor >= PHASE_BAR, race.nanoseconds()


@pytest.mark.parametrize("rate", [1037, 20_000])
def test_filtered_servo_in_real_time(benchmark, rate):
    voltage = ("drive.amplifier=voltage", "drive.supply=12 V")
    slides = {"current drive": Slide(rate), "voltage drive": Slide(rate, *voltage)}
    race = Race({name: timed(slide.run) for name, slide in slides.items()})
    if race.hold(benchmark, "current drive", 400):
        factors = {name: real_time(race, name, TICK) for name in slides}
        benchmark.extra_info.update({f"times real time, {name}": round(factor) for name, factor in factors.items()})
        assert factors["current drive"] >= FILTERED_BAR, race.nanoseconds()


# ---- parts of the phase servo ----------------------------------------------------------------------------------------


@step
def run_comparator(p, r, step_per_tick, ticks):
    """Detector and comparator, the carriage moving evenly."""
    x, high = 0.0, 0
    for k in range(ticks):
        high += compare(p, r, k & 63, x)
        x += step_per_tick
    return high


@step
def run_drive(pwm_p, pwm_r, bridge_p, bridge_r, ticks):
    """Sawtooth and bridge, the current below the limit."""
    pwm, bridge = local_copy(pwm_r), local_copy(bridge_r)
    for k in range(ticks):
        first, second = count_sawtooth(pwm_p, pwm, 40), count_sawtooth(pwm_p, pwm, 40)
        sense_current(bridge_p, bridge, (k & 255) * 0.01)
        drive_two(bridge_p, bridge, first, second)
    copy_back(pwm_r, pwm)
    copy_back(bridge_r, bridge)


@step
def run_drive_train(p, r, supply, ticks):
    """Motor and carriage under a voltage that turns each 128 ticks: to and fro."""
    train = local_copy(r)
    for k in range(ticks):
        u = supply if k & 128 else -supply
        move_averaged(p, train, u, u)
    copy_back(r, train)


@step
def run_gauge(r, ticks):
    """What watches the move."""
    gauge = local_copy(r)
    for k in range(ticks):
        read_gauge(gauge, k, k * 1e-9, k * 1e-9)
    copy_back(r, gauge)


def parts_of(rig):
    """Runners of the blocks of the tick, each in a loop of its own."""
    axis, state = rig.p, rig.r.copy()
    c, p, r, n = axis.controller, axis.plant, state.plant, PARTS_TICKS
    return {
        "converters": lambda: run_converters(c.converters, state.controller.converters, 0, 1 << 20, n),
        "comparator": lambda: run_comparator(p.detector, r.detector, 5e-8, n),
        "PWM and bridge": lambda: run_drive(c.pwm, SawtoothPwm(), p.bridge, SplitBridge(), n),
        "motor and carriage": lambda: run_drive_train(p.train, r.train, p.bridge.supply, n),
        "gauge": lambda: run_gauge(r.gauge, n),
    }


def part(run):
    def ticks():
        run()
        return PARTS_TICKS

    return timed(ticks)


def test_parts_of_the_phase_servo(benchmark):
    moves = Moves(JOBS["twelve moves of 6 pitches"])
    parts = {name: part(run) for name, run in parts_of(moves.rig).items()}
    race = Race({"whole tick": timed(moves.run), **parts})
    if race.hold(benchmark, "whole tick", 25):
        found = race.nanoseconds()
        assert max(found[name] for name in parts) < found["whole tick"], found
