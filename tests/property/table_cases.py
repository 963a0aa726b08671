"""Random jogs and positionings of a rotary table about the boundary of its angle, judged at every interrupt.

The servo loop is linear: a proportional gain, sampled every interrupt, around a first order lag. So what its deviation
dR may be follows from the response gc[j] of dR, j interrupts after the interpolated target C has gone one count on.
All in counts and interrupts, with gv[j] = gc[0] + ... + gc[j] the response to a velocity, whose end gv[inf] = 1 / Kp
(with droop d: 1 / (1 - d) Kp) is the following error per velocity:

- dR is what the way of C makes the loop do, to within (n + 1) sum |gc[j] - gc[j-1]| for a comparator that is wrong by
  up to n counts and cuts the rest of a count off, and half a word of register 5 through the loop's response to it;
- below a velocity V and with an acceleration a, |dR| is at most the following error gv[inf] V, and the acceleration
  adds at most a sum |gv[j] - gv[inf]|. What C does beyond an even acceleration comes on top: the square root by which
  the interpolator brakes takes up to 2 a at its end, and a start puts C on the table wherever that still lags.

A rollover or a crossing that is not the same in C and R shows as a whole turn in dR, 368 640 counts.
"""

from collections import Counter
from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.signal import lfilter, ss2tf
from tests.property.numbered_cases import chance, generator, log_uniform, whole
from tests.rotary_table_rig import COUNT, DAC_12, FINE, FINE_DAC, INTERRUPT, LAG, ONE, Rig, T, speed_word

from detent.control.table_positioner import AS_COMMANDED, HOLD, NEGATIVE, POSITIVE, SHORTEST

DELAY = 2e-4
"""From the strobe to the interrupt that works with its angle [s]."""
DELAY_TICKS, STROBE_TICKS = 2, 20
WINDOW = 2
FASTEST = 100.0
"""Speed that still leaves a 12-bit word room for the overshoot [deg/s]."""
NAMES = (
    "controller.positioner.dr",
    "controller.positioner.s4",
    "controller.positioner.state",
    "controller.positioner.z",
    "controller.positioner.oar",
    "controller.positioner.interpolator.irr",
    "controller.positioner.interpolator.speed",
    "controller.positioner.angle.position",
    "controller.positioner.angle.dar",
    "controller.positioner.angle.aar",
    "plant.train.motor.turns",
    "plant.train.motor.angle",
)


# ---------------------------------------------------------------------------------------------------------------- loop


@dataclass(frozen=True)
class Loop:
    """What one count of C, of the angle and of the word do to dR."""

    filter: tuple[np.ndarray, np.ndarray]
    """From the way of C to dR."""
    following: float
    """Deviation per velocity [interrupt]."""
    accelerating: float
    """Most deviation beyond it, per acceleration [interrupt^2]."""
    changing: float
    """Most deviation per change of velocity beyond that acceleration [interrupt]."""
    stepping: float
    """Most deviation per count by which C is put elsewhere."""
    measuring: float
    """Most deviation per count of measurement error."""
    rounding: float
    """Most deviation by the rounding of register 5 [count]."""


def lag(time: float, droop: float) -> tuple[np.ndarray, np.ndarray]:
    """Angle and velocity after a time, from themselves and from a constant reference."""
    rest = np.exp(-time / LAG)
    free = np.array([[1.0, LAG * (1 - rest)], [0.0, rest]])
    return free, (1 - droop) * np.array([time - LAG * (1 - rest), 1 - rest])


@cache
def loop(kp: float, dac: tuple[int, float], droop: float) -> Loop:
    """Model and bounds of the loop; a word acts from DELAY after its strobe to DELAY after the next."""
    (early, by_last), (late, by_this) = lag(DELAY, droop), lag(INTERRUPT - DELAY, droop)
    free, last = late @ early, late @ by_last
    # Deviation, velocity and last reference, from strobe to strobe; the reference is Kp times the deviation.
    step = np.array(
        [
            [1 - kp * by_this[0], -free[0, 1], -last[0]],
            [kp * by_this[1], free[1, 1], last[1]],
            [kp, 0.0, 0.0],
        ]
    )
    deviation, impulse = np.eye(1, 3), np.eye(1, 2000)[0]
    way, denominator = ss2tf(step, step @ deviation.T, deviation, [[1.0]])
    word, _ = ss2tf(step, np.array([[-by_this[0]], [by_this[1]], [1.0]]), deviation, [[0.0]])
    gc = lfilter(way[0], denominator, impulse)
    gv = np.cumsum(gc)
    return Loop(
        filter=(way[0], denominator),
        following=gv[-1],
        accelerating=np.abs(gv - gv[-1]).sum(),
        changing=np.abs(gv - gv[-1]).max(),
        stepping=np.abs(gc).max(),
        measuring=np.abs(np.diff(gc, prepend=0.0)).sum(),
        rounding=dac[1] / dac[0] / COUNT / 2 * np.abs(lfilter(word[0], denominator, impulse)).sum(),
    )


