"""Lists of moves on both servo axes: what arrives, what fails and why, and what cannot be commanded."""

import math

import pytest

import detent
from detent.errors import InputError
from detent.methods.filtered_servo import method as filtered_method
from detent.methods.filtered_servo.host import FilteredHost
from detent.methods.filtered_servo.system import FilteredServo
from detent.methods.load import load_spec
from detent.methods.moves.job import Move, MoveJob, load_moves, text_job
from detent.methods.moves.run import run_moves, time_to_settle
from detent.methods.phase_servo import method as phase_method
from detent.methods.phase_servo.host import PhaseHost
from detent.methods.phase_servo.system import PhaseServo
from detent.record.recorder import choose_leaves

pytestmark = pytest.mark.compiled

INCH = 0.0254
PITCH = INCH / 60


def phase(*overrides):
    return PhaseHost(load_spec(detent.example("phase_servo.toml"), overrides))


def filtered(*overrides):
    return FilteredHost(load_spec(detent.example("filtered_servo.toml"), overrides))


def job(*moves):
    return MoveJob("job", "moves", tuple(Move(number=n, row=n, **move) for n, move in enumerate(moves, 1)))


@pytest.fixture(scope="module")
def moves():
    return run_moves(phase(), load_moves(detent.example("moves.csv")))


@pytest.fixture(scope="module")
def slide():
    return run_moves(filtered(), load_moves(detent.example("slide_moves.toml")))


def test_every_move_of_the_phase_servo_ends_within_a_step_of_its_positioning_point(moves):
    step = PITCH / 64
    assert moves.done, moves.failure
    assert len(moves.moves) == moves.job.count
    assert moves.worst_error < step
    assert moves.worst_overshoot < 3 * step
    for move in moves.moves:
        assert move.target / PITCH == pytest.approx(round(move.target / PITCH), abs=1e-9)
        assert move.begin <= move.switched < move.ready < move.end + 1e-12
        assert move.settled <= move.ready


def test_settling_is_counted_from_the_command_and_the_final_approach_from_the_mode_switch(moves):
    """One meaning for every method, by one function."""
    assert time_to_settle(2.0, 2.5, rested=True) == 0.5
    assert time_to_settle(2.0, 1.5, rested=True) == 0.0  # it never was outside
    assert math.isnan(time_to_settle(2.0, 2.5, rested=False))
    far = max(moves.moves, key=lambda move: move.settling)
    assert far.settling == far.settled - far.begin
    assert far.approach == far.settled - far.switched
    assert 0 < far.approach < 3e-3 < far.settling


def test_a_move_that_ends_outside_has_not_settled():
    run = run_moves(phase("clock.oscillator=16 MHz"), job({"target": 0.2 * INCH}))
    assert math.isnan(run.moves[0].settling)
    assert math.isnan(run.moves[0].approach)
    assert not math.isnan(run.moves[0].switched)


def test_what_swings_is_not_laid_to_noise():
    """At 16 MHz the speed word is worth half the damping; the failure blamed noise that the axis did not have."""
    run = run_moves(phase("clock.oscillator=16 MHz"), job({"target": 0.2 * INCH}))
    assert not run.done
    assert "beyond its target" in run.failure
    assert "more damping" in run.failure
    assert "noise" not in run.failure
    assert run_moves(phase("clock.oscillator=16 MHz", "clock.sample_tap=13"), job({"target": 0.2 * INCH})).done


def test_noise_is_named_where_there_is_some():
    burst = ["disturbance.lines.burst.kind=+", "disturbance.lines.burst.at=5 ms", "disturbance.lines.burst.count=40"]
    run = run_moves(phase(*burst), job({"target": 0.2 * INCH}))
    assert not run.done
    assert sum(run.faults.values()) == 40
    assert "pulses that noise has added or removed" in run.failure


