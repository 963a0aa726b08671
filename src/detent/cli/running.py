"""What `detent live` runs: of each motor its loop, a channel, a watchdog and a panel."""

import contextlib
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any

from detent.cli.terminal import compiling_counted
from detent.operate.audit import Appender, Audit
from detent.operate.client import LiveAxis
from detent.operate.session import Session
from detent.operate.start import Place, make_host, shared_memory
from detent.operate.watchdog import Watchdog
from detent.panel.child import Child, PanelPlace


class Running:
    """An axis that runs, or one motor of a file with several; `chosen` goes to its host, `closing` ends it."""

    def __init__(
        self, closing: ExitStack, file: Path, motor: str, chosen: Mapping[str, Any], axis_file: dict[str, Any],
        *, record: Path | None, quiet: bool,
    ) -> None:  # fmt: skip
        self.motor, self.panel = motor, None
        place, (board, memory) = Place(file, motor), shared_memory()
        closing.callback(place.leave)
        with compiling_counted(quiet=quiet):
            self.host, name = make_host(file, motor=motor, memory=memory, **chosen)
            if record:
                closing.callback(_record(self.host, record).close)
            self.missing = self.host.start()
        closing.callback(lambda: self.host.is_running and self.host.close())  # where what follows cannot begin
        self.watchdog = closing.enter_context(contextlib.closing(Watchdog(self.host.board, board)))
        about = {"name": f"{name}, {motor}" if motor else name, "file": str(file), "speed": chosen["speed"]}
        self.session = Session(self.host, about | {"simulated": self.host.link is None}, axis_file)
        self.channel = _serve(closing, place, self.session)

    def show(self, closing: ExitStack, at: PanelPlace) -> None:
        """Open its panel."""
        self.panel = closing.enter_context(contextlib.closing(Child(self.channel.path, at)))

    def started(self, roles: Sequence[str]) -> dict[str, Any]:
        """How it is at the beginning, and how to speak to it."""
        status, told, link = self.session.status(), self.session.describe(), self.host.link
        found = {key: told[key] for key in ("name", "file", "simulated", "speed", "unit", "period", "drive")}
        found |= {key: status[key] for key in ("state", "store", "position", "trust", "find")}
        links = [self.panel.link(role) for role in roles] if self.panel else []
        found |= {"hardware": link.driver.hardware if link else "", "channel": str(self.channel.path), "panel": links}
        return found | {"not_permitted": self.missing, "watchdog": self.watchdog.id}

    def mend(self) -> list[str]:
        """Start again what has died beside the loop."""
        told = [self.panel.mend()] if self.panel else []
        return told + (["The watchdog had ended; another one watches now."] if self.watchdog.keep() else [])

    def end(self) -> dict[str, Any]:
        """Come to rest and let go; how it then is."""
        LiveAxis(self.session).close()
        self.host.note()  # the pulls of its end belong to the log
        return self.session.status()


def places(at: PanelPlace, axes: Sequence[Running]) -> list[PanelPlace]:
    """Where the panel of each is: where a port is named, the others follow it."""
    return [replace(at, port=at.port + k if at.port else 0) for k in range(len(axes))]


def end_all(axes: Sequence[Running]) -> dict[str, dict[str, Any]]:
    """All come to rest at the same time; how each then is, by its motor."""
    with ThreadPoolExecutor(len(axes)) as pool:
        return dict(zip((one.motor for one in axes), pool.map(Running.end, axes), strict=True))


def _serve(closing: ExitStack, place: Place, session: Session) -> Any:
    """Let other programs ask; what they ask is written down beside the store, or the channel. Gives the channel."""
    store = session.status()["store"]
    path = Path(store["path"]) if store else place.channel
    audit = closing.enter_context(contextlib.closing(Audit(path.with_suffix(".audit"))))
    return closing.enter_context(contextlib.closing(place.serve(session, audit)))


def _record(host: Any, path: Path) -> Appender:
    """Let a new file take the log of a host."""
    path.open("x", encoding="utf-8").close()
    recorder = Appender(path)
    host.log.sink = recorder.add
    return recorder
