"""Checks of what a mine is compared with: other plans, faces, baselines and kept forecasts."""

import difflib

import numpy as np

from catalogs.compare.face import Face
from catalogs.records.times import parse_time
from catalogs.settings import FacePosition
from common.errors import InputError, Mistakes
from workflow.dates import read_date
from workflow.face_positions import face_positions
from workflow.mine import Mine
from workflow.mine_settings import MINE_FILE_PLAN


def check_plans(mine: Mine, mistakes: Mistakes) -> None:
    """Names of plans, and of the excavations that they change. What a plan becomes is checked when it is asked for."""
    seen: list[str] = []
    written = [str(entry.get("name")) for entry in mine.text.get("excavations", ())]
    made = [entry.name for entry in mine.excavations]
    source = "schedule" if mine.settings.schedule else "excavations_from"
    for name, plan in mine.settings.plans.items():
        where = f"plans.{name}"
        with mistakes.gather():
            if name.lower() == MINE_FILE_PLAN:
                raise InputError(
                    f"{where}: this is what the plan of the mine file itself is called; choose another name"
                )
            if name.lower() in seen:
                raise InputError(
                    f"{where}: differs from another plan in capitals alone, which are the same folder on some disks"
                )
        seen.append(name.lower())
        for step in plan.steps or ():
            for key, date in (("start", step.start), ("end", step.end)):
                with mistakes.gather():
                    if date is not None:
                        read_date(f"{where}.steps.{step.name}.{key}", date)
        for excavation in plan.excavations or {}:
            with mistakes.gather():
                if excavation not in written and excavation in made:
                    raise InputError(
                        f"{where}.excavations.{excavation}: comes from {source}, which a plan cannot change; "
                        f"give {where}.file, a mine file of its own that lists its excavations"
                    )
                if excavation not in written:
                    near = difflib.get_close_matches(excavation, written, n=1)
                    meant = f"did you mean {near[0]}?" if near else "write it there first, with step: planned"
                    raise InputError(f"{where}.excavations.{excavation}: no excavation of the mine file; {meant}")
        with mistakes.gather():
            if plan.file is not None and not mine.path(plan.file).is_file():
                raise InputError(f"{where}.file: {mine.path(plan.file)}: no such file")


def check_face(mine: Mine, _: Mistakes) -> None:
    """A face is in plan, and stands somewhere at the end of a dated step. Raises InputError."""
    if mine.settings.face is None:
        return
    if mine.plane == "xz":
        raise InputError("face: its positions are in plan, which a scene with plane: xz does not have; leave it out")
    ends = [step.end for step in mine.listed_steps if step.is_dated]
    if not ends:
        raise InputError("face: no step has dates to compare events in; give steps start and end, or leave it out")
    face = Face.of([FacePosition.of(one) for one in face_positions(mine)])
    known = np.isfinite(face.at(np.array([parse_time(end, "steps") for end in ends])).ahead).all(axis=1)
    if not known.any():
        raise InputError(
            f"face: no position before and after the end of any dated step ({', '.join(ends)}); give positions that "
            "cover the steps"
        )


def check_baselines(mine: Mine, mistakes: Mistakes) -> None:
    """Check the date from which earlier months are read, and the radii of flaws against the domain."""
    settings, domain = mine.settings.baselines, mine.settings.domain
    starts = [step.start for step in mine.listed_steps if step.is_dated]
    if settings.since is not None:
        with mistakes.gather():
            since = read_date("baselines.since", settings.since)
            if starts and since > read_date("steps", starts[0]):
                raise InputError(
                    f"baselines.since: {settings.since} is after the first dated step begins, {starts[0]}; give an "
                    "earlier date, or leave it out"
                )
    if settings.radii is not None and mine.dimension == 3:
        edge = min(high - low for low, high in zip(domain.lower, domain.upper, strict=True))
        if settings.radii[1] > 0.5 * edge:
            mistakes.add(
                f"baselines.radii: a flaw with a radius of {settings.radii[1]:g} m does not fit into the domain, whose "
                f"shortest edge is {edge:g} m; give a smaller largest radius"
            )


def check_forecasts(mine: Mine, mistakes: Mistakes) -> None:
    """Kept forecasts that are there, of a mine whose record can score them."""
    forecasts, seen = mine.settings.forecasts, set[str]()
    if forecasts and (mine.settings.record is None or not mine.dated_steps):
        raise InputError("forecasts: there is no record to score them by; give one, or leave them out")
    for number, name in enumerate(forecasts):
        with mistakes.gather():
            if not mine.path(name).is_file():
                raise InputError(f"forecasts.{number}: {mine.path(name)}: no such file")
            place = mine.path(name).resolve().as_posix()
            if place in seen:
                raise InputError(f"forecasts.{number}: {name} stands twice; leave one out")
            seen.add(place)
