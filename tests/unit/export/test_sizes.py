"""Stack and bytes over machine code as objdump lists it, and sizes of objects as the binutils tell them."""

import pytest

from detent.export import sizes
from detent.export.sizes import Sizes, deepest, reached, routines, sizes_of

LISTING = """
00000100 <t_control>:
     100:	b5f0      	push	{r4, r5, r6, r7, lr}
     102:	b085      	sub	sp, #20
     104:	f000 f8a0 	bl	140 <t_inner>
     108:	f000 f8a0 	bl	160 <__aeabi_dadd>
     10c:	bdf0      	pop	{r4, r5, r6, r7, pc}

00000140 <t_inner>:
     140:	e92d 41f0 	stmdb	sp!, {r4-r8, lr}
     144:	ed2d 8b04 	vpush	{d8-d9}
     148:	e7fe      	b.n	148 <t_inner+0x8>
     14a:	bf00      	nop

00000150 <__aeabi_dsub>:
     150:	f081 4100 	eor.w	r1, r1, #2147483648
00000160 <__aeabi_dadd>:
     160:	f84d 4d08 	str.w	r4, [sp, #-8]!
     164:	4770      	bx	lr
"""
RISC_V = """
80000000 <r_control>:
80000000:	1101                	addi	sp,sp,-32
80000002:	c50c                	sw	a1,8(a0)
80000004:	8082                	ret
"""


def test_the_deepest_path_counts_and_what_falls_through_goes_on():
    known = routines(LISTING) | routines(RISC_V)
    assert {name: one.frame for name, one in known.items()} == {
        "t_control": 40, "t_inner": 24 + 16, "__aeabi_dsub": 0, "__aeabi_dadd": 8, "r_control": 32,
    }  # fmt: skip
    assert deepest("t_control", known) == 40 + 40
    assert deepest("__aeabi_dsub", known) == 8
    assert deepest("gone", known) == 0
    assert known["t_inner"].calls == set()


def test_a_routine_brings_all_that_it_calls():
    known = routines(LISTING)
    assert reached(["__aeabi_dsub", "gone"], known) == {"__aeabi_dadd": 0x166 - 0x160, "__aeabi_dsub": 0x10}


def test_a_jump_back_is_no_recursion():
    known = routines("00000000 <a>:\n 0:\tb510\tpush\t{r4, lr}\n 2:\te000\tb.n\t6 <b>\n"
                     "00000006 <b>:\n 6:\tb410\tpush\t{r4}\n 8:\te7fa\tb.n\t0 <a>\n")  # fmt: skip
    assert deepest("a", known) == 12


def test_sizes_are_those_of_the_objects(monkeypatch, tmp_path):
    said = {
        ("x-size", "-A", "unit.o"): (
            "unit.o  :\nsection size addr\n.text 480 0\n.rodata.a 20 0\n.data 4 0\n.bss 2 0\n.comment 39 0\nTotal 545\n"
        ),
        ("x-nm", "-S", "params.o"): "00000000 00000190 R t_defaults\n",
        ("x-nm", "-S", "replay.o"): "00000008 00000100 b c_\n00000150 00000020 b l_\n00000000 T t_replay\n",
        ("x-nm", "-S", "tables.o"): "00000000 00000040 R t_table\n",
        ("x-nm", "-u", "unit.o"): "         U memcpy\n         U __aeabi_dsub\n",
        ("x-objdump", "-d", "job"): LISTING,
        ("x-readelf", "-sW", "job"): "  12: 00000140  16 OBJECT  LOCAL  DEFAULT    1 t_inner\n",
    }
    monkeypatch.setattr(sizes, "_told", lambda command, _: said[tuple(command)])
    for part in ("params.o", "replay.o", "tables.o"):
        (tmp_path / part).touch()
    found = sizes_of("x-", tmp_path, ["t_control", "t_none"], "job", 100)
    library = {"__aeabi_dadd": 6, "__aeabi_dsub": 16}
    assert found == Sizes(480, 20, 6, 0x190 - 100, 100 + 0x40, 0x120, {"t_control": 48}, library)
    assert found.flash == 500
    assert sizes_of("x-", tmp_path, ["t_control"]).stack == {}


@pytest.mark.parametrize("told", ["", "text data bss dec\n"])
def test_without_binutils_there_is_nothing_to_say(monkeypatch, tmp_path, told):
    monkeypatch.setattr(sizes, "_told", lambda *_: told)
    assert sizes_of("", tmp_path, []) == Sizes()
