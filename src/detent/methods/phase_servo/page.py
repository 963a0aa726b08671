"""What a phase servo shows on the page of a list of moves: its two modes, and the text that it prints."""

import unicodedata

import numpy as np

from detent.control.phase_sequencer import POSITION_MODE
from detent.methods.moves.page import MM, MoveView, ShownMove, drive_curve, true_speed
from detent.methods.moves.run import MoveRun
from detent.methods.phase_servo.schema import PhaseServoSpec
from detent.page.chart import Band, Curve, Panel, spans_of
from detent.page.figure import Figure
from detent.page.paper import Marks, paper_figure
from detent.page.parts import INCH, Numbers
from detent.page.run_page import Stretch
from detent.page.words import CountUnit, count, number

MODE, STOP = "controller.sequencer.mode", "controller.sequencer.stop"
SETPOINT, SPEED = "controller.law.setpoint", "controller.speed.word"
INTEGRAL, WORD = "controller.law.integral", "controller.law.word"

PAGE_ROWS = 66  # lines of text on a page of paper: 11 in of 1/6 in each

IN_THE_MOVE = (
    "Until shortly before the target the speed follows a table of the distance to go, counted in pulses; then position "
    "mode begins, and the resolver phase itself determines the stop. Check: speed on the dashed line while "
    "braking, and a drive that settles."
)

AT_ITS_END = (
    "Below: the absolute error word, the integral and the drive word that results from them and the speed. Check: once "
    "inside the dashed lines the axis stays there, and is at rest after the stop."
)


class PhaseView(MoveView):
    """What this method shows of itself, see `moves.page.MoveView`."""

    spec: PhaseServoSpec
    signals = (MODE, STOP, SETPOINT, INTEGRAL, WORD, SPEED)
    captions = (IN_THE_MOVE, AT_ITS_END)

    @property
    def unit(self) -> CountUnit:
        """A step of the resolver."""
        return CountUnit(self.spec.step, "step")

    def panels(self, shown: ShownMove) -> list[Panel]:
        """Speed with what the table demands, distance to go, drive word."""
        rows, per_sample = shown.rows, self.spec.step / self.spec.sample_period
        demanded = np.where(_positioning(rows), np.nan, rows[SETPOINT] * per_sample)
        speeds = [
            Curve(label="speed word", colour="muted", width=1, step=True, y=rows[SPEED] * per_sample * MM),
            Curve(label="demanded by the table", colour="left", dash=(6, 4), step=True, y=demanded * MM, thin=0),
            true_speed(shown),
        ]
        to_go = Curve(label="distance to go", colour="speed", width=2, y=shown.to_go * MM, digits=4)
        return [
            Panel(name="move-speed", label="speed [mm/s]", zero=True, curves=speeds),
            Panel(name="move-to-go", label="distance to go [mm]", height=140, zero=True, curves=[to_go]),
            Panel(name="move-drive", label="drive [count]", height=160, zero=True, curves=[drive_curve(rows[WORD])]),
        ]

    def bands(self, shown: ShownMove) -> list[Band]:
        """Where the stop position rules."""
        rows = shown.rows
        return [Band(label="position mode", colour="good", spans=spans_of(rows.t, _positioning(rows)))]

    def words(self, rows: Stretch) -> list[Curve]:
        """What makes the drive word in position mode."""
        error = np.where(_positioning(rows), rows[SETPOINT], np.nan)
        return [
            Curve(label="absolute error word", colour="left", step=True, y=error, digits=0),
            Curve(label="integral", colour="ink", step=True, y=rows[INTEGRAL], digits=0),
            drive_curve(rows[WORD]),
        ]

    def events(self, shown: ShownMove) -> dict[str, float]:
        """From the set strobe to the stop."""
        move, method = shown.move, self.spec.method
        ruler = "controlled by the absolute word" if method.final == "absolute" else "controlled by the counted pulses"
        within = number(shown.run.tolerance / self.spec.step)
        return {
            "set strobe: the host gives direction and distance": 0.0,
            f"{count(method.threshold, 'step')} to go: position mode, {ruler}": move.switched - move.begin,
            f"within ±{within} steps of the target for good": shown.settled,
            "ready: the host may act": move.ready - move.begin,
            "stop: dead band and integrator take over": shown.rows.first(shown.rows[STOP]),
        }

    def text_figure(self, run: MoveRun) -> Figure:
        """Each character where the carriage stood for it."""
        caption = "Each character is drawn at the carriage position at the end of its dwell."
        return paper_figure("The text", caption, marks_of(self.spec, run), run.tolerance)


def _positioning(rows: Stretch) -> Numbers:
    return rows[MODE] == POSITION_MODE


def marks_of(spec: PhaseServoSpec, run: MoveRun) -> Marks:
    """Characters of a text in pages of `PAGE_ROWS` lines."""
    lines = {move.number: move.row - 1 for move in run.job.moves}
    line = np.array([lines[move.number] for move in run.moves], dtype=int)
    column = np.array([move.target - spec.printing.left_margin for move in run.moves], dtype=float)
    return Marks(
        # One code point each: a letter and its accent become one, or the letter alone.
        characters=[unicodedata.normalize("NFC", move.label)[:1] for move in run.moves],
        page=line // PAGE_ROWS + 1,
        line=line + 1,
        baseline=(line % PAGE_ROWS + 1) * (INCH / 6),
        column=column,
        landed=column - np.array([move.error for move in run.moves], dtype=float),
        width=np.full(len(line), spec.printing.character_pitch),
        direction=np.ones(len(line), dtype=int),
        strikes=np.ones(len(line), dtype=int),
    )
