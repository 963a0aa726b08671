from detent.plant.drive_train import Friction


def test_every_kind_of_friction_has_both_directions_and_a_unit():
    units = {leaf.path: leaf.unit for leaf in Friction.leaves()}
    assert units == {
        "coulomb_right": "N",
        "coulomb_left": "N",
        "static_right": "N",
        "static_left": "N",
        "viscous_right": "N.s/m",
        "viscous_left": "N.s/m",
    }
