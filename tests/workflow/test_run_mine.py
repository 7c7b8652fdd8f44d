"""A whole mine in this process: the same values as from the stages of a pipeline, which write files."""

import json
import re

import numpy as np
import pytest
import xarray as xr
from tiny_mines import DIRECTED, STRAIN, snakemake

from common.errors import InputErrors
from common.event_table import LABELS
from mpm_core.scene.scene import parse_scene
from mpm_core.scene.step_settings import GROWING, read_scene_attribute
from workflow import run_mine
from workflow.cli import arguments, check_options
from workflow.configuration import load_mine


@pytest.mark.slow
def test_values_are_those_of_the_pipeline(undisturbed, tiny_file, tmp_path):
    """To the bit, from the grid to the catalogue."""
    mine = load_mine(tiny_file)
    run, results = run_mine.run_mine(mine, tmp_path / "failed.npz"), undisturbed[0] / "results/tiny"
    made = {"grid": run.grid, "elastic": run.elastic, "catalog": run.catalog}
    made |= {f"steps/{name}": state for name, state in run.steps.items()}
    made |= {f"events/{name}": events for name, events in run.events.items()}
    assert set(run.steps) == set(run.events) == {"history", "2019-08"}
    for name, dataset in made.items():
        with xr.open_dataset(results / f"{name}.nc") as stored:
            labels = {field.name for field in LABELS} if "event" in stored.dims else set()  # which the stage adds
            assert set(stored.variables) == set(dataset.variables) | labels & set(stored.variables)
            for variable in dataset.variables:
                np.testing.assert_array_equal(stored[variable].values, dataset[variable].values, err_msg=variable)

    for number, name in enumerate(["elastic", "steps/history", "steps/2019-08"]):
        with xr.open_dataset(results / f"{name}.nc") as stored:
            whole = mine.mechanics_slice(max(number - 1, 0))
            assert read_scene_attribute(stored.attrs) == json.loads(json.dumps(growing(whole)))


def growing(values: dict) -> dict:
    """Settings that steps add to."""
    return {key: values[key] for key in GROWING if key in values}


def test_scenes_are_those_of_the_whole_mine(tiny_file, tmp_path, monkeypatch):
    """Step by step, from what each step changes."""
    mine = load_mine(tiny_file, {"loads": [DIRECTED], "strains": [STRAIN]})
    scenes = []
    monkeypatch.setattr(run_mine, "make_grid", lambda *_: None)
    monkeypatch.setattr(run_mine, "elastic_stage", lambda scene, *_: (scenes.append(scene), {}))
    monkeypatch.setattr(run_mine, "mining_step", lambda scene, *_: (scenes.append(scene), {}))
    for _ in run_mine.run_stages(mine.run_slices(extracted_as=()), tmp_path / "failed.npz"):
        pass
    for scene, last in zip(scenes, (0, 0, 1), strict=True):
        whole = vars(parse_scene(mine.mechanics_slice(last)))
        found = vars(scene)
        assert {key: found[key] for key in found if key != "insitu"} == {
            key: whole[key] for key in whole if key != "insitu"
        }
        assert list(scene.materials) == list(whole["materials"])
        np.testing.assert_array_equal(scene.insitu.constant, whole["insitu"].constant)


def test_changes_are_merged_as_snakemake_merges_them(tiny_file):
    mine = load_mine(tiny_file, {"solver": {"increments": 3}, "ensemble": 2})
    assert (mine.settings.solver.increments, mine.settings.ensemble) == (3, 2)
    assert mine.settings.solver.tolerance == load_mine(tiny_file).settings.solver.tolerance
    with pytest.raises(InputErrors, match=r"--config: solver\.increment: unknown key"):
        load_mine(tiny_file, {"solver": {"increment": 3}})


def test_the_installed_command_hands_a_mine_to_snakemake(capsys):
    """On all cores unless it is told otherwise; targets stand before the file."""
    line = arguments(["mine.yaml", "plans", "-n"])
    assert line[:4] == ["plans", "-n", "--cores", "all"]
    assert line[-2:] == ["--configfile", "mine.yaml"]
    assert arguments(["mine.yaml", "--cores", "2"])[:2] == ["--cores", "2"]
    for told in (["-c", "2"], ["-c4"], ["-j2"], ["--jobs", "8"], ["--profile", "profiles/site"], ["--core=2"]):
        assert "all" not in arguments(["mine.yaml", *told]), told
    assert "all" in arguments(["mine.yaml", "--configfile", "more.yaml"])
    with pytest.raises(SystemExit):
        arguments([])
    assert "usage: rockburst-mpm" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--configfile", "-mine.yaml"], "argument --configfile/--configfiles: expected at least one argument"),
        (["--nonsense", "--configfile", "mine.yaml"], "unrecognized arguments: --nonsense"),
        (["--cores", "--configfile", "mine.yaml"], "argument --cores/-c: expected one argument"),
    ],
)
def test_the_installed_command_names_a_wrong_option_in_one_line(words, says, capsys):
    """Snakemake would print all of its options first."""
    with pytest.raises(SystemExit, match=rf"^{re.escape(says)}; a file whose name begins with - is given as \./-name$"):
        check_options(words)
    assert capsys.readouterr().err == ""


def test_packages_in_the_working_directory_are_not_run(tiny_file, tmp_path):
    """Another checkout there, say: jobs say what code they run, and it is ours."""
    (tmp_path / "workflow").mkdir()
    (tmp_path / "workflow" / "__init__.py").write_text("raise SystemExit('a package of the working directory')")
    status, text = snakemake(tiny_file, tmp_path, "results/tiny/record.nc")
    assert status == 0, text
