"""Warnings that come before any number: in full for the appendix, in a clause for the first page.

The template is "warnings.html.j2".
"""

import json
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from catalogs.compare.bands import MAX_RATIO
from catalogs.report.cell_effects import cells_too_large
from catalogs.report.evidence import Evidence, ExcavationRow
from catalogs.report.gallery import Gallery
from catalogs.report.sections import section_number
from catalogs.report.text import MAX_NAMED, number, percent, plural, typeset, whole
from common.cell_sizes import CELLS_ACROSS_FILL, largest_cell

MAX_OPEN_SHARE = 0.05  # Share of an excavation's volume that may depend on how its surface is closed without a banner.
MAX_VOLUME_ERROR = 0.05  # Relative error of an excavation's volume on the grid without a banner.
MIN_BAND_SHARE = 0.01  # Of the failed rock: smaller bands along the grid are told only where they are no chance.
MAX_TRUNCATED_SHARE = 0.5  # With a larger share of overstressed rock too coarse to fail, the numbers are of no use.


@dataclass(frozen=True)
class Advice:
    """Advice to the reader: a sentence (text), and the key or command to follow it with (code); empty without one."""

    text: str
    code: str = ""


@dataclass(frozen=True)
class Banner:
    """Warning or note to the reader. kind: its style in the appendix; text: sentences; brief: the same as a clause,
    empty if the first page omits it; mend: advice on it; invalid: the numbers must not be used until it is followed."""

    kind: str
    text: str
    brief: str = ""
    mend: Advice | None = None
    invalid: bool = False


def section(evidence: Evidence, _: Gallery) -> list[Banner]:
    """Banners of the report, those that make the numbers invalid first."""
    return banners(evidence)


def banners(evidence: Evidence) -> list[Banner]:
    """Banners of the report, those that make the numbers invalid first; others by topic."""
    found = [
        *_collapse(evidence), *_numbers(evidence), *_solids(evidence), *_falls(evidence), *_loose(evidence),
        *_bands(evidence), *_notes(evidence),
    ]  # fmt: skip
    return sorted(found, key=lambda one: not one.invalid)


def _numbers(evidence: Evidence) -> Iterator[Banner]:
    """Banners on the numbers as a whole: draft, cells too large, rock too coarse to fail, failure at the boundary."""
    cell = float(evidence.grid.attrs["fine_cell"])
    if evidence.config.get("accuracy") == "draft":
        yield Banner(
            "draft", draft(evidence), "this is a draft", Advice("Compute the mine without", "accuracy: draft"), True
        )
    if text := cells_too_large(evidence):
        brief = f"cells of {cell:g} m are too large to say how far potency would still change"
        yield Banner("truncated", text, brief, finer_cells(evidence), invalid=True)
    if text := missing_potency(evidence):
        worst = max(_truncated(evidence), key=lambda step: step["truncated_share"])
        share = float(worst["truncated_share"])
        stage = f"in {worst['step']}" if worst["step"] else "before mining"
        brief = f"{percent(share)} of the rock that reached its strength {stage} lies in cells too coarse to fail"
        yield Banner("truncated", text, brief, _refine(evidence), invalid=share > MAX_TRUNCATED_SHARE)
    if text := at_boundary(evidence):
        mend = Advice("Make the modelled box of rock larger, or check strength and in-situ stress:", "domain")
        yield Banner("truncated", text, "failed rock has reached the edge of the modelled box", mend)


def finer_cells(evidence: Evidence) -> Advice:
    """Advice to halve the cells, with the key by which the mine file sets them."""
    if isinstance(evidence.config.get("accuracy"), dict):  # the cells follow from a request
        return Advice("Ask for a smaller error, or take accuracy out and halve the cells:", "accuracy: {error: ... %}")
    cell, grid = float(evidence.grid.attrs["fine_cell"]), evidence.config.get("grid", {})
    by_levels = "finest_cell" not in grid and "levels" in grid
    code = f"grid.levels: {int(grid['levels']) + 1}" if by_levels else f"grid.finest_cell: {cell / 2:g} m"
    return Advice("Compute the mine again with cells of half the size:", code)