# ------------------------------------------------------------------------------------------------------------- judging


@dataclass
class TableRecord:
    """A case, interrupt by interrupt, in counts; every array has shape (n,)."""

    rows: dict[str, np.ndarray]
    late: bool
    """A pass comes between the interrupt and the row, and what it writes shows one row early."""

    def __post_init__(self) -> None:
        rows = self.rows
        z = self.at_interrupt(rows["controller.positioner.z"].astype(float))
        active = rows["controller.positioner.state"] != HOLD
        # The pass that starts may follow at once on the interrupt that has come to rest.
        speed, left = (rows[f"controller.positioner.interpolator.{name}"] for name in ("speed", "irr"))
        begun = active & (speed == 0) & (left > 0)
        self.position = rows["controller.positioner.angle.position"]
        self.deviation = z * rows["controller.positioner.dr"] / ONE
        """C less R."""
        self.command = self.position + self.deviation
        """C, on beyond every turn."""
        self.way = np.diff(self.command, prepend=self.command[0])
        self.starts = self.at_interrupt(begun | (active & ~np.roll(active, 1)))
        """First interrupts of a jog or a positioning."""

    def at_interrupt(self, seen: np.ndarray) -> np.ndarray:
        """What a register that only passes write held at each interrupt."""
        return np.concatenate([seen[:1], seen[:-1]]) if self.late else seen


def judge_angles(record: TableRecord, noise: int) -> None:
    """D, R and the position of record are one angle, and that of the motor; C is where the registers say."""
    rows = record.rows
    dar, aar = rows["controller.positioner.angle.dar"], rows["controller.positioner.angle.aar"]
    assert ((dar >= 0) & (dar < T)).all(), "D leaves its range"
    assert ((record.position - dar) % T == 0).all(), "the position of record is not the detected angle"
    assert ((aar - dar) % T == 0).all(), "R is not the detected angle"
    motor = (rows["plant.train.motor.turns"] + rows["plant.train.motor.angle"] / (2 * np.pi)) * FINE
    # Noise may show an angle just above the boundary as one just below it: that is a period, for good.
    wrong = record.position[1:] - motor[:-1]
    wrong -= T * np.round(wrong[0] / T)
    assert np.abs(wrong).max() <= noise + 1, f"the position of record is {np.abs(wrong).max()} counts wrong"
    if not record.late:
        left = rows["controller.positioner.interpolator.irr"] / ONE
        command = rows["controller.positioner.oar"] - rows["controller.positioner.z"] * left
        assert (command - aar == record.deviation).all(), "C, R and dR do not belong together"


def judge_motion(record: TableRecord, model: Loop, fastest: float, acceleration: float, inexact: float) -> float:
    """C moves as an interpolated target does, and dR is what the loop makes of that; returns the most dR may be.

    `fastest` is the largest velocity asked for, `inexact` what noise and rounding may add to dR [count].
    """
    way, deviation = record.way, record.deviation
    put = way[record.starts] + deviation[np.flatnonzero(record.starts) - 1]
    assert np.abs(put).max(initial=0) <= acceleration + 2 / ONE, "a start does not put C on the table"
    velocity = np.where(record.starts, 0.0, way)
    # A stop uses up the fraction of a count that is left, however slow it was.
    assert np.abs(velocity).max() <= max(fastest, acceleration) + 2 / ONE, f"C jumps by {np.abs(velocity).max()} counts"
    change = np.abs(np.diff(velocity, prepend=0.0))
    assert change.max() <= 2 * acceleration + 2 / ONE, f"the velocity of C jumps by {change.max()} counts"
    beyond = np.maximum(change - acceleration, 0.0).sum()
    assert beyond <= 6 * acceleration * record.starts.sum() + len(change) / ONE, "C accelerates too much too often"
    wrong = np.abs(deviation - lfilter(*model.filter, way)).max()
    assert wrong <= inexact, f"dR is {wrong} counts from what the loop makes of the way of C"
    return (
        model.following * fastest
        + model.accelerating * acceleration
        + model.changing * beyond
        + model.stepping * np.abs(way[record.starts]).sum()
        + inexact
    )


# ------------------------------------------------------------------------------------------------------------- running


