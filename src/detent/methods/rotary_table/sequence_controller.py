"""The sequence controller of a rotary table: does one step after the other, by the lines of its host."""

from collections.abc import Callable

from detent.errors import AxisError
from detent.methods.rotary_table.build import ticks
from detent.methods.rotary_table.derive import TableFigures
from detent.methods.rotary_table.host import TableHost, dial_speed
from detent.methods.rotary_table.schema import RotaryTableSpec
from detent.methods.rotary_table.sequence_job import Action, Go, Jog, Output, Stretches, join_stretches
from detent.units import format_quantity

Change = tuple[float, str, bool]  # a signal that was switched: time since power-on [s], its name, on or off

CHECKED = 2500  # ticks after which the table is looked at again at the latest


class SequenceController:
    """Steps, inputs and outputs."""

    def __init__(self, host: TableHost, inputs: dict[str, Stretches], watch: Callable[[float], None]) -> None:
        self.host = host
        self.outputs: list[Change] = []  # output signals as they were switched
        # what went otherwise than a reader of the job expects; each text once, as a key
        self.warnings: dict[str, None] = {}
        self._edges = input_edges(inputs, host.tick)
        self._watch = watch  # looks at a table asked to go so far since the step began [rad]; raises `AxisError`
        self._way = 0.0  # asked for by a positioning [rad]
        self._pressed = self._released = 0  # ticks of the button
        self._speed = 0.0  # of the jog [rad/s]

    @property
    def inputs(self) -> list[Change]:
        """Input signals as they came."""
        return [(tick * self.host.machine.tick, name, on) for tick, name, on in self._edges if tick <= self.host.tick]

    @property
    def asked(self) -> float:
        """Way that the present step has asked for so far [rad], not signed; a stop makes up for the start."""
        held = ((self._released or self.host.tick) - self._pressed) * self.host.machine.tick if self._speed else 0.0
        return self._way + held * min(self._speed, held * self.host.spec.limits.acceleration)

    @property
    def latency(self) -> float:
        """Way that the present step may go more or less than it asked for [rad]: the button is seen in the task."""
        return 2 * self._speed * self.host.spec.method.task_period

    @property
    def coming(self) -> list[str]:
        """Input signals of which something has not come yet."""
        return list(dict.fromkeys(name for tick, name, _ in self._edges if tick > self.host.tick))

    def do(self, step: Action) -> None:
        """Do one step to its end."""
        self._way = self._speed = 0.0
        self.host.acknowledge()
        if isinstance(step, Go):
            self._go(step)
        elif isinstance(step, Jog):
            self._jog(step)
        elif isinstance(step, Output):
            self.outputs.append((self.host.machine.time, step.signal, step.on))
        elif step.signal is not None:
            self._await(step.signal, level=step.level)
        else:
            self._pass(step.duration or 0.0)

    # ------------------------------------------------------------------------------------------------------ steps

    def _go(self, step: Go) -> None:
        host = self.host
        host.begin(step.number)
        while host.positioner.start:  # its next task takes it
            self._pass(host.spec.method.strobe_period, rest=True)
        if host.refusal:
            raise AxisError(f"the positioner refused the start: {host.refusal}")
        self._way = host.way
        limit = host.move_time(host.way, min(host.spec.position[str(step.number)].speed, host.spec.limits.speed))
        host.arrive_within(limit)
        self._pass(limit, rest=True)
        host.arrive_within(0)
        if not host.at_rest:
            away = f"it is {format_quantity(host.way, 'rad')} away"
            raise AxisError(f"it was not in position within {format_quantity(limit, 's')}; {away}; {suspect(host)}")

    def _jog(self, step: Jog) -> None:
        host = self.host
        if step.signal is not None:
            self._await(step.signal, level=True)
        self._speed, self._pressed, self._released = dial_speed(host.spec, step.speed), host.tick, 0
        host.press(step.direction, self._speed)
        if step.signal is not None:
            self._await(step.signal, level=False)
        else:
            self._pass(step.duration or 0.0)
        host.release()
        self._released = host.tick
        if not host.is_moving:
            task = format_quantity(host.spec.method.task_period, "s")
            self._warn(step, f'"{step.signal}" was on for less than the task period, {task}: the table did not move')
            return
        limit = host.stop_time(self._speed)
        self._pass(limit, rest=True)
        if not host.at_rest:
            raise AxisError(f"it did not come to rest within {format_quantity(limit, 's')}; {suspect(host)}")
        host.acknowledge()
        if self._settle():
            return
        # Stick and slip carry a table over its target by as much as friction can hold it away.
        if host.way > 2 * TableFigures(host.spec).held_away:
            waited = host.settling_time + host.spec.method.in_position_time
            away = f"it is {format_quantity(host.way, 'rad')} from where it is held"
            raise AxisError(f"{away} {format_quantity(waited, 's')} after the jog; {suspect(host)}")
        away = "after the jog the table did not come within its window of where it is held: check the step's error"
        self._warn(step, f"{away}; friction, a load or noise of the detector keeps it off")

    def _warn(self, step: Action, text: str) -> None:
        """Note a warning, once for each step of the job."""
        self.warnings.setdefault(f"line {step.row}: {text}" if step.row else text)

    def _settle(self) -> bool:
        """Let the loop take the table to where it is held; False if it does not stay there."""
        host, method = self.host, self.host.spec.method
        end, inside = host.tick + ticks(host.settling_time + method.in_position_time), 0
        needed = max(1, round(method.in_position_time / method.strobe_period))
        while host.tick < end and inside < needed:
            self._pass(method.strobe_period)
            inside = inside + 1 if host.in_position else 0
        return inside >= needed

    # ------------------------------------------------------------------------------------------------------- time

    def _await(self, name: str, *, level: bool) -> None:
        """Let time pass until an input signal has a level: its next change brings it, where it has not."""
        changes = [(tick, on) for tick, signal, on in self._edges if signal == name]
        past = [change for change in changes if change[0] <= self.host.tick]
        if bool(past and past[-1][1]) == level:
            return
        if len(past) == len(changes):
            last = past[-1][0] * self.host.machine.tick
            raise AxisError(
                f'"{name}" went off for good at {format_quantity(last, "s")}, before the step began: it would wait for '
                f'ever; let "{name}" be on later, or shorten the steps before'
            )
        self._pass_until(changes[len(past)][0])

    def _pass(self, seconds: float, *, rest: bool = False) -> None:
        self._pass_until(self.host.tick + ticks(seconds), rest=rest)

    def _pass_until(self, tick: int, *, rest: bool = False) -> None:
        """Let time pass up to a tick; `rest` ends it when the table comes to rest."""
        host = self.host
        while host.tick < tick and not (rest and host.at_rest):
            host.acknowledge()
            host.machine.pass_ticks(min(tick - host.tick, CHECKED))
            if host.failure:
                raise AxisError("; ".join(filter(None, (host.failure, weakness(host.spec)))))
            self._watch(self.asked)


