"""Block models of CSV files and OMF projects, as planning packages write them, and damaged ones."""

import gzip
import io
import json
import zipfile

import numpy as np
import omf
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from common.errors import InputError
from common.mine_grid import SAME_AS_MAP, GridMap
from mpm_core.block_settings import PlacedBlocks
from mpm_core.geometry.block_files import read_block_csv
from mpm_core.geometry.omf_blocks import read_block_omf
from mpm_core.scene.rock_blocks import read_blocks

SIDE = np.array([10.0, 5.0, 2.5])
INDEX = np.stack(np.meshgrid(range(4), range(3), range(2), indexing="ij"), axis=-1).reshape(-1, 3)
MIDDLE = np.array([1000.0, 2000.0, -50.0]) + (INDEX + 0.5) * SIDE
ROCK = np.where(INDEX[:, 0] < 2, "ORE", "WASTE")
ROWS = [(*place, *SIDE, rock) for place, rock in zip(MIDDLE, ROCK, strict=True)]


def write(path, header: str, rows=ROWS, separator=",", comma=False, end="\n"):
    """A table of these rows."""

    def cell(value) -> str:
        text = f"{value:.4f}" if isinstance(value, float) else str(value)
        return text.replace(".", ",") if comma and isinstance(value, float) else text

    path.write_text(end.join([header, *(separator.join(map(cell, row)) for row in rows)]) + end, encoding="utf-8")
    return path


def read(path, named=None, size=None, turn=SAME_AS_MAP, unit=1.0, wanted=("ROCK",)):
    return read_block_csv(path, named or {}, size, turn, unit, list(wanted))


def check(table, rock="ROCK", unit=1.0):
    """It holds the blocks that all these files have, in their order."""
    assert np.allclose(table.blocks.lower, unit * (MIDDLE - 0.5 * SIDE), atol=1e-4)
    assert np.allclose(table.blocks.upper, unit * (MIDDLE + 0.5 * SIDE), atol=1e-4)
    assert table.columns[rock].tolist() == ROCK.tolist()


@pytest.mark.parametrize(
    "header",
    [
        "XC,YC,ZC,XINC,YINC,ZINC,ROCK",
        "x,y,z,dx,dy,dz,ROCK",
        "EAST,NORTH,RL,_EAST,_NORTH,_RL,ROCK",
        "\ufeffcentroid_x,centroid_y,centroid_z,dim_x,dim_y,dim_z,ROCK",
        "Block model of the mine\n# exported\n\nX , Y , Z , dX , dY , dZ , ROCK",
        "centroid_x,centroid_y,centroid_z,dim_x,dim_y,dim_z,ROCK\n"
        "Variable descriptions:,Y,Z,,,,rock\nVariable types:,double,double,double,double,double,name\n"
        "Variable defaults:,,,,,,",
    ],
)
def test_the_headers_of_planning_packages(tmp_path, header):
    check(read(write(tmp_path / "blocks.csv", header)))


def test_separators_decimal_commas_and_ends_of_lines(tmp_path):
    header = "XC;YC;ZC;XINC;YINC;ZINC;ROCK"
    check(read(write(tmp_path / "blocks.csv", header, separator=";", comma=True, end="\r\n")))
    check(read(write(tmp_path / "blocks.txt", header.replace(";", "\t"), separator="\t")))


def test_a_decimal_comma_is_found_in_any_column_and_row(tmp_path):
    """Centroids are often whole numbers; properties were then lost, or the file was refused."""
    header = "XC;YC;ZC;XINC;YINC;ZINC;E;ROCK"
    lines = [
        header,
        "1005;2005;105;10;10;10;27;a,b",
        "1015;2005;105;10;10;10;27,5;1,2,3",
        "1025;2005;105;10;10;10;30;c",
    ]
    (tmp_path / "blocks.csv").write_text("\n".join(lines))
    table = read(tmp_path / "blocks.csv", wanted=("E", "ROCK"))
    assert table.columns["E"].tolist() == [27.0, 27.5, 30.0]
    assert table.columns["ROCK"].tolist() == ["a,b", "1,2,3", "c"]
    (tmp_path / "blocks.csv").write_text("\n".join([*lines[:2], lines[2].replace("1015;", "1012,5;")]))
    assert read(tmp_path / "blocks.csv").blocks.lower[:, 0].tolist() == [1000.0, 1007.5]
    (tmp_path / "blocks.csv").write_text(
        "\n".join([*lines, "1035.5;2005;105;10;10;10;30;c", "1045,5;2005;105;10;10;10;30;c"])
    )
    with pytest.raises(InputError, match="column 'XC' has numbers with a comma, column 'XC' with a point"):
        read(tmp_path / "blocks.csv")
    thousands = ["XC;YC;ZC;XINC;YINC;ZINC;E", "1005.5;2005;105;10;10;10;35,000", "1015.5;2005;105;10;10;10;36,000"]
    (tmp_path / "blocks.csv").write_text("\n".join(thousands))
    with pytest.raises(InputError, match="column 'E' has numbers with a comma, column 'XC' with a point"):
        read(tmp_path / "blocks.csv", wanted=("E",))


