"""The axis at power-on, what commands it, and what it shows of a move."""

from detent.axisfile.drive_train import fill_drive_train
from detent.kernel.loop import advance
from detent.methods.moves.host import Host
from detent.methods.moves.job import one_move
from detent.methods.moves.page import PlainView
from detent.methods.moves.run import run_moves
from detent.page.chart import Curve, Panel
from detent.page.frame import TableComparison
from detent.page.table import TextTable
from detent.page.words import length, milliseconds
from detent.record.machine import Loop, Machine
from detent.sensing.encoder import stand_at
from detent_bang_bang.schema import TICK, BangBangSpec
from detent_bang_bang.system import BangBangParams, BangBangState


def build(spec: BangBangSpec) -> BangBangParams:
    p, c, method = BangBangParams(), spec.mechanics, spec.method
    mass = c.mass + spec.motor.rotor_inertia / spec.radius**2
    fill_drive_train(
        p.plant.train, spec.motor, c.friction, radius=spec.radius, mass=mass, travel=spec.limits.travel, period=TICK
    )
    p.plant.supply, p.plant.encoder.edge_pitch, p.plant.encoder.origin = method.supply, spec.pulse, -spec.pulse / 2
    p.controller.band, p.controller.window = method.dead_band, round(method.window / TICK)
    p.controller.settling = round(method.settling / TICK)
    if method.braking:
        p.controller.braking = spec.pulse / (2 * method.deceleration * method.window**2)
    return p


class BangBangHost(Host):
    def __init__(self, spec, recorder=None):
        p, r = build(spec), BangBangState()
        self.spec, self.controller, self.home, self.grid = spec, r.controller, 0.0, spec.pulse
        self.machine = Machine(p, r, Loop(TICK, advance), recorder)
        self.tolerance = (spec.method.dead_band + 1) * spec.pulse
        stand_at(p.plant.encoder, r.plant.encoder, 0.0, spec.encoder.seed)
        decoder, disc = r.controller.decoder, r.plant.encoder
        decoder.channel_a, decoder.channel_b = disc.channel_a, disc.channel_b

    def command(self, to):
        c = self.controller
        c.target, c.rest, c.event = to.counts, 0, 0

    def time_limit(self, to):
        return 2.0 + 10 * self.spec.limits.travel / self.spec.top_speed

    def wait(self, seconds):
        self.machine.pass_time(seconds)
        arrived, self.controller.event = bool(self.controller.event), 0
        return arrived


class BangBangView(PlainView):
    signals = ("controller.error", "controller.speed", "lines.drive")
    captions = ("Look for: full drive, full brake, then off.", "Below: what is left of the way when it has braked.")

    def panels(self, shown):
        drive = Curve(label="drive", colour="drive", step=True, y=shown.rows["lines.drive"])
        return [*super().panels(shown), Panel(name="move-drive", label="drive", zero=True, curves=[drive])]

    def words(self, rows):
        return [Curve(label="way left when braked", colour="left", step=True, y=rows["controller.error"])]


def compare_braking(spec):
    rows = []
    for name, braking in (("with braking", True), ("without", False)):
        host = BangBangHost(spec.model_copy(update={"method": spec.method.model_copy(update={"braking": braking})}))
        run = run_moves(host, one_move(name, 0.5 * spec.limits.travel, 0.0))
        rows.append((name, milliseconds(run.time_end), length(run.worst_overshoot)))
    return TableComparison(TextTable("Braking ahead of the target", ("way", "time", "overshoot"), rows))
