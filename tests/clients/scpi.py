"""pyvisa with pyvisa-py: identification, a move, the end of it, nonsense; over a socket or a serial terminal."""

import json
import sys
import time

import pyvisa

resource = pyvisa.ResourceManager("@py").open_resource(sys.argv[1], read_termination="\n", write_termination="\n")
resource.timeout = 8000
ask, tell = resource.query, resource.write
found = {"identity": ask("*IDN?"), "power_on": ask("*ESR?"), "unit": ask("UNIT?"), "limits": ask("LIMits?")}
if "refused" in sys.argv:
    tell("ENABle")
    found["refused"] = ask("SYST:ERR?")
    tell("MOVE:ABS 40")
    found["move_refused"] = ask("SYSTem:ERRor?")
    tell("STOP")
    found["stop"] = ask("SYST:ERR?")
    print(json.dumps(found))
    sys.exit()
tell("ENAB")
tell("MOVE:ABSolute 60")
begin = time.monotonic()
found["moving"] = ask("MOV?")
found["complete"] = ask("*OPC?")
found["took"] = time.monotonic() - begin
found["position"] = float(ask("POSition?"))
tell("MOVE:REL 5 mm")
tell("*OPC")
while not int(ask("*ESR?")) & 1:
    time.sleep(0.01)
found["by"] = float(ask("POS?"))
tell("MOVE:ABS 300;MOVE:ABS 61")
found["second"] = ask("*OPC?;POS?")
for nonsense in (
    "FOO",
    "MOVE:ABS",
    "MOVE:ABS x",
    "MOVE:ABS 1,2,3",
    "MOVE:ABS 10000",
    "*ESE 999",
    "\xff\x00",
    "MOVE:ABS 60,1e9",
):
    resource.write_raw(nonsense.encode("latin-1") + b"\n")
found["status"] = int(ask("*STB?"))
found["errors"] = []
while not (error := ask("SYST:ERR?")).startswith("0,"):
    found["errors"].append(int(error.split(",")[0]))
found["events"] = int(ask("*ESR?"))
tell("MOVE:ABS 300")
time.sleep(0.15)
tell("*RST")
found["stopped"] = float(ask("POS?"))
found["round_trips"] = []  # [s]
for _ in range(200):
    begin = time.perf_counter()
    ask("POS?")
    found["round_trips"].append(time.perf_counter() - begin)
print(json.dumps(found))
