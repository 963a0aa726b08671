"""The language of a step: what is accepted gives the same bits in C, what is not is refused with its place."""

import ctypes
import random
import shutil
import subprocess

import pytest
from tests import firmware_steps
from tests.firmware_steps import ACCEPTED, REFUSED, Limits, State

from detent.kernel.step import step
from detent.translate.program import Program
from detent.translate.text import code_text, signals_text, struct_texts
from detent.translate.values import RefusedError


@pytest.fixture(autouse=True)
def called_are_steps(monkeypatch):
    """What the steps call are steps; they themselves stay plain functions, which C is compared with."""
    for one in (*firmware_steps.STEPS, firmware_steps.recursion):
        monkeypatch.setattr(firmware_steps, one.__name__, step(one))


def program_of(*steps, options=None) -> Program:
    return Program("t", {f"t_{one.__name__}": one for one in steps}, Limits, options)


def text_of(*steps, options=None) -> str:
    return code_text(program_of(*steps, options=options))


@pytest.mark.parametrize("one", REFUSED, ids=lambda one: one.__name__)
def test_what_is_outside_the_language_is_refused_with_place_and_code(one):
    with pytest.raises(RefusedError, match=r"firmware_steps") as caught:
        program_of(one)
    assert caught.value.code == REFUSED[one]
    assert caught.value.exit_status == 1
    assert "expected: " in str(caught.value)
    assert "try: " in str(caught.value)


def test_a_refusal_names_file_and_line():
    with pytest.raises(RefusedError) as caught:
        program_of(firmware_steps.wild_index)
    line = firmware_steps.wild_index.__code__.co_firstlineno + 1
    assert str(caught.value).startswith(f"firmware_steps.py:{line}: FW09: got an index from -9223372036854775808")


def test_an_option_is_folded_and_what_only_the_other_way_reaches_is_gone():
    both = text_of(firmware_steps.folded)
    assert "if (p->form != 0U)" in both
    one = text_of(firmware_steps.folded, options={(Limits, "form"): 1})
    assert "form" not in one
    assert "t_bump" not in one
    assert "t_bump(r, 1)" in text_of(firmware_steps.folded, options={(Limits, "form"): 0})


def test_a_folded_parameter_is_not_in_the_structure():
    made = program_of(firmware_steps.folded, options={(Limits, "form"): 1})
    text = struct_texts(made, (Limits,))
    assert "form" not in text
    assert "shift" in text


def test_a_signal_is_read_inside_its_length():
    made = program_of(firmware_steps.along)
    assert "r->angle = values.at[r->count];" in code_text(made)
    assert "int32_t length;" in signals_text(made)


def test_what_is_not_proven_is_told():
    notes = program_of(firmware_steps.arithmetic).notes
    assert any("may go beyond 64 bits" in text for _, text in notes.wraps)
    assert any("a store that may wrap: r.half" in text for _, text in notes.wraps)
    first, turns = firmware_steps.loops.__code__.co_firstlineno, len(firmware_steps.WEIGHTS)
    assert program_of(firmware_steps.loops).notes.loops == {
        (f"firmware_steps.py:{firmware_steps.halve.__code__.co_firstlineno + 3}", "at most 64 turns: halves 64 bits"),
        (f"firmware_steps.py:{first + 2}", "at most 8 turns: range(PLACES)"),
        (f"firmware_steps.py:{first + 4}", f"{turns} turns: WEIGHTS"),
    }


def test_functions_stand_behind_those_they_call_with_their_docstrings():
    text = text_of(firmware_steps.effects)
    assert text.index("static int t_bump(") < text.index("void t_effects(")
    assert " * Writes, and gives something.\n" in text


# ---- essential types of MISRA C


def test_an_operand_without_a_sign_stands_beside_a_number_without_one():
    text = text_of(firmware_steps.signs)
    assert "#define T_LAST 255U\n" in text  # beside p->form alone
    assert "#define T_STRIDE 1\n" in text  # a summand, too
    assert "if ((p->form == T_LAST) || (p->form == (unsigned)T_STRIDE)) {" in text
    assert "UNUSED" not in text  # a number of a branch that is left out


