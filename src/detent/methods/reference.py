"""The reference of the axis file: one row per key, from the declarations themselves."""

from dataclasses import dataclass

from detent.files.fields import describe_allowed, example_of, leaf_fields, unit_of
from detent.files.problems import default_text, dotted
from detent.methods.registry import METHODS


@dataclass(frozen=True, slots=True)
class ReferenceRow:
    """One key of the axis file."""

    key: str  # dotted key
    unit: str  # SI unit the value is converted to; empty for numbers, words and switches
    default: str  # value that holds when the key is left out; empty when it must be stated
    required: bool  # True when it must be stated (in its table, if that is given at all)
    doc: str  # meaning
    allowed: str  # what it may be
    example: str  # a value as TOML text, for keys that must be stated


def reference_rows(method: str) -> tuple[ReferenceRow, ...]:
    """All keys a method's axis file knows, in the order of the schema.

    >>> row = reference_rows("print_head")[3]
    >>> row.key, row.unit, row.required
    ('limits.travel', 'm', True)
    """
    return tuple(
        ReferenceRow(
            key=dotted(path),
            unit=unit_of(field),
            default=default_text(field),
            required=field.is_required(),
            doc=field.description or "",
            allowed=describe_allowed(field),
            example=example_of(field),
        )
        for path, field in leaf_fields(METHODS[method].spec)
    )
