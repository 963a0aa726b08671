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


LARGE_FRAMES = """
00000000 <m0_large>:
       0:	b5f0      	push	{r4, r5, r6, r7, lr}
       2:	4c05      	ldr	r4, [pc, #20]	@ (18 <m0_large+0x18>)
       4:	44a5      	add	sp, r4
       6:	4b04      	ldr	r3, [pc, #16]	@ (1c <m0_large+0x1c>)
       8:	2300      	movs	r3, #0
       a:	449d      	add	sp, r3
       c:	4b03      	ldr	r3, [pc, #12]	@ (1c <m0_large+0x1c>)
       e:	469d      	add	sp, r3
      10:	bdf0      	pop	{r4, r5, r6, r7, pc}
      18:	ffffeda4 	.word	0xffffeda4
      1c:	0000125c 	.word	0x0000125c

00000040 <rv_large>:
      40:	d6010113          	add	sp,sp,-672
      44:	72fd                	lui	t0,0xfffff
      46:	9116                	add	sp,sp,t0
      48:	8082                	ret
"""
AVR = """
00000100 <a_control>:
     100:	cf 93       	push	r28
     102:	df 93       	push	r29
     104:	00 d0       	rcall	.+0      	; 0x106 <a_control+0x6>
     106:	cd b7       	in	r28, 0x3d	; 61
     108:	de b7       	in	r29, 0x3e	; 62
     10a:	2a 97       	sbiw	r28, 0x0a	; 10
     10b:	cd bf       	out	0x3d, r28	; 61
     10c:	0e 94 a0 00 	call	0x140	; 0x140 <a_inner>
     110:	2a 96       	adiw	r28, 0x0a	; 10
     112:	08 95       	ret

00000140 <a_inner>:
     140:	cd b7       	in	r28, 0x3d	; 61
     142:	cc 52       	subi	r28, 0x2C	; 44
     144:	d1 40       	sbci	r29, 0x01	; 1
     145:	cd bf       	out	0x3d, r28
     146:	c4 5d       	subi	r28, 0xD4	; 212
     148:	de 4f       	sbci	r29, 0xFE	; 254
     14a:	08 95       	ret

00000148 <a_middle>:
     148:	cd b7       	in	r28, 0x3d	; 61
     149:	c6 5f       	subi	r28, 0xF6	; 246
     14a:	d1 09       	sbc	r29, r1
     14b:	cd bf       	out	0x3d, r28
     14c:	8d b7       	in	r24, 0x3d	; 61
     14d:	08 97       	sbiw	r24, 0x08	; 8
     14e:	8d bf       	out	0x3d, r24
     14f:	ad b7       	in	r26, 0x3d	; 61
     150:	11 96       	adiw	r26, 0x01	; 1
     151:	8d b7       	in	r24, 0x3d	; 61
     152:	08 97       	sbiw	r24, 0x08	; 8
     153:	8d bf       	out	0x3d, r24
     154:	8d b7       	in	r24, 0x3d	; 61
     155:	40 96       	adiw	r24, 0x10	; 16
     156:	8d bf       	out	0x3d, r24
     157:	8d b7       	in	r24, 0x3d	; 61
     158:	08 97       	sbiw	r24, 0x08	; 8
     159:	8d bf       	out	0x3d, r24
     15a:	08 95       	ret

00000160 <a_leaf>:
     160:	21 97       	sbiw	r28, 0x01	; 1
     162:	08 95       	ret
"""


def test_a_frame_that_no_instruction_can_name_is_that_of_a_register():
    known = routines(LARGE_FRAMES)
    assert {name: one.frame for name, one in known.items()} == {"m0_large": 20 + 0x125C, "rv_large": 672 + 4096}


def test_an_avr_leaves_the_way_back_on_the_stack_and_lowers_a_copy_of_its_pointer():
    known = routines(AVR, back=3)
    assert {name: one.frame for name, one in known.items()} == {
        "a_control": 3 + 2 + 3 + 10, "a_inner": 3 + 0x12C, "a_middle": 3 + 0xF6 + 16, "a_leaf": 3,
    }  # fmt: skip
    assert deepest("a_control", known) == 18 + 303


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
