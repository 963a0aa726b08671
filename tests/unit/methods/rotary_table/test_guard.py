"""What a rotary table watches of itself: each fault in time, and none where the axis does what it is asked."""

import math

import pytest

import detent
from detent.control.guard import FOLLOWING, JUMPED, NO_ARRIVAL, OVERSPEED, REVERSED, SATURATED, STUCK
from detent.methods.load import load_spec
from detent.methods.rotary_table.build import build_rotary_table
from detent.methods.rotary_table.controller import control
from detent.methods.rotary_table.host import TableHost
from detent.methods.rotary_table.plant import move, sense
from detent.methods.rotary_table.run import run_sequence
from detent.methods.rotary_table.sequence_job import Go, Jog, SequenceJob
from detent.methods.rotary_table.system import TICK

pytestmark = pytest.mark.compiled

EXAMPLE = detent.example("rotary_table.toml")
ALONE = {  # one watch alone: the others are off
    "following": "protection.following_time=0 s",
    "stuck": "protection.stuck_time=0 s",
    "reversed": "protection.reversed_time=0 s",
    "overspeed": "protection.overspeed=0",
    "jump": "protection.jump=0",
}
PUSH = ("disturbance.load.torque=400 N*m", "disturbance.load.at=0.5 s", "disturbance.load.duration=5 s")


def without(*watches):
    return [ALONE[watch] for watch in watches]


def only(watch):
    return without(*(name for name in ALONE if name != watch))


def host_of(*overrides):
    host = TableHost(load_spec(EXAMPLE, overrides))
    host.start()
    return host


def sound(_lines, _tick):
    """Wires as they are."""


def jog(host, seconds, wrong=sound, speed=60.0, begin=0.5):
    """Jog with something wrong on the wires from `begin` on; the time that the guard takes to see it [s], or None."""
    machine = host.machine
    p, r = machine.params, machine.state
    host.press(1, math.radians(speed))
    for tick in range(round(seconds / TICK)):
        sense(p.plant, r.plant, r.plant.train, r.lines)
        if tick * TICK >= begin:
            wrong(r.lines, tick)
        control(p.controller, r.controller, r.lines)
        move(p.plant, r.plant, r.plant.train, r.lines, r.tick)
        r.tick += 1
        if r.controller.guard.code:
            return tick * TICK - begin
    return None


def code(host):
    return int(host.machine.state.controller.guard.code)


# -- the wires of the sensor


def standing():
    """Words that stay what they were."""
    kept = []

    def wrong(lines, _tick):
        kept.append((lines.fine, lines.coarse))
        lines.fine, lines.coarse = kept[0]

    return wrong


def test_a_sensor_that_stands_is_seen_before_the_table_has_turned_far():
    host = host_of()
    took = jog(host, 2.0, standing())
    assert code(host) == STUCK
    assert took < 0.05 + 2 * 0.02
    assert "50 ms" in host.failure
    assert (host.machine.state.lines.enable, host.machine.state.lines.word) == (0, 0)


def test_a_slow_table_is_off_by_its_deviation():
    host = host_of("limits.speed=4 deg/s", "position.1.speed=4 deg/s")
    took = jog(host, 3.0, standing(), speed=4.0)
    assert code(host) == FOLLOWING
    assert took < 0.2
    assert host.machine.state.plant.train.motor.velocity / 90 < math.radians(12)


def mirrored(lines, _tick):
    """Both windings with their leads exchanged."""
    if lines.strobe:
        lines.fine, lines.coarse = (4096 - lines.fine) % 4096, (4096 - lines.coarse) % 4096


@pytest.mark.parametrize("watches", [ALONE, ["reversed"]])
def test_a_sensor_the_wrong_way_round_is_seen_before_it_is_fast(watches):
    host = host_of(*without(*(name for name in ALONE if name not in watches)))
    took = jog(host, 1.0, mirrored, begin=0.0)
    assert code(host) == REVERSED
    assert took < 0.25
    assert abs(host.machine.state.plant.train.motor.velocity) / 90 < math.radians(140)


def slipping(lines, tick):
    """The coarse resolver reads a motor turn beside itself, 30 ms in 60."""
    if lines.strobe and tick // 300 % 2:
        lines.coarse = (lines.coarse + 46) % 4096


def test_an_angle_that_jumps_by_a_motor_turn():
    host = host_of()
    took = jog(host, 1.0, slipping, speed=10.0)
    assert code(host) == JUMPED
    assert took < 0.2


def test_a_single_disturbed_word_is_none():
    def once(lines, tick):
        if lines.strobe and tick == 6000:
            lines.coarse = (lines.coarse + 46) % 4096

    assert jog(host_of(), 1.5, once) is None


# -- the machine


def test_a_table_that_is_blocked():
    host = host_of()
    motor = host.machine.params.plant.train.motor
    motor.coulomb = motor.static = 1e4
    took = jog(host, 1.0, begin=0.0)
    assert code(host) == STUCK
    assert took < 0.3


@pytest.mark.parametrize("watch", ["following", "stuck"])
def test_each_watch_sees_it_alone(watch):
    host = host_of(*only(watch))
    motor = host.machine.params.plant.train.motor
    motor.coulomb = motor.static = 1e4
    jog(host, 1.0)
    assert code(host) == {"following": FOLLOWING, "stuck": STUCK}[watch]
    assert watch != "following" or "4.211 deg, protection.following_error" in host.failure


def test_a_motor_with_its_leads_exchanged_is_found_before_it_is_fast():
    host = host_of()
    amplifier = host.machine.params.plant.amplifier
    amplifier.speed_per_count = -amplifier.speed_per_count
    assert jog(host, 1.0, begin=0.0) < 0.25
    assert code(host) == REVERSED


