import numba
import pytest

import detent.kernel.step as step_module
from detent.control.feed_forward import steady_drive
from detent.kernel.registers import Registers, f8, i8, register
from detent.kernel.step import hot_step, step
from detent.plant.drive_train import settle_contacts

compiled_only = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="about compiled code; NUMBA_DISABLE_JIT is set")


class Ratio(Registers):
    """A quotient and its operands."""

    above: f8 = register("dividend")
    below: f8 = register("divisor")
    whole: i8 = register("integer part")


@step
def divide(r: Ratio) -> float:
    """Division that must not raise."""
    return r.above / r.below


@hot_step
def halve(r: Ratio) -> None:
    """An inlined step can be called by itself, too."""
    r.whole = int(r.above) >> 1


@compiled_only
def test_division_by_zero_gives_infinity_and_does_not_raise():
    assert divide(Ratio(above=1.0, below=0.0)) == float("inf")
    assert divide(Ratio(above=-1.0, below=0.0)) == float("-inf")


def test_hot_step_works_alone():
    r = Ratio(above=9.0)
    halve(r)
    assert r.whole == 4


@compiled_only
def test_compilation_options_are_those_of_the_house():
    for function, inline in ((steady_drive, False), (settle_contacts, True)):
        options = function.targetoptions
        assert options["error_model"] == "numpy"
        assert options["nogil"] is True
        assert bool(options.get("forceinline")) is inline
        assert not options.get("fastmath")  # strict floating point: every machine gives the same bits


@compiled_only
def test_only_steps_of_the_package_are_cached():
    assert isinstance(steady_drive._cache, step_module._PackageCache)
    assert not isinstance(divide._cache, step_module._PackageCache)


def test_the_name_and_the_documentation_stay():
    assert divide.__name__ == "divide"
    assert divide.__doc__ == "Division that must not raise."


@step
def keep(r: Ratio, whole: int, up: bool) -> None:
    """Take a value."""
    r.whole = whole + 1 if up else whole


@step
def keep_several(r: Ratio, whole: int) -> None:
    """Calls with variables and with constants."""
    keep(r, whole, r.above > 0.0)
    keep(r, 7, True)
    keep(r, 9, False)


@compiled_only
def test_calls_with_constants_use_the_same_machine_code():
    r = Ratio()
    keep_several(r, 5)
    assert r.whole == 9
    assert len(keep.overloads) == 1
