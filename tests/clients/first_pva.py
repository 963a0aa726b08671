"""A first move over PV Access: a put that ends with the move, what the record then shows, and a limit."""

import sys

from p4p.client.thread import Context, RemoteError

name, client = sys.argv[1], Context("pva", nt=False)


def shown(behind):
    """What a PV of the record shows."""
    return client.get(name + behind).value


client.put(name, 40.0, timeout=20)
print(f"at {shown('.RBV'):.1f} {shown('.EGU')}, done {shown('.DMOV')}, {shown(':trust')}")
try:
    client.put(name, 900.0, timeout=20)
except RemoteError as refused:
    print(refused)
client.close()
