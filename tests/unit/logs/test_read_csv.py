"""Text tables in all their dialects: separators, decimal signs, headers, units, cells that are no numbers, bad rows."""

import gzip
import math
import tracemalloc

import numpy as np
import pytest

from detent.errors import InputError
from detent.logs.mapping import FileOptions
from detent.logs.read_csv import is_moment, is_number, read_cell, read_column, read_csv, read_moments
from detent.logs.read_log import read_table


@pytest.fixture
def write(tmp_path):
    def write_file(text, name="log.csv"):
        path = tmp_path / name
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return path

    return write_file


def columns(table):
    return {name: values.tolist() for name, values in table.columns.items()}


def refusal(path, options=FileOptions()):  # noqa: B008 - frozen
    with pytest.raises(InputError) as caught:
        read_csv(path, options)
    (problem,) = caught.value.problems
    assert problem.file == str(path)
    assert problem.got
    assert problem.allowed
    assert problem.remedy
    return problem


@pytest.mark.parametrize(
    ("text", "notes"),
    [
        ("t [s],x [mm]\n0.5,1.5\n1,-2.25\n", []),
        ("t [s],x [mm]\r\n0.5,1.5\r\n1,-2.25\r\n", []),
        ("t [s], x [mm] \n 0.5 ,  1.5\n1 ,-2.25\n", []),
        ("t [s],x [mm],\n0.5,1.5,\n1,-2.25,\n", []),
        ('"t [s]","x [mm]"\n"0.5","1.5"\n"1","-2.25"\n', []),
        ("t [s];x [mm]\n0,5;1,5\n1;-2,25\n", ["separator semicolon", "decimal comma"]),
        ("t [s];x [mm]\n0.5;1.5\n1;-2.25\n", ["separator semicolon"]),
        ("t [s]\tx [mm]\n0.5\t1.5\n1\t-2.25\n", ["separator tab"]),
        ("t [s]|x [mm]\n0.5|1.5\n1|-2.25\n", ["separator bar"]),
        ('"t [s]","x [mm]"\n"0,5","1,5"\n1,"-2,25"\n', ["decimal comma"]),
        ("﻿t [s],x [mm]\n5e-1,15.0E-1\n1.0D0,-2.25\n", []),
        (
            "# made by a logger\n# rate 2 Hz\n# t [s],x [mm]\n0.5,1.5\n# a remark\n\n1,-2.25\n",
            ["2 lines above the header skipped"],
        ),
        ("Recorder 3000\nChannels,2\n\nt [s],x [mm]\n0.5,1.5\n1,-2.25\n", ["2 lines above the header skipped"]),
    ],
)  # fmt: skip
def test_dialects(write, text, notes):
    table = read_csv(write(text), FileOptions())
    assert columns(table) == {"t [s]": [0.5, 1.0], "x [mm]": [1.5, -2.25]}
    assert table.units == {"t [s]": "s", "x [mm]": "mm"}
    assert table.notes == notes
    assert table.rows.tolist() == [1, 2]
    assert table.broken == []


def test_separated_by_blanks(write):
    table = read_csv(write("t(s)   x(mm)\n 0.5    1.5\n 1     -2.25\n"), FileOptions())
    assert columns(table) == {"t(s)": [0.5, 1.0], "x(mm)": [1.5, -2.25]}
    assert table.units == {"t(s)": "s", "x(mm)": "mm"}
    assert table.notes == ["separator space"]


@pytest.mark.parametrize("units", ["[s];[mm]", "(s);(mm)", "s;mm"])
def test_units_in_a_line_of_their_own(write, units):
    table = read_csv(write(f"time;position\n{units}\n0,5;1,5\n1;-2,25\n"), FileOptions())
    assert columns(table) == {"time": [0.5, 1.0], "position": [1.5, -2.25]}
    assert table.units == {"time": "s", "position": "mm"}


def test_encodings(write):
    for encoding in ("utf-16", "cp1252", "utf-8"):
        table = read_csv(write("t [s],x [µm]\n1,2\n2,3\n".encode(encoding)), FileOptions())
        assert table.units == {"t [s]": "s", "x [µm]": "µm"}
        assert any("Windows-1252" in note for note in table.notes) == (encoding == "cp1252")


def test_packed(write):
    path = write(gzip.compress(b"t,x\n1,2\n2,3\n"), "log.csv.gz")
    assert columns(read_table(path)) == {"t": [1.0, 2.0], "x": [2.0, 3.0]}


