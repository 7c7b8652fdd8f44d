"""Measured results on the pages of docs/studies: python -m verification pages [RESULTS] [--check]

A page is written by hand except for its blocks. A block stands between two comments and belongs to one study. This
command rewrites the blocks of all studies that have a table in the folder RESULTS (results of a checkout), and copies
their figures. The other blocks keep their results. Every block says so where the numerics changed after the commit that
its results were made at.
"""

import importlib
import io
import re
from collections import Counter
from pathlib import Path

import pandas as pd

from common.datasets import atomic_path
from common.errors import InputError
from verification.frame import COST_COLUMNS, COSTS, load
from verification.made import NUMERICS, ROOT, UNKNOWN, Made, is_older
from verification.page_tables import LEGEND, TABLE, Columns, Pivot, markdown, rows_table
from verification.rows import KNOWN_MISS, PASSES_NOW, VERDICTS, parse_known_misses, read_rows
from verification.studies import FOLDER
from verification.targets import MEASURING
from workflow.strict_yaml import read_yaml

PAGES = ROOT / "docs" / "studies"
CORES = {"benchmarks": "2", "economies": "1"}  # That Snakemake is given for a measuring study; all for the others.
# Files of config/verification whose runs stand in one of those tables.
POINTS_OF = ("tradeoff_", "spread_", "times_", "scale_", "economies_", "foreseen_")
INDEX = "index"
BLOCK = re.compile(r"(<!-- results: (\S+) -->\n)(.*?)(<!-- end of results -->)", re.DOTALL)
MADE = re.compile(r"Made on \S+ at commit `([^`]+)`")
OLDER = re.compile(r" They are \*older than the numerics\*: [^*]* has changed since\.")
COUNTS = re.compile(r"(\d+) rows?, (\d+) judged: (\d+) pass(?:es)?, (\d+) known miss(?:es)?, (\d+) fails?\.")
INDEX_FACTS = ("Checks", "Reference")  # Facts that the index quotes from each page.
# Widths of a figure, pixels. The first one whose file is below MAX_FIGURE_BYTES is taken.
FIGURE_WIDTHS = (1200, 1000, 800)
PALETTE_COLOURS = 256
MAX_FIGURE_BYTES = 150_000


def studies() -> list[str]:
    """Names of all studies that have a block on a page."""
    files = sorted(path.stem for path in FOLDER.glob("*.yaml"))
    return [name for name in files if not name.startswith(POINTS_OF)] + list(MEASURING)


def rewrite(results: Path | None, pages: Path = PAGES) -> list[str]:
    """Rewrite the blocks of the studies with results and copy their figures; returns the names of these studies.

    Without results all blocks keep theirs. In any case blocks are marked whose results are older than the numerics, and
    the index is renewed. Raises InputError where the folder or a table in it is missing, a study is unknown, or a page
    lacks its markers.
    """
    tables = find_tables(results) if results else {}
    texts = read_pages(pages)
    blocks = {name: block(name, table, pages / "figures") for name, table in tables.items()}

    def fill(match: re.Match) -> str:
        old = match[3] if "|" in match[3] else not_measured(match[2])
        return match[1] + marked(blocks.get(match[2], old), numerics(match[2])) + match[4]

    texts = {path: BLOCK.sub(fill, text) for path, text in texts.items()}
    index = pages / f"{INDEX}.md"
    overview = index_table({path.stem: text for path, text in texts.items() if path != index})
    texts[index] = BLOCK.sub(lambda match: match[1] + overview + match[4], texts[index])
    for path, text in texts.items():
        with atomic_path(path) as temporary:
            temporary.write_text(text, encoding="utf-8")
    return list(tables)


def read_pages(pages: Path) -> dict[Path, str]:
    """Texts of all pages. Raises InputError where a marker is missing or wrong."""
    texts = {path: path.read_text(encoding="utf-8") for path in sorted(pages.glob("*.md"))}
    check_blocks(texts)
    return texts


def older_pages(pages: Path = PAGES) -> list[str]:
    """A line for each study whose results are older than the numerics: page, study and commit."""
    return [
        f"{path.stem}.md: {match[2]} was made at commit {commit}"
        for path, text in read_pages(pages).items()
        for match in BLOCK.finditer(text)
        for commit in MADE.findall(match[3])
        if is_older(commit, numerics(match[2]))
    ]


