"""The settings of event extraction, checked once."""

from dataclasses import dataclass

from pipeline.errors import InputError

NEEDED = ("mine", "closeness", "cluster", "seismic_fraction", "frame")


@dataclass(frozen=True)
class EventSettings:
    """How plastic strain becomes events.

    mine: its name; closeness: least tensor cosine of a family member to its leader; cluster: see seismic.clusters;
    seismic_fraction: share alpha of the stress drop's potency that is seismic; frame: the mine's place on Earth;
    thickness: m, of a two-dimensional scene, else None.
    """

    mine: str
    closeness: float
    cluster: dict
    seismic_fraction: float
    frame: dict
    thickness: float | None = None

    @property
    def dimension(self) -> int:
        """2 (plane strain) or 3."""
        return 3 if self.thickness is None else 2

    @classmethod
    def from_dict(cls, settings: dict) -> "EventSettings":
        """Settings from a plain dict in SI. Raises InputError for missing, unknown or impossible values.

        Closeness and cluster settings are checked where they are used.
        """
        if missing := [name for name in NEEDED if name not in settings]:
            raise InputError(f"seismic settings: {', '.join(missing)} missing: give a value")
        if unknown := sorted(set(settings) - {*NEEDED, "thickness"}):
            raise InputError(f"seismic settings: unknown {', '.join(unknown)}: remove or correct it")
        checked = cls(**settings)
        if not 0.0 < checked.seismic_fraction <= 1.0:
            raise InputError(
                f"seismic.seismic_fraction: {checked.seismic_fraction}: give a share above 0 and at most 1"
            )
        if checked.thickness is not None and not checked.thickness > 0.0:
            raise InputError(f"thickness: {checked.thickness}: give a length above 0 m, or none in three dimensions")
        return checked
