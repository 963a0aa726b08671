"""The axis computer of the print head: its registers, states and what every part of it shares.

Positions in emitters from the left frame, times in microseconds, speeds as speed values s = 6 v[in/s], drive values in
counts; per-direction values end in `_right` and `_left`. Print-head specification 2.2 (B2), 3 and 4.
"""

from detent.control.column_timer import ColumnTimer, ColumnTimerParams, LineBuffer
from detent.control.latch import Latch, StatusPort
from detent.control.self_identification import LONGEST, SLOPES, IdentifiedLine, PlausibleLimits
from detent.kernel.registers import Registers, block, i1, i2, i4, i4_array, i8, register, u1, u1_array, u2
from detent.kernel.step import step

POWER_ON, HOME_LEFT, HOME_RIGHT, IDLE = 0, 1, 2, 3
LOW_START, LOW_STEADY, LOW_STOP = 4, 5, 6
HIGH_ACCEL, HIGH_STEADY, HIGH_TRANSITION, HIGH_REVERSE = 7, 8, 9, 10
FAULT = 11
STATE_NAMES = (
    "power on", "home left", "home right", "idle", "low start", "low steady", "low stop",
    "high accel", "high steady", "high transition", "high reverse", "fault",
)  # fmt: skip

OK, ILLEGAL, OUT_OF_RANGE, NOT_CALIBRATED = 0x00, 0x01, 0x02, 0x04
OBSTRUCTION, IMPLAUSIBLE, OVERRUN = 0x08, 0x10, 0x20

NO_OPERATION, PRINT, RUN, SET_SPEED, CONTROLLED_RUN, CALCULATE, POSITION_HIGH, POSITION_LOW, REFUSED = range(9)

LOWEST_FAST_PASS = 84
"""Speed value, 14 in/s, from which a fast calibration pass lies far enough from the slow one at 10 in/s to tell slope
from friction. An axis that must stay slower makes no passes: its defaults stay in use, and it says so."""

SLOWEST_PASS = 10
"""How many times as long as at 10 in/s the slow pass may take. A head that creeps tells no speed."""

STALL_MARGIN = 20
"""Counts above friction from which the head must move: below them standing still is no fault (3.2, 7.3)."""

STALL_US = 50_000
DEAD_US = 1_000_000
"""A head that stands this long in a move is stalled at any drive: one that creeps along gives an emitter in 5 ms."""

RUNAWAY_US = 62
"""Emitter interval of 53 in/s: beyond every speed a plausible machine reaches with a drive of 300 counts or less."""

BACKWARD = 60
"""Emitters in a row against the drive, 0.2 in: the head is carried away, or leads of motor or encoder are swapped."""

QUEUE = 4
"""Commands that wait, the last place for refused ones; only one of them may be a motion command."""


SPEEDS = (0, 240)
"""Speed values, of which 240 is 40 in/s."""

COUNTS = (0, 300)
"""Drive values of the parameters: 300 counts are the whole supply."""

FAR = 1 << 20
"""Emitters from the left frame at which counting ends: 16 times what a command can name."""

WINDOWS = 1 << 15
"""Complete windows of a pass that are counted: at 10 in/s there are 18 of them on the longest travel."""

PLACES = (-2 * FAR, 2 * FAR)
"""Places and ways that are worked out from that, and from what a command names."""

LARGEST_START, LARGEST_END = 0xFFFFFF, 0xFFFF
"""Of the arguments of a command, of three and of two bytes."""

BYTES = 8
"""Of a command at most: its first one tells of up to seven more."""


class HeadOutputs(Registers):
    """What the axis computer hands to timer and decoder; taken over together at the next 25 kHz trigger."""

    count: i2 = register("magnitude for the PWM timer", unit="count")
    right_left: u1 = register("direction line, 1 = right")
    transition: u1 = register("transition line TR")


