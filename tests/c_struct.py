"""C99 declarations of register files, so that a program in C works on the same memory."""

from detent.kernel.registers import Field, Registers


def c_struct(*registers: type[Registers]) -> str:
    """Declarations of these structures and of the blocks in them, inner ones first, each once."""
    found: dict[str, str] = {}
    for one in registers:
        _declare(one, found)
    return "".join(found.values())


def _declare(block: type[Registers], found: dict[str, str]) -> None:
    body = "".join(_member(field, found) for field in block.__fields__.values())
    found.setdefault(block.__name__, f"typedef struct {{\n{body}}} {block.__name__};\n")


def _member(field: Field, found: dict[str, str]) -> str:
    if field.block is not None:
        _declare(field.block, found)
        return f"    {field.block.__name__} {field.name};\n"
    array = f"[{field.length}]" if field.length else ""
    return f"    {field.width.c_name if field.width else ''} {field.name}{array};\n"
