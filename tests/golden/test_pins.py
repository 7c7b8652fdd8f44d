"""Pins of results and their comparison: what changes a pin, and how a difference is told."""

import numpy as np
import pytest
import xarray as xr
from golden_files import differences
from pins import lines_of_page, pins_of

STRESS = np.array([[-3e7, 0.0], [1e6, np.nan], [2e6, -4e6]])
PAGE = """<html><head><title>t</title></head><body><h1>Mine</h1><p>It has <b>3</b>
events.</p><h2>4 Sizes</h2><table><tr><th>step</th><th>b</th></tr><tr><td>2019-08</td><td>1.20</td></tr></table>
<figure><img src="data:x"><figcaption>Sizes</figcaption></figure><script>1</script><h2>5 Resources</h2><p>2 s</p>
</body></html>"""


def pinned(folder, stress=STRESS, dims=("particle", "voigt"), **attributes):
    """Pins of a folder with one dataset."""
    folder.mkdir(exist_ok=True)
    step = xr.Dataset({"stress": (dims, stress), "name": ("step", np.array(["a", "b"]))}, attrs=attributes)
    step.to_netcdf(folder / "elastic.nc")
    return pins_of(folder)[0]


def test_attributes_do_not_count_and_one_bit_does(tmp_path):
    """The last bit of one value is named on the same processor and passes on another one."""
    golden = pinned(tmp_path, made_from="x")
    assert differences(golden, pinned(tmp_path, made_from="y")) == []
    last_bit = STRESS.copy()
    last_bit[2, 1] = np.nextafter(last_bit[2, 1], 0.0)
    found = pinned(tmp_path, last_bit)
    (line,) = differences(golden, found)
    assert line.startswith("elastic.nc: stress: values changed")
    assert differences(golden, found, exact=False) == []


@pytest.mark.parametrize(
    ("values", "line"),
    [
        ({"stress": STRESS.astype("f4")}, "float64 (particle 3, voigt 2) became float32 (particle 3, voigt 2)"),
        ({"dims": ("cell", "voigt")}, "float64 (particle 3, voigt 2) became float64 (cell 3, voigt 2)"),
        ({"stress": STRESS[:2]}, "float64 (particle 3, voigt 2) became float64 (particle 2, voigt 2)"),
        ({"stress": STRESS * [1.0, 1.5]}, "sum of absolute values 37000000 became 39000000"),
        ({"stress": np.nan_to_num(STRESS)}, "finite values 5 became 6"),
    ],
)
@pytest.mark.parametrize("exact", [True, False])
def test_type_dimensions_and_values_are_named(tmp_path, values, line, exact):
    """On any processor."""
    (found,) = differences(pinned(tmp_path), pinned(tmp_path, **values), exact)
    assert found.startswith("elastic.nc: stress: ")
    assert line in found


def test_values_in_another_order_are_named_on_the_same_processor(tmp_path):
    """Their summary is the same."""
    (line,) = differences(pinned(tmp_path), pinned(tmp_path, STRESS[::-1]))
    assert line == "elastic.nc: stress: values changed, but no number of their summary"


def test_files_and_variables_that_go_or_come_are_named(tmp_path):
    """A file that matches no pinned name is listed apart."""
    golden = pinned(tmp_path)
    (tmp_path / "steps").mkdir()
    xr.Dataset({"b": 1.0}).to_netcdf(tmp_path / "steps/history.nc")
    (tmp_path / "table.csv").write_text("a\n1\n")
    found, others = pins_of(tmp_path)
    assert others == ["table.csv"]
    assert differences(golden, found) == ["steps/history.nc: a result that the golden file does not have"]
    assert differences(found, golden) == ["steps/history.nc: no such result any more"]
    found = {"elastic.nc": {"name": golden["elastic.nc"]["name"]}}
    assert differences(golden, found) == ["elastic.nc: stress: no such variable any more"]
    assert differences(found, golden) == ["elastic.nc: stress: a new variable"]


def test_comments_of_tables_do_not_count(tmp_path):
    """They say what a table was made from."""
    table = tmp_path / "catalog.csv"
    pins = []
    for text in ("# made from x\na,b\n1,2\n", "# made from y\na,b\n1,2\n", "# made from y\na,b\n1,3\n"):
        table.write_text(text)
        pins.append(pins_of(tmp_path)[0])
    assert differences(pins[0], pins[1]) == []
    assert differences(pins[0], pins[2]) == ["catalog.csv: text: values changed"]


def test_a_page_is_pinned_by_its_lines():
    """A paragraph or a row with a number each; without figures, scripts and what differs between runs."""
    assert lines_of_page(PAGE) == {"Mine": ["It has 3 events."], "Sizes": ["2019-08 | 1.20"]}


def test_numbers_of_pages_may_differ_on_another_processor():
    """Words may not, and all differences are named on the same one."""
    golden = {"report.html": lines_of_page(PAGE)}
    for after, is_number in (("1.21", True), ("−3·10⁻¹³", True), ("−6e−14", True), ("none", False)):
        found = {"report.html": lines_of_page(PAGE.replace("1.20", after))}
        lines = ["- 2019-08 | 1.20", f"+ 2019-08 | {after}"]
        assert differences(golden, found) == [f"report.html: Sizes: {line}" for line in lines]
        assert (differences(golden, found, exact=False) == []) is is_number


def test_rounding_errors_may_differ_on_another_processor(tmp_path):
    """Of values that are 0 but for these, and not of others."""
    golden, found = pinned(tmp_path, 1e-22 * STRESS), pinned(tmp_path, 2e-22 * STRESS)
    assert len(differences(golden, found)) == 1
    assert differences(golden, found, exact=False) == []
    assert len(differences(golden, pinned(tmp_path, 1e-14 * STRESS), exact=False)) == 1
