"""Output in results/calibration_truth: table.csv, a figure, and report.html, which refers to no other file."""

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

import pandas as pd
from matplotlib.figure import Figure

from catalogs.figures import style
from common.datasets import atomic_path
from verification.calibration_truth.claims import COLUMNS, Claim
from verification.html_page import write_page


def write_report(claims: Sequence[Claim], figure: Figure, table: Path, page: Path) -> None:
    """Write table and page, atomically."""
    rows = pd.DataFrame([asdict(claim) for claim in claims], columns=list(COLUMNS))
    rows["holds"] = rows["holds"].map({True: "yes", False: "no"})
    with atomic_path(table) as temporary:
        rows.to_csv(temporary, index=False)
    picture = style.save(figure, page.parent / "figure.svg")
    write_page(page, "calibration_truth", rows=rows.to_dict("records"), figure=picture)
