"""Controller, lines and plant: three register blocks, and the tick that joins them."""

from detent.kernel.loop import controls, ticks
from detent.kernel.registers import CONTROLLER, PLANT, Registers, block, f8, i1, i8, register, u1
from detent.kernel.step import hot_step
from detent.plant.drive_train import DriveTrain, DriveTrainParams, move_averaged
from detent.sensing.encoder import Encoder, EncoderParams, follow
from detent.sensing.gauge import Gauge, read_gauge
from detent.sensing.quadrature import Quadrature, count_edge


class ControllerParams(Registers):
    band: i8 = register("dead band", unit="count")
    braking: f8 = register("braking distance over the square of the speed word", unit="1/count")
    window: i8 = register("ticks in a window of the speed counter", unit="tick")
    settling: i8 = register("ticks at rest until the axis has arrived", unit="tick")


class PlantParams(Registers):
    supply: f8 = register("voltage of full drive", unit="V")
    encoder: EncoderParams = block("encoder")
    train: DriveTrainParams = block("motor and mechanics")


class BangBangParams(Registers):
    controller: ControllerParams = block("constants of the law")
    plant: PlantParams = block("constants of the machine")


class Controller(Registers):
    decoder: Quadrature = block("quadrature decoder")
    target: i8 = register("where to", unit="count")
    left: i8 = register("ticks until the window closes", unit="tick")
    before: i8 = register("count when the window opened", unit="count")
    speed: i8 = register("pulses of the last window", unit="count")
    error: f8 = register("way that is left when it has braked", unit="count")
    rest: i8 = register("ticks inside the dead band", unit="tick")
    event: u1 = register("1 when the axis has arrived; the host clears it")


class Lines(Registers):
    a: u1 = register("channel A", by=PLANT)
    b: u1 = register("channel B", by=PLANT)
    drive: i1 = register("1 full drive to the right, -1 to the left, 0 off", by=CONTROLLER)


class Plant(Registers):
    encoder: Encoder = block("encoder disc")
    train: DriveTrain = block("motor and slide")
    gauge: Gauge = block("what an observer sees")


class BangBangState(Registers):
    tick: i8 = register("periods of 10 us since power-on", unit="tick")
    controller: Controller = block("controller")
    lines: Lines = block("wires between controller and plant")
    plant: Plant = block("plant")


@controls(ControllerParams)
@hot_step
def control(p: ControllerParams, c: Controller, lines: Lines) -> None:
    count_edge(c.decoder, lines.a, lines.b)
    c.left -= 1
    if c.left <= 0:
        c.left, c.speed, c.before = p.window, c.decoder.count - c.before, c.decoder.count
    away = c.target - c.decoder.count
    c.error = away - p.braking * c.speed * abs(c.speed)
    lines.drive = 0 if abs(away) <= p.band else 1 if c.error > 0.0 else -1
    c.rest = c.rest + 1 if abs(away) <= p.band else 0
    c.event = 1 if c.rest == p.settling else 0


@hot_step
def move(p: PlantParams, tick: int, lines: Lines, plant: Plant) -> None:
    move_averaged(p.train, plant.train, lines.drive * p.supply, lines.drive * p.supply)
    follow(p.encoder, plant.encoder, plant.train.position)
    read_gauge(plant.gauge, tick, plant.train.position, plant.train.velocity)


@ticks(BangBangParams)
@hot_step
def tick(p: BangBangParams, r: BangBangState) -> bool:
    if r.controller.event:
        return False
    r.lines.a, r.lines.b = r.plant.encoder.channel_a, r.plant.encoder.channel_b
    control(p.controller, r.controller, r.lines)
    move(p.plant, r.tick, r.lines, r.plant)
    r.tick += 1
    return True
