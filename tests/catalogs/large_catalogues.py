"""Catalogues as large as real ones, drawn by seed, with the mine around them, and the time that each stage takes.

python -m tests.catalogs.large_catalogues 100000 3000 400 FOLDER [STAGE ...]

writes the files of a mine with so many modelled events, recorded events, openings and dated steps, and prints time and
memory of every stage from events to the report, or of those named, and the size of the page. No mechanics run.
"""

import json
import multiprocessing
import resource
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr

sys.path.insert(0, str(Path(__file__).parent))
import report_fixtures as fixtures

from catalogs.compare.comparison import compare
from catalogs.records import read_record
from catalogs.settings import ComparisonSlice
from catalogs.sources.quakeml import write_quakeml
from common.datasets import read_dataset, write_dataset
from common.event_table import new_catalog, read_events, write_events
from seismic.catalog import merge, write_csv
from seismic.events import extract_events, sizes_by_rule
from verification.answers.clustering.known_truth import synthetic_step

FINE, PER_PLACE = 10.0, 4  # m; cells along each axis of a place, of which an opening mines the middle ones
PLACE = FINE * PER_PLACE
PARTICLES = 12  # of a modelled event
SETTINGS = {"mine": "large", "lame_lambda": fixtures.LAME, "shear_modulus": fixtures.SHEAR, "location_error": 5.0}
SEISMIC = {
    "mine": "large",
    "method": "simultaneous",
    "closeness": 0.8,
    "link_length": 2.0,
    "seismic_fraction": 1.0,
    "least_particles": 3,
    "frame": {"latitude": -41.8, "longitude": 145.4, "surface": 2000.0},
}


def write_large_mine(folder: Path, events: int, openings: int, steps: int, seed: int = 1) -> fixtures.Mine:
    """Write every file that the report of such a mine needs: openings on a lattice, mined in the order of weekly steps,
    events around those that are mined, more around some than around others, and a third of the record aftershocks."""
    random = np.random.default_rng(seed)
    weeks = np.datetime64("1980-01-01") + 7 * np.arange(steps + 1)
    names = ["history", *(f"week_{number:04d}" for number in range(1, steps + 1))]
    dates = list(zip(["", *weeks[:-1].astype(str)], ["", *weeks[1:].astype(str)], [0, *[1] * steps], strict=True))
    side = int(np.ceil((2 * openings) ** (1 / 3)))
    place = np.array(np.unravel_index(random.choice(side**3, openings, replace=False), (side,) * 3)).T
    grid, mined = _grid(place, side), np.arange(openings) * (steps + 1) // openings
    write_dataset(grid, folder / "grid.nc")
    elastic, other = (fixtures.make_state(fixtures.make_grid(**fixtures.SMALL), index) for index in (-1, 1))
    write_dataset(_stage(elastic, "", -1), folder / "elastic.nc")  # of all but the last the report reads convergence
    for index, name in enumerate(names):
        stage = _stage(other, name, index)
        write_dataset(_state(grid, mined, stage) if index == steps else stage, folder / "steps" / f"{name}.nc")
    kinds = {"catalog": "synthetic", "record": "twin"}
    made = {name: _catalog(random, kind, events, place, mined, names, weeks) for name, kind in kinds.items()}
    made["record"].attrs |= {"kind": "recorded", "period": "{}"}
    for name, one in made.items():
        write_events(one, folder / f"{name}.nc")
    step = made["catalog"]["step"].values
    bound = np.searchsorted(step, np.append(names, "x"))  # names are in alphabetical order
    for index, (name, (start, end, dated)) in enumerate(zip(names, dates, strict=True)):
        own = made["catalog"].isel(event=slice(*bound[index : index + 2]))
        own = own.assign_attrs(
            step=name, step_index=index, start=start, end=end, dated=dated, parts=4, truncated=0, collapsed=0,
            truncated_share=0.0, truncated_where="", unlike_share=0.1, cluster="{}", method="simultaneous",
            closeness=0.8, link_length=2.0, least_particles=3,
        )  # fmt: skip
        write_events(own, folder / "events" / f"{name}.nc")
    _table(made["record"]).to_csv(folder / "record.csv", index=False)
    write_dataset(_failed_rock(random, events), folder / "rock.nc")
    listed = [{"name": name, "start": start, "end": end} for name, (start, end, _) in zip(names, dates, strict=True)]
    excavations = [{"name": f"stope_{n}", "step": names[when], "fill": "none"} for n, when in enumerate(mined)]
    config = fixtures.CONFIG | {"excavations": excavations, "steps": listed}
    (folder / "config.json").write_text(json.dumps(config))
    return mine_in(folder)


