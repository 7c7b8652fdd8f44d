"""Settings of event extraction: the section `seismic` of a mine file, and the slice of the stages that use it."""

from typing import Literal, Self

from pydantic import model_validator

from common.frame import Frame
from common.setting_types import Settings, Size, real_number, refusal, whole_number

Positive = whole_number(ge=1, le=1_000_000)
DEFAULT_LINK_LENGTH = 4.0  # m; about half of the error of most recorded locations


class ClusterSettings(Settings):
    """How a family is separated into events (seismic.clusters), with method `families` only."""

    method: Literal["dbscan", "single_linkage", "kmeans"] = "dbscan"
    """`dbscan`: places with many particles. `single_linkage`: all particles that a chain of distances within the radius
    connects. `kmeans`: compact clusters."""
    radius_cells: real_number(gt=0, le=1000) = 1.8
    """Largest distance between neighbours, in particle spacings."""
    min_samples: Positive = 3
    """Smallest number of particles within the radius that makes a dense place (dbscan). Smaller events are not
    resolved."""
    clusters: Positive = None
    """Number of clusters of each family, with kmeans only. Default: as many as dbscan finds."""

    @model_validator(mode="after")
    def _counted(self) -> Self:
        if self.clusters is not None and self.method != "kmeans":
            raise refusal(f"method {self.method} finds their number itself; leave it out, or use kmeans", "clusters")
        return self


class SeismicSettings(Settings):
    """How plastic strain becomes events."""

    method: Literal["simultaneous", "families"] = "simultaneous"
    """How failed rock is grouped into events. `simultaneous`: rock that fails in one part of the step (solver.parts),
    hangs together, and has similar mechanisms. `families` (the paper's): rock of similar mechanisms anywhere in the
    mine, then clusters in space."""
    link_length: Size = None
    """Largest distance of rock that hangs together, m, and size of the surroundings whose mechanism counts; two of the
    finest cells or more. Default: 4 m, but at least two and at most eight of the finest cells. With method
    `simultaneous` only."""
    closeness: real_number(gt=0, lt=1) = 0.8
    """Cosine between potency tensors above which mechanisms count as similar."""
    least_particles: Positive = 3
    """Potency of the smallest resolved event, in particles of the finest cells with the median drop of strength. Method
    `families` uses cluster.min_samples instead."""
    seismic_fraction: real_number(gt=0, le=1) = 1.0
    """Share alpha of the brittle drop that is seismic."""
    cluster: ClusterSettings = None
    """How a family is separated into events, with method `families` only."""

    @model_validator(mode="after")
    def _separated(self) -> Self:
        if self.cluster is not None and self.method != "families":
            raise refusal("method simultaneous has no clusters; leave it out, or use method families", "cluster")
        if self.link_length is not None and self.method == "families":
            raise refusal("method families has cluster.radius_cells; leave it out", "link_length")
        return self

    @property
    def clustering(self) -> ClusterSettings:
        """Settings by which a family is separated into events."""
        return self.cluster or ClusterSettings()

    @property
    def length_of_links(self) -> float:
        """Largest distance of rock that hangs together, m; a mine has one for its cells (workflow.checks)."""
        return DEFAULT_LINK_LENGTH if self.link_length is None else self.link_length

    @property
    def min_particles(self) -> int:
        """Smallest number of particles of a resolved event."""
        return self.clustering.min_samples if self.method == "families" else self.least_particles


class EventSettings(SeismicSettings):
    """The slice of the event and catalogue stages: the section `seismic`, mine, frame and dates of a step."""

    mine: str
    """Name of the mine."""
    frame: Frame
    thickness: Size = None
    """Thickness of a two-dimensional scene, m; absent in three dimensions."""
    start: str = None
    """ISO date from which the step is mined. It is empty for a step before the record begins, and absent for a whole
    catalogue."""
    end: str = None
    """ISO date up to which the step is mined; as `start`."""

    @property
    def dimension(self) -> int:
        """2 (plane strain) or 3."""
        return 3 if self.thickness is None else 2
