"""Recordings of a simulated cascade axis as files, for the tests of what is done with an identification."""

import functools
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import detent

AXIS = """# slide of the test bench
[axis]
name = "slide"
method = "cascade"

[limits]
travel = "0.5 m"
lowest = "-0.25 m"
speed = "0.3 m/s"
acceleration = "4 m/s^2"
effort = "60 N"

[drive]
effort_per_volt = "1 N/V"
command_limit = "60 V"
delay = 2

[mechanics]
motor_mass = "4 kg"                 # weighed
start_position = "0 m"

[mechanics.friction]
offset = "1.5 N"

[mechanics.friction.positive]
coulomb = "5 N"
static = "5 N"
viscous = "14 N*s/m"

[mechanics.friction.negative]
coulomb = "5 N"
static = "5 N"
viscous = "11 N*s/m"

[encoder]
resolution = "1 um"
velocity_span = 2

[method]
sample_period = "1 ms"
position_gain = 20
velocity_gain = "320 V*s/m"
velocity_integral = "3 kV/m"

[method.feed_forward]
velocity = 1
"""

MOVES = """
repeat = 3
[[move]]
target = "0.15 m"
[[move]]
target = "-0.1 m"
speed = "0.15 m/s"
[[move]]
target = "-0.05 m"
speed = "40 mm/s"
[[move]]
target = "-0.1 m"
speed = "40 mm/s"
[[move]]
target = "0 m"
speed = "0.25 m/s"
"""


@functools.cache
def recorded() -> dict[str, NDArray[np.float64]]:
    """What the axis of `AXIS` recorded of `MOVES`: columns of a log by their headings."""
    from tempfile import TemporaryDirectory

    with TemporaryDirectory() as folder:
        axis, job = Path(folder, "axis.toml"), Path(folder, "job.toml")
        axis.write_text(AXIS, encoding="utf-8")
        job.write_text(MOVES, encoding="utf-8")
        run = detent.load(axis).run(job)
        assert run.done, run.failure
        return columns_of(run)


def columns_of(run: detent.Run) -> dict[str, NDArray[np.float64]]:
    """Columns of a log of a run."""
    assert run.trace is not None
    trace = run.trace
    force = trace["controller.law.command"] + 0.05 * np.random.default_rng(1).standard_normal(len(trace))
    return {
        "t [s]": trace.time,
        "setpoint [m]": trace["controller.reference.position"],
        "position [m]": trace["controller.motor_sensor.position"],
        "force [N]": force,
    }


def write_log(path: Path, columns: dict[str, NDArray[np.float64]] | None = None, **renamed: str) -> Path:
    """Write columns as CSV; a heading that begins with a key of `renamed` becomes its value."""
    found = recorded() if columns is None else columns
    heads = [next((new for old, new in renamed.items() if head.startswith(old)), head) for head in found]
    table = np.column_stack(list(found.values()))
    np.savetxt(path, table, delimiter=",", header=",".join(heads), comments="", fmt="%.9g")
    return path


def one_way() -> dict[str, NDArray[np.float64]]:
    """A part of the recording in which the axis moves one way only."""
    found = recorded()
    begin = int(np.argmax(found["setpoint [m]"] > 0.001))
    end = int(np.argmax(found["setpoint [m]"] > 0.149))
    part = {head: values[begin:end] for head, values in found.items()}
    return part | {"t [s]": part["t [s]"] - part["t [s]"][0]}
