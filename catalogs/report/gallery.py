"""The figures of a page: one by one into a folder, those of several sections at the same time."""

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from catalogs.figures import style
from common.processes import call_all


class Gallery:
    """Saves figures one by one, so that only one is in memory, and remembers which files are its own."""

    def __init__(self, folder: Path):
        self.folder = folder
        self.names: list[str] = []

    def add(self, name: str, figure: Figure) -> dict[str, str]:
        """File name and data URI of a saved figure."""
        self.names.append(f"{name}.svg")
        width = f"{figure.get_figwidth() * 96:.0f}"
        return {"name": self.names[-1], "uri": style.save(figure, self.folder / self.names[-1]), "width": width}


def draw_sections(sections: Mapping[str, Callable[[Gallery], Any]], folder: Path, processes: int) -> dict[str, Any]:
    """Return values of sections by name, with their figures saved in the folder; drawn in so many processes.

    Figures of an earlier report that this one no longer has are removed.
    """
    with style.applied():
        drawn = call_all({name: partial(_draw, section, folder) for name, section in sections.items()}, processes)
    names = {name for _, saved in drawn.values() for name in saved}
    for path in folder.glob("*.svg"):
        if path.name not in names:
            path.unlink()
    return {name: shown for name, (shown, _) in drawn.items()}


def _draw(section: Callable[[Gallery], Any], folder: Path) -> tuple[Any, list[str]]:
    """Return value of a section, drawn with a gallery in the folder, and the names of its figures' files."""
    gallery = Gallery(folder)
    return section(gallery), gallery.names
