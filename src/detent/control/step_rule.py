"""The rule of the stepper envelope: raise, hold or lower before every step (stepper-envelope specification 3.3 to 3.5).

While a step runs, the entry of the next one is read and compared with the present ramp index; that is all the motion
costs. The ramp list may hold frequencies or the timer's reload values: the comparison is one of indices, which neither
the reversed order of reloads nor equal neighbours among them can disturb.

The literal rule of the claim sets the frequency of the entry, whatever the present one is. It is safe on the envelope
only, that is for runs that begin at a start extreme.
"""

from detent.kernel.loop import i2_signal
from detent.kernel.registers import Registers, i1, i2, i4, i4_array, i8, register, u1, u2
from detent.kernel.step import hot_step, step

REST, ACCEL, CRUISE, DECEL, TURN, FAULT = 0, 1, 2, 3, 4, 5  # states of specification 4
IDLE, STEP, PAUSE = 0, 1, 2  # what comes next: nothing, a step with the frequency of `word`, the wait of a reversal
INFEASIBLE, OUT_OF_RANGE = 1, 2  # causes of a fault
AT_REST = -1  # ramp index of a motor that stands; also the entry of a step that is not allowed
OUTSIDE = -2  # in place of an entry: the motor is beyond the ends of the table
RAMP = 2048
LIMITS = 16


class StepRuleParams(Registers):
    """Ramp list, zone limits and what an entry of the table consists of."""

    ramp: i4_array = register(
        "word of each ramp index: frequency [Hz] or period [tick]", unit="count", length=RAMP, table=True
    )
    limit: i4_array = register("word of each zone limit: frequency [Hz] or period [tick]", unit="count", length=LIMITS)
    index_mask: i4 = register("bits of an entry that hold the ramp index", unit="code", range=(0, RAMP - 1))
    zone_shift: u1 = register("place of the zone number in an entry", unit="bit", range=(11, 15))
    last: i2 = register("last index of the ramp list", unit="count", range=(0, RAMP - 1))
    reload: u1 = register("1: words are periods, a larger one is slower", option=True)
    literal: u1 = register("1: the literal rule of the claim, without a limit on the change", option=True)


class StepRule(Registers):
    """Registers of one motor's control unit and the lines from and to the host."""

    start: u1 = register("1: start signal of an automatic move, written by the host, cleared when taken")
    heading: i1 = register("direction wanted, written by the host: 1 or -1; a running motor slows down to turn")
    turns: u2 = register("reversals at sentinels that the automatic move still has to make", unit="count")
    manual: u1 = register("1: the operator has taken over")
    request: i2 = register(
        "ramp index that the operator asks for, -1 when released", unit="count", range=(-1, RAMP - 1)
    )
    request_word: i4 = register("word that the operator asks for", unit="count")
    reset: u1 = register("leave a fault, written by the host, cleared when done")
    event: u1 = register("1 when the motor has come to rest; the host clears it")
    active: u1 = register("1 during an automatic move")
    state: u1 = register("0 rest, 1 accelerate, 2 cruise, 3 decelerate, 4 turn, 5 fault", unit="code")
    cause: u1 = register("of the last fault: 1 the envelope fell too fast, 2 position out of range", unit="code")
    index: i2 = register("ramp index of the running step, -1 at rest", unit="count", range=(-1, RAMP - 1))
    word: i4 = register("frequency [Hz] or period [tick] of the running step, 0 at rest", unit="count")
    relation: i1 = register("last comparison of present and permissible: -1 less, 0 equal, 1 greater")
    direction: i1 = register("direction line: 1 or -1")
    position: i8 = register("steps made, forward less backward", unit="count")


@hot_step
def slower(p: StepRuleParams, one: int, other: int) -> int:
    """The word of the lower frequency."""
    return max(one, other) if p.reload else min(one, other)


@hot_step
def entry_word(p: StepRuleParams, entry: int) -> int:
    """Permissible frequency of an entry, as a word; 0 for the sentinel."""
    if entry < 0:
        return 0
    return slower(p, p.ramp[entry & p.index_mask], p.limit[entry >> p.zone_shift])


@hot_step
def compare_words(p: StepRuleParams, present: int, permissible: int) -> int:
    """-1, 0 or 1 for a present frequency below, at or above the permissible one; 0 is standstill, reload or not."""
    if present == permissible:
        return 0
    faster = present < permissible if p.reload and present and permissible else present > permissible
    return 1 if faster else -1


@hot_step
def follow(r: StepRule, permissible: int, goal: int) -> int:
    """One index up, none or one down, towards `goal`; that must reach `permissible` when it falls. The new one.

    Three-way comparison and increment: with the table read, the whole cost of a step.
    """
    index = r.index
    if index == goal:
        r.relation, r.state = 0, CRUISE
        return index
    if index < goal:
        r.relation, r.state = -1, ACCEL
        r.index = index + 1
        return r.index
    r.index = index - 1
    r.relation = 1
    if r.state != FAULT:
        r.state = DECEL
        if r.index > permissible:
            r.state, r.cause = FAULT, INFEASIBLE
    return r.index


