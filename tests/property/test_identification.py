"""For every unit, direction and clock: the constants of an axis are those of the axis, not of how it was recorded."""

from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.identify_rig import TRUTH, Recorder, changed

from detent.identify.fit.identification import identify

pytestmark = pytest.mark.compiled

FEW = settings(max_examples=6)

factors = st.floats(-3.0, 3.0).map(lambda exponent: 10.0**exponent)

RECORDERS = {
    "each direction its own": Recorder(seconds=5.0, delay=0.003, force_noise=0.05),
    "sticky": Recorder(seconds=5.0, force_noise=0.05, excess=1.0, stribeck=0.05),
    "coarse counts": Recorder(TRUTH, 5.0, force_noise=0.02, count=5e-5),
}
recorders = st.sampled_from(sorted(RECORDERS))
references = st.booleans()

_MADE = {}


def identified(name, with_reference):
    """The recording as it is, once."""
    if (name, with_reference) not in _MADE:
        log = RECORDERS[name].log(with_reference=with_reference)
        _MADE[name, with_reference] = log, identify([log])
    return _MADE[name, with_reference]


def assert_constants(found, expected):
    """The same names, with these values and errors."""
    assert {e.name for e in found.estimates} == set(expected)
    for e in found.estimates:
        value, error = expected[e.name]
        assert e.value == pytest.approx(value, rel=1e-4, abs=1e-3 * error), e.name
        assert e.error == pytest.approx(error, rel=1e-3), e.name


def scaled(found, scale):
    """Values and errors times a factor by the kind of the constant."""
    return {e.name: (e.value * scale(e.name), e.error * scale(e.name)) for e in found.estimates}


@FEW
@given(name=recorders, with_reference=references, factor=factors)
def test_an_effort_times_a_factor_is_an_axis_times_that_factor(name, with_reference, factor):
    log, plain = identified(name, with_reference)
    found = identify([changed(log, force=factor * log.signals["force"])])
    assert found.verdict == plain.verdict
    assert_constants(found, scaled(plain, lambda n: 1.0 if n in {"delay", "stribeck"} else factor))


@FEW
@given(name=recorders, with_reference=references, factor=factors)
def test_a_position_times_a_factor_is_an_axis_divided_by_it(name, with_reference, factor):
    log, plain = identified(name, with_reference)
    moved = {n: factor * log.signals[n] for n in ("position", "reference") if n in log.signals}
    found = identify([changed(log, **moved)])
    assert found.verdict == plain.verdict

    def scale(constant):
        if constant == "stribeck":
            return factor
        return 1.0 / factor if constant == "mass" or constant.startswith("viscous") else 1.0

    assert_constants(found, scaled(plain, scale))


def swapped(name):
    """The same constant of the other direction."""
    if name.endswith("positive"):
        return name.replace("positive", "negative")
    return name.replace("negative", "positive")


@pytest.mark.parametrize("name", RECORDERS)
@pytest.mark.parametrize("with_reference", [True, False])
def test_a_mirror_swaps_the_directions(name, with_reference):
    log, plain = identified(name, with_reference)
    found = identify([changed(log, **{n: -values for n, values in log.signals.items()})])
    assert found.verdict == plain.verdict
    assert_constants(found, {swapped(e.name): (e.value, e.error) for e in plain.estimates})


@FEW
@given(name=recorders, with_reference=references, start=st.floats(-1e3, 1e3), place=st.floats(-10.0, 10.0))
def test_when_and_where_it_was_recorded_does_not_matter(name, with_reference, start, place):
    log, plain = identified(name, with_reference)
    count = RECORDERS[name].count or 1e-6
    place = count * round(place / count)
    moved = {n: log.signals[n] + place for n in ("position", "reference") if n in log.signals}
    found = identify([replace(changed(log, **moved), t=log.t + start)])
    assert found.verdict == plain.verdict
    assert_constants(found, {e.name: (e.value, e.error) for e in plain.estimates})


@FEW
@given(name=recorders, factor=factors)
def test_the_way_that_is_simulated_wrong_scales_with_the_position(name, factor):
    log, plain = identified(name, with_reference=True)
    moved = {n: factor * log.signals[n] for n in ("position", "reference")}
    found = identify([changed(log, **moved)])
    for ours, theirs in zip(plain.horizons, found.horizons, strict=True):
        assert theirs.name == ours.name
        assert theirs.rms == pytest.approx(factor * ours.rms, rel=0.02)
        assert theirs.naive == pytest.approx(factor * ours.naive, rel=1e-6)
