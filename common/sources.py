"""The files that a command of this repository runs, from the sources: its module's imports, and theirs.

An import within a function counts, and so does the package that a module stands in. A file that is no module (a
template, a schema) belongs to the modules next to it that say its name, or that of its folder, in double quotes.
"""

import ast
import functools
import gc
import hashlib
import re
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
CODE = (".py", ".pyc")
IMPORT = re.compile(r"^[ \t]*((?:import [^\n]+|from [\w.]+ import (?:\([^)]*\)|[^\n(]+)))", re.MULTILINE)


@functools.cache
def source_hash(*commands: str) -> str:
    """Hash of all files that the commands run, in path order; commands: see source_files."""
    digest = hashlib.sha256()
    for path in sorted(set().union(*map(source_files, commands))):
        digest.update(str(path.relative_to(ROOT)).encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:16]


@functools.cache
def source_files(command: str) -> frozenset[Path]:
    """Files of this repository that `python -m <command>` may run or read. Raises ValueError if there is no such thing.

    command: a module, or a package with a __main__; the same and the stage that it is to run ("catalogs report"),
    a function of that name in it, where what other stages import does not count; or a path with a slash, of a file or
    of a folder with all in it, for what is neither imported nor next to its module.
    """
    if "/" in command:
        path = ROOT / command
        files = frozenset(_below(path) if path.is_dir() else {path} & set(path.parent.iterdir()))
    else:
        module, _, stage = command.partition(" ")
        entry = _file(f"{module}.__main__") or _file(module)
        files = frozenset(_closure(entry, module, stage) if entry else ())
    if not files:
        raise ValueError(f"sources of {command!r}: there are none")
    return files


def _closure(entry: Path, module: str, stage: str) -> set[Path]:
    """The entry, and all that it imports or names, with all that these do."""
    files, new = set(), {entry, *_files(module)}
    while new:
        path = new.pop()
        imported, named = _uses(path, stage if path == entry else "")
        files |= {path, *named}
        new |= imported - files
    return files


@functools.cache
def _uses(path: Path, stage: str) -> tuple[set[Path], set[Path]]:
    """Modules that a module imports (in a stage alone, if one is named), and files next to it that it names."""
    source = path.read_text(encoding="utf-8")
    collecting = gc.isenabled()
    gc.disable()  # it would scan a growing tree again and again: twice the time
    try:
        tree = _of_stage(ast.parse(source), stage) if stage else _import_statements(source)
        imported = {file for name in _imports(tree, path) for file in _files(name)}
    finally:
        if collecting:
            gc.enable()
    named = {file for name, files in _data(path.parent).items() if f'"{name}"' in source for file in files}
    return imported, named


def _import_statements(source: str) -> ast.Module:
    """The import statements of a module alone: to parse all of it takes many times as long, before each stage."""
    try:
        return ast.parse("\n".join(IMPORT.findall(source)))
    except SyntaxError:  # a line of a text that begins like one
        return ast.parse(source)


def _imports(tree: ast.Module, path: Path) -> Iterator[str]:
    """Dotted names that a module at `path` imports: of modules, or of what may be a module."""
    for node in _statements(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            package = path.parent.relative_to(ROOT).parts
            parents = package[: len(package) - node.level + 1] if node.level else ()
            base = ".".join([*parents, *filter(None, [node.module])])
            yield from (f"{base}.{alias.name}" for alias in node.names)


def _statements(node: ast.AST) -> Iterator[ast.AST]:
    """All statements below a node, in functions and classes too; not what they are made of, which is the most of it."""
    for part in ("body", "orelse", "handlers", "finalbody", "cases"):
        for statement in getattr(node, part, ()):
            yield statement
            yield from _statements(statement)


def _of_stage(tree: ast.Module, stage: str) -> ast.Module:
    """The module without the functions that its function `stage` does not reach by name. Raises ValueError."""
    functions = {node.name: node for node in tree.body if isinstance(node, ast.FunctionDef)}
    if stage not in functions:
        raise ValueError(f"sources: no function {stage} among {', '.join(functions)}")
    reached, new = set(), {stage}
    while new:
        name = new.pop()
        reached.add(name)
        said = {node.id for node in ast.walk(functions[name]) if isinstance(node, ast.Name)}
        new |= said & set(functions) - reached
    others = [node for node in tree.body if not isinstance(node, ast.FunctionDef)]
    return ast.Module([*others, *(functions[name] for name in reached)], [])


def _files(name: str) -> set[Path]:
    """Files that importing a dotted name runs: the module, if it is ours, and the packages that it stands in."""
    parts = name.split(".")
    found = (_file(".".join(parts[: length + 1])) for length in range(len(parts)))
    return {path for path in found if path}


@functools.cache
def _file(name: str) -> Path | None:
    """The file of a module or package of ours; None for one of another's, and for a folder that is no package."""
    path = ROOT.joinpath(*name.split("."))
    return next((file for file in (path / "__init__.py", path.with_name(f"{path.name}.py")) if file.is_file()), None)


@functools.cache
def _data(folder: Path) -> dict[str, set[Path]]:
    """Files of a folder that are no modules, by their name and by that of the folder in it that they stand below.

    What stands below a package in it belongs to the modules of that.
    """
    entries = (path for path in folder.iterdir() if not (path / "__init__.py").is_file())
    found = {path.name: _below(path) if path.is_dir() else {path} for path in entries}
    return {name: {file for file in files if file.suffix not in CODE} for name, files in found.items()}


def _below(folder: Path) -> set[Path]:
    """All files of a folder and of those in it, compiled ones left out."""
    return {path for path in folder.rglob("*") if path.is_file() and path.suffix != ".pyc"}