@hot_step
def follow_literally(p: StepRuleParams, r: StepRule, entry: int, goal: int) -> int:
    """The claim's rule: the frequency becomes that of the entry, by however much that is. The new index."""
    r.relation = compare_words(p, r.word, entry_word(p, entry))
    r.state = CRUISE
    if r.relation:
        r.state = ACCEL if r.relation < 0 else DECEL
    r.index = goal
    return r.index


@hot_step
def wanted_index(r: StepRule, permissible: int) -> int:
    """Ramp index to go for: what the table allows, what the operator asks for, or rest."""
    if r.state == FAULT or r.heading != r.direction:
        return AT_REST
    if r.active:  # never under the operator's hand
        return permissible
    return min(permissible, r.request) if r.manual else AT_REST


@hot_step
def take_inputs(r: StepRule, entry: int) -> bool:
    """Lines of the host, read before every step; True when the motor runs or may be set running."""
    if r.index >= 0 and not (r.reset | r.manual | r.start):  # what nearly every step finds
        return True
    if r.reset:
        r.reset = r.start = 0
        if r.index < 0:
            r.state = REST
    if r.manual:
        r.start = r.active = 0
    if r.start and r.state != FAULT:
        r.start, r.active = 0, 1
    if r.index >= 0:
        return True
    if r.state == FAULT or not (r.active or (r.manual and r.request >= 0)):
        return False
    r.direction = r.heading
    if entry == OUTSIDE:
        r.state, r.cause = FAULT, OUT_OF_RANGE
        r.active, r.event = 0, 1
        return False
    return True


@hot_step
def come_to_rest(r: StepRule, permissible: int, moved: bool) -> int:
    """No further step in this direction: turn where a reversal is due, else rest."""
    r.word = 0
    if r.active and permissible < 0 and r.turns > 0:
        r.turns -= 1
        r.heading = -r.direction
    if r.state != FAULT and r.heading != r.direction and (r.active or (r.manual and r.request >= 0)):
        r.direction = r.heading
        r.state = TURN
        return PAUSE
    if moved or r.active:
        r.event = 1
    r.active = 0
    if r.state != FAULT:
        r.state = REST
    return IDLE


@hot_step
def next_entry(r: StepRule, up: i2_signal, down: i2_signal) -> int:
    """Entry of the next step, read while the present one runs; no other step of the rule takes the tables."""
    if not (0 <= r.position < len(up) and r.position < len(down)):
        return OUTSIDE
    forward = (r.heading if r.index < 0 else r.direction) > 0
    return int((up if forward else down)[r.position])


@hot_step
def next_step(p: StepRuleParams, r: StepRule, entry: int) -> int:
    """Decide about the next step, and make it."""
    if not take_inputs(r, entry):
        return IDLE
    if r.state == FAULT:
        entry = AT_REST  # a motor in fault slows down whatever the table says, even beyond the travel
    permissible = entry & p.index_mask if entry >= 0 else AT_REST
    goal = wanted_index(r, permissible)
    moved = r.index >= 0
    if p.literal:  # noqa: SIM108 - both write: C has no order for such effects in a choice
        index = follow_literally(p, r, entry, goal)
    else:
        index = follow(r, permissible, goal)
    if index < 0:
        return come_to_rest(r, permissible, moved)
    permitted = p.ramp[index]
    if entry >= 0:
        permitted = slower(p, permitted, p.limit[entry >> p.zone_shift])
    word = permitted
    if r.manual and index == r.request and compare_words(p, r.request_word, permitted) < 0:
        word = r.request_word
    r.word = word
    r.position += r.direction
    return STEP


@step
def place_motor(r: StepRule, position: int) -> None:
    """Power-on or homing: the motor stands at `position` [step]."""
    r.position = position
    r.index = r.request = AT_REST
    r.direction = r.heading = 1
    r.word = 0
    r.state = REST


@step
def start_move(r: StepRule, heading: int, turns: int) -> None:
    """Start signal for an automatic move to the sentinel of a direction, with `turns` reversals on the way."""
    r.heading, r.turns, r.start, r.manual, r.event = heading, turns, 1, 0, 0


@step
def deflect(p: StepRuleParams, r: StepRule, word: int, last: int, heading: int) -> None:
    """The operator takes over and asks for a frequency [Hz], or with reload words a period [tick]; 0 releases."""
    r.manual, r.heading, r.event = 1, heading, 0
    r.request_word = word
    # The first index that is fast enough; of several with this very word the last, which the motor passes them to.
    wanted = 0
    for k in range(last + 1):
        if compare_words(p, p.ramp[k], word) < 0:
            wanted = min(k + 1, last)
        elif p.ramp[k] == word:
            wanted = k
    r.request = AT_REST if word == 0 else wanted


@step
def release(r: StepRule) -> None:
    """The operator lets go: the motor comes down its ramp and rests."""
    r.manual, r.request, r.request_word, r.event = 1, AT_REST, 0, 0


@step
def acknowledge(r: StepRule) -> None:
    """The host has seen the event: time may pass on."""
    r.event = 0
