"""The keeper of a store beside a loop that does not wait for it: whatever happens while it looks at the axis."""

from collections.abc import Callable
from typing import Any

import pytest
from tests.acceptance.test_golden_bits import EXAMPLES
from tests.live_bench import Bench

from detent.control import operation as ops
from detent.methods.load import load_spec
from detent.methods.registry import METHODS
from detent.operate.keeper import POWERED
from detent.operate.opening import store_path
from detent.operate.store import Store

READS = 9  # of registers in one look, at least


class Watched:
    """Registers, of which each read is told."""

    def __init__(self, registers: Any, told: Callable[[], None]) -> None:
        self._registers, self._told = registers, told

    def __getattr__(self, name: str) -> Any:
        found = getattr(self._registers, name)
        if hasattr(found, "snapshot"):
            return Watched(found, self._told)
        self._told()
        return found


def made(folder: Any) -> Bench:
    """A parked axis with a store, at its own pace, whose time passes only when it is told to."""
    file = EXAMPLES / "cascade.toml"
    spec = load_spec(file, ())
    store = Store(store_path(folder / file.name, ""), METHODS["cascade"].sensors(spec)[""])
    bench = Bench("cascade", store=store)
    bench.host.run_until_ready()
    bench.pass_time(0.3)
    return bench


def look_while(bench: Bench, number: int, happens: Callable[[], object]) -> int:
    """One look, at whose read of this number something happens; gives how many there were."""
    keeper, reads = bench.host.keeper, 0
    assert keeper is not None
    board = bench.host.board

    def told() -> None:
        nonlocal reads
        reads += 1
        if reads == number:
            happens()

    keeper._board = Watched(board, told)
    keeper.look()
    keeper._board = board
    return reads


def check(bench: Bench) -> None:
    """What is parked has no torque, and stands where the store says."""
    keeper = bench.host.keeper
    assert keeper is not None
    saved, counts = keeper.store.saved, keeper._counts()
    assert saved is not None
    if not saved.moving:
        assert bench.operation.state not in POWERED
        assert abs(saved.counts - counts) <= keeper.store.sensor.window


def periods(bench: Bench, number: int) -> None:
    """Time passes for the loop alone: nobody looks at the store."""
    for _ in range(number):
        bench.host._run(1)
        bench.host.note()


@pytest.mark.compiled
@pytest.mark.parametrize("number", range(1, READS + 1))
def test_torque_that_comes_while_it_looks_is_not_parked(tmp_path: Any, number: int) -> None:
    """The request for torque is written, and taken at any read of a look that comes when the axis was long still."""
    bench = made(tmp_path)
    periods(bench, 500)
    bench.host.ask(ops.ENABLE)
    assert look_while(bench, number, lambda: periods(bench, 3)) >= READS
    assert bench.host.state == "operation enabled"
    assert bench.host.keeper.store.saved.moving  # type: ignore[union-attr]
    check(bench)
    bench.host.close()


@pytest.mark.compiled
@pytest.mark.parametrize("number", range(1, READS + 1))
def test_a_place_that_is_left_while_it_looks_is_not_parked(tmp_path: Any, number: int) -> None:
    """A look is held up at any read for so long that the axis moves, loses its torque, and rolls meanwhile."""
    bench = made(tmp_path).enable()

    def rolls() -> None:
        bench.host.ask(ops.MOVE_BY, 0.2)
        periods(bench, 300)
        bench.host.off()
        periods(bench, 5)

    assert look_while(bench, number, rolls) >= READS
    check(bench)
    assert bench.host.keeper.store.saved.moving  # type: ignore[union-attr]
    for _ in range(2):
        bench.pass_time(1.0)
        check(bench)
    assert not bench.host.keeper.store.saved.moving  # type: ignore[union-attr]
    bench.host.close()


@pytest.mark.compiled
def test_torque_that_came_and_went_between_two_looks_begins_the_time_again(tmp_path: Any) -> None:
    """Enabled, and off again where it stood, with no look between: it has not stood since the first of them."""
    bench = made(tmp_path)
    keeper = bench.host.keeper
    assert keeper is not None
    for ask in (lambda: bench.host.ask(ops.ENABLE), bench.host.off):
        ask()
        periods(bench, 200)
    assert keeper.look() is False
    periods(bench, 90)
    assert keeper.look() is False
    periods(bench, 20)
    assert keeper.look() is True
    bench.host.close()
