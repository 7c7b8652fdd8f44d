"""Settings that trade speed for accuracy. They are read from a configuration, so that no variant is mislabelled."""

from collections.abc import Callable
from dataclasses import dataclass

from workflow.mine_settings import MineSettings

CHOSEN = "by their error"  # Value of the knob increments where the configuration leaves their number open.

Value = float | str


@dataclass(frozen=True)
class Knob:
    """A setting. key: column of the table. of: reads it from a mine's settings. text: writes it with its unit."""

    key: str
    title: str
    of: Callable[[MineSettings], Value]
    text: Callable[[Value], str] = "{:g}".format


def _key(section: str, name: str) -> Callable[[MineSettings], Value]:
    return lambda settings: getattr(getattr(settings, section), name)


def _cell(settings: MineSettings) -> float:
    return settings.grid.coarse_cell / 2 ** (settings.grid.levels - 1)


def _width(settings: MineSettings) -> float:
    return settings.domain.upper[0] - settings.domain.lower[0]


def _radius(settings: MineSettings) -> float:
    return settings.seismic.clustering.radius_cells


KNOBS = (
    Knob("cell", "finest cell", _cell, "{:g} m".format),
    Knob("rings", "rings of cells", _key("grid", "buffer_cells")),
    Knob("particles", "particles per cell", _key("grid", "particles_per_cell")),
    Knob("cut_cells", "cut cells", _key("grid", "cut_cells"), str),
    Knob("width", "width of the domain", _width, "{:g} m".format),
    Knob("scheme", "scheme", _key("solver", "scheme"), str),
    Knob("tolerance", "tolerance", _key("solver", "tolerance"), "{:.0e}".format),
    Knob("cascade", "cascade tolerance", _key("solver", "cascade_tolerance"), "{:.0e}".format),
    Knob("increments", "increments", lambda settings: settings.solver.increments or CHOSEN, str),
    Knob("max_overshoot", "largest overshoot", _key("solver", "max_overshoot")),
    Knob("damping", "damping", _key("solver", "damping")),
    Knob("scaling", "density scaling", lambda settings: "on" if settings.solver.density_scaling else "off", str),
    Knob("method", "events are", _key("seismic", "method"), str),
    Knob("closeness", "closeness", _key("seismic", "closeness")),
    Knob("radius", "cluster radius", _radius, "{:g} cells".format),
)
SEISMIC = {"method", "closeness", "radius"}  # Knobs that change how events are counted, and no rock.
BY_KEY = {knob.key: knob for knob in KNOBS}


def settings_of(settings: MineSettings) -> dict[str, Value]:
    """Value of every knob in a mine's settings, by its key."""
    return {knob.key: knob.of(settings) for knob in KNOBS}


def changed(settings: dict[str, Value], base: dict[str, Value]) -> list[str]:
    """Keys of the knobs whose value differs from that of the base."""
    return [key for key in settings if settings[key] != base[key]]


def label(settings: dict[str, Value], keys: list[str]) -> str:
    """Values of these knobs in words: "tolerance 1e-03, finest cell 2.5 m"."""
    return ", ".join(f"{BY_KEY[key].title} {BY_KEY[key].text(settings[key])}" for key in keys)
