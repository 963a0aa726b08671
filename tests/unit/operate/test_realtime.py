"""What is asked of the system for the loop, from systems that permit it and systems that do not."""

import ctypes
import os
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from detent.operate import realtime
from detent.operate.realtime import NICENESS, ask_for_time, give_back, going_first


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """What was asked for, of a system that permits what stands in the environment."""
    found: list[str] = []

    def call(name: str, refused: int) -> Any:
        return lambda *_: (found.append(name), refused)[1]

    calls = {name: call(name, refused) for name, refused in (("prctl", 0), ("mlockall", 0), ("munlockall", 0))}
    monkeypatch.setattr(ctypes, "CDLL", lambda *_, **__: SimpleNamespace(**calls))
    monkeypatch.setattr(os, "sched_setscheduler", lambda *_: found.append("priority"), raising=False)
    monkeypatch.setattr(realtime, "ISOLATED", Path("nowhere"))
    return found


def test_where_all_is_permitted_nothing_is_missing(asked: list[str]) -> None:
    assert ask_for_time() == []
    assert asked == ["priority", "mlockall"]
    give_back()
    assert asked[-1] == "munlockall"


def test_what_is_not_permitted_is_told_with_what_permits_it(asked: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise PermissionError

    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    monkeypatch.setattr(ctypes, "CDLL", lambda *_, **__: SimpleNamespace(prctl=lambda *_: asked.append("prctl")))
    priority, memory = ask_for_time()
    assert "setcap cap_sys_nice" in priority
    assert "ulimit -l unlimited" in memory
    assert asked == ["prctl"]  # without priority its timers are at least exact
    give_back()  # a system without such calls


@pytest.mark.parametrize(("kept", "taken"), [("3", 3), ("2-3", 3), ("1,4-6", 6)])
def test_a_processor_that_is_kept_free_is_taken(
    asked: list[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path, kept: str, taken: int
) -> None:
    (tmp_path / "isolated").write_text(kept + "\n")
    monkeypatch.setattr(realtime, "ISOLATED", tmp_path / "isolated")
    processors: list[set[int]] = []
    monkeypatch.setattr(os, "sched_setaffinity", lambda _, numbers: processors.append(numbers), raising=False)
    assert ask_for_time() == []
    assert processors == [{taken}]

    def refuse(*_: object) -> None:
        raise OSError(22, "Invalid argument")

    monkeypatch.setattr(os, "sched_setaffinity", refuse)
    (told,) = ask_for_time()
    assert f"processor {taken}," in told
    assert "taskset" in told
    assert asked == ["priority", "mlockall"] * 2


def test_who_brings_a_stop_goes_before_who_only_computes(monkeypatch: pytest.MonkeyPatch) -> None:
    found: list[int] = []
    monkeypatch.setattr(os, "getpriority", lambda *_: 3, raising=False)
    monkeypatch.setattr(os, "setpriority", lambda *asked: found.append(asked[-1]), raising=False)

    def run_until_interrupted() -> None:
        with going_first():
            assert found == [NICENESS]
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_until_interrupted()
    assert found == [NICENESS, 3]

    def refuse(*_: object) -> None:
        raise PermissionError

    monkeypatch.setattr(os, "getpriority", refuse)
    with going_first():  # it goes without
        assert found == [NICENESS, 3]
