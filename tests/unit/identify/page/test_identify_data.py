"""What the figures of an identification show is what the identification says."""

from dataclasses import replace

import numpy as np
import pytest
from tests.unit.identify.page.samples import identified, rigid, trusted, unfitted

from detent.identify.page import identify_data
from detent.identify.page.identify_data import Windows, autocorrelation, hold_out, identify_report_data, windows_of


def windows(residual: list[float], place: list[int]) -> Windows:
    values = np.array(residual)
    return Windows(np.array(place) * 0.01, values, values * 0.0, values, values, np.array(place), 0.01, 0.04)


def test_the_simulation_is_that_of_the_table_of_horizons() -> None:
    (held,) = hold_out(identified())
    free = next(h for h in identified().horizons if h.name == "free run")
    assert held.rms_free == pytest.approx(free.rms, rel=1e-9)
    assert np.abs(held.free - held.measured).max() == pytest.approx(free.largest, rel=1e-9)


def test_only_the_last_quarter_is_simulated() -> None:
    (held,), (run,) = hold_out(identified()), identified().runs
    assert held.t[0] == pytest.approx(0.75 * run.t[-1], rel=0.01)
    assert held.t[-1] == pytest.approx(run.t[-1])
    assert np.array_equal(held.measured, run.position[-len(held.t) :])


def test_it_starts_again_from_the_recording() -> None:
    (held,) = hold_out(identified())
    samples = round(held.restart / (held.t[1] - held.t[0]))
    assert held.restart == pytest.approx(1.0)
    starts = np.arange(0, len(held.t), samples)
    assert len(starts) == 3
    assert np.array_equal(held.restarted[starts], held.measured[starts])
    assert held.rms_restarted < held.rms_free


def test_without_horizons_nothing_is_simulated() -> None:
    assert hold_out(replace(identified(), horizons=())) == ()
    assert hold_out(unfitted()) == ()


def test_windows_are_the_rows_of_the_regression() -> None:
    (one,) = windows_of(identified())
    fit = identified().fit
    assert fit is not None
    assert one.effort == pytest.approx(one.fitted + one.residual)
    assert np.array_equal(one.residual, fit.residual)
    assert len(one.t) == len(one.velocity) == len(fit.effort)
    assert one.place[0] == 0
    assert one.t == pytest.approx(one.t[0] + one.place * one.hop)
    assert one.width == pytest.approx((2 * fit.half + 1) * identified().runs[0].step)


def test_two_logs_share_the_rows_in_their_order() -> None:
    found = identified()
    fit = found.fit
    assert fit is not None
    twice = replace(
        found,
        runs=found.runs * 2,
        fit=replace(fit, residual=np.tile(fit.residual, 2), effort=np.tile(fit.effort, 2)),
    )
    first, second = windows_of(twice)
    assert np.array_equal(first.residual, second.residual)


def test_autocorrelation_of_alternating_residuals() -> None:
    found, pairs = autocorrelation([windows([1.0, -1.0] * 4, list(range(8)))])
    assert found[:3] == pytest.approx([1.0, -1.0, 1.0])
    assert pairs[:3].tolist() == [8.0, 7.0, 6.0]


def test_autocorrelation_does_not_reach_over_gaps_and_logs() -> None:
    parts = [windows([1.0, 1.0, -1.0], [0, 1, 5]), windows([2.0, 2.0], [0, 1])]
    found, pairs = autocorrelation(parts)
    assert pairs[:3].tolist() == [5.0, 2.0, 0.0]
    assert found[1] == pytest.approx((1.0 + 4.0) / 2 / ((1 + 1 + 1 + 4 + 4) / 5))
    assert np.isnan(found[2])


def test_the_worst_log_is_drawn() -> None:
    found = identified()
    other = replace(found.runs[0], position=found.runs[0].position * 1.2, reference=None)
    assert identify_report_data(replace(found, runs=(found.runs[0], other), logs=found.logs * 2)).shown in {0, 1}
    held = hold_out(replace(found, runs=(found.runs[0], other), logs=found.logs * 2))
    shown = identify_report_data(replace(found, runs=(found.runs[0], other), logs=found.logs * 2)).shown
    assert held[shown].rms_restarted == max(one.rms_restarted for one in held)


def test_moves_in_a_closed_loop_tell_no_response() -> None:
    assert identify_report_data(trusted()).response is None


@pytest.mark.parametrize(
    ("response", "told"),
    [
        (rigid(), True),
        (rigid(lines=8), False),
        (rigid(coherence=0.5), False),
        (rigid(rough=3.0), False),
        (rigid().within(10.0, 25.0), False),
    ],
)
def test_a_response_is_told_by_coherent_lines_that_agree(
    response: object, told: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(identify_data, "response_of", lambda *_: response)
    assert (identify_report_data(trusted()).response is response) is told


def test_a_response_that_is_given_is_shown_whatever_it_tells() -> None:
    given = rigid(coherence=0.1)
    assert identify_report_data(trusted(), response=given).response is given


def test_titles_are_the_names_of_the_logs() -> None:
    assert identify_report_data(trusted()).title == "run <1>.csv"
    assert identify_report_data(trusted(), "slide").title == "slide"
    two = replace(unfitted(), logs=unfitted().logs * 3, runs=unfitted().runs * 3)
    assert identify_report_data(two).title == "run <1>.csv and 2 more"
