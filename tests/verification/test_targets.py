"""Which files the rules of the studies read."""

from pathlib import Path

import pytest
import yaml
from common.sources import source_hash
from snakemake.iocontainers import Wildcards

from verification.targets import Studies

ROOT = Path(__file__).parents[2]
DEFAULT = yaml.safe_load((ROOT / "config/default.yaml").read_text())
JAEGER = Wildcards(fromdict={"study": "jaeger"})


@pytest.fixture(scope="module")
def studies() -> Studies:
    """Those of the checkout."""
    return Studies(ROOT / "config/verification", DEFAULT)


def test_a_variant_is_a_mine_in_a_folder_of_its_own(studies):
    """One that is not there ends the run in one line with those that are."""
    assert studies.mine_at("verification/jaeger/dip_40").name == "jaeger-dip_40"
    with pytest.raises(SystemExit, match=r"jaeger\.yaml: variants: no 'dip_41'; there are .*dip_40"):
        studies.mine_at("verification/jaeger/dip_41")


def test_a_study_that_is_wrong_ends_the_run_in_one_line(tmp_path):
    (tmp_path / "wrong.yaml").write_text("answer: jaeger\n")
    with pytest.raises(SystemExit, match=r"wrong\.yaml: a study needs the keys answer and title"):
        Studies(tmp_path, DEFAULT).read("wrong")


def test_an_answer_reads_all_stages_of_all_variants(studies):
    """Events only where the study asks for them."""
    files = studies.results(JAEGER)
    variants = studies.read("jaeger").mines
    assert len(files) == len(set(files)) == sum(2 + len(mine.mined_steps) for mine in variants.values())
    assert "results/verification/jaeger/dip_40/steps/press.nc" in files
    assert any("/events/" in file for file in studies.results_of(["spread_stope"]))


def test_an_answer_depends_on_its_module(studies):
    assert studies.answer_sources(JAEGER) == source_hash("verification answer", "verification.answers.jaeger")


def test_long_studies_are_run_by_their_own_names_alone(studies):
    """All others are verified, each with its rows and figure."""
    every, verified = set(studies.named("")), studies.verified()
    assert {"brazilian_platens", "schemes_demo"} <= every - set(verified)
    assert len(studies.answers(JAEGER)) == 2 * len(verified)
    assert set(studies.verified_files(JAEGER)) == {studies.file(name) for name in verified}
    assert studies.named("tradeoff_")[0] == "tradeoff_brittle"
