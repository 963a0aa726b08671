"""Frequency responses of two masses whose constants are known: computed with noise, or recorded from a cascade axis."""

from dataclasses import replace

import numpy as np

from detent.identify.analyse.measure_response import FrequencyResponse, noise_parts, response_deviation
from detent.identify.analyse.response_fit import TwoMassModel, respond_sampled
from detent.methods.cascade.system import set_count
from tests.cascade_rig import SAMPLE_TICKS, T_SAMPLE, Rig, make_params, set_friction


def random_axis(rng):
    """Parameters of `respond_sampled` for a random axis, and what a fit should find."""
    mass, ratio, fz = rng.uniform(0.5, 10), np.exp(rng.uniform(-1.5, 1.5)), rng.uniform(20, 60)
    damping_zero = np.exp(rng.uniform(np.log(0.005), np.log(0.08)))
    m2, omega = ratio / (1 + ratio), 2 * np.pi * fz
    d = 2 * damping_zero * omega * m2 * rng.uniform(0.2, 0.9)
    b1, b2 = rng.uniform(0.5, 8), 2 * damping_zero * omega * m2 - d
    delay = rng.uniform(0, 3e-3)
    parameters = np.array([np.log(ratio), np.log(omega), d, b1, b2, -np.log(mass), delay])
    modes = TwoMassModel().tell(parameters)
    truth = {
        "antiresonance": fz,
        "antiresonance.damping": damping_zero,
        "resonance": modes["resonance"],
        "resonance.damping": modes["resonance.damping"],
        "mass_ratio": ratio,
        "viscous": b1 + b2,
        "gain": 1 / mass,
        "delay": delay,
        "mass.total": mass,
        "mass.motor": mass * (1 - m2),
        "mass.load": mass * m2,
        "stiffness": mass * m2 * omega**2,
        "damping": mass * d,
    }
    return parameters, truth


def noisy_responses(seed, *, periods=8, lines=60, noise=0.02, kept=8.0):
    """Responses of motor and load of a random axis, their truth and the hold.

    As average_periods makes them: every period has noise of the sensors, and a disturbance that both encoders see.
    """
    rng = np.random.default_rng(seed)
    parameters, truth = random_axis(rng)
    frequency = np.linspace(2.0, 2.5 * truth["resonance"], lines)
    hold = 1 / (kept * truth["resonance"])
    exact = respond_sampled(TwoMassModel(2), parameters, frequency, hold)
    white = rng.normal(size=(3, periods, lines)) + 1j * rng.normal(size=(3, periods, lines))
    level = 10 * noise * np.abs(exact[0]).min()
    found = []
    for answer, own in zip(exact, white[:2], strict=True):
        values = answer * (1 + 3 * noise * white[2]) + level * own
        mean = values.mean(axis=0)
        scatter = np.sum(np.abs(values - mean) ** 2, axis=0) / (periods - 1)
        power = np.abs(mean) ** 2
        flat, slope = noise_parts(scatter, power, max(8, -(-40 // (periods - 1))))
        coherence = 1 / (1 + flat / power + slope)
        deviation = response_deviation(coherence, periods)
        found.append(FrequencyResponse(frequency, mean, coherence, deviation, periods, 0.0, "made", "N", "m"))
    return found, truth, hold


def multisine(band, step, size, seed):
    """A second with a line at each whole number of hertz within a band, all alike, with random phases."""
    rows = round(1.0 / step)
    numbers = np.arange(round(band[0]), round(band[1]) + 1)
    spectrum = np.zeros(rows // 2 + 1, dtype=np.complex128)
    spectrum[numbers] = np.exp(1j * np.random.default_rng(seed).uniform(0.0, 2.0 * np.pi, len(numbers)))
    once = np.fft.irfft(spectrum, rows)
    once *= size / np.abs(once).max()
    return np.roll(once, -int(np.argmin(np.abs(once))))


def record_cascade(seed, *, delay=2, coulomb=0.0, resolution=0.0, coupled=True, periods=8, band=(1.0, 200.0)):
    """A multisine of 20 N into a cascade axis without its loops: times, effort, both positions."""
    command = np.tile(multisine(band, T_SAMPLE, 20.0, seed), periods)
    p = make_params(coupled=coupled)
    p.plant.source.delay = delay
    set_count(p, resolution, resolution)
    set_friction(p.plant.machine.motor.friction, viscous=3.0)
    set_friction(p.plant.machine.load.friction, viscous=5.0, coulomb=coulomb, static=coulomb)
    names = ["plant.source.command", "controller.motor_sensor.position", "controller.load_sensor.position"]
    rows = Rig(p).record(len(command) * SAMPLE_TICKS, names, SAMPLE_TICKS, command=command)
    return rows["t"], *(rows[name] for name in names)


def within(response, low, high):
    """The part of a response between two frequencies [Hz], both included."""
    inside = (response.frequency >= low) & (response.frequency <= high)
    series = ("frequency", "response", "coherence", "deviation")
    return replace(response, **{name: getattr(response, name)[inside] for name in series})
