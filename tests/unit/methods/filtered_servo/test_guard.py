"""What a filtered servo watches of itself."""

import pytest
from tests.filtered_servo_rig import EXAMPLE

from detent.control.deviation_counter import FAULT
from detent.control.guard import FOLLOWING, NO_ARRIVAL, OVERSPEED, REVERSED, SATURATED, STUCK, TRAVEL
from detent.methods.filtered_servo.host import FilteredHost
from detent.methods.load import load_spec
from detent.methods.moves.job import one_move
from detent.methods.moves.run import run_moves

pytestmark = pytest.mark.compiled

HARD = ("limits.effort=1 kN", "drive.current_per_count=100 mA")
PUSHED = ("disturbance.push.at=100 ms", "disturbance.push.duration=1 s")


def host_of(*overrides):
    return FilteredHost(load_spec(EXAMPLE, overrides))


def fault_of(host, by=0.05):
    """Code of the guard after a move, and what the run says of it."""
    run = run_moves(host, one_move("there", by, 0.2))
    return int(host.controller.guard.code), run.failure


def jammed(*overrides):
    """A host whose slide nothing moves."""
    host = host_of(*overrides)
    friction = host.machine.params.plant.train.friction
    friction.static_right = friction.static_left = 1e4
    return host


def test_a_slide_that_is_jammed_is_a_sensor_that_stands_under_effort():
    host = jammed()
    code, failure = fault_of(host)
    assert code == STUCK
    assert "50 ms" in failure
    assert (host.machine.state.lines.run, host.machine.state.lines.word) == (0, 0.0)


def test_what_is_off_is_not_watched():
    code, failure = fault_of(jammed("protection.stuck_time=0 s"))
    assert (code, "position counter" in failure) == (0, True)


def test_a_command_at_its_limit_ends_the_move():
    code, failure = fault_of(jammed("method.position_bits=16", "protection.stuck_time=0 s"))
    assert code == SATURATED
    assert "1 s" in failure


def test_a_motor_with_its_leads_exchanged_is_found_before_it_is_fast():
    host = host_of()
    train = host.machine.params.plant.train
    train.force_constant = -train.force_constant
    code, _ = fault_of(host)
    assert code == REVERSED
    assert host.machine.state.plant.train.peak_current > 0.0


def test_a_slide_that_is_driven_too_fast():
    code, failure = fault_of(host_of("disturbance.push.force=400 N", *PUSHED, "protection.reversed_time=0 s"))
    assert code == OVERSPEED
    assert "1.1 x 100 mm/s" in failure


def test_a_move_that_does_not_arrive_is_told_and_held():
    host = host_of("disturbance.push.force=25 N", *PUSHED, "method.timeout=100 ms")
    code, failure = fault_of(host)
    assert code == NO_ARRIVAL
    assert "did not arrive" in failure
    host.stands(0.1)
    assert host.controller.deviation.state != FAULT


def test_the_ends_of_the_travel_count_from_where_it_stood():
    host = host_of("mechanics.start_position=100 mm")
    c = host.machine.params.controller
    pulse, window = host.spec.pulse, host.spec.method.in_position
    assert c.lowest == round(-0.1 / pulse) - window
    assert c.highest == round((host.spec.limits.travel - 0.1) / pulse) + window
    c.highest = 2000
    assert fault_of(host)[0] == TRAVEL


def test_following_is_the_position_counter():
    assert host_of().machine.params.controller.guard.following == 0
    assert fault_of(host_of())[0] != FOLLOWING
