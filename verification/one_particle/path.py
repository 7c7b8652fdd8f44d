"""The way of the single cell through failure, as found and as calculated."""

from dataclasses import dataclass

from verification.one_particle.closed_form import Point, Specimen


@dataclass(frozen=True)
class Path:
    """One variant: what the cell did in each of its four steps, and what it should have done."""

    specimen: Specimen
    exact: list[Point]
    found: list[Point]
    potency: list[float]
    volume: float

    @property
    def pulled(self) -> bool:
        """Or pressed."""
        return self.exact[0].strain.axial > 0
