"""From a specification back to the text of an axis file that gives the same specification."""

import json
from decimal import Decimal
from typing import cast

from pydantic.fields import FieldInfo

from detent.axisfile.tables import AxisSpec
from detent.files.fields import Table, file_key, is_named, table_of, unit_of


def dump_spec(spec: AxisSpec) -> str:
    """Write a specification as an axis file, with every value stated in SI units."""
    return "\n".join(_table_lines(spec, ())).lstrip("\n") + "\n"


def _table_lines(table: Table, path: tuple[str, ...]) -> list[str]:
    """Lines of a table: its header, its values, then the tables below it."""
    values: list[str] = []
    below: list[str] = []
    for name, field in type(table).model_fields.items():
        value: object = getattr(table, name)
        key = file_key(name, field)
        if isinstance(value, Table):
            below += _table_lines(value, (*path, key))
        elif is_named(field):
            for own, held in cast("dict[str, Table]", value).items():
                below += _table_lines(held, (*path, key, own))
        elif value is not None and table_of(field) is None:
            values.append(f"{key} = {_value_text(field, value)}")
    # A table of the user's own is there even if it states nothing: its name says something.
    header = ["", f"[{'.'.join(path)}]"] if path and (values or not below) else []
    return header + values + below


def _value_text(field: FieldInfo, value: object) -> str:
    """Write a value as TOML.

    ``repr`` of a float is the shortest text that reads back as the same float; that of a list of whole numbers is TOML.
    """
    unit = unit_of(field)
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float) and unit:
        number = str(Decimal(repr(value)) * 100) if unit == "%" else repr(value)
        return f'"{number} {unit}"'
    if isinstance(value, list) and unit:
        return f"[{', '.join(_value_text(field, one) for one in cast('list[float]', value))}]"
    if isinstance(value, str):
        # JSON's escapes are TOML's, as long as characters outside ASCII stay as they are.
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    return repr(cast("object", value))
