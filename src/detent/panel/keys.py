"""Who may do what: a key a role, and what is signed with it - one-time links, cookies, tickets of sockets."""

import hmac
import json
import os
import secrets
import time
from collections.abc import Callable
from hashlib import sha256
from pathlib import Path
from typing import NamedTuple

from detent.errors import AxisError, DetentError
from detent.files.text import shown

ROLES = ("viewer", "operator", "engineer")  # each may do what those before it may
LINK, COOKIE, TICKET = "link", "cookie", "ticket"  # what is signed
LIFETIMES = {LINK: 600.0, COOKIE: 12 * 3600.0, TICKET: 10.0}  # [s]
ONCE = (LINK, TICKET)


def make_keys() -> dict[str, str]:
    """A key for each role, 256 bits."""
    return {role: secrets.token_urlsafe(32) for role in ROLES}


def keys_of(channel: Path) -> Path:
    """Where the keys of the panel of a live axis lie."""
    return channel.with_suffix(".keys")


def keep_keys(path: Path, address: str, keys: dict[str, str]) -> None:
    """Write address and keys where only this user reads them."""
    path.unlink(missing_ok=True)
    with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w", encoding="ascii") as file:
        json.dump({"address": address, "keys": keys}, file)


def link_of(path: Path, role: str, now: float) -> str:
    """A one-time link to the panel whose keys a file holds."""
    if role not in ROLES:
        raise DetentError(f"role {shown(role)!r}: there are {', '.join(ROLES)}; choose one")
    try:
        held = json.loads(path.read_text(encoding="ascii"))
    except (OSError, ValueError) as error:
        raise AxisError(f"{path}: no panel runs there; start one with: detent live FILE") from error
    return f"{held['address']}/enter?ticket={sign(held['keys'][role], role, LINK, now)}"


class Pass(NamedTuple):
    """Who has shown something signed."""

    role: str
    name: str  # random, of this one
    until: float  # when it runs out [s since 1970]

    def may(self, role: str) -> bool:
        """Whether it may do what a role may."""
        return ROLES.index(self.role) >= ROLES.index(role)


def sign(key: str, role: str, kind: str, now: float) -> str:
    """Something signed: role, a random name, when it was made [ms], and the mark of the key over these and its kind."""
    body = f"{role}.{secrets.token_hex(16)}.{now * 1e3:.0f}"
    return f"{body}.{_mark(key, kind, body)}"


def _mark(key: str, kind: str, body: str) -> str:
    return hmac.new(key.encode(), f"{kind}.{body}".encode(), sha256).hexdigest()


class Keys:
    """What the panel signs and reads; links and tickets are taken once, and none that is older than this panel."""

    def __init__(self, keys: dict[str, str], clock: Callable[[], float] = time.time) -> None:
        self._keys, self._clock, self._since = keys, clock, clock()
        self._used: dict[str, float] = {}  # marks, and when they would have run out

    def sign(self, role: str, kind: str) -> str:
        """Sign for a role."""
        return sign(self._keys[role], role, kind, self._clock())

    def read(self, signed: str, kind: str) -> Pass | None:
        """Who shows this; None where it was not signed here, has run out, or was shown before."""
        body, _, mark = signed[:200].rpartition(".")
        role, _, rest = body.partition(".")
        name, _, made = rest.partition(".")
        if not hmac.compare_digest(
            mark.encode(), _mark(self._keys.get(role, secrets.token_hex()), kind, body).encode()
        ):
            return None
        now, until = self._clock(), int(made) * 1e-3 + LIFETIMES[kind]
        if now >= until or (kind in ONCE and (mark in self._used or int(made) * 1e-3 < self._since - 1e-3)):
            return None
        if kind in ONCE:
            self._used = {mark: end for mark, end in self._used.items() if end > now} | {mark: until}
        return Pass(role, name, until)

    def form_mark(self, who: Pass) -> str:
        """What a page says back beside its cookie, for another page cannot know it."""
        return _mark(self._keys[who.role], "form", who.name)
