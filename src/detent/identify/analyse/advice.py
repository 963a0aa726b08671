"""What to do with the answer to a question: a sentence for each, or what to record where there is none."""

from collections.abc import Callable, Mapping
from typing import Any

from detent.identify.fit.estimate import Estimate
from detent.units import format_quantity

BELOW = 0.5  # bandwidth of a velocity loop over the first anti-resonance, or resonance, by the usual rule
FEWEST = 6  # speeds of a map, both directions, below which no dip could show
LARGE = 0.1  # overshoot over the way of a move from which it is worth a word
Found = Mapping[str, Estimate]


def advise(name: str, estimates: tuple[Estimate, ...], reason: str, details: Mapping[str, Any]) -> str:
    """What to do with an answer."""
    if reason:
        return f"{'nothing usable' if estimates else 'no result'}: {reason}"
    return _ADVICE[name]({one.name: one for one in estimates}, details)


def _value(one: Estimate, digits: int = 4) -> str:
    return format_quantity(one.value, one.unit, digits)


def _two_speeds(found: Found, details: Mapping[str, Any]) -> str:
    ways: list[str] = []
    for way in ("positive", "negative"):
        if f"slope.{way}" in found:
            speeds = [abs(one["speed"]) for one in details[way]["stretches"]]
            slope, coulomb = found[f"slope.{way}"], found[f"coulomb.{way}"]
            between = f"{min(speeds):.3g} to {max(speeds):.3g}"
            ways.append(f"{way} {_value(coulomb)} and {slope.value:.4g} {slope.unit} ({between} in SI units of speed)")
    return f"friction: use {'; '.join(ways)}; not for standstill, which steady speeds do not show"


def _friction_map(found: Found, details: Mapping[str, Any]) -> str:
    dips = [dip for dip in details["dips"] if dip["is_found"]]
    if len(found) < FEWEST:
        few = "too few to show a dip at low speed: record slower passes too"
        return f"friction: use it at these {len(found)} speeds; {few}"
    if not dips:
        return f"friction: no dip at low speed in {len(found)} speeds; Coulomb and viscous friction are sufficient"
    speeds = " and ".join(f"{dip['direction']} up to {abs(dip['speed']):.3g}" for dip in dips)
    unit = details["speed_unit"]
    return f"friction decreases with speed ({speeds} {unit}): state static friction and stribeck, as it can stick-slip"


def _winding(found: Found, details: Mapping[str, Any]) -> str:
    del details
    return f"motor: state {', '.join(f'{one.name} = {one.value:.4g} {one.unit}' for one in found.values())}"


def _frequency(found: Found, details: Mapping[str, Any]) -> str:
    del details
    if "resonance" not in found:
        return "no resonance in this band: the axis can be treated as rigid up to its upper limit"
    resonance, lowest = found["resonance"], found.get("antiresonance", found["resonance"])
    which = "anti-resonance" if "antiresonance" in found else "resonance"
    limit = format_quantity(BELOW * lowest.value, "Hz", 2)
    return (
        f"resonance {_value(resonance, 3)}: keep the velocity-loop bandwidth below {limit}, half the {which} "
        f"{_value(lowest, 3)}, or state both masses and the stiffness and check the margins with detent check"
    )


def _steps(found: Found, details: Mapping[str, Any]) -> str:
    moves = details["moves"]
    worst = max((abs(move["overshoot"] / move["way"]) for move in moves if move["overshoot"]), default=0.0)
    rests = [(abs(one.value), one.unit) for name, one in found.items() if name.endswith("rest_error")]
    told = [f"{sum(move['times'] for move in moves)} moves of {len(moves)} kinds"]
    if any(move["is_profile"] for move in moves):
        told.append(
            "the reference is a profile, so rise time and overshoot describe the end of the profile, not a step "
            "response"
        )
    told.append(f"overshoot up to {worst:.1%} of the distance" if worst > LARGE else "no significant overshoot")
    told += [f"at rest up to {format_quantity(*max(rests), 3)} from the reference"] if rests else []
    if worst > LARGE:
        told.append("lower the outer gain, or record the frequency response")
    return "; ".join(told)


def _sensors(found: Found, details: Mapping[str, Any]) -> str:
    del details
    told = [f"encoder.resolution = {_value(found['resolution'])}"] if "resolution" in found else []
    told += [f"dead time {_value(found['delay'], 3)}, the drive's delay"] if "delay" in found else []
    return f"state {' and '.join(told)}"


_ADVICE: dict[str, Callable[[Found, Mapping[str, Any]], str]] = {
    "two-speeds": _two_speeds,
    "friction-map": _friction_map,
    "winding": _winding,
    "frequency": _frequency,
    "steps": _steps,
    "sensors": _sensors,
}
