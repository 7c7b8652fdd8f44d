"""The documentation's site: it builds without a warning, its links lead somewhere, and it needs no network."""

import re
from pathlib import Path

import pytest
from sphinx.cmd.build import build_main

ROOT = Path(__file__).resolve().parents[2]
KEYS = ROOT / "config/README.md"
FROM_ELSEWHERE = re.compile(r"""<(?:script|img|iframe)[^>]*\ssrc="(?:https?:)?//|<link[^>]*\shref="(?:https?:)?//""")
LINK = re.compile(r"\]\(([^)#]+)[^)]*\)")


@pytest.fixture(scope="module")
def site(tmp_path_factory) -> dict[str, str]:
    """The pages of the site, by their path."""
    folder = tmp_path_factory.mktemp("site")
    assert build_main(["-n", "-W", "--keep-going", "-q", "-c", str(ROOT / "docs"), str(ROOT), str(folder)]) == 0
    return {str(page.relative_to(folder)): page.read_text(encoding="utf-8") for page in folder.rglob("*.html")}


def test_every_page_is_part_of_the_site(site):
    pages = {str(page.relative_to(ROOT).with_suffix(".html")) for page in (ROOT / "docs").rglob("*.md")}
    assert pages | {"CONTRIBUTING.html", "CHANGELOG.html", "config/README.html"} <= set(site)


def test_no_page_loads_anything_from_elsewhere(site):
    assert {page for page, text in site.items() if FROM_ELSEWHERE.search(text)} == set()


def test_formulas_are_drawn_by_the_browser(site):
    text = site["docs/explanation/failure-and-increments.html"]
    assert '<math xmlns="http://www.w3.org/1998/Math/MathML"' in text
    assert "\\frac" not in text


def test_the_readme_links_to_files_that_exist():
    links = [link for link in LINK.findall((ROOT / "README.md").read_text(encoding="utf-8")) if "://" not in link]
    assert links
    assert [link for link in links if not (ROOT / link).exists()] == []


def test_the_readme_is_short_and_its_anchors_are_headings():
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert len(text) <= 4500
    anchors = re.findall(r"\]\(([^)#]+)#([^)]+)\)", text)
    assert anchors
    for page, anchor in anchors:
        headings = re.findall(r"^#+ (.+)$", (ROOT / page).read_text(encoding="utf-8"), re.MULTILINE)
        assert anchor in {re.sub(r"[^\w -]", "", heading).lower().replace(" ", "-") for heading in headings}


def test_the_readme_has_one_command_for_the_demo_and_one_for_the_tests():
    """Each does all set-up on a fresh machine, and is short enough to type."""
    blocks = re.findall(r"```sh\n(.*?)```", (ROOT / "README.md").read_text("utf-8"), re.DOTALL)
    assert blocks[1:3] == ["./install && .venv/bin/snakemake --cores all\n", "./install && .venv/bin/pytest\n"]
    assert (ROOT / "install").stat().st_mode & 0o111


@pytest.mark.parametrize(
    ("page", "folders"),
    [("reading-the-report.md", ("catalogs/report",)), ("running.md", ("mpm_core", "catalogs", "workflow"))],
)
def test_pages_quote_warnings_that_are_given(page, folders):
    files = [path for folder in folders for path in (ROOT / folder).rglob("*") if path.suffix in (".py", ".j2")]
    given = "\n".join(path.read_text(encoding="utf-8") for path in files)
    given = re.sub(r'"\s*\n\s*(?:text \+= |found\.append\(|)f?"', "", given)  # a text that goes on in the next line
    text = (ROOT / "docs/how-to" / page).read_text(encoding="utf-8")
    quoted = re.findall(r'^\| "([^"]+)" \|', text, flags=re.MULTILINE)
    assert quoted
    assert [warning for warning in quoted if warning not in given] == []