def _refine(evidence: Evidence) -> Advice:
    """Advice to let rock in coarse cells fail."""
    grid, text = evidence.config.get("grid", {}), "Allow small cells where rock is overstressed:"
    if grid.get("refinement") == "adaptive" and "max_cells" in grid:
        return Advice(text, f"grid.max_cells: {2 * int(grid['max_cells'])}")
    return Advice(text, "grid.refinement: adaptive")


def _solids(evidence: Evidence) -> Iterator[Banner]:
    """Banners on mined excavations: volume on the grid, solids that are not closed, openings narrow for the cells."""
    rows, cell = [row for row in evidence.excavations if not row.planned], float(evidence.grid.attrs["fine_cell"])
    off = [(row.drawn / row.solid - 1, row.name) for row in rows if row.solid > 0]
    off = sorted((one for one in off if abs(one[0]) > MAX_VOLUME_ERROR), key=lambda one: -abs(one[0]))
    if off:
        named = _named([f"{name} {100 * error:+.0f} %".replace("-", "−") for error, name in off])
        text = (
            f"The grid misses the volume of {plural(len(off), 'excavation')} by more than {percent(MAX_VOLUME_ERROR)}: "
            f"{named}. Refine the grid, or check whether these solids are closed (section {section_number('scene')})."
        )
        brief = f"the grid misses the volume of {_few([name for _, name in off])}"
        yield Banner("volume", text, brief, finer_cells(evidence))
    if idle := [row.name for row in rows if row.drawn > 0 and row.mined == 0 and row.fill_mined == 0]:
        text = (
            f"{_named(idle)}: nothing is left to mine there. Others have mined all of it, in an earlier step or in the "
            "same one. Check the steps of these excavations, and whether their solids are those of a later stage."
        )
        yield Banner("volume", text, f"nothing left to mine: {_few(idle)}")
    opened = sorted(((row.open, row.name) for row in rows if row.open > MAX_OPEN_SHARE), reverse=True)
    if opened:
        named = _named([f"{name} {percent(share)}" for share, name in opened])
        text = (
            f"Large parts of the surface are missing or look the other way: {named} of the volume depends on how it "
            "is closed. Export these solids again as closed surfaces."
        )
        names = _few([name for _, name in opened])
        yield Banner("volume", text, f"no closed solid: {names}", Advice(f"Export as closed surfaces: {names}."))
    if sheets := sorted(row.name for row in rows if row.narrow and not row.across > 0):
        text = (
            f"A quarter of the surface or more encloses nothing, as a repeated sheet does: {_named(sheets)}. How many "
            "cells these excavations have across is not known. Export these solids again as closed surfaces."
        )
        names = _few(sheets)
        yield Banner(
            "volume", text, f"surface encloses nothing: {names}", Advice(f"Export as closed surfaces: {names}.")
        )
    thin = [row for row in rows if row.narrow and row.across > 0]
    thin.sort(key=lambda row: (row.across / row.needed, row.name))
    unheld = [row for row in rows if row.unheld]
    size_narrow = _smallest([largest_cell(row.across * cell, row.needed) for row in thin])
    size_fill = _smallest([largest_cell(row.across * cell, CELLS_ACROSS_FILL) for row in unheld if row.across > 0])
    mend = _cells_of(min((size for size in (size_narrow, size_fill) if size), key=float, default=""))
    if thin:
        named = _named([f"{row.name} {row.across:.1f} of {row.needed:.0f}" for row in thin])
        text = (
            f"Narrow for cells of {number(cell)} m, by cells across and how many are needed: {named}. The walls of "
            "such an opening close too little, and far too little rock fails around it. "
            f"Cells of {size_narrow} m are small enough."
        )
        names = _few([row.name for row in thin])
        brief = f"too narrow for cells of {cell:g} m, so that too little rock fails there: {names}"
        yield Banner("truncated", text, brief, mend)
    if unheld:
        yield _unheld_fill(evidence, rows, size_fill, mend)


