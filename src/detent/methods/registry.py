"""The control methods that are installed: each is the entry point of its name in the group ``detent.methods``."""

from collections.abc import Iterator, MutableMapping
from importlib.metadata import EntryPoint, entry_points
from typing import Any

from detent.methods.method import Method

GROUP = "detent.methods"


class Methods(MutableMapping[str, Method[Any]]):
    """Methods by name; each loads when it is first asked for."""

    def __init__(self) -> None:
        self._known: dict[str, EntryPoint | Method[Any]] | None = None

    def _all(self) -> dict[str, EntryPoint | Method[Any]]:
        if self._known is None:
            self._known = {entry.name: entry for entry in sorted(entry_points(group=GROUP), key=lambda e: e.name)}
        return self._known

    def __getitem__(self, name: str) -> Method[Any]:
        known = self._all()
        found = known[name]
        if isinstance(found, EntryPoint):
            found = known[name] = found.load()()
        return found

    def __setitem__(self, name: str, method: Method[Any]) -> None:
        self._all()[name] = method

    def __delitem__(self, name: str) -> None:
        del self._all()[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._all())

    def __len__(self) -> int:
        return len(self._all())


METHODS = Methods()


def bringing(word: str) -> list[str]:
    """Names of the methods that bring what not all do, such as "envelopes"."""
    return [name for name, method in METHODS.items() if getattr(type(method), word) is not getattr(Method, word)]
