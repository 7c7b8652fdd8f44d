"""Any file given as a mine: what it holds is taken or refused in one line, at once, and nothing in it is ever run."""

import json
import os
import re
import signal
import subprocess
import sys
from contextlib import contextmanager

import pytest
import yaml
from hypothesis import given, seed, settings
from hypothesis import strategies as st
from tiny_mines import DEFAULT, ROOT, TINY, merged, snakemake, write_mine

from common.errors import InputError
from workflow.configuration import load
from workflow.strict_yaml import FAST_LOADER, loader_of, read_yaml

DEMO = ROOT / "config/mines/demo.yaml"
AT_ONCE = 10  # s of processor time; the demo's file takes 0.1
BOMB = "a0: &a0 {x: 1}\n" + "".join(
    f"a{level}: &a{level} {{{', '.join(f'k{part}: *a{level - 1}' for part in range(9))}}}\n" for level in range(1, 9)
)
SPOILED = {  # content of the file, what its one line says
    "Python": (
        b"__use_yte__: true\n__definitions__: [\"open('ran', 'w')\"]\nname: x\n",
        "__use_yte__: a file that",
    ),
    "Python by a merge": (b'base: &base {__use_yte__: true}\n<<: *base\n\'?open("ran", "w")\': 1\n', "__use_yte__"),
    "Python by a tag": (b"name: !!python/object/apply:os.mkdir [ran]\n", "line 1: not YAML"),
    "aliases that multiply": (BOMB.encode(), "its aliases stand for more than 100,000 values"),
    "aliases merged": (BOMB.replace("k", "<<: *a0, k").encode(), "its aliases stand for|stands twice"),
    "an alias of itself": (
        b"name: x\ngrid: &a {levels: *a}\n",
        "line 2: the alias .a stands inside",
    ),
    "nested lists": (b"name: " + b"[" * 50_000, "line 1: nested deeper than 30 levels"),
    "nested mappings": (b"".join(b" " * n + b"a:\n" for n in range(400)), "line 31: nested deeper"),
    "a key twice": (b"name: x\ngrid:\n  levels: 2\n  levels: 3\n", "line 4: levels: this key stands twice"),
    "a number and its text": (b"name: x\nmaterials: {1: a, '1': b}\n", "line 2: 1: this key stands twice"),
    "a key that is a number": (b"name: x\nmaterials: {007: a}\n", "line 2: 007: a key that YAML reads as 7; put it"),
    "a key that is a switch": (
        b"name: x\nrecord: {conversions: {on: none}}\n",
        "line 2: on: .* reads as True; put it",
    ),
    "a key that is a time": (b"name: x\nmaterials: {12:30: a}\n", "line 2: 12:30: .* reads as 750; put it in quotes"),
    "a list as a key": (b"? [a]\n: 1\n", "line 1: a key is a word here"),
    "a key without end": (b"0x" + b"f" * 900 + b": 1\n", "line 1: 0x(f+)...: a key of 902 characters"),
    "Latin-1": ("name: Mine Nord-Süd\n".encode("latin-1"), "not UTF-8"),
    "UTF-16": ("name: x\n".encode("utf-16"), "not UTF-8"),
    "zeros": (bytes(1000), "not YAML"),
    "a zip": (b"PK\x03\x04\x14\x00\x06\x00\x08\x00", "not YAML|not UTF-8"),
    "empty": (b"", "it has no keys"),
    "a list": (b"- name\n", "it has no keys"),
    "a sentence": (b"This is no mine.\n", "it has no keys"),
    "two documents": (b"name: x\n---\nname: y\n", "not YAML"),
    "a tab": (b"grid:\n\tlevels: 2\n", "line 2: not YAML"),
    "a tab after a colon": (b"name: \tdemo\n", "line 1: not YAML"),
    "an open quote": (b"name: 'x\n", "not YAML"),
    "month 13": (b"start: 2019-13-01\n", "not YAML .month must be"),
    "an endless integer": (b"seed: " + b"9" * 5000, "not YAML"),
}


@contextmanager
def at_once():
    """Ends what goes on for longer than a user would wait for a refusal."""

    def end(*_):
        raise TimeoutError(f"no answer within {AT_ONCE} s")

    before = signal.signal(signal.SIGVTALRM, end)
    signal.setitimer(signal.ITIMER_VIRTUAL, AT_ONCE)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0)
        signal.signal(signal.SIGVTALRM, before)


