"""What names of columns say, and what they must not be taken for."""

import pytest

from detent.logs.headings import ROLES, rank, split_heading, words_of


@pytest.mark.parametrize(
    ("name", "role"),
    [
        ("t", "time"), ("Time", "time"), ("timestamp", "time"), ("Time Stamp", "time"), ("Zeit", "time"),
        ("qg", "reference"), ("goal_position", "reference"), ("Target Motor", "reference"), ("SetPoint", "reference"),
        ("position_ref", "reference"), ("qm", "position"), ("enconder", "position"), ("Encoder", "position"),
        ("ActualPosition", "position"), ("theta", "position"), ("enc1", "position"), ("enc2", "position_load"),
        ("load_position", "position_load"), ("speed", "velocity"), ("motor.velocity", "velocity"), ("v", "velocity"),
        ("acc", "acceleration"), ("force", "force"), ("motor torque", "torque"), ("tau", "torque"), ("i_q", "current"),
        ("MotorCurrent", "current"), ("u", "voltage"), ("input_volts", "supply"), ("Vbus", "supply"),
        ("load", "command"), ("pwm", "command"), ("inputSignal", "command"), ("controlSignal", "command"),
        ("temp", "temperature"), ("torque_enable", "enabled"), ("AX:CUR", "current"), ("motor_curr1", "current"),
        ("AX:RBV", "position"),
    ],
)  # fmt: skip
def test_names(name, role):
    ranks = {other: place for other in ROLES if (place := rank(name, other)) is not None}
    assert role in ranks
    first = next(iter(ranks))  # roles are looked for in their order
    assert first == role or ranks[first] > ranks[role]


@pytest.mark.parametrize(
    ("name", "role"),
    [
        ("Current Error", "current"), ("PID P Term", "command"), ("target velocity", "reference"),
        ("target velocity", "velocity"), ("torque_enable", "torque"), ("iq_ref", "current"), ("velocity", "position"),
        ("extra", "position"), ("x2", "position"), ("vibration", "velocity"), ("Sample", "time"), ("", "time"),
        ("speed", "position"), ("commanded current", "current"), ("position_error", "position"),
        ("cur_pos", "current"), ("curr speed", "current"),
    ],
)  # fmt: skip
def test_names_of_something_else(name, role):
    assert rank(name, role) is None


def test_words():
    assert words_of("MotorCurrent2") == ("motor", "current", "2")
    assert words_of("RPM") == ("rpm",)
    assert words_of("PWMDuty") == ("pwm", "duty")


def test_time_with_its_unit():
    names = [split_heading(heading)[0] for heading in ("time(ms)", "t_s", "position [mm]")]
    assert [rank(name, "time") is not None for name in names] == [True, True, False]


def test_each_role_can_be_told_by_its_names():
    for role in ROLES.values():
        assert all(rank(split_heading(name)[0], role.name) is not None for name in role.names), role.name
