"""Damage: bytes, numbers, words and lines of good files changed, cut, doubled and mixed, by a seeded generator."""

import re
import struct
from collections.abc import Callable, Sequence
from random import Random

WORDS = (
    b"", b"0", b"-1", b"1e999", b"-1e-999", b"nan", b"inf", b"9" * 30, b"0x1F", b"1_000",
    b"-0.0", b"1e308", b"5e-324",
    b"2147483648", b"18446744073709551616", b"true", b"null", b"{}", b"[]", b"[[", b"]]", b'"', b'"""', b"'", b"\\",
    b"#",
    b"=", b",", b";", b"\t", b"\r", b"\n\n", b"\0", b"\xff", b"\xef\xbb\xbf", b"\xff\xfe",
    "µΩ°²".encode(), b"\xe2\x80\xae",
    b'"1 m"', b'"-5 kg"', b'"0 s"', b'"1e300 Hz"', b'"1 m/s^-0"', b'"3 fortnight"', b"{a = 1}", b"[[x]]",
    b"1979-05-27T07:32:00Z",
    b"a" * 3000, b"[" * 500, b"\\u0000", b"\\ud800", b"{0}", b"%s", b"../../x",
)  # fmt: skip
"""What text files are likely to stumble over."""

SIZES = (0, 1, 2, 7, 8, 63, 64, 127, 128, 255, 256, 32767, 65535, 2**31 - 1, 2**31, 2**32 - 1, 2**63 - 1, 2**64 - 1)
_NUMBER = re.compile(rb"-?[0-9]+(?:\.[0-9]+)?")


def mutate(rng: Random, seeds: Sequence[bytes], *, text: bool) -> bytes:
    """A good file, damaged once or several times."""
    data = bytearray(rng.choice(seeds))
    kinds = (*_BYTES, *_TEXT, *_TEXT) if text else _BYTES
    for _ in range(rng.choice((1, 1, 1, 2, 2, 3, 5, 10))):
        rng.choice(kinds)(rng, data, seeds)
    return bytes(data)


def _span(rng: Random, data: bytes | bytearray) -> slice:
    """A stretch, short more often than long."""
    at = rng.randrange(len(data) + 1)
    return slice(at, min(len(data), at + int(rng.choice((4, 16, 64, 1024)) * rng.random() ** 2) + 1))


def _flip(rng: Random, data: bytearray, _: Sequence[bytes]) -> None:
    if data:
        data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)


def _set(rng: Random, data: bytearray, _: Sequence[bytes]) -> None:
    if data:
        data[rng.randrange(len(data))] = rng.choice((0, 1, 0x7F, 0x80, 0xFF, rng.randrange(256)))


def _cut(rng: Random, data: bytearray, _: Sequence[bytes]) -> None:
    del data[_span(rng, data)]


def _end(rng: Random, data: bytearray, _: Sequence[bytes]) -> None:
    del data[rng.randrange(len(data) + 1) :]


def _double(rng: Random, data: bytearray, _: Sequence[bytes]) -> None:
    at = rng.randrange(len(data) + 1)
    data[at:at] = data[_span(rng, data)] * rng.choice((1, 1, 2, 30))


def _mix(rng: Random, data: bytearray, seeds: Sequence[bytes]) -> None:
    other = rng.choice(seeds)
    data[_span(rng, data)] = other[_span(rng, other)]


def _size(rng: Random, data: bytearray, _: Sequence[bytes]) -> None:
    code = rng.choice(("<H", "<I", "<Q", ">I", "<d"))
    if len(data) >= 8:
        at = rng.randrange(len(data) - 7)
        value = (
            rng.choice(SIZES) % 2 ** (8 * struct.calcsize(code)) if code != "<d" else rng.choice((1e308, float("nan")))
        )
        struct.pack_into(code, data, at, value)


def _word(rng: Random, data: bytearray, _: Sequence[bytes]) -> None:
    data[_span(rng, data) if rng.random() < 0.3 else slice(at := rng.randrange(len(data) + 1), at)] = rng.choice(WORDS)


def _number(rng: Random, data: bytearray, _: Sequence[bytes]) -> None:
    found = [one.span() for one in _NUMBER.finditer(bytes(data))]
    if found:
        begin, end = rng.choice(found)
        data[begin:end] = rng.choice(
            (*WORDS[:15], str(rng.randrange(-9, 10)).encode(), f"{rng.gauss(0, 1):.3g}".encode())
        )


def _lines(rng: Random, data: bytearray, seeds: Sequence[bytes]) -> None:
    lines = data.split(b"\n")
    at, other = rng.randrange(len(lines)), rng.randrange(len(lines))
    if rng.random() < 0.3:
        del lines[at]
    elif rng.random() < 0.5:
        lines[at], lines[other] = lines[other], lines[at]
    else:
        lines.insert(at, bytearray(rng.choice(rng.choice(seeds).split(b"\n"))))
    data[:] = b"\n".join(lines)


_BYTES: tuple[Callable[[Random, bytearray, Sequence[bytes]], None], ...] = (
    _flip, _set, _cut, _end, _double, _mix, _size, _size,
)  # fmt: skip
_TEXT = (_word, _word, _number, _number, _number, _lines)
