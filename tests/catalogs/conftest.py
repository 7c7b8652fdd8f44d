"""What several tests of the report share: one mine, its files read only, and one report with everything."""

import pytest
import report_fixtures as fixtures
from report_fixtures import Page

from catalogs.figures import style
from common.costs import Costs


@pytest.fixture(scope="session")
def mine(tmp_path_factory) -> fixtures.Mine:
    """A small one; its report is `page`: others are written elsewhere."""
    return fixtures.make_mine(tmp_path_factory.mktemp("mine"), **fixtures.SMALL)


@pytest.fixture(scope="session")
def page(mine) -> Page:
    """The report with everything."""
    logs = mine.folder / "logs"
    (logs / "steps").mkdir(parents=True)
    (logs / "steps" / "2019-08.log").write_text(f"at work\n{Costs(12.5, 20.25, 1.5, 345.0).closing_line('step')}\n")
    fixtures.write_page(**mine.arguments(logs=logs))
    return Page((mine.folder / "report.html").read_text())


@pytest.fixture
def without_drawing(monkeypatch):
    """Figures are empty files, but for those of `page`."""
    monkeypatch.setattr(style, "save", fixtures.write_nothing)
    return monkeypatch
