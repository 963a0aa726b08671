"""The same run on the same date leaves the same bytes, whatever the method."""

import shutil
from pathlib import Path

import pytest
from tests.unit.test_cli import call

import detent
from detent.methods.registry import METHODS

pytestmark = pytest.mark.compiled

MOVES = "target [mm],dwell [ms]\n25,20\n22,20\n"
JOBS = {
    "cascade": MOVES,
    "filtered_servo": MOVES,
    "phase_servo": "target [in],dwell [ms]\n0.2,20\n0.1,20\n",
    "print_head": "One line\nand another\n",
    "rotary_table": '[[step]]\ngo = 1\n[[step]]\nwait = "50 ms"\n[[step]]\ngo = 2\n',
    "stepper_envelope": '[[move]]\ngroup_a = "2 mm"\n[[move]]\ngroup_b = "1 mm"\n',
}
AXES = {"stepper_envelope": "zoom"}  # of the others the example has the name of the method


def test_every_method_is_here() -> None:
    assert sorted(JOBS) == sorted(METHODS)


@pytest.mark.parametrize("method", JOBS)
def test_two_runs_of_one_date_leave_the_same_bytes(
    method: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Report, traces of each kind and JSON; and of another date others, in which nothing else is other."""
    job = JOBS[method]
    name = f"job.{'toml' if '[[' in job else 'csv' if ',' in job else 'txt'}"
    said: list[str] = []
    left: list[dict[str, bytes]] = []
    for date in ("86400", "86400", "172800"):
        monkeypatch.setenv("SOURCE_DATE_EPOCH", date)
        folder = tmp_path / "here"
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir()
        monkeypatch.chdir(folder)
        Path(name).write_text(job, encoding="utf-8")
        shutil.copy(detent.example(f"{AXES.get(method, method)}.toml"), "axis.toml")
        answer = call("run", "axis.toml", "--job", name, "--trace", "h5,csv", "-o", "out", "--no-compare", "--json")
        assert answer.status == 0, answer
        said.append(answer.out)
        left.append({path.name: path.read_bytes() for path in sorted(Path("out").iterdir())})
    assert len(left[0]) >= 3
    assert said[0] == said[1]
    for file, content in left[0].items():
        assert content == left[1][file], f"{file} differs"
    assert left[0].keys() == left[2].keys()
    assert said[0].replace("1970-01-02", "1970-01-03") == said[2]
