"""Line protocols: whatever bytes come, the line lives, and what is answered is what the protocol says."""

import asyncio
import re
from collections.abc import Awaitable, Callable
from typing import Any

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from tests.fake_axis import Heard

from detent.faces.gcs import HANDLERS, Gcs
from detent.faces.grbl import Grbl
from detent.faces.scpi import COMMANDS, TEXTS, Scpi, pattern_of
from detent.faces.talk import LONGEST
from detent.faces.zaber import Zaber, checksum

FEW = settings(max_examples=60, deadline=None)
NUMBERS = st.one_of(
    st.floats().map(repr), st.integers().map(str), st.sampled_from(["", "x", "1e400", "-0", "9" * 400, "5 mm", "1,2"])
)
NOISE = st.binary(max_size=60)


def talked(dialect: Callable[..., Any], work: Callable[[Heard], Awaitable[None]], **more: Any) -> None:
    """A conversation from its beginning to its end."""

    async def whole() -> None:
        heard = Heard(dialect, **more)
        try:
            await work(heard)
        finally:
            await heard.close()

    asyncio.run(whole())


def lines_of(words: list[str]) -> st.SearchStrategy[bytes]:
    """Lines that are nearly commands."""
    one = st.tuples(st.sampled_from(words), NUMBERS).map(lambda pair: f"{pair[0]} {pair[1]}".encode())
    return st.lists(st.one_of(one, NOISE), max_size=6).map(b"\n".join)


@FEW
@given(lines_of([one.header for one in COMMANDS]))
@example(b"*ESE " + b"9" * 4000)
@example(b"\x00" * 10 + b"x" * (LONGEST + 5))
def test_scpi_answers_behind_whatever_came(data: bytes) -> None:
    async def work(heard: Heard) -> None:
        said = await heard.hear(data + b"\n")
        assert said == "" or said.endswith("\n")
        for _ in range(31):
            number, _, text = (await heard.hear(b"SYST:ERR?\n")).strip().partition(",")
            assert int(number) in TEXTS
            assert re.fullmatch(r'"[^"]*"', text)
        assert number == "0"
        assert (await heard.hear(b"*IDN?\n")).startswith("detent,fake axis,cascade,")

    talked(Scpi, work)


@pytest.mark.parametrize(
    ("line", "answer", "errors"),
    [
        ("ENAB;MOVE:ABS 60;*OPC?;POS?", "1;60", []), ("ENAB;MOVE:REL 5;*OPC?;POS?", "1;25", []), ("FOO", "", [-113]),
        ("MOVE:ABS", "", [-109]), ("MOVE:ABS 1,2,3", "", [-108]), ("MOVE:ABS x", "", [-104]),
        ("MOVE:ABS 1,1e9", "", [-222]), ("*ESE 256", "", [-222]), ("*ESE 32;FOO;*STB?", "36", [-113]),
        ("*ESR?;*ESR?", "128;0", []), ("TRUS 3", "", [-222]), ("UNIT?;LIM?", "MM;0,500", []),
        ("SYST:REM;SYST:SEL?;SYST:LOC;SYST:SEL?", '"remote";"both"', []),
    ],
)  # fmt: skip
def test_scpi(line: str, answer: str, errors: list[int]) -> None:
    async def work(heard: Heard) -> None:
        assert (await heard.hear(line.encode() + b"\n")).strip() == answer
        found = [(await heard.hear(b"SYST:ERR?\n")).partition(",")[0] for _ in range(len(errors) + 1)]
        assert [int(one) for one in found] == [*errors, 0]

    talked(Scpi, work)


def test_the_queue_of_errors_ends_with_its_overflow() -> None:
    async def work(heard: Heard) -> None:
        await heard.hear(b"FOO\n" * 40)
        found = [int((await heard.hear(b"SYST:ERR?\n")).partition(",")[0]) for _ in range(31)]
        assert found == [-113] * 29 + [-350, 0]

    talked(Scpi, work)


@given(st.sampled_from([one.header for one in COMMANDS]), st.data())
def test_headers_have_two_forms_and_no_third(header: str, data: st.DataObject) -> None:
    words = header.rstrip("?").split(":")
    short = ["".join(c for c in word if not c.islower()) for word in words]
    mark = "?" * header.endswith("?")
    chosen = [data.draw(st.sampled_from(pair)) for pair in zip(words, short, strict=True)]
    assert pattern_of(header).fullmatch(":".join(chosen).swapcase() + mark)
    longest = max(words, key=len)
    if longest != short[words.index(longest)]:
        between = longest[:-1]
        others = [between if word == longest else word for word in words]
        known = between in short
        assert bool(pattern_of(header).fullmatch(":".join(others) + mark)) == known


WORDS = ["G0X", "G1X", "G1F", "G91", "G4P0", "$", "$J=X", "M", "T", "X", "N1G1Y"]
GRBL = st.lists(
    st.one_of(
        st.tuples(st.sampled_from(WORDS), NUMBERS).map(lambda pair: (pair[0] + pair[1]).encode()),
        NOISE,
    ),
    max_size=6,
).map(b"\n".join)  # fmt: skip
REAL_TIME = {ord(c) for c in "?!~\x18"} | set(range(0x80, 0x100))


