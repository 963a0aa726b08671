"""What an identification leaves: an axis file, a job that shows the rest."""

from typing import Any


def render(template: str, **values: Any) -> str:
    """Text of a file by its template, which looks like the file."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    templates = Environment(  # noqa: S701 - no page
        loader=PackageLoader("detent.identify.write", "template"),
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=StrictUndefined,
        keep_trailing_newline=True,
    )
    return templates.get_template(template).render(values)
