"""A mine's configuration as Snakemake has merged it: read, checked, in SI units."""

import contextlib
import copy
import datetime
import hashlib
import json
import logging
import math
import os
from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path

from common.errors import InputError, InputErrors, Mistakes
from common.job import content_of, files_of
from common.setting_types import MAX_INTEGER, key_of, short
from workflow import BASE, command_line
from workflow.accuracy import STANDARD
from workflow.checks import check_mine
from workflow.key_order import key_in, parts_of, section_of, sorted_by_place
from workflow.map_coordinates import on_map
from workflow.mine import Mine
from workflow.mine_settings import AccuracyRequest, MineSettings
from workflow.strict_yaml import read_yaml

ELASTIC = {"model": "elastic", "youngs_modulus": "1 GPa", "poisson_ratio": 0.25, "density": "2000 kg/m^3"}
IN_PLACE = {  # of required keys
    "name": "mine",
    "frame": {"surface": "0 m"},
    "insitu_stress": {"constant": {}},
    "materials": {"host": ELASTIC},
    "plane": "none",
    "ensemble": 0,
}
SIZE_KEYS = ("finest_cell", "coarse_cell", "levels")  # of section grid
LISTS = ("excavations", "rock_bodies", "loads", "strains", "steps")
FORESEEN = ("own", "half", "steps", "members", "companion")  # of a request: its quote, that of half the error, for what
REQUESTS = Path(".snakemake/requests")  # next to Snakemake's own notes
MAX_MISTAKES_SHOWN = 20  # more scroll away


def load_mine(mine_file: str | os.PathLike, changes: dict | None = None) -> Mine:
    """The mine of a file over the defaults, as Snakemake loads it, for a notebook or a script.

    changes: keys that differ from the file, as --config sets them. Raises InputError for a file that cannot be read,
    and InputErrors as `load`.
    """
    from snakemake.utils import update_config  # here: Snakemake itself has merged what `load` takes

    default = read_yaml(BASE / "config/default.yaml")
    text = copy.deepcopy(default)
    for values in (read_yaml(mine_file), changes or {}):
        update_config(text, values)
    return load(text, mine_file, default, changes)


def load(
    config: dict,
    mine_file: str | os.PathLike,
    default: dict | None = None,
    overrides: dict | None = None,
    may_lack_record: bool = False,
) -> Mine:
    """Check a merged configuration (default and mine) and convert it to SI; `default` is kept for the report.

    overrides: what of it --config says. may_lack_record: where all mistakes are in section record, return the mine
    without it, and the mistakes as its `record_mistakes`. Raises InputErrors: a line for each mistake, in the order of
    the file, with the file (or --config) and the key.
    """
    mine_file, mistakes = Path(mine_file), Mistakes()
    odd: dict[str, str] = {}
    text = normalise_yaml_values(config, odd)
    settings = None
    with mistakes.gather():
        settings = MineSettings.read(text)
    mistakes.lines = [
        *(f"{key}: {reason}" for key, reason in odd.items()),
        *(line for line in mistakes.lines if key_in(line) not in odd),
    ]
    if mistakes.lines:
        text, settings = valid_subset(text, map(key_in, mistakes.lines))
    request = settings.accuracy if settings else None
    if settings and isinstance(request, AccuracyRequest):
        asked = text["accuracy"]
        text, settings = text | {"accuracy": STANDARD}, settings.model_copy(update={"accuracy": STANDARD})
    if settings:
        grid_text = ""
        with mistakes.gather():
            settings, grid_text = on_map(settings)
        broken = {section_of(line) for line in mistakes.lines}
        with mistakes.gather():
            mine = Mine(settings, text, mine_file.parent, default or {})
            mine.grid_text = grid_text
            check_mine(mine, mistakes, broken)
    if mistakes.lines:
        lines = sorted_by_place(list(dict.fromkeys(mistakes.lines)), mine_file, overrides or {})
        most = MAX_MISTAKES_SHOWN + sum(
            section_of(line) == "schedule" for line in mistakes.lines
        )  # Those of a table are all shown.
        if len(lines) > most + 1:
            lines[most:] = [f"{mine_file}: and {len(lines) - most} more mistakes"]
        if may_lack_record and all(section_of(line) == "record" for line in mistakes.lines):
            rest = {key: value for key, value in config.items() if key not in ("record", "forecasts")}
            with contextlib.suppress(InputError):  # of what needs the record
                mine = load(rest, mine_file, default, overrides)
                mine.record_mistakes = "; ".join(lines)
                return mine
        raise InputErrors(lines)
    if isinstance(request, AccuracyRequest):
        try:
            found = on_requested_cells(mine, request, mine_file)
            found.asked = asked
            return found
        except InputErrors:  # of the file on those cells
            raise
        except InputError as error:
            raise InputErrors([f"{mine_file}: {error}"]) from error
    return mine


