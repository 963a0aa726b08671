"""Values that were chosen for an axis, and how they come into its file."""

from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

from detent.errors import DetentError
from detent.files.patch import Change, NewValue, patch
from detent.files.screen import OnScreen
from detent.files.text import check_target, write_text
from detent.methods.load import AxisFile
from detent.page.table import TextTable


class Chosen(OnScreen):
    """What was chosen, whichever way."""

    values: Mapping[str, Any]

    @property
    def file(self) -> AxisFile:
        """The axis with the values of its file."""
        raise NotImplementedError

    def new_values(self) -> Sequence[NewValue]:
        """The values, with what is said of each in the file."""
        raise NotImplementedError

    @property
    def table(self) -> TextTable:
        """What the axis does at standstill with friction that its file does not state; no rows where there is none."""
        return TextTable("", (), ())

    @cached_property
    def changes(self) -> list[Change]:
        """What becomes of the axis file."""
        return self._patched()[1] if self.values else []

    def _patched(self) -> tuple[str, list[Change]]:
        file = self.file
        if not file.source.content:
            raise DetentError(
                f"{file.file}: got an axis without a file; expected: one of a file; try: write it down first"
            )
        return patch(file.source.content.decode(), self.new_values(), file.file)

    def save(self, path: str | Path, *, force: bool = False) -> Path:
        """Write the axis file with what was chosen; all else of its text stays.

        Parameters
        ----------
        path : path
            TOML file; that of the axis itself, or a new one.
        force : bool
            Replace another file that detent did not write.

        Returns
        -------
        Path
            The file.

        Raises
        ------
        DetentError
            Nothing was chosen, or the file cannot be written.
        """
        if not self.values:
            raise DetentError(f"{self.file.file}: got no gains; expected: gains that keep the bounds; see why not")
        own = Path(self.file.file)
        is_own = own.exists() and Path(path).exists() and own.samefile(path)
        target = check_target(path, (".toml",), "an axis", force=force or is_own)
        return write_text(target, self._patched()[0], force=force or is_own)