def numerics(name: str) -> tuple[str, ...]:
    """Folders with which the results of a study may change.

    A study without scenes measures no mechanics: its answer names them as NUMERICS.
    """
    if name in MEASURING:
        return (*NUMERICS, *MEASURING[name].numerics)
    if name == INDEX:
        return NUMERICS
    answer = importlib.import_module(f"verification.answers.{read_yaml(FOLDER / f'{name}.yaml')['answer']}")
    return getattr(answer, "NUMERICS", NUMERICS)


def marked(text: str, folders: tuple[str, ...]) -> str:
    """Text of a block with a sentence that says so where its results are older than the numerics, which are folders."""
    text = OLDER.sub("", text)
    made = MADE.search(text)
    if not made or not is_older(made[1], folders):
        return text
    first, rest = text.split("\n", 1)
    named = " or ".join(f"`{folder}`" for folder in folders)
    return f"{first} They are *older than the numerics*: {named} has changed since.\n{rest}"


def find_tables(results: Path) -> dict[str, Path]:
    """The table of each study that has one."""
    if not results.is_dir():
        raise InputError(f"{results}: no such folder; name the folder results of a checkout that ran the studies")
    known = studies()
    found = {path.parent.name: path for path in sorted(results.glob(f"verification/*/{TABLE}.csv"))}
    found = {name: path for name, path in found.items() if not name.startswith(POINTS_OF)}
    unknown = [name for name in found if name not in known]
    if unknown:
        raise InputError(
            f"{found[unknown[0]]}: {FOLDER.relative_to(ROOT)} has no study '{unknown[0]}'; remove its folder"
        )
    found |= {name: results / name / "table.csv" for name in MEASURING if (results / name / "table.csv").is_file()}
    if not found:
        raise InputError(f"{results}: holds neither verification/<study>/table.csv nor <study>/table.csv")
    return found


def check_blocks(texts: dict[Path, str]) -> None:
    """Raise InputError unless every study has one block, and every page has blocks of studies."""
    places: dict[str, Path] = {}
    for path, text in texts.items():
        names = [match[2] for match in BLOCK.finditer(text)]
        if (
            not names
            or text.count("<!-- results:") != len(names)
            or text.count("<!-- end of results -->") != len(names)
        ):
            raise InputError(f"{path}: needs '<!-- results: STUDY -->' and '<!-- end of results -->', each on its line")
        for name in names:
            if name not in (INDEX, *studies()):
                raise InputError(f"{path}: '{name}' is not a study; there are {', '.join(studies())}")
            if name in places:
                raise InputError(f"{path}: the results of '{name}' stand in {places[name]} already")
            places[name] = path
    missing = [name for name in (INDEX, *studies()) if name not in places]
    if missing:
        raise InputError(f"docs/studies: no page has '<!-- results: {missing[0]} -->'")


def block(name: str, table: Path, figures: Path) -> str:
    """Text of one study's block. Its figures are drawn into the folder `figures`."""
    if name in MEASURING:
        title, counts, lines = _measured(name, table)
    else:
        title, counts, lines = _verified(name, table)
    pictures = []
    for figure in sorted(table.parent.glob("*.svg")):
        copy = figures / (f"{name}.png" if figure.stem == "figure" else f"{name}_{figure.stem}.png")
        draw(figure, copy)
        pictures += [f"![{title}]({figures.name}/{copy.name})", ""]
    made = Made.read(table)
    if made.commit == UNKNOWN:
        raise InputError(f"{table}: was made in no git checkout, which would tell the commit that it was made at")
    return "\n".join([f"{made.sentence()} {counts}", "", *pictures, *lines]) + "\n"


def _measured(name: str, table: Path) -> tuple[str, str, list[str]]:
    """Title, counts and tables of a measuring study."""
    lines = []
    for shown in load(name).shown:
        file = table.with_stem(shown.file)
        try:
            lines += [*shown.lines(pd.read_csv(file)), ""]
        except (KeyError, FileNotFoundError) as error:
            missing = f"has no column {error.args[0]}" if isinstance(error, KeyError) else "is missing"
            raise InputError(
                f"{file.name} of {name}: {missing}; an earlier version made it: run the target again"
            ) from error
    rows = pd.read_csv(table, dtype=str, keep_default_na=False).to_dict("records")
    is_judged = any(row.get("passed") for row in rows)
    return f"Results of {name}", _counts(rows) if is_judged else f"{len(rows)} rows.", lines


