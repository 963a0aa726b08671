from dataclasses import replace

import pytest
from tests.live_rig import SENSORS, memory_folder, open_store, table_of

from detent.errors import DetentError, InputError
from detent.methods.position import PositionSensor, Sensed
from detent.operate.positions import load_positions, save_positions
from detent.operate.rows import MOST_POSITIONS, Position

RULED = SENSORS["absolute"]
TURNED = PositionSensor(sensor="disc", kind=Sensed.ABSOLUTE, scale=2e-5, unit="rad", band=314_159)
TABLE = [Position("1", 0, 0, 1, ""), Position('left "end", 2', 19_999, 3, 1, ""), Position("#3", 7, 0, 0, "")]


@pytest.mark.parametrize("kind", [".csv", ".toml", ".CSV"])
@pytest.mark.parametrize("sensor", [RULED, TURNED], ids=["slides", "turns"])
def test_a_table_comes_back_as_it_was(tmp_path, kind, sensor):
    file = save_positions(tmp_path / f"table{kind}", TABLE, sensor)
    assert load_positions(file, sensor) == [(one.name, one.counts, one.tolerance) for one in TABLE]


def test_import_is_a_step_of_the_table(tmp_path):
    file = save_positions(tmp_path / "table.csv", TABLE, RULED)
    with memory_folder() as folder, open_store(folder / "axis.state", RULED) as store:
        store.take(load_positions(file, RULED))
        assert table_of(store) == {one.name: (one.counts, one.tolerance) for one in TABLE}
        assert len(store.undo()) == 3


def test_people_write_units_or_counts(tmp_path):
    file = tmp_path / "table.csv"
    file.write_text("# loading\nname;position [mm];counts;tolerance [um]\n1;5,5;;10\n2;;12;\n", encoding="utf-8")
    assert load_positions(file, RULED) == [("1", 5500, 10), ("2", 12, 0)]
    file = tmp_path / "table.toml"
    file.write_text('[[position]]\nname = "1"\nposition = "90 deg"\n', encoding="utf-8")
    assert load_positions(file, TURNED) == [("1", 78540, 0)]


def test_numbers_of_any_axis_fit(tmp_path):
    file = tmp_path / "table.csv"
    file.write_text(f"name,counts\n1,{2**63 - 1}\n2,-9223372036854775808\n", encoding="utf-8")
    endless = replace(RULED, ends=None)
    assert load_positions(file, endless) == [("1", 2**63 - 1, 0), ("2", -(2**63), 0)]
    file.write_text(f"name,counts\n1,{2**63}\n", encoding="utf-8")
    with pytest.raises(InputError) as refused:
        load_positions(file, endless)
    assert [(one.line, one.key) for one in refused.value.problems] == [(2, "counts")]


def test_counts_of_another_scale_are_other_places(tmp_path):
    file = save_positions(tmp_path / "table.csv", [Position("1", 5000, 0, 1, "")], RULED)
    other = PositionSensor(sensor="a ruler", kind=Sensed.INCREMENTAL, scale=2e-6)
    with pytest.raises(InputError) as refused:
        load_positions(file, other)
    assert [(one.line, one.key) for one in refused.value.problems] == [(2, "counts")]
    assert "2500 counts" in refused.value.problems[0].allowed


@pytest.mark.parametrize(
    ("text", "key", "line"),
    [
        ("name,position [mm]\n1,2\n1,3\n", "name", 3),
        ("name,position [mm]\n,3\n", "name", 2),
        ("name,position [mm]\na\u202eb,3\n", "name", 2),
        ("name,position [mm]\n1,3\n2,20.006\n", "position", 3),
        ("name,counts\n1,-6\n", "counts", 2),
        ("name,position [mm],counts\n1,,\n", "position", 2),
        ("name,position [s]\n1,3\n", "", 1),
        ("name,position\n1,3\n", "", 1),
        ("number,angle\n1,3\n", "", 1),
        ("", "", 0),
        ("name,position [mm]\n", "", 0),
        ("\n".join(["name,counts", *(f"{k},{k}" for k in range(MOST_POSITIONS + 1))]), "", 0),
    ],
)
def test_what_is_no_table_is_told_with_its_place(tmp_path, text, key, line):
    file = tmp_path / "table.csv"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as refused:
        load_positions(file, RULED)
    problem = refused.value.problems[0]
    assert (problem.key, problem.line) == (key, line)
    assert problem.remedy


def test_places_for_a_table(tmp_path):
    with pytest.raises(DetentError, match="empty"):
        save_positions(tmp_path / "table.csv", [], RULED)
    with pytest.raises(DetentError, match=r"\.txt"):
        save_positions(tmp_path / "table.txt", TABLE, RULED)
