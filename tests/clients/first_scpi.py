"""pyvisa: enable, move, wait until it has arrived, and read the queue of errors."""

import sys

import pyvisa

axis = pyvisa.ResourceManager("@py").open_resource(sys.argv[1], read_termination="\n", write_termination="\n")
axis.timeout = 20_000
print(axis.query("*IDN?"))
axis.write("ENABle")
axis.write("MOVE:ABSolute 60")
axis.query("*OPC?")
print(f"at {float(axis.query('POSition?')):.1f}", axis.query("UNIT?"))
axis.write("MOVE:ABSolute 900")
print(axis.query("SYSTem:ERRor?"))
