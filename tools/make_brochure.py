"""Write src/detent/examples/brochure.prn, a small Diablo 630 stream of our own.

A word processor for a daisy-wheel printer did more than send characters: it changed the spacing within a line,
sent every other line backwards so that the carriage need not return, struck bold letters twice, and moved by
absolute tabs. Each paragraph below uses one of these, so that the stream shows what a stream can do.

Run it from the root of the project: `python tools/make_brochure.py`. A test compares the file with what this writes.
"""

from pathlib import Path

CR, LF, FF, BS, SUB = b"\r", b"\n", b"\f", b"\b", b"\x1a"
ESC = b"\x1b"
FORWARD, BACKWARD = ESC + b"5", ESC + b"6"
UNDERSCORE_ON, UNDERSCORE_OFF = ESC + b"E", ESC + b"R"
BOLD, SHADOW, PLAIN = ESC + b"O", ESC + b"W", ESC + b"&"
RED, BLACK = ESC + b"A", ESC + b"B"
UP_HALF, DOWN_HALF = ESC + b"D", ESC + b"U"
RESET = ESC + b"\rP"

CPM_RECORD = 128
"""Bytes of a record of a CP/M file; the last one is filled with SUB."""


def hmi(columns: int) -> bytes:
    """Set the spacing [1/120 in]: 12 is ten characters per inch."""
    return ESC + b"\x1f" + bytes([columns + 1])


def vmi(steps: int) -> bytes:
    """Set the line spacing [1/48 in]: 8 is six lines per inch."""
    return ESC + b"\x1e" + bytes([steps + 1])


def tab(position: int) -> bytes:
    """Move the carriage to a print position, counted in the spacing in force."""
    return ESC + b"\t" + bytes([position + 1])


def overstruck(text: str) -> bytes:
    """Strike bold as WordStar did: each letter again 1/120 inch further, then on to the next."""
    return b"".join(hmi(1) + c + hmi(11) + c for c in (bytes([b]) for b in text.encode("ascii"))) + hmi(12)


def underlined(text: str) -> bytes:
    """Underline letter by letter: one step back, and an underscore over it."""
    return b"".join(bytes([b]) + BS + b"_" for b in text.encode("ascii"))


def both_ways(*lines: str) -> bytes:
    """Print a paragraph to and fro: every second line is sent from its last letter to its first.

    The carriage goes to the last letter by an absolute tab, and the line feed carries it into the next line
    without a return, as the printers of the time did it.
    """
    stream = b""
    for number, line in enumerate(lines):
        text = line.encode("ascii")
        if number % 2:
            stream += tab(len(text) - 1) + BACKWARD + text[:0:-1] + hmi(0) + text[:1] + hmi(12) + FORWARD
        else:
            stream += tab(0) + text
        stream += LF
    return stream


def justified(line: str, right: int) -> bytes:
    """Spread a line to end at a print position: the gaps share what is left over."""
    words = line.split()
    letters = sum(len(word) for word in words)
    gaps = len(words) - 1
    free = (right - letters) * 12
    stream = words[0].encode("ascii")
    for number, word in enumerate(words[1:]):
        gap = free * (number + 1) // gaps - free * number // gaps
        stream += hmi(gap) + b" " + hmi(12) + word.encode("ascii")
    return stream + CR + LF


def brochure() -> bytes:
    """Give the whole stream, filled to whole CP/M records."""
    end = CR + LF
    page = RESET + hmi(12) + vmi(8)
    page += hmi(24) + tab(4) + BOLD + b"THE CARRIAGE" + PLAIN + hmi(12) + end + LF
    page += both_ways(
        "A print head on a belt, a brush motor, an encoder: that is all.",
        "What makes it precise is what it knows about itself. It measures",
        "how fast it runs for a given voltage, to the left and to the right,",
        "and from then on it drives every speed without having to search.",
    )
    page += LF + underlined("Figures") + end
    for name, value in (("Top speed", "40 in/s"), ("Step of speed", "1/6 in/s"), ("Speeds", "223")):
        page += tab(4) + name.encode("ascii") + tab(40) + value.encode("ascii") + end
    page += tab(4) + b"Acceleration" + tab(40) + b"600 in/s" + UP_HALF + b"2" + DOWN_HALF + end + LF
    page += hmi(10) + b"Twelve letters to the inch are as easy for it as ten: the spacing is a number." + hmi(12) + end
    page += LF + justified("A justified line hides its spare room in the gaps between the words.", 72)
    page += b"It can be " + overstruck("bold") + b", " + SHADOW + b"shadowed" + PLAIN + b", "
    page += UNDERSCORE_ON + b"underscored by itself" + UNDERSCORE_OFF + b" or " + RED + b"red" + BLACK + b"." + end
    page += vmi(12) + LF + tab(52) + b"detent" + CR + vmi(8) + FF
    return page + SUB * (-len(page) % CPM_RECORD)


if __name__ == "__main__":
    target = Path(__file__).resolve().parent.parent / "src" / "detent" / "examples" / "brochure.prn"
    print(f"{target.name}: {target.write_bytes(brochure())} bytes")
