import itertools

import pytest

from detent.drive.h_bridge import Bridge, BridgeLines, decode, steer, terminal_voltage

Q1, Q2, Q3, Q4 = 1, 2, 4, 8
SUPPLY = 38.0


@pytest.mark.parametrize(
    ("gates", "positive", "negative"),
    [
        (Q1 | Q4, SUPPLY, SUPPLY),  # drive right, pulse: both legs held, whatever the current
        (Q2 | Q3, -SUPPLY, -SUPPLY),
        (Q4, 0.0, SUPPLY),  # drive right, pause: forward current free-wheels, backward current charges the supply
        (Q3, -SUPPLY, 0.0),
        (0, -SUPPLY, SUPPLY),  # all open: the diodes always oppose the current
        (Q3 | Q4, 0.0, 0.0),  # shorted below
        (Q1 | Q2, 0.0, 0.0),  # shorted above
    ],
)
def test_terminal_voltage_by_gates_and_sign_of_the_current(gates, positive, negative):
    assert terminal_voltage(gates, SUPPLY, 1) == positive
    assert terminal_voltage(gates, SUPPLY, -1) == negative


@pytest.mark.parametrize("right_left", [0, 1])
def test_open_legs_never_help_the_current(right_left):
    for transition, pwm in itertools.product((0, 1), (0, 1)):
        gates = decode(pwm, right_left, transition)
        assert terminal_voltage(gates, SUPPLY, 1) <= terminal_voltage(gates, SUPPLY, -1)


@pytest.mark.parametrize("pulse", [0, 1, 99, 150, 300])
def test_mean_voltages_of_the_four_line_states(pulse):
    share = pulse / 300
    expected = {
        # (TR, right/left): mean for positive and negative current
        (0, 1): (SUPPLY * share, SUPPLY),
        (0, 0): (-SUPPLY, -SUPPLY * share),
        (1, 1): (-SUPPLY, SUPPLY * (1 - share)),  # braking rightward motion: current flows backward
        (1, 0): (-SUPPLY * (1 - share), SUPPLY),
    }
    for (transition, right_left), means in expected.items():
        bridge = Bridge()
        steer(bridge, BridgeLines(right_left=right_left, transition=transition), pulse, SUPPLY)
        assert (bridge.mean_positive, bridge.mean_negative) == pytest.approx(means)
        assert bridge.pulse == pulse
        assert bridge.gates_on == decode(1, right_left, transition)
        assert bridge.gates_off == decode(0, right_left, transition)


def test_complement_in_transition_gives_the_drive_value_as_mean_voltage():
    for value in range(301):
        bridge = Bridge()
        steer(bridge, BridgeLines(right_left=1, transition=1), 300 - value, SUPPLY)
        assert bridge.mean_negative == pytest.approx(SUPPLY * value / 300)
