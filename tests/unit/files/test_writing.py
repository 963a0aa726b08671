"""What is written has its name only when it is whole."""

import os
import re
import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import pytest

import detent
from detent.errors import DetentError, DiskError
from detent.files import text as files_text
from detent.files.text import abandon, placing, together, write_text, writing


def test_a_file_gets_its_name_at_the_end(tmp_path: Path) -> None:
    path = tmp_path / "told.txt"
    path.write_text("before", encoding="utf-8")
    with writing(path, force=True) as part:
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
        with writing(path, force=True) as part:
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
        write_text(path, text, force=True)
        assert (tmp_path / "far" / "kept.txt").read_text() == text
    assert [path.is_symlink() for path in (link, again, within)] == [True] * 3
    assert [path.name for path in (tmp_path / "far").iterdir()] == ["kept.txt"]


def test_what_a_link_leads_to_stays_whole_when_writing_fails(tmp_path):
    (tmp_path / "kept.txt").write_text("before")
    link = linked(tmp_path, "link.txt", "kept.txt")

    def fail() -> None:
        with writing(link, force=True) as part:
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


# ---- killed at each call that changes a folder

# Ends the process, with nothing cleared up, before the call of a number that changes something below the folder.
KILLED = """
import os, sys
from pathlib import Path
from detent.files import text
CHANGES = {"open", "os.mkdir", "os.rename", "os.remove", "os.rmdir", "os.truncate"}
last, folder = int(sys.argv[1]), Path(sys.argv[2])
def at(event, args):
    global last
    if event in CHANGES and str(args[0]).startswith(str(folder)):
        last -= 1
        if last < 0:
            os._exit(9)
sys.addaudithook(at)
with text.placing(folder, ("report.html", "trace.h5", "trace.csv"), force=True) as made:
    text.write_text(made / "report.html", "new")
    text.write_text(made / "trace.h5", "new")
"""
OLD = dict.fromkeys(("report.html", "trace.h5", "trace.csv"), "old")
NEW = dict.fromkeys(("report.html", "trace.h5"), "new")


def held(folder: Path) -> dict[str, str]:
    return {file.name: file.read_text(encoding="utf-8") for file in folder.iterdir() if file.is_file()}


def killed_at(number: int, folder: Path) -> bool:
    for name, text in OLD.items():
        (folder / name).write_text(text, encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "-c", KILLED, str(number), str(folder)], capture_output=True, text=True, check=False,
        env={**os.environ, "PYTHONPATH": str(Path(detent.__file__).parents[1])},
    )  # fmt: skip
    assert done.returncode in {0, 9}, done.stderr
    return done.returncode == 9


@pytest.mark.process
def test_killed_anywhere_files_that_belong_together_are_those_of_one_time(
    tmp_path: Path, tried: Callable[..., None]
) -> None:
    """A report could stand beside another run's trace, and the folder it was made in stayed for ever."""
    outcomes: list[dict[str, str]] = []
    for number in range(60):
        folder = tmp_path / str(number)
        folder.mkdir()
        was_killed = killed_at(number, folder)
        found = held(folder)
        assert found.items() <= OLD.items() or found.items() <= NEW.items()
        with pytest.raises(KeyError), placing(folder):  # one that fails on its own changes nothing more
            raise KeyError
        outcomes.append(held(folder))
        assert [file for file in folder.iterdir() if file.is_dir()] == []
        if not was_killed:
            break
    turn = outcomes.index(NEW)
    assert 5 < turn < len(outcomes) - 4  # calls before all is there, and after
    assert outcomes == [OLD] * turn + [NEW] * (len(outcomes) - turn)
    what = "report and traces, killed before each call that changes their folder"
    tried("kill", what, "never two runs side by side; the next command clears up", len(outcomes) - 1)


