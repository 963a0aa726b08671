"""The gains of a cascade axis or a PID: the most integral stiffness that a bound on Ms leaves, over a set of plants.

    L_v = C V        L = C (K_p P + V)        T = C K_p P / (1 + L)        C = K_v + K_i T_s z / (z - 1)

P, V : from a command to the position and the velocity, as they are read        C : law of the velocity loop
L_v, L : loops cut open at the velocity and at the command        T : from the reference to the position

Largest K_i K_p with max |1/(1 + L)| and max |1/(1 + L_v)| at most Ms, max |T| at most the overshoot, and one count of
the velocity moving the drive by no more than a tenth of what it can: the optimum of the integral gain under a bound on
the sensitivity (Astrom, Panagopoulos, Hagglund 1998, Automatica 34; Astrom, Hagglund 2006, Advanced PID Control,
ch. 7), for three gains. A PID is sought among those with the same law at the command: proportional K_v K_p + K_i,
integral K_i K_p, derivative K_v; its zeros are then real.

The search has no random numbers and no gradient: it looks at places of a lattice, and its answer has three digits.
"""

import math
from collections.abc import Callable, Container, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from detent.analysis.margins import largest_level
from detent.methods.cascade.checks import LARGEST_JUMP, directions
from detent.methods.cascade.derive import CascadeFigures
from detent.methods.cascade.schema import CascadeSpec
from detent.methods.tuning import DIGITS, Bounds, Response, Share, Tuning, digits
from detent.units import format_quantity

Numbers = NDArray[np.float64]
Phasors = NDArray[np.complex128]

RATIOS = np.geomspace(1e-3, 1.0, 40)  # times of the integral, Kv/Ki, that are tried first [s]
LEVELS = np.geomspace(1e-5, 10.0, 73)  # Kv that are tried for each, over that which crosses at a twentieth of the rate
SHARES = np.linspace(0.3, 1.0, 8)  # of the largest Kv that are tried for each
OUTER = 1e-6, 0.5  # smallest and largest Kp that is looked at, over the sample rate
POINTS, DECADES = 500, 4.0  # frequencies of the search, and how far below half the sample rate they begin
AROUND = 60  # more of them inside each resonance
COARSE, FINE = 10, 22  # halvings of an interval, in the logarithm
ROUNDS, PLACES = 4, 7  # of looking closer at the best, and places each way
FRONT = (0.7, 0.5, 0.35, 0.25)  # of the largest J: the quieter gains of which the quickest are chosen
WITHIN = 1.002  # of their bounds, where the gains of the file lie that nothing quieter replaces
EXACT = 12  # plants of which the worst bound is looked at exactly
CLOSE = 0.99  # of its bound, from which one decides
NEAR = 0.2  # of the frequency of the resonance, within which a peak is its
BOUNDS = (
    "a count of the velocity moves the command by {0:.0f} % of its largest",
    "Ms at the command is {0:.3g} at {1}", "the overshoot is {0:.3g} at {1}", "Ms at the velocity is {0:.3g} at {1}",
)  # fmt: skip
"""What is bounded, in words, with its value and the frequency of it."""


class Gains:
    """Candidates: columns Kp, Kv, Ki of shape (n,), as a cascade has them."""

    def __init__(self, kp: Any, kv: Any, ki: Any) -> None:
        self.kp, self.kv, self.ki = (np.atleast_1d(np.asarray(x, np.float64)) for x in np.broadcast_arrays(kp, kv, ki))

    @property
    def worth(self) -> Numbers:
        """J = Ki Kp."""
        return self.ki * self.kp

    def at(self, which: Any) -> "Gains":
        """Some of them."""
        return Gains(self.kp[which], self.kv[which], self.ki[which])

    @property
    def pid(self) -> tuple[Numbers, Numbers, Numbers]:
        """Proportional, integral and derivative gain of the PID with the same law at the command."""
        return self.kv * self.kp + self.ki, self.ki * self.kp, self.kv


class PidGains(Gains):
    """A PID as a file has it: its zeros need not be real, as those of a cascade are."""

    def __init__(self, proportional: float, derivative: float, integral: float) -> None:
        super().__init__(math.nan, derivative, integral)
        self.proportional = np.array([proportional], np.float64)

    @property
    def pid(self) -> tuple[Numbers, Numbers, Numbers]:
        """As they are stated."""
        return self.proportional, self.ki, self.kv


