"""The code of the page "Before you start" does what the page shows."""

import doctest
from pathlib import Path

PAGE = Path(__file__).resolve().parents[2] / "docs/how-to/before-you-start.md"


def test_the_examples_of_the_page_hold():
    examples = doctest.DocTestParser().get_doctest(PAGE.read_text(encoding="utf-8"), {}, PAGE.name, str(PAGE), 0)
    found = doctest.DocTestRunner().run(examples)
    assert found.attempted == 3
    assert found.failed == 0
