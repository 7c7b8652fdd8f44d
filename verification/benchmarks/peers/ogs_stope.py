"""The block with a stope in OpenGeoSys 6 (Python wheel): small deformation, hexahedra with 2 x 2 x 2 Gauss points.

Elastic: the block stands without its stope under the in-situ stress and moves to rest in one step. Coulomb: MFront's
MohrCoulombAbboSloan; the forces that held the walls up are removed in equal increments. Newton's method in both, until
the 2-norm of the residual is at most the tolerance times that of the released force (OpenGeoSys solves once more after
the iteration that brought it there). Eigen's conjugate gradients, for the unsymmetric matrices of non-associated flow
BiCGSTAB, with a diagonal preconditioner, which is much faster here than its ILUT.

Run by benchmarks/measuring.py in an environment with ogs.txt; takes the file of a case, prints JSON. Seconds, memory
and processor time are those of the process `ogs`, from reading the mesh to the written result.
"""

import os
import re
import resource
import subprocess
import sys
import tempfile
import time
import xml.etree.ElementTree as ET
from importlib.metadata import version
from pathlib import Path

import meshio
import numpy as np
from stope import LINEAR_TOLERANCE_SHARE, Block, announce, end_with_parent, peak_memory, read_case

# Abbo and Sloan (1995) round the corners of Coulomb's pyramid: Lode angle from which, deg, and the tip's rounding, Pa
TRANSITION_ANGLE, TIP_ROUNDING = 29.0, 1e4
NEWTON_ITERATIONS, LINEAR_ITERATIONS = 50, 10000


def add(parent: ET.Element, content: dict) -> None:
    """Put nested values into an element: a list repeats its tag, a key "@name" is an attribute."""
    for tag, value in content.items():
        for entry in value if isinstance(value, list) else [value]:
            if tag.startswith("@"):
                parent.set(tag[1:], str(entry))
            elif isinstance(entry, dict):
                add(ET.SubElement(parent, tag), entry)
            else:
                ET.SubElement(parent, tag).text = str(entry)


def constant(name: str, *values: float) -> dict:
    """A parameter of the project file."""
    return {"name": name, "type": "Constant", "values": " ".join(str(value) for value in values)}


def write_mesh(path: Path, points: np.ndarray, kind: str, cells: np.ndarray, **data) -> None:
    """A mesh of one kind of cell; data of nodes and cells as OpenGeoSys names them."""
    nodes = {name: values for name, values in data.items() if name == "bulk_node_ids"}
    others = {name: [values] for name, values in data.items() if name != "bulk_node_ids"}
    mesh = meshio.Mesh(points, [(kind, cells)], point_data=nodes, cell_data=others)
    meshio.write(path, mesh, file_format="vtu", binary=True, compression=None)


def write_meshes(block: Block, folder: Path, with_walls: bool) -> dict[str, tuple[int, float]]:
    """Mesh files of rock and held faces; with walls also theirs: axis and traction (Pa) by name of the mesh."""
    position = block.position
    write_mesh(
        folder / "rock.vtu", position, "hexahedron", block.hexahedra, MaterialIDs=np.zeros(len(block.cells), np.int32)
    )
    outer = block.outer
    vertices = np.arange(len(outer))[:, None]
    write_mesh(folder / "outer.vtu", position[outer], "vertex", vertices, bulk_node_ids=outer.astype(np.uint64))
    walls = {}
    for wall in block.walls() if with_walls else ():
        name = f"wall_{'xyz'[wall.axis]}{wall.side}"
        nodes, faces = np.unique(wall.faces, return_inverse=True)
        write_mesh(
            folder / f"{name}.vtu",
            position[nodes],
            "quad",
            faces.reshape(wall.faces.shape),
            bulk_node_ids=nodes.astype(np.uint64),
            bulk_element_ids=wall.rock.astype(np.uint64),
        )
        walls[name] = wall.axis, wall.traction
    return walls


def material(case: dict) -> tuple[dict, list[dict]]:
    """The constitutive relation and its parameters."""
    elastic = [constant("E", case["youngs_modulus"]), constant("nu", case["poisson_ratio"])]
    if "cohesion" not in case:
        return {"type": "LinearElasticIsotropic", "youngs_modulus": "E", "poissons_ratio": "nu"}, elastic
    names = {
        "YoungModulus": "E",
        "PoissonRatio": "nu",
        "Cohesion": "c",
        "FrictionAngle": "phi",
        "DilatancyAngle": "psi",
        "TransitionAngle": "lode",
        "TensionCutOffParameter": "tip",
    }
    given = [{"@name": name, "@parameter": parameter} for name, parameter in names.items()]
    strength = [
        constant("c", case["cohesion"]),
        constant("phi", case["friction_angle"]),
        constant("psi", case["dilation_angle"]),
        constant("lode", TRANSITION_ANGLE),
        constant("tip", TIP_ROUNDING),
    ]
    relation = {"type": "MFront", "behaviour": "MohrCoulombAbboSloan"}
    return relation | {"material_properties": {"material_property": given}}, elastic + strength