def _unheld_fill(evidence: Evidence, rows: list[ExcavationRow], size: str, mend: Advice | None) -> Banner:
    """Banner on fill that was placed but does not hold the walls of its opening.

    rows: of mined excavations; size: edge, m, of cells with which it would; empty where that is not known.
    """
    steps = [step["step"] for step in evidence.steps]
    filled = [row for row in rows if row.unheld or (row.fill != "none" and (row.filled in steps or row.filled_at_once))]
    unheld = [row for row in filled if row.unheld]
    count = f"{whole(len(unheld))} of {plural(len(filled), 'filled excavation')}"
    text = (
        f"Fill does not hold the walls of {count}, at {plural(sum(row.unheld for row in unheld), 'node')}: "
        f"{_named([row.name for row in unheld])}. This is a limit of the grid, not of the mine: these are fewer than "
        f"{CELLS_ACROSS_FILL} cells across. Their walls "
        "moved apart while they stood open, and fill that was placed later moves with one of them. Rock fails there as "
        f"if they were still open. {f'Use cells of {size} m or less, or fill' if size else 'Fill'} in the step that "
        "mines."
    )
    brief = f"cells too large for fill to touch the walls of {count} (the grid's limit, not the mine's)"
    return Banner("truncated", text, brief, mend)


def _smallest(sizes: list[float]) -> str:
    """The smallest of some cell sizes, m; empty where there are none."""
    return f"{min(sizes):g}" if sizes else ""


def _cells_of(size: str) -> Advice | None:
    """Advice to use cells of a size, m; None for an empty size."""
    if not size:
        return None
    return Advice("Compute the mine again with cells that fit its openings:", f"grid.finest_cell: {size} m")


def _steps(evidence: Evidence) -> list[dict]:
    """Attributes of the steps, or of the stages where none is listed."""
    return evidence.steps or [stage.attrs for stage in evidence.stages]


def _collapse(evidence: Evidence) -> Iterator[Banner]:
    """The first step in which rock found no equilibrium: what follows is not computed."""
    collapsed = [step for step in _steps(evidence) if int(step.get("collapsed", 0))]
    if not collapsed:
        return
    first, after = collapsed[0], collapsed[1:]
    text = f"Rock found no equilibrium in step {first['step']}: {first['collapse']}. "
    text += "What is shown of this step is its last equilibrium"
    text += f"; {plural(len(after), 'later step')} {'is' if len(after) == 1 else 'are'} not computed." if after else "."
    brief = f"the mine finds no equilibrium in {first['step']}, and all after that is missing"
    mend = Advice("See docs/how-to/loose-rock.md: mine this step in parts, fill earlier, or check residual strength.")
    yield Banner("truncated", text, brief, mend, invalid=True)


def _falls(evidence: Evidence) -> Iterator[Banner]:
    """Rock that came loose as it failed, by step."""
    for step in _steps(evidence):
        pieces = json.loads(step.get("falls", "[]"))
        if not pieces:
            continue
        total, falls = sum(piece["volume"] for piece in pieces), len({piece["fall"] for piece in pieces})
        named = "; ".join(_fall_text(piece) for piece in pieces[:MAX_NAMED])
        more = f"; and {len(pieces) - MAX_NAMED} smaller pieces" if len(pieces) > MAX_NAMED else ""
        text = f"Rock fell in step {step['step']}: {number(total)} m³ in {plural(falls, 'fall')}: {named}{more}. "
        text += "It came loose as it failed, makes no event, and counts as excavated from then on."
        largest = pieces[0]
        where = f"from the {largest['side']} of {largest['opening']}" if largest["opening"] else "from the rock"
        brief = f"{number(total)} m³ fell in {step['step']}, most of it {where}"
        yield Banner("note", text, brief, Advice("See docs/how-to/loose-rock.md for what decides a fall."))


