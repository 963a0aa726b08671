from pathlib import Path

import pytest

from detent.errors import AxisError
from detent.panel.keys import COOKIE, LINK, ROLES, TICKET, Keys, Pass, link_of, make_keys, sign


class Clock:
    """A time that a test sets."""

    def __init__(self) -> None:
        self.now = 1000.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def keys(clock: Clock) -> Keys:
    return Keys(make_keys(), clock)


@pytest.mark.parametrize("role", ROLES)
@pytest.mark.parametrize("kind", [LINK, COOKIE, TICKET])
def test_what_is_signed_is_read(keys: Keys, role: str, kind: str) -> None:
    signed = keys.sign(role, kind)
    for other in {LINK, COOKIE, TICKET} - {kind}:
        assert keys.read(signed, other) is None
    who = keys.read(signed, kind)
    assert who is not None
    assert who.role == role
    assert [who.may(one) for one in ROLES] == [ROLES.index(one) <= ROLES.index(role) for one in ROLES]


@pytest.mark.parametrize(
    ("kind", "lasts", "again"), [(LINK, 600.0, False), (COOKIE, 43200.0, True), (TICKET, 10.0, False)]
)
def test_how_long_and_how_often(keys: Keys, clock: Clock, kind: str, lasts: float, again: bool) -> None:
    late = keys.sign("viewer", kind)
    clock.now += lasts - 0.01
    assert keys.read(late, kind) is not None
    assert (keys.read(late, kind) is not None) == again
    later = keys.sign("viewer", kind)
    clock.now += lasts
    assert keys.read(later, kind) is None


def test_used_marks_are_forgotten_when_they_have_run_out(keys: Keys, clock: Clock) -> None:
    for _ in range(100):
        assert keys.read(keys.sign("viewer", TICKET), TICKET) is not None
        clock.now += 1.0
    assert len(keys._used) <= 11


def test_a_link_of_before_a_restart_is_void_and_a_cookie_is_not(clock: Clock) -> None:
    held = make_keys()
    before = {kind: sign(held["operator"], "operator", kind, clock.now) for kind in (LINK, COOKIE)}
    clock.now += 5.0
    keys = Keys(held, clock)
    assert keys.read(before[LINK], LINK) is None
    assert keys.read(before[COOKIE], COOKIE) is not None


@pytest.mark.parametrize(
    "forged",
    [
        "",
        ".",
        "...",
        "viewer",
        "viewer.a.b.c",
        "viewer.a.1000000.",
        "root.a.1000000.0",
        "é.a.1.é",
        "viewer.a.1e3.0" * 90,
    ],
)
def test_what_was_not_signed_here_is_nobody(keys: Keys, forged: str) -> None:
    assert keys.read(forged, COOKIE) is None


def test_no_part_of_what_is_signed_can_be_changed(keys: Keys) -> None:
    signed = keys.sign("viewer", COOKIE)
    for k in range(len(signed)):
        changed = signed[:k] + ("0" if signed[k] != "0" else "1") + signed[k + 1 :]
        assert keys.read(changed, COOKIE) is None
    assert keys.read(signed.replace("viewer", "engineer"), COOKIE) is None


def test_the_mark_of_a_form_is_of_one_session(keys: Keys) -> None:
    one, other = (Pass("operator", name, 0.0) for name in "ab")
    assert keys.form_mark(one) == keys.form_mark(one) != keys.form_mark(other)
    assert keys.form_mark(one) != keys.form_mark(Pass("viewer", "a", 0.0))


@pytest.mark.parametrize("text", [None, "", "{"])
def test_no_panel_there(tmp_path: Path, text: str | None) -> None:
    path = tmp_path / "axis.keys"
    if text is not None:
        path.write_text(text, encoding="ascii")
    with pytest.raises(AxisError, match="detent live"):
        link_of(path, "viewer", 0.0)
