"""The axis at power-on, what commands it, and what it shows of a move."""

from detent.axisfile.blocks import fill_slide
from detent.methods.moves.job import one_move
from detent.methods.moves.page import MoveView
from detent.methods.moves.run import Host, run_moves
from detent.page.chart import Curve, Panel
from detent.page.frame import TableComparison
from detent.page.table import TextTable
from detent.page.words import length, milliseconds
from detent.record.machine import Machine
from detent.sensing.encoder import stand_at
from detent.sensing.quadrature import preset
from detent_bang_bang.schema import TICK, BangBangSpec
from detent_bang_bang.system import BangBangParams, BangBangState


def build(spec: BangBangSpec) -> BangBangParams:
    p, method = BangBangParams(), spec.method
    fill_slide(p.plant, spec, TICK)
    p.plant.supply, p.controller.band = method.supply, method.dead_band
    p.controller.window, p.controller.settling = round(method.window / TICK), round(method.settling / TICK)
    if method.braking:
        p.controller.braking = spec.pulse / (2 * method.deceleration * method.window**2)
    return p


class BangBangHost(Host):
    def __init__(self, spec, recorder=None):
        p, r, home = build(spec), BangBangState(), spec.mechanics.start_position
        r.plant.train.position = home
        stand_at(p.plant.encoder, r.plant.encoder, home, spec.encoder.seed)
        preset(r.controller.decoder, r.plant.encoder.channel_a, r.plant.encoder.channel_b)
        machine, tolerance = Machine(p, r, TICK, recorder), (spec.method.dead_band + 1) * spec.pulse
        super().__init__(spec, machine, grid=spec.pulse, tolerance=tolerance, home=home)

    def command(self, to):
        self.controller.target, self.controller.rest, self.controller.event = to.counts, 0, 0

    def time_limit(self, to):
        return 2.0 + 10 * self.spec.limits.travel / self.spec.top_speed


class BangBangView(MoveView):
    signals = ("controller.error", "controller.speed", "lines.drive")
    captions = ("Look for: full drive, full brake, then off.", "Below: what is left of the way when it has braked.")
    max_speed = property(lambda self: self.spec.top_speed)

    def panels(self, shown):
        drive = Curve(label="drive", colour="drive", step=True, y=shown.rows["lines.drive"])
        return [*super().panels(shown), Panel(name="move-drive", label="drive", zero=True, curves=[drive])]

    def words(self, rows):
        return [Curve(label="way left when braked", colour="left", step=True, y=rows["controller.error"])]


def compare_braking(spec, progress):
    rows = []
    for name, braking in (("with braking", True), ("without", False)):
        progress(len(rows) / 2, name)
        host = BangBangHost(spec.changed(method={"braking": braking}))
        run = run_moves(host, one_move(name, 0.5 * spec.limits.travel, 0.0))
        rows.append((name, milliseconds(run.time_end), length(run.worst_overshoot)))
    return TableComparison(TextTable("Braking ahead of the target", ("way", "time", "overshoot"), rows))
