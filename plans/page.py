"""The page of the plans, and the table beside it."""

from collections.abc import Sequence
from pathlib import Path

import xarray as xr

from catalogs.figures import style
from catalogs.report.text import typeset
from common.datasets import atomic_path
from common.errors import InputError
from common.pages import page_templates
from common.provenance import comment
from plans.figures import draw_course, draw_plans
from plans.plan_summary import PlanSummary
from plans.sentences import contained, law_texts, missing, spanned, verdict
from plans.settings import PlansReportSlice
from plans.tables import exposed_rows, forecast_rows, matrix, opening_rows, plan_rows, step_rows, write_table

TEMPLATES = Path(__file__).parent / "templates"


def write_report(
    outcomes: Sequence[xr.Dataset],
    grid: xr.Dataset,
    settings: PlansReportSlice,
    page: Path,
    table: Path,
    made_from: str,
) -> None:
    """Write the page, which needs nothing else, its figures beside it, and the table, atomically.

    outcomes: of all plans (plans.layout), that which others are compared with first. Raises InputError for one of
    another mine, or of other classes.
    """
    plans = [PlanSummary(one) for one in outcomes]
    for plan in plans:
        if plan.outcome.attrs["mine"] != settings.mine:
            raise InputError(f"plans: {plan.name} is of mine {plan.outcome.attrs['mine']}, not of {settings.mine}")
        classes = list(plan.outcome["size"].values), [float(one) for one in plan.outcome["distance"].values]
        if classes != (list(settings.hazard.sizes), list(settings.hazard.distances)):
            raise InputError(f"plans: {plan.name} was made with other classes of size or distance; run it again")
    hazard = settings.hazard
    with style.applied():
        figures = {"map": draw_plans(plans, grid), "course": draw_course(plans)}
        pictures = {name: style.save(figure, page.parent / f"{name}.svg") for name, figure in figures.items()}
    ratios = {str(plan.outcome.attrs["ratio_text"]) for plan in plans} - {""}
    text = (
        page_templates(TEMPLATES)
        .get_template("plans.html.j2")
        .render(
            mine=settings.mine,
            first=plans[0].name,
            labels=[plan.name for plan in plans],
            verdict=verdict(plans, hazard),
            missing=missing(plans, hazard),
            contained=contained(plans),
            plans=plan_rows(plans),
            steps=step_rows(plans, hazard),
            openings=opening_rows(plans),
            sizes=[(name, typeset(f"{value:g}")) for name, value in hazard.sizes.items()],
            distances=[f"{distance:g}" for distance in hazard.distances],
            matrices=[
                {"plan": plan.name, "steps": spanned(plan.counted), "rows": matrix(plan, hazard)} for plan in plans
            ],
            exposed=exposed_rows(plans, hazard),
            likelihoods=sorted((hazard.likelihoods or {}).items(), key=lambda one: one[1]),
            forecasts=forecast_rows(plans),
            laws=law_texts(plans),
            ratios=sorted(ratios),
            members=[plan.members for plan in plans],
            pictures=pictures,
        )
    )
    write_table(table, plans, hazard)
    with atomic_path(page) as temporary:
        temporary.write_text(f"{text.rstrip()}\n{comment(made_from)}", encoding="utf-8")