def test_columns_by_name_and_other_columns_beside_them(tmp_path):
    header = "id,Mitte X,Mitte Y,Mitte Z,bx,by,bz,ROCK,,id"
    path = write(tmp_path / "blocks.csv", header, [(n, *row, "", n) for n, row in enumerate(ROWS)])
    named = dict(zip(("x", "y", "z", "dx", "dy", "dz"), header.split(",")[1:7], strict=True))
    check(read(path, named))


def test_sides_of_all_blocks_by_key(tmp_path):
    path = write(tmp_path / "blocks.csv", "XC,YC,ZC,ROCK", [(*row[:3], row[6]) for row in ROWS])
    check(read(path, size=tuple(SIDE)))
    with pytest.raises(InputError, match=r"no sides of its blocks.*block_model\.size"):
        read(path)


def test_feet(tmp_path):
    check(read(write(tmp_path / "blocks.csv", "XC,YC,ZC,XINC,YINC,ZINC,ROCK"), unit=0.3048), unit=0.3048)


def test_turned_blocks(tmp_path):
    """A row of blocks along N 30 E: y of the blocks is 30 degrees clockwise from y of the file."""
    direction = np.array([np.sin(np.radians(30.0)), np.cos(np.radians(30.0)), 0.0])
    middle = np.array([500.0, 800.0, 0.0]) + 10.0 * np.arange(5)[:, None] * direction
    path = write(tmp_path / "blocks.csv", "x,y,z,dx,dy,dz", [(*row, 4.0, 10.0, 6.0) for row in middle])
    blocks = read(path, turn=GridMap(angle=30.0), wanted=()).blocks
    across = np.array([direction[1], -direction[0], 0.0])
    for reach, holds in ((1.9, True), (2.1, False)):
        for side in (-1, 1):
            found = blocks.at(middle + side * reach * across)
            assert np.array_equal(found, np.arange(5) if holds else np.full(5, -1))
    along = middle[0] + np.linspace(-4.9, 44.9, 50)[:, None] * direction
    assert np.array_equal(blocks.at(along), np.floor((np.linspace(-4.9, 44.9, 50) + 5.0) / 10.0))


@pytest.mark.parametrize(
    ("header", "change", "words"),
    [
        ("XC,YC,ZC,XINC,YINC,ZINC,LITHO", {}, "no column 'ROCK'.*LITHO"),
        ("XC,YC,depth,XINC,YINC,ZINC,ROCK", {}, "no column of z"),
        ("XC,YC,ZC,XINC,YINC,h,ROCK", {}, "columns of dx, dy sides"),
        ("a,b,c,d,e,f,g", {}, "no line with the names"),
        ("XC,YC,ZC,XINC,YINC,ZINC,ROCK", {(3, 2): "??"}, "column 'ZC': block 4 of 24 has '\\?\\?' \\(1 such\\)"),
        ("XC,YC,ZC,XINC,YINC,ZINC,ROCK", {(3, 4): 0.0}, "block 4 has a side of 0"),
        ("XC,ROCK,ZC,XINC,YINC,ZINC,ROCK", {}, "no column of y"),
        ("XC,YC,ZC,XINC,YINC,ZINC,XC,ROCK", {}, "2 columns 'XC'"),
    ],
)  # fmt: skip
def test_what_is_wrong_in_a_table(tmp_path, header, change, words):
    rows = [list(row) for row in ROWS]
    for (row, column), value in change.items():
        rows[row][column] = value
    path = write(tmp_path / "blocks.csv", header, rows)
    with pytest.raises(InputError, match=words) as refused:
        read(path)
    assert "\n" not in str(refused.value)


