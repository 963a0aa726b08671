"""The control methods that are installed: each is the entry point of its name in the group ``detent.methods``."""

from collections.abc import Iterator, Mapping
from functools import cached_property
from importlib.metadata import EntryPoint, entry_points
from typing import Any, cast

from detent.errors import DetentError
from detent.methods.method import Method

GROUP = "detent.methods"


class Methods(Mapping[str, Method[Any]]):
    """Methods by name; each loads when it is first asked for."""

    refused: tuple[str, ...] = ()

    @cached_property
    def known(self) -> dict[str, EntryPoint | Method[Any]]:
        """The entry points, and in their place the methods that have been loaded."""
        return {entry.name: entry for entry in sorted(entry_points(group=GROUP), key=lambda entry: entry.name)}

    def __getitem__(self, name: str) -> Method[Any]:
        found = self.known[name]
        # An `EntryPoint`, or one of the package importlib_metadata, which takes the place of the standard library's.
        if hasattr(found, "group"):
            found = self.known[name] = _loaded(cast("EntryPoint", found))
        return cast("Method[Any]", found)

    def usable(self) -> list[Method[Any]]:
        """Those that can be loaded; what keeps the others from it is in `refused`."""
        found: list[Method[Any]] = []
        self.refused = ()
        for name in self:
            try:
                found.append(self[name])
            except DetentError as error:
                self.refused += (str(error),)
        return found

    def __iter__(self) -> Iterator[str]:
        return iter(self.known)

    def __len__(self) -> int:
        return len(self.known)


def _loaded(entry: EntryPoint) -> Method[Any]:
    """The method of an entry point; whatever another distribution does wrong while it loads is said in a sentence."""
    try:
        return entry.load()()
    except Exception as error:
        owner = entry.dist.name if entry.dist else entry.value
        raise DetentError(
            f"method {entry.name}: {owner}, which brings it, cannot be loaded ({type(error).__name__}: {error}); "
            f"reinstall {owner}, or remove it"
        ) from error


METHODS = Methods()


def bringing(word: str) -> list[str]:
    """Names of the methods that bring what not all do, such as "envelopes"."""
    return [method.name for method in METHODS.usable() if getattr(type(method), word) is not getattr(Method, word)]
