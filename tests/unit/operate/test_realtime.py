"""What is asked of the system for the loop, from systems that permit it and systems that do not."""

import ctypes
import os
import threading
from types import SimpleNamespace
from typing import Any

import pytest

from detent.operate.realtime import NICENESS, ask_for_time, ask_to_go_first, give_back


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """What was asked for, of a system that permits what stands in the environment."""
    found: list[str] = []

    def call(name: str, refused: int) -> Any:
        return lambda *_: (found.append(name), refused)[1]

    calls = {name: call(name, refused) for name, refused in (("prctl", 0), ("mlockall", 0), ("munlockall", 0))}
    monkeypatch.setattr(ctypes, "CDLL", lambda *_, **__: SimpleNamespace(**calls))
    monkeypatch.setattr(os, "sched_setscheduler", lambda *_: found.append("priority"), raising=False)
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


def test_who_brings_a_stop_goes_before_who_only_computes(monkeypatch: pytest.MonkeyPatch) -> None:
    found: list[tuple[int, ...]] = []
    monkeypatch.setattr(os, "setpriority", lambda *asked: found.append(asked), raising=False)
    ask_to_go_first()
    assert [one[1:] for one in found] == [(threading.get_native_id(), NICENESS)]

    def refuse(*_: object) -> None:
        raise PermissionError

    monkeypatch.setattr(os, "setpriority", refuse)
    ask_to_go_first()  # it goes without