class Plant:
    """What the gains act on: responses on a grid, and exact ones where they are asked for."""

    def __init__(self, spec: CascadeSpec) -> None:
        figures = CascadeFigures(spec)
        self.spec, self.loop, self.pid = spec, figures.loop, spec.method.structure == "pid"
        share = self.loop.velocity_share * figures.counted_velocity * (self.loop.derivative_share if self.pid else 1.0)
        #: Kv by which one count of the velocity moves the drive as far as it may
        self.most_gain = LARGEST_JUMP * spec.largest_command / share if share > 0.0 else math.inf

    @cached_property
    def resonance(self) -> float:
        """The masses swing against one another on their coupling [Hz]; 0 for a rigid axis."""
        modes = np.linalg.eigvals(self.loop.plant.a) / math.tau
        return float(np.abs(modes[np.argmax(modes.imag)])) if np.any(modes.imag > 0.0) else 0.0

    @cached_property
    def frequencies(self) -> Numbers:
        """Where it is looked at in the search [Hz]."""
        modes = np.linalg.eigvals(self.loop.plant.a) / math.tau
        near = [m.imag + np.linspace(-4.0, 4.0, AROUND) * max(-m.real, 1e-4 * m.imag) for m in modes if m.imag > 0.0]
        last = 0.5 / self.loop.period
        grid = np.concatenate([np.geomspace(last * 10**-DECADES, last, POINTS), *near])
        return np.unique(grid[(grid > 0.0) & (grid <= last)])

    @cached_property
    def paths(self) -> tuple[Phasors, Phasors, Phasors]:
        """Responses on the grid."""
        return self.loop.paths(self.frequencies)

    def levels(self, g: Gains, bounds: Bounds) -> Numbers:
        """By how much candidates exceed the worst of their bounds on the grid, shape (n,): 1 is at the bound."""
        at_count = g.kv / self.most_gain
        return np.maximum(at_count, np.max(self._ratios(g, bounds, self.paths), axis=(0, 2)))

    def _ratios(self, g: Gains, bounds: Bounds, paths: tuple[Phasors, Phasors, Phasors]) -> Numbers:
        """Sensitivities at command and velocity, and transmission, over their bounds; shape (3, n, frequencies)."""
        position, velocity, summed = paths
        kp, kv, ki = g.kp[:, None], g.kv[:, None], g.ki[:, None]
        if self.pid:
            proportional, integral, derivative = (one[:, None] for one in g.pid)
            outer, inner = (proportional + integral * summed) * position, derivative * velocity
        else:
            law = kv + ki * summed
            outer, inner = law * (kp * position), law * velocity
        through = 1.0 / np.maximum(np.abs(1.0 + inner + outer), 1e-300)
        found = np.zeros((3, *inner.shape))
        found[0] = through / bounds.sensitivity
        found[1] = np.abs(outer) * through / bounds.overshoot
        if not self.pid:
            found[2] = 1.0 / (bounds.sensitivity * np.maximum(np.abs(1.0 + inner), 1e-300))
        return found

    def worst(self, g: Gains, bounds: Bounds) -> float:
        """The same of one candidate, each peak looked at closer; infinite where it does not settle."""
        return max(level for level, _ in self.exactly(g, bounds)) if self.settles(g)[0] else math.inf

    def exactly(self, g: Gains, bounds: Bounds) -> list[tuple[float, float]]:
        """By how much one candidate exceeds each of its bounds, in the order of `BOUNDS`, and where that is [Hz]."""
        levels = self._ratios(g, bounds, self.paths)[:, 0]
        found = [(float(g.kv[0]) / self.most_gain, math.nan)]
        for k in range(3):

            def level(at: Numbers, k: int = k) -> Numbers:
                return self._ratios(g, bounds, self.loop.paths(at))[k, 0]

            found.append(largest_level(level, self.frequencies, levels[k]))
        return found

    def settles(self, g: Gains) -> NDArray[np.bool_]:
        """Whether every mode decays, shape (n,)."""
        bare, *parts = self._transitions
        gains = g.pid if self.pid else (g.kv, g.ki, g.kv * g.kp, g.ki * g.kp)
        whole = np.repeat(bare[None], len(g.kv), axis=0)
        for gain, part in zip(gains, parts, strict=True):
            whole += gain[:, None, None] * part
        whole[g.ki == 0.0, :, -2] = 0.0  # an integral that nobody uses stays where it is
        return np.max(np.abs(np.linalg.eigvals(whole)), axis=1) < 1.0

    @cached_property
    def _transitions(self) -> list[Numbers]:
        """The closed loop from sample to sample without gains, and what each product of gains adds to it."""
        if self.pid:
            bare, *ones = (self._transition(proportional=p, integral=i + 1e-300, derivative=d)
                           for p, i, d in ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)))  # fmt: skip
            return [bare, *(one - bare for one in ones)]
        bare, kv, ki, both_kv, both_ki = (
            self._transition(position_gain=p, velocity_gain=v, velocity_integral=i + 1e-300)
            for p, v, i in ((0, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0), (1, 0, 1))
        )
        return [bare, kv - bare, ki - bare, both_kv - kv, both_ki - ki]

    def _transition(self, **gains: float) -> Numbers:
        loop = copy(self.loop)  # with its plant from sample to sample
        loop.spec = self.spec.changed(method=gains)
        return loop.transition()


