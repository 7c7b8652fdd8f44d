"""One stope on cells that follow the rock, against cells that are fine everywhere, and with ever more increments."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from catalogs.figures import style
from mpm_core.equilibrium.increments import potency
from verification.comparisons import failed_in_step, released_potency, reported, vanishing
from verification.page_tables import Pivot
from verification.plots import GRID, plot_cells, plot_series
from verification.results import Results, Variant
from verification.rows import Row

TABLES = (
    Pivot(
        "Rock above strength in coarse cells (share; none is allowed)",
        r"(?P<row>\w+): (?P<column>rock above strength in coarse cells), share",
        "measured",
    ),
)

STEP = "mined"
SECTION_HALF_WIDTH = 22.0  # Half the width of the drawn sections around the middle of the stope, m.


class Run:
    """Results of the step. potency, flow: potency m3 of the drop and of later flow, summed over rock that failed in it.

    volume: of failed rock, m3. overshoot: over the drop, of rock that fails first in an increment. cycles: V-cycles.
    seconds: processor time without compiling, s. memory: MiB.
    """

    def __init__(self, variant: Variant):
        self.state = variant.step(STEP)
        self.facts = self.state.attrs
        self.failed = failed_in_step(self.state)
        volume = self.state.volume.values[self.failed]
        self.potency = released_potency(self.state)
        self.flow = float(potency(self.state.later_strain.values[self.failed], volume).sum())
        self.volume = float(self.facts["failed_volume"])
        self.particles = int(self.facts["failed_particles"])
        self.overshoot = float(self.facts["overshoot_share"])
        self.cycles = int(self.facts["iterations"])
        self.seconds = variant.processor_time(f"steps/{STEP}")
        self.memory = variant.peak_memory(f"steps/{STEP}")

    @property
    def cost(self) -> float | None:
        """Processor time of the step for each failed particle, ms; None where nothing measured it."""
        return None if self.seconds is None else 1e3 * self.seconds / max(self.particles, 1)


def answer(results: Results) -> tuple[list[Row], Figure]:
    """Rows and figure of the study."""
    settings, allowed = results.settings, results.allowed
    runs = {name: Run(variant) for name, variant in results.variants.items()}
    fine, first = runs[settings["everywhere"]], runs[settings["rings"][0]]
    rows = []
    for name in settings["rings"]:
        rows += same(name, "fine cells everywhere", runs[name], fine, allowed["grid"])
    rows += same(settings["mirrored"], settings["rings"][0], runs[settings["mirrored"]], first, allowed["mirror"])
    for between, moved in settings["moved"].items():
        rows += same(moved, f"walls between cells ({between})", runs[moved], runs[between], None)
    for name, run in runs.items():
        share = float(run.facts["truncated_share"])
        rows.append(vanishing(f"{name}: rock above strength in coarse cells, share", share, 0.0))
    most = runs[settings["parts"][-1]]
    for name in [*settings["parts"][:-1], *settings["chosen"]]:
        run = runs[name]
        remark = f"{run.facts['increments']} increments, overshoot {run.overshoot:.2f} of the drop"
        bound = allowed["increments"] if name == settings["asked"] else None
        quantity = f"{name}: potency over that of {most.facts['increments']} increments"
        rows.append(Row.relative(quantity, 1.0, run.potency / most.potency, bound, remark))
    rows += plastic(runs, settings, allowed)
    for name in settings["cells"]:
        run = runs[name]
        cost = run.cost
        if cost is None:
            continue
        remark = (
            f"{run.particles} failed particles, {run.facts['cells']} cells, {run.seconds:.1f} s without compiling, "
            f"{run.memory:.0f} MiB"
        )
        quantity = f"{name}: processor time of the step for each failed particle, ms"
        rows.append(reported(quantity, cost, remark))
    return rows, draw(results, runs)


def same(name: str, other: str, run: Run, expected: Run, bound: float | None) -> list[Row]:
    """Potency and failed volume of a run against those of another."""
    remark = f"{run.facts['cells']} cells, {run.facts['finest_cells']} of the finest; {expected.facts['cells']} cells"
    return [
        Row.relative(f"{name}: {what} as with {other}, {unit}", wanted, found, bound, remark)
        for what, unit, wanted, found in (
            ("seismic potency", "m3", expected.potency, run.potency),
            ("failed volume", "m3", expected.volume, run.volume),
        )
    ]


def plastic(runs: dict[str, Run], settings: dict, allowed: dict) -> list[Row]:
    """V-cycles where no strength is lost, on ever finer cells, and the effect of a looser tolerance on flow."""
    rows = []
    for name in settings["plastic"]:
        run = runs[name]
        remark = f"{run.facts['cells']} cells, split {run.facts['cell_splits']} times, {run.particles} flow"
        rows.append(vanishing(f"{name}: V-cycles of the step", run.cycles, allowed["cycles"], remark))
    strict = runs[settings["plastic"][2]]
    for name in settings["looser"]:
        run = runs[name]
        bound = allowed["looser"] if name == settings["enough"] else None
        remark = f"{run.cycles} V-cycles, {strict.cycles} at {strict.facts['tolerance']:.0e}"
        rows.append(Row.relative(f"{name}: potency of all that flowed, m3", strict.flow, run.flow, bound, remark))
    return rows


def draw(results: Results, runs: dict[str, Run]) -> Figure:
    """Sections through the stope on both grids, excess potency by increments, and cost of a failed particle."""
    settings = results.settings
    figure = style.new_figure(height=8.2)
    (left, right), (below, cost) = figure.subplots(2, 2)
    for panel, name in ((left, settings["rings"][0]), (right, settings["everywhere"])):
        draw_section(panel, runs[name])
        panel.set_title(f"{name}: {runs[name].facts['cells']} cells")
    most, excess, notes = runs[settings["parts"][-1]], {}, {}
    for names, label in (
        (settings["parts"][:-1], "equal increments"),
        (settings["chosen"], "increments that follow their error"),
    ):
        some = [runs[name] for name in names]
        excess[label] = [run.overshoot for run in some], [abs(run.potency / most.potency - 1.0) for run in some]
        notes[label] = [str(run.facts["increments"]) for run in some]
    plot_series(
        below,
        excess,
        {"as large as it says": ([0.02, 1.0], [0.02, 1.0])},
        marks=("o", "s"),
        notes=notes,
        xscale="log",
        yscale="log",
        xlabel="overshoot of the first that fail, over their drop",
        ylabel=f"potency beside that of {most.facts['increments']} increments, share off",
    )
    measured = [runs[name] for name in settings["cells"] if runs[name].particles]
    shown = [(run.particles, run.cost) for run in measured if run.cost is not None]
    plot_series(
        cost,
        {"": ([count for count, _ in shown], [each for _, each in shown])},
        marks="o-",
        xscale="log",
        yscale="log",
        xlabel="failed particles",
        ylabel="processor time of the step for each,\nstart included, compiling not (ms)",
    )
    for panel in (below, cost):
        panel.grid(which="major", **GRID)
    return figure


def draw_section(panel: Axes, run: Run) -> None:
    """Cells cut by the section along x through the middle of the stope. Those with failed rock are filled."""
    state, middle, half = run.state, np.array([80.0, 80.0, 980.0]), SECTION_HALF_WIDTH
    low, size = state.cell_origin.values, state.cell_size.values
    cut = (low[:, 1] <= middle[1]) & (low[:, 1] + size > middle[1])
    failed = np.zeros(len(size), bool)
    failed[state.cell.values[run.failed]] = True
    for chosen, colour in ((cut & ~failed, "none"), (cut & failed, style.MODELLED)):
        look = {"facecolor": colour, "edgecolor": "#999999", "linewidth": 0.3, "rasterized": False}
        plot_cells(panel, low[chosen][:, [0, 2]], size[chosen], **look)
    panel.plot([75, 85, 85, 75, 75], [970, 970, 990, 990, 970], color="black", linewidth=1.2)
    panel.set(xlim=(middle[0] - half, middle[0] + half), ylim=(middle[2] - half, middle[2] + half), aspect="equal")
    panel.set(xlabel="x (m)", ylabel="z (m); failed rock filled, stope in black")
