"""Openings of any shape and place on cells of each accuracy, against cells finer than all of these."""

import itertools
import json
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from catalogs.compare.cell_error import failed_thickness
from catalogs.compare.grid_convergence import cell_error
from catalogs.figures import style
from common.voigt import tensor_from_voigt
from mpm_core.stages.grid_stage import MIN_WHOLE_CELL_SHARE_ACCEPTED
from verification.cavities.inclusion import Elastic, SphericalInclusion
from verification.comparisons import mean_square_root, seismic_potency, vanishing
from verification.page_tables import Pivot
from verification.plots import plot_errors
from verification.results import Results, Variant
from verification.rows import Row

TABLES = (
    Pivot(
        "Error against the finest cells (%)",
        r"(?P<row>\w+), (?P<column>(?:draft|standard|fine): (?:energy|potency|volume)), (?:J|m3)",
        "change, %",
    ),
    Pivot(
        "Potency elsewhere on the cells, against the finest cells (%)",
        r"(?P<row>\w+), moved: (?P<column>(?:draft|standard|fine), \w+), m3",
        "change, %",
    ),
    Pivot(
        "Three cells across, against the finest cells (%)",
        r"(?P<row>\w+, (?:own place|\w+)), three cells across: (?P<column>energy|potency|volume), (?:J|m3)",
        "change, %",
    ),
    Pivot(
        "Energy of slots against fine cells (%)",
        r"slot, (?P<row>dip \d+), (?P<column>\w+ cells? across): energy, J",
        "change, %",
    ),
)

STEP = "history"
MEASURES = {"energy": "J", "potency": "m3", "volume": "m3"}
TITLES = {"energy": "energy set in motion, elastic", "potency": "seismic potency", "volume": "volume of failed rock"}


@dataclass(frozen=True)
class Found:
    """Results of one run.

    energy: set in motion in elastic rock when its openings are mined at once (half the work of the removed support), J.
    potency, volume: of failed rock, m3. thickness: mean one of the failed rock, finest cells; NaN if none failed.
    whole: least share of an opening in whole cells. narrow: an opening is narrow for the cells, or they have no part of
    it. seconds: processor time of its stages without compiling, s.
    """

    energy: float
    potency: float
    volume: float
    thickness: float
    whole: float
    narrow: bool
    seconds: float


def answer(results: Results) -> tuple[list[Row], Figure]:
    """Errors by scene and accuracy, r.m.s. errors of each accuracy, potency elsewhere on the cells, what the report's
    uncertainty holds, the sphere's energy, the slots; a figure."""
    settings, allowed = results.settings, results.allowed
    *sizes, finest = settings["sizes"]
    names = [f"{scene}_{size}" for scene in settings["scenes"] for size in settings["sizes"]]
    placed = ["", *(f"_{placement}" for placement in settings["placements"])]
    moved = [f"{scene}{place}_{size}" for scene in settings["scenes"] for place in placed[1:] for size in sizes]
    found = {name: measure(results[name]) for name in [*names, *moved]}
    rows, errors = [], {}
    for scene in settings["scenes"]:
        truth = found[f"{scene}_{finest}"]
        for size in sizes:
            run = found[f"{scene}_{size}"]
            told = f"{run.whole:.2f} of it in whole cells, {run.seconds:.0f} s"
            for name, unit in MEASURES.items():
                bound = allowed[name] if size == settings["judged"] else None
                true, value = getattr(truth, name), getattr(run, name)
                errors[scene, size, name] = value / true - 1.0
                rows.append(Row.relative(f"{scene}, {size}: {name}, {unit}", true, value, bound, told))
    for size in sizes:
        for name in MEASURES:
            values = np.array([errors[scene, size, name] for scene in settings["scenes"]])
            rows.append(scenes_row(f"{size}: {name}", values))
    for size in settings["sizes"]:
        sphere = f"{settings['sphere']}_{size}"
        true = energy_of_sphere(results[sphere])
        bound = allowed["energy"] if size == settings["judged"] else None
        rows.append(Row.relative(f"{sphere}: energy of the closed form, J", true, found[sphere].energy, bound))
    for scene, size, place in itertools.product(settings["scenes"], sizes, placed[1:]):
        run, truth = found[f"{scene}{place}_{size}"], found[f"{scene}_{finest}"]
        rows.append(Row.relative(f"{scene}, moved: {size}, {place[1:]}, m3", truth.potency, run.potency, None))
    rows += three_across(results, {scene: found[f"{scene}_{finest}"] for scene in settings["three_across"]}, placed)
    for (coarse, fine), name in itertools.product(itertools.pairwise(sizes), ("potency", "volume")):
        runs = [
            [found[f"{scene}{place}_{size}"] for size in (coarse, fine)] + [found[f"{scene}_{finest}"]]
            for scene, place in itertools.product(settings["scenes"], placed)
        ]
        rows += coverage(f"{fine} beside {coarse}: {name}", name, runs, settings["holds"])
        coarse_values, values, true = (
            np.array([getattr(one, name) for one in same]) for same in zip(*runs[:: len(placed)], strict=True)
        )
        rows.append(
            scenes_row(f"{fine} beside {coarse}: {name} extrapolated", (2.0 * values - coarse_values) / true - 1.0)
        )
    return rows + slots(results), draw(settings, errors)