@dataclass(frozen=True)
class Search:
    """The choice over several plants."""

    plants: Sequence[Plant]
    bounds: Bounds
    held: Mapping[str, float]  # of "kp", "kv", "ki"
    least: float = 0.0  # J that must be reached with as little Kv as will do; 0: as much J as will do

    def best(self) -> Gains | None:
        """The best candidate, with three digits; None where there is none."""
        kv, ki = self._first()
        found = self._best_of(kv, ki, COARSE)
        if found is None:
            return None
        steps = [0.0 if name in self.held else step for name, step in (("kv", 0.15), ("ki", 0.2))]
        for _ in range(ROUNDS):
            places = np.linspace(-1.0, 1.0, PLACES)
            kv, ki = (x.ravel() for x in np.meshgrid(*(np.exp(step * places) for step in steps), indexing="ij"))
            closer = self._best_of(found.kv[0] * kv, found.ki[0] * ki, FINE)
            found = closer if closer is not None and self._rank(closer)[0] > self._rank(found)[0] else found
            steps = [step / 3 for step in steps]
        return self._rounded(found)

    @property
    def rate(self) -> float:
        """Samples a second [Hz]."""
        return 1.0 / self.plants[0].loop.period

    def keep(self, g: Gains) -> NDArray[np.bool_]:
        """Which candidates keep every bound on every plant."""
        fine = np.ones(len(g.kp), bool)
        for plant in self.plants:
            asked = np.flatnonzero(fine)
            fine[asked] = plant.levels(g.at(asked), self.bounds) <= 1.0
            asked = np.flatnonzero(fine)
            fine[asked] = plant.settles(g.at(asked))
        return fine

    def _rank(self, g: Gains) -> Numbers:
        """What is made large."""
        return -g.kv if self.least else g.worth if np.any(g.ki > 0.0) else g.kp * g.kv

    def _first(self) -> tuple[Numbers, Numbers]:
        """Kv and Ki of the candidates to begin with."""
        _, velocity, _ = self.plants[0].loop.paths(np.array([0.05 * self.rate]))
        tried = np.array([self.held["kv"]]) if "kv" in self.held else LEVELS / abs(velocity[0])
        if "ki" in self.held:
            return tried, np.full(len(tried), self.held["ki"])
        if "kv" in self.held:
            return np.full(len(RATIOS), tried[0]), tried[0] / RATIOS
        most = self._largest_inner(tried)
        kv = (most[:, None] * SHARES).ravel()
        return kv, kv / np.repeat(RATIOS, len(SHARES))

    def _largest_inner(self, tried: Numbers) -> Numbers:
        """Largest Kv for each time of the integral with which the inner loop alone keeps its bound; 0 for none."""
        least, most = OUTER[0] * self.rate, np.zeros(len(RATIOS))
        for k, ratio in enumerate(RATIOS):
            fine = np.flatnonzero(self.keep(Gains(least, tried, tried / ratio)))
            most[k] = tried[fine[-1]] if len(fine) else 0.0
        return self._up_to(
            lambda kv: self.keep(Gains(least, kv, kv / RATIOS)), most, most * LEVELS[1] / LEVELS[0], COARSE
        )

    def _up_to(
        self, keeps: Callable[[Numbers], NDArray[np.bool_]], low: Numbers, high: Numbers, halvings: int
    ) -> Numbers:
        """Largest values that keep the bounds, from ones that do up to ones that need not."""
        for _ in range(halvings):
            middle = np.sqrt(low * high)
            fine = keeps(middle)
            low, high = np.where(fine, middle, low), np.where(fine, high, middle)
        return low

    def _best_of(self, kv: Numbers, ki: Numbers, halvings: int) -> Gains | None:
        """The best of all pairs of Kv and Ki, each with its Kp: what is held, what reaches J, or the largest."""
        if "kp" in self.held or self.least:
            kp = self.held["kp"] if "kp" in self.held else self.least / np.maximum(ki, 1e-300)
            g = Gains(kp, kv, ki)
            g = g.at(np.flatnonzero((g.kv > 0.0) & (g.worth >= self.least * (1 - 1e-9)) & (g.kp < self.rate)))
            g = g.at(np.flatnonzero(self.keep(g)))
        else:
            g = Gains(OUTER[0] * self.rate, kv, ki)
            g = g.at(np.flatnonzero(g.kv > 0.0))
            g = g.at(np.flatnonzero(self.keep(g)))
            most = np.full(len(g.kp), OUTER[1] * self.rate)
            g = Gains(self._up_to(lambda kp: self.keep(Gains(kp, g.kv, g.ki)), g.kp, most, halvings), g.kv, g.ki)
        return g.at([int(np.argmax(self._rank(g)))]) if len(g.kp) else None

    def worst(self, kp: float, kv: float, ki: float) -> float:
        """The worst bound of one candidate over all plants, exactly."""
        return max(plant.worst(Gains(kp, kv, ki), self.bounds) for plant in self.plants)

    def _rounded(self, g: Gains) -> Gains | None:
        """The candidate with three digits, the last one set by the exact peaks; None where they are not kept."""
        kp, kv, ki = (float(x[0]) for x in (g.kp, g.kv, g.ki))
        ki = self.held["ki"] if "ki" in self.held else digits(ki, round)
        towards = math.ceil if self.least else math.floor
        first = self.held.get("kv", digits(kv, towards))
        tried = [first] if "kv" in self.held else [digits(first * (1 + k * 10**-DIGITS), towards)
                                                    for k in range(0, 40, 2)]  # fmt: skip
        if not self.least and "kv" not in self.held:
            tried = [digits(first * (1 - k * 10**-DIGITS), towards) for k in range(0, 200, 2)]
        low = self.held.get("kp", digits(self.least / ki, math.ceil) if self.least else OUTER[0] * self.rate)
        kv = next((kv for kv in tried if self.worst(low, kv, ki) <= 1.0), 0.0)
        if kv == 0.0:
            return None
        if "kp" in self.held or self.least:
            return Gains(low, kv, ki)
        low, high = (kp, 2.0 * kp) if self.worst(kp, kv, ki) <= 1.0 else (0.5 * kp, kp)
        for _ in range(FINE):
            middle = math.sqrt(low * high)
            low, high = (middle, high) if self.worst(middle, kv, ki) <= 1.0 else (low, middle)
        return Gains(digits(low, math.floor), kv, ki)