def _fall_text(piece: dict) -> str:
    """Volume, opening and place of a piece that fell."""
    names, place = ", ".join(piece["place"]), ", ".join(f"{along:.1f}" for along in piece["place"].values())
    source = f" from the {piece['side']} of {piece['opening']}" if piece["opening"] else ""
    return f"{number(piece['volume'])} m³{source} at ({names}) = ({place}) m"


def _loose(evidence: Evidence) -> Iterator[Banner]:
    """Rock that nothing holds; pieces smaller than a finest cell are worth a note."""
    for step in _steps(evidence):
        if not int(step.get("loose_pieces", 0)):
            continue
        text = f"Unsupported rock in step {step['step']}: {plural(int(step['loose_pieces']), 'piece')}, "
        text += f"{number(step['loose_volume'])} m³, "
        text += f"{typeset(step['loose_where']).replace(' m3 ', ' m³ ')}, counts as excavated"
        text += " from then on, since nothing held it. Check the solids there."
        small = step["loose_volume"] < _finest_volume(evidence)
        brief = f"{number(step['loose_volume'])} m³ of rock that nothing held count as excavated ({step['step']})"
        mend = Advice(f"Check the solids of step {step['step']} for thin shells between them.")
        yield Banner("note", text) if small else Banner("truncated", text, brief, mend)


def _bands(evidence: Evidence) -> Iterator[Banner]:
    """Bands of failed rock along the axes of the grid, where there are more of them than along mirrored directions."""
    found = evidence.bands
    if found is None:
        return
    assert evidence.state is not None
    along, mirrored = int(found.along.sum()), int(found.mirrored.sum())
    failed = int(np.count_nonzero(evidence.state["failed"].values >= 0))
    if not found.is_told and (along < MIN_BAND_SHARE * failed or along <= MAX_RATIO * mirrored):
        return
    text = (
        f"Failed rock lies in thin bands along the axes of the grid at {plural(along, 'particle')}, in "
        f"{plural(len(found.along), 'band')}. Along their mirror images, where rock without a grid breaks as often, it "
        f"does at {whole(mirrored)}. "
    )
    if found.is_told:
        text += f"Chance seldom makes such a difference (p = {found.chance:.2g}): the grid chooses these bands. "
    else:
        text += "So few bands may differ by chance. "
    text += (
        "Do not read such a band as a structure: its direction, and how far it reaches, may be those of the grid "
        "(study bands). Compute the mine turned by some 20 degrees to see which bands stay."
    )
    yield Banner("note", text)


def _notes(evidence: Evidence) -> Iterator[Banner]:
    """Banners on what the numbers describe: fill placed while mining, a twin, no record, the cut of the comparison."""
    at_once = [row.name for row in evidence.excavations if row.dated and row.filled_at_once]
    if at_once:
        text = f"These excavations are filled while they are mined: {_named(at_once)}. "
        text += "Their fill is in place while their own step unloads the rock, and it supports walls and failed rock. "
        yield Banner("note", text + "An opening that is filled in a later step (key filled) makes more events.")
    if evidence.is_twin:
        text = "The record shown is a twin: a catalogue that this pipeline made itself with other settings. "
        yield Banner("twin", text + "It was not measured.")
    if evidence.record is None and evidence.steps and "record" not in evidence.config:
        yield Banner("note", "No recorded catalogue was given, so this report cannot say how well the model fits.")
    if evidence.comparison is not None and evidence.comparison["events_above_cut"].values.all():
        yield Banner("note", f"Model and record are compared from {typeset(evidence.comparison.attrs['cut_text'])}.")


