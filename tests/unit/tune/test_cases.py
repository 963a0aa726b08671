"""Which values case number i has, and what makes a machine of it."""

from pathlib import Path

import numpy as np
import pytest
from tests.acceptance.test_golden_bits import EXAMPLES

import detent
from detent.errors import DetentError
from detent.methods.cascade.build import build_cascade
from detent.methods.moves.job import one_move
from detent.tune.cases import Limit, Question, draw, shares

TOLERANCE = """
[tolerance]
"mechanics.load_mass" = "10 %"
"mechanics.friction.positive.coulomb" = ["10 N", "18 N"]
"mechanics.coupling.stiffness" = { interval = ["51 N/um", "69 N/um"], distribution = "normal" }
"drive.delay" = [1, 3]
"""


def question(folder: Path, tolerance: str = TOLERANCE, overrides: tuple[str, ...] = (), **more):
    file = folder / "axis.toml"
    file.write_text((EXAMPLES / "cascade.toml").read_text(encoding="utf-8") + tolerance, encoding="utf-8")
    return Question.of(detent.load(file, overrides).file, one_move("one", 0.01, 0.0), **more)


def test_case_0_is_the_file_and_the_others_fill_their_intervals(tmp_path):
    values = draw(question(tmp_path), 0, 4000)
    assert {key: each[0] for key, each in values.items()} == {
        "mechanics.load_mass": 30.0, "mechanics.friction.positive.coulomb": 14.0,
        "mechanics.coupling.stiffness": 60e6, "drive.delay": 1.0,
    }  # fmt: skip
    mass, stiffness = values["mechanics.load_mass"], values["mechanics.coupling.stiffness"]
    assert 27.0 <= mass.min() < 27.01
    assert 32.99 < mass.max() <= 33.0
    assert np.mean((stiffness >= 51e6) & (stiffness <= 69e6)) == pytest.approx(0.95, abs=0.01)
    delays, numbers = np.unique(values["drive.delay"], return_counts=True)
    assert delays.tolist() == [1.0, 2.0, 3.0]
    assert numbers == pytest.approx([4000 / 3] * 3, abs=120)
    assert abs(np.corrcoef(mass, stiffness)[0, 1]) < 0.05


def test_a_value_depends_on_seed_number_and_key_alone(tmp_path):
    asked = question(tmp_path)
    whole = draw(asked, 0, 200)
    fewer = question(tmp_path, '[tolerance]\n"drive.delay" = [1, 3]\n"mechanics.load_mass" = "10 %"\n')
    for key, each in draw(fewer, 77, 40).items():
        assert each.tolist() == whole[key][77:117].tolist()
    other = draw(question(tmp_path, seed=2), 1, 199)
    assert not np.isin(other["mechanics.load_mass"], whole["mechanics.load_mass"]).any()


def test_the_numbers_are_those_of_the_published_generator():
    """First word of Philox4x64-10 at counter 1, by the reference's own arithmetic in whole numbers."""
    words, key, mask = [1, 0, 0, 0], [7, int.from_bytes(_sha("a"), "little")], 2**64 - 1
    for _ in range(10):
        high, low = divmod(0xD2E7470EE14C6C93 * words[0], 2**64)
        high2, low2 = divmod(0xCA5A826395121157 * words[2], 2**64)
        words = [high2 ^ words[1] ^ key[0], low2, high ^ words[3] ^ key[1], low]
        key = [(key[0] + 0x9E3779B97F4A7C15) & mask, (key[1] + 0xBB67AE8584CAA73B) & mask]
    assert shares(7, "a", 1, 1)[0] == ((words[0] >> 11) + 0.5) * 2.0**-53


def _sha(key: str) -> bytes:
    import hashlib

    return hashlib.sha256(key.encode()).digest()[:8]


def test_static_friction_follows_at_its_ratio(tmp_path):
    asked, coulomb = question(tmp_path), "mechanics.friction.positive.coulomb"
    assert asked.machine({coulomb: 7.0}).spec.mechanics.friction.positive.static == pytest.approx(9.0, rel=1e-15)
    own = question(tmp_path, TOLERANCE + '"mechanics.friction.positive.static" = ["18 N", "20 N"]\n')
    static = {coulomb: 10.0, "mechanics.friction.positive.static": 19.0}
    assert own.machine(static).spec.mechanics.friction.positive.static == 19.0
    assert bytes(build_cascade(asked.machine({}).spec)) == bytes(build_cascade(asked.file.spec))


def test_the_hash_tells_questions_apart(tmp_path):
    asked = question(tmp_path)
    assert asked.hash == question(tmp_path).hash
    for other in (
        question(tmp_path, seed=2), question(tmp_path, overrides=("drive.delay=2",)), question(tmp_path, margins=True),
        question(tmp_path, limits=[Limit("done", 1.0, least=True)]),
        question(tmp_path, TOLERANCE.replace("10 %", "9 %")),
    ):  # fmt: skip
        assert other.hash != asked.hash


def test_what_is_no_question_is_refused(tmp_path):
    with pytest.raises(DetentError, match=r"0 to 18446744073709551615"):
        question(tmp_path, seed=-1)
    with pytest.raises(DetentError, match=r"no table \[tolerance\]"):
        question(tmp_path, "")


def test_a_limit_is_not_kept_by_a_case_that_lacks_it():
    results = {"error": np.array([1.0, 2.0, np.nan])}
    assert Limit("error", 1.5).kept(results).tolist() == [True, False, False]
    assert Limit("error", 1.5, least=True).kept(results).tolist() == [False, True, False]
    assert str(Limit("error", 1.5)) == "error <= 1.5"
