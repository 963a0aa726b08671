"""Frequency response from a recording: what an axis answers to each frequency.

A periodic excitation is averaged over its periods (`average_periods`), any other over windows
(`average_windows`). Both assume an axis that stays as it is through the recording. Dry friction and
backlash are no noise: they come back in each period, so that neither coherence nor scatter show them.
"""

from dataclasses import replace

from detent.errors import DetentError
from detent.identify.analyse.average_periods import average_periods
from detent.identify.analyse.average_windows import FEWEST_ROWS, average_windows
from detent.identify.analyse.excitation_period import cut_periods
from detent.identify.analyse.frequency_response import FrequencyResponse
from detent.logs.log import Log, Values
from detent.logs.stamps import stretches


def measure_response(
    t: Values, excitation: Values, answer: Values, *, period: float | None = None, settle: int = 1
) -> FrequencyResponse:
    """Measure a frequency response, by periods where the excitation has some, otherwise by windows."""
    t, excitation, answer = _longest_stretch(t, excitation, answer)
    periods = cut_periods(t, excitation, [answer], period)
    if periods is not None and len(periods.signals[0]) >= settle + 2:
        return average_periods(periods, settle)
    if period is not None:
        raise DetentError(
            f"identify: came a recording of {t[-1] - t[0]:g} s; allowed: {settle + 2} periods of {period:g} s or more, "
            f"the first {settle} to settle; record more periods"
        )
    return average_windows(t, excitation, answer)


def response_of(
    log: Log, effort: str | None = None, position: str = "position", *, period: float | None = None
) -> FrequencyResponse:
    """Measure the response of the position to the effort in a log."""
    chosen = log.effort(effort or "")
    log.need(position)
    found = measure_response(log.t, log.signals[chosen], log.signals[position], period=period)
    return replace(found, input_unit=log.units.get(chosen, ""), output_unit=log.units.get(position, ""))


def _longest_stretch(t: Values, excitation: Values, answer: Values) -> tuple[Values, Values, Values]:
    """The longest part without a gap."""
    if not len(t) == len(excitation) == len(answer) or len(t) < FEWEST_ROWS:
        raise DetentError(
            f"identify: came {len(t)} times, {len(excitation)} values of the input, {len(answer)} of the output; "
            f"allowed: as many of each, {FEWEST_ROWS} or more; record longer"
        )
    part = max(stretches(t), key=lambda part: part.stop - part.start)
    if part.stop - part.start < FEWEST_ROWS:
        raise DetentError(
            f"identify: came {part.stop - part.start} samples between two gaps; allowed: {FEWEST_ROWS} or more; record "
            "without missing rows"
        )
    return t[part], excitation[part], answer[part]