RECORDINGS = {
    "short ramps both ways, with the reference (`detent identify LOG --job FILE` writes them)":
        "motor_mass load_mass rotor_inertia torque_constant current_per_volt force_per_volt voltage_gain resistance",
    "a chirp or noise through the resonance, with the effort (`detent analyse`), or a ring-down after a stop":
        "stiffness damping",
    "sharp changes of acceleration, at the sample rate of the loops": "delay",
    "several steady speeds, both ways": "viscous coulomb",
    "creeping moves with reversals, at least 20 break-aways each way": "static stribeck",
    "slow reversals with an encoder on the load, under both signs of load": "backlash",
}  # fmt: skip
"""What would narrow an interval, and of which keys."""


class CascadeTuning(Tuning):
    """What `tune` asks."""

    goals = ("stiff", "quiet", "quick")
    worth_text = "integral stiffness Ki Kp"
    recordings: Mapping[str, str] = {key: text for text, keys in RECORDINGS.items() for key in keys.split()}

    def __init__(self, spec: CascadeSpec) -> None:
        pid = spec.method.structure == "pid"
        names = (
            ("proportional", "derivative", "integral")
            if pid
            else ("position_gain", "velocity_gain", "velocity_integral")
        )
        self.spec, self.pid, self.keys = spec, pid, tuple(f"method.{name}" for name in names)
        self.stated = {f"method.{name}": float(getattr(spec.method, name)) for name in names}
        self._plants: dict[int, tuple[Any, Plant]] = {}

    def plant(self, spec: CascadeSpec) -> Plant:
        """The plant of a specification, made once."""
        if id(spec) not in self._plants:
            self._plants[id(spec)] = spec, Plant(spec)
        return self._plants[id(spec)][1]

    def choose(
        self, plants: Sequence[CascadeSpec], bounds: Bounds, goal: str, held: Mapping[str, float]
    ) -> dict[str, float]:
        """The gains; empty where none keeps the bounds on every plant."""
        found = self._choose(plants, bounds, held, self.worth(self.stated) if goal == "quiet" else 0.0)
        if not found and goal == "quiet" and max(self.worst(plants, self.stated, bounds)) <= WITHIN:
            return dict(self.stated)  # at the bound already: nothing is quieter
        return found

    def _choose(
        self, plants: Sequence[CascadeSpec], bounds: Bounds, held: Mapping[str, float], least: float
    ) -> dict[str, float]:
        """The stiffest gains, or the quietest ones with at least such a stiffness."""
        short = {key: held[long] for key, long in zip(("kp", "kv", "ki"), self.keys, strict=True) if long in held}
        found = Search([self.plant(spec) for spec in plants], bounds, short, least).best()
        return self.values_of(found) if found is not None else {}

    def gains_of(self, values: Mapping[str, float]) -> Gains:
        """Gains of the file as a candidate."""
        return (PidGains if self.pid else Gains)(*(values[key] for key in self.keys))

    def values_of(self, g: Gains) -> dict[str, float]:
        """Gains as the file has them."""
        kp, kv, ki = float(g.kp[0]), float(g.kv[0]), float(g.ki[0])
        if self.pid:
            proportional, integral, derivative = (float(one[0]) for one in g.pid)
            return dict(zip(self.keys, (proportional, derivative, integral), strict=True))
        return dict(zip(self.keys, (kp, kv, ki), strict=True))

    def worst(self, plants: Sequence[CascadeSpec], values: Mapping[str, float], bounds: Bounds) -> list[float]:
        """By how much each plant exceeds the worst of its bounds; those near the worst of them exactly."""
        g = self.gains_of(values)
        made = [self.plant(spec) for spec in plants]
        levels = [float(plant.levels(g, bounds)[0]) for plant in made]
        near = sorted(range(len(made)), key=lambda k: -levels[k])[:EXACT]
        for k in near:
            levels[k] = made[k].worst(g, bounds)
        return levels

    def worth(self, values: Mapping[str, float]) -> float:
        """J = Ki Kp [V/(m s)]."""
        kp, _, ki = (values[key] for key in self.keys)
        return ki if self.pid else ki * kp

    def front(self, plants: Sequence[CascadeSpec], bounds: Bounds, held: Mapping[str, float]) -> list[dict[str, float]]:
        """The stiffest gains, then the quietest ones of each share of that stiffness."""
        stiffest = self._choose(plants, bounds, held, 0.0)
        if not stiffest or not self.worth(stiffest):
            return [stiffest] if stiffest else []
        quieter = (self._choose(plants, bounds, held, share * self.worth(stiffest)) for share in FRONT)
        return [stiffest, *(values for values in quieter if values)]

    def settling(self, result: Any) -> float:
        """How long the slowest move of a run took [s]; infinite where one did not settle."""
        times = [move.settling for move in result.moves]
        return max(times, default=math.inf) if result.done and not any(map(math.isnan, times)) else math.inf

    def limits(self, plant: CascadeSpec, values: Mapping[str, float], bounds: Bounds) -> str:
        """Bounds that are reached, with the resonance where it is that."""
        made, g = self.plant(plant), self.gains_of(values)
        scales = 100.0 * LARGEST_JUMP, bounds.sensitivity, bounds.overshoot, bounds.sensitivity
        found = list[str]()
        for text, scale, (level, at) in zip(BOUNDS, scales, made.exactly(g, bounds), strict=True):
            if level >= CLOSE:
                found.append(text.format(scale * level, format_quantity(at, "Hz", 3) if at > 0.0 else ""))
                if abs(at - made.resonance) < NEAR * made.resonance:
                    found[-1] += f", near the resonance of the coupling ({format_quantity(made.resonance, 'Hz', 3)})"
        return "; ".join(found)

    def easier(self, plant: CascadeSpec) -> list[tuple[str, CascadeSpec]]:
        """A stiffer or better damped coupling, less dead time, a finer encoder."""
        return list(_easier(plant))

    def figures(self, plant: CascadeSpec) -> dict[str, str]:
        """Stiffness, compliance, noise and steady error."""
        from detent.methods.cascade.tried import loop_figures

        return dict(loop_figures(plant))

    def responses(self, plant: CascadeSpec) -> Sequence[Response]:
        """A push on the load, and a step of the reference."""
        from detent.methods.cascade.tried import responses

        return responses(plant)

    def followed(self, plant: CascadeSpec, job: Any) -> Response:
        """Error of the position loop during a job."""
        from detent.methods.cascade.tried import followed

        return followed(plant, job)

    def shares(self, stated: Container[str], known: Mapping[str, float]) -> list[Share]:
        """All of what is stated, of Coulomb friction as much as is known, and nothing of what is not."""
        return list(_shares(self.spec, stated, known))