class TableCase:
    """One table, what is done with it, and what came of it."""

    def __init__(self, number: int, **changes: int) -> None:
        self.rng = rng = generator(number)
        self.kp, self.droop = (20.0, 30.0, 40.0)[whole(rng, 0, 2)], 0.05 * chance(rng, 0.3)
        self.dac, self.noise = DAC_12 if chance(rng, 0.3) else FINE_DAC, (0, 0, 1, 3)[whole(rng, 0, 3)]
        self.model = loop(self.kp, self.dac, self.droop)
        self.acceleration = speed_word(300.0 * INTERRUPT) / ONE
        task_at = whole(rng, 0, 199)
        self.late = task_at % STROBE_TICKS > DELAY_TICKS
        self.rig = Rig(
            self.draw_place() * COUNT,
            task_at=task_at,
            seed=number,
            noise=float(self.noise),
            kp=self.kp,
            dac=self.dac,
            droop=self.droop,
            window=WINDOW + int(self.noise * self.model.measuring),
            judge=whole(rng, 0, 1),
            inclusive=whole(rng, 0, 1),
            **changes,
        )
        self.fastest = 0.0
        self.rows: list[dict[str, np.ndarray]] = []
        self.met: Counter[str] = Counter()

    def draw_place(self) -> int:
        """Where the table stands [count]: mostly so near the boundary that it crosses it early, or lags behind it."""
        kind = self.rng.random()
        if kind < 0.2:
            return whole(self.rng, -3, 3) % T
        if kind < 0.4:
            return whole(self.rng, 0, T - 1)
        return round(self.rng.uniform(-1.5, 1.5) * FASTEST / self.kp / COUNT) % T

    def record(self, seconds: float) -> None:
        """Let time pass."""
        self.rows.append(self.rig.record(self.rig.time + seconds, NAMES))

    def draw_speed(self, slowest: float) -> float:
        """Speed of dial or table [deg/s]."""
        speed = log_uniform(self.rng, slowest, FASTEST) if chance(self.rng, 0.6) else self.rng.uniform(40.0, FASTEST)
        self.fastest = max(self.fastest, speed_word(speed) / ONE)
        return speed

    def jog(self) -> None:
        """Hold a button, turn the dial, perhaps press the other button too, and let go."""
        sign, speed = 1 if chance(self.rng, 0.5) else -1, self.draw_speed(0.1)
        self.rig.press(sign, speed)
        far = speed > 40 and chance(self.rng, 0.25)
        self.record(self.rng.uniform(300.0, 700.0) / speed if far else log_uniform(self.rng, 0.01, 1.5))
        for _ in range(whole(self.rng, 0, 2)):
            self.rig.press(sign, self.draw_speed(0.1))
            self.rig.positioner.plus = self.rig.positioner.minus = 1
            self.record(log_uniform(self.rng, 0.01, 0.5))
        self.rig.release()
        self.record(log_uniform(self.rng, 0.005, 0.8))
        self.met["jogs"] += 1

    def move(self) -> None:
        """Go to an angle, near by the shortest way, or wherever the policy leads."""
        policy = (SHORTEST, SHORTEST, POSITIVE, NEGATIVE, AS_COMMANDED)[whole(self.rng, 0, 4)]
        target = (self.rig.detected + self.rng.uniform(-20.0, 20.0)) % 360.0
        taken = self.rig.positioner.state == HOLD
        self.rig.entry(0, target, self.draw_speed(10.0 if policy == SHORTEST else 60.0), policy).go(0)
        self.record(0.03)
        for _ in range(60):
            if self.rig.positioner.state == HOLD:
                break
            self.record(0.2)
        assert self.rig.positioner.state == HOLD, "the positioning does not end"
        self.met["moves"] += taken

    def run(self) -> None:
        """Jogs and positionings, one after another, then time to come to rest."""
        self.record(0.02)
        for _ in range(whole(self.rng, 1, 4)):
            if chance(self.rng, 0.75):
                self.jog()
            else:
                self.move()
        self.record(FASTEST / 300.0 + 0.6)
        self.met["rollovers"] += self.rig.positioner.rollovers
        self.met["crossings"] += self.rig.angle.crossings

    def judge(self) -> None:
        """The table did not jump, and rests on its target."""
        record = TableRecord({name: np.concatenate([r[name] for r in self.rows]) for name in NAMES}, self.late)
        inexact = (self.noise + 1) * self.model.measuring + self.model.rounding + 1
        judge_angles(record, self.noise)
        most = judge_motion(record, self.model, self.fastest, self.acceleration, inexact)
        assert np.abs(record.deviation).max() <= most, (
            f"dR of {np.abs(record.deviation).max()}, more than {most} counts"
        )
        word = self.dac[1] / self.dac[0] / COUNT
        speed = self.kp * most + word / 2
        assert np.abs(record.rows["controller.positioner.s4"]).max() * word <= speed, (
            "S4 is more than the following error asks for"
        )
        jump = np.abs(np.diff(record.position)).max()
        assert jump <= (1 - self.droop) * speed * INTERRUPT + 2 * self.noise + 1, f"R jumps by {jump} counts"
        left = abs(record.deviation[-1])
        assert self.rig.positioner.state == HOLD, "the table does not come to rest"
        assert left <= WINDOW + self.noise * self.model.measuring, f"at rest dR is {left} counts"
        assert 0 <= self.rig.positioner.oar < T, "the target is not brought back into the first turn"


def run_table(number: int) -> Counter[str]:
    """Draw, run and judge a case; returns what it met."""
    case = TableCase(number)
    case.run()
    case.judge()
    return case.met
