"""What several tests of the report share: one mine, its files read only, and one report with everything."""

from dataclasses import replace

import pytest
import report_fixtures as fixtures
from report_fixtures import Page

from catalogs.compare.comparison import compare
from catalogs.figures import style
from catalogs.report.evidence import Evidence
from common.costs import Costs
from common.datasets import read_dataset


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


@pytest.fixture(scope="module")
def known(mine) -> Evidence:
    """Steps, events and a measured record with mechanisms, from one run; nothing of it is wrong."""
    record = read_dataset(mine.record).assign_attrs(kind="recorded")
    catalog = read_dataset(mine.catalog)
    found = fixtures.evidence_of(**mine.arguments())
    for stage in found.stages:
        stage.attrs |= {"truncated": 0, "loose_pieces": 0}
    comparison = compare(catalog, record, fixtures.dated_steps())
    return replace(found, record=record, comparison=comparison)
