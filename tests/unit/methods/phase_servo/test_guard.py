"""What a phase servo watches of itself."""

import pytest
from tests.phase_servo_rig import EXAMPLE

from detent.control.guard import NO_ARRIVAL, SATURATED, STUCK
from detent.methods.load import load_spec
from detent.methods.moves.job import one_move
from detent.methods.moves.run import run_moves
from detent.methods.phase_servo.controller import acquire
from detent.methods.phase_servo.host import PhaseHost

pytestmark = pytest.mark.compiled


def host_of(*overrides):
    return PhaseHost(load_spec(EXAMPLE, overrides))


def block(host, force):
    """Friction of the carriage [N]."""
    friction = host.machine.params.plant.train.friction
    friction.static_right = friction.static_left = friction.coulomb_right = friction.coulomb_left = force


def jammed(*overrides):
    """A host whose carriage nothing moves, once it has settled."""
    host = host_of(*overrides)
    host.start()
    block(host, 1e4)
    host.start = lambda: None
    return host


def fault_of(host, pitches=10):
    """Code of the guard after a move, and what the run says of it."""
    run = run_moves(host, one_move("there", pitches * host.spec.pitch, 0.05))
    return int(host.controller.guard.code), run.failure


def test_a_move_that_goes_well_is_no_fault():
    assert fault_of(host_of()) == (0, "")


def test_a_carriage_that_is_jammed_is_a_sensor_that_stands_under_effort():
    host = jammed()
    code, failure = fault_of(host)
    assert code == STUCK
    assert "50 ms" in failure
    assert host.machine.state.lines.enable == 0


def test_a_command_at_its_limit_ends_the_move():
    code, failure = fault_of(jammed("protection.stuck_time=0 s", "protection.saturation_time=100 ms"))
    assert code == SATURATED
    assert "100 ms" in failure


def test_a_move_that_does_not_arrive_is_told_and_held():
    host = jammed("protection.stuck_time=0 s")
    code, failure = fault_of(host)
    assert code == NO_ARRIVAL
    assert "did not arrive" in failure
    assert host.machine.state.lines.enable == 1


def test_after_a_fault_it_acquires_anew():
    host = jammed()
    fault_of(host)
    block(host, 1.0)
    host.machine.pass_time(0.2)
    acquire(host.controller)
    del host.start
    host.start()
    assert (host.controller.guard.code, host.machine.state.lines.enable) == (0, 1)
