"""What may stand at the other end of an axis's lines when that is no simulated plant."""
