"""The errors a person meets, and the texts of the axis computer's status codes.

Everything detent raises on purpose is a `DetentError`. Its subclasses follow what the caller does next: correct the
input (`InputError`), or look at the axis (`AxisError`). Inside the compiled loop nothing is raised: a code stands in a
register, and its text stands here.
"""

from collections.abc import Iterable
from dataclasses import dataclass

MOST_PROBLEMS = 20  # problems of one job or recording told at most: a file of another kind would have one in each line


class DetentError(Exception):
    """Root of every error detent raises on purpose.

    Its `exit_status` is what a command returns to the shell: 1 for an axis that did not do it, 2 for wrong input.
    """

    exit_status: int = 2


@dataclass(frozen=True, slots=True)
class FileProblem:
    """One thing wrong in one input: where, what it got, what it expected, what to try.

    Attributes
    ----------
    file : str
        The file as the user named it, or ``--set`` for a value given on the command line.
    line, column : int
        Counted from 1; 0 when the problem has no place in the text (a missing file, an override).
    key : str
        Dotted key such as ``mechanics.travel``; empty for a problem of the text as a whole.
    got : str
        What was found, as written.
    allowed : str
        What would be accepted.
    remedy : str
        What the user does about it.
    """

    file: str
    line: int
    column: int
    key: str
    got: str
    allowed: str
    remedy: str

    @classmethod
    def of_key(cls, key: str, got: str, allowed: str, remedy: str) -> "FileProblem":
        """Problem of a key; whoever reads the file adds the place, and the value as written where `got` is empty."""
        return cls("", 0, 0, key, got, allowed, remedy)

    def __str__(self) -> str:
        """Give the problem as one line that editors and terminals can jump from."""
        place = f"{self.file}:{self.line}:{self.column}" if self.line else self.file
        what = f"{place} {self.key}".rstrip()
        got = self.got if self.got == "no such file" else f"got {self.got}"
        return f"{what}: {got}; expected: {self.allowed}; try: {self.remedy}"


class InputError(DetentError):
    """An input (axis file, override, job) is wrong; holds all that is wrong with it, in the order of the text."""

    exit_status = 2

    def __init__(self, problems: Iterable[FileProblem]) -> None:
        self.problems: tuple[FileProblem, ...] = tuple(
            sorted(problems, key=lambda problem: (problem.file == "--set", problem.line, problem.column))
        )
        super().__init__("\n".join(str(problem) for problem in self.problems))

    @classmethod
    def of_file(cls, file: str, got: str, allowed: str, remedy: str) -> "InputError":
        """Error about a file as a whole: it is absent, empty or of another kind."""
        return cls([FileProblem(file, 0, 0, "", got, allowed, remedy)])

    def __reduce__(self) -> tuple[type["InputError"], tuple[tuple[FileProblem, ...]]]:
        """Pickle by the problems, so that the error crosses a process boundary whole."""
        return type(self), (self.problems,)


class DiskError(DetentError):
    """A disk did not take what was to be written: it is full, or read-only, or it fails."""

    exit_status = 1


class AxisError(DetentError):
    """The axis did not do what it was asked: it stalled, met an obstruction, or could not be identified."""

    exit_status = 1


SB1_TEXT: dict[int, str] = {
    0x01: "the command is unknown or illegal; send one of the commands of the protocol, with its count of data bytes",
    0x02: "a position or a speed is out of range; keep positions between the frames and speeds between 3 and 40 in/s",
    0x04: "the axis is not calibrated; send CALCULATE PARAMETERS before the first motion",
    0x08: "the head is obstructed or stalled, or moves against its drive, and the drive is off; clear the obstruction, "
    "check the wiring of motor and encoder, then send CALCULATE PARAMETERS",
    0x10: "the measured slope or friction is implausible and the default values were kept; check for a jam, "
    "a wrong supply voltage or a wrong motor, then send CALCULATE PARAMETERS",
    0x20: "a motion command arrived while one was already queued and was dropped; wait for an answer before sending "
    "the next",
}
"""Meaning of each bit of the axis computer's status byte SB1 (specification of the print head, 3.1)."""


SERVO_FAULT_TEXT: dict[int, str] = {
    1: "the following error left the range of the position counter and the drive is off; lower the speed or the "
    "command's acceleration, check for a blocked slide, or widen method.position_bits",
    2: "the speed counter was about to wrap and the drive is off: the slide moves by more pulses per sample than it "
    "can count; lower the speed, shorten method.sample_period, or widen method.counter_bits",
}
"""Causes of a fault of the filtered servo (control.deviation_counter)."""


