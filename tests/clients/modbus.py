"""pymodbus as a client: identification, and the hand-shake of a PLC with its heartbeat."""

import json
import sys
import time

from pymodbus.client import ModbusTcpClient

client = ModbusTcpClient("127.0.0.1", port=int(sys.argv[1]))
assert client.connect()
what, beat, sequence = sys.argv[2], 0, 0


def read(address, words=1):
    found = client.read_holding_registers(address, count=words).registers
    value = 0
    for word in found:
        value = value << 16 | word
    return value - (1 << 32) if words == 2 and value >> 31 else value


def write(address, value, words=1):
    data = [value >> 16 & 0xFFFF, value & 0xFFFF] if words == 2 else [value]
    return client.write_registers(address, data)


def heart():
    global beat
    beat = (beat + 1) % 65536
    return write(40, beat)


def command(number, target=0, speed=0, silent=False, wait=True):
    global sequence
    sequence = (read(23) + 1) % 65536
    write(42, target, 2)
    write(44, speed, 2)
    write(41, number)
    if not silent:
        heart()
    write(46, sequence)
    while wait and (read(23) != sequence or read(24) == 1):
        if not silent:
            heart()
    return read(24), read(25)


beat = read(40)
found = {"identification": client.read_holding_registers(0, count=26).registers}
if what == "hand-shake":
    identity = client.read_device_information(read_code=1)
    found["maker"] = identity.information[0].decode()
    found["enabled"] = command(1)
    found["moved"] = command(7, 60_000)
    found["position"] = read(16, 2)
    found["by"] = command(8, -2_000), read(16, 2)
    found["beyond"] = command(7, 9_000_000)
    found["read_only"] = write(16, 5).exception_code
    found["no_address"] = client.read_holding_registers(200, count=1).exception_code
    found["no_value"] = write(41, 99).exception_code
    found["no_function"] = client.write_coil(1, True).exception_code
    found["round_trips"] = []  # [s]
    for _ in range(500):
        begin = time.perf_counter()
        client.read_holding_registers(10, count=16)
        found["round_trips"].append(time.perf_counter() - begin)
elif what == "silent":
    found["enable"] = command(1, silent=True)
    time.sleep(1.0)
    found["stop"] = command(3, silent=True)
    command(1)
    command(7, 400_000, 40_000, wait=False)
    for _ in range(20):
        heart()
        time.sleep(0.02)
    found["moving"] = bool(read(12) & 8)
    begin, places = time.monotonic(), []
    while time.monotonic() - begin < 2.0:
        places.append((time.monotonic() - begin, read(16, 2), read(18, 2)))
        time.sleep(0.01)
    found["rest"] = next(t for t, _, _ in places if all(abs(v) <= 200 for s, _, v in places if s >= t))
    found["end"], found["result"] = places[-1][1], (read(24), read(25))
    speeds = [abs(v) for t, _, v in places if t < found["rest"]]
    found["ramp"] = sum(10_000 < v < 30_000 for v in speeds)
elif what == "jog":
    command(1)
    command(9, speed=20_000, wait=False)
    for _ in range(25):
        heart()
        time.sleep(0.02)
    seen = []
    for _ in range(20):  # samples, fifty of which come in a second: a count more in one is 1000 of its velocity
        heart()
        seen.append(read(18, 2))
        time.sleep(0.02)
    found["velocity"] = sum(seen) / len(seen)
    command(3)
    begin = time.monotonic()
    while abs(read(18, 2)) >= 200 and time.monotonic() - begin < 1.0:
        time.sleep(0.01)  # the commanded point rests at once, the load a little later
    found["after"] = read(18, 2)
elif what == "leave moving":
    command(1)
    command(7, 450_000, 50_000, wait=False)
    while True:
        heart()
        time.sleep(0.05)
elif what == "refused":
    found["move"] = command(7, 1_000)
    found["stop"] = command(3)
print(json.dumps(found))
