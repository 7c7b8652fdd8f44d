"""Position of a key in a mine file, to list mistakes in the order of the file."""

import re
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import yaml

from workflow.strict_yaml import loader_of


def key_in(line: str) -> str:
    """The key that a mistake's line begins with."""
    return line.split(": ")[0]


def parts_of(key: str) -> list[str | int]:
    """A key's names and numbers: excavations[2].lower, also excavations.stope_1.lower."""
    found = re.findall(r"\[(\d+)\]|([^.\[\]]+)", key)
    return [int(number) if number else name for number, name in found] or [key]


def section_of(line: str) -> str:
    """The section of the configuration that a mistake's line is about."""
    return str(parts_of(key_in(line))[0])


def sorted_by_place(lines: Sequence[str], file: Path, overrides: dict) -> list[str]:
    """Lines in the order of what they are about in a file, which they name; --config comes last, under that name."""
    places, place_of = [], _places(file)
    for number, line in enumerate(lines):
        parts = parts_of(key_in(line))
        is_said = _is_said(overrides, parts)
        places.append((is_said, place_of(parts), number, f"{'--config' if is_said else file}: {line}"))
    return [line for *_, line in sorted(places)]


def _places(file: Path) -> Callable[[list[str | int]], int]:
    """Index of the character at which a key stands in a YAML file, or else the innermost section that it is in; of
    one in no section the end of the file."""
    try:
        text = file.read_text(encoding="utf-8")
        root = yaml.compose(text, Loader=loader_of(text))
    except (OSError, ValueError, yaml.YAMLError):
        root = None
    below = {}  # by node: of each key, name or number below it the place and the node

    def children(node: yaml.Node) -> dict[str | int, tuple[int, yaml.Node]]:
        if node not in below:
            below[node] = dict(_children(node))
        return below[node]

    def place_of(parts: list[str | int]) -> int:
        node, place = root, root.end_mark.index if root else 0
        for part in parts:
            if node is None or part not in children(node):
                break
            place, node = children(node)[part]
        return place

    return place_of


def _children(node: yaml.Node) -> Iterator[tuple[str | int, tuple[int, yaml.Node]]]:
    """Children of a node, (key, (offset in the text, node)); entries of a list by number and, if named, by name."""
    if isinstance(node, yaml.MappingNode):
        yield from ((key.value, (key.start_mark.index, value)) for key, value in node.value)
    elif isinstance(node, yaml.SequenceNode):
        for number, entry in enumerate(node.value):
            pairs = entry.value if isinstance(entry, yaml.MappingNode) else ()
            names = [value.value for key, value in pairs if key.value == "name" and isinstance(value, yaml.ScalarNode)]
            yield from ((name, (entry.start_mark.index, entry)) for name in (number, *names))


def _is_said(overrides: dict, parts: list[str | int]) -> bool:
    """True if --config sets a key, given by its parts, or one of the sections around it."""
    for part in parts:
        if not isinstance(overrides, dict):
            return True
        if part not in overrides:
            return False
        overrides = overrides[part]
    return True