def test_what_is_no_table_is_one_line(tmp_path):
    (tmp_path / "blocks.csv").write_text('{"blocks": [' + "1 2 3 " * 40_000 + "]}")
    with pytest.raises(InputError, match="has no line with the names of columns"):
        read(tmp_path / "blocks.csv")


def test_a_table_without_a_block(tmp_path):
    with pytest.raises(InputError, match="no block below its header"):
        read(write(tmp_path / "blocks.csv", "XC,YC,ZC,XINC,YINC,ZINC,ROCK", []))


def test_omf_1_counts_as_it_is_told(tmp_path):
    shape = (4, 3, 2)
    values = np.arange(24.0).reshape(shape)  # by u, v, w
    for first, order in (("w", "C"), ("u", "F")):
        path = tmp_path / f"{first}.omf"
        names = omf.Legend(name="rock", values=omf.StringArray(["ORE", "WASTE"]))
        volume = omf.VolumeElement(
            name="model",
            geometry=omf.VolumeGridGeometry(
                tensor_u=np.full(4, 10.0), tensor_v=np.full(3, 5.0), tensor_w=np.full(2, 2.5),
                axis_u=[0.0, 1.0, 0.0], axis_v=[-1.0, 0.0, 0.0], axis_w=[0.0, 0.0, 1.0], origin=[100.0, 0.0, -5.0],
            ),
            data=[
                omf.ScalarData(name="number", location="cells", array=values.ravel(order)),
                omf.MappedData(
                    name="ROCK", location="cells", legends=[names],
                    array=omf.ScalarArray((values.ravel(order) > 11).astype(int)),
                ),
            ],
        )  # fmt: skip
        project = omf.Project(name="p", elements=[volume], origin=[0.0, 1000.0, 0.0], units="m")
        omf.OMFWriter(project, str(path))
        table = read_block_omf(path, None, first, None, ["number", "ROCK"])
        middle = np.array([100.0 - 12.5, 1000.0 + 5.0, -5.0 + 1.25])  # u = 0, v = 2, w = 0
        block = table.blocks.at(middle[None])[0]
        assert table.columns["number"][block] == values[0, 2, 0]
        assert table.columns["ROCK"][block] == "ORE"
        with pytest.raises(InputError, match="counted_first"):
            read_block_omf(path, None, None, None, [])
        with pytest.raises(InputError, match="no data 'grade' on its blocks: it has number, ROCK"):
            read_block_omf(path, None, first, None, ["grade"])


def write_omf_2(path, geometry: dict, attributes: dict, arrays: dict, **project):
    """An OMF 2 project of one block model. arrays: columns of the Parquet file by its name."""
    element = {"name": "model", "geometry": {"type": "BlockModel", **geometry}, "attributes": attributes}
    index = {"date": "2024-01-01T00:00:00Z", "units": "metres", "elements": [element], **project}
    with zipfile.ZipFile(path, "w") as archive:
        for name, columns in arrays.items():
            buffer = io.BytesIO()
            pq.write_table(pa.table(columns), buffer)
            archive.writestr(name, buffer.getvalue())
        archive.writestr("index.json.gz", gzip.compress(json.dumps(index).encode()))
        archive.comment = b"Open Mining Format 2.0"


def test_omf_without_a_unit_has_that_of_the_mines_grid(tmp_path):
    """As solids have. A stated one counts more."""
    geometry = {"orient": {"origin": [100.0, 0.0, 0.0]}, "grid": {"type": "Regular", "size": [1] * 3, "count": [1] * 3}}
    for units, metres in (("", 0.3048), ("metres", 1.0)):
        write_omf_2(tmp_path / "a.omf", geometry, [], {}, units=units)
        model = {"file": str(tmp_path / "a.omf"), "material": "host", "grid": {"units": "ft"}}
        assert read_blocks(PlacedBlocks.of(model, "block_model")).blocks.origin[0] == 100.0 * metres