def _easier(spec: CascadeSpec) -> Iterator[tuple[str, CascadeSpec]]:
    coupling, drive = spec.mechanics.coupling, spec.drive
    if coupling is not None:
        stiff = format_quantity(2.0 * coupling.stiffness, spec.unit("N") + "/" + spec.unit("m"), 3)
        texts = f"a coupling twice as stiff, {stiff},", "a coupling with twice the damping"
        for text, name in zip(texts, ("stiffness", "damping"), strict=True):
            made = coupling.model_copy(update={name: 2.0 * getattr(coupling, name)})
            yield text, spec.changed(mechanics={"coupling": made})
    table = "encoder" if spec.encoder_of("velocity") is spec.encoder else "load_encoder"
    read = spec.encoder_of("velocity")
    if drive.delay:
        yield "an amplifier that is a sample sooner", spec.changed(drive={"delay": drive.delay - 1})
    elif read.delay:
        yield "an encoder that is a sample sooner", spec.changed(**{table: {"delay": read.delay - 1}})
    elif read.velocity_filter > 0.0:
        half = 0.5 * read.velocity_filter
        made = spec.changed(**{table: {"velocity_filter": half}})
        yield f"a velocity filter of {format_quantity(half, 's', 3)}", made
    else:
        half = 0.5 * spec.method.sample_period
        yield f"a sample period of {format_quantity(half, 's', 3)}", spec.changed(method={"sample_period": half})
    if read.resolution > 0.0:
        yield "an encoder with half the count", spec.changed(**{table: {"resolution": 0.5 * read.resolution}})


