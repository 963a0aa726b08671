"""Foreign files in a process of their own: whatever a reader does there, the answer is its result or one sentence."""

import os
import signal
import sys
import threading
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pytest
from tests import stumbling_readers as readers

from detent.errors import DetentError, InputError
from detent.files import apart

LINUX = pytest.mark.skipif(sys.platform != "linux", reason="only here the memory is limited")


@pytest.fixture
def path(tmp_path: Path) -> Path:
    (tmp_path / "log.bin").write_bytes(b"x" * 100)
    return tmp_path / "log.bin"


def refusal(reader, path, *args):
    with pytest.raises(InputError) as caught:
        apart.read_apart(reader, path, "a log", *args)
    (problem,) = caught.value.problems
    assert problem.file == str(path)
    return problem


def test_the_result_comes_back_and_what_libraries_print_does_not(path):
    trace = apart.read_apart(readers.prints, path, "a log")
    assert trace.time.tolist() == [0.0, 1.0, 2.0]
    assert trace.time.flags.writeable
    assert trace.attributes == {"seed": 3}


def test_one_process_reads_them_all_wherever_they_are_named_from(path, monkeypatch):
    first, _ = apart.read_apart(readers.whoami, path, "a log")
    monkeypatch.chdir(path.parent)
    again, found = apart.read_apart(readers.whoami, Path(path.name), "a log")
    assert first == again != os.getpid()
    assert found == str(path.resolve())


@pytest.mark.parametrize("reader", [readers.never_ends, readers.sleeps])
def test_a_reading_without_end_is_ended(path, monkeypatch, reader):
    monkeypatch.setattr(apart, "SECONDS", 0.2)
    before, _ = apart.read_apart(readers.whoami, path, "a log")
    problem = refusal(reader, path)
    assert problem.got == "a file that took longer to read than 0.2 s"
    assert problem.allowed == "a log, read in 0.2 s and 4 GB"
    assert problem.remedy.endswith("set DETENT_READ_LIMITS=4 in the environment: both limits times 4")
    with pytest.raises(ChildProcessError):  # it is gone, and no zombie
        os.waitpid(before, os.WNOHANG)
    monkeypatch.undo()
    assert apart.read_apart(readers.whoami, path, "a log")[0] != before


@LINUX
def test_a_reading_that_wants_all_memory_is_ended(path):
    assert refusal(readers.takes_all, path).got == "a file that needed more memory to read than 4 GB"


@LINUX
def test_the_limits_grow_with_the_file_and_by_the_environment(path, monkeypatch):
    monkeypatch.setattr(apart, "MEMORY", 50_000_000)
    size = 100_000_000
    problem = refusal(readers.takes, path, size)
    assert "needed more memory to read than 0.05 GB" in problem.got
    monkeypatch.setenv("DETENT_READ_LIMITS", "4")
    assert apart.read_apart(readers.takes, path, "a log", size) == size
    assert "DETENT_READ_LIMITS=16" in refusal(readers.takes, path, 3 * size).remedy
    monkeypatch.delenv("DETENT_READ_LIMITS")
    os.truncate(path, 30_000_000)
    assert apart.read_apart(readers.takes, path, "a log", size) == size
    assert apart.limits_of(30_000_000) == (63.0, 170_000_000, 1.0)


@pytest.mark.parametrize("stated", ["", "much", "0", "-1", "nan", "inf"])
def test_an_environment_that_states_no_number_is_told(path, monkeypatch, stated):
    monkeypatch.setenv("DETENT_READ_LIMITS", stated)
    with pytest.raises(DetentError, match="DETENT_READ_LIMITS: got"):
        apart.read_apart(readers.whoami, path, "a log")


@pytest.mark.parametrize(
    ("reader", "said"),
    [(readers.crashes, "SIGSEGV"), (readers.leaves, "status 3"), (readers.stumbles, "KeyError: 'log.bin'")],
)
def test_a_reader_that_breaks_down(path, reader, said):
    assert refusal(reader, path).got == f"a file that crashed its reader ({said})"


def test_a_refusal_comes_back_as_it_is(path):
    assert refusal(readers.refuses, path).got == "this"


def test_nothing_but_plain_values_comes_back(path):
    assert refusal(readers.answers_evil, path).got.endswith("crashed its reader (posix.system is no plain value)")


def test_an_absent_file_is_the_readers_affair(tmp_path):
    with pytest.raises(KeyError):
        apart.read_apart(readers.stumbles, tmp_path / "nowhere", "a log")


def test_ctrl_c_ends_the_reading_too(path, request):
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # programs in the background ignore it
    request.addfinalizer(lambda: signal.signal(signal.SIGINT, before))
    process, _ = apart.read_apart(readers.whoami, path, "a log")
    threading.Timer(0.2, os.kill, (os.getpid(), signal.SIGINT)).start()
    with pytest.raises(KeyboardInterrupt):
        apart.read_apart(readers.sleeps, path, "a log")
    with pytest.raises(ChildProcessError):
        os.waitpid(process, os.WNOHANG)


def test_many_numbers_come_back_bit_for_bit(path):
    found = apart.read_apart(readers.numbers, path, "a log", 1_000_000)
    assert found.tobytes() == np.random.default_rng(1).normal(size=1_000_000).tobytes()


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no forks here")
def test_a_fork_of_the_program_has_a_process_of_its_own(path):
    mine, _ = apart.read_apart(readers.whoami, path, "a log")
    with get_context("fork").Pool(1) as pool:
        its, _ = pool.apply(apart.read_apart, (readers.whoami, path, "a log"))
    assert its != mine
    assert apart.read_apart(readers.whoami, path, "a log")[0] == mine
