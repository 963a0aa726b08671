"""The exact linear model against the plant's own figures and against the compiled axis."""

import math
from dataclasses import replace

import numpy as np
import pytest
from tests.cascade_rig import Rig

from detent.analysis.margins import usual_frequencies
from detent.methods.cascade.build import build_cascade
from detent.methods.cascade.loop import LinearLoop, machine_of
from detent.plant.linear_two_mass import fastest_rate

FREE = [
    f"mechanics.{mass}.{sense}.{kind}=0 N"
    for mass in ("friction", "load_friction")
    for sense in ("positive", "negative")
    for kind in ("coulomb", "static")
]
FINE = ["encoder.resolution=0 m", "drive.command_step=0 V", "limits.effort=5 MN", "drive.command_limit=1e6 V"]
PID = [
    "method.structure=pid",
    "method.proportional=8 kV/m",
    "method.integral=100 kV/(m*s)",
    "method.derivative=100 V*s/m",
    "method.derivative_filter=0.2 ms",
]


@pytest.mark.parametrize(
    "overrides",
    [
        (),
        ("mechanics.pendulum=3 N*m",),
        ("motor.inductance=0 H",),
        ("mechanics.load_friction.negative.viscous=2 N*m*s/rad",),
        ("mechanics.friction.positive.stribeck=0.01 deg/s",),
        ("mechanics.coupling.damping=40 N*m*s/rad",),
    ],
)
def test_the_fastest_rate_is_that_of_the_plant(load_text, rotary_text, overrides):
    spec = load_text(rotary_text, *overrides).spec
    assert fastest_rate(machine_of(spec)) == pytest.approx(fastest_rate(build_cascade(spec).plant.machine), rel=1e-9)


def test_the_fastest_rate_of_one_mass(load_text, rigid_text):
    for overrides in ([], ["drive.input=voltage", "motor.inductance=2 mH"], ["drive.input=voltage"]):
        spec = load_text(rigid_text, *overrides).spec
        assert fastest_rate(machine_of(spec)) == pytest.approx(
            fastest_rate(build_cascade(spec).plant.machine), rel=1e-9
        )


def swing(spec, seconds):
    """Largest position error after a push at rest, in the first and in the last quarter of a run [m]."""
    p = build_cascade(spec)
    rig = Rig(p, spec.mechanics.start_position)
    rig.r.plant.machine.motor.velocity = rig.r.plant.machine.load.velocity = 1e-3
    samples = round(seconds / spec.method.sample_period)
    run = rig.record(samples * p.controller.sample_ticks, ["plant.machine.motor.position"], p.controller.sample_ticks)
    error = np.abs(run["plant.machine.motor.position"] - spec.mechanics.start_position)
    quarter = samples // 4
    return error[:quarter].max(), error[-quarter:].max()


VARIANTS = [
    pytest.param([], id="cascade"),
    pytest.param(["drive.delay=4", "encoder.velocity_span=3", "encoder.delay=2"], id="late"),
    pytest.param(["method.velocity_integral=0 V/m"], id="P over P"),
    pytest.param(
        ["load_encoder.resolution=0 m", "method.feedback.position=load", "load_encoder.delay=3"], id="load position"
    ),
    pytest.param(PID, id="PID"),
    pytest.param(["drive.input=voltage", "motor.inductance=2 mH", "drive.voltage_gain=2"], id="voltage"),
]


@pytest.mark.compiled
@pytest.mark.parametrize("variant", VARIANTS)
def test_the_axis_swings_up_beyond_the_gain_margin_and_not_below(load_text, good_text, variant):
    base = [*FREE, *FINE, "mechanics.start_position=250 mm", *variant]
    spec = load_text(good_text, *base).spec
    margin = LinearLoop(spec).gain_margin
    assert 1.05 < margin < 100
    for factor, grows in ((0.93 * margin, False), (1.07 * margin, True)):
        drive = spec.drive
        key = "voltage_gain" if drive.input == "voltage" else "current_per_volt"
        scaled = spec.model_copy(update={"drive": drive.model_copy(update={key: getattr(drive, key) * factor})})
        first, last = swing(scaled, 1.2)
        assert (last > 2 * first) == grows, (first, last)


