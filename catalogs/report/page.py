"""`report.html`: one page, complete in itself, that a mine's geotechnical engineer reads from top to bottom."""

import json
import os
from collections.abc import Callable, Sequence
from pathlib import Path

import jinja2
import numpy as np
from matplotlib.figure import Figure

from catalogs.figures import beachballs, convergence, events, rock, scene, sizes, stereonets, style, views
from catalogs.mechanisms import mean_axis, trend_plunge
from catalogs.report import energy, match, text
from catalogs.report.inputs import Evidence, read_evidence
from catalogs.report.record import sentences
from catalogs.report.scene import by_step
from catalogs.report.spread import headline as headline_of_spread
from catalogs.report.spread import section as section_of_spread
from catalogs.report.text import fixed, number, percent, whole
from catalogs.settings import Scheduled
from catalogs.size_law import NONE, TRUNCATED
from catalogs.sizes import b_by_cut, cut_grid, estimate_b, log_potency
from pipeline.datasets import atomic_path
from pipeline.pages import page_templates
from pipeline.source_tensors import moment_from_potency

BALLS = 10
MANY = 40  # rows: a longer list is folded or scrolls, or ends after the MOST that have most potency
MOST = 20
TEMPLATES = Path(__file__).parent / "templates"
MODEL_LABEL = "Modelled"


def write_report(
    *,
    config: dict,
    grid: str | os.PathLike,
    output: str | os.PathLike,
    figures: str | os.PathLike,
    elastic: str | os.PathLike | None = None,
    steps: list = (),
    events: list = (),
    catalog: str | os.PathLike | None = None,
    record: str | os.PathLike | None = None,
    comparison: str | os.PathLike | None = None,
    spread: str | os.PathLike | None = None,
    benchmarks: str | os.PathLike | None = None,
    default: dict | None = None,
    excavations: Sequence[Scheduled] | None = None,
    expected_hashes: dict[str, str] | None = None,
) -> None:
    """Write the page to `output` (atomically) and each of its figures as SVG into the folder `figures`.

    config: the resolved configuration as the user wrote it (units as text), default: config/default.yaml, for the marks
    of what differs; grid, elastic, steps, events, catalog, record, comparison, spread: datasets, absent stages None or
    empty; benchmarks: folder of Snakemake's benchmark files of this mine; excavations: when each is mined,
    if not as `config` says; expected_hashes: {dataset path: config_hash it should carry}, for the banner of stale
    results.
    Same inputs, same bytes. Raises InputError where a dataset is unreadable or is no catalogue.
    """
    evidence = read_evidence(
        config, default, grid, elastic, list(steps), list(events), catalog, record, comparison, spread,
        benchmarks, expected_hashes, excavations,
    )  # fmt: skip
    gallery = Gallery(Path(figures))
    with style.applied():
        sections = {
            "scene": _scene(evidence, gallery),
            "convergence": _convergence(evidence, gallery),
            "rock": _rock(evidence, gallery),
            "events": _events(evidence, gallery),
            "sizes": _sizes(evidence, gallery),
            "spread": section_of_spread(evidence, gallery.add),
            "axes": _axes(evidence, gallery),
            "balls": _balls(evidence, gallery),
            "budget": _budget(evidence),
        }
    gallery.remove_others()
    page = _environment().get_template("report.html.j2").render(
        evidence=evidence,
        mine=evidence.grid.attrs["mine"],
        headline=text.headline(evidence) + headline_of_spread(evidence),
        match=match.match_rows(evidence),
        beside=sentences(evidence),
        banners=text.banners(evidence),
        many=MANY,
        config_lines=text.config_lines(config, default),
        versions=_versions(evidence),
        files=[(_short(path, output), attributes) for path, attributes in evidence.files.items()],
        **sections,
    )  # fmt: skip
    with atomic_path(output) as temporary:
        temporary.write_text(page, encoding="utf-8")


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


def _environment() -> jinja2.Environment:
    environment = page_templates(TEMPLATES)
    filters: dict[str, Callable] = {
        "number": number,
        "percent": percent,
        "whole": whole,
        "fixed": fixed,
        "typeset": text.typeset,
    }
    filters["logarithm"] = lambda value: fixed(np.log10(value) if value > 0 else np.nan, 2)
    environment.filters.update(filters)
    return environment


def _cuts(evidence: Evidence) -> list[views.View]:
    """Cut planes through the fullest layers of what the dated steps mine; if nothing is dated, of all that is mined."""
    grid, rows = evidence.grid, evidence.excavations
    wanted = [index for index, row in enumerate(rows) if row.dated] or [
        index for index, row in enumerate(rows) if not row.planned
    ]
    cell, owner = grid["piece_cell"].values, grid["piece_excavation"].values
    size = grid["cell_size"].values[cell]
    weight = grid["piece_fraction"].values * size ** int(grid.attrs["dimension"]) * np.isin(owner, wanted)
    return views.cuts(grid, grid["cell_origin"].values[cell] + size[:, None] / 2, weight)


