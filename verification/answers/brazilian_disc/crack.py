"""Growth of a crack through the disc, generation by generation: failed cells, span, potency."""

from dataclasses import dataclass
from functools import cached_property
from typing import Generic, Protocol, TypeVar

import numpy as np
import xarray as xr
from scipy import ndimage

from common.source_tensors import principal_axes, scalar_potency
from common.voigt import tensor_from_voigt
from seismic.events import extract_events, particle_potency
from verification.answers.brazilian_disc.closed_form import Disc
from verification.answers.brazilian_disc.elastic_rock import MIN_SOUND_SHARE, PressedDisc
from verification.comparisons import failed_in_step
from verification.results import Variant

STRAINS = ("seismic_strain", "overshoot_strain", "later_strain", "plastic_strain_step")
STAGE_COUNT = 6  # As in the paper's Fig. 16.


class LoadedDisc(Protocol):
    """Interface of a disc in which a crack grows: loaded on two arcs (PressedDisc), or between platens."""

    name: str
    variant: Variant
    disc: Disc
    center: np.ndarray
    cell_size: float

    @property
    def flat(self) -> bool:
        """True if the scene is a section in plane strain."""

    def text_of(self, step: str, share: float) -> str:
        """Load or strain in words that is applied once this share (0 to 1) of a step's load or strain is added."""


Loaded = TypeVar("Loaded", bound=LoadedDisc)


@dataclass(frozen=True)
class Moment:
    """The growing crack after a generation of failure.

    part: parts of the step's load or strain that are applied by then. span: share of the loaded diameter that the
    largest connected body of failed cells spans. potency: sum over particles, m3.
    """

    generation: int
    part: int
    failed_cells: int
    span: float
    potency: float