def input_edges(inputs: dict[str, Stretches], start: int) -> list[tuple[int, str, bool]]:
    """Changes of the input signals in order: (tick, name, on)."""
    edges: list[tuple[int, str, bool]] = []
    for name, stretches in inputs.items():
        # A pulse lasts a tick at least; two that touch in the same tick are one.
        in_ticks = ((ticks(begin), max(ticks(end), ticks(begin) + 1)) for begin, end in stretches)
        for begin, end in join_stretches(in_ticks):
            edges += [(start + int(begin), name, True), (start + int(end), name, False)]
    return sorted(edges)


def suspect(host: TableHost) -> str:
    """What to look at when a table does not do what it is told."""
    return weakness(host.spec) or (
        "check deviation and torque in the report: a load, friction, limits.effort too low for the acceleration, or "
        "noise of the detector keeps the table off its target"
    )


def weakness(spec: RotaryTableSpec) -> str:
    """What the form of the method or of the detector is known to fail by; empty for the sound ones."""
    method = spec.method
    if not method.position_control:
        return "the table's angle is not controlled: set method.position_control = true"
    if not method.signed_remaining:
        return "beyond its target the unsigned remaining angle drives it on: set method.signed_remaining = true"
    if method.form != "turn counter":
        return f'the form "{method.form}" loses a turn at the boundary: set method.form = "turn counter"'
    if spec.detector.composition != "rounded":
        return 'the detected angle jumps by motor turns: set detector.composition = "rounded"'
    return ""
