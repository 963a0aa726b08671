"""The same bits everywhere: what every register of every method is, through a standard job, as a hash.

It holds for both makers' processors, for every kernel of the linear algebra and width of numpy's loops, and for plain
Python (``NUMBA_DISABLE_JIT=1``, a shorter job). Where a block was changed on purpose, or a register renamed, the golden
hashes change with it; make them again with

    python -m tests.acceptance.test_golden_bits

and say in the commit why they did.
"""

import hashlib
import json
import os
import platform
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.places import ROOT

import detent
from detent.control.deviation_counter import RUN
from detent.kernel.registers import Registers
from detent.methods.print_head.controller import load_line

EXAMPLES = Path(detent.__file__).parent / "examples"
GOLDEN = Path(__file__).with_name("golden_bits.json")

NARROW = {"NPY_DISABLE_CPU_FEATURES": "X86_V3 X86_V4 AVX2 FMA3 AVX512F AVX512_SKX"}
"""Numpy's loops without wide vectors and fused products, by the names of its versions."""

KERNELS = ({"OPENBLAS_CORETYPE": "Prescott"} | NARROW, {"OPENBLAS_CORETYPE": "Haswell"})
"""Of the linear algebra; another one where the processor has its instructions."""

FIRST = 4000
"""Ticks of the shorter job, from the first command on."""

SAMPLES = 25
"""Of each of the commands."""


@dataclass
class Job:
    """An axis at power-on, and how it is told to move."""

    params: Mapping[str, Registers]
    state: Mapping[str, Registers]
    commands: tuple[Callable[[], object], ...]
    run: Callable[[int], object]  # lets ticks pass, whatever the axis says
    acknowledge: Callable[[], object] = lambda: None  # the host's answer to an event
    feed: Callable[[str], tuple[Any, ...]] = lambda _: ()  # what the host has laid ready for `advance`, by motor
    later: Callable[[int], object] = lambda _: None  # what the host itself keeps of the time goes on by so many ticks
    ticks: int = 2000  # from sample to sample: each command has time to be done


def print_head() -> Job:
    """Two lines with ink, one each way, its encoder shaking."""
    from tests.print_head_rig import Rig

    rig = Rig(overrides=["encoder.jitter=3 deg", "encoder.missing_edges=0.0005"]).pretend_identified()
    # Until there was ink no column was fired, and the bits of the column timer and of the paper said nothing.
    for bank in (0, 1):
        load_line(rig.r.controller, bank, [range(k, k + 2) for k in range(240 + 7 * bank, 560, 5)])

    def acknowledge() -> None:
        if rig.head.status.latch.flag:
            rig.read_status()

    def run(ticks: int) -> None:
        while ticks > 0:
            ticks -= rig.run(ticks)
            acknowledge()

    lines = (lambda: rig.send_print(1040.5, 1900), lambda: rig.send_print(1800, 1100))
    return Job({"": rig.p}, {"": rig.r}, lines, run, acknowledge)


def phase_servo() -> Job:
    """Two pitches there and three back against a force, each with speed mode, position mode, ready, stop and integral.

    With a noise of 0.5 us, two steps, as it was, the pulses of the noise alone counted the first pitch down within a
    millisecond, and what was left was the noise. The noise is now that of a good comparator.
    """
    from tests.phase_servo_rig import Rig

    errors = ("detector.jitter=15 ns", "detector.gain_error=2 %", "detector.offset_error=1 %")
    push = (f"disturbance.push.{key}" for key in ("force=3 N", "at=1 ms", "duration=1 s"))
    rig = Rig(*errors, *push, locked=True)
    commands = (lambda: rig.command(2), lambda: rig.command(-3))
    return Job({"": rig.p}, {"": rig.r}, commands, rig.run_ticks, rig.acknowledge, ticks=8000)


def filtered_servo() -> Job:
    """Command pulses there and back, with a few of noise between them; the slide comes to rest after each.

    At 20 000 pulses/s, as it was, the speed counter was about to wrap after 60 ms: a fault, and the rest coasting.
    """
    from tests.filtered_servo_rig import Rig

    rig = Rig(plant=("encoder.jitter=5 deg", "disturbance.lines.inserted=4 Hz"))
    commands = (lambda: rig.go(1400, 5000.0), lambda: rig.go(-1900, 6543.0))
    return Job({"": rig.p}, {"": rig.r}, commands, rig.run_ticks, rig.acknowledge)


