"""What a user writes behind snakemake: taken as in a mine's file, or refused in one line that shows the right way."""

import os
import shutil
import subprocess
import sys

import pytest
from test_full_disk import little_room
from tiny_mines import ROOT, TINY, snakemake, write_mine

from common.errors import InputError
from workflow.command_line import read_overrides
from workflow.mine_folder import NOTES, check_owner, note_owner

READ_ONLY = "/sys"  # a folder of Linux that takes no files, of root neither


@pytest.mark.parametrize(
    ("entry", "means"),
    [
        ("solver={increments: 2}", {"solver": {"increments": 2}}),
        ('solver={"tolerance": 1.0e-3, "move": false}', {"solver": {"tolerance": 1e-3, "move": False}}),
        ("grid_convergence=false", {"grid_convergence": False}),
        ("ensemble=8", {"ensemble": 8}),
        ("thickness=2 m", {"thickness": "2 m"}),
        ("plane=none", {"plane": "none"}),
        ('name="2019"', {"name": "2019"}),
        ("domain={lower: [0 m, 0 m, 0 m]}", {"domain": {"lower": ["0 m"] * 3}}),
        ("record=", {"record": None}),
    ],
)
def test_a_value_means_what_it_means_in_a_mine_file(entry, means):
    assert read_overrides([entry]) == means


@pytest.mark.parametrize(
    ("entries", "says"),
    [
        (["solver.tolerance=1e-3"], "--config solver.tolerance=1e-3: keys below.*--config 'solver={tolerance: 1e-3}'"),
        (["materials.m.cohesion.intact=3 MPa"], "--config 'materials={m: {cohesion: {intact: 3 MPa}}}'"),
        (["excavations.0.radius=3 m"], "entries of a list are changed in the mine's file"),
        (["x=1"], "--config x=1: 'x' is no key of a mine's file"),
        (["=1"], "--config =1: '' is no key"),
        (["accuracy=draft", "verification"], "--config verification: no key=value.*--cores all verification --config"),
        (["accuracy=draft", "accuracy=fine"], "--config accuracy=fine: accuracy stands twice"),
        (["solver={increments"], "--config solver: line 1: not YAML"),
        (["solver={increments: 2, increments: 3}"], "--config solver: line 1: increments: this key stands twice"),
        (["name=!!python/object/apply:os.getcwd []"], "--config name: line 1: not YAML"),
    ],
)
def test_what_cannot_be_meant_is_refused_with_the_right_way(entries, says):
    with pytest.raises(InputError, match=says) as refused:
        read_overrides(entries)
    assert "\n" not in str(refused.value)


def spoken(folder, *options: str) -> list[str]:
    """What a user reads who asks for the tiny mine with these options, and is refused."""
    file = write_mine(TINY, folder / "mine.yaml")
    status, text = snakemake(file, folder, "--dry-run", *options)
    assert status != 0, text
    return [line for line in text.splitlines() if "Using workflow specific profile" not in line]


def test_keys_of_a_section_merge_with_those_of_the_file(tmp_path):
    """Numbers as numbers; what the file says of the section beside them stays."""
    uniform, varied = (f"materials={{host: {{variability: {{share: {share}}}}}}}" for share in (0, 0.2))
    (line,) = spoken(tmp_path, "--config", "ensemble=2", uniform)
    assert "ensemble: members differ by the random strength of their rock, and none varies" in line
    status, text = snakemake(tmp_path / "mine.yaml", tmp_path, "-n", "--config", "ensemble=2", varied)
    assert status == 0, text


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--config", "solver.tolerance=1e-3"], "keys below a section are written in braces"),
        (["--config", "accuracy=draft", "--config", "ensemble=2"], "--config stands twice"),
        (["--config", "accuracy=draft", "report"], "--config report: no key=value"),
        (["--config", "accuracyy=draft"], "accuracyy: unknown key; did you mean accuracy?"),
        (["--config", "solver=3"], "solver: 3 is not of type 'object'"),
        (["--config", "name=a b"], "name: 'a b' does not match"),
    ],
)
def test_snakemake_ends_in_one_line(tmp_path, options, says):
    lines = spoken(tmp_path, *options)
    assert len(lines) == 1, lines
    assert says in lines[0]