def test_files_that_pages_name_exist():
    packages = "|".join(folder.name for folder in ROOT.iterdir() if (folder / "__init__.py").is_file())
    named = re.compile(rf"`((?:{packages}|config|tests|workflow|profiles)/[\w./-]+)`")
    pages = [*(ROOT / "docs").rglob("*.md"), ROOT / "CONTRIBUTING.md", ROOT / "README.md"]
    found = {(page.name, path) for page in pages for path in named.findall(page.read_text(encoding="utf-8"))}
    assert found
    assert {(page, path) for page, path in found if not (ROOT / path).exists()} == set()


def test_keys_that_pages_name_exist():
    """Keys are written `section.key`, or `section.key: value`."""
    tables = re.findall(
        r"^### ([\w.]+).*?\n(.*?)(?=^##|\Z)", KEYS.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE
    )
    known = {f"{path}.{key}" for path, rows in tables for key in re.findall(r"^\| `(\w+)` \|", rows, re.MULTILINE)}
    sections = "|".join({path.split(".")[0] for path, _ in tables})
    named = re.compile(rf"`((?:{sections})\.(?!nc|vtu|csv|py|html)[a-z_.]+)[`:]")
    pages = [*(ROOT / "docs").rglob("*.md"), ROOT / "README.md"]
    found = {(page.name, key) for page in pages for key in named.findall(page.read_text(encoding="utf-8"))}
    assert found
    assert {(page, key) for page, key in found if key not in known} == set()


def test_works_that_pages_cite_are_those_listed():
    """Cited as: Name 2000, Name and Name (2000), Name's (2000), Name et al. 2000."""
    folder = ROOT / "docs"
    entry = re.compile(r"^- ([\w-]+),[^(]*\((\d{4})\)", re.MULTILINE)
    listed = entry.findall((folder / "reference/references.md").read_text("utf-8"))
    pages = [page.read_text("utf-8") for part in ("explanation", "laws") for page in (folder / part).glob("*.md")]
    name = r"[A-ZÀ-Ž][\w-]+"
    cite = re.compile(rf"({name})(?:, {name})*(?: and {name}| et al\.)?(?:'s?)? \(?((?:19|20)\d\d)\b")
    assert set(cite.findall(" ".join(" ".join(pages).split()))) == set(listed)


def test_defaults_that_pages_state_are_those_of_the_settings():
    """A default is stated as `section.key` (default 0.2)."""
    tables = re.findall(r"^### ([\w.]+)\n(.*?)(?=^##|\Z)", KEYS.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)
    row = re.compile(r"^\| `(\w+)` \|[^|]*\| `([^`]+)` \|", re.MULTILINE)
    known = {f"{path}.{key}": default for path, rows in tables for key, default in row.findall(rows)}
    stated = re.compile(r"`([a-z_.]+)`\s\(default\s([^)]+)\)")
    found = {pair for page in (ROOT / "docs").rglob("*.md") for pair in stated.findall(page.read_text("utf-8"))}
    assert found
    assert {(key, default) for key, default in found if known.get(key) != default} == set()


def test_the_tutorial_quotes_the_mine_file_of_the_demo():
    """Each excerpt is a run of whole lines of the file, word for word."""
    mine = (ROOT / "config/mines/demo.yaml").read_text(encoding="utf-8")
    excerpts = re.findall(r"```yaml\n(.*?)```", (ROOT / "docs/tutorial.md").read_text(encoding="utf-8"), re.DOTALL)
    assert excerpts
    assert [excerpt for excerpt in excerpts if f"\n{excerpt}" not in f"\n{mine}"] == []


def test_words_of_the_glossary_are_in_alphabetical_order():
    parts = (ROOT / "docs/reference/glossary.md").read_text(encoding="utf-8").split("\n## ")[1:]
    words = [re.findall(r"^### (.+)$", part, re.MULTILINE) for part in parts]
    assert all(words)
    assert words == [sorted(part, key=str.casefold) for part in words]
