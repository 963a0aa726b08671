"""tools/environment.py leaves either a whole environment or none, and asks nothing of pip when nothing changed."""

import importlib.util
import json
import subprocess
import sys
from pathlib import Path

import pytest

TOOL = Path(__file__).resolve().parents[3] / "tools" / "environment.py"
PYPROJECT = (
    '[build-system]\nrequires = []\n[project]\nname = "x"\nversion = "{version}"\n[tool.ruff]\nline-length = {length}\n'
)


class Machine:
    """Stands for `python -m venv` and pip: makes the folder, remembers what was installed, fails on demand."""

    def __init__(self):
        self.installed = []
        self.failure = None
        self.version = "3 11"

    def run(self, command, **_):
        if command[1:3] == ["-m", "venv"]:
            python = Path(command[3]) / "bin" / "python"
            python.parent.mkdir(parents=True)
            python.touch()
        elif "install" in command:
            if isinstance(self.failure, BaseException):
                raise self.failure
            self.installed.append(command[-1])
            return subprocess.CompletedProcess(command, self.failure or 0)
        elif "-c" in command:
            if not Path(command[0]).exists():
                raise FileNotFoundError(command[0])
            return subprocess.CompletedProcess(command, 0, stdout=self.version)
        return subprocess.CompletedProcess(command, 0)


@pytest.fixture
def tool():
    spec = importlib.util.spec_from_file_location("environment", TOOL)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def machine(tool, monkeypatch, tmp_path):
    machine = Machine()
    monkeypatch.setattr(tool.subprocess, "run", machine.run)
    monkeypatch.chdir(tmp_path)
    write_pyproject()
    return machine


def write_pyproject(version="1", length=120):
    Path("pyproject.toml").write_text(PYPROJECT.format(version=version, length=length), encoding="utf-8")


def test_second_call_asks_nothing_of_pip(tool, machine):
    assert [tool.main([".venv"]), tool.main([".venv"])] == [0, 0]
    assert machine.installed == ["."]


def test_a_larger_set_serves_for_the_smaller(tool, machine):
    for words in ([".venv", "test"], [".venv"], [".venv", "dev"], [".venv", "test"]):
        assert tool.main(words) == 0
    assert machine.installed == [".[test]", ".[dev]"]


def test_changed_dependencies_are_installed_with_the_sets_already_there(tool, machine):
    tool.main([".venv", "test"])
    write_pyproject(version="2")
    assert tool.main([".venv"]) == 0
    assert machine.installed == [".[test]", ".[test]"]


def test_a_changed_linter_setting_is_no_reason_to_install(tool, machine):
    tool.main([".venv"])
    write_pyproject(length=100)
    tool.main([".venv"])
    assert machine.installed == ["."]


def test_failure_leaves_nothing_and_the_next_call_starts_again(tool, machine, capsys):
    machine.failure = 1
    assert tool.main([".venv"]) == 2
    assert not Path(".venv").exists()
    assert "package index" in capsys.readouterr().err
    machine.failure = None
    assert tool.main([".venv"]) == 0


def test_an_interrupt_leaves_nothing(tool, machine):
    machine.failure = KeyboardInterrupt()
    with pytest.raises(KeyboardInterrupt):
        tool.main([".venv"])
    assert not Path(".venv").exists()


@pytest.mark.usefixtures("machine")
def test_what_a_killed_run_left_is_made_anew(tool):
    Path(".venv/bin").mkdir(parents=True)
    Path(".venv/half-made").touch()
    Path(".venv.lock").write_text("unfinished", encoding="utf-8")
    assert tool.main([".venv"]) == 0
    assert not Path(".venv/half-made").exists()


def test_failed_update_keeps_the_environment_but_not_its_claim(tool, machine):
    tool.main([".venv"])
    write_pyproject(version="2")
    machine.failure = 1
    assert tool.main([".venv"]) == 2
    machine.failure = None
    assert tool.main([".venv"]) == 0
    assert machine.installed == [".", ".", "."]
    assert json.loads(Path(".venv/detent-environment.json").read_text(encoding="utf-8"))["ours"] is True


def test_an_environment_made_by_a_person_is_never_removed(tool, machine):
    machine.run([sys.executable, "-m", "venv", ".venv"])
    machine.failure = 1
    assert tool.main([".venv"]) == 2
    assert Path(".venv/bin/python").exists()
    machine.failure = None
    machine.version = "3 9"
    assert [tool.main([".venv"]), tool.main(["--chosen", ".venv"])] == [0, 0]
    assert machine.installed == [".", "."]


def test_a_chosen_python_replaces_the_one_inside(tool, machine):
    tool.main([".venv"])
    machine.version = "3 9"
    assert tool.main([".venv"]) == 0
    assert machine.installed == ["."]
    assert tool.main(["--chosen", ".venv"]) == 0
    assert machine.installed == [".", "."]


def test_a_moved_project_gets_a_new_environment(tool, machine, monkeypatch, tmp_path):
    tool.main([".venv"])
    elsewhere = tmp_path.with_name(tmp_path.name + "-moved")
    tmp_path.rename(elsewhere)
    monkeypatch.chdir(elsewhere)
    assert tool.main([".venv"]) == 0
    assert machine.installed == [".", "."]


def test_a_missing_module_names_the_package_to_install(tool, machine, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "ensurepip", None)
    assert tool.main([".venv"]) == 2
    assert "apt install python3-venv" in capsys.readouterr().err
    assert not machine.installed


def test_an_old_python_is_told_what_to_do(tool, machine, monkeypatch, capsys):
    monkeypatch.setattr(tool, "OLDEST_PYTHON", (99, 0))
    assert tool.main([".venv"]) == 2
    assert "make demo PYTHON=" in capsys.readouterr().err
    assert not machine.installed


@pytest.mark.usefixtures("machine")
@pytest.mark.parametrize("words", [[], [".venv", "tests"], [".venv", "test", "dev"]])
def test_wrong_words_show_the_usage(tool, words, capsys):
    assert tool.main(words) == 2
    assert "FOLDER" in capsys.readouterr().err