def test_of_several_block_models_one_is_named(tmp_path):
    """It told of a key that is none, and "*" gave the first of them."""
    geometry = {"orient": {"origin": [0.0] * 3}, "grid": {"type": "Regular", "size": [1] * 3, "count": [1] * 3}}
    models = [
        {"name": name, "geometry": {"type": "BlockModel", **geometry}, "attributes": []} for name in ("a", "b", "b")
    ]
    write_omf_2(tmp_path / "m.omf", geometry, [], {}, elements=models)
    for element in (None, "*"):
        with pytest.raises(InputError, match=r"has 3 block models: name one by block_model.element: a, b"):
            read_block_omf(tmp_path / "m.omf", element, None, None, [])
    with pytest.raises(InputError, match="has 2 block models called 'b': rename them"):
        read_block_omf(tmp_path / "m.omf", "b", None, None, [])
    assert len(read_block_omf(tmp_path / "m.omf", "a", None, None, []).blocks.lower) == 1
    with pytest.raises(InputError, match=r"block_model.element 'c' is not one of a, b"):
        read_block_omf(tmp_path / "m.omf", "c", None, None, [])


def place(name: str, count: int) -> dict:
    return {"filename": name, "item_count": count}


def category(location: str, count: int) -> list[dict]:
    values = {"type": "Category", "values": place("index", count), "names": place("names", 2)}
    return [{"name": "ROCK", "location": location, "data": values}]


def test_omf_2_regular_grid_counts_u_first(tmp_path):
    geometry = {
        "orient": {"origin": [100.0, 0.0, 0.0]}, "grid": {"type": "Regular", "size": [10, 5, 2.5], "count": [4, 3, 2]}
    }  # fmt: skip
    index = [0] * 23 + [None]
    write_omf_2(
        tmp_path / "a.omf",
        geometry,
        category("Primitives", 24),
        {"index": {"index": pa.array(index, pa.uint32())}, "names": {"name": ["ORE", "WASTE"]}},
        origin=[0.0, 1000.0, 0.0],
    )
    table = read_block_omf(tmp_path / "a.omf", "model", None, None, ["ROCK"])
    assert table.columns["ROCK"].tolist() == ["ORE"] * 23 + [""]
    assert read_block_omf(tmp_path / "a.omf", None, None, 0.3048, []).blocks.origin[0] == 30.48
    points = np.array([[101.0, 1001.0, 1.0], [111.0, 1001.0, 1.0], [101.0, 1006.0, 1.0], [101.0, 1001.0, 3.0]])
    assert table.blocks.at(points).tolist() == [0, 1, 4, 12]


@pytest.mark.parametrize("kind", ["Regular", "Freeform"])
def test_omf_2_sub_blocks(tmp_path, kind):
    """Two parents; the second is cut in two along w, at a quarter of its height."""
    ends = [[0, 0, 0, 1, 1, 1], [0, 0, 0, 1, 1, 0.25], [0, 0, 0.25, 1, 1, 1]]
    scale = np.array([4, 4, 4]) if kind == "Regular" else np.ones(3)
    corners = np.array(ends) * np.tile(scale, 2)
    number = pa.uint32() if kind == "Regular" else pa.float64()
    columns = {f"parent_{axis}": pa.array([0, 1, 1] if axis == "u" else [0, 0, 0], pa.uint32()) for axis in "uvw"}
    for part, first in (("corner_min", 0), ("corner_max", 3)):
        for offset, axis in enumerate("uvw"):
            values = corners[:, first + offset]
            columns[f"{part}_{axis}"] = pa.array(values.astype(int) if kind == "Regular" else values, number)
    subblocks = {"type": kind, "subblocks": place("sub", 3), **({"count": [4, 4, 4]} if kind == "Regular" else {})}
    geometry = {"orient": {"origin": [0, 0, 0]}, "grid": {"type": "Tensor", **{a: place(a, n) for a, n in
                zip("uvw", (2, 1, 1), strict=True)}}, "subblocks": subblocks}  # fmt: skip
    arrays = {"u": {"scalar": [10.0, 20.0]}, "v": {"scalar": [8.0]}, "w": {"scalar": [4.0]}, "sub": columns}
    arrays |= {"index": {"index": pa.array([0, 1, 0], pa.uint32())}, "names": {"name": ["ORE", "WASTE"]}}
    write_omf_2(tmp_path / "a.omf", geometry, category("Subblocks", 3), arrays)
    table = read_block_omf(tmp_path / "a.omf", None, None, None, ["ROCK"])
    points = np.array([[5.0, 4.0, 3.0], [25.0, 4.0, 0.9], [25.0, 4.0, 1.1], [25.0, 4.0, 4.1]])
    assert table.blocks.at(points).tolist() == [0, 1, 2, -1]
    assert table.columns["ROCK"].tolist() == ["ORE", "WASTE", "ORE"]