def without_waits(data: bytes) -> bytes:
    """Lines behind which nothing waits for somebody else, or for hours: no hold, reset, cancelled jog or dwell."""
    kept = bytes(byte for byte in data if byte not in b"!\x18" and byte != 0x85)
    return re.sub(rb"[Pp]", b"S", kept)


@FEW
@given(GRBL.map(without_waits))
@example(b"G4 S1e9\nM0")
def test_grbl_answers_each_line_once(data: bytes) -> None:
    async def work(heard: Heard) -> None:
        lines = bytes(byte for byte in data if byte not in REAL_TIME).replace(b"\r", b"\n").split(b"\n")
        wanted = sum(bool(line.decode("ascii", "replace").strip()) for line in lines)
        said = (await heard.hear(data + b"\n", turns=60)).split("\r\n")
        assert sum(one == "ok" or bool(re.fullmatch(r"error:\d+", one)) for one in said) == wanted
        assert (await heard.hear(b"?")).startswith("<")

    talked(Grbl, work)


@pytest.mark.parametrize(
    ("line", "answer"),
    [
        ("G1X40F600", ["ok"]), ("G1X40", ["error:22"]), ("X900", ["ALARM:2", "error:33"]), ("Y1", ["error:20"]),
        ("$J=X1", ["error:22"]), ("$J=X900F100", ["error:15"]), ("1", ["error:1"]), ("G99", ["error:20"]),
        ("$9", ["error:3"]), ("G", ["error:2"]), ("G20 X1 (an inch) ; or so", ["ok"]),
    ],
)  # fmt: skip
def test_grbl(line: str, answer: list[str]) -> None:
    async def work(heard: Heard) -> None:
        assert [one for one in (await heard.hear(line.encode() + b"\n")).split("\r\n") if one] == answer

    talked(Grbl, work)


@FEW
@given(lines_of([*HANDLERS, "XYZ"]))
def test_gcs_tells_the_number_of_its_error(data: bytes) -> None:
    async def work(heard: Heard) -> None:
        await heard.hear(bytes(byte for byte in data if byte not in (4, 5, 7, 24)) + b"\n")
        assert re.fullmatch(r"\d+\n", await heard.hear(b"ERR?\n"))
        assert await heard.hear(b"ERR?\n") == "0\n"

    talked(Gcs, work)


@pytest.mark.parametrize(
    ("lines", "error"),
    [
        ("MOV 1 30", 5), ("SVO 1 1\nMOV 1 30", 0), ("SVO 1 1\nMOV 1 900", 7), ("SVO 1 1\nMOV 2 30", 15), ("MOV 1", 1),
        ("VEL 1 1e9", 8), ("XYZ", 2), ("MOV 1 x", 1), ("SVO 1 1\nMOV 1 nan", 7), ("STP", 10),
    ],
)  # fmt: skip
def test_gcs(lines: str, error: int) -> None:
    async def work(heard: Heard) -> None:
        await heard.hear(lines.encode() + b"\n")
        assert await heard.hear(b"ERR?\n") == f"{error}\n"

    talked(Gcs, work)


ZABER = [
    "/",
    "/1",
    "/1 1 move abs",
    "/1 1 get",
    "/1 1 set maxspeed",
    "/1 1 move vel",
    "/2 get pos",
    "/1 7 get",
    "/1 1 move rel",
]


@FEW
@given(st.tuples(st.sampled_from(ZABER), NUMBERS).map(" ".join))
@example("/1 1 move abs " + "9" * 400)
@example("/1 1 set maxspeed " + "9" * 400)
def test_zaber_answers_a_command_once_and_nothing_else(line: str) -> None:
    async def work(heard: Heard) -> None:
        body, colon, _ = line[1:].partition(":")
        answers = (await heard.hear(line.encode("ascii", "replace") + b"\n")).split("\r\n")[:-1]
        device = next(iter(body.split()), "")
        is_ours = not device.isdigit() or int(device) < 2
        assert len(answers) == int(is_ours and not colon)
        assert all(re.fullmatch(r"@01 \d \w* ?(OK|RJ) (IDLE|BUSY) \S\S \S.*", one) or " RJ " in one for one in answers)
        assert await heard.hear(b"no command\n@01 0 OK IDLE -- 0\n") == ""

    talked(Zaber, work)


@given(st.text(st.characters(min_codepoint=32, max_codepoint=126), max_size=40))
def test_a_checksum_makes_the_sum_of_a_line_nothing(text: str) -> None:
    assert (sum(text.encode()) + checksum(text)) % 256 == 0


