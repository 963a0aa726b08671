"""Winding: known constants come back with intervals that hold, and what data cannot tell apart is said."""

import numpy as np
import pytest
from scipy.signal import lfilter
from tests.log_rig import assert_covers, coloured, make_log, quantised

from detent.errors import DetentError
from detent.identify.analyse.winding import fit_winding
from detent.logs.log import Source

DT = 2.5e-4
TRUE = {"resistance": 2.0, "inductance": 2e-3, "back_emf_constant": 0.05, "voltage_offset": 0.1}


def record(rng, count=2500, noise=0.05, speed=None, is_still=False, **changed):
    """Random steps of the voltage at a winding: position, voltage and current as they would be sampled.

    The speed follows the voltage as that of a motor does, unless another is given.
    """
    true = TRUE | changed
    u = np.repeat(rng.uniform(-6, 6, count // 40 + 1), 40)[:count]
    v = lfilter([0.01], [1, -0.99], u) / 0.06 if speed is None else speed
    v = np.zeros(count) if is_still else v
    a = np.exp(-true["resistance"] * DT / true["inductance"])
    drive = u - true["back_emf_constant"] * v - true["voltage_offset"]
    i = np.r_[0.0, lfilter([(1 - a) / true["resistance"]], [1, -a], drive)][:count]
    signals = {
        "position": quantised(np.r_[0.0, np.cumsum(v)][:count] * DT, 2 * np.pi / 8000),
        "voltage": u,
        "current": quantised(i + coloured(rng, count, noise, 0.5), 0.01),
    }
    return np.arange(count) * DT, signals, i, v


def turning(t, signals, **more):
    return make_log(t, {"position": "rad", "velocity": "rad/s"}, **signals, **more)


def values(found):
    return {one.name: one.value for one in found.estimates}


def test_known_constants_come_back():
    t, signals, _, _ = record(np.random.default_rng(1), count=8000)
    found = fit_winding(turning(t, signals))
    assert (found.reason, found.notes) == ("", ())
    assert values(found) == pytest.approx(TRUE | {"torque_constant": 0.05}, rel=0.02)
    assert [one.unit for one in found.estimates] == ["ohm", "H", "V*s/rad", "V", "N*m/A"]
    assert "conservation of energy" in found.torque_constant.method
    assert 0.02 < found.relative_error < 0.1


@pytest.mark.wide
def test_intervals_hold_the_true_value_as_often_as_they_say():
    hits = {name: [] for name in TRUE}
    for seed in range(200):
        t, signals, _, _ = record(np.random.default_rng(seed))
        for one in fit_winding(turning(t, signals)).estimates[:4]:
            hits[one.name].append(one.holds(TRUE[one.name]))
    for name in TRUE:
        assert len(hits[name]) == 200
        assert_covers(hits[name])


def test_noise_of_the_current_does_not_make_the_inductance_smaller():
    """Ten times the noise: least squares of the same equation is off by half, the instruments are not."""
    t, signals, _, _ = record(np.random.default_rng(2), count=20_000, noise=0.5)
    found = fit_winding(turning(t, signals))
    assert found.inductance.holds(TRUE["inductance"])
    assert found.inductance.value == pytest.approx(TRUE["inductance"], rel=0.1)
    i, u, x = signals["current"], signals["voltage"], signals["position"]
    columns = np.column_stack([i[:-1], u[:-1], np.diff(x) / DT, np.ones(len(t) - 1)])
    pole = np.linalg.lstsq(columns, i[1:], rcond=None)[0][0]
    assert -2.0 * DT / np.log(pole) < 0.7 * TRUE["inductance"]


def test_a_locked_rotor_gives_resistance_and_inductance_only():
    t, signals, _, _ = record(np.random.default_rng(3), is_still=True)
    found = fit_winding(turning(t, signals))
    assert set(values(found)) == {"resistance", "inductance", "voltage_offset"}
    assert found.resistance.holds(2.0)
    assert found.inductance.value == pytest.approx(2e-3, rel=0.05)
    hits = []
    for seed in range(100):
        t, signals, _, _ = record(np.random.default_rng(seed), count=1500, is_still=True)
        hits += [one.holds(TRUE[one.name]) for one in fit_winding(turning(t, signals)).estimates]
    assert_covers(hits)


def test_a_measured_torque_gives_the_torque_constant():
    rng = np.random.default_rng(4)
    t, signals, i, v = record(rng, count=4000)
    torque = 0.048 * i - 0.002 + coloured(rng, len(t), 0.01, 0.9)
    log = turning(t, signals, torque=torque)
    found = fit_winding(log)
    assert found.torque_constant.holds(0.048)
    assert found.torque_constant.unit == "N*m/A"
    assert found.torque_constant.error < 0.001
    log.columns.update(torque=Source("i", "A", 0.05), current=Source("i", "A", 1.0))
    assert "conservation of energy" in fit_winding(log).torque_constant.method
    straight = make_log(t, velocity=v, voltage=signals["voltage"], current=signals["current"])
    assert fit_winding(straight).torque_constant.unit == "N/A"
    counted = make_log(t, {"position": "count"}, **signals)
    assert fit_winding(counted).torque_constant is None
    assert fit_winding(counted).back_emf_constant.unit == "V*s/count"


def test_a_speed_proportional_to_the_current_is_said():
    """A brake whose torque grows with the speed, at a negligible mass: v = 20 i at every moment."""
    rng = np.random.default_rng(5)
    t, signals, i, _ = record(rng, is_still=True, resistance=3.0)
    signals["position"] = np.r_[0.0, np.cumsum(10 * (i[:-1] + i[1:]))] * DT
    found = fit_winding(turning(t, signals))
    # As if R were 2 and ke 0.05: only their sum R + 20 ke = 3 is seen.
    assert found.resistance is None
    assert found.back_emf_constant is None
    assert found.apparent_resistance.name == "resistance.apparent"
    assert found.apparent_resistance.value == pytest.approx(3.0, rel=0.01)
    assert "cannot be separated" in found.notes[0]


def test_a_constant_speed_is_said():
    t, signals, _, _ = record(np.random.default_rng(6), speed=np.full(2500, 30.0))
    found = fit_winding(turning(t, signals))
    assert set(values(found)) == {"resistance", "inductance"}
    assert found.resistance.holds(2.0)
    assert "the speed is constant" in found.notes[0]


def test_a_speed_too_low_for_a_back_emf_is_said():
    t, signals, _, _ = record(np.random.default_rng(7), speed=0.05 * np.sin(np.arange(2500) / 100))
    found = fit_winding(turning(t, signals))
    assert found.back_emf_constant is None
    assert found.resistance.holds(2.0)
    assert "record higher speeds" in found.notes[0]


def test_an_inductance_that_settles_within_a_sample_is_only_bounded():
    t, signals, _, _ = record(np.random.default_rng(8), noise=0.3, inductance=5e-5)
    found = fit_winding(turning(t, signals))
    assert found.inductance is None
    assert found.resistance.holds(2.0)
    limit = float(found.notes[0].split("below ")[1].split(" H")[0])
    assert 5e-5 < limit < 3e-4


def test_a_voltage_that_acts_later_is_said():
    t, signals, _, _ = record(np.random.default_rng(9), noise=0.02)
    signals["voltage"] = np.r_[signals["voltage"][1:], 0.0]
    assert "a voltage that acts a sample later" in fit_winding(turning(t, signals)).notes[-1]


def test_signs_that_do_not_fit_are_refused():
    t, signals, _, _ = record(np.random.default_rng(10))
    assert "the resistance is negative" in fit_winding(turning(t, signals | {"current": -signals["current"]})).reason
    assert "invert one" in fit_winding(turning(t, signals | {"position": -signals["position"]})).reason


def test_what_says_nothing_about_a_winding_has_a_reason():
    rng = np.random.default_rng(11)
    t, signals, _, _ = record(rng)
    u, i = signals["voltage"], signals["current"]
    assert "cannot be separated" in fit_winding(make_log(t, voltage=u, current=i)).reason
    assert "record longer" in fit_winding(make_log(t[:60], velocity=u[:60], voltage=u[:60], current=i[:60])).reason
    assert "voltage is constant" in fit_winding(make_log(t, velocity=u, voltage=0 * u + 1, current=i)).reason
    uneven = t + 0.3 * DT * rng.uniform(-1, 1, len(t))
    assert "sample evenly" in fit_winding(make_log(uneven, velocity=u, voltage=u, current=i)).reason
    noise = make_log(t, velocity=u, voltage=u, current=rng.standard_normal(len(t)))
    found = fit_winding(noise)
    assert found.reason
    assert found.estimates == ()


def test_what_drowns_in_noise_is_not_given():
    t, signals, _, _ = record(np.random.default_rng(12), count=400, is_still=True)
    rng = np.random.default_rng(13)
    quiet = signals | {"current": signals["current"] + 30 * rng.standard_normal(len(t))}
    assert fit_winding(turning(t, quiet)).estimates == ()
    slow = np.repeat([0.0, 2.0], 200)
    pole = np.exp(-2.0 * DT / 2e-3)
    i = lfilter([(1 - pole) / 2.0], [1, -pole], slow) + 0.8 * rng.standard_normal(len(t))
    found = fit_winding(turning(t, {"position": 0 * t, "voltage": slow, "current": i}))
    assert found.resistance.holds(2.0)
    assert found.inductance is None
    assert found.notes


def test_a_record_without_noise_gives_its_constants_and_a_proportional_speed_is_seen_there_too():
    t, signals, i, v = record(np.random.default_rng(14), noise=0.0)
    exact = {"voltage": signals["voltage"], "current": i, "position": np.r_[0.0, np.cumsum(v)][:-1] * DT}
    assert values(fit_winding(turning(t, exact))) == pytest.approx(TRUE | {"torque_constant": 0.05}, rel=1e-3)
    t, signals, i, _ = record(np.random.default_rng(14), is_still=True, resistance=3.0)
    tied = {"voltage": signals["voltage"], "current": i, "position": np.r_[0.0, np.cumsum(10 * (i[1:] + i[:-1]))] * DT}
    found = fit_winding(turning(t, tied))
    assert found.resistance is None
    assert found.apparent_resistance.value == pytest.approx(3.0, rel=0.01)


def test_a_gap_parts_the_record():
    t, signals, _, _ = record(np.random.default_rng(15), count=5000)
    kept = np.r_[0:2000, 2050:2100, 2500:5000]
    found = fit_winding(turning(t[kept], {role: series[kept] for role, series in signals.items()}))
    assert values(found) == pytest.approx(TRUE | {"torque_constant": 0.05}, rel=0.04)


def test_wrong_input_is_an_error():
    t, signals, _, _ = record(np.random.default_rng(1))
    with pytest.raises(DetentError, match="name the column: current=COLUMN"):
        fit_winding(make_log(t, voltage=signals["voltage"]))
