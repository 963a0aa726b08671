"""The host of a stepper stage: it moves the extremes of the tables and gives the start signal, and waits for rest.

It knows what a controller would know: the step counts. Whether the rotors followed is for an observer to say.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

from detent.control.step_rule import FAULT, acknowledge, deflect, release, start_move
from detent.errors import STEP_FAULT_TEXT, AxisError, FileProblem, InputError
from detent.methods.stepper_envelope.controller import NOWHERE
from detent.methods.stepper_envelope.machine import Stage
from detent.methods.stepper_envelope.schema import StepperEnvelopeSpec, StepperTable
from detent.methods.stepper_envelope.stage_job import StageJob, StageJog, StageMove
from detent.record.machine import AnyRecorder
from detent.units import format_quantity


@dataclass(frozen=True, slots=True)
class Leg:
    """What one motor does in a move, in steps of its own."""

    start: int  # and target: step boundaries
    target: int
    turn: int | None = None  # where it turns on the way

    @property
    def steps(self) -> int:
        """Steps made in all."""
        via = self.target if self.turn is None else self.turn
        return abs(via - self.start) + abs(self.target - via)


class StageHost:
    """Host of a stage at power-on."""

    def __init__(self, spec: StepperEnvelopeSpec, recorder: AnyRecorder | None = None) -> None:
        self.spec, self.stage = spec, Stage(spec, recorder)
        self.goal = {name: motor.place for name, motor in self.stage.motors.items()}

    def legs(self, move: StageMove) -> dict[str, Leg]:
        """What each motor has to do for a move; motors that stand there already are left out."""
        found: dict[str, Leg] = {}
        for name in move.motors:
            motor = self.stage.motors[name]
            goal = move.targets[name] if name in move.targets else self.goal[name] + move.by[name]
            self.goal[name] = goal
            turn = None if move.turn is None else motor.table.step_inside(move.turn)
            leg = Leg(motor.position, motor.table.step_inside(goal), turn)
            if leg.steps:
                found[name] = leg
        return found

    def start(self, legs: dict[str, Leg]) -> None:
        """Set the extremes of each motor and give all start signals at once."""
        for name, leg in legs.items():
            motor = self.stage.motors[name]
            via = leg.target if leg.turn is None else leg.turn
            heading = 1 if via > leg.start else -1
            first, second = motor.along(heading)
            first.move_start(leg.start)
            first.move_stop(via)
            if leg.turn is not None:
                second.move_start(via)
                second.move_stop(leg.target)
            start_move(motor.controller.rule, heading, int(leg.turn is not None))

    def wait(self, legs: dict[str, Leg]) -> None:
        """Wait until all motors have come to rest."""
        limit = 1.0 + 2.0 * sum(leg.steps / self._slowest(name) for name, leg in legs.items())
        late = self.stage.wait_for(legs, limit)
        for name in legs:
            rule = self.stage.motors[name].controller.rule
            if rule.state == FAULT:
                raise AxisError(f"motor {name}: {STEP_FAULT_TEXT[rule.cause]}")
            if name in late:
                late_after = format_quantity(limit, "s")
                raise AxisError(
                    f"motor {name}: did not come to rest within {late_after}; look at its table in the report"
                )

    def _slowest(self, name: str) -> float:
        """A step frequency that no run stays below for long [Hz]."""
        motor = self.stage.motors[name]
        return min(float(motor.tables.ramp.hz[0]), *motor.tables.up.zones.limits)

    def run(self, move: StageMove) -> tuple[dict[str, Leg], bool]:
        """Make one move up to rest: what each motor did, and whether it could not stop where it was told to."""
        legs, over = self.legs(move), False
        self.start(legs)
        if move.change is not None:
            for name in legs:  # it is the only one
                over = self._change(name, move.change.at, move.change.to)
        self.wait(legs)
        for name in legs if over else ():  # its new stop lay behind the nearest possible one: come back to it
            motor = self.stage.motors[name]
            back = {name: Leg(motor.position, motor.table.step_inside(self.goal[name]))}
            if back[name].steps:
                self.start(back)
                self.wait(back)
        return legs, over

    def _change(self, name: str, at: float, to: float) -> bool:
        """Move the stop extreme of a running motor when it passes a place; True if it lay too near."""
        motor = self.stage.motors[name]
        rule = motor.controller.rule
        motor.controller.stop_at = motor.table.step_inside(at)
        late = self.stage.wait_for([name], 1.0 + 2.0 * motor.table.steps / self._slowest(name))
        motor.controller.stop_at = NOWHERE
        if late or motor.resting:
            return False
        acknowledge(rule)
        ahead, behind = motor.along(rule.direction)
        edit = ahead.move_stop(motor.table.step_inside(to), rule.position, rule.index)
        behind.move_start(edit.stop)
        self.goal[name] = to
        return edit.overrun

    def jog(self, jog: StageJog) -> Leg:
        """A manual run up to rest."""
        motor = self.stage.motors[jog.motor]
        start, heading = motor.position, 1 if jog.speed > 0 else -1
        for table in (motor.tables.up, motor.tables.down):
            lower, upper = (0, motor.table.steps) if table.direction > 0 else (motor.table.steps, 0)
            table.move_start(lower)
            table.move_stop(upper)
        # A timer word on the slower side.
        hz, rule = motor.table.hz(abs(jog.speed)), motor.controller.rule
        reload = self.spec.controller.words == "reload"
        word = math.ceil(self.spec.controller.timer / hz - 1e-9) if reload else math.floor(hz + 1e-9)
        deflect(motor.p.controller.rule, rule, word, len(motor.tables.ramp) - 1, heading)
        self.stage.pass_time(jog.duration)
        release(rule)
        if not motor.resting:
            self.wait({jog.motor: Leg(0, motor.table.steps)})
        self.goal[jog.motor] = motor.place
        return Leg(start, motor.position)


def check_stage_job(spec: StepperEnvelopeSpec, job: StageJob) -> None:
    """Refuse what the axis cannot be told to do, before anything moves."""
    problems: list[FileProblem] = []
    goal = {name: table.mechanics.start_position for name, table in spec.stepper.items()}
    for move in job.moves:
        unknown = next((name for name in move.motors if name not in spec.stepper), None)
        if unknown is not None:
            came, allowed = f"the motor {unknown}", f"one of {', '.join(spec.stepper)}"
            problems.append(FileProblem(job.name, move.row, 1, unknown, came, allowed, "rename it"))
            break
        if isinstance(move, StageJog):
            problems += _jog_problems(spec.stepper[move.motor], job, move)
            # Where a manual run ends is not known before it is made.
            goal[move.motor] = math.nan
            continue
        for name in move.motors:
            goal[name] = move.targets[name] if name in move.targets else goal[name] + move.by[name]
            places = [goal[name], move.turn]
            if move.change is not None:
                places += [move.change.at, move.change.to]
                goal[name] = move.change.to
            for place in places:
                if place is not None:
                    problems += _place_problems(spec.stepper[name], (job.name, move.row, name), place)
    if problems:
        raise InputError(problems)


def _place_problems(table: StepperTable, where: tuple[str, int, str], place: float) -> Iterator[FileProblem]:
    """What is wrong with a place, of the file, line and motor `where`."""
    # The end of a travel that is no whole number of steps lies a part of a step beyond the last one.
    end = max(table.steps * table.step, table.limits.travel) + table.step / 2
    if not math.isnan(place) and not -table.step / 2 <= place - table.mechanics.lower_end <= end:
        lower, upper = format_quantity(table.mechanics.lower_end, "m"), format_quantity(table.upper_end, "m")
        nearest = lower if place < table.mechanics.lower_end else upper
        file, row, name = where
        remedy = f"go to {nearest} at the most, or correct limits.travel and mechanics.lower_end of the motor"
        came = f"the position {format_quantity(place, 'm', 6)}"
        yield FileProblem(file, row, 1, name, came, f"from {lower} to {upper}", remedy)


def _jog_problems(table: StepperTable, job: StageJob, jog: StageJog) -> Iterator[FileProblem]:
    if not 1.0 <= table.hz(abs(jog.speed)) <= table.max_hz * (1 + 1e-9):
        came, top = format_quantity(jog.speed, "m/s"), format_quantity(table.limits.speed, "m/s")
        slowest = format_quantity(table.step, "m/s")
        remedy = f"write {top}, or correct limits.speed"
        yield FileProblem(job.name, jog.row, 1, "speed", came, f"{slowest} to {top}, either way", remedy)