@pytest.mark.parametrize("half_width", [1, 4])
def test_what_the_dead_band_leaves_alone_counts_as_arrived(half_width):
    """Every move was missed beyond 2 steps, though the servo is told to leave D of them alone."""
    push = ["force=9 N", "at=0.1 s", "duration=10 s"]
    over = [f"disturbance.push.{key}" for key in push]
    host = phase(f"method.dead_band={half_width}", "protection.stuck_time=0 s", *over)
    run = run_moves(host, job({"target": 0.2 * INCH, "dwell": 0.15}))
    assert run.done, run.failure
    assert host.tolerance == pytest.approx((half_width + 1) * host.spec.step)
    assert (half_width == 1) == (run.worst_error < 2 * host.spec.step)


def test_a_slide_that_stands_off_says_what_it_counts():
    """It stood half a pulse short by its true position, and the axis counts whole ones."""
    sticky = [f"mechanics.friction.{side}.static=9 N" for side in ("right", "left")]
    weak = filtered("method.in_position=0", "method.position_gain=0.2", "method.timeout=0.5 s", *sticky)
    run = run_moves(weak, job({"target": weak.home + 2e-3, "speed": 0.01}))
    assert not run.done
    # The time of its way and ramps, 0.22 s, counts too; it was told with that of the way that was left at the end.
    assert "did not arrive within 720 ms" in run.failure
    assert f"by its true position) short of it to the left, P = {weak.controller.deviation.deviation};" in run.failure
    assert weak.controller.deviation.deviation == pytest.approx(run.moves[0].error / weak.spec.pulse, abs=1)


def test_a_long_move_takes_its_time_and_peaks_at_the_tables_velocity(moves):
    long = next(move for move in moves.moves if abs(move.target - move.start) > 0.29)
    assert long.peak_speed == pytest.approx(0.346, rel=0.01)
    assert long.ready - long.begin == pytest.approx(0.898, rel=0.02)


def test_a_move_of_no_way_is_ready_at_once_and_keeps_its_place(moves):
    still = [move for move in moves.moves if abs(move.target - move.start) < PITCH / 2]
    assert len(still) == 3
    for move in still:
        assert move.ready - move.begin == pytest.approx(3e-3, abs=1e-6)


def test_the_slide_makes_all_moves_and_stands_within_its_window(slide):
    spec = filtered().spec
    assert slide.done, slide.failure
    assert slide.worst_error < 2.5 * spec.pulse
    assert all(math.isnan(move.switched) for move in slide.moves)
    rapid = slide.moves[0]
    assert rapid.peak_speed == pytest.approx(0.08, rel=0.06)


def test_the_speed_of_a_move_is_commanded(slide):
    slow = slide.moves[1]
    way = abs(slow.target - slow.start)
    assert slow.ready - slow.begin > way / 0.005


def test_a_whole_pitch_is_lost_where_the_protection_ends_and_the_run_says_so():
    """Phase-servo test 26: threshold + n beyond N/2."""
    burst = ("kind=+", "at=30 ms", "count=30")
    spec = phase(*(f"disturbance.lines.burst.{text}" for text in burst))
    found = run_moves(spec, load_moves(detent.example("moves.csv")))
    assert not found.done
    assert "on the positioning point 1 pitch off" in found.failure
    assert "63." in found.failure or "64." in found.failure
    assert found.faults["inserted"] == 30
    assert len(found.moves) == 2


def test_twenty_pulses_move_nothing():
    spec = phase(*(f"disturbance.lines.burst.{t}" for t in ("kind=+", "at=30 ms", "count=20")))
    assert run_moves(spec, load_moves(detent.example("moves.csv"))).done


def test_an_overspeed_of_the_slide_is_a_fault_with_its_cause():
    spec = filtered("limits.speed=0.2 m/s", "method.counter_bits=12").spec
    spec = spec.model_copy(update={"method": spec.method.model_copy(update={"counter_bits": 8})})
    found = run_moves(FilteredHost(spec), job({"target": 0.4}))
    assert not found.done
    assert "the speed counter was about to wrap" in found.failure
    assert math.isnan(found.moves[-1].ready)


