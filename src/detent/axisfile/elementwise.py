"""What plain numbers and arrays of them are both put to, so that one text builds one machine or thousands.

A number stays the number of Python that it is; an array gives, place by place, the same bits. NumPy loads only where
there is an array.
"""

import math
from typing import Any


def is_array(*values: Any) -> bool:
    """Whether one of them is an array."""
    return any(getattr(value, "ndim", 0) for value in values)


def least(first: Any, second: Any) -> Any:
    """The smaller of two."""
    return _numpy().minimum(first, second) if is_array(first, second) else min(first, second)


def most(first: Any, second: Any) -> Any:
    """The larger of two."""
    return _numpy().maximum(first, second) if is_array(first, second) else max(first, second)


def root(value: Any) -> Any:
    """The square root."""
    return _numpy().sqrt(value) if is_array(value) else math.sqrt(value)


def up(value: Any) -> Any:
    """Rounded up to a whole number."""
    return _numpy().ceil(value).astype("int64") if is_array(value) else math.ceil(value)


def nearest(value: Any) -> Any:
    """Rounded to the nearest whole number, halves to the even one."""
    return _numpy().rint(value).astype("int64") if is_array(value) else round(value)


def _numpy() -> Any:
    import numpy as np

    return np
