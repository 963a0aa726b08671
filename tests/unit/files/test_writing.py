"""What is written has its name only when it is whole."""

from pathlib import Path

import pytest

from detent.errors import DetentError
from detent.files.text import write_text, writing


def test_a_file_gets_its_name_at_the_end(tmp_path: Path) -> None:
    path = tmp_path / "told.txt"
    path.write_text("before", encoding="utf-8")
    with writing(path) as part:
        part.write_text("after", encoding="utf-8")
        assert path.read_text(encoding="utf-8") == "before"
    assert path.read_text(encoding="utf-8") == "after"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(("error", "told"), [(OSError(28, "No space left"), DetentError), (KeyError("x"), KeyError)])
def test_after_a_failure_nothing_is_left_and_the_old_file_stays(
    tmp_path: Path, error: Exception, told: type[Exception]
) -> None:
    path = tmp_path / "told.txt"
    write_text(path, "before")

    def fail() -> None:
        with writing(path) as part:
            part.write_text("half", encoding="utf-8")
            raise error

    with pytest.raises(told):
        fail()
    assert path.read_text(encoding="utf-8") == "before"
    assert list(tmp_path.iterdir()) == [path]


def test_a_place_that_takes_no_file_is_told(tmp_path: Path) -> None:
    with pytest.raises(DetentError, match=r"nowhere.*cannot be written .*choose another place or make room"):
        write_text(tmp_path / "nowhere" / "told.txt", "text")
    with pytest.raises(DetentError, match="cannot be written"):
        write_text(tmp_path, "text")
    assert list(tmp_path.iterdir()) == []


def test_a_text_that_is_no_utf8_is_written_with_marks(tmp_path: Path) -> None:
    assert write_text(tmp_path / "told.txt", "a\udcff\nb").read_bytes() == b"a?\nb"