@pytest.mark.skipif(not os.path.isdir(READ_ONLY), reason="no folder that takes no files")
@pytest.mark.parametrize("folder", [READ_ONLY, __file__], ids=["read-only", "a file"])
def test_a_working_directory_that_takes_no_files_is_one_line(tmp_path, folder):
    """Snakemake makes folders for its notes there before it reads the Snakefile."""
    status, text = snakemake(write_mine(TINY, tmp_path / "mine.yaml"), folder, "--dry-run")
    lines = [line for line in text.splitlines() if "Using workflow specific profile" not in line]
    assert status != 0
    assert len(lines) == 1, lines
    assert lines[0].startswith(f"{folder}: cannot be written (")


@pytest.mark.parametrize("cache", [None, f"{READ_ONLY}/cache", "file"])
def test_a_home_that_cannot_be_written_is_one_line_with_the_remedy(tmp_path, cache):
    """Snakemake ended in a traceback. With another folder for its cache the run starts."""
    (tmp_path / "file").write_text("")
    given = {} if cache is None else {"XDG_CACHE_HOME": str(tmp_path / cache)}  # joined with an absolute path: that one
    environment = {key: value for key, value in os.environ.items() if key != "XDG_CACHE_HOME"} | {"HOME": READ_ONLY}
    command = [sys.executable, "-m", "snakemake", "--snakefile", ROOT / "Snakefile", "--cores", "1", "--dry-run"]
    command += ["--workflow-profile", ROOT / "profiles/default"]
    command += ["--configfile", write_mine(TINY, tmp_path / "mine.yaml")]

    def run(**others):
        return subprocess.run(
            command, cwd=tmp_path, env=environment | others, capture_output=True, text=True, timeout=120, check=False
        )

    done = run(**given)
    lines = [line for line in done.stderr.splitlines() if "Using workflow specific profile" not in line]
    assert done.returncode != 0
    assert len(lines) == 1, lines
    assert "cannot be written (" in lines[0]
    assert lines[0].endswith("name another folder in front of the command, XDG_CACHE_HOME=<folder>")
    if cache is None:
        assert run(XDG_CACHE_HOME=str(tmp_path / "cache")).returncode == 0


@pytest.mark.parametrize("name", ["mines {2019}", "{mine}"])
def test_a_working_directory_with_braces_is_one_line(tmp_path, name):
    """Snakemake reads them as a pattern when it looks for locks, and ended in a traceback of 40 lines."""
    folder = tmp_path / name
    status, text = snakemake(write_mine(TINY, tmp_path / "mine.yaml"), folder, "--dry-run")
    lines = [line for line in text.splitlines() if "Using workflow specific profile" not in line]
    assert status != 0
    assert lines == [
        f"{folder}: Snakemake takes braces in the name of a folder for a wildcard; start in another folder, or name "
        "one with --directory"
    ]


