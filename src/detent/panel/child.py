"""The panel as a child of the process that runs the axis: started, watched, started again where it has died."""

import ipaddress
import json
import subprocess
import sys
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from detent.errors import AxisError, DetentError
from detent.files.text import shown
from detent.panel.keys import ROLES, keep_keys, keys_of, link_of, make_keys

LOOPBACK = ("127.0.0.1", "::1")


@dataclass(frozen=True, slots=True)
class PanelPlace:
    """Where a panel listens, and how."""

    bind: str = ""  # an address of this machine; empty: only programs of this machine reach it
    port: int = 0  # 0: any that is free
    certificate: str = ""
    key_file: str = ""
    plain: bool = False  # plain HTTP over a network, knowingly
    names: Sequence[str] = field(default=())  # under which it is called, beside its addresses

    def check(self) -> None:
        """Refuse what would let others in, and what could not work."""
        if bool(self.certificate) != bool(self.key_file):
            raise DetentError("TLS needs both, --tls-certificate and --tls-key")
        for path in filter(None, (self.certificate, self.key_file)):
            if not Path(path).is_file():
                raise DetentError(f"{shown(path)}: no such file; expected a PEM file for TLS")
        try:
            address = ipaddress.ip_address(self.bind or LOOPBACK[0])
        except ValueError as error:
            raise DetentError(f"--bind {shown(self.bind)}: expected an address such as 192.168.1.20") from error
        if address.is_unspecified:
            raise DetentError(f"--bind {self.bind}: that is every network; name the address of one")
        if not (address.is_loopback or self.certificate or self.plain):
            raise DetentError(
                f"--bind {self.bind}: others on that network could read and change what is sent; give "
                "--tls-certificate and --tls-key, or accept it with --i-accept-plain-http"
            )

    @property
    def on_network(self) -> bool:
        """Whether others than this machine reach it without TLS."""
        return bool(self.bind) and not ipaddress.ip_address(self.bind).is_loopback and not self.certificate


class Child:
    """The process of the panel."""

    def __init__(self, channel: Path, place: PanelPlace) -> None:
        place.check()
        self._channel, self._place, self._keys = channel, place, make_keys()
        self._port, self._gone = place.port, False
        self.keys_file = keys_of(channel)
        self._start()

    def _start(self) -> None:
        place = self._place
        told: dict[str, Any] = {
            "channel": str(self._channel), "keys": self._keys, "port": self._port, "names": [*place.names],
            "addresses": [place.bind] if place.bind else [*LOOPBACK], "plain": place.on_network,
            "certificate": place.certificate, "key_file": place.key_file,
        }  # fmt: skip
        # A group of its own: Ctrl-C at the terminal must not close the panel before the axis is at rest. No session of
        # its own: Linux shares a processor among sessions first, and there a priority within one counts for nothing.
        self._process = subprocess.Popen(
            [sys.executable, "-m", "detent.panel"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
            process_group=0,
        )  # fmt: skip
        assert self._process.stdin is not None  # noqa: S101 - it is a pipe
        assert self._process.stdout is not None  # noqa: S101 - it is a pipe
        with suppress(BrokenPipeError):  # it has ended: no answer tells so
            self._process.stdin.write(json.dumps(told) + "\n")
            self._process.stdin.flush()
        answer: dict[str, Any] = json.loads(self._process.stdout.readline() or "{}")
        if "port" not in answer:
            self._process.communicate()
            at = f"{place.bind or LOOPBACK[0]}, port {self._port or 'any'}"
            why = f"the panel did not start at {at} ({answer.get('error', 'its process ended')})"
            raise AxisError(f"{why}; choose --bind, --port or certificate anew, or do without it: --headless")
        self._port = answer["port"]
        keep_keys(self.keys_file, self.address, self._keys)

    @property
    def address(self) -> str:
        """Where it is."""
        host = self._place.bind or LOOPBACK[0]
        host = f"[{host}]" if ":" in host else host
        return f"{'https' if self._place.certificate else 'http'}://{host}:{self._port}"

    def link(self, role: str) -> str:
        """A one-time link."""
        return link_of(self.keys_file, role, time.time())

    def mend(self) -> str:
        """Start it again where it has died; tells what has happened, if anything has."""
        if self._gone or self._process.poll() is None:
            return ""
        self.close()
        try:
            self._start()
        except AxisError as error:  # the axis goes on without it
            self._gone = True
            return f"The panel has ended: {error}"
        return f"The panel had ended, and runs again: {self.link(ROLES[-1])}"

    def close(self) -> None:
        """End it."""
        assert self._process.stdin is not None  # noqa: S101 - it is a pipe
        self._process.stdin.close()
        try:
            self._process.wait(3.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        if self._process.stdout is not None:
            self._process.stdout.close()
        self.keys_file.unlink(missing_ok=True)
