"""Timing diagrams of all three methods: every clock of a stretch, the same bits as a run that nobody watches."""

import numpy as np
import pytest
from tests.vcd_reader import load_vcd

import detent
from detent.errors import DetentError
from detent.methods.load import load_spec
from detent.methods.registry import METHODS
from detent.record.capture import capture
from detent.record.waveforms import save_vcd

pytestmark = pytest.mark.compiled

STRETCHES = {
    "print_head.toml": (1.0, 4e-3),
    "phase_servo.toml": (6e-3, 20e-6),
    "filtered_servo.toml": (30e-3, 400e-6),
}


def captured(name, at=None, duration=None, signals=None, overrides=()):
    spec = load_spec(detent.example(name), overrides)
    method = METHODS[spec.axis.method].simulated(spec)
    begin, length = STRETCHES[name]
    job = method.sample_job()
    return capture(
        method.registers,
        method.clocking,
        method.tick,
        lambda recorder: method.run(job, recorder=recorder),
        at=begin if at is None else at,
        duration=length if duration is None else duration,
        signals=signals or method.timing,
        title=spec.axis.name,
    )


def at_times(waveform, times):
    """Value of a waveform at moments [ps]."""
    return waveform.values[np.searchsorted(waveform.times, times, side="right") - 1]


@pytest.mark.parametrize("name", STRETCHES)
def test_a_capture_spans_its_stretch_and_shows_what_was_asked(name):
    found = captured(name)
    begin, length = STRETCHES[name]
    assert found.begin == round(begin * 1e12)
    assert found.end == round((begin + length) * 1e12)
    names = [signal.name for signal in found.signals]
    method = detent.load(detent.example(name)).simulated
    assert [*(method.clocking.clocks or {}), *method.timing] == names


@pytest.mark.parametrize("name", STRETCHES)
def test_a_vcd_file_of_a_capture_reads_back_as_it_was(name, tmp_path):
    found = captured(name)
    save_vcd(found, tmp_path / "timing.vcd")
    back = load_vcd(tmp_path / "timing.vcd")
    assert {signal.name for signal in back.signals} == {signal.name for signal in found.signals}
    for signal in found.signals:
        again = back[signal.name]
        np.testing.assert_array_equal(again.times, signal.times)
        # A float has 16 digits in VCD.
        np.testing.assert_allclose(again.values, signal.values, rtol=4e-16 if signal.is_float else 0)


def test_the_clocks_of_the_phase_servo_alternate_and_its_reference_counts_with_them():
    found = captured("phase_servo.toml")
    one, two = found["controller.clocks.CK1"], found["controller.clocks.CK2"]
    rises = [w.times[w.values == 1] for w in (one, two)]
    assert np.all(np.diff(rises[0]) == 250_000)
    np.testing.assert_array_equal(rises[0] + 125_000, rises[1])
    reference, plus = (found[f"controller.converters.tracking.{name}"] for name in ("reference", "plus"))
    steps = np.diff(reference.values.astype(int)) % 64
    assert set(steps.tolist()) == {1}
    # One step per first clock, and one more where a + pulse comes with the second.
    pulses = int((plus.values == 1).sum())
    assert pulses >= 1
    assert len(reference.values) == len(rises[0]) + pulses


def test_a_plus_pulse_lies_in_the_second_clock_after_the_gate():
    found = captured("phase_servo.toml")
    plus, two = found["controller.converters.tracking.plus"], found["controller.clocks.CK2"]
    pulses = plus.times[plus.values == 1]
    assert np.all(at_times(two, pulses) == 1)
    assert np.all(at_times(found["controller.converters.tracking.gate"], pulses) == 1)
    assert np.all(at_times(found["controller.converters.tracking.ps_first"], pulses) == 1)


def test_the_request_of_the_pwm_follows_sawtooth_and_word_in_both_halves_of_a_tick():
    names = ("controller.pwm.sawtooth", "lines.request", "controller.law.word")
    found = captured("phase_servo.toml", at=30e-3, duration=64e-6, signals=names)
    sawtooth, request, words = (found[name] for name in names)
    moments = np.arange(found.begin, found.end, 125_000)
    s = at_times(sawtooth, moments).astype(int)
    assert set(np.diff(s).tolist()) == {1, -255}
    word = at_times(words, moments + 124_999).astype(int)
    # The word of a tick is worked out before its first period; the moments within a tick at which it shows differ.
    steady = word == np.roll(word, 2)
    np.testing.assert_array_equal(np.sign(word - s)[steady], at_times(request, moments)[steady])


def test_each_clock_of_the_decoder_shows_and_a_pulse_is_one_clock_long():
    found = captured("filtered_servo.toml", duration=2e-3)
    forward, a1, a2 = (found[f"controller.decoder.{name}"] for name in ("forward", "a1", "a2"))
    rises, falls = forward.times[forward.values == 1], forward.times[forward.values == 0][1:]
    assert len(rises) >= 3
    np.testing.assert_array_equal(falls - rises, np.full(len(rises), 1_000_000))
    np.testing.assert_array_equal(a2.times[1:], a1.times[1:] + 1_000_000)
    count = found["controller.deviation.deviation"]
    assert all(int(t) in count.times for t in falls)  # the counter takes the pulse at the next clock


WATCHED = ("plant.train.position", "plant.train.velocity", "plant.train.current")


@pytest.mark.parametrize(
    ("name", "delay"), [("print_head.toml", 0), ("phase_servo.toml", 0), ("filtered_servo.toml", 1)]
)
def test_watching_changes_nothing(name, delay):
    """A trace of every tick of the job passes through the same values; a decoder clock sees its tick begin."""
    method = detent.load(detent.example(name)).simulated
    found = captured(name, signals=WATCHED)
    trace = detent.load(detent.example(name)).run(method.sample_job(), signals=WATCHED, every=1).trace
    end = round(sum(STRETCHES[name]) / method.tick)
    row = int(np.flatnonzero(np.rint(trace.time / method.tick) == end - delay)[0])
    assert all(trace[signal][row] == found[signal].values[-1] for signal in WATCHED)


@pytest.mark.parametrize(
    ("at", "duration", "text"),
    [
        (-1.0, 1e-6, "expected: a moment from 0 s"),
        (0.0, 0.0, "expected: a moment from 0 s"),
        (0.0, 1.0, "up to 50 ms"),
        (10.0, 1e-6, "the run ends before 10 s"),
    ],
)
def test_a_stretch_that_cannot_be_shown_is_refused_with_what_to_do(at, duration, text):
    with pytest.raises(DetentError, match=text):
        captured("phase_servo.toml", at=at, duration=duration)


def test_an_unknown_signal_names_the_nearest():
    with pytest.raises(DetentError, match=r"did you mean .lines\.plus"):
        captured("phase_servo.toml", signals=("lines.plu",))