def rotary_table() -> Job:
    """Two stations."""
    from detent.methods.load import load_spec
    from detent.methods.rotary_table.host import TableHost

    host = TableHost(load_spec(EXAMPLES / "rotary_table.toml", ()))
    host.start()

    def run(ticks: int) -> None:
        while ticks > 0:
            ticks -= host.machine.pass_ticks(ticks)
            host.acknowledge()

    machine = host.machine
    stations = (lambda: host.begin(1), lambda: host.begin(2))
    return Job({"": machine.params}, {"": machine.state}, stations, run, acknowledge=host.acknowledge)


def stepper_envelope() -> Job:
    """Both motors of a stage at once."""
    from detent.control.step_rule import acknowledge
    from detent.methods.load import load_spec
    from detent.methods.stepper_envelope.host import Leg, StageHost

    host = StageHost(load_spec(EXAMPLES / "zoom.toml", ()))
    motors = host.stage.motors

    def by(steps: int) -> Callable[[], object]:
        return lambda: host.start({n: Leg(m.position, max(m.position + steps, 0)) for n, m in motors.items()})

    def run(ticks: int) -> None:
        host.stage.pass_time(ticks * host.stage.tick)

    def later(ticks: int) -> None:
        host.stage.instant += ticks

    def answer() -> None:
        for motor in motors.values():
            acknowledge(motor.controller.rule)

    params = {name: motor.p for name, motor in motors.items()}
    state = {name: motor.r for name, motor in motors.items()}
    return Job(params, state, (by(200), by(-150)), run, answer, lambda name: motors[name].feed, later)


def cascade() -> Job:
    """A screw with a load on its coupling, Stribeck friction and backlash, there and back."""
    from detent.methods.cascade.build import motion_limits
    from detent.methods.cascade.host import CascadeHost
    from detent.methods.load import load_spec
    from detent.planning.profile import plan_move

    changes = ("mechanics.coupling.backlash=20 um", "encoder.velocity_filter=2 ms", "method.derivative_filter=1 ms")
    host = CascadeHost(load_spec(EXAMPLES / "cascade.toml", changes))
    limits, start = motion_limits(host.spec), host.spec.mechanics.start_position

    def to(begin: float, end: float) -> Callable[[], object]:
        return lambda: host.follow(plan_move(start + begin, start + end, limits, host.period))

    machine = host.machine
    commands = (to(0.0, 0.02), to(0.02, 0.005))
    return Job({"": machine.params}, {"": machine.state}, commands, machine.pass_ticks, feed=lambda _: host.feed)


JOBS = (print_head, phase_servo, filtered_servo, rotary_table, stepper_envelope, cascade)


def leaves(files: Mapping[str, Registers]) -> Iterator[tuple[str, bytes]]:
    """Path and bytes of every stored quantity, in the order of the paths."""
    for name, registers in sorted(files.items()):
        memory = bytes(registers)
        for leaf in sorted(type(registers).leaves(), key=lambda one: one.path):
            size = leaf.width.size * max(leaf.length, 1)
            yield f"{name}.{leaf.path}", memory[leaf.offset : leaf.offset + size]


def bits(job: Job, *, whole: bool) -> dict[str, str]:
    """Hash of the parameters, of all registers behind the shorter job, and of the samples of the whole one."""
    digest = hashlib.sha256()

    def add(files: Mapping[str, Registers]) -> str:
        """Take these registers in; the hash so far."""
        for path, value in leaves(files):
            digest.update(path.encode() + b"\0" + value)
        return digest.hexdigest()[:16]

    found = {"parameters": add(job.params)}
    job.commands[0]()
    job.run(FIRST)
    found["first"] = add(job.state)
    if whole:
        for _ in course(job):
            found["whole"] = add(job.state)
    return found


def course(job: Job) -> Iterator[int]:
    """The job from its first command on, sample by sample; gives the number of the command that is being done.

    Each is followed to its end before the next. The first one used to be given twice, and none went back.
    """
    for number in range(len(job.commands)):
        if number:
            job.commands[number]()
        for _ in range(SAMPLES):
            job.run(job.ticks)
            yield number


def all_bits(*, whole: bool) -> dict[str, dict[str, str]]:
    """Of every method."""
    return {job.__name__: bits(job(), whole=whole) for job in JOBS}


