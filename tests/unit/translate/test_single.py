"""Single precision in C: float, its literals and its rounding; where it would be lost unseen, a step is refused."""

import ctypes
import random
import re
import shutil
import subprocess

import pytest
from tests import single_steps
from tests.single_steps import ACCEPTED, REFUSED, Law, Mixed

from detent.kernel.registers import single
from detent.kernel.single import Single
from detent.kernel.step import step
from detent.translate.program import Program
from detent.translate.text import code_text, struct_texts
from detent.translate.values import RefusedError


@pytest.fixture(autouse=True)
def called_are_steps(monkeypatch):
    monkeypatch.setattr(single_steps, "halved", step(single_steps.halved))


def text_of(*steps) -> str:
    return code_text(Program("t", {f"t_{one.__name__}": one for one in steps}))


def test_singles_stay_singles_beside_whole_numbers():
    text = text_of(single_steps.operators)
    assert "first = (r->x * r->y) + (r->x / (fabsf(r->y) + 1.0f)) - ((float)r->n * r->x);" in text
    assert "t_min_f4(t_max_f4(first, -r->y), 2.0f * fabsf(r->x))" in text
    assert "(a > 0) ? first : 1.0f" in text
    assert "r->z = t_f64_of_f32(r->x - (float)r->z);" in text
    assert "r->y = t_f32_of_f64(r->z + (double)a);" in text
    assert text.startswith("#include <math.h>\n")
    assert re.search(r"^float t_operators\(", text, re.MULTILINE)


def test_what_a_step_is_handed_decides_its_precision():
    text = text_of(single_steps.roots)
    assert "static float t_halved(float value)\n" in text
    assert "return value / 2.0f;" in text
    assert "sqrtf(fabsf(r->x))" in text


def test_a_constant_beside_a_single_is_the_next_on_the_side_that_keeps_the_comparison():
    text = text_of(single_steps.comparisons)
    above, below = float(Single(0.1)), 0.09999999403953552
    assert below < 0.1 < above
    for sign, value in (("<", above), ("<=", below), (">=", above)):
        assert f"r->x {sign} {value!r}f" in text
    assert f"{below!r}f < r->x" in text
    assert "fabsf(r->x) < INFINITY" in text
    assert "r->x == 0.5f" in text
    assert "(double)r->x == 0.1" in text  # no single is


def test_a_promotion_is_cast_and_told_with_its_line():
    made = Program("t", {"t_promoted": single_steps.promoted})
    first = single_steps.promoted.__code__.co_firstlineno
    assert made.notes.promotions == {
        (f"single_steps.py:{first + 2}", "r.x * 0.1"),
        (f"single_steps.py:{first + 2}", "(r.x + r.y) * r.z"),
    }
    assert "((double)r->x * 0.1) + (t_f64_of_f32(r->x + r->y) * r->z)" in code_text(made)
    assert Program("t", {"t_operators": single_steps.operators}).notes.promotions == set()


@pytest.mark.parametrize("one", REFUSED, ids=lambda one: one.__name__)
def test_what_would_lose_its_precision_unseen_is_refused(one):
    with pytest.raises(RefusedError, match=r"single_steps\.py:\d+: FW02: .*(single|both)") as caught:
        Program("t", {"t_one": one})
    first = one.__code__.co_firstlineno
    assert first <= int(str(caught.value).split(":")[1]) <= first + 6


def test_one_definition_gives_both_structures():
    double, other = (struct_texts(Program("t", {}, kind), (kind,)) for kind in (Law, single(Law)))
    assert double.count("    double ") == 3
    assert (other.count("float gain"), other.count("float limit"), other.count("double place")) == (1, 1, 1)
    assert other.replace("    float ", "    double ") == double


@pytest.mark.process
@pytest.mark.parametrize("compiler", ["gcc", "clang"])
def test_what_is_accepted_gives_the_same_bits_in_c_and_no_warning_of_a_promotion(tmp_path, compiler):
    if not shutil.which(compiler):
        pytest.skip(f"not installed: {compiler}")
    made = Program("t", {f"t_{one.__name__}": one for one in ACCEPTED})
    text = "#include <stdbool.h>\n#include <stdint.h>\n" + struct_texts(made, (Mixed,)) + code_text(made)
    (tmp_path / "t.c").write_text(text)
    flags = "-std=c99 -O2 -ffp-contract=off -Wall -Wextra -Wconversion -Wdouble-promotion -Werror -shared -fPIC"
    command = [compiler, *flags.split(), "t.c", "-o", "t.so", "-lm"]
    subprocess.run(command, cwd=tmp_path, check=True)
    library, draw = ctypes.CDLL(str(tmp_path / "t.so")), random.Random(1)
    for one in ACCEPTED:
        call = getattr(library, f"t_{one.__name__}")
        call.argtypes = (ctypes.c_void_p, ctypes.c_int64)
        call.restype = {"comparisons": ctypes.c_int64, "promoted": None}.get(one.__name__, ctypes.c_float)
        for _ in range(1000):
            near = float(Single(0.1)) + draw.choice((-2, -1, 0, 0, 1)) * 2.0**-27
            x = draw.choice((draw.uniform(-1e3, 1e3), draw.uniform(-1, 1), near, 0.5, 1e-40, 1e18))
            r = Mixed(x=x, y=draw.choice((x, draw.uniform(-9, 9))), z=draw.choice((x, draw.gauss(0, 1e5))),
                      n=draw.choice((draw.randint(-9, 9), draw.randint(-(1 << 62), 1 << 62))))  # fmt: skip
            a, mine, theirs = draw.randint(-3, 3), r.copy(), r.copy()
            expected = one(mine, a)
            found = call(ctypes.addressof(theirs), a)
            assert bytes(mine) == bytes(theirs), (one.__name__, values(r), a)
            assert found == expected


def values(r: Mixed) -> tuple[float, ...]:
    return float(r.x), float(r.y), r.z, r.n


def test_a_text_with_a_double_literal_is_one_that_the_compiler_refuses(tmp_path):
    if not shutil.which("gcc"):
        pytest.skip("not installed: gcc")
    made = Program("t", {"t_operators": single_steps.operators})
    text = "#include <stdint.h>\n" + struct_texts(made, (Mixed,)) + code_text(made)
    assert "2.0f * fabsf" in text
    for name, code, status in (("sound", text, 0), ("spoilt", text.replace("2.0f * fabsf", "2.0 * fabsf"), 1)):
        (tmp_path / f"{name}.c").write_text(code)
        command = ["gcc", "-std=c99", "-Wdouble-promotion", "-Werror", "-c", f"{name}.c"]
        assert subprocess.run(command, cwd=tmp_path, check=False, capture_output=True).returncode == status
