"""The plants for which gains are chosen: what the intervals of ``[tolerance]`` make of one specification.

Nominal first, then all corners of the keys that matter most, then places of a Latin hypercube, as McKay, Beckman,
Conover (1979) made it; other random places are kept to check a choice with plants that it has not seen.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from detent.axisfile.tables import AxisSpec
from detent.axisfile.tolerance import Tolerance

CORNERS = 6  # keys whose ends are combined in every way
HYPERCUBE = 64  # places
SEED = 1
EDGE = 1e-9  # an end of an interval, as a share


@dataclass(frozen=True, slots=True)
class Variant:
    """A plant: what it is called, the values of the keys that are not known, and the specification with them."""

    values: Mapping[str, float]
    spec: Any

    @property
    def is_nominal(self) -> bool:
        """True where it is the file's."""
        return not self.values


class Plants:
    """All plants of an axis file."""

    def __init__(self, spec: AxisSpec, tolerance: Mapping[str, Tolerance]) -> None:
        self.spec, self.tolerance = spec, dict(tolerance)
        self.nominal = Variant({}, spec)

    def at(self, shares: Mapping[str, float]) -> Variant:
        """The plant at a place: of each key, the share of all values that lie below."""
        values = {key: self.tolerance[key].at(min(max(share, EDGE), 1.0 - EDGE)) for key, share in shares.items()}
        values = {key: self.end(key, shares[key], value) for key, value in values.items()}
        return Variant(values, self.spec.varied(values))

    def end(self, key: str, share: float, value: float) -> float:
        """The value, at an end that of the interval: a normal distribution has none."""
        one = self.tolerance[key]
        return one.low if share <= 0.0 else one.high if share >= 1.0 else value

    def ends(self, key: str) -> tuple[Variant, Variant]:
        """Both ends of one interval."""
        return self.at({key: 0.0}), self.at({key: 1.0})

    def corners(self, keys: Sequence[str]) -> Iterator[Variant]:
        """All combinations of the ends of some keys."""
        for places in product((0.0, 1.0), repeat=len(keys)):
            yield self.at(dict(zip(keys, places, strict=True)))

    def hypercube(self, count: int, keys: Sequence[str], seed: int = SEED) -> Iterator[Variant]:
        """Places of which each key's are spread evenly."""
        chance = np.random.Generator(np.random.Philox(key=seed))
        columns = [(chance.permutation(count) + chance.random(count)) / count for _ in keys]
        for row in np.array(columns).T.tolist():
            yield self.at(dict(zip(keys, row, strict=True)))

    def random(self, count: int, keys: Sequence[str], seed: int) -> Iterator[Variant]:
        """Places at random."""
        for row in np.random.Generator(np.random.Philox(key=seed)).random((count, len(keys))).tolist():
            yield self.at(dict(zip(keys, row, strict=True)))