def told(kernel: Mapping[str, str], how: str) -> dict[str, dict[str, str]]:
    """The same from a process of its own that is told to take a kernel."""
    unset = {"OPENBLAS_CORETYPE", "NPY_DISABLE_CPU_FEATURES", "NUMBA_DISABLE_JIT"}
    environment = {name: value for name, value in os.environ.items() if name not in unset}
    made = subprocess.run(
        [sys.executable, "-W", "ignore", "-m", "tests.acceptance.test_golden_bits", how],
        env=environment | {"OPENBLAS_NUM_THREADS": "1"} | kernel,
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert made.returncode == 0, made.stderr[-2000:]
    return json.loads(made.stdout)


def kernels() -> tuple[dict[str, str], ...]:
    """What each process is told."""
    from numpy._core._multiarray_umath import __cpu_features__ as features

    return (*KERNELS, {"OPENBLAS_CORETYPE": "SkylakeX"}) if features.get("AVX512F", False) else KERNELS


@pytest.fixture(scope="module")
def golden() -> dict[str, dict[str, str]]:
    return json.loads(GOLDEN.read_text())


@pytest.mark.compiled
def test_every_register_has_its_golden_bits(golden):
    assert all_bits(whole=True) == golden


@pytest.mark.compiled
def test_the_standard_job_of_the_print_head_fires_columns_both_ways():
    job = print_head()
    axis: Any = job.state[""]
    head = axis.controller.head
    job.commands[0]()
    landed = [(head.direction, int(head.columns.fired)) for _ in course(job)]
    fired = [max(count for direction, count in landed if direction == d) for d in (1, -1)]
    assert fired[0] > 50
    assert fired[1] > fired[0] + 50


@pytest.mark.compiled
def test_the_standard_job_of_the_phase_servo_moves_settles_and_holds_both_ways():
    job = phase_servo()
    axis: Any = job.state[""]
    states: list[set[tuple[int, int, int]]] = [set(), set()]
    places, integrals = [axis.plant.train.position], []
    job.commands[0]()
    for number in course(job):
        s = axis.controller.sequencer
        states[number].add((s.mode, s.ready, s.stop))
        places[number + 1 :] = [axis.plant.train.position]
        integrals.append(axis.controller.law.integral)
    # Speed mode, position mode, ready, stop; and there the integral holds the force.
    every = {(0, 0, 0), (1, 0, 0), (1, 1, 0), (1, 1, 1)}
    assert states == [every, every]
    step = detent.load(EXAMPLES / "phase_servo.toml").spec.step
    assert np.diff(places) / step == pytest.approx([128, -192], abs=2)
    assert min(integrals) <= -4
    assert axis.controller.guard.code == 0


@pytest.mark.compiled
def test_the_standard_job_of_the_filtered_servo_moves_and_comes_to_rest_both_ways():
    job = filtered_servo()
    axis: Any = job.state[""]
    deviation = axis.controller.deviation
    places, rests = [deviation.position], []
    job.commands[0]()
    for number in course(job):
        assert deviation.state == RUN
        places[number + 1 :] = [deviation.position]
        rests[number:] = [deviation.deviation]
    assert np.diff(places) == pytest.approx([1400, -1900], abs=10)
    # It lags 100 pulses and more while it moves; the ringing of the filtered loop is all but over.
    assert np.abs(rests).max() <= 8


@pytest.mark.wide
@pytest.mark.compiled
@pytest.mark.skipif(platform.machine() not in {"x86_64", "AMD64"}, reason="the names are those of x86 kernels")
def test_no_kernel_and_no_width_changes_a_bit(golden):
    with ThreadPoolExecutor(2) as pool:
        for kernel, found in zip(kernels(), pool.map(lambda kernel: told(kernel, "whole"), kernels()), strict=True):
            assert found == golden, kernel


def test_plain_python_gives_the_same_bits(golden):
    found = told({"NUMBA_DISABLE_JIT": "1"}, "first")
    assert found == {name: {k: v for k, v in parts.items() if k != "whole"} for name, parts in golden.items()}


if __name__ == "__main__":
    if len(sys.argv) > 1:
        sys.stdout.write(json.dumps(all_bits(whole=sys.argv[1] == "whole")))
    else:
        GOLDEN.write_text(json.dumps(all_bits(whole=True), indent=2) + "\n")