def test_a_noisy_detector_that_never_locks_is_told():
    found = run_moves(phase("detector.jitter=300 ns"), job({"target": 0.1 * INCH}))
    assert not found.done
    assert "did not become ready" in found.failure
    assert found.moves == []


def test_a_move_that_is_held_back_does_not_arrive():
    push = [f"disturbance.push.{text}" for text in ("force=-250 N", "at=0 s", "duration=100 s")]
    found = run_moves(
        phase(*push, "protection.stuck_time=0 s", "protection.saturation_time=0 s"), job({"target": 2 * INCH})
    )
    assert not found.done
    assert "did not arrive within" in found.failure or "stands" in found.failure


def test_a_line_of_text_is_a_move_per_character():
    spec = phase()
    text = text_job("so be it", name="line.txt", pitch=INCH / 10, left_margin=INCH, hammer_time=8e-3)
    found = run_moves(spec, text)
    assert found.done, found.failure
    assert "".join(move.label for move in found.moves) == "sobeit"
    columns = [round((move.target - INCH) / (INCH / 10)) for move in found.moves]
    assert columns == [0, 1, 3, 4, 6, 7]
    assert found.worst_error < 2 * PITCH / 64


def test_the_same_seed_gives_the_same_run():
    noise = ("disturbance.lines.inserted=40 Hz", "disturbance.lines.removed=40 Hz", "detector.jitter=3 ns")
    runs = [run_moves(phase(*noise), load_moves(detent.example("moves.csv"))) for _ in range(2)]
    assert runs[0].to_dict() == runs[1].to_dict()
    assert runs[0].faults["inserted"] > 0


@pytest.mark.parametrize(
    ("spec", "move", "texts"),
    [
        (phase, {"target": 0.4}, ("job:1:1 target", "limits.travel, 355.6 mm")),
        (phase, {"target": -0.01}, ("from 0 to limits.travel",)),
        (phase, {"by": 10e-3}, ("by", "a multiple of the detector's pitch", "move to a positioning point: ")),
        (phase, {"target": 0.1 * INCH, "speed": 0.1}, ("speed", "the velocity table")),
        (phase, {"target": 0.1 * INCH, "sample_period": 0.1}, ("sample_period",)),
        (filtered, {"target": 0.6}, ("limits.travel, 500 mm",)),
        (filtered, {"target": 0.1, "speed": 0.5}, ("speed", "limits.speed, 100 mm/s")),
        (filtered, {"target": 0.1, "sample_period": 0.02}, ("sample_period", "the speed counter holds 126 pulses")),
    ],
)
def test_a_move_that_cannot_be_commanded_is_refused_before_anything_moves(spec, move, texts):
    with pytest.raises(InputError) as refused:
        run_moves(spec(), job(move))
    assert all(text in str(refused.value) for text in texts), str(refused.value)


def test_all_bad_moves_are_told_at_once_up_to_a_limit():
    with pytest.raises(InputError) as refused:
        run_moves(phase(), job(*({"target": 1.0} for _ in range(50))))
    assert len(refused.value.problems) == 20


def test_the_usual_signals_exist():
    assert len(choose_leaves(PhaseServo, phase_method.SIGNALS)) == len(phase_method.SIGNALS)
    assert len(choose_leaves(FilteredServo, filtered_method.SIGNALS)) == len(filtered_method.SIGNALS)


def test_a_retune_takes_effect_with_the_move_and_the_next_one_goes_back():
    host = filtered()
    host.start()
    for period in (2e-3, None):
        move = Move(number=1, row=1, by=1e-3, sample_period=period)
        to = host.place(move, host.home + (1e-3 if period else 2e-3))
        host.command(to)
        assert host.wait(host.time_limit(to))
        assert host.controller.clock.period == (2000 if period else 5000)


def test_progress_counts_the_moves():
    told = []
    run_moves(filtered(), job({"by": 1e-3}, {"by": 1e-3}), progress=lambda share, text: told.append((share, text)))
    assert told == [(0.5, "move 1 of 2"), (1.0, "move 2 of 2")]