def test_no_header_gives_numbered_columns(write):
    table = read_csv(write("1,2,3\n2,3,4\n"), FileOptions())
    assert list(table.columns) == ["column 1", "column 2", "column 3"]
    assert table.notes == ["no header: columns are named by their numbers"]


def test_stated_layout_is_not_guessed(write):
    options = FileOptions(separator=";", decimal=",", header=2)
    table = read_csv(write("a;b\nt;x\n1;2\n2;3,5\n"), options)
    assert columns(table) == {"t": [1.0, 2.0], "x": [2.0, 3.5]}
    assert table.notes == []
    table = read_csv(write("1;2\n2;3,5\n"), FileOptions(header=0))
    assert columns(table) == {"column 1": [1.0, 2.0], "column 2": [2.0, 3.5]}


def test_header_beyond_the_file(write):
    problem = refusal(write("t,x\n1,2\n"), FileOptions(header=9))
    assert problem.got == "no lines below the header"


def test_a_comma_that_is_no_decimal_sign_is_refused_as_a_cell(write):
    rows = "".join(f"{k}.5;{k}\n" for k in range(20))
    table = read_csv(write(f"t;x\n{rows}1,5;3\n"), FileOptions(decimal="."))
    assert [(row.row, row.reason) for row in table.broken] == [(21, '"1,5" is no number')]


def test_missing_and_broken_cells(write):
    good = "".join(f"{k},{k},{k}\n" for k in range(3, 30))
    text = f"t,x,y\n1,2,\n2,nan,4\n{good}30,#ERR,3\n31,3\n32,3,4,5\n33,3,4,,\n34,NULL,-\n35,inf,1\n36,true,0\n"
    table = read_csv(write(text), FileOptions())
    assert table.rows.tolist() == [*range(1, 30), 33, 34, 35, 36]
    assert np.isnan(table.columns["x"]).nonzero()[0].tolist() == [1, 30, 31]
    assert np.isnan(table.columns["y"]).nonzero()[0].tolist() == [0, 30]
    assert table.columns["x"][-1] == 1.0
    assert table.broken == [
        (30, (30.0, None, 3.0), '"#ERR" is no number'),
        (31, (31.0, 3.0), "2 cells in place of 3"),
        (32, (32.0, 3.0, 4.0, 5.0), "4 cells in place of 3"),
    ]


def test_columns_of_words_and_of_moments(write):
    text = "stamp,state,x\n2024-10-26T12:00:00.5Z,run,1\n2024-10-26 12:00:01,run,2\n2024-10-26T12:00:01.25,stop,3\n"
    table = read_csv(write(text), FileOptions())
    assert list(table.columns) == ["stamp", "x"]
    assert table.units["stamp"] == "ns"
    assert (np.diff(table.columns["stamp"]) * 1e-9).tolist() == [0.5, 0.25]
    assert "text columns skipped: state" in table.notes


def test_nanoseconds_since_1970_stay_exact(write):
    start = 1_700_000_000_123_456_789
    table = read_csv(write(f"t_ns,x\n{start},1\n{start + 1},2\n{start + 1001},3\n"), FileOptions())
    assert table.columns["t_ns"].tolist() == [0, 1, 1001]
    assert table.notes == [f"t_ns: counted from its first value, {start}"]
    table = read_csv(write(f"t_ns,x,state\n{start},1,run\n{start + 1},2,run\n{start + 1001},3,run\n"), FileOptions())
    assert table.notes == [f"t_ns: counted from its first value, {start}", "text columns skipped: state"]


def test_more_cells_than_headings(write):
    table = read_csv(write("t,x\n1,2,3\n2,3,4\n"), FileOptions())
    assert list(table.columns) == ["t", "x", "column 3"]
    assert table.notes == ["the header names 2 columns, the rows have 3: the last ones have no name"]


def test_a_last_column_that_is_always_empty(write):
    table = read_csv(write("t,x,remark\n1,2\n2,3\n"), FileOptions())
    assert list(table.columns) == ["t", "x", "remark"]
    assert np.isnan(table.columns["remark"]).all()


def test_headings_twice(write):
    table = read_csv(write("t,x,x\n1,2,3\n2,3,4\n"), FileOptions())
    assert columns(table) == {"t": [1, 2], "x": [2, 3], "x'": [3, 4]}


