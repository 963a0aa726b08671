"""Jobs in words, and the moves that are laid ready of them."""

import math
import struct
from types import SimpleNamespace
from typing import Any

import pytest

from detent.control import operation as ops
from detent.control.program import PLACES
from detent.errors import DetentError
from detent.methods.method import Leg
from detent.operate.jobs import Moves, read_job


def legs_of(job: Any) -> Any:
    return job.legs


def axis(**more: Any) -> Any:
    q = SimpleNamespace(look_ticks=10, operation=SimpleNamespace(endless=0, lowest=0.0, highest=1.0))
    usual: dict[str, Any] = {"live": q, "tick": 1e-4, "speed": 0.5, "unit": "m", "legs": legs_of, "text": None}
    return SimpleNamespace(**usual | more)


def board() -> Any:
    return SimpleNamespace(program=SimpleNamespace(job=3, begun=9, done=9))


def leg(line: str) -> Leg:
    if line == "nowhere":
        raise DetentError("no such place")
    return Leg(ops.MOVE_TO, float(line))


def test_a_move_is_laid_with_its_share_of_the_speed_and_its_rest_in_looks():
    b, legs = board(), [Leg(ops.MOVE_TO, 0.5, 0.25, 0.2), Leg(ops.MOVE_BY, -0.1), Leg(ops.GO, 3, 9.0)]
    work = Moves(legs, axis(), b, 0.5)
    assert (work.name, work.pieces, work.done) == ("3 moves", 3, 0)
    laid = [struct.unpack("<4d", work.piece() or b"") for _ in range(3)]
    assert laid == [(ops.MOVE_TO, 0.5, 0.25, 200), (ops.MOVE_BY, -0.1, 0.5, 0), (ops.GO, 3.0, 0.5, 0)]
    assert work.piece() is None
    b.program.job, b.program.done = 4, 2
    assert work.done == 2
    job = SimpleNamespace(name="moves.csv", legs=legs[:1])
    slow = Moves(job, axis(speed=math.nan), board(), 1.0)
    assert (slow.name, struct.unpack("<4d", slow.piece() or b"")[2]) == ("moves.csv", 1.0)


def test_no_more_is_laid_than_the_tray_has_places():
    b = board()
    work = Moves([Leg(0)] * (2 * PLACES), axis(), b, 1.0)
    assert [work.piece() is None for _ in range(PLACES + 1)] == [False] * PLACES + [True]
    b.program.job, b.program.begun = 4, 1
    assert [work.piece() is None for _ in range(2)] == [False, True]


def test_a_place_beyond_the_limits_is_refused_before_anything_moves():
    with pytest.raises(DetentError, match=r"move 2: got 1.5 m; expected: a place from 0 m to 1 m"):
        Moves([Leg(ops.MOVE_TO, 0.5), Leg(ops.MOVE_TO, 1.5)], axis(), board(), 1.0)
    endless = axis(live=SimpleNamespace(look_ticks=1, operation=SimpleNamespace(endless=1)))
    assert Moves([Leg(ops.MOVE_TO, 1.5)], endless, board(), 1.0).pieces == 1
    with pytest.raises(DetentError, match="does none live"):
        Moves(SimpleNamespace(name="a"), axis(legs=None), board(), 1.0)


def test_a_job_is_a_file_places_or_a_text():
    assert read_job(axis(), lambda path: path.name, "folder/moves.csv", leg) == "moves.csv"
    read = read_job(axis(), str, {"moves": ["0.1", "0.2"], "rounds": 2, "rest": 0.5}, leg)
    assert read == [Leg(ops.MOVE_TO, place, None, 0.5) for place in (0.1, 0.2, 0.1, 0.2)]
    assert read_job(axis(text=str.upper), str, {"text": "ab"}, leg) == "AB"


@pytest.mark.parametrize(
    ("value", "told"),
    [(None, "got None"), ("", "got ''"), (7, "got 7"), ({}, "got {}"), ({"moves": ["1"], "speed": 1}, "got 'speed'"),
     ({"moves": ["1"], "text": "a"}, "give one"), ({"rounds": 2}, "give one"), ({"text": "a"}, "prints none"),
     ({"moves": []}, "a list of places"), ({"moves": "1"}, "a list of places"), ({"moves": [1]}, "a list of places"),
     ({"moves": ["1"], "rounds": 0}, "got rounds 0"), ({"moves": ["1"], "rounds": True}, "got rounds True"),
     ({"moves": ["1"], "rounds": 100_001}, "from 1 to 100000"), ({"moves": ["1"], "rest": -1}, "got rest -1"),
     ({"moves": ["1"], "rest": math.nan}, "got rest nan"), ({"moves": ["1", "nowhere"]}, "line 2 .nowhere.: no such")],
)  # fmt: skip
def test_what_is_no_job_is_refused_in_a_sentence(value: object, told: str):
    with pytest.raises(DetentError, match=told):
        read_job(axis(), str, value, leg)


def test_a_printer_takes_text_and_no_places():
    printer = axis(legs=None, text=str)
    with pytest.raises(DetentError, match="give it a text"):
        read_job(printer, str, {"moves": ["1"]}, leg)
    with pytest.raises(DetentError, match="write some"):
        read_job(printer, str, {"text": "  "}, leg)
