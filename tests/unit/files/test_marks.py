"""A file that detent did not write stays as it is, unless somebody says that it shall go."""

import json
from collections.abc import Callable, Iterator
from pathlib import Path

import h5py
import numpy as np
import pytest
from matplotlib.figure import Figure
from tests.unit.page.samples import page

import detent
from detent.errors import InputError
from detent.files.marks import IN_C, IN_TOML, is_ours, is_signed, refuse_others, signed
from detent.files.text import check_target, placing, write_text, writing
from detent.methods.registry import METHODS
from detent.page.plots import new_figure
from detent.page.render import write_page
from detent.record.trace import Trace
from detent.record.trace_files import save_trace
from detent.record.waveforms import save_vcd

TOLD = r"got a file that detent did not write, or that was edited since; expected: .* --force"


def trace() -> Trace:
    columns = {"t": np.arange(3.0), "controller.law.command": np.arange(3.0), "tick": np.arange(3)}
    return Trace(columns=columns, units={"t": "s", "controller.law.command": "V", "tick": "tick"})


def draw(path: Path) -> None:
    with new_figure(path, 2.0, 2.0) as figure:
        figure.subplots().plot([0, 1])


def waveforms(path: Path) -> None:
    from tests.unit.record.test_waveforms_vcd import make_waveforms

    save_vcd(make_waveforms(), path)


WRITERS: dict[str, Callable[[Path], object]] = {
    "a.html": lambda path: write_page(path, page()),
    "a.png": draw,
    "a.svg": draw,
    "a.pdf": draw,
    "a.vcd": waveforms,
    "a.h5": lambda path: save_trace(trace(), path),
    "a.hdf5": lambda path: save_trace(trace(), path),
    "a.csv": lambda path: save_trace(trace(), path),
    "a.parquet": lambda path: save_trace(trace(), path),
    "a.toml": lambda path: write_text(path, signed("a = 1\n")),
    "a.h": lambda path: write_text(path, signed("int a;\n", IN_C)),
}


@pytest.mark.parametrize("name", WRITERS)
def test_what_detent_wrote_is_replaced_and_what_others_wrote_is_not(name: str, tmp_path: Path) -> None:
    """Every one of them was replaced without a word."""
    path = tmp_path / name
    if path.suffix == ".parquet":
        pytest.importorskip("pyarrow")
    for _ in range(2):
        WRITERS[name](path)
    assert is_ours(path)
    theirs = b"what took a day"
    path.write_bytes(theirs)
    with pytest.raises(InputError, match=TOLD) as told:
        WRITERS[name](path)
    assert told.value.exit_status == 2
    assert str(told.value).startswith(f"{path}: ")
    assert [(one.name, one.read_bytes()) for one in tmp_path.iterdir()] == [(name, theirs)]


def theirs(folder: Path) -> Iterator[Path]:
    """Files of the same kinds that other programs make."""
    figure = Figure()
    figure.subplots().plot([0, 1])
    for kind in ("png", "svg", "pdf"):
        figure.savefig(folder / f"plot.{kind}", metadata={"Title": "detent"})
        yield folder / f"plot.{kind}"
    with h5py.File(folder / "log.h5", "w") as file:
        file.attrs["made by"] = "a bench with detent 3"
    yield folder / "log.h5"
    for name, text in (
        ("log.csv", "t [s],position [m],force [N]\n0,0,0\n"),
        ("detent.csv", "t [s],controller.law.command [V],my own\n0,0,0\n"),
        ("axis.toml", '[axis]\nname = "detent 0.1.0 wrote this"\n'),
        ("motor.h", "/* made for detent 0.1.0 */\n"),
        ("notes.html", "<html><p>detent 0.1.0</p></html>"),
        ("notes.txt", "detent"),
        ("wave.vcd", "$version other 1 $end\n$comment detent 0.1.0 $end\n"),
    ):
        (folder / name).write_text(text, encoding="utf-8")
        yield folder / name


def test_files_of_other_programs_are_not_taken_for_ones_of_detent(tmp_path: Path) -> None:
    assert [path.name for path in theirs(tmp_path) if is_ours(path)] == []


def test_the_heading_of_a_trace_with_every_register_is_known(tmp_path: Path) -> None:
    """CSV carries no mark: programs that read numbers would take a comment for one of their rows."""
    for method in METHODS.values():
        leaves = {leaf.path: leaf.unit for leaf in method.registers().leaves() if not leaf.length}
        held = Trace(columns={"t": np.zeros(1)} | {name: np.zeros(1) for name in leaves}, units={"t": "s"} | leaves)
        save_trace(held, tmp_path / "trace.csv")
        assert is_ours(tmp_path / "trace.csv"), method.name


def test_a_trace_of_many_columns_and_long_names_is_known(tmp_path: Path) -> None:
    columns = {"t": np.zeros(1)} | {f"controller.number{k}": np.zeros(1) for k in range(300)}
    held = Trace(columns=columns, units={"t": "s"}, attributes={"axis": "a" * 4000, "job": "b" * 4000})
    for kind in ("h5", "csv", "parquet"):
        save_trace(held, tmp_path / f"trace.{kind}")
        assert is_ours(tmp_path / f"trace.{kind}")


