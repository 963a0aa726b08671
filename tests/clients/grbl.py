"""grbl-streamer: connect, stream twenty lines, hold and resume, reset in motion."""

import json
import os
import sys
import time
import tty
from pathlib import Path

from grbl_streamer import GrblStreamer

events = []
streamer = GrblStreamer(lambda name, *about: events.append((name, *map(str, about))))
streamer.setup_logging()


def until(met, seconds=10.0):
    begin = time.monotonic()
    while not met():
        if time.monotonic() - begin > seconds:
            sys.stderr.write(f"waited in vain; {streamer.cmode} {streamer.cmpos} {events[-15:]}\n")
            sys.stderr.flush()
            os._exit(1)  # its threads would go on for ever
        time.sleep(0.01)


def came(name):
    return any(event[0] == name for event in events)


streamer.cnect(sys.argv[1])
until(lambda: came("on_boot"))
streamer.poll_start()
until(lambda: streamer.cmode == "Idle")
time.sleep(0.3)
if "refused" in sys.argv:
    streamer.send_immediately("G1 X60 F6000")
    until(lambda: came("on_error"))
    print(json.dumps({"move": [event[1] for event in events if event[0] == "on_error"]}), flush=True)
    place = streamer.cmpos[0]
    until(lambda: abs(streamer.cmpos[0] - place) > 1.0)
    streamer.softreset()
    time.sleep(0.5)
    streamer.killalarm()  # of a reset in motion, for who comes next
    time.sleep(0.2)
    streamer.poll_stop()
    streamer.disconnect()
    raise SystemExit
streamer.incremental_streaming = True
lines = ["G21", "G90", *(f"G1 X{40 + k} F6000" for k in range(18))]
streamer.write("\n".join(lines))
events.clear()
streamer.job_run()
until(lambda: came("on_job_completed"), 30.0)
until(lambda: streamer.cmode == "Idle" and abs(streamer.cmpos[0] - 57.0) < 0.1)
found = {"completed": True, "position": streamer.cmpos[0], "errors": [e for e in events if e[0] == "on_error"]}
streamer.send_immediately("G1 X260 F6000")
until(lambda: streamer.cmode == "Run" and streamer.cmpos[0] > 80)
streamer.hold()
until(lambda: streamer.cmode.startswith("Hold"))
time.sleep(0.6)
until(lambda: streamer.cmode == "Hold:0")
found["held"] = streamer.cmpos[0]
time.sleep(0.3)
found["held_later"] = streamer.cmpos[0]
streamer.resume()
until(lambda: streamer.cmode == "Idle" and abs(streamer.cmpos[0] - 260) < 0.1)
found["resumed"] = streamer.cmpos[0]
streamer.send_immediately("G1 X60 F6000")
until(lambda: streamer.cmode == "Run" and streamer.cmpos[0] < 240)
streamer.softreset()
until(lambda: came("on_alarm"))
found |= {"alarm": [e[1] for e in events if e[0] == "on_alarm"], "mode": streamer.cmode}
time.sleep(1.0)
found["reset_at"] = streamer.cmpos[0]
time.sleep(0.5)
found |= {"reset_later": streamer.cmpos[0], "reset_mode": streamer.cmode}
streamer.killalarm()
until(lambda: streamer.cmode == "Idle")
found["unlocked"] = streamer.cmode
streamer.poll_stop()
streamer.disconnect()
found["round_trips"] = []  # [s], of a status, which the library asks for in a rhythm of its own
with Path(sys.argv[1]).open("r+b", buffering=0) as line:
    tty.setraw(line)
    for _ in range(200):
        begin, answer = time.perf_counter(), b""
        line.write(b"?")
        while not answer.endswith(b">\r\n"):
            answer += line.read(1)
        found["round_trips"].append(time.perf_counter() - begin)
print(json.dumps(found))
