"""The views of the panel, as far as they can be looked at without a browser."""

import math
import re
from importlib.resources import files

import pytest

import detent
from detent.methods.load import read_axis
from detent.methods.method import Live
from detent.methods.registry import METHODS
from detent.operate.host import operation_params

EXAMPLES = ("cascade", "filtered_servo", "phase_servo", "print_head", "rotary_table", "zoom")
PREFIX = re.compile(r'const (\w) = "(controller\.[\w.]*)";')
CHANNEL = re.compile(r"controller\.[a-z_]+(?:\.[a-z_0-9]+)*")


@pytest.fixture(params=EXAMPLES)
def axis(request: pytest.FixtureRequest) -> tuple[str, Live]:
    """An axis at power-on, and the script of its method's view."""
    spec = read_axis(detent.example(f"{request.param}.toml"), ()).spec
    method = METHODS[spec.axis.method]
    made = method.brought(method.lives)(spec, operation_params(careful=1))
    script = files(type(method).__module__.rpartition(".")[0]).joinpath("panel.js").read_text(encoding="utf-8")
    return script, next(iter(made.values()))


def test_an_axis_says_how_fast_it_goes_and_what_its_view_shows(axis: tuple[str, Live]) -> None:
    script, live = axis
    assert 0.0 < live.speed < math.inf
    assert live.view["title"]
    wanted = re.search(r"const \{ ([\w, ]+) \} = link\.about\.view\.data", script)
    assert set(wanted[1].split(", ") if wanted else ()) == set(live.view.get("data", {}))


def test_the_view_of_a_method_watches_registers_that_there_are(axis: tuple[str, Live]) -> None:
    script, live = axis
    for name, place in PREFIX.findall(script):
        script = script.replace(f"${{{name}}}", place)
    script = PREFIX.sub("", script)
    watched = set(CHANNEL.findall(script))
    assert 2 <= len(watched) <= 8
    assert watched <= {leaf.path for leaf in type(live.state).leaves() if not leaf.length}
