"""Numbers of the code in the report's own words: as values, so that the words cannot say another number."""

import re
from pathlib import Path

from catalogs.report import page
from catalogs.report.cell_effects import MAX_ERROR_SHARE
from catalogs.report.sections import SECTIONS
from catalogs.sources.sizes import B_MAGNITUDE_PER_B_POTENCY

TEMPLATES = {name: page.FOLDER / "sections" / f"{name}.html.j2" for name in SECTIONS}
READING = Path(__file__).parents[2] / "docs/how-to/reading-the-report.md"


def test_every_section_has_a_module_and_a_template():
    """And there is neither of another."""
    for suffix in (".py", ".html.j2"):
        found = {path.name.removesuffix(suffix) for path in (page.FOLDER / "sections").glob(f"*{suffix}")}
        assert found - {"__init__"} == set(SECTIONS)
    assert list(page.MODULES) == ["first", *SECTIONS]
    assert set(page.SLOWEST_FIRST) <= set(page.MODULES)


def test_headings_and_sentences_take_numbers_from_the_list_of_sections():
    """No heading and no sentence has one of its own."""
    for name, path in TEMPLATES.items():
        headings = re.findall(r'<section id="(\w+)">\n<h2[^>]*>(.{12,}?\}\})', path.read_text())
        assert headings == [(name, f'{{{{ section_number("{name}") }}}}')]
    texts = [path.read_text() for path in page.FOLDER.rglob("*.py")]
    assert len(texts) > 20
    assert not [text for text in texts if re.search(r"\bsection \d", text)]


def test_the_how_to_lists_the_sections_that_there_are():
    """With their numbers and names."""
    listed = re.findall(r"^\| (\d+) ([^|]+?) \|", READING.read_text(), re.MULTILINE)
    assert listed == [(str(number), name) for number, name in enumerate(SECTIONS.values(), 1)]


def test_the_templates_have_no_number_of_their_own_in_their_sentences():
    """But 95 %, which is what an interval is, and the page's own styles."""
    body = (page.FOLDER / "templates/report.html.j2").read_text().partition("<body>")[2]
    body += (page.FOLDER / "templates/first_page.html.j2").read_text()
    body += "".join(path.read_text() for path in TEMPLATES.values())
    sentences = re.findall(r"<p[ >].*?</p>|picture\(.*?\) \}\}", body, flags=re.DOTALL)
    assert len(sentences) > 20
    for sentence in sentences:
        words = re.sub(r"\{%.*?%\}|\{\{(?! picture).*?\}\}|<[^>]+>|'[^']*'", " ", sentence)
        words = re.sub(r"95 %|~.*?~|\b1 (?:is at failure|means)|0 means|DXF|2015", " ", words)
        found = re.findall(r"\b\d+(?:\.\d+)?(?: %| degrees)|\b(?:hundred|half of|a fifth|a tenth)\b", words)
        assert not found, (found, sentence)
    assert B_MAGNITUDE_PER_B_POTENCY == 1.5


def test_another_limit_is_another_sentence(tmp_path):
    line = next(one for one in TEMPLATES["uncertainty"].read_text().splitlines() if "uncertainty.too_coarse" in one)
    sentence = page._environment(tmp_path).from_string(line)
    for limit, said in ((0.3, "stands for more than 30 %"), (MAX_ERROR_SHARE, "stands for more than 65 %")):
        assert said in sentence.render(uncertainty={"sizes": ["1", "2"], "too_coarse": limit})
