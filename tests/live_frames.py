"""Frames on a serial line that loses and spoils some: a receiver in Python and one in C, which must do the same."""

import ctypes
import shutil
import subprocess
from importlib import resources
from pathlib import Path
from random import Random
from typing import Any

import pytest

from detent.control.operation import Request
from detent.operate.drivers.frames import LONGEST, NUMBERS, Frame, Receiver, encode

CC = shutil.which("cc")
needs_cc = pytest.mark.skipif(CC is None, reason="compiles C")
GLUE = """
#include "frames.h"
uint32_t encode(uint8_t kind, uint16_t number, const uint8_t *payload, uint32_t count, uint8_t *line)
{ return frame_encode(kind, number, payload, count, line); }
uint32_t size(void) { return sizeof(frame_receiver); }
uint32_t feed(frame_receiver *r, const uint8_t *line, uint32_t count, uint8_t *out)
{   /* frames as kind, number, length and payload */
    uint32_t at = 0;
    for (uint32_t k = 0; k < count; k++)
        if (frame_feed(r, line[k])) {
            out[at++] = r->kind; out[at++] = r->number & 0xFF; out[at++] = r->number >> 8; out[at++] = r->filled - 5;
            for (uint32_t j = 3; j + 2 < r->filled; j++) out[at++] = r->data[j];
        }
    return at;
}
void counts(const frame_receiver *r, uint32_t *out)
{ out[0] = r->good; out[1] = r->spoilt; out[2] = r->missing; out[3] = r->stale; }
"""


def in_c(folder: Path) -> Any:
    """The same frames, compiled."""
    header = resources.files("detent.operate.drivers").joinpath("frames.h").read_text(encoding="ascii")
    (folder / "frames.h").write_text(header)
    (folder / "glue.c").write_text(GLUE)
    strict = ["-std=c99", "-O2", "-Wall", "-Wextra", "-Werror", "-fPIC", "-shared"]
    subprocess.run([str(CC), *strict, "glue.c", "-o", "frames.so"], cwd=folder, check=True)
    return ctypes.CDLL(str(folder / "frames.so"))


class InC:
    """A receiver in C."""

    def __init__(self, library: Any) -> None:
        self.library, self.memory = library, ctypes.create_string_buffer(library.size())

    def feed(self, line: bytes) -> list[Frame]:
        out = ctypes.create_string_buffer(len(line) + 2 * LONGEST)
        count = self.library.feed(self.memory, line, len(line), out)
        raw, at, found = out.raw, 0, []
        while at < count:
            length = raw[at + 3]
            found.append(Frame(raw[at], raw[at + 1] | raw[at + 2] << 8, raw[at + 4 : at + 4 + length]))
            at += 4 + length
        return found

    @property
    def counts(self) -> tuple[int, ...]:
        out = (ctypes.c_uint32 * 4)()
        self.library.counts(self.memory, out)
        return tuple(out)


def counts(receiver: Receiver) -> tuple[int, ...]:
    return receiver.good, receiver.spoilt, receiver.missing, receiver.stale


def requests(number: int) -> bytes:
    """A record of the mailbox, as a payload."""
    return bytes(Request(number=number, kind=5, id=number, client=1, value=number * 1e-3, speed=1.0))


def disturbed(frames: int, seed: int) -> tuple[bytes, int]:
    """A line that loses a hundredth of the frames and turns bits of another; and how many are left whole."""
    random, line, whole = Random(seed), bytearray(), 0
    for number in range(frames):
        frame, luck = bytearray(encode(1, number, requests(number))), random.random()
        if luck < 0.01 and 0 < number < frames - 1:
            continue
        if luck < 0.02 and 0 < number < frames - 1:
            for _ in range(random.randint(1, 8)):
                frame[random.randrange(len(frame))] ^= 1 << random.randrange(8)
        else:
            whole += 1
        line += frame
    return bytes(line), whole


def receive_all(library: Any, frames: int, seed: int) -> None:
    (line, whole), ours, theirs = disturbed(frames, seed), Receiver(), InC(library)
    good, at, random = 0, 0, Random(seed)
    while at < len(line):
        piece = line[at : at + random.randint(1, 4000)]
        at += len(piece)
        found = ours.feed(piece)
        assert found == theirs.feed(piece)
        for frame in found:
            number = int.from_bytes(frame.payload[:8], "little")
            assert number % NUMBERS == frame.number
            assert frame.payload == requests(number)
        good += len(found)
    assert counts(ours) == theirs.counts
    assert good == ours.good
    assert good + ours.missing == frames
    assert 0.97 * frames < good <= whole  # what stands beside a spoilt frame may be lost with it