def test_blocks_join(write, monkeypatch):
    monkeypatch.setattr("detent.logs.read_csv.BLOCK_ROWS", 7)
    lines = [f"{k},{k * 0.5}" for k in range(50)]
    lines[20] = "x,1"
    table = read_csv(write("\n".join(["t,x", *lines])), FileOptions())
    assert table.rows.tolist() == [k + 1 for k in range(50) if k != 20]
    assert table.columns["x"].tolist() == [k * 0.5 for k in range(50) if k != 20]
    assert [row.row for row in table.broken] == [21]


@pytest.mark.parametrize("end", ["\n", "\r\n"])
@pytest.mark.parametrize("mark", ["", '"'])
@pytest.mark.parametrize("stretch", [0, 3, 40])
def test_a_text_may_be_cut_behind_any_line(write, monkeypatch, end, mark, stretch):
    lines = [
        "# by a logger",
        "t [s],x [mm]",
        *(f"{k},{k * 0.5}" for k in range(9)),
        "",
        "# a remark",
        "9,4.5",
        "word,5",
    ]
    path = write(end.join(f"{mark}{line}{mark}" for line in lines))
    broken = write(end.join(f"{mark}{line}{mark}" for line in [*lines, *["1,2,3"] * 3]), "broken.csv")
    whole, problem = read_csv(path, FileOptions()), refusal(broken)
    monkeypatch.setattr("detent.logs.read_csv.STRETCH", stretch)
    monkeypatch.setattr("detent.logs.read_csv.BLOCK_ROWS", 4)
    table = read_csv(path, FileOptions())
    assert columns(table) == columns(whole)
    assert columns(table)["x [mm]"] == [k * 0.5 for k in range(10)]
    assert (table.rows.tolist(), table.broken, table.notes) == (whole.rows.tolist(), whole.broken, whole.notes)
    assert refusal(broken) == problem
    assert (problem.line, problem.got[:5]) == (15, "word,")


def test_what_a_table_takes_in_memory_is_its_text_and_its_numbers(write, monkeypatch):
    monkeypatch.setattr("detent.logs.read_csv.STRETCH", 10_000)
    monkeypatch.setattr("detent.logs.read_csv.BLOCK_ROWS", 100)
    text = "t [s],x [mm],i [A]\n" + "".join(f"{k * 1e-3:.6f},{k % 7:.6f},{k % 3:.6f}\n" for k in range(20_000))
    monkeypatch.setattr("detent.logs.read_csv.MAX_BYTES", len(text))  # so many are asked for before they are read
    path = write(text)
    read_csv(path, FileOptions())
    tracemalloc.start()
    try:
        table = read_csv(path, FileOptions())
        most = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert table.columns["t [s]"][-1] == 19.999
    assert most < 2.5 * len(text)  # all lines at once would be as much on top


@pytest.mark.parametrize(
    ("data", "got"),
    [
        (b"", "an empty file"),
        (b"  \n\n", "an empty file"),
        (b"t,x\n1,2\n\0\0", "NUL bytes, as in a binary file"),
        (b"a letter\nto a friend, who reads\n", "a letter"),
        (b"t,x\n", "t,x"),
    ],
)
def test_no_tables(write, data, got):
    assert refusal(write(data)).got == got


def test_a_table_that_is_mostly_broken(write):
    problem = refusal(write("t,x\n1,2\n" + "1,2,3,4,5\n3,4\n" * 5))
    assert problem.line == 3
    assert problem.got.startswith("1,2,3,4,5 (")
    assert "5 of 11 rows are broken" in problem.got


def test_too_large(write, monkeypatch):
    path = write("t,x\n" + "1,2\n" * 100)
    monkeypatch.setattr("detent.logs.read_csv.MAX_BYTES", 300)
    assert refusal(path).got == "more than 0 MB"
    monkeypatch.setattr("detent.logs.read_csv.MAX_BYTES", 3000)
    monkeypatch.setattr("detent.logs.raw_table.MAX_CELLS", 150)
    assert refusal(path).got == "2 columns of 100 rows"
    remarks = write("t,x\n" + "1,2\n# a remark\n\n" * 75, "remarks.csv")
    assert len(read_csv(remarks, FileOptions()).rows) == 75
    monkeypatch.setattr("detent.logs.raw_table.MAX_CELLS", 149)
    assert refusal(remarks).got == "2 columns of 75 rows"
    packed = write(gzip.compress(b"t,x\n" + b"1,2\n" * 5000), "bomb.csv.gz")
    assert refusal(packed).got == "more than 0 MB"


def test_damaged_packing(write):
    whole = gzip.compress(b"t,x\n" + b"1,2\n" * 5000)
    assert refusal(write(whole[:-9], "cut.csv.gz")).got.startswith("a damaged packed file")
    assert refusal(write(b"t,x\n1,2\n", "plain.csv.gz")).got.startswith("a damaged packed file")


