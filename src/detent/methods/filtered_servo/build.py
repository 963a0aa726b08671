"""From a checked specification to the parameters of the filtered servo: SI values to pulses, counts and ticks."""

import math

from detent.axisfile.blocks import fill_guard, fill_interference, fill_marks, fill_push, fill_slide
from detent.control.pulse_generator import PER_PULSE
from detent.methods.filtered_servo.plant import FilteredPlantParams
from detent.methods.filtered_servo.schema import FilteredServoSpec
from detent.methods.filtered_servo.system import TICK, FilteredServoParams
from detent.sensing.counted_speed import FIXED, FLOAT, NONE

GUARD_PERIOD = 1e-3  # time between two looks of the guard [s]


def build_filtered_servo(spec: FilteredServoSpec) -> FilteredServoParams:
    """Parameters of the filtered servo."""
    p = FilteredServoParams()
    c, m = p.controller, p.plant
    method, drive = spec.method, spec.drive
    c.generator.ticks_per_second = 1 / TICK
    c.generator.acceleration = method.command_acceleration / spec.pulse * TICK * PER_PULSE
    c.deviation.gain = method.position_gain
    c.deviation.range = (1 << (method.position_bits - 1)) - 1
    full = 1 << (drive.word_bits - 1)
    c.deviation.word_limit = spec.word_limit
    c.deviation.whole_words = drive.whole_words
    c.speed.half = 1 << (method.counter_bits - 1)
    c.filter.kind = {"none": NONE, "float": FLOAT, "fixed": FIXED}[method.filter]
    c.filter.scale, c.filter.coefficient = method.scale, method.coefficient
    c.filter.shift, c.filter.fraction_bits = round(-math.log2(method.coefficient)), method.fraction_bits
    m.amplifier.voltage_drive = drive.amplifier == "voltage"
    m.amplifier.per_count = drive.supply / full if m.amplifier.voltage_drive else drive.current_per_count
    m.amplifier.carrier_ticks = round(1 / (drive.pwm_frequency * TICK))
    fill_slide(m, spec, TICK, spec.drive.bridge_resistance)
    fill_interference(m.interference, spec.disturbance.lines, TICK)
    fill_push(m.push, spec.disturbance.push, TICK)
    _fill_home(m, spec)
    fill_guard(c.guard, spec.protection, sample=GUARD_PERIOD, speed=spec.limits.speed / spec.pulse)
    c.look_ticks = round(GUARD_PERIOD / TICK)
    c.breaking = spec.protection.stuck_effort * c.deviation.word_limit
    start = spec.mechanics.start_position
    c.lowest = round(-start / spec.pulse) - method.in_position
    c.highest = round((spec.limits.travel - start) / spec.pulse) + method.in_position
    c.window = method.in_position
    c.window_ticks = round(method.in_position_time / TICK)
    return p


def _fill_home(m: FilteredPlantParams, spec: FilteredServoSpec) -> None:
    """The marks of the machine lie where the file says that the axis finds them, or its frame does."""
    home = spec.home
    if home is None:
        return
    if home.by != "contact":
        fill_marks(m.home, home, spec.mechanics.travel_per_revolution)
    elif home.side > 0:
        m.train.right_end = home.position
    else:
        m.train.left_end = home.position
