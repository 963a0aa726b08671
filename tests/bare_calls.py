"""What each call of the firmware specification takes, in every state that a simulated job comes to.

`python -m tests.bare_calls METHOD TICKS FILE`, with plain steps, notes the registers before each call and what it is
given; a program on an emulated processor puts these registers in place, calls, and counts instructions and stack.
"""

import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import detent
from detent.export.code import FLAGS, _initialiser, template
from detent.export.drawn import blocks_in
from detent.export.measure import COUNTS, SHIFT
from detent.export.unit import ControlUnit, unit_of
from detent.export.vectors import record
from detent.export.verify import TARGETS, answer
from detent.kernel.registers import Registers
from detent.methods.cascade import controller as cascade
from detent.methods.filtered_servo import controller as filtered
from detent.methods.phase_servo import controller as phase
from detent.methods.print_head import controller as head
from detent.methods.rotary_table import controller as table
from detent.methods.stepper_envelope import controller as stepper
from detent.translate.program import Program
from tests.bare_units import ENTRIES, JOBS, MOTORS, axis_named, bare_code, bare_header, bare_program

PAINTED = 1024  # bytes of stack
END = 0xFF  # behind the last record


@dataclass(frozen=True)
class Taken:
    """What the calls of an entry take at most."""

    calls: int
    most: int  # instructions
    stack: int  # bytes


# ---- the calls of a simulation

Made = tuple[Registers | None, Registers | None, tuple[int, ...]]
HOOKS: dict[str, list[tuple[Any, str, str, Callable[..., Made]]]] = {
    "cascade": [(cascade, "sample", "sample", lambda _p, c, w, *_: (c, w, (w.motor.count, w.load.count)))],
    "filtered_servo": [
        (filtered, "one_clock", "clock", lambda _p, c, w, k: (c, w, (w.a >> k & 1, w.b >> k & 1))),
        (filtered, "steer_rate", "prepare", lambda *_: (None, None, ())),
        (filtered, "work", "", lambda _p, c, w, _quiet: (c, w, ())),
        (filtered, "decide", "decide", lambda _p, c, w: (c, w, ())),
    ],
    "phase_servo": [(phase, "sample", "tick", lambda _p, c, w: (c, w, (w.ps,)))],
    "zoom": [(stepper, "step_along", "next", lambda _p, c, *_: (c, None, ()))],
    "rotary_table": [
        (table, "take_interrupt", "", lambda _p, c, w: (c, w, ())),
        (table, "interrupt", "interrupt", lambda _p, _r, theta: (None, None, (theta,))),
        (table, "begin_task", "begin_task", lambda *_: (None, None, ())),
        (table, "end_task", "end_task", lambda *_: (None, None, ())),
    ],
    "print_head": [
        (head, "emitter", "emitter", lambda _p, c, when, change: (c, None, (when, change))),
        (head, "reverse", "reverse", lambda _p, c: (c, None, ())),
        (head, "fired", "fired", lambda c: (c, None, ())),
        (head, "decide", "decide", lambda _p, c, w: (c, w, ())),
    ],
}
HOOKS["single"] = HOOKS["cascade"]
"""Where a simulation comes by an entry: module, name there, entry, and of its arguments controller, lines and numbers.

Without an entry the registers are noted for what is called next, of which only a block is at hand.
"""


class Notebook:
    """Records of calls, as the program in C reads them: what has changed since the last one, and the numbers."""

    def __init__(self, method: str, unit: ControlUnit) -> None:
        self.unit, self.names = unit, list(ENTRIES[method])
        self.controller: Registers = unit.controller()
        self.lines: Registers = unit.lines()
        self.before = np.zeros(len(bytes(self.controller)) + len(bytes(self.lines)), np.uint8)
        self.data, self.signals = bytearray(), list[bytes]()

    def note(self, entry: str, made: Made) -> None:
        """One call."""
        controller, lines, numbers = made
        self.controller, self.lines = controller or self.controller, lines or self.lines
        if not entry:
            return
        image = np.frombuffer(bytes(self.controller) + bytes(self.lines), np.uint8)
        places = np.flatnonzero(image != self.before).tolist()
        self.before = image
        self.data.append(self.names.index(entry))
        self.data += len(places).to_bytes(2, "little")
        for at in places:
            self.data += at.to_bytes(2, "little")
            self.data.append(int(image[at]))
        for one in numbers:
            self.data += one.to_bytes(8, "little", signed=True)

    def hook(self, module: Any, name: str, entry: str, of: Callable[..., Made]) -> None:
        """Note every call by this name."""
        step = getattr(module, name)

        def noted(*given: Any) -> Any:
            """Note it, and call."""
            if entry == "next" and not self.signals:
                self.signals = [bytes(one) for one in given[2:]]
            self.note(entry, of(*given))
            return step(*given)

        setattr(module, name, noted)


