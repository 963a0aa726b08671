"""What a filtered servo shows on the page of a list of moves: the following error, and the speed word it is held by."""

from typing import Any

import numpy as np

from detent.methods.filtered_servo.schema import FilteredServoSpec
from detent.methods.moves.page import MM, MoveView, ShownMove, drive_curve, true_speed
from detent.page.chart import Curve, Panel
from detent.page.parts import Numbers
from detent.page.run_page import Stretch
from detent.page.words import count, number

COMMAND, DEVIATION, WORD = "controller.generator.command", "controller.deviation.deviation", "lines.word"
COUNTED, FILTERED, WINDOW = "controller.speed.word", "controller.filter.output", "controller.clock.period"

IN_THE_MOVE = (
    "The slide follows the command pulses with a lag proportional to speed: the following error minus the speed word "
    "is the drive. Compare the smooth filtered speed word with the counted one, which jumps by whole pulses times B."
)

AT_ITS_END = (
    "Below: following error minus filtered speed is the drive word. Check: few oscillations about the target; the lag "
    "of the filter reduces damping."
)


class FilteredView(MoveView):
    """What this method shows of itself, see `moves.page.MoveView`."""

    spec: FilteredServoSpec
    signals = (COMMAND, DEVIATION, WORD, COUNTED, FILTERED, WINDOW)
    captions = (IN_THE_MOVE, AT_ITS_END)

    def panels(self, shown: ShownMove) -> list[Panel]:
        """Speed with the commanded one, the speed words, following error, drive word."""
        rows = shown.rows
        commanded = command_speed(rows.t, rows[COMMAND], rows[WINDOW] * 1e-6) * self.spec.pulse
        speeds = [true_speed(shown), Curve(label="commanded", colour="left", dash=(6, 4), y=commanded * MM, thin=0)]
        counted = rows[COUNTED] * self.spec.method.scale
        words = [
            Curve(label="counted × B", colour="muted", step=True, y=counted, digits=1),
            Curve(label="after the filter", colour="speed", width=2, step=True, y=rows[FILTERED]),
        ]
        error = Curve(label="following error", colour="speed", width=2, step=True, y=rows[DEVIATION], digits=0)
        return [
            Panel(name="move-speed", label="speed [mm/s]", zero=True, curves=speeds),
            Panel(name="move-counted", label="speed word [pulse]", height=180, zero=True, curves=words),
            Panel(name="move-deviation", label="error [pulse]", height=160, zero=True, curves=[error]),
            Panel(name="move-drive", label="drive [count]", height=160, zero=True, curves=[drive_curve(rows[WORD])]),
        ]

    def words(self, rows: Stretch) -> list[Curve]:
        """What makes the drive word."""
        return [
            Curve(label="following error", colour="left", step=True, y=rows[DEVIATION], digits=0),
            Curve(label="filtered speed", colour="muted", step=True, y=rows[FILTERED]),
            drive_curve(rows[WORD]),
        ]

    def events(self, shown: ShownMove) -> dict[str, float]:
        """From the request to in position."""
        move, method = shown.move, self.spec.method
        goal = round((move.target - self.spec.mechanics.start_position) / self.spec.pulse)
        window = f"within ±{count(method.in_position, 'pulse')} for {number(method.in_position_time * 1e3)} ms"
        within = number(shown.run.tolerance / self.spec.pulse)
        return {
            "move commanded": 0.0,
            "last command pulse": shown.rows.first(shown.rows[COMMAND] == goal),
            f"within ±{within} pulses of the target for good": shown.settled,
            f"in position: {window}": move.ready - move.begin,
        }


def command_speed(t: Numbers, command: Numbers, window: Numbers) -> Numbers:
    """Rate of the command pulses [1/s]: mean over a sample period, between pulses in proportion to time.

    What comes after the last row is unknown, and so is the mean shortly before it: NaN.
    """
    changes = np.concatenate(([0], np.flatnonzero(np.diff(command)) + 1))
    places = command[changes].astype(float)
    half = window / 2
    gained: Any = np.interp(t + half, t[changes], places) - np.interp(t - half, t[changes], places)
    return np.where(t + half <= t[-1], gained / window, np.nan)
