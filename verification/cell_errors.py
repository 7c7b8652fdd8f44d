"""Errors of potency and failed volume that cells leave, from study openings: its runs, and the constants of their law.

python -m verification.cell_errors runs the mines of the study one after the other in this process, appends each to
config/verification/openings/cell_errors.csv and prints the constants of catalogs/compare/cell_error.py by the runs that
the file has. Runs that the file has are not made again: delete it to make all of them. Names of variants, if there are
any, are all that this process runs, in that order: several processes may run side by side.
"""

import csv
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linprog

TABLE = Path(__file__).parents[1] / "config" / "verification" / "openings" / "cell_errors.csv"
COLUMNS = ("variant", "energy", "potency", "volume", "thickness")
QUANTITIES = ("potency", "volume")
PLACEMENTS = ("", "quarter", "half", "rotated")  # of a mine on its cells; the first is that of the finest cells, too
DRAFT, STANDARD, FINE, FINEST = "draft", "standard", "fine", "finest"
FITTED_SHARE = 0.92  # of the runs keep the law: of a mine that it was not fitted to, fewer do (cell_error.COVERAGE).
MIN_ABSOLUTE_ERROR = 0.003  # Smaller errors of ln Q are chance: the runs end at a tolerance of this order.


class CellError(NamedTuple):
    """Error of a number of one run: mine, placement, size of cells, quantity; thickness of the failed rock in cells;
    ln of the number over that of the finest cells."""

    mine: str
    placement: str
    size: str
    quantity: str
    thickness: float
    error: float


class Law(NamedTuple):
    """U(t) = max(at_one_cell t^-order, least) of |ln Q_h / Q|; t: thickness of the failed rock in cells."""

    at_one_cell: float
    order: float
    least: float

    def at(self, thickness: NDArray) -> NDArray:
        return np.maximum(self.at_one_cell * np.asarray(thickness, float) ** -self.order, self.least)


def variant_name(mine: str, placement: str, size: str) -> str:
    """Name of a variant of the study."""
    return "_".join(part for part in (mine, placement, size) if part)


def read_table(path: Path = TABLE) -> dict[str, dict[str, float]]:
    """Rows of the table by variant, in SI units."""
    with path.open(encoding="utf-8", newline="") as file:
        return {row["variant"]: {name: float(row[name]) for name in COLUMNS[1:]} for row in csv.DictReader(file)}


def cell_errors(table: Mapping[str, Mapping[str, float]], mines: Iterable[str]) -> list[CellError]:
    """Errors of all runs of the table in which rock failed, against the finest cells that the table has of their mine:
    FINEST or FINE."""
    found = []
    for mine in mines:
        sizes = [size for size in (DRAFT, STANDARD, FINE, FINEST) if variant_name(mine, "", size) in table]
        if not sizes or sizes[-1] not in (FINE, FINEST):
            continue
        truth = table[variant_name(mine, "", sizes[-1])]
        for placement in PLACEMENTS:
            for size in sizes[:-1]:
                run = table.get(variant_name(mine, placement, size), {"volume": 0.0})
                for name in QUANTITIES if run["volume"] > 0 else ():
                    error = np.log(run[name] / truth[name])
                    found.append(CellError(mine, placement, size, name, run["thickness"], float(error)))
    return found


def fit(errors: Iterable[CellError]) -> Law:
    """The law that FITTED_SHARE of the runs keep: by quantile regression of ln |error| on ln t (Koenker and Bassett
    1978) for draft and standard, and the quantile of |error| for fine, whose zones are so thick that chance is most of
    it."""
    errors = list(errors)
    coarse = [one for one in errors if one.size != FINE]
    sizes = np.maximum(np.abs([one.error for one in coarse]), MIN_ABSOLUTE_ERROR)
    line = np.column_stack([np.ones(len(coarse)), np.log([one.thickness for one in coarse])])
    costs = np.concatenate([np.zeros(4), np.full(len(coarse), FITTED_SHARE), np.full(len(coarse), 1.0 - FITTED_SHARE)])
    identity = np.eye(len(coarse))
    found = linprog(costs, A_eq=np.hstack([line, -line, identity, -identity]), b_eq=np.log(sizes)).x
    least = np.quantile(np.abs([one.error for one in errors if one.size == FINE]), FITTED_SHARE)
    return Law(float(np.exp(found[0] - found[2])), float(found[3] - found[1]), float(least))


def main(names: list[str]) -> None:
    """Make the runs that the table lacks, of these names only if there are any, and print the constants."""
    from common.kernel_cache import use_numba_cache

    use_numba_cache()
    from verification.answers.openings import measure
    from verification.results import Variant
    from verification.studies import FOLDER, load_study
    from workflow.run_mine import run_stages

    study = load_study(FOLDER / "openings.yaml")
    if not TABLE.is_file():
        TABLE.write_text(",".join(COLUMNS) + "\n", encoding="utf-8")
    wanted = [name for name in study.mines if not name.startswith("slot_") and not name.endswith("_three")]
    for name in names or wanted:
        if name in read_table():  # Another process may have made it meanwhile.
            continue
        slices = study.mines[name].run_slices()
        slices["steps"] = [step | {"events": []} for step in slices["steps"]]
        datasets = {path: dataset for path, dataset, _ in run_stages(slices, Path("failed_state.npz"))}
        found = measure(Variant(study.mines[name], lambda path: datasets[path.removesuffix(".nc")]))  # noqa: B023
        with TABLE.open("a", encoding="utf-8") as file:
            file.write(",".join([name, *(f"{getattr(found, column):.6g}" for column in COLUMNS[1:])]) + "\n")
    law = fit(cell_errors(read_table(), study.settings["scenes"]))
    print(f"ERROR_AT_ONE_CELL = {law.at_one_cell:.2g}\nERROR_ORDER = {law.order:.2g}\nMIN_ERROR = {law.least:.2g}")


if __name__ == "__main__":
    main(sys.argv[1:])
