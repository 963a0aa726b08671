import math

import pytest

from detent.drive.effort_source import MEMORY, EffortSource, EffortSourceParams, take_command


def source(**changes: float) -> EffortSourceParams:
    p = EffortSourceParams(gain=1.0, limit=math.inf)
    for name, value in changes.items():
        setattr(p, name, value)
    return p


@pytest.mark.parametrize("delay", [0, 1, 2, 17, MEMORY - 1])
def test_a_command_acts_after_the_delay_and_not_a_sample_sooner_or_later(delay):
    p, r = source(delay=delay, gain=35.0), EffortSource()
    out = []
    for k in range(3 * MEMORY):
        take_command(p, r, float(k + 1))
        out.append(r.output)
    assert out == [0.0] * delay + [35.0 * (k + 1) for k in range(3 * MEMORY - delay)]


@pytest.mark.parametrize(
    ("command", "taken"), [(0.124, 0.0), (0.126, 0.25), (-0.126, -0.25), (-0.124, 0.0), (0.125, 0.25), (7.3, 7.25)]
)
def test_the_converter_takes_the_nearest_step(command, taken):
    p, r = source(step=0.25), EffortSource()
    take_command(p, r, command)
    assert r.command == r.output == taken


@pytest.mark.parametrize("sign", [1, -1])
def test_the_command_is_limited_behind_the_converter(sign):
    p, r = source(step=0.3, limit=1.0, gain=-2.0), EffortSource()
    take_command(p, r, sign * 50.0)
    assert (r.command, r.output) == (sign * 1.0, sign * -2.0)
    take_command(p, r, sign * 0.92)
    assert r.command == pytest.approx(sign * 0.9)


def test_without_steps_the_command_is_taken_as_it_is():
    p, r = source(), EffortSource()
    take_command(p, r, math.pi)
    assert r.output == math.pi
