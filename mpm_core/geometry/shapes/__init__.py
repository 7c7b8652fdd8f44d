"""Shapes of solids. Each is one class here and one entry of SHAPES; all other code calls the shape (shape.py).

Curved surfaces are cut into enough facets that the plain inscribed ones would lose less than 0.1 % of the volume, and
moved outward until the volume is exact. trimesh and ezdxf are imported where a shape needs them: see solid_files.py.
"""

from collections.abc import Mapping

from common.errors import InputError
from mpm_core.geometry.shapes.prism import Prism
from mpm_core.geometry.shapes.shape import Shape, ShapeError
from mpm_core.geometry.shapes.simple import Box, Circle, Cylinder, Polygon, Sphere
from mpm_core.geometry.shapes.tunnel import Tunnel
from mpm_core.geometry.solids import Solid

SHAPES: dict[int, dict[str, type[Shape]]] = {  # by dimension and name
    3: {"box": Box, "tunnel": Tunnel, "cylinder": Cylinder, "sphere": Sphere, "prism": Prism},
    2: {"box": Box, "circle": Circle, "sphere": Circle, "cylinder": Circle, "polygon": Polygon},
}


def shape_model(name: str | None, dimension: int, where: str) -> type[Shape]:
    """The shape of this name. Raises InputError if the dimension has none."""
    shapes = SHAPES[dimension]
    if name not in shapes:
        raise InputError(f"{where}.shape: {name!r} is not one of the {dimension}-D shapes {', '.join(shapes)}")
    return shapes[name]


def shape_of(specification: Mapping, dimension: int, where: str) -> Shape:
    """The shape of a solid's keys (`shape` and its own, SI; others are ignored), checked.

    Raises InputError, a line for each mistake, that names the key in `where`.
    """
    model = shape_model(specification.get("shape"), dimension, where)
    shape = model.of({key: specification[key] for key in model.model_fields if key in specification}, where)
    return checked(shape, dimension, where)


def checked(shape: Shape, dimension: int, where: str) -> Shape:
    """The shape. Raises InputError as `shape_of`."""
    try:
        shape.check(dimension)
    except ShapeError as error:
        raise InputError(f"{where}{'.' * bool(error.key)}{error.key}: {error.problem}") from error
    return shape


def solid_of(shape: Shape, dimension: int, name: str) -> Solid:
    """The solid of a shape that has been checked. Raises InputError for one without volume."""
    try:
        solid = Solid(name, *shape.surface(dimension))
    except ShapeError as error:
        raise InputError(f"{name}.{error.key}: {error.problem}") from error
    if solid.volume == 0:
        raise InputError(f"{name}: encloses no volume: check its coordinates")
    return solid if solid.signed_volume > 0 else Solid(name, solid.vertices, solid.facets[:, ::-1])


def build_shape(specification: Mapping, dimension: int) -> Solid:
    """Solid of one excavation, rock body or load from its `name`, `shape` and the shape's own keys (SI).

    Raises InputError that begins with the name and names the key.
    """
    name = specification.get("name", "excavation")
    return solid_of(shape_of(specification, dimension, name), dimension, name)