def test_a_table_that_is_driven_too_fast():
    host = host_of(*PUSH, *without("following", "reversed"))
    assert jog(host, 2.0) < 0.1
    assert code(host) == OVERSPEED
    assert "1.25 x 60 deg/s" in host.failure


def test_a_saturated_word_is_a_fault_only_where_the_file_says_so():
    weak = ("limits.effort=0.02 N*m", *without("following"))
    assert jog(host_of(*weak), 1.0) is None
    host = host_of(*weak, "protection.saturation_time=0.2 s")
    jog(host, 3.0)
    assert code(host) == SATURATED


# -- what a run says


def run(*steps, over=()):
    return run_sequence(load_spec(EXAMPLE, over), SequenceJob("job", steps))


def test_a_run_ends_with_the_cause_and_the_table_coasts():
    found = run(Go(1), Jog(1, duration=10.0, row=7), over=[*PUSH, "disturbance.load.at=5 s"])
    assert not found.done
    assert found.failure.startswith("step 2 of 2 (line 7), jog + at 60 deg/s for 10 s: the axis ran faster than 1.25 x")
    assert found.failure.endswith("(protection.overspeed)")
    assert found.time_end < 5.2


def test_a_form_that_is_known_to_fail_is_named_beside_the_cause():
    over = [f"position.{number}.direction=as commanded" for number in range(5)]
    over += ["method.form=raw", "mechanics.start_angle=100 deg"]
    found = run(Jog(1, duration=14.0), over=over)
    assert "the following error exceeded 4.211 deg, protection.following_error, and the drive" in found.failure
    assert found.failure.endswith('set method.form = "turn counter"')
    # At the boundary, 260 deg on, dR is a turn: 60 ms and a look later the drive is off.
    assert math.degrees(found.steps[0].travel) < 260 + 0.08 * 133


def test_a_positioning_that_does_not_arrive_is_told_and_held():
    over = ["limits.effort=1 N*m", "disturbance.load.torque=20 N*m", "disturbance.load.at=1 s",
            "disturbance.load.duration=50 s", "protection.following_error=20 deg"]  # fmt: skip
    host = host_of(*over)
    host.begin(1)
    host.machine.pass_ticks(200)
    host.arrive_within(5.0)
    host.machine.pass_ticks(100_000)
    assert (code(host), host.failure, host.at_rest) == (NO_ARRIVAL, "", False)
    host.arrive_within(0.0)
    for _ in range(3):
        host.acknowledge()
        host.machine.pass_ticks(10_000)
    assert host.machine.state.lines.enable == 1
    assert "it was not in position within" in run(Go(1), over=over).failure


# -- what is left alone


@pytest.mark.parametrize("bits", [12, 16])
@pytest.mark.parametrize("sign", [1, -1])
def test_the_runs_of_the_specification_do_not_trip_it(sign, bits):
    """Tests 4 to 9, 17 and 18: jogs over many turns from everywhere, stops and back, on the default axis (7)."""
    for place in (0.0, 360 / 368640, 0.5, 100.0, 359.9):
        host = host_of(f"mechanics.start_angle={place} deg", "drive.droop=0 %", f"drive.word_bits={bits}")
        for speed, seconds, way in ((60.0, 14.0, sign), (60.0, 3.0, -sign), (2.0, 2.0, sign), (0.1, 1.0, sign)):
            host.press(way, math.radians(speed))
            pass_time(host, seconds)
            host.release()
            pass_time(host, 0.5)
        for number in (1, 2, 3, 4, 4):
            host.begin(number)
            pass_time(host, 5.0)
        assert code(host) == 0


def pass_time(host, seconds):
    left = round(seconds / TICK)
    while left > 0:
        left -= host.machine.pass_ticks(left)
        host.acknowledge()


@pytest.mark.parametrize(
    "over",
    [
        ["detector.fine.noise=0.26 deg", "mechanics.start_angle=0 deg"],  # test 14: 3 counts
        ["method.update=flag first", "method.task_phase=0.2 ms"],  # test 15: a deviation of a turn for one sample
        ["method.update=remaining first", "method.task_phase=0.2 ms"],
        ["method.position_control=false", "drive.droop=20 %"],  # test 19: no deviation is kept
        ["mechanics.coulomb=0.3 N*m", "mechanics.backlash=0.1 deg"],
        ["limits.speed=126 deg/s", "limits.acceleration=3000 deg/s^2", "limits.effort=40 N*m"],  # the word is clipped
    ],
)
def test_what_is_odd_but_no_fault(over):
    host = host_of(*over)
    for way in (1, -1):
        host.press(way, host.spec.limits.speed)
        pass_time(host, 20.0)
        host.release()
        pass_time(host, 1.0)
    assert code(host) == 0


def test_the_windows_follow_from_the_keys():
    spec = load_spec(EXAMPLE, ())
    p = build_rotary_table(spec).controller
    assert (p.look_interrupts, p.guard.following, p.guard.stuck, p.guard.saturated, p.guard.travel) == (10, 3, 3, 0, 0)
    assert math.degrees(p.following / 65536 * spec.count) == pytest.approx(2 * 60 / 0.95 / 30, abs=1e-3)
    assert p.breaking == math.ceil(0.3 * 2047)
    assert p.guard.speed == pytest.approx(1.25 * 60 * 0.02 * 368640 / 360, abs=2.1)
    seldom = build_rotary_table(load_spec(EXAMPLE, ("method.strobe_period=50 ms", "method.task_period=50 ms")))
    assert seldom.controller.look_interrupts == 1
    off = build_rotary_table(load_spec(EXAMPLE, ("method.position_control=false",))).controller
    assert off.guard.following == 0
