"""The figures of a page: one by one into a folder."""

from pathlib import Path

from matplotlib.figure import Figure

from catalogs.figures import style


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

    def remove_others(self) -> None:
        """Remove figures of an earlier report that this one no longer has."""
        for path in self.folder.glob("*.svg"):
            if path.name not in self.names:
                path.unlink()
