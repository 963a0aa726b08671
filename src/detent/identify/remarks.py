"""What to know about constants that are right by the numbers, and would be read wrongly: each in a sentence."""

from collections.abc import Iterator, Mapping

from detent.errors import DetentError
from detent.identify.analyse.two_speeds import fit_two_speeds
from detent.identify.fit.estimate import Estimate
from detent.identify.fit.identification import Identification
from detent.identify.fit.ladder import chosen_climb
from detent.identify.page.words import written
from detent.logs.log import Log
from detent.page.words import GAP
from detent.units import format_quantity

UNEXPLAINED = 0.05  # effort that one mass leaves unexplained from which on a second one is looked for


def remarks_of(found: Identification) -> tuple[str, ...]:
    """Remarks about the constants of an identification."""
    named = {one.name: one for one in found.estimates}
    told = list(early(named))
    told += two_masses(found)
    if len(found.runs) == 1:  # constants of several logs are those of none alone
        told += friction_remarks(found.logs[0], found.runs[0].effort_name, named)
    return tuple(one.replace(GAP, " ") for one in told)


def two_masses(found: Identification) -> Iterator[str]:
    """A log that one mass does not explain, and two masses do, by its frequency response."""
    error = chosen_climb(found.climbs).error if found.climbs else 1.0
    if error < UNEXPLAINED:
        return
    # Loaded for the few logs that need them.
    from detent.identify.analyse.analyses import analyse
    from detent.identify.analyse.measure_response import told_response

    for log, run in zip(found.logs, found.runs, strict=True):
        if told_response(log, run.effort_name, is_open=run.reference is None) is None:
            continue
        answer = analyse(log, "frequency", run.effort_name)
        seen = {one.name: format_quantity(one.value, "Hz", 3) for one in answer.estimates if one.unit == "Hz"}
        if answer.reason or "antiresonance" not in seen:
            continue
        yield (
            f"this is two masses: {log.name} shows an anti-resonance at {seen['antiresonance']} and a resonance at "
            f"{seen['resonance']}, and one mass leaves {error:.0%} of the effort unexplained; try: detent analyse "
            f"{log.name} --what frequency"
        )
        return


def early(constants: Mapping[str, Estimate]) -> Iterator[str]:
    """A delay below 0, which no drive has."""
    delay = constants.get("delay")
    if delay is None or delay.value >= 0.0:
        return
    if delay.high >= 0.0:
        yield f"delay {written(delay)}: not significantly different from 0"
        return
    yield (
        f"delay {written(delay)}: negative, which is not causal: effort and position have inconsistent time stamps, "
        "the position was filtered, or the model lacks something that looks like a delay (a compliant coupling, "
        "low-speed friction); 0 is written to axis files; try: record both with the same clock, or take the "
        "delay from a frequency response (detent analyse --what frequency)"
    )


def friction_remarks(log: Log, effort: str, constants: Mapping[str, Estimate]) -> Iterator[str]:
    """Where steady speeds alone tell another friction than all of the motion does."""
    try:
        steady = fit_two_speeds(log, effort)
    except DetentError:
        return
    for line in (steady.positive, steady.negative):
        whole = constants.get(f"viscous.{line.direction}")
        if line.slope is None or whole is None or whole.unit != line.slope.unit or _overlap(line.slope, whole):
            continue
        speeds = [abs(stretch.speed) for stretch in line.stretches]
        unit = f"{log.units['position']}/s" if "position" in log.units else log.units.get("velocity", "")
        yield (
            f"viscous friction in {line.direction} direction: {written(whole)} from all motion (detent identify), "
            f"{written(line.slope)} from the constant speeds from {min(speeds):.3g} to {max(speeds):.3g} {unit} alone "
            "(detent analyse): friction is not linear in speed, and each fits its own range; use the first to "
            "simulate all speeds, the second between these speeds"
        )


def _overlap(one: Estimate, other: Estimate) -> bool:
    return one.low <= other.high and other.low <= one.high
