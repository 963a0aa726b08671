"""What detent takes of the bang-bang positioner."""

from detent.axisfile.catalogue import DC_MOTORS
from detent.methods.moves.method import MoveMethod
from detent_bang_bang.schema import BangBangSpec, countable


class BangBang(MoveMethod[BangBangSpec]):
    name = "bang_bang"
    title = "bang-bang: full drive towards the target, off in a dead band"
    pace = "10 us, every 10th"
    spec, catalogue, rules = BangBangSpec, DC_MOTORS, (countable,)
    fills, derives, clock = "schema:fill", "schema:derive", "schema:TICK"
    state, params = "system:BangBangState", "system:BangBangParams"
    commands, shows, compares = "host:BangBangHost", "host:BangBangView", ("host:compare_braking",)
    every, seed = 10, "encoder.seed"
    signals = (
        "plant.train.position", "plant.train.velocity", "plant.train.current", "plant.gauge.target",
        "controller.error", "controller.speed", "lines.drive",
    )  # fmt: skip
    timing = ("lines.a", "lines.b", "controller.decoder.count", "controller.speed", "lines.drive")