class Crack(Generic[Loaded]):
    """Failure in the step of a variant in which rock fails: its particles and the generations in which they fail."""

    def __init__(self, disc: Loaded, step: str):
        self.disc, self.step = disc, step
        state = disc.variant.step(step)
        self.state = state
        self.failed = failed_in_step(state)
        order = state.failure_order.values[self.failed].astype(np.int64)
        instant = order[:, 0] * (order[:, 1].max() + 1) + order[:, 1]
        _, first, self.rank = np.unique(
            instant, return_index=True, return_inverse=True
        )  # Generation, from the first failure.
        self.part_of = order[first, 0]
        rock = np.bincount(state.cell.values, state.volume.values)  # Volume of each cell, m3. All cells have one size.
        sound = (
            rock[state.cell.values[self.failed]] >= MIN_SOUND_SHARE * rock.max()
        )  # Crumbs at the ends of the arcs fail before.
        self.first_part = int(order[sound if sound.any() else slice(None), 0].min())
        self.last_part = int(order[:, 0].max())
        self.place = state.position.values[self.failed, :2] - disc.center
        fraction = disc.variant.values["seismic"]["seismic_fraction"]
        self.potency_tensor = tensor_from_voigt(
            particle_potency(state.seismic_strain.values, state.volume.values, fraction)[self.failed]
        )
        self.potency = scalar_potency(self.potency_tensor)

    @property
    def parts(self) -> int:
        """Parts in which the step's load is added."""
        return self.disc.variant.values["solver"]["increments"]

    def load(self: "Crack[PressedDisc]", part: int) -> float:
        """Resultant on each arc, N, once so many parts of the step's load are added."""
        loading = self.disc.loading
        return loading.before + loading.added[self.step] * part / self.parts

    def text_of(self, part: int) -> str:
        """Load or platen displacement once so many parts of the step are applied."""
        return self.disc.text_of(self.step, part / self.parts)

    @cached_property
    def cell_index(self) -> tuple[np.ndarray, np.ndarray]:
        """Index of the cell of each failed particle along the axes (particle, 3), and number of cells (3,)."""
        grid = self.disc.variant.grid
        index = np.rint((grid.cell_origin.values - grid.attrs["domain_lower"]) / self.disc.cell_size).astype(int)
        return index[self.state.cell.values[self.failed]], index.max(axis=0) + 1

    @cached_property
    def moments(self) -> list[Moment]:
        """The crack after each generation."""
        axes = [0, 1] if self.disc.flat else [0, 1, 2]
        index, shape = self.cell_index
        broken = np.zeros(shape[axes], bool)
        corners = ndimage.generate_binary_structure(len(axes), len(axes))  # Cells are connected over corners as well.
        potency = np.cumsum(np.bincount(self.rank, self.potency))
        moments = []
        for generation in range(self.rank.max() + 1):
            broken[tuple(index[self.rank == generation][:, axes].T)] = True
            bodies = ndimage.find_objects(ndimage.label(broken, corners)[0])
            height = max(body[1].stop - body[1].start for body in bodies)
            span = height * self.disc.cell_size / (2.0 * self.disc.disc.radius)
            part, cells = int(self.part_of[generation]), int(broken.sum())
            moments.append(Moment(generation, part, cells, min(span, 1.0), float(potency[generation])))
        return moments

    def layer_spans(self, generation: int) -> np.ndarray:
        """Span of the loaded diameter (layer,) in each layer of cells along the axis, by its largest connected body."""
        index, shape = self.cell_index
        broken = np.zeros(shape, bool)
        broken[tuple(index[self.rank <= generation].T)] = True
        within_layers = np.zeros((3, 3, 3), bool)
        within_layers[:, :, 1] = True
        labels, _ = ndimage.label(broken, within_layers)
        height = np.zeros(broken.shape[2])
        for body in ndimage.find_objects(labels):
            layer = body[2].start
            height[layer] = max(height[layer], body[1].stop - body[1].start)
        return np.minimum(height * self.disc.cell_size / (2.0 * self.disc.disc.radius), 1.0)

    def run_through(self, span: float) -> Moment | None:
        """The first moment at which the crack spans that share of the loaded diameter; None if it never does."""
        return next((moment for moment in self.moments if moment.span >= span), None)

    def near_share(self, near: float, moment: Moment) -> float:
        """Share of the potency so far of particles within `near` m of the loaded diameter."""
        so_far = self.rank <= moment.generation
        close = np.abs(self.place[:, 0]) <= near
        return float(self.potency[so_far & close].sum() / self.potency[so_far].sum())

    def opening_axis_angle(self, moment: Moment) -> float:
        """Angle, degrees, between the T axis of all potency so far and the normal of the loaded diameter."""
        tensor = self.potency_tensor[self.rank <= moment.generation].sum(axis=0)
        return float(np.degrees(np.arccos(min(1.0, abs(principal_axes(tensor)[2][0])))))

    def stages(self) -> list[Moment]:
        """STAGE_COUNT moments, between which equal shares of the whole potency are released."""
        potency = np.array([moment.potency for moment in self.moments])
        wanted = potency[-1] * np.arange(1, STAGE_COUNT + 1) / STAGE_COUNT
        return [self.moments[index] for index in np.searchsorted(potency, wanted * (1.0 - 1e-12))]

    def events_between(self, after: int, until: int) -> xr.Dataset:
        """Events of the particles that failed after one generation up to another, as if this were a step of its own."""
        chosen = np.zeros(len(self.failed), bool)
        chosen[np.flatnonzero(self.failed)[(self.rank > after) & (self.rank <= until)]] = True
        kept = {name: self.state[name].where(xr.DataArray(chosen, dims="particle"), 0.0) for name in STRAINS}
        return extract_events(self.state.assign(kept), self.disc.variant.mine.catalogue_slice())[0]

    def events(self) -> xr.Dataset:
        """Events of the whole step, as the pipeline has them."""
        return self.disc.variant.events(self.step)


def read_crack(disc: Loaded) -> Crack[Loaded] | None:
    """The crack of a variant, in the step in which most rock fails; None where no rock fails.

    Crumbs of rim cells at the ends of the loaded arcs may fail in an earlier step.
    """
    failed = {step: disc.variant.step(step).attrs["failed_volume"] for step in disc.variant.step_names}
    most = max(failed, key=lambda step: failed[step], default=None)
    return Crack(disc, most) if most and failed[most] > 0.0 else None
