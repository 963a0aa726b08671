"""p4p alone: a put that is refused, and a stop that is not."""

import json
import sys

from p4p.client.thread import Context, RemoteError

name, client, found = sys.argv[1], Context("pva", nt=False), {}
found["selector"] = client.get(f"{name}:selector", timeout=5).value
if "look" in sys.argv:
    print(json.dumps(found))
    sys.exit()
try:
    client.put(name, 60.0, timeout=20)
except RemoteError as refused:
    found["put"] = str(refused)
client.put(f"{name}.STOP", 1, timeout=20)
client.close()
print(json.dumps(found))