def _scene(evidence: Evidence, gallery: Gallery) -> dict:
    cuts, rows = _cuts(evidence), evidence.excavations
    return {
        "levels": gallery.add("grid_levels", scene.grid_levels(evidence.grid, cuts)),
        "share": gallery.add("excavated_share", scene.excavated_share(evidence.grid, cuts, evidence.planned))
        if evidence.grid.sizes["piece"]
        else None,
        "table": scene.level_table(evidence.grid),
        "excavations": rows,
        "steps": by_step(rows) if len(rows) > MANY else [],
    }


def _convergence(evidence: Evidence, gallery: Gallery) -> dict | None:
    if not evidence.stages:
        return None
    figure = gallery.add("convergence", convergence.convergence(evidence.stages))
    failures = [int(stage["convergence_new_failures"].values.sum()) for stage in evidence.stages]
    return {"figure": figure, "table": list(zip([stage.attrs for stage in evidence.stages], failures, strict=True))}


def _rock(evidence: Evidence, gallery: Gallery) -> dict | None:
    if evidence.state is None:
        return None
    grid, state, cuts, planned = evidence.grid, evidence.state, _cuts(evidence), evidence.planned
    sections = [view for view in cuts if view.vertical == views.UP] or cuts
    shown = {"failed": None, "table": evidence.steps, "energy": energy.section(evidence)}
    if (state["failed"].values >= 0).any():
        last = max(int(step["step_index"]) for step in evidence.steps)
        names, dated = ["" for _ in range(last + 1)], [False] * (last + 1)
        for step in evidence.steps:
            names[int(step["step_index"])], dated[int(step["step_index"])] = step["step"], bool(int(step["dated"]))
        shown["failed"] = gallery.add("failed_rock", rock.failed_rock(grid, state, cuts, names, dated, planned))
    shown["strength"] = gallery.add("strength_factor", rock.strength_factor(grid, state, sections, planned))
    shown["displacement"] = gallery.add("displacement", rock.displacement(grid, state, sections, planned))
    return shown


def _shown(evidence: Evidence) -> dict:
    """Catalogues that have events to show, by label: the modelled one first."""
    found = {} if evidence.catalog is None else {MODEL_LABEL: evidence.resolved}
    if evidence.record is not None:
        found[evidence.record_label] = evidence.record
    return found if any(catalog.sizes["event"] for catalog in found.values()) else {}


def _events(evidence: Evidence, gallery: Gallery) -> dict | None:
    shown = _shown(evidence)
    if not shown:
        return None
    rows, _ = text.near_excavations(evidence)
    compared = evidence.comparison is not None
    located = compared and bool(np.isfinite(evidence.comparison["energy_distance"]))
    return {
        "figure": gallery.add("events", events.locations(evidence.grid, shown, evidence.planned)),
        "near": _with_most_potency(rows),
        "nearness": gallery.add("nearness", events.nearness(evidence.comparison)) if located else None,
        "rows": match.location_rows(evidence) if located else [],
        "text": text.typeset(evidence.comparison.attrs.get("location_text", "")) if compared else "",
        "beside": len(shown) > 1,
    }


def _with_most_potency(rows: list[dict]) -> list[dict]:
    """Rows of excavations with events beside them; where they are many, those with most potency and the others' sum."""
    if len(rows) <= MANY:
        return rows
    rows = sorted(rows, key=lambda row: -row["potency"])
    others = rows[MOST:]
    sums = {name: sum(row[name] for row in others) for name in ("events", "potency", "potency_share")}
    return [*rows[:MOST], {"name": f"{len(others)} others", "step": "", **sums, "distance": np.nan}]


def _sizes(evidence: Evidence, gallery: Gallery) -> dict | None:
    shown = _shown(evidence)
    if not shown:
        return None
    catalogs = [_size_fit(evidence, label, catalog) for label, catalog in shown.items()]
    return {
        "figure": gallery.add("potency_frequency", sizes.potency_frequency(catalogs)),
        "by_cut": gallery.add("b_against_cut", sizes.b_against_cut(catalogs)),
        "rows": match.size_rows(evidence),
        "fits": catalogs,
        "text": "" if evidence.comparison is None else text.typeset(evidence.comparison.attrs.get("size_text", "")),
    }