def simulated(method: str, ticks: int) -> tuple[bytes, bytes, list[bytes]]:
    """Parameters, records and signals of a job, with plain steps."""
    axis = axis_named(method)
    unit = unit_of(axis, motor=MOTORS.get(method, ""))
    book = Notebook(method, unit)
    for one in HOOKS[method]:
        book.hook(*one)
    golden = record(unit, axis, axis.load_job(detent.example(JOBS[method])), ticks)
    return bytes(golden.params), bytes(book.data), book.signals


# ---- counted

PROGRAM = """#include "count.h"
#include "bare.h"
#include <string.h>

int bare_get(void);
void bare_put(char one);
int bare_replay(void);

static const bare_params p_ = PARAMS;
static bare_controller c_;
static bare_lines l_;
static uint8_t image_[sizeof c_ + sizeof l_];
typedef char layout_[(sizeof image_ == BYTES) ? 1 : -1];
SIGNALS
static uint32_t calls_[ENTRIES], most_[ENTRIES], deep_[ENTRIES], nothing_, begun_;
static volatile unsigned char *top_;

static uint64_t take(int bytes)
{
    uint64_t value = 0;
    for (int k = 0; k < bytes; k++) {
        value |= (uint64_t)(unsigned)bare_get() << (8 * k);
    }
    return value;
}

static void say(const char *text)
{
    while (*text != '\\0') {
        bare_put(*text);
        text++;
    }
}

static void say_number(uint32_t value)
{
    char digits[12];
    int k = 11;
    digits[k] = '\\0';
    do {
        k--;
        digits[k] = (char)('0' + (int)(value % 10u));
        value /= 10u;
    } while (value != 0u);
    say(" ");
    say(&digits[k]);
}

/* Nothing else is called between paint and look: it would leave its own marks. */
#define BEGIN() do { top_ = stack_(); for (int k_ = 1; k_ <= PAINTED; k_++) { *(top_ - k_) = 0xA5u; } \\
                     begun_ = instructions_(); } while (0)
#define END(taken, deep) do { taken = instructions_() - begun_; deep = PAINTED; \\
                              while ((deep > 0u) && (*(top_ - deep) == 0xA5u)) { deep--; } } while (0)

int bare_replay(void)
{
    static const char *const names[ENTRIES] = {NAMES};
    uint32_t taken, deep;
    BEGIN();
    END(nothing_, deep);
    for (;;) {
        const unsigned entry = (unsigned)take(1);
        if (entry == 0xFFu) {
            break;
        }
        for (uint64_t places = take(2); places > 0u; places--) {
            const uint64_t at = take(2);
            image_[at] = (uint8_t)take(1);
        }
        memcpy(&c_, image_, sizeof c_);
        memcpy(&l_, &image_[sizeof c_], sizeof l_);
        const int64_t a = (NUMBERS[entry] > 0) ? (int64_t)take(8) : 0;
        const int64_t b = (NUMBERS[entry] > 1) ? (int64_t)take(8) : 0;
        (void)a;
        (void)b;
        switch (entry) {
CASES
        default:
            return 2;
        }
        taken -= nothing_;
        calls_[entry]++;
        most_[entry] = (taken > most_[entry]) ? taken : most_[entry];
        deep_[entry] = (deep > deep_[entry]) ? deep : deep_[entry];
    }
    for (int k = 0; k < ENTRIES; k++) {
        say(names[k]);
        say_number(calls_[k]);
        say_number(most_[k]);
        say_number(deep_[k]);
        say("\\n");
    }
    return 0;
}
"""


def cases(program: Program, unit: ControlUnit) -> Iterator[tuple[str, int]]:
    """The call of each entry, and how many numbers it takes."""
    places = {
        one: f"&{root}_" + "".join(f".{part}" for part in path.split(".") if part)
        for top, root in ((unit.lines, "l"), (unit.controller, "c"), (unit.params, "p"))
        for one, _, path in blocks_in(top, root)
    }
    for f in (one for one in program.steps.values() if one.entry):
        texts, numbers, signals = list[str](), 0, 0
        for name in program.arguments(f):
            value: Any = f.names[name]
            if value.kind == "file":
                texts.append(places[value.registers])
            elif value.kind == "signal":
                texts.append(f"laid{signals}_")
                signals += 1
            else:
                texts.append("ab"[min(numbers, 1)])
                numbers += 1
        yield f"{'' if f.result_kind == 'none' else '(void)'}{f.cname}({', '.join(texts)});", numbers