@pytest.mark.parametrize("kind", SPOILED)
def test_a_spoiled_file_is_one_line(tmp_path, kind):
    """With its name; nothing that stands in it is run."""
    content, says = SPOILED[kind]
    file = tmp_path / "mine.yaml"
    file.write_bytes(content)
    with at_once(), pytest.raises(InputError) as refused:
        read_yaml(file)
    line = str(refused.value)
    assert line.startswith(f"{file}: ")
    assert re.search(says, line), line
    assert len(line) < 400
    assert os.listdir(tmp_path) == ["mine.yaml"]


def test_keys_that_stay_what_they_are_are_taken(tmp_path):
    """In quotes, as dates, as whole numbers, as words that look like one."""
    file = tmp_path / "mine.yaml"
    file.write_text('"007": 1\n2019: 1\n2019-08: 1\n2019-08-01: 1\n1e3: 1\n-: 1\n"on": 1\nonly: 1\n')
    assert [str(key) for key in read_yaml(file)] == ["007", "2019", "2019-08", "2019-08-01", "1e3", "-", "on", "only"]


@pytest.mark.parametrize("path", sorted((ROOT / "config").rglob("*.yaml")), ids=lambda path: path.name)
def test_our_own_files_read_as_yaml_does(path):
    """No key stands twice in them, and what is refused costs them nothing."""
    assert read_yaml(path) == yaml.safe_load(path.read_text(encoding="utf-8"))


def test_aliases_and_merges_within_measure_are_taken(tmp_path):
    """They are YAML's own way to say a thing once."""
    file = tmp_path / "mine.yaml"
    file.write_text("one: &one {a: 1, b: [2, 3]}\ntwo: {<<: *one, c: *one}\n", encoding="utf-8-sig")
    assert read_yaml(file)["two"] == {"a": 1, "b": [2, 3], "c": {"a": 1, "b": [2, 3]}}


def spoken(mine_file, folder, *options: str) -> list[str]:
    """What a user reads who gives this file."""
    status, text = snakemake(mine_file, folder, "--dry-run", *options)
    assert status != 0
    return [line for line in text.splitlines() if "Using workflow specific profile" not in line]


@pytest.mark.parametrize("kind", ["Python", "nested lists", "an alias of itself", "Latin-1"])
def test_snakemake_refuses_it_before_it_reads_it(tmp_path, kind):
    """Snakemake would evaluate the first, and end with a traceback in the others, before it reads the Snakefile."""
    content, says = SPOILED[kind]
    file = tmp_path / "mine.yaml"
    file.write_bytes(content)
    lines = spoken(file, tmp_path)
    assert len(lines) == 1, lines
    assert re.search(says, lines[0])
    assert not (tmp_path / "ran").exists()


def test_a_key_that_stands_twice_is_told_with_another_profile_too(tmp_path):
    """The Snakefile looks for itself."""
    file = write_mine(TINY, tmp_path / "mine.yaml")
    file.write_text(file.read_text() + "solver: {tolerance: 1.0e-2}\n")
    lines = spoken(file, tmp_path, "--workflow-profile", "none")
    assert lines[-1].startswith(f"{file}: line ")
    assert "solver: this key stands twice" in lines[-1]


def test_a_target_after_the_mine_file_is_told(tmp_path):
    """Snakemake takes it for another configuration, and `verification` is a folder to it."""
    write_mine(TINY, tmp_path / "mine.yaml")
    line = [sys.executable, "-m", "snakemake", "--dry-run", "--cores", "1", "--configfile", str(tmp_path / "mine.yaml")]
    run = subprocess.run([*line, "verification"], cwd=ROOT, capture_output=True, text=True)
    assert run.returncode == 1
    *_, last = run.stderr.splitlines()
    assert last.startswith("verification: no configuration file")
    assert "snakemake --cores all verification --configfile <mine>.yaml" in last
    assert "Traceback" not in run.stderr


# ---- the demo's file, spoiled at random ----

ODD = (
    "", "~", "true", "-1", "0", "1.5", "1e400", "-.inf", ".nan", "9" * 400, "[]", "{}", "[1, [2]]", "{x: 1}", "none",
    "nan m", "1e300 m", "-5 m", "0 m", "1 m", "57 GPa*9**9**9", "1 ft", "5 m + 2 s", "2019-08-01", "0000-00-00", "1e9",
    "9999-12-31", '"2019-08"', "planned", "history", "x" * 300, "../../etc", "*a", "&a", "<<", "!!python/name:os",
    "%", "?", "'", '"', "|", ">", "#", ":", "- -", "\t", "\u0000", "\u2028", "Süd", "elk_creek", "xz", "xy", "free",
    "explicit", "yes",
)  # fmt: skip
WORD = re.compile(r"[^\s\[\]{},:]+")