@pytest.mark.parametrize("name", ["program {2019}", "{mine}", "it's {x} {{y}}"])
def test_a_program_in_a_folder_with_braces_runs(tmp_path, name):
    """Its path stands in the command of each job and in the rules' environment, where braces were names."""
    program = tmp_path / name
    program.symlink_to(ROOT)
    (tmp_path / "run").mkdir()
    command = [sys.executable, "-m", "snakemake", "--snakefile", program / "Snakefile", "--cores", "1"]
    command += ["--workflow-profile", program / "profiles/default", "results/tiny/grid.nc"]
    command += ["--configfile", write_mine(TINY, tmp_path / "mine.yaml")]
    done = subprocess.run(command, cwd=tmp_path / "run", capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert (tmp_path / "run/results/tiny/grid.nc").exists()


@pytest.mark.parametrize("note", [b"", b"\n", b"\xff\xfe/mine.yaml", b"/gone\0/mine.yaml", None])
def test_a_note_that_says_nothing_blocks_no_folder(tmp_path, monkeypatch, note):
    """A full disk left an empty one; None: a folder stands in its place."""
    monkeypatch.chdir(tmp_path)
    file = write_mine(TINY, tmp_path / "mine.yaml")
    (tmp_path / "results/tiny").mkdir(parents=True)
    NOTES.mkdir(parents=True)
    if note is None:
        (NOTES / "tiny").mkdir()
    else:
        (NOTES / "tiny").write_bytes(note)
    check_owner("tiny", file)


def test_a_note_is_whole_or_absent(tmp_path, monkeypatch):
    """Nothing is written in its place before it is whole."""
    monkeypatch.chdir(tmp_path)
    with little_room(5), pytest.raises(InputError, match="the disk is full: no room in"):
        note_owner("tiny", tmp_path / "mine.yaml")
    assert not list(NOTES.iterdir())


def test_results_under_a_name_of_the_command_line_are_not_replaced(tmp_path, monkeypatch):
    """The file that they were made from does not have that name."""
    monkeypatch.chdir(tmp_path)
    one, other = (write_mine(TINY | {"name": name}, tmp_path / f"{name}.yaml") for name in ("one", "other"))
    (tmp_path / "results/other").mkdir(parents=True)
    note_owner("other", one, is_overridden=True)
    check_owner("other", one)
    with pytest.raises(InputError, match=r"results/other was made from .*one\.yaml, with that name by --config; give"):
        check_owner("other", other)


def test_a_copy_of_a_project_is_one_of_its_own(tmp_path, monkeypatch):
    """Its note named the file of the original, and the first change of its own file ended the run."""
    original, copy = tmp_path / "original", tmp_path / "copy"
    (original / "results/tiny").mkdir(parents=True)
    monkeypatch.chdir(original)
    file = write_mine(TINY, original / "files/mine.yaml")
    note_owner("tiny", file)
    check_owner("tiny", file)
    shutil.copytree(original, copy)
    monkeypatch.chdir(copy)
    other = write_mine(TINY | {"ensemble": 3}, copy / "files/mine.yaml")
    check_owner("tiny", other)
    with pytest.raises(InputError, match=r"results/tiny was made from files/mine.yaml, which has this name, too"):
        check_owner("tiny", write_mine(TINY, copy / "files/another.yaml"))


@pytest.mark.parametrize(
    ("words", "status", "says"),
    [
        ("workflow", 2, "python -m workflow: the following arguments are required: job, --output; --help"),
        ("workflow jobs/grid/1.json --output x --threads many", 2, "python -m workflow: argument --threads: inv"),
        (
            "workflow nonsense.json --output x",
            2,
            "python -m workflow: nonsense.json: no job of a stage; there ",
        ),
        ("workflow.generate nonsense", 2, "python -m workflow.generate: unrecognized arguments: nonsense"),
        (
            "workflow jobs/grid/1.json --output x",
            1,
            "grid x: jobs/grid/1.json: not readable (No such file or directory); jobs stand",
        ),
        ("workflow {empty}/jobs/grid/2.json --output x", 1, "grid x: {empty}/jobs/grid/2.json: not JSON ("),
    ],
)
def test_a_stage_that_is_called_wrong_by_hand_is_one_line(tmp_path, words, status, says):
    """No usage of many lines, no traceback, no advice to delete what is no slice."""
    (tmp_path / "jobs/grid").mkdir(parents=True)
    (tmp_path / "jobs/grid/2.json").write_text("")
    line = words.format(empty=tmp_path).split()
    run = subprocess.run([sys.executable, "-m", *line], cwd=ROOT, capture_output=True, text=True)
    assert run.returncode == status
    assert len(run.stderr.splitlines()) == 1, run.stderr
    assert run.stderr.startswith(says.format(empty=tmp_path))