def program_text(program: Program, unit: ControlUnit, params: Registers, signals: list[bytes]) -> str:
    """The program around the unit."""
    found = list(cases(program, unit))
    laid = "".join(
        f"static const int16_t at{k}_[] = {{{', '.join(map(str, np.frombuffer(one, np.int16)))}}};\n"
        f"static const bare_i2_signal laid{k}_ = {{at{k}_, {len(one) // 2}}};\n"
        for k, one in enumerate(signals)
    )
    size = len(bytes(unit.controller())) + len(bytes(unit.lines()))
    names = [name for name in program.steps.values() if name.entry]
    text = PROGRAM.replace("PARAMS", _initialiser(program, params)).replace("BYTES", str(size))
    text = text.replace("CASES", "\n".join(
        f"        case {k}: BEGIN(); {call} END(taken, deep); break;" for k, (call, _) in enumerate(found)
    )).replace("SIGNALS", laid).replace("NAMES", ", ".join(f'"{one.cname[5:]}"' for one in names))  # fmt: skip
    numbers = f"static const int NUMBERS[] = {{{', '.join(str(count) for _, count in found)}}};\n"
    return f"#define ENTRIES {len(found)}\n#define PAINTED {PAINTED}\n{numbers}{text}"


def counted(method: str, ticks: int, names: tuple[str, ...], work: Path) -> dict[str, dict[str, Taken]]:
    """What each entry takes at most, by processor."""
    notes = work / "notes"
    command = [sys.executable, "-m", "tests.bare_calls", method, str(ticks), str(notes)]
    environment = os.environ | {"NUMBA_DISABLE_JIT": "1"}
    subprocess.run(command, check=True, env=environment, cwd=Path(__file__).parents[1])
    parts = [notes.with_suffix(f".{k}").read_bytes() for k in range(2)]
    signals = [one.read_bytes() for one in sorted(work.glob("notes.signal*"))]
    axis = axis_named(method)
    unit = unit_of(axis, motor=MOTORS.get(method, ""))
    params = unit.params.from_buffer_copy(parts[0])
    program = bare_program(method, unit, params)
    (work / "job.vec").write_bytes(parts[1] + bytes([END]))
    (work / "bare.c").write_text(bare_code(method, unit, params))
    (work / "bare.h").write_text(bare_header(program, unit))
    (work / "count.h").write_text(template("count.h.in", NAME="BARE"))
    (work / "call.c").write_text(program_text(program, unit, params, signals))
    (work / "board.c").write_text(template("board.c.in", name="bare"))
    return {name: dict(_counted(name, work)) for name in names}


def _counted(name: str, work: Path) -> Iterator[tuple[str, Taken]]:
    target = TARGETS[name]
    assert target.memory is not None
    (work / "board.ld").write_text(template("board.ld.in", **target.memory))
    flags = f"{target.compiler} {FLAGS} -Os {target.flags}".split()
    for file, more in (("bare.c", []), ("call.c", []), ("board.c", ["-include", "count.h", '-DVECTORS="job.vec"'])):
        subprocess.run([*flags, *more, "-c", file, "-o", f"{file}.o"], cwd=work, check=True)
    objects = ["bare.c.o", "call.c.o", "board.c.o"]
    linked = [*flags, "-T", "board.ld", "-Wl,-e,Start", *objects, "-o", "job", *target.libraries.split()]
    subprocess.run(linked, cwd=work, check=True)
    for line in answer(target, work, work, "job", f"-icount shift={SHIFT}").splitlines():
        words = line.split()
        unit = COUNTS[name.partition("-")[0]]
        if len(words) == 4 and words[1] != "0":
            yield words[0], Taken(int(words[1]), round(int(words[2]) * unit), int(words[3]))


if __name__ == "__main__":
    given, noted, laid = simulated(sys.argv[1], int(sys.argv[2]))
    place = Path(sys.argv[3])
    place.with_suffix(".0").write_bytes(given)
    place.with_suffix(".1").write_bytes(noted)
    for number, one in enumerate(laid):
        place.with_suffix(f".signal{number}").write_bytes(one)
