import os
import subprocess
import sys
from pathlib import Path

import numba
import pytest
from numba.core.registry import cpu_target

import detent.kernel.step as step_module
from detent.control.feed_forward import steady_drive
from detent.kernel.registers import Registers, f8, i8, register
from detent.kernel.step import hot_step, step
from detent.plant.drive_train import settle_contacts
from detent.plant.two_mass import TwoMass

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


SCRIPT = """
import numpy as np
from detent.kernel.loop import write_row
from detent.kernel.registers import Registers, i8, register

class Own(Registers):
    count: i8 = register("pulses", unit="count")

rows, picks = np.zeros((2, 8), np.uint8), np.arange(8)
write_row(Own(count=7), 1, rows, picks, 1)
print(rows[1, 0])
"""


@pytest.mark.process
@compiled_only
def test_registers_of_a_script_stay_out_of_the_cache(tmp_path):
    """Code that names a class of a script can be read by no process that cannot import it: commands crashed."""
    (tmp_path / "own_axis.py").write_text(SCRIPT, encoding="utf-8")
    package = Path(step_module.__file__).parents[2]
    environment = os.environ | {
        "DETENT_CACHE_DIR": str(tmp_path / "cache"),
        "PYTHONPATH": os.pathsep.join([str(tmp_path), str(package)]),
    }
    run = subprocess.run(
        [sys.executable, "-c", "import own_axis"], env=environment, capture_output=True, text=True, check=False
    )
    assert run.stdout == "7\n", run.stderr
    assert not any(b"own_axis" in kept.read_bytes() for kept in (tmp_path / "cache").rglob("*.code"))


@compiled_only
@compiled_only
def test_registers_of_the_package_are_kept():
    kinds, codegen = (numba.typeof(TwoMass()), numba.int64), cpu_target.target_context.codegen()
    file, why = steady_drive._cache._file(kinds, codegen)
    assert (file is not None, why) == (True, "")
    assert steady_drive._cache._file((numba.typeof(Ratio()),), codegen) == (None, "registers of another package")
    # What numba hands over may be a signature with its return type.
    assert steady_drive._cache._file(numba.none(*kinds), codegen) == (file, "")


@compiled_only
def test_only_steps_of_the_package_are_cached():
    assert isinstance(steady_drive._cache, step_module._Kept)
    assert not isinstance(divide._cache, step_module._Kept)


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
