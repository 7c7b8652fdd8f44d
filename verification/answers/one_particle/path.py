"""The path of the single cell through failure, as computed and as calculated by hand."""

from dataclasses import dataclass

from verification.answers.one_particle.closed_form import Point, Specimen


@dataclass(frozen=True)
class Path:
    """One variant: points by hand (`exact`) and of the cell (`found`) after each step, and potency by step, m3."""

    specimen: Specimen
    exact: list[Point]
    found: list[Point]
    potency: list[float]
    volume: float

    @property
    def pulled(self) -> bool:
        """Whether the cell is pulled rather than pressed."""
        return self.exact[0].strain.axial > 0
