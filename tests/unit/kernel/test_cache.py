"""The compiled cache, tried on a copy of the package that may be edited."""

import os
import re
import shutil
import subprocess
import sys
import textwrap
import time
from pathlib import Path

import pytest

import detent
from detent.kernel import cache

PACKAGE = Path(detent.__file__).parent

pytestmark = [pytest.mark.compiled, pytest.mark.process]


class Copy:
    """A copy of the package with a compiled cache of its own; every `run` is a new process."""

    def __init__(self, folder: Path) -> None:
        self.package = folder / "lib" / "detent"
        shutil.copytree(PACKAGE, self.package, ignore=shutil.ignore_patterns("__pycache__"))
        self.cache = folder / "cache"

    def run(self, program: str, **extra: str) -> str:
        environment = os.environ | {
            "PYTHONPATH": str(self.package.parent),
            "DETENT_CACHE_DIR": str(self.cache),
            "PYTHONDONTWRITEBYTECODE": "1",
        }
        environment.pop("NUMBA_DISABLE_JIT", None)
        command = [sys.executable, "-W", "error", "-c", textwrap.dedent(program)]
        done = subprocess.run(command, env=environment | extra, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        return done.stdout.strip()

    def edit(self, file: str, old: str, new: str) -> None:
        source = self.package / file
        text = source.read_text()
        assert text.count(old) == 1
        source.write_text(text.replace(old, new))

    def write(self, file: str, text: str) -> Path:
        source = self.package / file
        source.write_text(textwrap.dedent(text))
        return source

    @property
    def compiled(self) -> list[str]:
        """Names of the machine code files in every folder."""
        return sorted(str(f.relative_to(self.cache)) for f in self.cache.rglob("*.code"))

    @property
    def folders(self) -> list[Path]:
        return sorted((self.cache / "compiled").iterdir())


@pytest.fixture
def package(tmp_path):
    return Copy(tmp_path)


SHORT_PROGRAM = """
    from detent.control.head_computer import HeadComputer
    from detent.control.head_motion import must_stop  # calls stop_distance_up of another file

    print(must_stop(HeadComputer(speed=240, direction=1, emitter=0, target=500)))
"""


def test_editing_a_callee_in_another_file_never_yields_a_stale_result(package):
    assert package.run(SHORT_PROGRAM) == "False"  # 500 emitters left, 400 needed
    package.edit("control/feed_forward.py", "(s * s + 143) // 144", "(s * s + 71) // 72")
    assert package.run(SHORT_PROGRAM) == "True"  # now 800 needed
    package.edit("control/feed_forward.py", "(s * s + 71) // 72", "(s * s + 143) // 144")
    assert package.run(SHORT_PROGRAM) == "False"
    assert len(package.folders) == 2  # the third run found the first one's folder again


def test_editing_a_declaration_of_registers_is_an_edit_of_the_callers(package):
    assert package.run(SHORT_PROGRAM) == "False"
    # The fields behind it move in memory; machine code with the old offsets would read other registers.
    field = 'emitter: i8 = register("position"'
    package.edit("control/head_computer.py", field, f'pushed_in: i8 = register("new")\n    {field}')
    assert package.run(SHORT_PROGRAM) == "False"
    assert len(package.folders) == 2


TWO_STEPS = f"""{SHORT_PROGRAM}
    from detent.control.feed_forward import stop_distance_up

    print(stop_distance_up(240))
"""

LOADED_PROGRAM = """
    from detent.plant.drive_train import DriveTrain, DriveTrainParams
    from detent.plant.switched_motor import Scratch, SwitchedParams, move_switched

    p = DriveTrainParams(resistance=1.0, inductance=1.0, mass=1.0, period=4e-5, substep=4e-5)
    move_switched(p, SwitchedParams(), DriveTrain(velocity=1.0), Scratch(), 100, 1.0, 1.0, 0.0, 0.0)
    print(sum(move_switched._cache_hits.values()), sum(move_switched._cache_misses.values()))
"""


def test_a_second_process_takes_machine_code_from_the_cache(package):
    assert package.run(LOADED_PROGRAM) == "0 1"
    compiled = package.compiled
    assert any("move_switched" in name for name in compiled)
    assert len(compiled) == 1  # what it calls is part of it
    assert package.run(LOADED_PROGRAM) == "1 0"
    assert package.compiled == compiled


ANOTHER = "import numba, llvmlite, sys; {what}.__version__ = '0.1'"
NO_FEATURES = {"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": ""}


@pytest.mark.wide
def test_code_for_another_processor_is_not_taken(package):
    """One cache on a disk that machines share; each compiles once, and finds its own again."""
    assert package.run(SHORT_PROGRAM) == "False"
    own = package.compiled
    assert package.run(SHORT_PROGRAM, **NO_FEATURES) == "False"
    both = package.compiled
    assert len(package.folders) == 1
    assert set(own) < set(both)
    assert len(both) == 2 * len(own)
    before = {name: (package.cache / name).stat().st_mtime_ns for name in both}
    for told in ({}, NO_FEATURES):
        assert package.run(SHORT_PROGRAM, **told) == "False"
    assert {name: (package.cache / name).stat().st_mtime_ns for name in package.compiled} == before
    # Nor under its name: what is kept says whose it is.
    for name in own:
        for other in set(both).difference(own):
            if other.rpartition("-")[0] == name.rpartition("-")[0]:
                shutil.copy(package.cache / other, package.cache / name)
                assert cache.read_kept(package.cache / name) is None
    assert package.run(SHORT_PROGRAM) == "False"
    assert package.compiled == both


@pytest.mark.wide
@pytest.mark.parametrize("what", ["numba", "llvmlite"])
def test_code_of_another_compiler_is_not_taken(package, what):
    assert package.run(SHORT_PROGRAM) == "False"
    own = package.compiled
    program = f"{ANOTHER.format(what=what)}\n{textwrap.dedent(SHORT_PROGRAM)}"
    assert package.run(program) == "False"
    assert len(package.folders) == 2
    assert len(package.compiled) == 2 * len(own)
    assert package.run(SHORT_PROGRAM) == "False"
    assert len(package.compiled) == 2 * len(own)


def test_equal_names_in_two_rooms_do_not_meet(package):
    for room, factor in (("control", 2), ("drive", 3)):
        package.write(
            f"{room}/same_name.py",
            f"""
            from detent.kernel.step import step


            @step
            def scaled(x: int) -> int:
                return {factor} * x
            """,
        )
    program = """
        from detent.control import same_name as a
        from detent.drive import same_name as b

        print(a.scaled(1), b.scaled(1))
    """
    assert package.run(program) == "2 3"
    assert package.run(program) == "2 3"


def test_a_step_of_one_axis_imports_no_registers_of_another(package):
    for name in ("here", "there"):
        package.write(
            f"control/{name}.py",
            """
            from detent.kernel.registers import Registers, i8, register


            class File(Registers):
                value: i8 = register("a value")
            """,
        )
    package.write(
        "control/shared.py",
        """
        from typing import Any

        from detent.kernel.step import step


        @step
        def value_of(r: Any) -> int:
            return r.value
        """,
    )
    program = """
        import sys
        from importlib import import_module
        from detent.control.shared import value_of

        for name in {names}:
            print(value_of(import_module(f"detent.control.{{name}}").File(value=7)))
        print([name for name in sys.modules if name in ("detent.control.here", "detent.control.there")])
    """
    both = package.run(program.format(names=("here", "there")))
    compiled = package.compiled
    assert both.splitlines()[:2] == ["7", "7"]
    assert package.run(program.format(names=("here",))) == "7\n['detent.control.here']"
    assert package.compiled == compiled


def test_steps_outside_the_package_are_compiled_but_not_cached(package, tmp_path):
    outside = """
        from detent.kernel.step import step


        @step
        def doubled(x: int) -> int:
            return 2 * x
    """
    (tmp_path / "lib" / "elsewhere.py").write_text(textwrap.dedent(outside))
    package.write("record/elsewhere.py", outside)  # a room whose edits do not change the hash
    program = """
        import elsewhere
        from detent.record import elsewhere as above

        print(elsewhere.doubled(21), above.doubled(4), elsewhere.doubled.nopython_signatures != [])
    """
    assert package.run(program) == "42 8 True"
    assert package.compiled == []


def test_plain_python_makes_no_cache(package):
    assert package.run(SHORT_PROGRAM, NUMBA_DISABLE_JIT="1") == "False"
    assert package.compiled == []


def test_a_cache_folder_that_cannot_be_made_does_not_stop_the_program(package, tmp_path):
    blocked = tmp_path / "a file"
    blocked.write_text("in the way")
    assert package.run(SHORT_PROGRAM, DETENT_CACHE_DIR=str(blocked / "cache")) == "False"


def test_damaged_code_is_dropped_and_compiled_anew(package, tried):
    """An empty file ended in "Aborted.", a flipped byte of machine code in a wrong trace."""
    first = package.run(TWO_STEPS)
    files = [package.cache / name for name in package.compiled]
    assert len(files) > 1
    for k, file in enumerate(files):
        whole = bytearray(file.read_bytes())
        whole[len(whole) * 2 // 3] ^= 1 << k % 8
        damages = (bytes(whole), b"", bytes(whole[:-1]), b"\0" * len(whole))
        for damage in damages:
            file.write_bytes(damage)
            assert cache.read_kept(file) is None
        file.write_bytes(damages[k % 4])
    assert package.run(TWO_STEPS) == first
    assert [package.cache / name for name in package.compiled] == files
    assert None not in [cache.read_kept(file) for file in files]
    tried(
        "cache",
        "files of compiled steps: flipped, emptied, shortened, zeroed",
        "compiled anew, same result",
        4 * len(files),
    )


def test_no_flipped_bit_gets_through(tmp_path, tried):
    file = tmp_path / "step-1.code"
    cache.keep(file, b"machine code")
    whole = file.read_bytes()
    assert cache.read_kept(file) == b"machine code"
    for bit in range(8 * len(whole)):
        flipped = bytearray(whole)
        flipped[bit // 8] ^= 1 << bit % 8
        file.write_bytes(flipped)
        assert cache.read_kept(file) is None
        assert not file.exists()
    tried("cache", "every bit of a kept file, flipped", "found, the file removed", 8 * len(whole))


def test_code_of_another_step_is_not_taken(tmp_path, tried):
    cache.keep(tmp_path / "one.code", b"machine code")
    (tmp_path / "one.code").rename(tmp_path / "other.code")
    assert cache.read_kept(tmp_path / "other.code") is None
    tried("cache", "code of one step under the name of another", "not taken")


def test_a_folder_in_the_place_of_a_file_is_left_alone(tmp_path):
    (tmp_path / "one.code").mkdir()
    cache.keep(tmp_path / "one.code", b"machine code")
    assert cache.read_kept(tmp_path / "one.code") is None
    assert [file.name for file in tmp_path.iterdir()] == ["one.code"]


def test_a_full_disk_costs_time_only(package, tried):
    program = "import resource\nresource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))\n" + textwrap.dedent(SHORT_PROGRAM)
    assert package.run(program) == "False"
    assert [file for file in package.cache.rglob("*") if file.is_file()] == []
    tried("disk", "the folder of compiled steps", "the same result, later")


def test_a_folder_that_others_may_write_is_not_used(tmp_path, monkeypatch):
    monkeypatch.setenv("DETENT_CACHE_DIR", str(tmp_path / "cache"))
    find = cache.compiled_folder.__wrapped__
    used, why = find()
    assert used == tmp_path / "cache" / "compiled" / cache.source_hash()
    assert why == ""
    for folder in (used.parents[1], used.parent, used):
        folder.chmod(0o775)
        assert find() == (None, f"{folder} can be written by other users; set DETENT_CACHE_DIR to a folder of yours")
        folder.chmod(0o700)
    assert find() == (used, "")


def test_a_folder_of_another_user_is_not_used(tmp_path, monkeypatch):
    assert cache._open_to_others(tmp_path) == ""
    monkeypatch.setattr(cache.os, "geteuid", lambda: tmp_path.stat().st_uid + 1)
    assert cache._open_to_others(tmp_path) == "belongs to another user"


def test_compiling_is_told_once(monkeypatch):
    told = []
    monkeypatch.setattr(cache, "AT_FIRST_COMPILING", [told.append])
    cache.tell_compiling("a reason")
    cache.tell_compiling("a reason")
    assert told == ["a reason"]


def test_sources_of_the_hash_are_the_rooms_a_step_can_be_made_of():
    sources = cache.step_sources()
    rooms = {source.relative_to(PACKAGE).parts[0] for source in sources}
    assert rooms == {*cache.STEP_ROOMS, "methods", "tune"}
    assert PACKAGE / "plant" / "drive_train.py" in sources
    assert PACKAGE / "methods" / "cascade" / "system.py" in sources
    assert PACKAGE / "methods" / "cascade" / "page.py" not in sources
    assert Path(__file__) not in sources


def test_every_module_that_declares_a_step_is_in_the_hash():
    declared = {s for s in PACKAGE.rglob("*.py") if re.search(r"^@(hot_)?step$", s.read_text("utf-8"), re.MULTILINE)}
    assert declared <= cache.step_sources()
    assert PACKAGE / "methods" / "print_head" / "controller.py" in declared


def test_what_a_killed_process_left_goes_and_what_another_writes_stays(tmp_path, monkeypatch):
    monkeypatch.setenv("DETENT_CACHE_DIR", str(tmp_path))
    folder, _ = cache.compiled_folder.__wrapped__()
    for name, age in (("killed.code.1.part", 2 * cache.OLD_PART), ("now.code.2.part", 1.0), ("old.code", 1e6)):
        (folder / name).touch()
        os.utime(folder / name, (time.time() - age,) * 2)
    assert cache.compiled_folder.__wrapped__() == (folder, "")
    assert sorted(file.name for file in folder.iterdir()) == ["now.code.2.part", "old.code"]


def test_only_the_youngest_folders_are_kept(tmp_path):
    names = [f"hash{k}" for k in range(cache.KEPT_FOLDERS + 3)]
    now = time.time()
    for age, name in enumerate(names):
        (tmp_path / name).mkdir()
        os.utime(tmp_path / name, (now - age, now - age))
    (tmp_path / "note.txt").write_text("not a folder")
    cache._forget_old(tmp_path, keep=tmp_path / names[-1])
    left = {f.name for f in tmp_path.iterdir()}
    assert left == {*names[: cache.KEPT_FOLDERS - 1], names[-1], "note.txt"}


@pytest.mark.parametrize(
    ("platform", "variables", "expected"),
    [
        ("linux", {"DETENT_CACHE_DIR": "/stated"}, Path("/stated")),
        ("linux", {"XDG_CACHE_HOME": "/xdg"}, Path("/xdg/detent")),
        ("linux", {}, Path.home() / ".cache" / "detent"),
        ("darwin", {}, Path.home() / "Library" / "Caches" / "detent"),
        ("win32", {"LOCALAPPDATA": "/local"}, Path("/local/detent/Cache")),
    ],
)
def test_cache_root_of_each_system(monkeypatch, platform, variables, expected):
    for name in ("DETENT_CACHE_DIR", "XDG_CACHE_HOME", "LOCALAPPDATA"):
        monkeypatch.delenv(name, raising=False)
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    monkeypatch.setattr(cache.sys, "platform", platform)
    assert cache.user_cache_root() == expected
