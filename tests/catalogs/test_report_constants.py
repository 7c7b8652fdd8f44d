"""Numbers of the code in the report's own words: as values, so that the words cannot say another number."""

import re

import pytest

from catalogs.compare.grid_convergence import MIN_ERROR_SHARE, SAFETY_FACTOR
from catalogs.figures.record_figure import EVENTS_PER_WINDOW
from catalogs.figures.views import MIN_EXCAVATED_SHARE_DRAWN
from catalogs.report import page
from catalogs.report.grid_convergence_text import MAX_ERROR_SHARE
from catalogs.report.section_numbers import SECTIONS
from catalogs.sources.mechanisms import MAX_CONE
from catalogs.sources.sizes import B_MAGNITUDE_PER_B_POTENCY

LIMITS = {
    "least_error": MIN_ERROR_SHARE,
    "safety": SAFETY_FACTOR,
    "too_coarse": MAX_ERROR_SHARE,
    "shown_excavated": MIN_EXCAVATED_SHARE_DRAWN,
    "window": EVENTS_PER_WINDOW,
    "widest_cone": MAX_CONE,
}


def test_every_limit_that_the_page_names_is_that_of_the_code():
    assert page.LIMITS == LIMITS
    template = (page.TEMPLATES / "report.html.j2").read_text()
    for name in LIMITS:
        assert f"limits.{name}" in template, name
    assert B_MAGNITUDE_PER_B_POTENCY == 1.5


def test_sections_stand_in_the_order_of_their_numbers():
    """Contents, headings and sentences take a section's number from SECTIONS; no heading has one of its own."""
    template = (page.TEMPLATES / "report.html.j2").read_text()
    headings = re.findall(r'<section id="(\w+)">\n<h2[^>]*>(.{12,}?\}\})', template)
    assert headings == [(section, f'{{{{ section_number("{section}") }}}}') for section in SECTIONS]
    assert not re.search(r"<h2[^>]*>\d", template)
    texts = [path.read_text() for path in page.TEMPLATES.parent.glob("*.py")]
    assert len(texts) > 10
    assert not [text for text in texts if re.search(r"\bsection \d", text)]


def test_the_template_has_no_number_of_its_own_in_its_sentences():
    """But 95 %, which is what an interval is, and the page's own styles."""
    template = (page.TEMPLATES / "report.html.j2").read_text()
    body = template[template.index("<body>") :] + (page.TEMPLATES / "first_page.html.j2").read_text()
    sentences = re.findall(r"<p[ >].*?</p>|picture\(.*?\) \}\}", body, flags=re.DOTALL)
    assert len(sentences) > 20
    for sentence in sentences:
        words = re.sub(r"\{%.*?%\}|\{\{(?! picture).*?\}\}|<[^>]+>|'[^']*'", " ", sentence)
        words = re.sub(r"95 %|~.*?~|\b1 (?:is at failure|means)|0 means|DXF|2015", " ", words)
        found = re.findall(r"\b\d+(?:\.\d+)?(?: %| degrees)|\b(?:hundred|half of|a fifth|a tenth)\b", words)
        assert not found, (found, sentence)


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("least_error", 0.2, "never less than 20 %"),
        ("safety", 1.5, "is 1.5 times its change"),
        ("too_coarse", 0.3, "stands for more than 30 %"),
    ],
)
def test_another_limit_is_another_sentence(name, value, said):
    template = (page.TEMPLATES / "report.html.j2").read_text()
    line = next(line for line in template.splitlines() if f"limits.{name}" in line)
    sentence = page._environment().from_string(line)
    convergence = {"sizes": ["1", "2"]}
    assert said in sentence.render(limits=LIMITS | {name: value}, convergence=convergence)
    assert said not in sentence.render(limits=LIMITS, convergence=convergence)
