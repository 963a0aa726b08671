"""How long a person waits and how much memory a job takes: whole processes, from the command line to their end."""

import os
import subprocess
import sys
import time
from pathlib import Path
from typing import NamedTuple

import pytest

import detent

EXAMPLES = Path(detent.__file__).parent / "examples"
AXIS, LETTER = EXAMPLES / "print_head.toml", EXAMPLES / "letter.txt"

HELP_BAR = 0.25
WARM_BAR = 2.5
COLD_BAR = 20.0
"""Seconds."""

GROWTH_BARS = {("--every", "0"): 30e6, ("--trace", "h5"): 150e6}
"""Bytes by which the peak of a half-hour job may exceed that of a two-minute job: without and with a trace."""

HEAVY = {"numba", "llvmlite", "numpy", "matplotlib", "pint", "pydantic", "h5py"}


class Done(NamedTuple):
    seconds: float
    peak: int
    """Largest resident memory [byte]."""
    output: str


def call(*words, cache=None, log=None):
    """Run Python with `words`; time and memory are of that process alone."""
    paths = [str(Path(detent.__file__).parents[1]), os.environ.get("PYTHONPATH", "")]
    env = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, paths))}
    if cache:
        env["DETENT_CACHE_DIR"] = str(cache)
    begin = time.perf_counter()
    process = subprocess.Popen(
        [sys.executable, *map(str, words)],
        stdout=subprocess.PIPE, stderr=log or subprocess.STDOUT, text=True, env=env,
    )  # fmt: skip
    with process.stdout as stream:
        output = stream.read()
    _, status, usage = os.wait4(process.pid, 0)
    seconds = time.perf_counter() - begin
    process.returncode = os.waitstatus_to_exitcode(status)
    assert process.returncode == 0, output
    return Done(seconds, usage.ru_maxrss * (1 if sys.platform == "darwin" else 1024), output)


def run(job, folder, *words, cache=None):
    done = call("-m", "detent", "run", AXIS, "--job", job, "--output", folder, *words, cache=cache)
    assert (folder / "report.html").stat().st_size > 50_000
    return done


def test_import(benchmark):
    benchmark.pedantic(call, args=("-c", "import detent"), rounds=7, warmup_rounds=1)


def test_help(benchmark):
    benchmark.pedantic(call, args=("-m", "detent", "--help"), rounds=7, warmup_rounds=1)
    if not benchmark.disabled:
        assert benchmark.stats.stats.median <= HELP_BAR


def test_help_imports_nothing_heavy(tmp_path):
    with (tmp_path / "log").open("w+") as log:
        call("-X", "importtime", "-m", "detent", "--help", log=log)
        log.seek(0)
        imported = {row.rsplit("|", 1)[-1].strip() for row in log if row.startswith("import time:")}
    assert "detent.cli" in imported
    assert imported & HEAVY == set()


def test_letter_warm(benchmark, tmp_path):
    benchmark.pedantic(run, args=(LETTER, tmp_path / "out"), rounds=5, warmup_rounds=1)
    if not benchmark.disabled:
        assert benchmark.stats.stats.median <= WARM_BAR


def test_letter_cold(benchmark, tmp_path):
    cache = tmp_path / "cache"
    done = benchmark.pedantic(run, args=(LETTER, tmp_path / "out"), kwargs={"cache": cache}, rounds=1)
    assert list(cache.rglob("*.code")), "the run has compiled nothing: it was not cold"
    if not benchmark.disabled:
        assert done.seconds <= COLD_BAR


@pytest.fixture
def text_of(tmp_path):
    def make(minutes):
        """A text that takes the default print head about that long: 0.34 s a line."""
        lines = round(minutes * 60 / 0.34)
        text = "".join(
            f"{n:5d} the quick brown fox jumps over the lazy dog, the carriage runs on\n" for n in range(lines)
        )
        path = tmp_path / f"{minutes}.txt"
        path.write_text(text)
        return path

    return make


@pytest.mark.parametrize(("options", "bar"), GROWTH_BARS.items(), ids=["nothing recorded", "with a trace"])
def test_memory_does_not_grow_with_the_job(benchmark, tmp_path, text_of, options, bar):
    short, long = (2, 4) if benchmark.disabled else (2, 30)
    run(LETTER, tmp_path / "first")  # compiles where nothing is compiled yet: that takes memory too
    few = run(text_of(short), tmp_path / "few", *options)
    many = benchmark.pedantic(run, args=(text_of(long), tmp_path / "many", *options), rounds=1)
    benchmark.extra_info.update({f"peak MB, {short} min": few.peak / 1e6, f"peak MB, {long} min": many.peak / 1e6})
    assert many.peak - few.peak <= bar
