"""Which files the rules of the studies read."""

from pathlib import Path

import pytest
import yaml
from snakemake.iocontainers import Wildcards

from verification.targets import MEASURING, Cases, Studies

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
    assert any(file.endswith("/events") for file in studies.results_of(["spread_stope"]))
    assert not any(file.endswith("/events") for file in files)


def test_a_scene_of_a_measuring_study_has_no_table_of_its_own(studies):
    scene = Wildcards(fromdict={"study": "tradeoff_kirsch"})
    with pytest.raises(SystemExit, match=r"tradeoff_kirsch\.yaml: its rows stand in results/tradeoff/table\.csv"):
        studies.answer_sources(scene)


def test_long_studies_are_run_by_their_own_names_alone(studies):
    """All others are verified, each with its table."""
    every, verified = set(studies.named("")), studies.verified()
    assert {"brazilian_platens", "schemes_demo"} <= every - set(verified)
    assert studies.tables(JAEGER) == [f"results/verification/{name}/table.csv" for name in verified]
    assert studies.named("tradeoff_")[0] == "tradeoff_brittle"


def test_every_measuring_study_has_cases(studies):
    """Random mines of `extremes` are cases of stability: what both targets ask for runs once."""
    cases = Cases(studies)
    files = {target: cases.files(target) for target in MEASURING}
    assert all(len(found) == len(set(found)) > 0 for found in files.values())
    assert set(files["stability"]) & set(files["extremes"])
    scene = Wildcards(fromdict={"target": "catalog_spread", "case": "spread_stope"})
    assert cases.inputs(scene) == [*studies.results_of(["spread_stope"]), studies.file("spread_stope")]
    assert (cases.threads(scene), cases.options(scene)) == (1, "")
    absent = Wildcards(fromdict={"target": "benchmarks", "case": "elastic-moose-4"})
    with pytest.raises(SystemExit, match=r"config/benchmarks\.yaml: asks for no case elastic-moose-4; there are "):
        cases.inputs(absent)
