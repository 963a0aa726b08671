"""What detent takes of the bang-bang positioner."""

from detent.axisfile.catalogue import DC_MOTORS
from detent.files.findings import quantity_figure
from detent.methods.moves.method import MoveMethod
from detent_bang_bang.schema import TICK, BangBangSpec, countable


class BangBang(MoveMethod[BangBangSpec]):
    name = "bang_bang"
    title = "bang-bang: full drive towards the target, off in a dead band"
    pace = "10 us, every 10th"
    every = 10
    spec = BangBangSpec
    rules = (countable,)
    catalogue = DC_MOTORS
    signals = (
        "plant.train.position", "plant.train.velocity", "plant.train.current", "plant.gauge.target",
        "controller.error", "controller.speed", "lines.drive",
    )  # fmt: skip
    timing = ("lines.a", "lines.b", "controller.decoder.count", "controller.speed", "lines.drive")

    def tick(self, spec):
        return TICK

    def derive(self, spec):
        return (quantity_figure("top speed", spec.top_speed, "m/s", "supply over back-EMF constant"),)

    def registers(self):
        from detent_bang_bang.system import BangBangState

        return BangBangState

    def parameters(self):
        from detent_bang_bang.system import BangBangParams

        return BangBangParams

    def host(self, spec, recorder):
        from detent_bang_bang.host import BangBangHost

        return BangBangHost(spec, recorder)

    def view(self, spec):
        from detent.page.words import CountUnit
        from detent_bang_bang.host import BangBangView

        return BangBangView(spec.axis.name, CountUnit(spec.pulse, "pulse"), spec.top_speed)

    def compare(self, spec, progress=None):
        from detent_bang_bang.host import compare_braking

        return (compare_braking(spec),)