def test_an_operators_result_is_made_wider_or_unsigned_by_a_function():
    text = text_of(firmware_steps.signs)
    assert "r->inner.word = (uint16_t)((unsigned)r->half & 7U);" in text
    assert "r->count = t_i64_of_i32(r->half * (int32_t)p->form);" in text
    assert "r->angle = t_f64_of_i32((int32_t)r->half + T_STRIDE);" in text
    assert "r->other = (int64_t)t_shift_down_int((int)p->form, p->shift);" in text


def test_of_a_result_no_more_is_made_than_what_is_kept():
    text = text_of(firmware_steps.lower_bits)
    assert "r->half = t_wrap_i2(" in text
    assert "s->word = (uint16_t)((s->word * 3U) + ((unsigned)r->other - (unsigned)a));" in text
    assert "if ((((s->word & 4U) | (s->word ^ 1U)) != 0U) && (" in text  # words without a sign stay such
    assert "int64_t t_wrap_mul" not in text  # nor is a function left of what is made in another way
    assert "& 7U" in text


def test_a_chain_of_else_if_ends_with_an_else():
    text = text_of(firmware_steps.signs)
    assert text.count("    } else {\n        /* nothing */\n    }\n") == 1


def test_what_a_call_gives_is_kept_before_registers_are_read_beside_it():
    text = text_of(firmware_steps.effects)
    assert (
        "t2_ = t_wrap_add_i64(t1_, t_bump(r, a));\n    r->count = t_wrap_add_i64(t2_, t_wrap_mul_i64(r->other, 2))"
        in text
    )


# ---- against C


def compiled(tmp_path, *steps) -> ctypes.CDLL:
    made = program_of(*steps)
    text = "#include <stdbool.h>\n#include <stdint.h>\n" + struct_texts(made, (Limits, State)) + code_text(made)
    (tmp_path / "t.c").write_text(text)
    flags = "-std=c99 -O1 -ffp-contract=off -Wall -Wextra -Wconversion -Werror -fsanitize=undefined -shared -fPIC"
    more = ["-fno-sanitize-recover=all", "-static-libubsan", "t.c", "-o", "t.so", "-lm"]
    subprocess.run([shutil.which("gcc") or "gcc", *flags.split(), *more], cwd=tmp_path, check=True)
    return ctypes.CDLL(str(tmp_path / "t.so"))


def wrapped(number: int) -> int:
    return (number + (1 << 63)) % (1 << 64) - (1 << 63)


@pytest.mark.process
def test_what_is_accepted_gives_the_same_bits_in_c(tmp_path):
    library, draw = compiled(tmp_path, *ACCEPTED), random.Random(1)
    for one in ACCEPTED:
        call = getattr(library, f"t_{one.__name__}")
        call.argtypes = (ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int64, ctypes.c_int64)
        call.restype = {"floats": ctypes.c_double, "conditions": ctypes.c_int64}.get(one.__name__)
        for _ in range(400):
            p = Limits(form=draw.choice((0, 1, 255)), shift=draw.randint(0, 12), gain=draw.uniform(-3, 3))
            edge = draw.choice((9, 300, 1 << 20, 1 << 40))
            r = State(
                count=draw.randint(-edge, edge), other=draw.randint(-edge, edge), place=draw.randint(0, 7),
                angle=draw.uniform(-1e3, 1e3), half=draw.randint(-32768, 32767),
            )  # fmt: skip
            a, b = draw.randint(-edge, edge), draw.choice((draw.randint(-9, 9), draw.randint(-edge, edge))) or 1
            mine, theirs = r.copy(), r.copy()
            expected = one(p, mine, a, b)
            found = call(ctypes.addressof(p), ctypes.addressof(theirs), a, b)
            assert bytes(mine) == bytes(theirs), (one.__name__, a, b)
            assert found == (wrapped(expected) if isinstance(expected, int) else expected)


@pytest.mark.process
def test_a_divisor_0_gives_0_and_the_last_number_divides_by_minus_1(tmp_path):
    library = compiled(tmp_path, firmware_steps.arithmetic)
    p, r = Limits(), State()
    for a, b in ((5, 0), (-(1 << 63), -1), ((1 << 63) - 1, -(1 << 63))):
        library.t_arithmetic(ctypes.byref(p), ctypes.byref(r), ctypes.c_int64(a), ctypes.c_int64(b))
        assert r.half == (a + b + (1 << 15)) % (1 << 16) - (1 << 15)