def _size_fit(evidence: Evidence, label: str, catalog) -> sizes.Sizes:
    """b of one catalogue: from the comparison, or above the model's own floor if it stands alone."""
    values = log_potency(catalog["potency"].values)
    modelled, comparison = label == MODEL_LABEL, evidence.comparison
    colour = style.MODELLED if modelled else style.RECORDED
    if comparison is not None:
        here = comparison.sel(catalogue="model" if modelled else "record")
        by_cut = np.stack([comparison["cut_log_potency"], here["b_by_cut"], here["b_by_cut_error"]])
        fit = [float(here[name]) for name in ("b", "b_error", "a")]
        law, cut = comparison.attrs["law_model" if modelled else "law_record"], float(comparison["cut"])
        if law == TRUNCATED:  # its line through the same number of events at the cut
            b = float(here["b_truncated"])
            fit = [b, float(here["b_truncated_error"]), fit[2] + (b - fit[0]) * cut]
        elif law == NONE:
            fit = [np.nan] * 3
        return sizes.Sizes(label, colour, values, *fit, cut, by_cut)
    floor = float(evidence.catalog.attrs["potency_floor"]) if modelled else np.nan
    known = values[np.isfinite(values)]
    cut = np.log10(floor) if floor > 0 else known.min(initial=np.inf)
    fit = estimate_b(known, cut)
    table = [(value.cut, value.b, value.error) for value in b_by_cut(known, cut_grid(known))]
    return sizes.Sizes(
        label, colour, values, fit.b, fit.error, fit.a, float(cut), np.array(table, float).reshape(-1, 3).T
    )


def _axes(evidence: Evidence, gallery: Gallery) -> dict | None:
    nets = [net for net in (_net(evidence, *item) for item in _shown(evidence).items()) if net is not None]
    if not nets:
        return None
    compared = evidence.comparison is not None and int(evidence.comparison.attrs.get("axes_present", 0))
    return {
        "figure": gallery.add("stereonets", stereonets.stereonets(nets)),
        "kagan": gallery.add("kagan_angles", stereonets.kagan_angles(evidence.comparison)) if compared else None,
        "rows": match.axis_rows(evidence) if compared else [],
        "text": "" if evidence.comparison is None else evidence.comparison.attrs.get("axes_text", ""),
    }


def _net(evidence: Evidence, label: str, catalog) -> stereonets.Axes | None:
    """Axes of one catalogue with their means; None if it has none."""
    modelled, comparison = label == MODEL_LABEL, evidence.comparison
    vectors = np.stack([catalog[f"{name}_axis"].values for name in "pbt"])
    known = np.isfinite(vectors).all(axis=(0, 2))
    if not known.any():
        return None
    vectors = vectors[:, known]
    mean, cone = [*trend_plunge(mean_axis(vectors)[0])], np.full(3, np.nan)
    if comparison is not None and int(comparison.attrs.get("axes_present", 0)):
        here = comparison.sel(catalogue="model" if modelled else "record")
        mean, cone = [here["mean_trend"].values, here["mean_plunge"].values], here["mean_cone"].values
    look = (style.MODELLED, "Blues") if modelled else (style.RECORDED, "Oranges")
    return stereonets.Axes(label, *look, vectors, *mean, cone)


def _balls(evidence: Evidence, gallery: Gallery) -> dict | None:
    if evidence.catalog is None:
        return None
    largest = text.largest_events(evidence.resolved, BALLS)
    if not len(largest):
        return None
    chosen = evidence.resolved.isel(event=largest)
    rows = text.ball_rows(chosen)
    titles = [f"{row['rank']}: log P {row['log_potency']}\n{row['date']}" for row in rows]
    axes_of = np.stack([chosen["p_axis"].values, chosen["t_axis"].values], axis=1)
    lame_lambda, shear_modulus = (float(chosen.attrs[name]) for name in ("lame_lambda", "shear_modulus"))
    tensors = moment_from_potency(chosen["potency_tensor"].values, lame_lambda, shear_modulus)
    return {
        "figure": gallery.add("beach_balls", beachballs.beach_balls(tensors, titles, axes_of, style.MODELLED)),
        "rows": rows,
    }


def _budget(evidence: Evidence) -> dict | None:
    components, rows, budget = text.budget_rows(evidence)
    if not rows:
        return None
    return {
        "components": components,
        "rows": rows,
        "budget": budget,
        "floor": float(evidence.catalog.attrs["potency_floor"]),
        "seismic_fraction": float(evidence.catalog.attrs["seismic_fraction"]),
        "shear_modulus": float(evidence.catalog.attrs["shear_modulus"]),
    }


def _versions(evidence: Evidence) -> dict[str, str]:
    """Package versions named by the datasets; where files differ, each version."""
    found: dict[str, set[str]] = {}
    for attributes in evidence.files.values():
        for name, version in json.loads(attributes.get("versions", "{}")).items():
            found.setdefault(name, set()).add(version)
    return {name: ", ".join(sorted(versions)) for name, versions in sorted(found.items())}


def _short(path: str, output) -> str:
    """A dataset's path below the report's own folder where it lies there, else its name."""
    path, folder = Path(path).resolve(), Path(output).resolve().parent
    return path.relative_to(folder).as_posix() if path.is_relative_to(folder) else path.name