def project(block: Block, walls: dict[str, tuple[int, float]]) -> ET.Element:
    """The project file."""
    case = block.case
    relation, parameters = material(case)
    increments = case.get("increments", 1)
    conditions = [{"mesh": "outer", "type": "Dirichlet", "component": axis, "parameter": "zero"} for axis in range(3)]
    for name, (axis, traction) in walls.items():
        ramped = {"name": f"t_{name}", "type": "CurveScaled", "curve": "support", "parameter": f"p_{name}"}
        parameters += [constant(f"p_{name}", traction), ramped]
        conditions.append({"mesh": name, "type": "Neumann", "component": axis, "parameter": f"t_{name}"})
    parameters += [
        constant("zero", 0.0),
        constant("virgin_displacement", 0.0, 0.0, 0.0),
        constant("virgin_stress", *case["stress"], 0.0, 0.0, 0.0),
        constant("T_ref", 293.15),  # MFront asks for a temperature
    ]
    density = {"name": "density", "type": "Constant", "value": 2850}  # without weight: of no effect
    process = {
        "name": "rock",
        "type": "SMALL_DEFORMATION",
        "integration_order": 2,
        "constitutive_relation": relation,
        "initial_stress": "virgin_stress",
        "process_variables": {"process_variable": "displacement"},
        "specific_body_force": "0 0 0",
    }
    once_at_the_end = {"pair": {"repeat": 1, "each_steps": increments}}
    root = ET.Element("OpenGeoSysProject")
    add(
        root,
        {
            "meshes": {"mesh": ["rock.vtu", "outer.vtu", *(f"{name}.vtu" for name in walls)]},
            "processes": {"process": process},
            "media": {
                "medium": {"@id": 0, "phases": {"phase": {"type": "Solid", "properties": {"property": density}}}}
            },
            "time_loop": {
                "processes": {
                    "process": {
                        "@ref": "rock",
                        "nonlinear_solver": "newton",
                        "convergence_criterion": {
                            "type": "Residual",
                            "norm_type": "NORM2",
                            "abstol": case["tolerance"] * block.released,
                        },
                        "time_discretization": {"type": "BackwardEuler"},
                        "time_stepping": {
                            "type": "FixedTimeStepping",
                            "t_initial": 0,
                            "t_end": 1,
                            "timesteps": {"pair": {"repeat": increments, "delta_t": 1 / increments}},
                        },
                    }
                },
                "output": {
                    "type": "VTK",
                    "prefix": "result",
                    "timesteps": once_at_the_end,
                    "variables": {"variable": "displacement"},
                },
            },
            "parameters": {"parameter": parameters},
            "curves": {"curve": {"name": "support", "coords": "0 1", "values": "1 0"}},
            "process_variables": {
                "process_variable": {
                    "name": "displacement",
                    "components": 3,
                    "order": 1,
                    "initial_condition": "virgin_displacement",
                    "boundary_conditions": {"boundary_condition": conditions},
                }
            },
            "nonlinear_solvers": {
                "nonlinear_solver": {
                    "name": "newton",
                    "type": "Newton",
                    "max_iter": NEWTON_ITERATIONS,
                    "linear_solver": "linear",
                }
            },
            "linear_solvers": {
                "linear_solver": {
                    "name": "linear",
                    "eigen": {
                        "solver_type": "BiCGSTAB" if "cohesion" in case else "CG",
                        "precon_type": "DIAGONAL",
                        "triangular_matrix": "LowerUpper",  # both triangles: the product then takes all threads
                        "max_iteration_step": LINEAR_ITERATIONS,
                        "error_tolerance": LINEAR_TOLERANCE_SHARE * case["tolerance"],
                    },
                }
            },
        },
    )
    return root


def main() -> None:
    case = read_case(sys.argv[1])
    block = Block(case)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        walls = write_meshes(block, folder, with_walls="cohesion" in case)
        ET.ElementTree(project(block, walls)).write(folder / "stope.prj", xml_declaration=True, encoding="utf-8")
        threads = str(case["threads"])
        environment = os.environ | {"OMP_NUM_THREADS": threads, "OGS_ASM_THREADS": threads}
        command = [str(Path(sys.executable).with_name("ogs")), "stope.prj", "-o", "."]
        announce(begins=True)
        start = time.perf_counter()
        run = subprocess.run(
            command, cwd=folder, env=environment, capture_output=True, text=True, preexec_fn=end_with_parent
        )
        seconds = time.perf_counter() - start
        used = resource.getrusage(resource.RUSAGE_CHILDREN)
        results = sorted(folder.glob("result*_t_1.0*.vtu"))
        converged = run.returncode == 0 and bool(results)
        moved = meshio.read(results[-1]).point_data["displacement"] if converged else None
    talk = run.stdout + run.stderr
    errors = re.findall(r"(?:error|critical): (.*)", talk)
    announce(
        converged=converged,
        reason="" if converged else (errors[0] if errors else f"exit status {run.returncode}"),
        seconds=seconds,
        cpu_seconds=used.ru_utime + used.ru_stime,
        memory=peak_memory(resource.RUSAGE_CHILDREN),
        iterations=len(re.findall(r"Iteration #\d+ took", talk)),
        closure=block.closure(moved) if converged else None,
        version=f"OpenGeoSys {version('ogs')}",
    )


if __name__ == "__main__":
    main()