class HeadParams(Registers):
    """Options and constants of the axis computer."""

    slope_default: i4 = register("power-on slope K", unit="count/256", range=SLOPES)
    friction_default: i4 = register("power-on friction Vf", unit="count", range=COUNTS)
    ir: i4 = register("IR term of acceleration and braking", unit="count", range=COUNTS)
    drive_limit: i4 = register("largest drive magnitude", unit="count", range=COUNTS)
    span_steady: u1 = register(
        "1: ramp interval from the whole steady drive (literal), 0: from its back-EMF part", option=True
    )
    ack_last: u1 = register("1: the last byte of a command is acknowledged too", option=True)
    transition: u1 = register("1: transition mode, 0: coast until the drive value reaches zero", option=True)
    friction_jump: u1 = register("1: turn-around jumps by the friction of both directions", option=True)
    trim: u1 = register("1: steady speed is trimmed every 16 ms", option=True)
    overspeed_test: u1 = register("1: low speed halves the drive above 17/16 of the speed", option=True)
    memory: u1 = register("1: the trimmed drive is kept for the next move of the same speed", option=True)
    zero_speed_us: i4 = register("standstill: no emitter for this long", unit="us", range=(0, DEAD_US))
    contact_us: i4 = register("contact while homing: no emitter for this long", unit="us", range=(0, DEAD_US))
    homing_speed: i4 = register("speed value of homing", unit="1/6 in/s", range=SPEEDS)
    homing_limit: i4 = register("drive limit of homing", unit="count", range=COUNTS)
    run_speed: i4 = register("speed value of RUN and of the fast calibration pass", unit="1/6 in/s", range=SPEEDS)
    print_speed: i4 = register("preselected speed value at power-on", unit="1/6 in/s", range=SPEEDS)
    expected_width: i4 = register("travel between the frames", unit="emitter", range=(0, LARGEST_END))
    width_tolerance: i4 = register(
        "narrower by more than this is an obstruction", unit="emitter", range=(0, LARGEST_END)
    )
    calibration_margin: i4 = register(
        "stop target of calibration passes from the frames", unit="emitter", range=(0, LARGEST_END)
    )
    plausible: PlausibleLimits = block("limits of the identified line")
    columns: ColumnTimerParams = block("columns of a line")


class Receiver(Registers):
    """Collects the bytes of one command."""

    left: u1 = register("data bytes still to come", unit="count")
    count: u1 = register("bytes collected", unit="count")
    buffer: u1_array = register("the bytes", unit="code", length=BYTES)


class CommandQueue(Registers):
    """Decoded commands that wait, in order."""

    operation: i4_array = register("operation code", unit="code", length=QUEUE, range=(0, REFUSED))
    start: i4_array = register(
        "first argument; position of PRINT in 1/256 emitter", unit="emitter/256", length=QUEUE, range=(0, LARGEST_START)
    )
    end: i4_array = register("second argument", unit="emitter", length=QUEUE, range=(0, LARGEST_END))
    first: u1 = register("index of the oldest", unit="count", range=(0, QUEUE - 1))
    waiting: u1 = register("how many wait", unit="count")
    motions: u1 = register("how many of them are motion commands", unit="count")


class Plan(Registers):
    """A motion command worked out from where the head will stand."""

    code: u1 = register("SB1 if the command cannot be done", unit="code")
    direction: i1 = register("1 right, -1 left", range=(-1, 1))
    speed: i2 = register("selected speed value", unit="1/6 in/s", range=SPEEDS)
    target: i4 = register("commanded stop position", unit="emitter", range=PLACES)
    distance: i4 = register("distance the speed was selected from", unit="emitter", range=(0, 2 * PLACES[1]))
    reposition: u1 = register("1: a run back for the run-up, the print follows")


