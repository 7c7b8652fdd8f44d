"""Checks of `observations.scans`: excavations that are mined and open when a scan is taken, and its surface."""

import difflib

from common.errors import InputError, Mistakes
from response.scan_settings import ObservedScan
from workflow.dates import read_date
from workflow.mine import Mine


def check_scans(mine: Mine, mistakes: Mistakes) -> None:
    """Steps, excavations and surfaces of scans; each mistake on a line of its own."""
    assert mine.settings.observations is not None
    for number, scan in enumerate(mine.settings.observations.scans):
        where = f"observations.scans[{number}]"
        before = len(mistakes.lines)
        with mistakes.gather():
            step = _step_of(mine, where, scan)
            for name in scan.excavations:
                with mistakes.gather():
                    _check_excavation(mine, where, name, step)
        if len(mistakes.lines) == before:
            with mistakes.gather():
                _check_surface(mine, where, scan)


def _step_of(mine: Mine, where: str, scan: ObservedScan) -> str:
    """The step that a scan is compared with. Raises InputError without one."""
    if scan.step is not None:
        if scan.step not in mine.mined_steps:
            near = difflib.get_close_matches(scan.step, mine.mined_steps, n=1)
            meant = f"did you mean {near[0]}?" if near else f"there are {', '.join(mine.mined_steps) or 'none'}"
            raise InputError(f"{where}.step: no step {scan.step}; {meant}")
        return scan.step
    if not mine.dated_steps:
        raise InputError(f"{where}.date: no step has dates, so none is known at that of a scan; give step")
    read_date(f"{where}.date", str(scan.date))
    if not (step := mine.scan_step(scan)):
        first = mine.dated_steps[0]
        raise InputError(f"{where}.date: {scan.date} is before the first dated step, {first}; correct it, or give step")
    return step


def _check_excavation(mine: Mine, where: str, name: str, step: str) -> None:
    """An excavation is known, has walls, and is mined and open at the end of the step."""
    known = {entry.name: entry for entry in mine.excavations}
    if name not in known:
        near = difflib.get_close_matches(name, known, n=1)
        meant = f"did you mean {near[0]}?" if near else f"there are {', '.join(known) or 'none'}"
        raise InputError(f"{where}.excavations: no excavation {name}; {meant}")
    entry, last = known[name], mine.mined_steps.index(step)
    if entry.outside:
        raise InputError(f"{where}.excavations: {name} is what a shape leaves of the domain; name one with walls")
    if entry.step not in mine.mined_steps[: last + 1]:
        when = f"is mined in {entry.step}" if entry.step in mine.mined_steps else "is planned"
        raise InputError(
            f"{where}.excavations: {name} {when}, the scan is that of the end of {step}; correct date, step or "
            "excavations"
        )
    if (
        entry.fill_material is not None
        and entry.fill_step in mine.mined_steps[: last + 1]
        and entry.fill_step != entry.step
    ):
        raise InputError(
            f"{where}.excavations: {name} is filled in {entry.fill_step}, so there is no void at the end of {step}; "
            f"give the step before it, step: {mine.previous(entry.fill_step)}"
        )


def _check_surface(mine: Mine, where: str, scan: ObservedScan) -> None:
    """The surface is there, bounds a volume, and is that of the excavations."""
    from mpm_core.scene.scene_solids import read_entry
    from response.scan_settings import PlacedScan
    from response.scanned_surface import read_scan

    known = {entry.name: entry for entry in mine.excavations}
    design = [read_entry(mine.placed(known[name]), mine.dimension, "excavations") for name in scan.excavations]
    read_scan(PlacedScan.of(mine.placed_scan(scan)), design, where)