def on_requested_cells(mine: Mine, request: AccuracyRequest, mine_file: Path) -> Mine:
    """The mine with the grid that a request asks for, as if its file gave that. Raises InputError where it cannot.

    What was chosen is kept in REQUESTS, for the rock, the solids and the first steps of the mine: free memory, and on a
    cluster the number of cores, is another one at each start, and with other cells all stages would run again.
    """
    from common.kernel_cache import use_numba_cache

    use_numba_cache()
    from workflow.quote import Quotes, available_cores, choose, quote_slice, quote_source

    grid = mine.settings.grid
    settings, code = quote_slice(mine), quote_source()
    content = [content_of(path) for path in files_of(settings["pilots"][:1])]
    like = [settings[key] for key in ("doubled", "cell", "max_cells", "companion", "members", "pilots")]
    parts = json.dumps([request.given(), *like, content, code], sort_keys=True)
    path = REQUESTS / f"{mine.name}_{hashlib.sha256(parts.encode()).hexdigest()[:16]}.json"
    kept = _kept_choice(path)
    if kept is None:
        quotes = Quotes(settings, code, command_line.cores or available_cores())
        cell = choose(quotes, request)
    else:
        cell = kept["cell"]
    written = {key: value for key, value in (mine.text.get("grid") or {}).items() if key not in SIZE_KEYS}
    if not settings["doubled"] or mine.far_field:
        written["finest_cell"] = f"{cell:.15g} m"
    else:
        written["coarse_cell"] = f"{grid.coarse_cell:.15g} m"
    if settings["doubled"]:
        written["levels"] = grid.levels + round(math.log2(mine.finest_cell / cell))
    try:
        found = load(mine.text | {"grid": written}, mine_file, mine.default)
    except InputErrors as errors:
        on = f"on the cells of {cell:.3g} m that follow from accuracy"
        raise InputErrors(f"{line} ({on})" for line in errors.lines) from errors
    if kept is None:
        own = quotes.at(found.finest_cell)
        half, said = quotes.half(own), own.text()
        if where := quotes.pilot.collapsed:
            said += f"; the mine that was tried collapses in {where}, and steps after it are taken to cost nothing"
        kept = {"cell": cell, "said": said, "own": asdict(own), "half": half and asdict(half)}
        kept |= {key: settings[key] for key in ("steps", "members", "companion")}
        _keep_choice(path, kept)
    found.requested = f"accuracy: cells of {found.finest_cell:.3g} m; {kept['said']}"
    found.foreseen = {key: kept[key] for key in FORESEEN}
    return found


def _keep_choice(path: Path, choice: dict) -> None:
    from common.datasets import atomic_path

    try:
        with atomic_path(path) as temporary:
            temporary.write_text(json.dumps(choice), encoding="utf-8")
    except (InputError, OSError) as error:
        logging.info("%s", error)


def _kept_choice(path: Path) -> dict | None:
    """What was chosen for a request: the finest cells (m), what was said of them, and FORESEEN; None if nothing was
    yet."""
    try:
        kept = json.loads(path.read_text(encoding="utf-8"))
        return {"cell": float(kept["cell"]), "said": str(kept["said"])} | {key: kept[key] for key in FORESEEN}
    except (OSError, ValueError, KeyError, TypeError):  # none yet, or no longer whole
        return None


def normalise_yaml_values(value, odd: dict[str, str], path=()):
    """The value with dates as they are meant. odd: receives numbers that nothing can be computed with, by their keys.

    A text that looks like a number stays text: what a key accepts is for its model to say
    (common.setting_types.number).
    """
    if isinstance(value, dict):
        return {str(key): normalise_yaml_values(entry, odd, (*path, str(key))) for key, entry in value.items()}
    if isinstance(value, list):
        return [normalise_yaml_values(entry, odd, (*path, index)) for index, entry in enumerate(value)]
    if isinstance(value, datetime.date | datetime.datetime):
        return value.isoformat()
    endless = isinstance(value, float) and not math.isfinite(value)
    if endless or (isinstance(value, int) and abs(value) > MAX_INTEGER):
        odd[key_of(path)] = f"{short(value)} is not a finite number that can be computed with"
    return value


def valid_subset(text: dict, keys: Iterable[str]) -> tuple[dict, MineSettings | None]:
    """The configuration without the entries and sections that these keys are in, as text and read; None if that fails.

    A step or a material keeps its name, which others refer to.
    """
    sound = dict(text)
    entries: dict[str, set[int]] = {name: set() for name in LISTS}
    for section, *rest in map(parts_of, keys):
        if section in LISTS and rest and isinstance(rest[0], int) and isinstance(text.get(section), list):
            entries[section].add(rest[0])
        elif section == "materials" and rest and isinstance(text.get(section), dict):
            sound[section] = {
                name: ELASTIC if name.startswith(str(rest[0])) else rock for name, rock in sound[section].items()
            } | {"host": ELASTIC if rest[0] == "host" else sound[section].get("host", ELASTIC)}
        elif section in IN_PLACE:
            sound[section] = IN_PLACE[section]
        else:
            sound.pop(section, None)
    for section, numbers in entries.items():
        if numbers:
            listed = enumerate(text[section])
            kept = [_named(section, entry) if number in numbers else entry for number, entry in listed]
            sound[section] = [entry for entry in kept if entry is not None]
    try:
        return sound, MineSettings.read(sound)
    except InputError:
        return sound, None


def _named(section: str, entry) -> dict | None:
    """Entry {"name": ...} that stands for a wrong step; None for other entries and for steps without a name."""
    is_named = section == "steps" and isinstance(entry, dict) and isinstance(entry.get("name"), str)
    return {"name": entry["name"]} if is_named else None