def test_a_message_names_the_place_that_a_file_will_have(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("out").mkdir()
    with pytest.raises(DiskError) as told, placing(Path("out")) as made, writing(made / "trace.h5"):
        raise OSError(28, "No space left")
    assert str(told.value).startswith("out/trace.h5: cannot be written (No space left)")


# ---- files in any folders that belong together


@pytest.fixture
def pair(tmp_path: Path) -> tuple[Path, Path]:
    (tmp_path / "pictures").mkdir()
    files = tmp_path / "a.vcd", tmp_path / "pictures" / "a.png"
    for file in files:
        write_text(file, "old")
    return files


def texts(pair: tuple[Path, Path]) -> list[str]:
    assert sorted(p for p in pair[0].parent.rglob("*") if p.is_file()) == sorted(pair)
    return [file.read_text() for file in pair]


def test_files_written_together_get_their_names_at_one_time(pair: tuple[Path, Path]) -> None:
    with together():
        for file in pair:
            write_text(file, "new", force=True)
        assert [file.read_text() for file in pair] == ["old", "old"]
        with pytest.raises(DiskError, match="another process is writing there"):
            write_text(pair[0], "another", force=True)
    assert texts(pair) == ["new", "new"]
    write_text(pair[0], "alone", force=True)
    assert texts(pair) == ["alone", "new"]


@pytest.mark.parametrize("error", [OSError(28, "No space left"), KeyError()])
def test_when_the_second_fails_the_first_gets_no_name_either(pair: tuple[Path, Path], error: Exception) -> None:
    """A VCD file of this run stood beside the picture of an earlier one."""

    def fail() -> None:
        with together():
            write_text(pair[0], "new", force=True)
            with writing(pair[1], force=True):
                raise error

    with pytest.raises((DiskError, KeyError)) as told:
        fail()
    assert texts(pair) == ["old", "old"]
    assert isinstance(told.value, KeyError) or str(told.value).startswith(f"{pair[1]}: cannot be written (No space")


@pytest.mark.parametrize("named", [0, 1, 2])
def test_ended_while_they_are_named_all_get_their_names(
    pair: tuple[Path, Path], named: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A signal that is heeded comes between the names of two files."""
    monkeypatch.setattr(files_text, "_WRITTEN", {})
    monkeypatch.setattr(files_text, "_UNFINISHED", {})
    replace, kept = Path.replace, list[Path]()

    def ended(self: Path, target: Path) -> Path:
        left = [one for one in pair if one.with_name(f"{one.name}.part").exists()]
        if 2 - len(left) == named:
            monkeypatch.setattr(Path, "replace", replace)
            kept.extend(abandon())
            raise KeyboardInterrupt
        return replace(self, target)

    monkeypatch.setattr(Path, "replace", ended)
    with suppress(KeyboardInterrupt):
        with together():
            for file in pair:
                write_text(file, "new", force=True)
        kept.extend(abandon())
    assert texts(pair) == ["new", "new"]
    assert sorted(kept) == sorted(pair)


def test_ended_before_all_are_whole_none_gets_its_name(
    pair: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(files_text, "_WRITTEN", {})
    with suppress(KeyboardInterrupt), together():
        write_text(pair[0], "new", force=True)
        with writing(pair[1], force=True) as part:
            part.write_text("half")
            assert abandon() == []
            assert texts(pair) == ["old", "old"]
            raise KeyboardInterrupt


# ---- two at once


def test_a_second_that_writes_the_same_is_refused_until_the_first_has_ended(
    tmp_path: Path, tried: Callable[..., None]
) -> None:
    """Both wrote into one file, which then got its name twice."""
    for attempt in (lambda: writing(tmp_path / "told.txt"), lambda: placing(tmp_path)):
        with attempt() as first:
            with pytest.raises(DiskError, match="another process is writing there"), attempt():
                pytest.fail("it was let in")
            (first / "told.txt" if first.is_dir() else first).write_text("first")
        assert held(tmp_path) == {"told.txt": "first"}
        tried("kill", "two at once, into one file or folder", "the second is refused in a sentence")


def test_what_a_killed_one_left_of_a_file_does_not_stand_in_the_way(tmp_path: Path) -> None:
    (tmp_path / "told.txt.part").write_text("of a process that was killed, and longer")
    write_text(tmp_path / "told.txt", "whole")
    assert held(tmp_path) == {"told.txt": "whole"}


def test_a_folder_that_is_given_up_leaves_what_was_there(tmp_path: Path) -> None:
    (tmp_path / "a").write_text("old")
    with suppress(KeyError), placing(tmp_path, ("a", "b"), force=True) as made:
        write_text(made / "a", "new")
        raise KeyError
    assert held(tmp_path) == {"a": "old"}
    assert len(list(tmp_path.iterdir())) == 1
