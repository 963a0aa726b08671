"""Faces specification, section 3, number 17: a master that guards a CiA 402 node, and one that falls silent."""

from itertools import pairwise

import numba
import pytest
from tests.cyclic_rig import NODE, master_of, stepped

pytestmark = [
    pytest.mark.compiled,
    pytest.mark.process,
    pytest.mark.skipif(numba.config.DISABLE_JIT, reason="a process of its own for the bus"),
]
GUARDED = 0.02  # time between two questions [s]


@pytest.mark.parametrize(
    ("option", "state"),
    [
        pytest.param(0, "OPERATION ENABLED", marks=pytest.mark.wide), (1, "FAULT"),
        pytest.param(2, "SWITCH ON DISABLED", marks=pytest.mark.wide), (3, "QUICK STOP ACTIVE"),
    ],
)  # fmt: skip
def test_17_a_master_that_guards_no_more_does_what_6007_says(tmp_path, option, state):
    with stepped(tmp_path) as axis, master_of(axis, f"guarded {option}") as (node, network), axis.running():
        heard: list[int] = []
        network.subscribe(0x700 + NODE, lambda _id, data, _time: heard.append(data[0]))
        node.sdo[0x6007].raw = option
        node.sdo[0x100C].raw, node.sdo[0x100D].raw = 100, 5
        node.op_mode = "PROFILED VELOCITY"
        node.nmt.start_node_guarding(GUARDED)
        node.state = "OPERATION ENABLED"
        node.sdo[0x60FF].raw = 30_000
        axis.until(lambda: axis.operation.answer.commanded_velocity > 0.025)
        axis.until(lambda: len(heard) > 10)
        assert {code & 0x7F for code in heard} == {5}  # operational
        assert all(one ^ other == 0x80 for one, other in pairwise(heard))
        assert not node.sdo[0x6041].raw & 0x08
        node.nmt.stop_node_guarding()
        axis.until(lambda: (node.check_statusword(), node.state)[1] == state and axis.operation.answer.rests)
        assert node.sdo[0x603F].raw == (0x8130 if option == 1 else 0)


def test_17_no_answer_where_a_heartbeat_is_sent_and_no_loss_without_a_life_time(tmp_path):
    with stepped(tmp_path) as axis, master_of(axis, "not guarded") as (node, network), axis.running():
        heard: list[int] = []
        network.subscribe(0x700 + NODE, lambda _id, data, _time: heard.append(data[0]))
        node.state = "OPERATION ENABLED"
        network.send_message(0x700 + NODE, [], remote=True)
        axis.until(lambda: heard)
        assert heard == [5]
        node.nmt.send_command(0x82)  # reset of communication: it boots, and the bit begins anew
        axis.until(lambda: heard == [5, 0])
        network.send_message(0x700 + NODE, [], remote=True)
        axis.until(lambda: len(heard) == 3)
        assert heard[2] == 0x7F  # pre-operational
        node.sdo[0x1017].raw = 1000
        network.send_message(0x700 + NODE, [], remote=True)
        assert node.sdo[0x6041].raw & 0x6F == 0x27
        assert [one for one in heard[3:] if one & 0x80] == []