def draft(evidence: Evidence) -> str:
    """Sentences on how a draft departs from the settings of the mine file: cells, tolerances and increments."""
    lost = json.loads(evidence.grid.attrs.get("draft_would_lose", "[]"))
    cells = "" if lost else "cells of twice the size, "
    text = (
        f"A draft has {cells}looser tolerances and larger increments than section {section_number('config')} states. "
    )
    if lost:
        text += "It keeps the cells of the mine file, since hardly any cell of twice the size would lie wholly in "
        text += f"{lost[0]}" + (f" and {plural(len(lost) - 1, 'other excavation')}. " if len(lost) > 1 else ". ")
    return text + "Its numbers are preliminary. Compute the mine without accuracy: draft for numbers to use."


def missing_potency(evidence: Evidence) -> str:
    """A sentence or two on rock in cells that were too coarse to fail; empty if there is none.

    The missing potency of a step is estimated from its truncated share s, that of rock above its strength in coarse
    cells. This rock is assumed to release as much per volume as the rock that failed, so s / (1 - s) of the step's
    potency. The estimate has not been compared with a run without coarse rock.
    """
    found = _truncated(evidence)
    if not found:
        return ""
    short = found[0] in evidence.dated
    worst = max(found, key=lambda step: step["truncated_share"])
    shares = sorted(float(step["truncated_share"]) for step in found)
    span = percent(shares[0]) if len(shares) == 1 else f"{number(100 * shares[0], 2)} to {percent(shares[-1])}"
    where = typeset(worst["truncated_where"]).split(";")[0]
    which = "the dated steps" if short else "the steps before the record" if evidence.steps else "the elastic stage"
    text = f"In {which}, {span} of the rock that reached its strength lies in cells too coarse to fail"
    place = f"; most in {worst['step']}, {where}. Refine the grid there (section {section_number('truncated')})."
    if not short or evidence.catalog is None:
        return text + place
    potency, step = evidence.catalog["potency"].values, evidence.catalog["step"].values
    more = sum(
        float(potency[step == one["step"]].sum()) * one["truncated_share"] / (1 - one["truncated_share"])
        for one in found
        if one["truncated_share"] < 1
    )
    lead = (
        f"About {number(more, 2)} m³ of potency is missing from the {number(potency.sum())} m³ of the model's events: "
    )
    return lead + text[0].lower() + text[1:] + place


def _truncated(evidence: Evidence) -> list[dict]:
    """Dated steps with rock too coarse to fail; if there is none, other stages with such rock."""
    dated = [step for step in evidence.dated if int(step["truncated"])]
    return dated or [stage.attrs for stage in evidence.stages if int(stage.attrs["truncated"])]


def at_boundary(evidence: Evidence) -> str:
    """Sentences on failed rock that has reached a held or loaded face of the domain; empty if none has."""
    reached = [step for step in evidence.steps if step.get("boundary_failed_faces")]
    if not reached:
        return ""
    last = max(reached, key=lambda step: step["boundary_failed_volume"])
    return (
        f"Failed rock has reached the domain's boundary ({last['boundary_failed_faces']}; "
        f"{number(last['boundary_failed_volume'])} m³ of its cells lie there in step {last['step']}): the "
        "boundary condition decides what fails there. Make the domain larger, or check whether the rock is as weak as "
        "assumed. On a plane of symmetry this is no error."
    )


def _named(parts: list[str]) -> str:
    """The first MAX_NAMED of them, and how many more there are."""
    more = f" and {len(parts) - MAX_NAMED} more" if len(parts) > MAX_NAMED else ""
    return ", ".join(parts[:MAX_NAMED]) + more


def _few(names: list[str]) -> str:
    """The first name, and how many more there are: for a clause."""
    return names[0] + (f" and {len(names) - 1} more" if len(names) > 1 else "")


def _finest_volume(evidence: Evidence) -> float:
    """Volume of a finest cell, m3."""
    attributes = evidence.grid.attrs
    volume = float(attributes["fine_cell"]) ** int(attributes.get("dimension", 3))
    return volume * float(attributes.get("thickness", 1.0))