@st.composite
def spoiled(draw, text: str) -> str:
    """A configuration's text with a few words, lines or characters replaced, repeated, exchanged or left out."""
    for _ in range(draw(st.integers(1, 3))):
        kind = draw(st.sampled_from(["word", "word", "exchange", "line", "repeat", "cut", "insert"]))
        words = list(WORD.finditer(text))
        lines = text.splitlines(keepends=True)
        place = draw(st.integers(0, max(len(lines) - 1, 0)))
        if kind == "word" and words:
            word = draw(st.sampled_from(words))
            text = text[: word.start()] + draw(st.sampled_from(ODD)) + text[word.end() :]
        elif kind == "exchange" and words:
            one, other = draw(st.sampled_from(words)), draw(st.sampled_from(words))
            text = text[: one.start()] + other.group() + text[one.end() :]
        elif kind == "line":
            text = "".join(lines[:place] + lines[place + 1 :])
        elif kind == "repeat":
            text = "".join(lines[: place + 1] + lines[place:])
        elif kind == "cut":
            text = text[: draw(st.integers(0, len(text)))]
        else:
            at = draw(st.integers(0, len(text)))
            text = text[:at] + draw(st.sampled_from(ODD)) + text[at:]
    return text


def without_comments(text: str) -> str:
    """What counts of a file: else most changes would be in its remarks."""
    return re.sub(r"\s*#.*", "", text).lstrip()


DEMO_TEXT = without_comments(DEMO.read_text(encoding="utf-8"))
DEFAULTS = yaml.safe_load(DEFAULT.read_text(encoding="utf-8"))
FUZZED = int(os.environ.get("FUZZED_MINE_FILES", 150))  # 20,000 take a quarter of an hour


def read_by(loader: type, text: str):
    """What a loader makes of a text, or that it refuses it."""
    try:
        return repr(yaml.load(text, loader))
    except (yaml.YAMLError, ValueError, OverflowError, RecursionError):
        return "refused"


@seed(18)
@settings(max_examples=2 * FUZZED, deadline=None, database=None)
@given(spoiled(DEMO_TEXT))
def test_the_fast_reader_and_snakemakes_agree(text):
    """Where the fast one is used: else what passes here would end in a traceback there, or mean something else."""
    if loader_of(text) is FAST_LOADER:
        fast = read_by(FAST_LOADER, text)
        assert fast in (read_by(yaml.SafeLoader, text), "refused")  # what it refuses the other one looks at again


def test_our_own_mines_are_read_fast_and_odd_texts_are_not():
    """A tab, a control character, a tag, an escape, a directive."""
    assert loader_of(DEMO.read_text(encoding="utf-8")) is FAST_LOADER
    for odd in ("\t", "\u0085", "!", "\\", "%", "?", "@", "\ufeff"):
        assert loader_of(f"name: {odd}demo\n") is yaml.SafeLoader


@seed(17)
@settings(max_examples=FUZZED, deadline=None, database=None)
@given(spoiled(DEMO_TEXT))
def test_the_demo_spoiled_at_random_is_taken_or_refused_in_lines(tmp_path_factory, text):
    """At once, one for each mistake, and what is taken has no number that cannot be computed with."""
    folder = tmp_path_factory.getbasetemp() / "fuzzed"
    (folder / "demo").mkdir(parents=True, exist_ok=True)
    (folder / "demo/record.csv").touch()
    file = folder / "mine.yaml"
    file.write_text(text, encoding="utf-8")
    with at_once():
        refusal, mine = None, None
        try:
            read_yaml(file)
            mine = load(merged(yaml.load(text, yaml.FullLoader)), file, DEFAULTS)  # as Snakemake reads it
        except InputError as error:
            refusal = str(error)
        if refusal is not None:
            for line in refusal.splitlines():
                assert line.startswith(f"{file}: ")
                assert len(line) < 600
            return
        slices = [mine.grid_slice(), mine.catalogue_slice(), mine.record_slice() if mine.settings.record else {}]
        json.dumps([*slices, *(mine.step_slice(step) for step in mine.mined_steps)], allow_nan=False)
