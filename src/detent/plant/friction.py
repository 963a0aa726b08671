"""Friction of a guided carriage: Coulomb, viscous and static, each direction its own."""

from detent.kernel.registers import Registers, f8, register


class Friction(Registers):
    """Friction of both directions of motion; all values are magnitudes."""

    coulomb_right: f8 = register("Coulomb friction moving right", unit="N")
    coulomb_left: f8 = register("Coulomb friction moving left", unit="N")
    static_right: f8 = register("force that breaks loose to the right", unit="N")
    static_left: f8 = register("force that breaks loose to the left", unit="N")
    viscous_right: f8 = register("viscous friction moving right", unit="N.s/m")
    viscous_left: f8 = register("viscous friction moving left", unit="N.s/m")