def test_an_envelope_is_known_by_its_heading(tmp_path: Path) -> None:
    axis = detent.load(detent.example("stage.toml"))
    name, tables = next(iter(axis.envelopes().items()))
    for kind in ("csv", "h"):
        path = tables.save(tmp_path / f"{name}.{kind}")
        assert is_ours(path)
        text = path.read_text("utf-8")
        path.write_text(text.replace("3", "4", 1) if kind == "h" else f"my {text}", encoding="utf-8")
        with pytest.raises(InputError, match=TOLD):
            tables.save(path)
        tables.save(path, force=True)
        assert path.read_text("utf-8") == text


# ---- texts that people edit


@pytest.mark.parametrize("comment", [IN_TOML, IN_C])
def test_an_edited_text_is_theirs(comment: str) -> None:
    text = "first\nsecond\n"
    made = signed(text, comment)
    assert made.endswith(text)
    assert made.count("\n") == 3
    assert is_signed(made)
    assert signed(made, comment) == made
    for edited in (made + " ", made.replace("second", "third"), made.removesuffix("\n"), text, ""):
        assert not is_signed(edited)


def test_line_ends_and_a_mark_of_the_order_are_no_edits() -> None:
    made = signed("first\nsecond\n")
    windows = "\ufeff" + made.replace("\n", "\r\n")
    assert is_signed(windows)
    assert signed("\ufefffirst\r\nsecond\r\n") == windows


# ---- before the work, and at its end


def test_a_name_is_refused_before_the_work(tmp_path: Path) -> None:
    (tmp_path / "a.png").write_text("mine")
    with pytest.raises(InputError, match=TOLD):
        check_target(tmp_path / "a.png")
    assert check_target(tmp_path / "a.png", force=True)
    with pytest.raises(InputError, match=TOLD), placing(tmp_path, ("b.png", "a.png")):
        pytest.fail("the work began")
    with pytest.raises(InputError, match=TOLD), writing(tmp_path / "a.png"):
        pytest.fail("the work began")
    assert [path.name for path in tmp_path.iterdir()] == ["a.png"]


def test_all_names_are_told_at_once(tmp_path: Path) -> None:
    for name in ("a.png", "b.csv"):
        (tmp_path / name).write_text("mine")
    with pytest.raises(InputError) as told:
        refuse_others([tmp_path / name for name in ("a.png", "b.csv", "c.h5")])
    assert [Path(one.file).name for one in told.value.problems] == ["a.png", "b.csv"]


def test_a_file_that_appears_during_the_work_stays(tmp_path: Path) -> None:
    def work(begin: Callable[[], object], name: str) -> None:
        with begin() as made:  # type: ignore[attr-defined]
            (made / name if made.is_dir() else made).write_text("new")
            (tmp_path / name).write_text("mine")

    for begin, name in ((lambda: writing(tmp_path / "a.png"), "a.png"), (lambda: placing(tmp_path), "b.png")):
        with pytest.raises(InputError, match=TOLD):
            work(begin, name)
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {"a.png": "mine", "b.png": "mine"}


def test_a_file_that_would_only_go_is_refused_too(tmp_path: Path) -> None:
    """A trace beside the report of an earlier run goes with it; one of somebody else went too."""
    (tmp_path / "trace.csv").write_text("t,x\n0,1\n")
    with pytest.raises(InputError, match=TOLD), placing(tmp_path, ("report.html", "trace.csv")):
        pytest.fail("the work began")
    with placing(tmp_path, ("report.html", "trace.csv"), force=True) as made:
        (made / "report.html").write_text("new")
    assert [path.name for path in tmp_path.iterdir()] == ["report.html"]


def test_nothing_and_the_same_bytes_are_no_loss(tmp_path: Path) -> None:
    (tmp_path / "empty.png").touch()
    assert is_ours(tmp_path / "empty.png")
    (tmp_path / "a.txt").write_text("mine")
    with placing(tmp_path) as made:
        (made / "a.txt").write_text("mine")
    assert (tmp_path / "a.txt").read_text() == "mine"


def test_a_link_to_a_file_of_others_is_not_written_through(tmp_path: Path) -> None:
    (tmp_path / "mine.html").write_text("mine")
    (tmp_path / "a.html").symlink_to("mine.html")
    with pytest.raises(InputError, match=TOLD):
        write_page(tmp_path / "a.html", page())
    assert (tmp_path / "mine.html").read_text() == "mine"


def test_a_file_that_cannot_be_read_is_of_others(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_page(tmp_path / "a.html", page())

    def refuse(*_words: object, **_more: object) -> None:
        raise PermissionError

    monkeypatch.setattr(Path, "open", refuse)
    assert not is_ours(tmp_path / "a.html")


def test_a_damaged_file_of_any_kind_is_looked_at_without_a_library(tmp_path: Path) -> None:
    for name in WRITERS:
        for content in (b"PAR1" + b"\xff" * 12, b"\x89HDF", b"\x89PNG" * 3, b"\xff\xfe", b"\0"):
            (tmp_path / name).write_bytes(content)
            assert not is_ours(tmp_path / name)


def test_problems_are_data_for_programs(tmp_path: Path) -> None:
    (tmp_path / "a.png").write_text("mine")
    with pytest.raises(InputError) as told:
        check_target(tmp_path / "a.png")
    assert json.dumps([one.file for one in told.value.problems]) == json.dumps([str(tmp_path / "a.png")])