def three_across(results: Results, truths: dict[str, Found], placed: list[str]) -> list[Row]:
    """Errors of runs with three cells across, reported, by scene, with its truth, and place; then over all of them,
    judged."""
    rows, errors = [], []
    for (scene, truth), place in itertools.product(truths.items(), placed):
        run = measure(results[f"{scene}{place}_three"])
        title = f"{scene}, {place.removeprefix('_') or 'own place'}, three cells across"
        pairs = {name: (getattr(truth, name), getattr(run, name)) for name in MEASURES}
        errors.append([value / true - 1.0 for true, value in pairs.values()])
        rows += [
            Row.relative(f"{title}: {name}, {unit}", *pairs[name], None, f"{run.seconds:.0f} s")
            for name, unit in MEASURES.items()
        ]
    return rows + [
        scenes_row(f"three cells across, all places: {name}", column, results.allowed[f"three_{name}"])
        for name, column in zip(MEASURES, np.array(errors).T, strict=True)
    ]


def coverage(title: str, name: str, runs: list[list[Found]], holds: float) -> list[Row]:
    """Rows on the uncertainty that the report states of a number.

    runs: for each mine at each placement those on doubled cells, on its own and on the finest. The first row is the
    share of runs whose uncertainty reaches to the finest cells; it must be at least `holds`. The second is the share
    that it reaches beyond by more than its distance.
    """
    errors, stated = [], []
    for coarse, own, finest in runs:
        values = (getattr(own, name), getattr(coarse, name))
        errors.append(abs(np.log(getattr(finest, name) / values[0])) if values[0] > 0.0 else np.inf)
        stated.append(np.log1p(cell_error(values, (own.thickness, coarse.thickness), coarse.narrow)))
    within, wide = (float(np.mean(np.multiply(share, stated) >= errors)) for share in (1.0, 0.5))
    return [
        Row.at_least(f"{title}, share of runs within the stated uncertainty", within, holds),
        vanishing(f"{title}, share of runs with more than twice the uncertainty", wide),
    ]


def scenes_row(name: str, errors: np.ndarray, allowed: float | None = None) -> Row:
    """Root mean square of the signed errors (scene,) of all scenes; reported only if no bound is allowed."""
    told = f"{100 * errors.min():+.1f} to {100 * errors.max():+.1f} %"
    return vanishing(f"{name}, r.m.s. error over the scenes", float(mean_square_root(errors)), allowed, told)


def measure(variant: Variant) -> Found:
    """Numbers of one run of a scene."""
    state = variant.step(STEP)
    failed = state.failed.values >= 0
    volumes, narrow = (json.loads(variant.grid.attrs[f"excavation_{name}"]) for name in ("volume_grid", "narrow"))
    stages = ("grid", "elastic", f"steps/{STEP}")
    return Found(
        float(variant.elastic.attrs["energy_motion"]),
        float(seismic_potency(state, failed).sum()),
        float(state.volume.values[failed].sum()),
        failed_thickness(state, [int(state.attrs["step_index"])]),
        whole_share(variant),
        bool(narrow) or not min(volumes) > 0.0,
        float(np.array([variant.processor_time(stage) for stage in stages], float).sum()),  # NaN without a log
    )


def whole_share(variant: Variant) -> float:
    """Least share of an opening in whole cells."""
    return min(json.loads(variant.grid.attrs["excavation_whole_share"]))


def energy_of_sphere(variant: Variant) -> float:
    """V s0 : e / 2 with the strain e of the wall (verification.answers.sphere), J, stress as at the sphere's centre."""
    hole, rock = variant.values["excavations"][0], variant.values["materials"]["host"]
    virgin = tensor_from_voigt(variant.scene().insitu.at(np.array([hole["center"][2]])))[0]
    exact = SphericalInclusion(hole["radius"], virgin, Elastic(rock["youngs_modulus"], rock["poisson_ratio"]))
    return 2.0 / 3.0 * np.pi * hole["radius"] ** 3 * float((virgin * exact.strain_inside).sum())


def slots(results: Results) -> list[Row]:
    """Energy of dipping slots against the same on fine cells. A grid that would be refused has no bound."""
    settings, allowed, rows = results.settings["slots"], results.allowed, []
    for dip in settings["dips"]:
        true = float(results[f"slot_{dip}_{settings['finest']}"].elastic.attrs["energy_motion"])
        for size in settings["judged"]:
            variant = results[f"slot_{dip}_{size}"]
            share = whole_share(variant)
            refused = share < MIN_WHOLE_CELL_SHARE_ACCEPTED
            told = f"{share:.2f} of it in whole cells" + (": refused unless volume_error is 1" if refused else "")
            value = float(variant.elastic.attrs["energy_motion"])
            bound = None if refused else allowed[f"slots_{size}"]
            across = f"{size} cell{'' if size == 'one' else 's'} across"
            rows.append(Row.relative(f"slot, dip {dip}, {across}: energy, J", true, value, bound, told))
    return rows


def draw(settings: dict, errors: dict[tuple[str, str, str], float]) -> Figure:
    """Signed errors by scene, a panel for each measure."""
    figure = style.new_figure(height=3.8)
    scenes = settings["scenes"]
    names = [scene.replace("_", " ") for scene in scenes]
    for panel, (name, title) in zip(figure.subplots(1, len(TITLES), sharey=True), TITLES.items(), strict=True):
        series = {size: [100 * errors[scene, size, name] for scene in scenes] for size in settings["sizes"][:-1]}
        labels: dict = {"title": title, "xlabel": "error against the finest cells (%)"}
        plot_errors(panel, names, series, truth=0.0, legend=None, **labels)
    figure.legend(*panel.get_legend_handles_labels(), loc="outside lower center", ncols=len(series))
    return figure
