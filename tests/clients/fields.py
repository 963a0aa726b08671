"""Every field of the record, with pyepics and with aioca: its type as Channel Access tells it, and a value."""

import asyncio
import json
import os
import sys

import aioca
import epics

name, fields = sys.argv[1], sys.argv[2].split(",")


async def by_aioca():
    values = await aioca.caget([f"{name}.{field}" for field in fields], format=aioca.FORMAT_CTRL)
    return {field: int(value.datatype) for field, value in zip(fields, values, strict=True)}


found = {"aioca": asyncio.run(by_aioca()), "pyepics": {}, "none": []}
pvs = {field: epics.PV(f"{name}.{field}", auto_monitor=False) for field in fields}
for field, pv in pvs.items():
    if pv.wait_for_connection(5.0):
        found["pyepics"][field] = pv.type.replace("time_", "").replace("ctrl_", "")
        if pv.get() is None:
            found["none"].append(field)
found["extras"] = {
    extra: epics.caget(f"{name}:{extra}", as_string=True) for extra in ("trust", "state", "fault_text", "sample")
}
print(json.dumps(found), flush=True)
os._exit(0)  # pyepics now and then crashes while Python shuts down (its issue 228)