GUARD_TEXT: dict[int, str] = {
    1: "the encoder sent two words within 5 ms that failed their check, or none, and the drive is off; check its "
    "cable, shield and supply (encoder.checked)",
    5: "the encoders of motor and load differ by more than {slip}, and the drive is off; check the coupling and both "
    "encoders (protection.slip)",
    14: "the axis swings about its reference by more than {swing} to either side, and the drive is off; lower the "
    "gains, or look for play (protection.oscillation)",
    21: "the motor has had more than motor.max_current, which it bears for ever, for too long, and the drive is off; "
    "let it cool, and lower acceleration or duty (protection.thermal_time)",
    30: "the axis ran onto its {side} limit switch, and the drive is off; move it away from there, and check the ends "
    "of the travel",
    33: "the circuits of both limit switches are open, and the drive is off; check the wire that they share",
    2: "the sensor did not move although the effort exceeded breakaway for {stuck}, and the drive is off; "
    "check for a blocked axis, a loose coupling or a broken sensor cable (protection.stuck_time, "
    "protection.stuck_effort)",
    3: "the sensor jumped farther than any motion can explain, twice, and the drive is off; check its cable, shield "
    "and supply (protection.jump)",
    4: "the axis accelerated against its own effort for {reversed}, and the drive is off; check for a sensor or motor "
    "with swapped leads, or an external force that exceeds the effort (protection.reversed_time)",
    10: "the following error exceeded {following}, and the drive is off; check what blocks the axis, lower speed "
    "or acceleration, or correct the gains",
    11: "the command stayed at its limit for {saturated}, and the drive is off; lower the acceleration, use a "
    "stronger drive, or check for an unstable loop (protection.saturation_time)",
    12: "the axis ran faster than {speed}, and the drive is off; check for an external force, a miscounting sensor, or "
    "an unstable loop (protection.overspeed)",
    13: "the axis did not arrive within {arrival}; check for a load it cannot hold, or allow more time",
    52: "a value in the loop was no number, and the drive is off; check the sensor and what computes with it",
    32: "the axis overran the {side} end of travel, {end}, and the drive is off; keep the moves farther from "
    "the ends, or damp the overshoot",
}
"""Faults reported by a controller's guard (control.guard), by their numbers; in all of them the first cause stays."""


# ---- faults of a live axis that no guard of a controller sees
DRIVE_FAULT, DRIVE_LOST, LOOP_OVERRUN, LOOP_DEAD, BROKEN, OTHER_HARDWARE = 24, 40, 50, 51, 54, 70
SENSOR_LOST, OVER_CURRENT, MOTOR_LOAD = 1, 20, 21  # a drive has found them; of 1 and 21 a guard may know, too
NO_MARK = 55  # refusal of a motion that a power cut would make a riddle of
NOT_AT_REST, NOTHING_TO_UNDO = 111, 112  # refusals of what is asked of a position table
TOO_FAR, DRIVEN_OFF = 113, 114  # why a stream of set-points does not begin, or does not go on
ON_LOCAL, ON_REMOTE = 115, 116  # refusals by the selector of who commands