def test_no_file(tmp_path):
    assert refusal(tmp_path / "gone.csv").got == "no such file"
    (tmp_path / "folder.csv").mkdir()
    assert refusal(tmp_path / "folder.csv").got == "a folder"


def test_cell_too_long(write):
    problem = refusal(write('t,x\n1,2\n2,"' + "3" * 200_000 + '"\n'))
    assert "field larger than field limit" in problem.got


@pytest.mark.parametrize(
    ("cell", "decimal", "value"),
    [("1.5", ".", 1.5), ("-.5", ".", -0.5), ("1,5", ",", 1.5), ("+2e3", ".", 2000.0), ("1.5D-2", ".", 0.015),
     ("off", ".", 0.0), ("TRUE", ".", 1.0), ("1,5", ".", None), ("1.2.3", ".", None), ("0x1F", ".", None),
     ("1_000", ".", None)],
)  # fmt: skip
def test_cells(cell, decimal, value):
    assert read_cell(cell, decimal) == value


def test_cells_that_say_nothing():
    assert all(math.isnan(read_cell(cell, ".")) for cell in ("", "nan", "N/A", "--", "NULL", "Inf"))
    assert is_number("1,5")
    assert not is_number("")
    assert is_moment("2024-01-02 03:04:05")
    assert not is_moment("2024-01-02")


def test_pieces_of_columns():
    values, wrong = read_column(["1", "x", ""], ".")
    assert (values[0], wrong) == (1.0, {1})
    values, wrong = read_column([str(2**60), str(2**60 + 1)], ".")
    assert (values.dtype.kind, int(values[1]), wrong) == ("i", 2**60 + 1, set())
    values, wrong = read_column(["1e30", "2e30"], ".")
    assert (values.dtype.kind, wrong) == ("f", set())
    moments, wrong = read_moments(["2024-13-02 03:04:05"])
    assert np.isnat(moments).all()
    assert wrong == {0}
    moments, wrong = read_moments(["2024-12-02 03:04:05", "now"])
    assert (np.isnat(moments).tolist(), wrong) == ([False, True], {1})


@pytest.mark.parametrize("sign", ["\u2028", "\x85", "\x1c", "\v"])
def test_a_row_ends_where_its_line_ends(write, sign):
    table = read_csv(write(f"t [s],note,x [mm]\n0,one{sign}more,1\n1,two,2\n2,three,3\n"), FileOptions())
    assert columns(table) == {"t [s]": [0, 1, 2], "x [mm]": [1, 2, 3]}
    assert table.broken == []


def test_lines_of_old_programs_end_in_a_carriage_return_alone(write):
    assert columns(read_csv(write("t [s],x [mm]\r0,1\r1,2\r2,3\r"), FileOptions())) == {
        "t [s]": [0, 1, 2],
        "x [mm]": [1, 2, 3],
    }


def test_a_carriage_return_in_a_line_is_a_blank_beside_a_number(write):
    lines = "".join(f"{k},{k}\n" for k in range(300))
    table = read_csv(write(f"t,x\n{lines}300\r,\r300\n301,301\r\r\n"), FileOptions())
    assert columns(table) == {"t": [*range(302)], "x": [*range(302)]}


def test_lines_of_nothing_but_numbers_say_the_same_as_cells_in_quotes(write, monkeypatch):
    """Plain lines are read as one; a line with a word, too few cells or no value takes its block the other way."""
    monkeypatch.setattr("detent.logs.read_csv.BLOCK_ROWS", 3)
    whole = ["0,1.5,9007199254740993", "1, 2.5 ,9007199254740995", "2,-3e2,9007199254740997"]
    lines = [*whole, "3,,4", "4,5,6", "5,word,7", "6,1", "7,2,3", "8,4,5"]
    plain = read_csv(write("\n".join(["t,q,n", *lines])), FileOptions())
    quoted = read_csv(write("\n".join(['"t",q,n', *lines])), FileOptions())
    assert plain.columns.keys() == quoted.columns.keys() == {"t", "q", "n"}
    for name, values in plain.columns.items():
        np.testing.assert_array_equal(values, quoted.columns[name])
    assert plain.broken == quoted.broken
    assert [one.row for one in plain.broken] == [6, 7]
    assert plain.rows.tolist() == quoted.rows.tolist() == [1, 2, 3, 4, 5, 8, 9]