@pytest.mark.compiled
def test_the_slowest_mode_decays_as_the_model_says(load_text, rigid_text):
    """One sample of the model is one sample of the axis: the state of a rigid axis is followed step by step."""
    spec = load_text(
        rigid_text, *FREE, *FINE, "mechanics.start_position=250 mm", "drive.delay=2", "encoder.delay=1"
    ).spec
    p = build_cascade(spec)
    rig = Rig(p, 0.25)
    rig.r.plant.machine.motor.velocity = rig.r.plant.machine.load.velocity = 2e-3
    loop = LinearLoop(spec)
    m = loop.transition()
    state = np.zeros(len(m))
    state[1] = 2e-3
    expected = []
    for _ in range(400):
        state = m @ state
        expected.append(state[0])
    run = rig.record(400 * p.controller.sample_ticks, ["plant.machine.motor.position"], p.controller.sample_ticks)
    found = run["plant.machine.motor.position"] - 0.25
    assert np.abs(expected).max() > 5e-6
    # Viscous friction has two directions, of which the model takes the weaker.
    assert found == pytest.approx(np.array(expected), abs=0.02 * np.abs(expected).max())


def test_margins_of_a_mass_are_those_of_the_textbook(load_text, rigid_text):
    """A rigid mass under P control of velocity: crossover Kv/m, phase lost to the dead time; around it Kp."""
    spec = load_text(
        rigid_text,
        *FREE,
        *[f"mechanics.friction.{sense}.viscous=0 N*s/m" for sense in ("positive", "negative")],
        "method.velocity_integral=0 V/m",
        "encoder.velocity_filter=0 s",
        "method.position_gain=10",
    ).spec
    loop = LinearLoop(spec)
    bandwidth = spec.method.velocity_gain * spec.effort_per_command / spec.mass
    assert 2 * math.pi * loop.velocity_loop.crossover == pytest.approx(bandwidth, rel=1e-2)
    late = 2.0 * spec.method.sample_period
    assert loop.velocity_loop.phase == pytest.approx(math.pi / 2 - bandwidth * late, rel=1e-2)
    assert 2 * math.pi * loop.position_loop.crossover == pytest.approx(10.0, rel=2e-2)
    lag = math.atan(10 / bandwidth)
    assert loop.position_loop.phase == pytest.approx(math.pi / 2 - lag, rel=3e-2)


def test_a_loop_that_no_gain_settles_has_no_margin(load_text, good_text):
    spec = load_text(good_text, "method.velocity_integral=10 MV/m", "method.position_gain=100000").spec
    loop = LinearLoop(spec)
    assert loop.spectral_radius > 1
    assert loop.gain_margin < 1


def test_a_pid_has_one_loop(load_text, good_text):
    loop = LinearLoop(load_text(good_text, *PID).spec)
    assert loop.velocity_loop.crossover == 0
    assert loop.position_loop.crossover > 10
    assert loop.spectral_radius < 1


@pytest.mark.parametrize("variant", VARIANTS)
def test_matrices_and_closed_form_give_the_same_open_loops(load_text, good_text, variant):
    loop = LinearLoop(load_text(good_text, *variant).spec)
    f = usual_frequencies(loop.period)[80::12]
    inner, outer = loop._open_loops(f)
    cuts = {"velocity": inner, "position": outer} if "velocity" in loop.cuts else {}
    cuts["command"] = (1.0 + inner) * (1.0 + outer) - 1.0
    for cut, wanted in cuts.items():
        system = loop.open_loop(cut)
        assert np.array_equal(system.response(f[None]), system.quick(f)[None])
        assert np.abs(system.quick(f) - wanted) == pytest.approx(np.zeros(len(f)), abs=1e-9 * np.abs(wanted).max())
        found = replace(system, quick=None).response(f)
        assert np.abs(found - wanted) == pytest.approx(np.zeros(len(f)), abs=1e-6 * np.abs(wanted).max())
        assert found[-10:] == pytest.approx(wanted[-10:], rel=1e-6)
    # Closed at the command it is the axis: the same modes, and the same limit of its gain.
    closed = loop.open_loop("command").closed()
    assert closed.a == pytest.approx(loop.transition(), rel=1e-9, abs=1e-12)
    assert loop.open_loop("command").margins().gain == pytest.approx(loop.gain_margin, rel=1e-3)
