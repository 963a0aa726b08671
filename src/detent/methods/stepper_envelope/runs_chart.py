"""Frequency against position: the steps that a motor made, under what its tables permit."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from detent.methods.stepper_envelope.schema import StepperTable, ZoneTable
from detent.methods.stepper_envelope.stage_trace import Arc, Envelope
from detent.methods.stepper_envelope.summary import stated
from detent.page.chart import Chart, Curve, Loop, Panel, loop_chart
from detent.page.parts import Numbers
from detent.page.words import GAP, count

HEADROOM = 1.25  # height of a half of the figure over the motor's limit
LONG_NUMBERS = 1e4  # limit from which on frequencies are written in kHz [Hz]
CROPPED = 0.35  # runs that lie within less than this part of the travel are drawn alone, not with all of it

MM = 1e3


@dataclass(frozen=True, slots=True)
class Runs:
    """Runs of one motor under its envelope."""

    name: str  # of the motor
    table: StepperTable
    envelope: Envelope
    arcs: Sequence[Arc]  # in order of time; at least one, if they are to be drawn
    left_out: int = 0  # motions of this motor that are not among them

    @property
    def travel(self) -> tuple[float, float]:
        """Ends of the travel [m]."""
        return self.table.mechanics.lower_end, self.table.upper_end

    @property
    def window(self) -> tuple[float, float]:
        """Part of the travel that is drawn: all of it, or the neighbourhood of the runs if these are short [m]."""
        places = np.concatenate([arc.position for arc in self.arcs])
        low, high = float(places.min()), float(places.max())
        first, last = self.travel
        if high - low > CROPPED * (last - first):
            return self.travel
        room = max(0.12 * (high - low), 10 * self.table.step)
        return max(low - room, first), min(high + room, last)

    @property
    def zones(self) -> dict[str, ZoneTable]:
        """Zones that reach into that part."""
        low, high = self.window
        return {name: zone for name, zone in self.table.zone.items() if zone.begin < high and zone.end > low}

    def permitted(self) -> tuple[Numbers, Numbers, Numbers]:
        """Places in that part, both its ends included, and frequencies up and down."""
        (low, high), envelope = self.window, self.envelope
        inside = envelope.position[(envelope.position > low) & (envelope.position < high)]
        at = np.concatenate(([low], inside, [high]))
        rows = np.searchsorted(envelope.position, at + 0.01 * self.table.step, side="right") - 1
        rows = rows.clip(0, len(envelope.position) - 1)
        return at, envelope.up[rows], envelope.down[rows]


def runs_chart(runs: Runs, name: str, *, height: int = 300) -> Chart:
    """Draw the steps of a motor under its envelope, up above zero and down below it."""
    at, up, down = runs.permitted()
    max_hz = runs.table.max_hz
    unit, per_hz, digits = ("kHz", 1e-3, 4) if max_hz >= LONG_NUMBERS else ("Hz", 1.0, 1)
    permitted = [
        Curve(label=f"permissible, {word}", colour="muted", step=True, fill=True, y=sign * hz * per_hz, digits=digits)
        for word, sign, hz in (("up", 1, up), ("down", -1, down))
        if hz.any()
    ]
    most, limit = (
        max_hz * per_hz,
        f"limit {count(round(max_hz))}{GAP}Hz, {stated(max_hz * runs.table.step * MM)}{GAP}mm/s",
    )
    panel = Panel(
        name=name, label=f"← down   [{unit}]   up →", height=height, zero=True, span=_halves(most, up, down),
        levels=[(most, limit), (-most, "" if up.any() else limit)], curves=permitted,
        about=f"Step frequency of {runs.name} over position, under the envelope",
    )  # fmt: skip
    loops = [
        Loop(label=f"steps made, {word}", colour=colour, x=arc.position * MM, y=arc.hz * sign * per_hz, digits=digits)
        for word, colour, sign in (("up", "right", 1), ("down", "left", -1))
        for arc in runs.arcs
        if arc.direction == sign
    ]
    chart = loop_chart(panel, at * MM, f"position of {runs.name} [mm]", loops)
    return chart | {"bands": [_zone_band(zone_name, zone) for zone_name, zone in runs.zones.items()]}


def _halves(most: float, up: Numbers, down: Numbers) -> tuple[float, float]:
    """Ends of the vertical axis; a half in which nothing is permitted has little room."""
    top = HEADROOM * most
    return -round(top if down.any() else 0.1 * top, 3), round(top if up.any() else 0.1 * top, 3)


def _zone_band(name: str, zone: ZoneTable) -> Chart:
    only = "" if zone.direction == "both" else f", {zone.direction} only"
    span = [round(zone.begin * MM, 4), round(zone.end * MM, 4)]
    return {"spans": [span], "colour": "brake", "label": f"{name}: {stated(zone.speed * MM)} mm/s{only}"}
