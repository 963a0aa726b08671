"""pyepics, or p4p: signals of a method: their units, a monitor that follows a move, one that is not there, a put."""

import json
import math
import sys
import threading
import time

name, kind, channels, found = sys.argv[1], sys.argv[2], sys.argv[3].split(","), {}
seen, lock = {channel: [] for channel in channels}, threading.Lock()


def came(channel, value):
    with lock:
        seen[channel].append((time.monotonic(), value))


if kind == "ca":
    import epics

    pvs = [
        epics.PV(f"{name}:{channel}", callback=lambda value, channel=channel, **_: came(channel, value))
        for channel in channels
    ]
    for pv in pvs:
        assert pv.wait_for_connection(10), pv.pvname
    found["units"] = [pv.get_ctrlvars()["units"] for pv in pvs]
    found["access"] = [pv.write_access for pv in pvs]
    found["severity"] = [pv.get_with_metadata(use_monitor=False)["severity"] for pv in pvs]
    epics.caput(name, 20.0, wait=True, timeout=20)
    epics.caput(name, 40.0, wait=True, timeout=20)
    leave = [pv.disconnect for pv in pvs]
    last = epics.caget(f"{name}:{channels[0]}")
else:
    from p4p.client.thread import Context

    client = Context("pva", nt=False)
    monitors = [
        client.monitor(f"{name}:{channel}", lambda value, channel=channel: came(channel, value.value))
        for channel in channels
    ]
    values = [client.get(f"{name}:{channel}", timeout=10) for channel in channels]
    found["units"] = [value.display.units for value in values]
    found["severity"] = [value.alarm.severity for value in values]
    client.put(name, 20.0, timeout=20)
    client.put(name, 40.0, timeout=20)
    leave = [*(monitor.close for monitor in monitors), client.disconnect]  # which keeps its channels else
    last = client.get(f"{name}:{channels[0]}").value
time.sleep(0.3)
with lock:
    times = [[t for t, _ in one] for one in seen.values()]
    found["changes"] = [len({v for _, v in one}) for one in seen.values()]
    found["ends"] = [one[-1][1] if one and math.isfinite(one[-1][1]) else None for one in seen.values()]
rates = [(len(one) - 1) / (one[-1] - one[0]) for one in times if len(one) > 10]
found |= {"rate": max(rates), "last": last}
print(json.dumps(found), flush=True)
sys.stdin.readline()  # whoever reads looks at the axis now
for one in leave:
    one()
time.sleep(0.5)
print("left", flush=True)
sys.stdin.readline()
