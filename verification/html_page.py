"""Pages of the verification. Each is a template of templates/ that extends base.html.j2."""

from collections.abc import Callable
from pathlib import Path

from common.datasets import atomic_path
from common.pages import page_templates

TEMPLATES = Path(__file__).parent / "templates"


def write_page(page: Path, template: str, filters: dict[str, Callable] | None = None, **values) -> None:
    """Fill in a template and write it atomically as a page that refers to no other file."""
    environment = page_templates(TEMPLATES)
    environment.filters |= filters or {}
    text = environment.get_template(f"{template}.html.j2").render(**values)
    with atomic_path(page) as temporary:
        temporary.write_text(text, encoding="utf-8")