def mine_in(folder: Path) -> fixtures.Mine:
    """The files of a mine that write_large_mine has written."""
    names = ("grid", "elastic", "catalog", "record", "comparison")
    several = {name: sorted((folder / name).glob("*.nc")) for name in ("steps", "events")}
    return fixtures.Mine(folder, **several, **{name: folder / f"{name}.nc" for name in names})


def _grid(place: np.ndarray, side: int) -> xr.Dataset:
    """Cells of the places of openings (opening, 3), of which each mines the middle ones, and of one edge of a place
    elsewhere."""
    child = np.stack(np.meshgrid(*[np.arange(PER_PLACE)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    middle = ((child > 0) & (child < PER_PLACE - 1)).all(axis=1)
    fine = (place[:, None] * PLACE + child * FINE).reshape(-1, 3)
    every = np.ones((side,) * 3, bool)
    every[tuple(place.T)] = False
    origin = fixtures.ORIGIN + np.concatenate([fine, np.argwhere(every) * PLACE])
    size = np.repeat([FINE, PLACE], [len(fine), len(origin) - len(fine)])
    piece = np.flatnonzero(np.tile(middle, len(place)))
    names, volume = [f"stope_{number}" for number in range(len(place))], [FINE**3 * middle.sum()] * len(place)
    return xr.Dataset(
        {
            "cell_origin": (("cell", "xyz"), origin),
            "cell_size": ("cell", size),
            "cell_level": ("cell", np.where(size == FINE, 2, 0).astype(np.int8)),
            "cell_body": ("cell", np.full(len(size), -1, np.int16)),
            "piece_cell": ("piece", piece),
            "piece_origin": (("piece", "xyz"), origin[piece]),
            "piece_excavation": ("piece", (piece // len(child)).astype(np.int16)),
            "piece_samples": ("piece", np.full(len(piece), 2**64 - 1, np.uint64)),
            "piece_fraction": ("piece", np.ones(len(piece))),
            "piece_volume": ("piece", np.full(len(piece), FINE**3)),
        },
        attrs=fixtures.make_grid(**fixtures.SMALL).attrs
        | {
            "mine": "large", "domain_lower": fixtures.ORIGIN, "domain_upper": fixtures.ORIGIN + side * PLACE,
            "coarse_cell": PLACE, "fine_cell": FINE, "levels": 3, "excavation_names": json.dumps(names),
            "excavation_volume": json.dumps(np.array(volume).tolist()),
            "excavation_volume_grid": json.dumps(np.array(volume).tolist()),
        },
    )  # fmt: skip


def _stage(other: xr.Dataset, name: str, index: int) -> xr.Dataset:
    """Convergence and attributes of a stage, as those of another one."""
    kept = other[[one for one in other if one.startswith("convergence_")]]
    return kept.assign_attrs(mine="large", step=name, step_index=index, truncated=0, loose_pieces=0)


def _state(grid: xr.Dataset, mined: np.ndarray, stage: xr.Dataset) -> xr.Dataset:
    """The state after the last step, in which a third of the cells around each opening have failed when it was mined;
    stage: its convergence and attributes."""
    size, count, per = grid["cell_size"].values, grid.sizes["cell"], PER_PLACE**3
    is_open = np.zeros(count, bool)
    is_open[grid["piece_cell"].values] = True
    failed = np.full(count, -1, np.int32)
    failed[: len(mined) * per : 3] = np.repeat(mined, per)[::3]
    failed[is_open] = -1
    strain = np.where(failed[:, None] >= 0, 1e-4, 0) * np.ones(6)
    return stage.assign(
        {one: grid[one] for one in ("cell_origin", "cell_size", "cell_level", "cell_body")}
        | {
            "position": (("particle", "xyz"), grid["cell_origin"].values + size[:, None] / 2),
            "cell": ("particle", np.arange(count, dtype=np.int32)),
            "spacing": ("particle", size),
            "volume": ("particle", np.where(is_open, 0.0, size**3)),
            "material": ("particle", np.zeros(count, np.int16)),
            "excavation": ("particle", np.full(count, -1, np.int16)),
            "displacement": (("particle", "xyz"), np.full((count, 3), 1e-3)),
            "failed": ("particle", failed),
            "strength_factor": ("particle", np.where(failed >= 0, 1.0, 2.0)),
            "seismic_strain": (("particle", "voigt"), strain),
            "plastic_strain": (("particle", "voigt"), strain),
        }
    )


def _catalog(random, kind: str, count: int, place, mined, names: list[str], weeks) -> xr.Dataset:
    """Events by time, each around an opening that is mined in its step or before; some openings have many."""
    step = np.sort(random.integers(1, len(names), count))
    known = np.searchsorted(mined, step, side="right")  # openings that are mined by then
    opening = ((random.random(count) ** 3) * known).astype(int)
    location = fixtures.ORIGIN + (place[opening] + 0.5) * PLACE + 8.0 * random.normal(size=(count, 3))
    second = random.integers(0, 7 * 86400, count)
    time = weeks[step - 1].astype("M8[ns]") + second.astype("m8[s]")
    if kind != "synthetic":  # aftershocks
        after = np.flatnonzero(random.random(count) < 1 / 3)
        main = random.integers(0, count, len(after))
        time[after] = time[main] + (10 ** random.uniform(1, 5, len(after)) * 1e9).astype("m8[ns]")
        time[after] = np.minimum(time[after], weeks[-1].astype("M8[ns]") - np.timedelta64(1, "s"))
        location[after] = location[main] + 4.0 * random.normal(size=(len(after), 3))
    order = np.lexsort((time, step)) if kind == "synthetic" else np.argsort(time, kind="stable")
    time, location, step = time[order], location[order], step[order]
    tensor = random.normal(size=(count, 3, 3)) * 0.3 + np.diag([1.0, 0.1, -1.0])
    tensor = tensor + np.swapaxes(tensor, 1, 2)
    potency = 1e-4 * random.random(count) ** (-1 / 0.8)
    tensor *= (potency / np.sqrt(2 * (tensor**2).sum(axis=(1, 2))))[:, None, None]
    attributes = {
        **fixtures.make_catalog(fixtures.make_state(fixtures.make_grid(**fixtures.SMALL), 2), 1).attrs,
        **{"mine": "large", "kind": kind, "location_error": 5.0, "frame": json.dumps(SEISMIC["frame"])},
    }
    synthetic = kind == "synthetic"
    return new_catalog(
        count, attributes, time=time, location=location, source_size=np.full(count, 2.0),
        time_lower_uncertainty=np.full(count, 86400.0), time_upper_uncertainty=np.full(count, 86400.0),
        step=np.array(names, object)[step] if synthetic else np.full(count, "", object),
        particles=np.full(count, PARTICLES if synthetic else -1), resolved=np.ones(count, np.int8),
        **fixtures.decompose(tensor),
    )  # fmt: skip


def _table(record: xr.Dataset) -> pd.DataFrame:
    """A record as a mine exports it."""
    columns = dict(zip("xyz", record["location"].values.T.round(2), strict=True))
    return pd.DataFrame(
        {"time": pd.DatetimeIndex(record["time"].values).strftime("%Y-%m-%d %H:%M:%S"), **columns}
        | {"mw": record["mw"].values.round(3)}
    )


def _failed_rock(random: np.random.Generator, events: int) -> xr.Dataset:
    """A step in which so many bodies of some particles have failed."""
    side = int(np.ceil(events ** (1 / 3)))
    centre = np.stack(np.unravel_index(np.arange(events), (side,) * 3), axis=1) * 20.0
    position = (centre[:, None] + 1.5 * np.array(list(np.ndindex(3, 2, 2)))).reshape(-1, 3)
    mechanism = np.repeat(random.normal(size=(events, 6)), PARTICLES, axis=0)
    strain = 1e-4 * (mechanism + 0.1 * random.normal(size=mechanism.shape))
    order = np.repeat(np.stack([random.integers(0, 8, events), random.integers(0, 20, events)], axis=1), PARTICLES, 0)
    return synthetic_step(position, strain, failure_order=order, mine="large")


def stages(folder: Path) -> dict[str, Callable[[], object]]:
    """What each stage does, by name, in order, with the files in the folder; results go to its folder `out`."""
    mine, out = mine_in(folder), folder / "out"
    config = json.loads((folder / "config.json").read_text())
    steps = [one for one in config["steps"] if one["start"]]
    columns = {name: name for name in ("time", *"xyz", "mw")}

    def record(reader: str, file: Path, **others) -> None:
        found = read_record(SETTINGS | {"frame": SEISMIC["frame"], "reader": reader, "file": str(file)} | others)
        write_events(found, out / "record.nc")

    def extract() -> None:
        write_events(extract_events(read_dataset(folder / "rock.nc"), SEISMIC)[0], out / "events.nc")

    def rules() -> None:
        write_dataset(sizes_by_rule([read_dataset(folder / "rock.nc")], SEISMIC), out / "event_rules.nc")

    def merged() -> None:
        write_events(merge([read_events(path) for path in mine.events]), out / "catalog.nc")

    def comparison() -> None:
        settings = ComparisonSlice.of({"steps": steps}, "comparison")
        write_dataset(compare(read_events(mine.catalog), read_events(mine.record), settings), mine.comparison)

    return {
        "events": extract,
        "event rules": rules,
        "catalogue": merged,
        "csv": lambda: write_csv(read_events(mine.catalog), out / "catalog.csv"),
        "quakeml": lambda: write_quakeml(read_events(mine.catalog), out / "catalog.xml"),
        "record csv": lambda: record("csv", folder / "record.csv", columns=columns),
        "record quakeml": lambda: record("quakeml", out / "catalog.xml"),
        "comparison": comparison,
        "report": lambda: fixtures.write_page(
            **mine.arguments(output=out / "report.html", figures=out / "figures", config=config)
        ),
    }


def _measured(folder: Path, name: str, queue) -> None:
    start = time.process_time()  # which other programs lengthen less than the clock's
    stages(folder)[name]()
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    queue.put((time.process_time() - start, peak))


def measure(folder: Path, name: str) -> tuple[float, float]:
    """Processor time (s) and peak memory (MB) of a stage in a process of its own."""
    context = multiprocessing.get_context("spawn")
    queue = context.Queue()
    process = context.Process(target=_measured, args=(folder, name, queue))
    process.start()
    process.join()
    return queue.get(timeout=1)


if __name__ == "__main__":
    count, openings, steps = map(int, sys.argv[1:4])
    folder = Path(sys.argv[4])
    if not (folder / "config.json").exists():
        write_large_mine(folder, count, openings, steps)
    (folder / "out").mkdir(exist_ok=True)
    for name in sys.argv[5:] or stages(folder):
        seconds, peak = measure(folder, name)
        print(f"{name:16s} {seconds:8.1f} s {peak:8.0f} MB", flush=True)
    page = folder / "out" / "report.html"
    print(f"page {page.stat().st_size / 1e6 if page.exists() else 0:.2f} MB")
