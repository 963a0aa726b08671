"""From a recorded run to constants: recordings of real machines, read, checked and put into SI units."""
