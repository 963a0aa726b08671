"""The same log gives the same verdict, model and figures whatever kernel the linear algebra takes for the processor.

OpenBLAS chooses its kernels by the processor, and `OPENBLAS_CORETYPE` in its place; numpy does so for its own loops.
Sums then come in another order, or fused, and results differ in their last digits: no choice may hang on these.
"""

import json
import os
import platform
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from tests.log_rig import EMPS

DATA = Path(__file__).parents[4] / "shared" / "data"

pytestmark = [
    pytest.mark.early,
    pytest.mark.compiled,
    pytest.mark.skipif(platform.machine() not in {"x86_64", "AMD64"}, reason="the names are those of x86 kernels"),
]

KERNELS = [
    {"OPENBLAS_CORETYPE": "Haswell"},
    {"OPENBLAS_CORETYPE": "Sandybridge"},
    {"OPENBLAS_CORETYPE": "Prescott", "NPY_DISABLE_CPU_FEATURES": "X86_V3 X86_V4 AVX2 FMA3 AVX512F AVX512_SKX"},
]
"""What each process is told; SkylakeX where the processor has its instructions."""

PROGRAM = """
import contextlib, io, json, sys
import numpy as np
from detent.cli import main

def printed(words):
    text, sys.argv = io.StringIO(), ["detent", *words]
    with contextlib.redirect_stdout(text), contextlib.redirect_stderr(text):
        try:
            main()
        except SystemExit as left:
            return f"{left.code} {text.getvalue()}"

table = np.random.default_rng(1).normal(size=(500, 7))
bits = np.linalg.lstsq(table, table[:, 0], rcond=None)[0].tobytes().hex()
commands = json.loads(sys.argv[1])
print(json.dumps([bits, [printed(words) for words in commands]]))
"""
"""Prints what commands print, and bits of a solution that tell one kernel from another."""

DOCUMENTED = ["--set", "mechanics.load_mass=40 kg", "--set", "encoder.resolution=20 nm", "--no-compare"]
"""How docs/how-to/identify-an-axis.md records its axis."""

SERVO = [
    *("identify", "--column", "position=position [rad]", "--column", "reference=goal_position [rad]"),
    *("--column", "velocity="),
]
MOTOR = ["identify", "--column", "command=-inputSignal"]
BALL_SCREW = [
    *("identify", str(EMPS), "--column", "position=qm [m]", "--column", "reference=qg [m]"),
    *("--column", "force=vir [35.15 N]"),
]


def run(commands: list[list[str]], folder: Path, kernel: dict[str, str] | None = None) -> tuple[str, list[str]]:
    """Bits of the kernel, and what each command prints in a process of its own."""
    unset = {"OPENBLAS_CORETYPE", "NPY_DISABLE_CPU_FEATURES"}
    environment = {name: value for name, value in os.environ.items() if name not in unset}
    made = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", PROGRAM, json.dumps(commands)],
        env=environment | {"OPENBLAS_NUM_THREADS": "1"} | (kernel or {}),
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )
    assert made.returncode == 0, made.stderr[-2000:]
    bits, texts = json.loads(made.stdout)
    return bits, texts


def kernels() -> list[dict[str, str]]:
    from numpy._core._multiarray_umath import __cpu_features__ as features

    has_more = features.get("AVX512_SKX", False)
    return [*KERNELS, {"OPENBLAS_CORETYPE": "SkylakeX"}] if has_more else KERNELS


def agree(commands: list[list[str]], folder: Path) -> list[str]:
    """What the commands print, which is one and the same by every kernel."""
    with ThreadPoolExecutor(2) as pool:
        found = list(pool.map(lambda kernel: run(commands, folder, kernel), kernels()))
    assert len({bits for bits, _ in found}) > 1, "these processes all took one kernel: the test shows nothing"
    first = found[0][1]
    for kernel, (_, texts) in zip(kernels(), found, strict=True):
        for command, ours, theirs in zip(commands, first, texts, strict=True):
            assert theirs == ours, f"{kernel}: detent {' '.join(command)}"
    return first


@pytest.fixture(scope="module")
def documented(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder in which the page has made its logs."""
    folder = tmp_path_factory.mktemp("documented")
    cascade = ["run", "axes/cascade.toml", *DOCUMENTED, "--job"]
    _, texts = run(
        [
            ["examples", "--copy", "axes"],
            [*cascade, "axes/slide_moves.toml", "--output", "first"],
            [*of_the_page("first"), "--job", "moves.toml"],
            [*cascade, "moves.toml", "--output", "second"],
        ],
        folder,
    )
    assert [text[0] for text in texts] == ["0", "0", "1", "0"], texts
    return folder


def of_the_page(log: str) -> list[str]:
    return ["identify", f"{log}/trace.h5", "--column", "voltage=controller.law.command", "--axis", "axes/cascade.toml"]


@pytest.mark.wide
def test_the_log_of_the_page_and_recordings(documented: Path) -> None:
    """Of the page's log six constants were trusted by some kernels and nine by others, three of them wrong.

    The motor turned one way only: columns of the other are 0, and not what rounding leaves.
    """
    recorded = [BALL_SCREW, [*MOTOR, str(DATA / "arduino_dc_motor" / "expdata_20201120_215030.csv")]]
    text, *_ = agree([of_the_page("second"), *(recorded if EMPS.exists() else [])], documented)
    assert "Trusted: 6 constants" in text


@pytest.mark.long
def test_the_other_log_of_the_page_and_its_file(documented: Path) -> None:
    agree([of_the_page("first"), [*of_the_page("second"), "--method", "output-error"]], documented)
    written = [[*of_the_page("second"), "--write", "slide.toml"]]
    texts = [(run(written, documented, kernel), (documented / "slide.toml").read_text())[1] for kernel in kernels()]
    assert len(set(texts)) == 1


@pytest.mark.long
@pytest.mark.skipif(not DATA.exists(), reason="the recordings of real machines (../shared/data) are not here")
def test_every_shared_recording(tmp_path: Path) -> None:
    servos = sorted((DATA / "servo_pendulum_bam").glob("*/*.json.gz"))
    motors = sorted((DATA / "arduino_dc_motor").glob("*.csv"))
    commands = [
        *([*SERVO, str(path)] for path in servos),
        *([*MOTOR, str(path)] for path in motors),
        [*BALL_SCREW, "--method", "output-error"],
        ["identify", str(DATA / "lsb250_two_mass" / "exp1.npz")],
    ]
    agree(commands, tmp_path)
