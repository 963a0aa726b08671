"""Stack over a call graph as gcc writes it, and sizes of objects as the binutils tell them."""

import pytest

from detent.export import sizes
from detent.export.sizes import Sizes, sizes_of, stacks

GRAPH = r"""graph: { title: "a/t.c"
node: { title: "a/t.c:t_inner" label: "t_inner\na/t.c:39:16\n24 bytes (static)" }
node: { title: "__aeabi_ldivmod" label: "__aeabi_ldivmod\n<built-in>" shape : ellipse }
edge: { sourcename: "a/t.c:t_inner" targetname: "__aeabi_ldivmod" }
node: { title: "a/t.c:t_other" label: "t_other\na/t.c:50:16\n100 bytes (static)" }
node: { title: "t_control" label: "t_control\na/t.c:60:6\n40 bytes (static)" }
edge: { sourcename: "t_control" targetname: "a/t.c:t_inner" label: "a/t.c:61:23" }
edge: { sourcename: "t_control" targetname: "a/t.c:t_other" label: "a/t.c:62:23" }
edge: { sourcename: "a/t.c:t_other" targetname: "a/t.c:t_inner" label: "a/t.c:51:23" }
node: { title: "t_power_on" label: "t_power_on\na/t.c:70:6\n8 bytes (static)" }
}
"""


def test_the_deepest_path_counts():
    assert stacks(GRAPH, ["t_control", "t_power_on", "t_inner", "gone"]) == {
        "t_control": 164, "t_power_on": 8, "t_inner": 24,
    }  # fmt: skip


def test_sizes_are_those_of_the_objects(monkeypatch, tmp_path):
    said = {
        ("x-size", "unit.o"): "text data bss dec\n 500 4 2 506\n",
        ("x-nm", "-S", "params.o"): "00000000 00000190 R t_defaults\n",
        ("x-nm", "-S", "replay.o"): "00000008 00000100 b c_\n00000150 00000020 b l_\n00000000 T t_replay\n",
        ("x-nm", "-u", "unit.o"): "         U memcpy\n         U __aeabi_dadd\n",
    }
    monkeypatch.setattr(sizes, "_told", lambda command, _: said[tuple(command)])
    assert sizes_of("x-", tmp_path, []) == Sizes(500, 6, 0x190, 0x120, {}, ("__aeabi_dadd", "memcpy"))
    (tmp_path / "unit.ci").write_text(GRAPH)
    assert sizes_of("x-", tmp_path, ["t_power_on"]).stack == {"t_power_on": 8}


@pytest.mark.parametrize("told", ["", "text data bss dec\n"])
def test_without_binutils_there_is_nothing_to_say(monkeypatch, tmp_path, told):
    monkeypatch.setattr(sizes, "_told", lambda *_: told)
    assert sizes_of("", tmp_path, []) == Sizes()
