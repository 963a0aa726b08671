"""How far a position that was kept may be trusted when the axis comes back: one function, and nothing is guessed.

Nothing but a reference makes a position `referenced`: what is judged here is `restored` at best.
"""

import math
from dataclasses import dataclass
from enum import StrEnum

from detent.methods.position import PositionSensor, Sensed
from detent.units import format_place, format_quantity


class Trust(StrEnum):
    """Trust of position."""

    UNKNOWN = "unknown"  #: nobody knows where the axis stands; it only creeps
    RESTORED = "restored"  #: kept, or read again, since it was last referenced
    REFERENCED = "referenced"  #: a reference was found since the power came


class Why(StrEnum):
    """Why a position is trusted as far as it is: what is known, and what to do where it does not suffice."""

    REFERRED = "a reference was found"
    STATED = "its axis file says where it stands"
    PARKED = "it was at rest and held while the power was off"
    READ = "the absolute sensor shows one place only, and the axis stands where it was left"
    UNIQUE = "it was in motion when it was last seen, and the absolute sensor shows one place only"
    NEW = "nothing is known of it yet; home it"
    UNREFERENCED = "it was not known before the power went either; home it"
    KILLED = "it was in motion when it was last seen, and its sensor counts from where it is switched on; home it"
    NOT_HELD = "its sensor counts from where it is switched on, and nothing held the axis while it was off; home it"
    NO_OFFSET = "its last reference was taken without a reading of the sensor; home it"
    NO_READING = "the absolute sensor gives no reading; look at its leads and its battery, then home it"
    AMBIGUOUS = "the absolute sensor shows more than one place within the travel; home it"
    OUTSIDE = "the absolute sensor shows a place beyond the ends of the travel; look at its lead and coupling, home it"
    DISTRUSTED = "its sensor or its way was found to be wrong since it was last referenced; home it"
    MOVED = "it was moved while the power was off; confirm the position that the sensor shows, or home it"
    ELSEWHERE = "what was kept of it was written elsewhere: the file was copied or moved; home it"


@dataclass(frozen=True, slots=True)
class Saved:
    """What was kept of the motion before, and what ties readings of the sensor to positions."""

    moving: bool  # the axis was in motion, or could have been
    trust: Trust
    counts: int  # where it was at rest, or where the motion began
    offset: int | None = None  # position of the reading 0; None where the last reference was taken without a reading
    elsewhere: bool = False  # the store does not lie where it was written


@dataclass(frozen=True, slots=True)
class Judgement:
    """Trust of a position, and why."""

    trust: Trust
    why: Why
    counts: int | None = None  # the position; None while it is unknown
    shown: int | None = None  # the place that an absolute sensor shows, trusted or not
    distance: int | None = None  # from where the axis was left to that place

    def describe(self, sensor: PositionSensor) -> str:
        """Say it with units.

        >>> sensor = PositionSensor(sensor="ruler", kind=Sensed.ABSOLUTE, scale=1e-6, ends=(0.0, 0.1))
        >>> judge(sensor, Saved(False, Trust.RESTORED, 5000, 0), 7000).describe(sensor)
        'unknown: it was moved while the power was off; confirm the position that the sensor shows, or home it \
(shown 7 mm, 2 mm from where it was left)'
        """
        told = f"{self.trust}: {self.why}"
        if self.counts is not None:
            return f"{told} ({format_place(sensor.position(self.counts), sensor.unit)})"
        if self.shown is None or self.distance is None:
            return told
        shown = format_place(sensor.position(self.shown), sensor.unit)
        distance = format_quantity(self.distance * sensor.scale, sensor.unit)
        return f"{told} (shown {shown}, {distance} from where it was left)"


def judge(sensor: PositionSensor, saved: Saved | None, reading: int | None) -> Judgement:
    """Trust of a position by the kind of sensor, what was kept, and the present reading (None: it gives none)."""
    if saved is None:
        return Judgement(Trust.UNKNOWN, Why.NEW)
    if saved.trust is Trust.UNKNOWN:
        return Judgement(Trust.UNKNOWN, Why.UNREFERENCED)
    if saved.elsewhere:
        return Judgement(Trust.UNKNOWN, Why.ELSEWHERE)
    if sensor.kind is not Sensed.INCREMENTAL:
        return _judge_reading(sensor, saved, reading)
    if saved.moving or not sensor.held:
        return Judgement(Trust.UNKNOWN, Why.KILLED if saved.moving else Why.NOT_HELD)
    return Judgement(Trust.RESTORED, Why.PARKED, saved.counts)


def _judge_reading(sensor: PositionSensor, saved: Saved, reading: int | None) -> Judgement:
    if saved.offset is None or reading is None:
        return Judgement(Trust.UNKNOWN, Why.NO_OFFSET if saved.offset is None else Why.NO_READING)
    place = shown_place(sensor, saved, reading + saved.offset)
    if place is None:
        return Judgement(Trust.UNKNOWN, Why.OUTSIDE)
    shown, is_only = place
    distance = shown - saved.counts
    if sensor.is_circle:
        distance = (distance + sensor.band // 2) % sensor.band - sensor.band // 2
    if not is_only:
        return Judgement(Trust.UNKNOWN, Why.AMBIGUOUS, None, shown, distance)
    if not saved.moving and abs(distance) > sensor.window:
        return Judgement(Trust.UNKNOWN, Why.MOVED, None, shown, distance)
    return Judgement(Trust.RESTORED, Why.UNIQUE if saved.moving else Why.READ, shown, shown, distance)


def shown_place(sensor: PositionSensor, saved: Saved, place: int) -> tuple[int, bool] | None:
    """Of the places at which the axis can stand with this reading the nearest to where it was left; is it the only one.

    An axis that was held at rest stands within half a band of where it was left.
    """
    if sensor.is_circle:
        return place % sensor.band, True
    low, high = sensor.reach or (-math.inf, math.inf)
    if sensor.kind is Sensed.ABSOLUTE:
        return (place, True) if low <= place <= high else None
    band, half = sensor.band, sensor.band // 2
    near = saved.counts + (place - saved.counts + half) % band - half
    if sensor.held and not saved.moving:
        return (near, True) if low <= near <= high else None
    if sensor.reach is None:
        return near, False
    low, high = sensor.reach
    first, last = low + (place - low) % band, high - (high - place) % band
    return (min(max(near, first), last), first == last) if first <= last else None
