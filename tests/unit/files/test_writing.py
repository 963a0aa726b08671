"""What is written has its name only when it is whole."""

import re
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


def linked(folder, name, leads_to):
    (folder / name).symlink_to(leads_to)
    return folder / name


def test_a_link_is_written_through_and_stays_one(tmp_path):
    """The file took the place of the link, and what it led to kept the old contents."""
    (tmp_path / "far").mkdir()
    (tmp_path / "far" / "kept.txt").write_text("before")
    link = linked(tmp_path, "link.txt", "far/kept.txt")
    again = linked(tmp_path, "again.txt", "link.txt")
    within = linked(tmp_path, "folder", "far")
    for path, text in ((link, "one"), (again, "two"), (within / "kept.txt", "three")):
        write_text(path, text)
        assert (tmp_path / "far" / "kept.txt").read_text() == text
    assert [path.is_symlink() for path in (link, again, within)] == [True] * 3
    assert [path.name for path in (tmp_path / "far").iterdir()] == ["kept.txt"]


def test_what_a_link_leads_to_stays_whole_when_writing_fails(tmp_path):
    (tmp_path / "kept.txt").write_text("before")
    link = linked(tmp_path, "link.txt", "kept.txt")

    def fail() -> None:
        with writing(link) as part:
            part.write_text("half")
            raise RuntimeError

    with pytest.raises(RuntimeError):
        fail()
    assert link.is_symlink()
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {"kept.txt": "before", "link.txt": "before"}


def test_a_link_to_what_is_not_there_yet_makes_it(tmp_path):
    link = linked(tmp_path, "link.txt", "new.txt")
    write_text(link, "first")
    assert link.is_symlink()
    assert (tmp_path / "new.txt").read_text() == "first"


@pytest.mark.parametrize(
    ("leads_to", "reason"),
    [
        ("link.txt", "Too many levels of symbolic links"),
        ("nowhere/new.txt", "No such file or directory"),
        ("/dev/null", "it is no file but a device"),
        (".", "Is a directory"),
    ],
)
def test_a_link_that_leads_nowhere_is_told(tmp_path, leads_to, reason):
    link = linked(tmp_path, "link.txt", leads_to)
    with pytest.raises(DetentError, match=re.escape(f"link.txt: cannot be written ({reason}); choose")) as caught:
        write_text(link, "text")
    assert caught.value.exit_status == 2
    assert [path.name for path in tmp_path.iterdir()] == ["link.txt"]
    assert link.is_symlink()
