"""The worst machine of a sample and beyond, and its file."""

import pytest
from tests.tolerance_rig import SHORT, asked, quick

import detent
from detent.errors import DetentError
from detent.files.marks import is_signed
from detent.tune.batch import Limit, run_chunk
from detent.tune.worst import worst, worst_text, write_worst

TABLE = """
[tolerance]
"mechanics.load_mass" = "10 %"
"mechanics.load_friction.positive.coulomb" = "30 %"
"drive.delay" = [0, 2]
"""


def test_the_worst_is_an_end_and_its_file_says_why(tmp_path):
    question = asked(tmp_path, TABLE, SHORT, quick())
    chunk = run_chunk(question, 0, 3)
    found = worst(question, [chunk], ["peak_command", "peak_speed"])
    assert [one.quantity for one in found] == ["peak_command", "peak_speed"]
    for one in found:
        assert one.value >= one.sampled == chunk.results[one.quantity].max()
        assert one.value == run(question, one.values)[one.quantity]
    assert found[0].value > found[0].sampled
    file = write_worst(question, found[0], tmp_path / "worst.toml")
    assert detent.load(file).run(SHORT, every=0).result.figures()["peak_command"] == found[0].value
    text = worst_text(question, found[0], "moves.csv", "worst.toml")
    assert is_signed(text)  # another search may replace it, unless a person has edited it
    assert f"\n# The machine with the largest peak_command found: {found[0].value!r} V\n" in text
    assert "detent run worst.toml --job moves.csv" in text
    assert "30 kg before: in 27 kg to 33 kg" in text
    assert "at its ratio to Coulomb friction" in text
    assert "model]\nmass = " in text


def run(question, values):
    return question.method.run(question.machine(values).spec, question.job).figures()


def test_where_the_least_is_the_worst(tmp_path):
    question = asked(tmp_path, TABLE, SHORT, quick(), limits=[Limit("peak_speed", 0.01, least=True)])
    chunk = run_chunk(question, 0, 2)
    found = worst(question, [chunk], ["peak_speed"])[0]
    assert found.least
    assert found.value <= found.sampled == chunk.results["peak_speed"].min()


def test_what_no_case_has_is_left_out_and_an_unknown_name_refused(tmp_path):
    question = asked(tmp_path, '[tolerance]\n"encoder.delay" = [0, 62]\n', SHORT, quick())
    chunk = run_chunk(question, 1, 2)
    chunk.results["error"][:] = float("nan")
    assert worst(question, [chunk], ["error"]) == []
    with pytest.raises(DetentError, match="one of done, time_end, peak_following"):
        worst(question, [chunk], ["eror"])


def test_a_value_outside_its_interval_and_one_given_with_set(tmp_path):
    normal = '[tolerance]\n"mechanics.load_mass" = { interval = ["29 kg", "31 kg"], distribution = "normal" }\n'
    file = tmp_path / "slide.toml"
    asked(tmp_path, normal, SHORT, quick())
    axis = detent.load(file, ["drive.command_step=0 V"])
    question = type(asked(tmp_path, normal, SHORT, quick())).of(axis.file, SHORT)
    chunk = run_chunk(question, 0, 1)
    found = worst(question, [chunk], ["peak_command"])[0]
    far = type(found)(found.quantity, found.value, found.sampled, 0, {"mechanics.load_mass": 35.0})
    text = worst_text(question, far, "moves.csv", "worst.toml")
    assert "[tolerance]" not in text
    assert "--set 'drive.command_step=0 V'" in text
    assert "[tolerance]" in worst_text(question, found, "moves.csv", "worst.toml")