@pytest.mark.parametrize(
    ("line", "data"),
    [
        ("/1 1 home", "OK IDLE -- 0"), ("/1 1 move abs 30000", "OK IDLE -- 0"),
        ("/1 1 move abs 900000", "RJ IDLE -- BADDATA"),
        ("/1 1 move abs x", "RJ IDLE -- BADDATA"), ("/1 2 home", "RJ IDLE -- BADAXIS"),
        ("/1 1 fly", "RJ IDLE -- BADCOMMAND"),
        ("/1 1 get pos", "OK IDLE -- 20000"), ("/1 1 set maxspeed 0", "RJ IDLE -- BADDATA"),
        ("/1 1 warnings", "OK IDLE -- 00"),
        ("/1 1 17 get pos", "OK IDLE -- 20000"),
    ],
)  # fmt: skip
def test_zaber(line: str, data: str) -> None:
    async def work(heard: Heard) -> None:
        assert (await heard.hear(line.encode() + b"\n")).strip().endswith(data)

    talked(Zaber, work)


def test_a_garbled_line_has_no_answer() -> None:
    async def work(heard: Heard) -> None:
        body = "1 1 get pos"
        good = f"/{body}:{checksum(body):02X}\n".encode()
        answer = (await heard.hear(good)).strip()
        assert answer.endswith(f":{checksum(answer[1:-3]):02X}")
        assert await heard.hear(good.replace(b"pos", b"pot")) == ""

    talked(Zaber, work)


@pytest.mark.parametrize(
    ("dialect", "line", "told"),
    [
        (Scpi, b"ENAB;*STB?\n", "4"), (Grbl, b"G0X30\n", "error:9"),
        (Zaber, b"/1 1 move abs 30000\n", "RJ IDLE -- REMOTE"),
        (Gcs, b"SVO 1 1\nERR?\n", {43: "5", 115: "51", 120: "63"}),
    ],
)  # fmt: skip
@pytest.mark.parametrize("why", [43, 115, 120])  # somebody else commands, the selector, a face that only reads
def test_who_may_not_command_is_refused_and_may_stop(dialect: Any, line: bytes, told: Any, why: int) -> None:
    async def work(heard: Heard) -> None:
        heard.line.refuse = why
        if why == 115:
            heard.line.status["selector"] = "local"
        answer = (await heard.hear(line)).strip()
        assert answer.endswith(told[why] if isinstance(told, dict) else told)
        stop = {Scpi: b"STOP\n", Grbl: b"\x18", Zaber: b"/1 stop\n", Gcs: b"STP\n"}[dialect]
        await heard.hear(stop)
        assert heard.line.asked[-1] == "stop"

    talked(dialect, work, commands=why != 120)


@pytest.mark.parametrize(
    ("dialect", "lines", "answer"),
    [
        (Scpi, 'INST:CAT?\nINST:SEL "y";INST:SEL?\nENAB;MOVE:ABS 30;*OPC?;POS?', '"x","y"\n"y"\n1;30'),
        (Gcs, "SAI?\nSVO 1 1 2 1\nMOV 2 30\nPOS? 2\nVEL 2 5\nVEL?", "1 \n2\n2=30.0000000\n1=500.0000000 \n2=5.0000000"),
        (Zaber, "/1 2 move abs 30000\n/1 get pos\n/get system.axiscount",
         "@01 2 OK IDLE -- 0\r\n@01 0 OK IDLE -- 20000 30000\r\n@01 0 OK IDLE -- 2"),
        (Grbl, "G1 Y30 F600\nM0\n$$", "ok\r\nok\r\n"),
    ],
)  # fmt: skip
def test_two_motors_are_two_axes(dialect: Callable[..., Any], lines: str, answer: str) -> None:
    async def work(heard: Heard) -> None:
        said = await heard.hear(lines.encode() + b"\n", turns=2000)
        assert said.startswith(answer) if dialect is Grbl else said.strip() == answer
        assert [line.status["position"] for line in heard.lines] == [0.02, 0.03]

    talked(dialect, work, motors=("x", "y"))


@pytest.mark.parametrize(("dialect", "line"), [(Scpi, "STOP"), (Scpi, "*RST"), (Gcs, "STP"), (Zaber, "/1 stop")])
def test_a_stop_is_one_of_all_axes(dialect: Callable[..., Any], line: str) -> None:
    async def work(heard: Heard) -> None:
        await heard.hear(line.encode() + b"\n")
        assert [line.asked for line in heard.lines] == [["stop"], ["stop"]]

    talked(dialect, work, motors=("x", "y"))


@pytest.mark.parametrize(
    ("dialect", "line", "told"),
    [(Gcs, "MOV 3 1\nERR?", "15"), (Gcs, "MOV 1 1 2 1e6\nERR?", "7"), (Zaber, "/1 3 home", "@01 3 RJ IDLE -- BADAXIS"),
     (Scpi, "INST:SEL z\nSYST:ERR?", '-222,"Data out of range; z: x, y"'), (Grbl, "G0 Z1", "error:20")],
)  # fmt: skip
def test_an_axis_that_there_is_not_moves_none(dialect: Callable[..., Any], line: str, told: str) -> None:
    async def work(heard: Heard) -> None:
        assert (await heard.hear(line.encode() + b"\n")).strip() == told
        assert not any({"move_to", "home"} & {*line.asked} for line in heard.lines)

    talked(dialect, work, motors=("x", "y"))
