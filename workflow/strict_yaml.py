"""Check of a configuration file before its values are used: it refuses what YAML allows and no mine needs.

Snakemake reads the files of --configfile before it reads the Snakefile, and evaluates Python in one that says
`__use_yte__`. Only a profile comes earlier: ours (profiles/default) has them checked here first. The Snakefile does
so once more, for a run with another profile.
"""

import os
import re
from pathlib import Path
from typing import Any

import yaml

from common.errors import InputError

MAX_FILE_BYTES = 20_000_000  # far above that of a mine with thousands of stopes
MAX_NESTING = 30  # levels; far above those of a mine
MAX_KEY_CHARACTERS = 120  # A row of a study, which `known_misses` names, is the longest key of our own files.
MAX_ALIASED_VALUES = 100_000  # values that aliases stand for; ours have none
TEMPLATE = "__use_yte__"
# libyaml is faster, but takes some tabs, controls and odd scalars that Snakemake's own reader ends on with a
# traceback: it reads what has none of them, as nearly every mine file.
FAST_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
PLAIN = re.compile(r"""[A-Za-z0-9 \n_.,:;+/()\[\]{}#'"^=<>&*|~`\-°²³µ·]*""")
NO_WORD = re.compile(r"[-+.~\d]|(?:yes|no|on|off|true|false|null)$|$", re.IGNORECASE)  # a key that YAML may read
SWALLOWED = (
    "--configfile takes all words up to the next option, so a target stands before it: "
    "snakemake --cores all {target} --configfile <mine>.yaml"
)


def check_files(paths: list[Path]) -> None:
    """Check all files of --configfile. Raises InputError; a target among them is named as what it is."""
    for number, path in enumerate(paths):
        if number and not path.is_file():
            raise InputError(f"{path}: no configuration file; {SWALLOWED.format(target=path)}")
        read_yaml(path)


def read_yaml(path: str | os.PathLike) -> dict:
    """The mapping that a YAML file holds.

    Raises InputError, naming file and line, for a file that is not UTF-8 or not YAML, keys that stand twice, aliases
    that refer to themselves or grow without measure, deep nesting, Python to be evaluated, and what is no mapping.
    """
    path = Path(path)
    try:
        if path.exists() and not path.is_file():
            raise InputError(f"{path}: not a file; give a mine's YAML file")
        if path.is_file() and path.stat().st_size > MAX_FILE_BYTES:
            raise InputError(
                f"{path}: over {MAX_FILE_BYTES // 10**6} MB; give solids and records as files of their own"
            )
        text = path.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: not UTF-8 (byte {error.start}: {error.reason}); save it as UTF-8") from error
    except OSError as error:
        raise InputError(f"{path}: not readable ({error.strerror}); check its name and place") from error
    document = read_text(path, text)
    if not isinstance(document, dict):
        raise InputError(f"{path}: not a configuration: it has no keys; start from config/mines/demo.yaml")
    if TEMPLATE in document:
        raise InputError(
            f"{path}: {TEMPLATE}: a file that runs Python is refused; write its values out, and ask who sent it why"
        )
    return document


def read_text(source: str | Path, text: str):
    """Value that a YAML text holds. Raises InputError, which names `source`, if the text is not YAML or is refused."""
    try:
        return _read(source, text, loader_of(text))
    except yaml.MarkedYAMLError as error:
        place = f" line {error.problem_mark.line + 1}:" if error.problem_mark else ""
        raise InputError(f"{source}:{place} not YAML ({error.problem}); check indents, brackets and quotes") from error
    except (yaml.YAMLError, ValueError, OverflowError) as error:  # ValueError: a date of month 13, a number too long
        raise InputError(f"{source}: not YAML ({str(error)[:200]})") from error


def _read(path: str | Path, text: str, loader: type):
    """The content of a text. The slow loader decides about what the fast loader refuses."""
    try:
        _check_structure(path, text, loader)
        return yaml.load(text, Loader=loader)
    except yaml.YAMLError:
        if loader is yaml.SafeLoader:
            raise
        return _read(path, text, yaml.SafeLoader)


def loader_of(text: str) -> type:
    """The class that reads a file's text."""
    return FAST_LOADER if PLAIN.fullmatch(text) else yaml.SafeLoader


def meant_by(key: str) -> str:
    """Text of the key that YAML reads where `key` stands without quotes: 7 for 007, True for on, 750 for 12:30."""
    if not NO_WORD.match(key):
        return key
    loader = yaml.SafeLoader("")
    return str(loader.construct_object(yaml.ScalarNode(loader.resolve(yaml.ScalarNode, key, (True, False)), key)))


def _check_structure(path: str | Path, text: str, loader: type) -> None:
    """Nesting, keys and aliases, from the parser's events: nothing is built, so nothing can grow."""

    def refuse(event: yaml.Event, problem: str) -> InputError:
        return InputError(f"{path}: line {event.start_mark.line + 1}: {problem}")

    # of each level: [keys seen or None for a list, whether a key comes next, anchor, values before it]
    open_nodes: list[list[Any]] = []
    values, aliased, size_of = 0, 0, {}  # values so far; those by aliases; how many an anchored node has
    for event in yaml.parse(text, Loader=loader):
        if isinstance(event, yaml.CollectionEndEvent):
            *_, anchor, before = open_nodes.pop()
            size_of[anchor] = values - before
            continue
        if not isinstance(event, yaml.NodeEvent):
            continue
        if open_nodes and open_nodes[-1][0] is not None:
            keys, is_key, *_ = open_nodes[-1]
            open_nodes[-1][1] = not is_key
            if is_key and not isinstance(event, yaml.ScalarEvent):
                raise refuse(event, "a key is a word here, not a list, a mapping or an alias")
            if is_key and len(event.value) > MAX_KEY_CHARACTERS:
                raise refuse(event, f"{event.value[:20]}...: a key of {len(event.value):,} characters; shorten it")
            if is_key and event.implicit[0] and (meant := meant_by(event.value)) != event.value:
                raise refuse(event, f"{event.value}: a key that YAML reads as {meant}; put it in quotes")
            if is_key and event.value in keys:
                raise refuse(event, f"{event.value}: this key stands twice; the second would replace the first")
            if is_key:
                keys.add(event.value)
        if isinstance(event, yaml.AliasEvent):
            if any(anchor == event.anchor for *_, anchor, _ in open_nodes):
                raise refuse(event, f"the alias *{event.anchor[:80]} stands inside what it refers to; write it out")
            values += size_of.get(event.anchor, 1)
            aliased += size_of.get(event.anchor, 1)
        else:
            values += 1
            size_of[event.anchor] = 1
        if aliased > MAX_ALIASED_VALUES:
            raise refuse(event, f"its aliases stand for more than {MAX_ALIASED_VALUES:,} values; use fewer of them")
        if isinstance(event, yaml.CollectionStartEvent):
            if len(open_nodes) == MAX_NESTING:
                raise refuse(event, f"nested deeper than {MAX_NESTING} levels; check its brackets and indents")
            keys = set() if isinstance(event, yaml.MappingStartEvent) else None
            open_nodes.append([keys, True, event.anchor, values - 1])
