"""grbl-streamer: three lines of G-code, and where the axis is at their end."""

import sys
import threading

from grbl_streamer import GrblStreamer

booted, done, still = threading.Event(), threading.Event(), threading.Event()
events = {"on_boot": booted, "on_job_completed": done}


def heard(name, *about):
    """What the streamer tells, from its threads."""
    if name in events:
        events[name].set()
    if name == "on_stateupdate" and done.is_set() and about[0] == "Idle":
        still.set()


sender = GrblStreamer(heard)
sender.setup_logging()
sender.cnect(sys.argv[1])
booted.wait(10)
sender.poll_start()
sender.incremental_streaming = True
sender.write("G21 G90\nG1 X40 F6000\nG1 X57 F6000")
sender.job_run()
done.wait(20)
still.wait(20)
print(f"{sender.cmode} at X{sender.cmpos[0]:.1f}")
sender.disconnect()