REFUSAL_TEXT: dict[int, str] = {
    1: "the encoder is not heard; check its cable and supply, reset, and find the reference anew",
    20: "the drive has switched off for a current too large, or a short; check motor and cable with the supply off, "
    "then reset",
    21: "the motor has had more than it bears for ever, for too long; let it cool, then reset, and ask less of it",
    24: "the drive tells a fault of its own, or has left its operation by itself; read its error code, mend that, then "
    "reset",
    31: "the target lies beyond a soft limit; name one between the limits",
    35: "the position is not known, so that only creeping by a way or by hand is allowed; home the axis",
    40: "nothing is heard from the drive for three periods of its heartbeat; check cable, supply and bus, then reset",
    41: "whoever held the jog, led the job, or sent the set-points was silent for too long; begin it again",
    43: "somebody else commands; take over first, or ask them",
    44: "a stop came after this was asked; look at the axis and ask again",
    50: "the loop came too late, for more than 5 periods or more than 3 times in a second, and the axis was stopped; "
    "give it real-time priority, or a longer period",
    51: "the loop stood for longer than its watchdog waits, and the torque was taken away; look for what stopped the "
    "process, then reset",
    54: "a part of the program beside the loop has ended in an error, and the axis is not enabled any more; keep the "
    "report, end detent live, and start it anew",
    55: "that the axis is going to move cannot be kept, so no new motion may begin, for after a power cut nobody would "
    "know where it stands; give the store room on its disk, then enable again",
    52: "a value that is no number, infinite, or a share of the speed outside 0 to 1; correct it",
    70: "the drive is not the hardware of the axis file; connect that one, or correct hardware.id",
    101: "the axis is not enabled; enable it first",
    102: "the axis stands in a fault; read it, mend its cause, reset, then enable",
    103: "there is no fault to reset",
    104: "there is no such command; look at the list of commands",
    105: "this control method has no such command",
    106: "not while the axis is enabled; switch it off first",
    107: "the axis takes no other move while one is under way; wait for its end, or stop it",
    108: "the axis is not ready: it has not yet taken its first position; wait a moment",
    109: "no job is under way; begin one first",
    110: "the first motion since enabling has not been confirmed, and a job goes at speeds of its own; confirm first",
    111: "the axis moves, and where it is cannot be taught; wait until it rests, or stop it",
    112: "there is no change of the position table left to take back, or to make again; look at the table",
    113: "the first set-point lies farther away than the axis goes in an interpolation period; begin where it stands",
    114: "the effort drove the axis to its largest speed, or to where it could just stop before a soft limit, and it "
    "was brought to rest; ask for less, and sooner for the other way",
    115: "the selector stands on local, where panel and programs command, and faces read and stop; turn it at the "
    "panel, or with: detent connect FILE selector both",
    116: "the selector stands on remote, where only faces command; turn it at the panel, or with: detent connect FILE "
    "selector both",
    201: "the table was still moving; wait until it stands, or stop it",
    202: "the position table has no such number; name one that it has, or add it to the axis file",
    203: "the way is longer than the remaining angle can count; name a nearer position",
    210: "the axis is not ready, or the way is longer than its counter; wait until it is ready, or go in parts",
    230: "the head is looking for its frames or measures itself; wait until that is over, or stop it",
    231: "the head came to rest farther from its target than a stop may miss it; look for what blocks or drives it",
    232: "the axis computer did not do it, and what it answered stands in its status byte; mend that and ask again",
    341: "the reference was not found: no switch and no hard stop on the whole way, or something else holds the axis; "
    "look at the switch and its lead, at home.direction, and for what is in the way, then home again",
    342: "the home switch stayed on when the axis backed off; look at the switch and its lead, or lengthen back_off",
    343: "the axis began on its home switch and did not come off it; look at the switch and at home.direction",
    344: "no index mark came within a turn behind the edge of the switch; look at the encoder's index line",
}
"""Why an operation refuses a command, or ends one that it had taken (control.operation)."""


STEP_FAULT_TEXT: dict[int, str] = {
    1: "the table of permissible speeds fell by more than one ramp step, which the motor cannot follow; it came down "
    "its ramp and stands; build the table anew from its extremes, or edit it with move_stop",
    2: "the position lies outside the travel; place the motor inside it again (home it)",
}
"""Causes of a fault of the step rule (control.step_rule)."""


TABLE_REFUSAL_TEXT: dict[int, str] = {
    1: "the table was still moving; start positioning when the previous one has ended or the jog has come to rest",
    2: "the position table has no such entry; add [position.NUMBER] to the axis file, or start another number",
    3: "the distance exceeds the range of the remaining angle; name a nearer angle in the position's entry, or lower "
    "detector.fine.counts",
}
"""Why the positioner of a rotary table refuses a start, by its reason (control.table_positioner)."""


COURSE_REFUSAL_TEXT: dict[int, str] = {
    1: "a place or a velocity that is no finite number, or beyond 1e9 m or 1e12 m/s; send one that the axis can have",
    2: "the target lies beyond the soft limit {limit}; name one between {lowest} and {highest}, or widen the limits",
    3: "the velocity is above the largest one, {speed}; ask for a lower one, or raise the limit of the speed",
    4: "the limits are none that a motion could keep: speed and acceleration must be 1e-9 to 1e12, the jerk too or 0, "
    "the lower soft limit not above the upper one; correct them",
}
"""Why the course of a live axis refuses a command (planning.course); what is under way goes on."""


def describe_sb1(code: int) -> str:
    """Say what a status byte means and what to do.

    >>> describe_sb1(0)
    'done'
    >>> describe_sb1(0x04)
    'the axis is not calibrated; send CALCULATE PARAMETERS before the first motion'
    """
    if code == 0:
        return "done"
    texts = [text for bit, text in SB1_TEXT.items() if code & bit]
    unnamed = code & ~sum(SB1_TEXT)
    if unnamed:
        texts.append(f"status bits 0x{unnamed:02X} have no meaning in this protocol; the status byte was not SB1")
    return "; also: ".join(texts)