def _verified(name: str, table: Path) -> tuple[str, str, list[str]]:
    """Title, counts and tables of a study with a known answer."""
    study, rows = read_yaml(FOLDER / f"{name}.yaml"), read_rows(table)
    lines = _verification_tables(rows, answer_tables(study["answer"]))
    known = parse_known_misses(study.get("known_misses"))
    causes = Counter(known[row["quantity"]].cause for row in rows if row["passed"] == KNOWN_MISS)
    if causes:
        lines += ["Causes of the known misses:", "", *(f"- {cause} (rows: {n})" for cause, n in causes.items()), ""]
    costs = table.with_stem(COSTS)
    if costs.is_file():
        lines += [*Columns("Cells, time and memory of each variant", COST_COLUMNS).lines(pd.read_csv(costs)), ""]
    return study["title"], _counts(rows), lines


def _verification_tables(rows: list[dict[str, str]], pivots: tuple[Pivot, ...]) -> list[str]:
    """Pivots of the rows that belong to them. All other rows, and those that do not pass, follow one by one."""
    lines, rest = [], rows
    for pivot in pivots:
        inside = [row for row in rows if pivot.place(row)]
        if inside:
            lines += [*pivot.lines(inside), ""]
            rest = [row for row in rest if row not in inside or row["passed"] in (VERDICTS[False], KNOWN_MISS)]
    if lines:
        lines += [LEGEND, ""]
    return lines + ([*rows_table(rest), ""] if rest else [])


def _counts(rows: list[dict[str, str]]) -> str:
    of = {
        verdict: sum(row["passed"] == verdict for row in rows)
        for verdict in (*VERDICTS.values(), KNOWN_MISS, PASSES_NOW)
    }
    passed, known, failed = of[VERDICTS[True]] + of[PASSES_NOW], of[KNOWN_MISS], of[VERDICTS[False]]
    judged = passed + known + failed
    return (
        f"{len(rows)} row{'s' if len(rows) != 1 else ''}, {judged} judged: {passed} pass{'es' if passed == 1 else ''}, "
        f"{known} known miss{'es' if known != 1 else ''}, {failed} fail{'s' if failed == 1 else ''}."
    )


def answer_tables(answer: str) -> tuple[Pivot, ...]:
    """Tables of the page of a study with a known answer: TABLES of the answer's module, and none without them."""
    return getattr(importlib.import_module(f"verification.answers.{answer}"), "TABLES", ())


def not_measured(name: str) -> str:
    """Text of a block without results: the command that makes them."""
    target = name if name in MEASURING else f"results/verification/{name}/{TABLE}.csv"
    return (
        f"No results are kept here yet. `.venv/bin/snakemake --cores {CORES.get(name, 'all')} {target}` makes them.\n"
    )


def draw(figure: Path, copy: Path) -> None:
    """Draw an SVG as a small PNG. Its palette keeps the colours of thin lines, which cover little of a figure."""
    import resvg_py
    from PIL import Image

    for width in FIGURE_WIDTHS:
        content = resvg_py.svg_to_bytes(svg_path=str(figure), dpi=96, width=width, background="white")
        picture = Image.open(io.BytesIO(bytes(content))).convert("RGB")
        file = io.BytesIO()
        picture.quantize(PALETTE_COLOURS, Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE).save(
            file, format="png", optimize=True
        )
        if len(file.getvalue()) < MAX_FIGURE_BYTES:
            break
    else:
        raise InputError(f"{figure}: more than {MAX_FIGURE_BYTES:,} bytes as a picture {FIGURE_WIDTHS[-1]} pixels wide")
    with atomic_path(copy) as temporary:
        temporary.write_bytes(file.getvalue())


def index_table(texts: dict[str, str]) -> str:
    """Table of all pages: title, what each checks, its reference, and the counts of its rows."""
    body = []
    for name, text in texts.items():
        title, *facts = (_told(name, text, start) for start in ("# ", *(f"- **{fact}:** " for fact in INDEX_FACTS)))
        counts = [[int(count) for count in match.groups()] for match in COUNTS.finditer(text)]
        _, judged, passed, known, failed = (
            (sum(column) for column in zip(*counts, strict=True)) if counts else [None] * 5
        )
        unjudged = "measured, not judged" if MADE.search(text) else "no results"
        numbers = [unjudged, "", "", ""] if judged is None else map(str, (judged, passed, known, failed))
        body.append([f"[{title}]({name}.md)", *facts, *numbers])
    head = ("study", "what it checks", "reference", "rows judged", "pass", "known misses", "fail")
    return "\n".join(markdown(head, body)) + "\n"


def _told(name: str, text: str, start: str) -> str:
    """Rest of the first line of a page that starts so. Raises InputError without such a line."""
    found = re.search(rf"^{re.escape(start)}(.+)$", text, re.MULTILINE)
    if not found:
        raise InputError(f"docs/studies/{name}.md: needs a line '{start}...'")
    return found[1].rstrip(".")
