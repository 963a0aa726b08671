"""Induction noise on pulse lines: pulses inserted or taken away, samples lost or corrupted.

By rate (each kind at random moments, a mean number per second) or at chosen ticks from a list. Everything follows from
the seed and the list, so a run repeats to the byte. The next moment of all kinds is one number, so that a quiet tick
costs one comparison.
"""

from detent.kernel.noise import NoiseSource, uniform, waiting_time
from detent.kernel.registers import Registers, block, f8_array, i8, i8_array, register, u1_array
from detent.kernel.step import step

INSERT_PLUS, INSERT_MINUS, REMOVE, LOSE_SAMPLE, CORRUPT, INSERT = 0, 1, 2, 3, 4, 5
RATES = 4  # kinds that come at random: `REMOVE`, `LOSE_SAMPLE`, `CORRUPT` and `INSERT`, a pulse inserted of either sign
ENTRIES = 64
NEVER = 1 << 62


class InterferenceParams(Registers):
    """What disturbs the lines, and when."""

    mean_ticks: f8_array = register(
        "mean ticks between events: pulses removed, samples lost, samples corrupted, pulses inserted; 0 never",
        unit="tick",
        length=RATES,
    )
    entries: i8 = register("entries of the list in use", unit="count")
    tick: i8_array = register("list: tick of each event, in order", unit="tick", length=ENTRIES)
    kind: u1_array = register("list: what happens", unit="code", length=ENTRIES)


class Interference(Registers):
    """What has come and what comes next."""

    next_tick: i8 = register("first tick at which something happens", unit="tick")
    next_random: i8_array = register("next tick of each random kind", unit="tick", length=RATES)
    next_entry: i8 = register("first entry of the list still to come", unit="count")
    plus: i8 = register("pulses inserted at this tick, forward", unit="count")
    minus: i8 = register("pulses inserted at this tick, backward", unit="count")
    remove: i8 = register("pulses still to be taken away", unit="count")
    lose_sample: i8 = register("samples still to be lost", unit="count")
    corrupt: i8 = register("1 when the sample of this tick is inverted", unit="count")
    inserted: i8 = register("pulses inserted so far", unit="count")
    removed: i8 = register("pulses removed so far", unit="count")
    lost: i8 = register("samples lost so far", unit="count")
    corrupted: i8 = register("samples inverted so far", unit="count")
    noise: NoiseSource = block("moments and signs")


@step
def strike(r: Interference, kind: int) -> None:
    """One event."""
    if kind == INSERT:
        kind = INSERT_PLUS if uniform(r.noise) < 0.5 else INSERT_MINUS
    if kind == INSERT_PLUS:
        r.plus += 1
        r.inserted += 1
    elif kind == INSERT_MINUS:
        r.minus += 1
        r.inserted += 1
    elif kind == REMOVE:
        r.remove += 1
    elif kind == LOSE_SAMPLE:
        r.lose_sample += 1
    elif kind == CORRUPT and r.corrupt == 0:
        r.corrupt = 1
        r.corrupted += 1


@step
def interfere(p: InterferenceParams, r: Interference, tick: int) -> None:
    """What happens at this tick, and when something happens next; to be called when ``tick >= next_tick``."""
    r.plus = 0
    r.minus = 0
    r.corrupt = 0
    while r.next_entry < p.entries and p.tick[r.next_entry] <= tick:
        strike(r, p.kind[r.next_entry])
        r.next_entry += 1
    for k in range(RATES):
        if r.next_random[k] <= tick:
            strike(r, REMOVE + k)
            r.next_random[k] = tick + 1 + int(p.mean_ticks[k] * waiting_time(r.noise))
    plan_next(p, r, tick)


@step
def plan_next(p: InterferenceParams, r: Interference, tick: int) -> None:
    """The next tick at which something happens; the one after an event, which clears what it put in, counts."""
    soonest = p.tick[r.next_entry] if r.next_entry < p.entries else NEVER
    for k in range(RATES):
        soonest = min(soonest, r.next_random[k])
    if r.plus or r.minus or r.corrupt:
        soonest = tick + 1
    r.next_tick = soonest


@step
def count_losses(r: Interference, pulses: int, samples: int) -> None:
    """The lines have lost so many pulses and samples, of those that were to be lost."""
    r.remove -= pulses
    r.removed += pulses
    r.lose_sample -= samples
    r.lost += samples


def start_interference(p: InterferenceParams, r: Interference, seed: int) -> None:
    """Power-on; `seed` decides every random moment."""
    r.noise.state = seed
    r.next_entry = 0
    r.plus = r.minus = r.corrupt = 0
    for k in range(RATES):
        mean = p.mean_ticks[k]
        r.next_random[k] = 1 + int(mean * waiting_time(r.noise)) if mean > 0.0 else NEVER
    plan_next(p, r, 0)