class HeadComputer(Registers):
    """State of the axis computer."""

    state: u1 = register("motion state", unit="code")
    now_us: i8 = register("time of this tick", unit="us")
    wake_us: i8 = register("time of the next timer; before it only emitters and commands matter", unit="us")
    homed: u1 = register("1 after homing")
    width: i4 = register("measured travel between the frames", unit="emitter", range=(-FAR, FAR))

    emitter: i8 = register("position", unit="emitter", range=(-FAR, FAR))
    last_emitter_us: i8 = register("time of the last emitter, or of the start of the move", unit="us")
    interval_us: i8 = register("latest emitter interval, 0 while unknown", unit="us")
    emitter_seen: u1 = register("1 once an emitter has come in this move")
    last_step: i1 = register("direction of the last emitter")
    too_fast: u1 = register("emitters in a row at runaway speed", unit="count")

    against: u2 = register("emitters in a row against the direction of the move", unit="count")

    direction: i1 = register("direction of the move, 1 right, -1 left", range=(-1, 1))
    speed: i2 = register("commanded speed value", unit="1/6 in/s", range=SPEEDS)
    target: i4 = register("commanded stop position", unit="emitter", range=PLACES)
    expected_stop: i4 = register("where the running move will stand", unit="emitter", range=PLACES)
    drive: i2 = register("drive value V along the direction of motion", unit="count")
    drive_cmd: i2 = register("signed drive value put out, right positive", unit="count")
    steady: i2 = register("steady drive the ramp leads to", unit="count")
    ramp_top: i2 = register("drive at which the ramp ends", unit="count")
    ramp_us: i4 = register("time per count of the ramp", unit="us")
    next_ramp_us: i8 = register("next count of the ramp", unit="us")
    next_trim_us: i8 = register("next trim", unit="us")
    phase_start: i8 = register("position at which the present phase or window began", unit="emitter", range=(-FAR, FAR))
    start_emitters: i4 = register("emitters of the low-speed start", unit="emitter", range=(0, LARGEST_END))

    maximum: i2 = register("preselected maximum print speed value", unit="1/6 in/s", range=SPEEDS)
    right: IdentifiedLine = block("identified line moving right")
    left: IdentifiedLine = block("identified line moving left")
    kept_speed_right: i2 = register("speed value the kept drive belongs to, 0 none", unit="1/6 in/s")
    kept_drive_right: i2 = register("kept drive moving right", unit="count")
    kept_speed_left: i2 = register("speed value the kept drive belongs to, 0 none", unit="1/6 in/s")
    kept_drive_left: i2 = register("kept drive moving left", unit="count")

    operation: u1 = register("running command", unit="code", range=(0, REFUSED))
    start: i4 = register("its first argument", unit="emitter/256", range=(0, LARGEST_START))
    end: i4 = register("its second argument", unit="emitter", range=(0, LARGEST_END))
    repositioning: u1 = register("1 during the run back of a print command")
    repositioned: u1 = register("1 after it")
    latched_position: u2 = register("position latched by POSITION HIGH", unit="emitter")
    plan: Plan = block("the command being started or next in line")

    calibration_pass: u1 = register("0 none, 1 left fast, 2 right fast, 3 left slow, 4 right slow")
    window_us: i8 = register("end of the running calibration window", unit="us")
    windows: i4 = register("complete windows of this pass", unit="count", range=(-1, WINDOWS))
    window_total: i8 = register("emitters of the windows of this pass", unit="emitter", range=(-LONGEST, LONGEST))

    moves: i8 = register("moves begun", unit="count")
    turn_arounds: i8 = register("turn-arounds without a stop", unit="count")
    repositions: i8 = register("runs back before a print", unit="count")

    out: HeadOutputs = block("drive outputs")
    columns: ColumnTimer = block("print timing")
    command_latch: Latch = block("command latch, written by the supervisor")
    status: StatusPort = block("status latch and its queue")
    receiver: Receiver = block("byte collector")
    queue: CommandQueue = block("waiting commands")
    buffer: LineBuffer = block("columns of the running and of the next line")


@step
def line_of(c: HeadComputer, direction: int) -> IdentifiedLine:
    """Identified line of a direction."""
    return c.right if direction > 0 else c.left


@step
def is_motion(operation: int) -> bool:
    """True for commands that move the head to a position."""
    return operation in (PRINT, RUN, CONTROLLED_RUN)
