"""HTML pages from templates; those that need nothing else extend templates/base.html.j2."""

from pathlib import Path

import jinja2

BASE = Path(__file__).parent / "templates"


def page_templates(folder: Path) -> jinja2.Environment:
    """The templates of a folder: text is escaped, and a name that a template lacks is an error."""
    return jinja2.Environment(
        loader=jinja2.FileSystemLoader([folder, BASE]),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
