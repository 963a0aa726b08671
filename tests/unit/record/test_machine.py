import pytest
from tests.print_head_rig import EXAMPLE

from detent.control.head_computer import HOME_LEFT, POWER_ON
from detent.control.latch import read_latch, write_latch
from detent.methods.load import load_spec
from detent.methods.print_head.run import print_head_machine
from detent.methods.print_head.system import TICK, PrintHead
from detent.record import machine as machine_module
from detent.record import recorder as recorder_module
from detent.record.recorder import Recorder


def test_power_on_is_at_the_start_position_with_the_drive_off() -> None:
    machine = print_head_machine(load_spec(EXAMPLE, ["mechanics.start_position=5 in"]))
    assert machine.time == 0.0
    assert machine.state.plant.train.position == pytest.approx(0.127)
    assert machine.state.controller.head.state == POWER_ON
    machine.pass_time(0.5)
    assert machine.state.plant.train.position == pytest.approx(0.127)
    assert machine.state.plant.train.energy == 0.0


@pytest.mark.parametrize(("seconds", "ticks"), [(0.0, 1), (1e-9, 1), (40e-6, 1), (1e-3, 25), (0.5, 12_500)])
def test_time_passes_in_whole_ticks_and_at_least_one(seconds: float, ticks: int) -> None:
    machine = print_head_machine(load_spec(EXAMPLE))
    machine.pass_time(seconds)
    assert machine.state.tick == ticks
    assert machine.time == pytest.approx(ticks * TICK)


def test_a_status_byte_stops_time_until_it_is_read() -> None:
    machine = print_head_machine(load_spec(EXAMPLE))
    write_latch(machine.state.controller.head.command_latch, 0x40)  # POSITION HIGH: answered within a tick
    machine.pass_time(1.0)
    assert machine.state.tick <= 2
    stopped_at = machine.state.tick
    machine.pass_time(1.0)
    assert machine.state.tick == stopped_at
    read_latch(machine.state.controller.head.status.latch)
    machine.pass_time(1.0)
    assert machine.state.tick == stopped_at + 25_000


def test_a_long_time_is_cut_into_stretches_without_a_seam(monkeypatch: pytest.MonkeyPatch) -> None:
    whole, pieces = (print_head_machine(load_spec(EXAMPLE)) for _ in range(2))
    for machine in (whole, pieces):
        write_latch(machine.state.controller.head.command_latch, 0x01)
    whole.pass_time(0.5)
    monkeypatch.setattr(machine_module, "LONGEST_STRETCH", 7)
    pieces.pass_time(0.5)
    assert whole.state.controller.head.state == HOME_LEFT
    assert whole.state.plant.train.velocity < 0
    assert whole.state.snapshot() == pieces.state.snapshot()


def test_recording_changes_nothing_and_loses_no_row(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(recorder_module, "ROWS", 64)
    spec = load_spec(EXAMPLE)
    recorder = Recorder(PrintHead, ["plant.train.velocity"], every=3, period=TICK)
    recorded, plain = print_head_machine(spec, recorder), print_head_machine(spec)
    for machine in (recorded, plain):
        write_latch(machine.state.controller.head.command_latch, 0x01)
        machine.pass_time(0.1)
        machine.close()
    assert recorded.state.snapshot() == plain.state.snapshot()
    assert len(recorder.trace()) == 2500 // 3
