"""Mapping files and options: what is written is what is meant, and every slip is told with its place."""

import pytest

from detent.errors import InputError
from detent.logs.mapping import Choice, ColumnMapping, FileOptions, load_mapping, parse_options

WHOLE = """
[log]
separator = "semicolon"
decimal = ","
header = 3
table = "run1"
period = "1 ms"

[columns]
time = "t [ms]"
position = {column = "qm", unit = "0.3125 um", sign = -1, bits = 16, offset = 2, delay = "3 ms"}
force = {column = 4, unit = "N", factor = "gtau"}
velocity = ""

[constants]
gtau = 35
"""


@pytest.fixture
def write(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def write_file(text):
        (tmp_path / "map.toml").write_text(text, encoding="utf-8")
        return "map.toml"

    return write_file


def problems_of(call, *arguments):
    with pytest.raises(InputError) as caught:
        call(*arguments)
    assert all(problem.got and problem.allowed and problem.remedy for problem in caught.value.problems)
    return caught.value.problems


def test_mapping_file(write):
    assert load_mapping(write(WHOLE)) == ColumnMapping(
        columns={
            "time": Choice(column="t", unit="ms"),
            "position": Choice(column="qm", unit="0.3125 um", offset=2.0, sign=-1, bits=16, delay="3 ms"),
            "force": Choice(column="4", unit="N", factor="gtau"),
            "velocity": Choice(column=""),
        },
        file=FileOptions(separator=";", decimal=",", header=3, table="run1", period="1 ms"),
        constants={"gtau": 35.0},
    )


@pytest.mark.parametrize(
    ("option", "mapping"),
    [
        ("position=qm [m]", ColumnMapping({"position": Choice(column="qm", unit="m")})),
        (
            " position = motor angle[ 1.8 deg ] ",
            ColumnMapping({"position": Choice(column="motor angle", unit="1.8 deg")}),
        ),
        ("force=-vir [35.15 N]", ColumnMapping({"force": Choice(column="vir", unit="35.15 N", sign=-1)})),
        ("position=enc(steps)", ColumnMapping({"position": Choice(column="enc(steps)")})),
        ("velocity=", ColumnMapping({"velocity": Choice(column="")})),
        ("time=2", ColumnMapping({"time": Choice(column="2")})),
        ("separator=tab", ColumnMapping(file=FileOptions(separator="\t"))),
        ("separator=;", ColumnMapping(file=FileOptions(separator=";"))),
        ("decimal=comma", ColumnMapping(file=FileOptions(decimal=","))),
        ("header=0", ColumnMapping(file=FileOptions(header=0))),
        ("period=1 ms", ColumnMapping(file=FileOptions(period="1 ms"))),
        ("table=a/b", ColumnMapping(file=FileOptions(table="a/b"))),
    ],
)
def test_options(option, mapping):
    assert parse_options([option]) == mapping


def test_options_override_the_mapping(write):
    mapping = load_mapping(write(WHOLE)).overridden(parse_options(["force=x [N]", "decimal=point", "header=0"]))
    assert mapping.columns["force"] == Choice(column="x", unit="N")
    assert mapping.columns["time"] == Choice(column="t", unit="ms")
    assert mapping.file == FileOptions(separator=";", decimal=".", header=0, table="run1", period="1 ms")


@pytest.mark.parametrize(
    ("text", "line", "key", "got"),
    [
        ('[columns]\nposition = "qm [V]"', 2, "columns.position.unit", "V"),
        ('[columns]\npositon = "qm"', 2, "columns.positon", 'the unknown key "positon"'),
        ("[columns]\nposition = 3", 2, "columns.position", "3"),
        ('[columns]\nposition = {unit = "m"}', 2, "columns.position.column", "nothing"),
        ('[columns.position]\ncolumn = "q"\nunit = "furlong/x"', 3, "columns.position.unit", '"furlong/x"'),
        ("[columns.position]\ncolumn = 0", 2, "columns.position.column", "0"),
        ('[columns.position]\ncolumn = "q"\nsign = 2', 3, "columns.position.sign", "2"),
        ('[columns.position]\ncolumn = "q"\nfactor = 0', 3, "columns.position.factor", "0"),
        ('[columns.position]\ncolumn = "q"\nfactor = true', 3, "columns.position.factor", "true"),
        ('[columns.position]\ncolumn = "q"\noffset = "1 mm"', 3, "columns.position.offset", '"1 mm"'),
        ('[columns.position]\ncolumn = "q"\nbits = 1', 3, "columns.position.bits", "1"),
        ('[columns.position]\ncolumn = "q"\ndelay = 3', 3, "columns.position.delay", "3"),
        ('[columns.position]\ncolumn = "q"\nfaktor = 3', 3, "columns.position.faktor", 'the unknown key "faktor"'),
        ("[columns]\n[log]\nheader = -1", 3, "log.header", "-1"),
        ('[log]\nseparator = "dash"', 2, "log.separator", '"dash"'),
        ("[log]\nseparator = 3", 2, "log.separator", '"3"'),
        ("[log]\ntable = 3", 2, "log.table", "3"),
        ('[log]\nperiod = "0 s"', 2, "log.period", '"0 s"'),
        ('[log]\nperiod = "1 mm"', 2, "log.period", '"1 mm"'),
        ("[log]\nfirst = 1", 2, "log.first", 'the unknown key "first"'),
        ("log = 3", 1, "log", "3"),
        ('[constants]\ngtau = "35"', 2, "constants.gtau", '"35"'),
        ("[coulmns]", 1, "coulmns", "the unknown table [coulmns]"),
        ("[columns]\nposition = qm", 2, "position", "`position = qm`"),
    ],
)
def test_slips_in_mapping_files(write, text, line, key, got):
    (problem,) = problems_of(load_mapping, write(text))
    assert (problem.file, problem.line, problem.key) == ("map.toml", line, key)
    assert got in problem.got or problem.got in got


def test_all_slips_are_told_at_once(write):
    found = problems_of(load_mapping, write('[log]\nheader = "x"\nperiod = 3\n[columns]\nx = "y"\n'))
    assert [problem.line for problem in found] == [2, 3, 5]
    assert found[2].remedy.startswith("remove it")


def test_files_that_are_no_mapping(write, tmp_path):
    assert problems_of(load_mapping, "gone.toml")[0].got == "no such file"
    assert problems_of(load_mapping, write(""))[0].got == "an empty file"
    assert problems_of(load_mapping, write("[[[ no toml"))[0].line == 1
    (tmp_path / "map.toml").write_bytes(b"\xff\xfe\x00")
    assert problems_of(load_mapping, "map.toml")[0].got == "the byte 0xFF"


@pytest.mark.parametrize(
    ("option", "got", "remedy"),
    [
        ("position", '"position"', "write SIGNAL=COLUMN [UNIT]"),
        ("positon=qm", 'the unknown key "positon"', 'did you mean "position"?'),
        ("force=x [mm]", '"x [mm]"', "write a unit as in [mN]"),
        ("torque=x [mm]", '"x [mm]"', "write a unit as in [mN*m]"),
        ("position=x [V]", '"x [V]"', "write a unit as in [mm], or one of counts"),
        ("command=x [V]", '"x [V]"', "write a unit as in [%]"),
        ("header=two", '"two"', "write the number without quotes"),
        ("period=fast", '"fast"', "write a time as"),
    ],
)
def test_slips_in_options(option, got, remedy):
    (problem,) = problems_of(parse_options, [option])
    assert (problem.file, problem.key, problem.got) == ("option", option, got)
    assert problem.remedy.startswith(remedy)


def test_all_options_are_looked_at():
    assert len(problems_of(parse_options, ["a=1", "position=q [m]", "b=2"])) == 2
