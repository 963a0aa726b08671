"""alpyca: a focuser or a rotator; and raw requests as ConformU makes them."""

import json
import sys
import time
import urllib.error
import urllib.parse
import urllib.request

from alpaca import exceptions, management
from alpaca.focuser import Focuser
from alpaca.rotator import Rotator

address, kind = sys.argv[1], sys.argv[2]
device = (Focuser if kind == "focuser" else Rotator)(address, 0)


def error_of(ask):
    try:
        ask()
    except exceptions.AlpacaRequestException as error:
        return f"HTTP {error.number}"
    except exceptions.DriverException as error:
        return f"driver {error.number:#x}"
    except Exception as error:  # noqa: BLE001 - its name is what is asked for
        return type(error).__name__
    return ""


def raw(method, name, **said):
    data = urllib.parse.urlencode(said)
    url = f"http://{address}/api/v1/{kind}/0/{name}" + (f"?{data}" if method == "GET" else "")
    request = urllib.request.Request(url, data=data.encode() if method == "PUT" else None, method=method)
    try:
        with urllib.request.urlopen(request) as answer:
            return json.load(answer)
    except urllib.error.HTTPError as error:
        return error.code


found = {
    "versions": management.apiversions(address), "devices": management.configureddevices(address),
    "not_connected": error_of(lambda: device.IsMoving),
}  # fmt: skip
device.Connected = True
if "refused" in sys.argv:
    found["move"] = error_of(lambda: device.Move(100))
    found["halt"] = error_of(device.Halt)
    print(json.dumps(found))
    sys.exit()


def rest():
    while device.IsMoving:
        time.sleep(0.01)


if kind == "focuser":
    found |= {
        "absolute": device.Absolute,
        "max": device.MaxStep,
        "size": device.StepSize,
        "comp": device.TempCompAvailable,
    }
    device.Move(70_000)
    found["moving"] = device.IsMoving
    rest()
    found["position"] = device.Position
    found["temperature"] = error_of(lambda: device.Temperature)
    found["action"] = error_of(lambda: device.Action("fly", ""))
    device.Move(400_000)
    far = 400_000
else:
    found |= {"reverse": device.CanReverse, "size": device.StepSize}
    device.MoveAbsolute(90.0)
    found["moving"] = device.IsMoving
    rest()
    found |= {"position": device.Position, "mechanical": device.MechanicalPosition, "target": device.TargetPosition}
    device.Move(-10.0)
    rest()
    found["by"] = device.Position
    found["beyond"] = error_of(lambda: device.MoveAbsolute(400.0))
    device.Sync(45.0)
    found["synced"] = [device.Position, device.MechanicalPosition]
    device.MoveMechanical(200.0)
    far = 200.0
time.sleep(0.15)
device.Halt()
found |= {"halted": device.Position, "still": device.IsMoving, "far": far}
first = raw("GET", "name", ClientID=1, ClientTransactionID=77)
found |= {
    "transaction": first["ClientTransactionID"], "server": first["ServerTransactionID"] > 0,
    "wrong_case": raw("PUT", "move", position=5), "no_number": raw("PUT", "move", Position="here"),
    "unknown": raw("GET", "colour"), "bad_mark": raw("GET", "name", ClientTransactionID=-4),
    "not_a_number": raw("PUT", "move", Position="nan"), "flag": raw("PUT", "connected", Connected="maybe"),
}  # fmt: skip
found["round_trips"] = []  # [s]
for _ in range(200):
    begin = time.perf_counter()
    device.Position
    found["round_trips"].append(time.perf_counter() - begin)
device.Connected = False
found["left"] = error_of(lambda: device.Position)
print(json.dumps(found))
