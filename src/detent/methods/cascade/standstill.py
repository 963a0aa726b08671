"""A cascade axis at standstill: its starts, and what `tune.standstill` watches of each.

A third of the starts each are *small*, within 0.3 of the reach 3 Fs/P + 3 gap + 5 counts; *wide*, all of it; and
*hard*, up to twice the error that saturates the command. Fs is the static friction, P the stiffness of the loops,
G (Kv Kp + Ki), G the force per command. The integral is whatever static friction holds; encoder and target lie at any
place of a count, motor and load at any place of the gap.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from detent.files.nearest import put
from detent.methods.cascade.build import build_cascade
from detent.methods.cascade.checks import directions
from detent.methods.cascade.derive import grain
from detent.methods.cascade.loop import LinearLoop
from detent.methods.cascade.schema import CascadeSpec
from detent.methods.cascade.standstill_steps import Watch, watch_standstill
from detent.methods.cascade.system import Cascade, along, latch_both, switch_on
from detent.methods.tuning import COLUMNS, Ensemble, Forecast, Rule, Swing
from detent.sensing.position_sensor import stand_sensor

Numbers = NDArray[np.float64]

STARTS = "small", "wide", "hard"
NEAR = 0.3  # share of the reach of small starts
FORGOTTEN = 30.0  # time constants of a filter until it holds 1e-13 of what it held
LEFT = 4  # samples between a leap and the one at which friction gives way
SLIP = 0.5  # of a slip that is followed, at most [s]
LOOSE = 1e-6  # of the force beyond what static friction holds, with which a slip begins
HOUR = 3600.0  # of standing after which an axis rests [s]
SLOW = 1e-6  # of a count in a sample: so slowly a mass without friction stands
STEEP = 0.86  # largest slope of the falling friction, in (Fs - Fc)/vs: of 1 - exp(-x^2) at its steepest
STANDS = 0.1  # share of the time that friction holds an axis that sticks and slips
PART = 0.5  # share of the gap that a motor crosses in it
OFTEN = 0.05  # share of the samples at the limit of an axis that saturates
MORE_REST = "less static friction, a stiffer position loop, or no integral"  # what helps against stick-slip
SINGLE = 1.5  # counts that a swing across the edge of a count has at most


class CascadeCourse:
    """One start."""

    def __init__(self, ensemble: "CascadeEnsemble", seed: int, number: int, *, on_counts: bool) -> None:
        self.start, self.period = STARTS[number % 3], ensemble.spec.method.sample_period
        self.params: Any = ensemble.params
        chance = np.random.default_rng([seed, number])
        place, twist, integral, share, sign = (float(x) for x in chance.uniform(-1.0, 1.0, 5))
        self.state: Any = Cascade()
        middle = ensemble.middle + 3.0 * place * ensemble.grain
        switch_on(self.params, self.state, middle)
        self._twist(twist * self.params.plant.machine.half_gap)
        low, high = ensemble.held
        self.state.controller.law.integral = low + 0.5 * (integral + 1.0) * (high - low)
        error = math.copysign(ensemble.error(self.start, 0.5 * (share + 1.0)), sign)
        on_load = self.params.controller.feedback.position_on_load
        sensor = self.state.controller.load_sensor if on_load else self.state.controller.motor_sensor
        target = sensor.position + error
        if on_counts and ensemble.count > 0.0:
            target = round(target / ensemble.count) * ensemble.count
        self.feed = along(np.array([target]), np.zeros(1), np.zeros(1))
        self.watch: Any = Watch(settled=ensemble.settled, margin=ensemble.margin, slow=ensemble.slow, leaps=1,
                                longest=round(HOUR / self.period))  # fmt: skip

    def _twist(self, twist: float) -> None:
        """The motor stands elsewhere in the gap than the load."""
        p, r = self.params, self.state
        r.plant.machine.load.position -= twist
        latch_both(p.plant, r.plant.machine, r.lines)
        stand_sensor(p.controller.load_sensor, r.controller.load_sensor, r.lines.load)

    @property
    def proven(self) -> bool:
        """True once nothing will ever change."""
        return bool(self.watch.proven)

    @property
    def leapt(self) -> float:
        """Time that was leapt over [s]."""
        return self.watch.leapt * self.period

    def go(self, seconds: float) -> Numbers:
        """Simulate so long, a row for each sample."""
        rows = np.zeros((max(1, round(seconds / self.period)), len(COLUMNS)))
        rows = rows[: watch_standstill(self.params, self.state, self.watch, rows, *self.feed)]
        rows[:, 0] *= self.period
        return rows


class CascadeEnsemble(Ensemble):
    """What `hunt` asks of a cascade axis."""

    band = "method.dead_band"

    def __init__(self, spec: CascadeSpec) -> None:
        self.spec, self.unit, self.grain = spec, spec.unit("m"), grain(spec)
        # In doubles whatever the controller computes in: a leap over hours of creeping relies on equal increments.
        self.params: Any = build_cascade(spec.changed(controller={"arithmetic": "double"}))
        plant = self.params.plant
        plant.push.force, plant.home.present, plant.stop.side = 0.0, 0, 0.0
        self.count = spec.encoder_of("position").resolution
        self.middle = spec.limits.lowest + 0.5 * spec.limits.travel
        force, pid = spec.effort_per_command, spec.method.structure == "pid"
        m = spec.method
        #: force per error, per velocity, and per error and time
        self.stiffness = force * (m.proportional if pid else m.velocity_gain * m.position_gain + m.velocity_integral)
        self.damping = force * (m.derivative if pid else m.velocity_gain)
        self.growth = force * (m.integral if pid else m.velocity_integral * m.position_gain)
        self.settled, self.margin = self._times()
        self.slow = SLOW * self.grain / m.sample_period
        coupling = spec.mechanics.coupling
        self.gap = coupling.backlash if coupling else 0.0
        self.reach = 3.0 * max(self._static) / self.stiffness + 3.0 * self.gap + 5.0 * self.count
        self.reach = max(self.reach, self.grain)

    @property
    def _static(self) -> tuple[float, float]:
        """Static friction of both masses, in both directions [N]."""
        positive, negative = self.spec.friction(1), self.spec.friction(-1)
        return max(positive.static, positive.coulomb), max(negative.static, negative.coulomb)

    @property
    def held(self) -> tuple[float, float]:
        """Integrals that static friction holds [V]; 0 where nothing integrates."""
        if self.growth == 0.0:
            return 0.0, 0.0
        force, mechanics = self.spec.effort_per_command, self.spec.mechanics
        left = (1.0 - self.spec.method.feed_forward.weight) * mechanics.weight
        limit = self.spec.largest_command
        low, high = (left - self._static[1]) / force, (left + self._static[0]) / force
        return max(low, -limit), min(high, limit)

    def _times(self) -> tuple[int, int]:
        """Samples until all increments are the same, and that a leap leaves until friction gives way."""
        c, drive = self.params.controller, self.params.plant.source
        sensors = [c.motor_sensor, c.load_sensor]
        shares = [one.smoothing for one in sensors] + ([c.law.pid.smoothing] if c.law.position_pid else [])
        fading = sum(math.ceil(-FORGOTTEN / math.log1p(-share)) for share in shares if share < 1.0)
        winding, lag = self.params.plant.machine.winding, 0
        if winding.used and winding.inductance > 0.0:
            lag = math.ceil(FORGOTTEN * winding.inductance / winding.resistance / self.spec.method.sample_period)
        settled = max(one.delay + one.span for one in sensors) + drive.delay + fading + lag + 2
        return settled, LEFT + lag

    def error(self, start: str, share: float) -> float:
        """Magnitude of the error of a start [m], by the share of all such that are smaller."""
        if start != "hard":
            return share * self.reach * (NEAR if start == "small" else 1.0)
        most = 2.0 * self.spec.largest_command * self.spec.effort_per_command / self.stiffness
        ends = sorted((self.reach, min(most, 0.25 * self.spec.limits.travel)))
        return math.exp(math.log(ends[0]) + share * math.log(ends[1] / ends[0]))

    def courses(self, starts: int, seed: int, *, on_counts: bool) -> Sequence[CascadeCourse]:
        """The axis at its starts."""
        return [CascadeCourse(self, seed, number, on_counts=on_counts) for number in range(starts)]

    @property
    def stated(self) -> bool:
        """Whether the file states static friction and Stribeck velocity where there is Coulomb friction."""
        tables = (self.spec.mechanics.friction, self.spec.mechanics.load_friction)
        rubbing = [one for table in tables for one in (table.positive, table.negative) if one.coulomb > 0.0]
        return all({"static", "stribeck"} <= one.model_fields_set for one in rubbing)

    @property
    def rule(self) -> Rule:
        """The rule of thumb."""
        moving = 0.5 * (self.spec.friction(1).coulomb + self.spec.friction(-1).coulomb)
        static, falls = 0.5 * sum(self._static), self._fall()
        if self.growth == 0.0:
            return Rule(0.0, math.inf, "nothing integrates: friction holds the axis for good")
        if static <= moving:
            return Rule(0.0, math.inf, "static friction is no larger than Coulomb friction: each slip is smaller")
        if self.damping > STEEP * falls:
            return Rule(0.0, math.inf, "the velocity loop is steeper than the falling friction")
        swing = (static - moving) / self.stiffness
        return Rule(swing, 4.0 * (static + moving) / (self.growth * swing), MORE_REST)

    @property
    def forecasts(self) -> list[Forecast]:
        """Across the edge of a count, where friction does not hold what that costs; as far as the limit lets it."""
        loop, spec, found = LinearLoop(self.spec), self.spec, list[Forecast]()
        edge = loop.edge if self.count > 0.0 and self.gap == 0.0 and loop.spectral_radius < 1.0 else None
        if edge is not None:
            command, most = edge.command * self.count, 2.0 * max(self._static) / spec.effort_per_command
            period = 2 * edge.half * loop.period
            if most < command < 2.0 * spec.largest_command:
                found.append(Forecast("count edge", "Tsypkin's method", edge.swing * self.count, period, command))
        swinging = loop.limited
        if swinging is not None:
            far, both = max(swinging.motor, swinging.load), 2.0 * spec.largest_command
            how = "the describing function of its limit"
            found.append(Forecast("beyond the margin", how, far, 1.0 / swinging.frequency, both))
        return found

    def _fall(self) -> float:
        """Steepest fall of friction from static to Coulomb [N*s/m], of both masses and the weaker direction."""
        tables = (self.spec.mechanics.friction, self.spec.mechanics.load_friction)
        found = list[float]()
        for sense in ("positive", "negative"):
            sides = [getattr(one, sense) for one in tables]
            drops = [(one.static - one.coulomb, one.stribeck) for one in sides if one.static > one.coulomb]
            found.append(sum(drop / speed if speed > 0.0 else math.inf for drop, speed in drops))
        return max(found)

    @property
    def integral(self) -> str:
        """Key of the integral gain."""
        return "method.integral" if self.spec.method.structure == "pid" else "method.velocity_integral"

    def assumed(self, ratio: float, stribeck: float) -> CascadeSpec:
        """The specification with another friction at standstill."""
        values = dict[str, float]()
        for key, table in directions(self.spec).items():
            if table.coulomb > 0.0:
                values |= {f"{key}.static": ratio * table.coulomb, f"{key}.stribeck": stribeck}
        return self.spec.varied(values)

    @property
    def as_stated(self) -> CascadeSpec | None:
        """The specification without static friction beyond Coulomb friction where that is a default."""
        assumed = {
            f"{key}.static": table.coulomb
            for key, table in directions(self.spec).items()
            if table.coulomb > 0.0 and "static" not in table.model_fields_set
        }
        return self.spec.varied(assumed) if assumed else None

    def helps(self, kind: str) -> str:
        """The position from the motor, a dead band, or other gains."""
        if kind == "gap crossing":
            load = self.spec.mechanics.load_friction  # a load that nothing holds goes to and fro in its gap by itself
            held = min(load.positive.coulomb, load.negative.coulomb) > 0.0
            if held and self.spec.method.feedback.position == "load":
                return put("method.feedback.position", '"motor"')
            return "less play, or friction at the load"
        if kind == "stick-slip":
            return f"{MORE_REST}, or the dead band that `detent hunt --dead-band` finds"
        return super().helps(kind)

    def slips(self, errors: Numbers) -> Numbers | None:
        """Error behind a slip, of an axis without a gap that integrates and sticks."""
        if self.gap > 0.0 or self.growth == 0.0 or not min(self._static) > 0.0:
            return None
        return np.array([self._slip(float(error)) for error in errors])

    def _slip(self, error: float) -> float:
        """Error at the standstill behind a slip that begins at an error [m]."""
        course = CascadeCourse(self, 1, 0, on_counts=False)
        c, force = course.state.controller, self.spec.effort_per_command
        target = course.feed[0][0] = c.motor_sensor.position + error
        loose = self.held[1] if error > 0.0 else self.held[0]
        proportional = (self.stiffness - force * self.spec.method.velocity_integral) / force
        if self.spec.method.structure == "pid":
            proportional = self.stiffness / force
        c.law.integral = loose * (1.0 + LOOSE) - proportional * error
        rows = course.go(SLIP)
        moved = np.flatnonzero(rows[:, 2] != rows[0, 1])
        stuck = np.flatnonzero(rows[moved[0] :, 8] == 1.0) if len(moved) else moved
        last = moved[0] + stuck[0] if len(stuck) else len(rows) - 1
        return float(target - rows[last, 1])

    def kind(self, swing: Swing) -> str:
        """What makes it hunt so."""
        drive, quickest = self.spec.drive, 2.0 / max(LinearLoop(self.spec).velocity_loop.crossover, 1e-9)
        if swing.limited > OFTEN:
            return "beyond the margin" if swing.period < quickest else "saturation with integral"
        if self.gap > 0.0 and abs(swing.motor - swing.load) > PART * self.gap:
            return "gap crossing"
        if swing.held > STANDS:
            step = drive.command_step * self.spec.effort_per_command
            coarse = step > max(self._static) - min(self.spec.friction(1).coulomb, self.spec.friction(-1).coulomb)
            return "converter step against friction" if coarse and step > 0.0 else "stick-slip"
        if self.gap > 0.0:
            return "gap crossing"
        if swing.largest < SINGLE * self.count:
            return "count edge"
        return "beyond the margin" if swing.period < quickest else "stick-slip"
