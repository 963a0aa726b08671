"""The cascade axis against a real one, the ball-screw axis EMPS (Janot, Gautier, Brunot 2019).

The recording is not part of the project (its authors state no licence); where it is not at hand, its tests are skipped.
"""

import math

import numpy as np
import pytest
from scipy.io import loadmat
from scipy.signal import butter, filtfilt
from tests.cascade_rig import Rig, set_friction
from tests.places import DATA

from detent.methods.cascade.system import CascadeParams, fill_clocks, set_count
from detent.planning.profile import profile_of_recording

RECORDING = DATA / "emps" / "DATA_EMPS.mat"
T = 1e-3

# Reference model of the authors: least squares on this recording.
MASS, VISCOUS, COULOMB, OFFSET = 95.1089, 203.5034, 20.3935, -3.1648
KP, KV = 160.18, 243.45

pytestmark = [
    pytest.mark.compiled,
    pytest.mark.skipif(not RECORDING.exists(), reason="the recording is not at hand"),
]


@pytest.fixture(scope="module")
def emps():
    """Reference qg [m], position qm [m], command vir [V] at 1 kHz, and the force per command [N/V]."""
    return {name: value.ravel() for name, value in loadmat(RECORDING).items() if not name.startswith("__")}


def emps_params(force_per_volt: float, tick: float, mass: float) -> CascadeParams:
    """Position P over velocity P, vir = kp kv (qg - qm) - kv dq, on the model of one mass with friction."""
    p = CascadeParams()
    p.plant.machine.motor.mass = mass
    set_friction(p.plant.machine.motor.friction, coulomb=COULOMB, viscous=VISCOUS, offset=OFFSET)
    p.controller.law.cascade.position_gain, p.controller.law.cascade.velocity_gain = KP, KV
    p.controller.law.cascade.max_velocity = math.inf
    p.controller.law.max_command = p.plant.source.limit = 10.0
    p.plant.source.gain = force_per_volt
    for sensor in (p.controller.motor_sensor, p.controller.load_sensor):
        sensor.span, sensor.smoothing = 1, 1.0
    set_count(p, 5e-8, 5e-8)
    fill_clocks(p, tick, round(T / tick))
    return p


def derivatives(q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Central differences, twice, as the authors take them."""
    v = np.gradient(q, T)
    return v, np.gradient(v, T)


def relative_error(measured: np.ndarray, simulated: np.ndarray) -> float:
    """Norm of the difference over the norm of the measurement [%]."""
    return float(100 * np.linalg.norm(measured - simulated) / np.linalg.norm(measured))


def simulate(emps: dict[str, np.ndarray], *, tick: float = 50e-6, mass: float = MASS) -> tuple[np.ndarray, np.ndarray]:
    """Position [m] at each sample, and the command that follows from it [V]."""
    qg = emps["qg"]
    ref = profile_of_recording(np.arange(len(qg)) * T, qg, T)
    p = emps_params(float(emps["gtau"][0]), tick, mass)
    rig = Rig(p, float(emps["qm"][0]))
    every = p.controller.sample_ticks
    run = rig.record(len(qg) * every, ["plant.machine.motor.position", "controller.law.command"], every, profile=ref)
    before = np.concatenate([emps["qm"][:1], run["plant.machine.motor.position"][:-1]])
    return before, run["controller.law.command"]


def test_the_closed_loop_follows_the_recorded_one(emps):
    """The authors' own simulation errs by 0.0138, 0.2291, 8.60 and 5.85 % (position, velocity, acceleration, force).

    Measured derivatives are those of the position filtered at 100 Hz forwards and backwards; simulated ones are not
    filtered. A tighter figure than theirs is no better model: their integration and their velocity signal differ.
    """
    q, command = simulate(emps)
    smooth = filtfilt(*butter(4, 100 / 500), emps["qm"])
    (v_meas, a_meas), (v, a) = derivatives(smooth), derivatives(q)
    errors = [
        relative_error(emps["qm"], q),
        relative_error(v_meas, v),
        relative_error(a_meas, a),
        relative_error(emps["vir"], command),
    ]
    assert 0.0005 < errors[0] < 0.0138
    assert 0.05 < errors[1] < 0.2291
    assert 2.0 < errors[2] < 8.60
    assert 2.0 < errors[3] < 5.85


def test_a_shift_of_one_sample_would_be_seen(emps):
    q, _ = simulate(emps)
    here = relative_error(emps["qm"], q)
    late, soon = relative_error(emps["qm"][1:], q[:-1]), relative_error(emps["qm"][:-1], q[1:])
    assert min(late, soon) > 10 * here


def test_wrong_constants_would_be_seen(emps):
    """The command is what the plant shows itself in: the loop holds the position whatever the plant."""
    _, command = simulate(emps)
    right = relative_error(emps["vir"], command)
    _, heavier = simulate(emps, mass=1.1 * MASS)
    assert relative_error(emps["vir"], heavier) > right + 0.5


def test_the_tick_is_short_enough(emps):
    (q, command), (fine, also) = simulate(emps), simulate(emps, tick=10e-6)
    assert np.abs(q - fine).max() < 5e-8, "a count of the encoder"
    assert relative_error(also, command) < 0.05