def _shares(spec: CascadeSpec, stated: Container[str], known: Mapping[str, float]) -> Iterator[Share]:
    """Shares of feedforward."""
    key, now = "method.feed_forward.", spec.method.feed_forward
    yield Share(f"{key}velocity", 1.0, "Feedforward of velocity is 1: the reference knows it.")
    yield Share(f"{key}acceleration", 1.0, "Feedforward of acceleration is 1: the moving masses are stated.")
    given = {
        name: [one for one in (f"{table}.{name}" for table in directions(spec)) if one in stated]
        for name in ("viscous", "coulomb")
    }
    drags = bool(given["viscous"]) or spec.back_emf_drag > 0.0
    why = "viscous friction or back-EMF is stated" if drags else "neither viscous friction nor back-EMF is stated"
    yield Share(f"{key}viscous", float(drags), f"Feedforward of viscous friction is {int(drags)}: {why}.")
    unsure = [known[one] for one in given["coulomb"] if one in known]
    share = max(0.0, round(1.0 - max(unsure), 2)) if unsure else now.coulomb if given["coulomb"] else 0.0
    why = (
        f"[tolerance] leaves {100 * max(unsure):.3g} % of it open" if unsure
        else "as in the file, where [tolerance] does not say how well it is known" if given["coulomb"]
        else "it is not stated"
    )  # fmt: skip
    yield Share(f"{key}coulomb", share, f"Feedforward of Coulomb friction is {share:g}: {why}.")
    if spec.mechanics.weight != 0.0 or spec.mechanics.pendulum != 0.0:
        yield Share(f"{key}weight", 1.0, "Feedforward of the weight is 1: it is stated.")
