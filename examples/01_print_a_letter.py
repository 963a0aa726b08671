"""Load an axis, let it print a letter, look at what happened, and disturb it.

Run it from any folder: python examples/01_print_a_letter.py. It writes into runs/example.
"""

# %% Load an axis file. Everything that is wrong with it would come as one InputError.
from pathlib import Path

import detent

axis = detent.load(detent.example("print_head.toml"))
for warning in axis.check().warnings:
    print("warning:", warning)

# %% Print a job, from power-on: homing, identification, line by line.
run = axis.run(detent.example("letter.txt"))
found = run.result
print(f"printed: {run.done}, {found.characters} characters in {found.print_time:.2f} s")
print(f"worst column {found.worst_error * 1e6:.1f} um, {found.turn_arounds} turn-arounds")
for side, line in found.identified.items():
    print(f"{side}: slope {line.slope} (true {line.true_slope:.1f}), friction {line.friction} counts")

# %% The trace: numpy arrays with units, named like the registers of the machine.
current = run.trace["plant.train.current"]
print(f"{len(run.trace)} rows, current up to {abs(current).max():.2f} {run.trace.units['plant.train.current']}")

# %% Files for other tools, a figure of the first line, the report.
folder = Path("runs/example")
folder.mkdir(parents=True, exist_ok=True)
first = found.lines[0]
run.save(folder / "trace.h5")
run.plot(["plant.train.velocity", "controller.head.drive_cmd"], folder / "line.png", (first.start, first.stop))
run.report(folder / "report.html")
print(f"open {folder / 'report.html'}")

# %% The same axis on a machine that has drifted: does it still print as well?
for drift in (-10, 0, 10):
    drifted = detent.load(detent.example("print_head.toml"), [f"disturbance.motor_constant={drift} %"])
    result = drifted.run(detent.example("letter.txt"), every=0).result
    print(f"motor constant {drift:+3} %: worst column {result.worst_error * 1e6:.1f} um")
