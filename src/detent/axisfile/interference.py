"""From the tables of disturbances to the parameters of the blocks that disturb; the same for every method."""

from detent.axisfile.tables import InterferenceTable, PushTable
from detent.plant.push import Push
from detent.sensing.interference import CORRUPT, INSERT_MINUS, INSERT_PLUS, LOSE_SAMPLE, REMOVE, InterferenceParams

KINDS = {"+": INSERT_PLUS, "-": INSERT_MINUS, "remove": REMOVE, "lose sample": LOSE_SAMPLE, "corrupt": CORRUPT}


def fill_interference(p: InterferenceParams, table: InterferenceTable, tick: float) -> None:
    """Fill rates and list; `tick` is the base tick [s]."""
    for k, rate in enumerate((table.removed, table.lost_samples, table.corrupted, table.inserted)):
        p.mean_ticks[k] = 1 / (rate * tick) if rate > 0 else 0.0
    burst = table.burst
    if burst is None:
        return
    ticks = burst.ticks
    if burst.at is not None:
        ticks = [round((burst.at + k * burst.spacing) / tick) for k in range(burst.count)]
    p.entries = len(ticks)
    for k, moment in enumerate(sorted(ticks)):
        p.tick[k], p.kind[k] = moment, KINDS[burst.kind]


def fill_push(p: Push, table: PushTable | None, tick: float) -> None:
    """Fill the disturbing force; `tick` is the base tick [s]."""
    if table is not None:
        p.force = table.force
        p.begin, p.end = round(table.at / tick), round((table.at + table.duration) / tick)
