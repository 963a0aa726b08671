"""Hash over register images: FNV-1a of 64 bits, chained from tick to tick, so that one number stands for all of them.

The image of a register file is its leaves in the order of declaration, each in its width, little endian, no padding.
Fowler, Noll, Vo: the FNV non-cryptographic hash algorithm, draft-eastlake-fnv (2019).
"""

from typing import Any

import numpy as np

from detent.kernel.loop import Bytes
from detent.kernel.registers import Registers, i8, register
from detent.kernel.step import step

FNV_BASIS, FNV_PRIME = 0xCBF29CE484222325, 0x100000001B3
WHOLE = (1 << 64) - 1


class ImageHash(Registers):
    """Hash so far; as a register it wraps at 64 bits, in plain Python too."""

    value: i8 = register("hash of all images so far", unit="code")

    @property
    def number(self) -> int:
        """The same without a sign."""
        return int(self.value) & WHOLE


def begin_hash() -> ImageHash:
    """Hash of nothing."""
    made: Any = ImageHash()
    made.value = FNV_BASIS  # wraps
    return made


@step
def add_rows(h: ImageHash, rows: Bytes, low: Bytes) -> None:
    """Add rows of images, one per tick; the low byte of the hash after each goes to `low`."""
    for k in range(rows.shape[0]):
        for n in range(rows.shape[1]):
            h.value = (h.value ^ int(rows[k, n])) * FNV_PRIME
        low[k] = h.value & 0xFF


def add_bytes(h: ImageHash, image: bytes) -> None:
    """Add one image."""
    add_rows(h, np.frombuffer(image, np.uint8)[None, :], np.zeros(1, np.uint8))
