"""A process of FEniCSx that solves its share of the block with a stope. fenicsx_stope.py starts one for each thread."""

import sys
import time

import dolfinx
import numpy as np
import ufl
from dolfinx import fem
from dolfinx.mesh import Mesh, create_mesh
from mpi4py import MPI
from petsc4py import PETSc
from stope import LINEAR_TOLERANCE_SHARE, Block, announce, end_with_parent, peak_memory, read_case

LINEAR_ITERATIONS = 1000
TENSOR_ORDER = [0, 1, 3, 2, 4, 5, 7, 6]  # Corners of a hexahedron in dolfinx, by their number in VTK.
WORLD = MPI.COMM_WORLD


def distribute(block: Block) -> Mesh:
    """The mesh, shared out over the processes. The first one reads it."""
    element = ufl.Mesh(ufl.VectorElement("Lagrange", ufl.hexahedron, 1))
    here = WORLD.rank == 0
    cells = block.hexahedra[:, TENSOR_ORDER] if here else np.empty((0, 8), np.int64)
    return create_mesh(WORLD, cells, block.position if here else np.empty((0, 3)), element)


def rigid_motions(space: fem.FunctionSpace) -> PETSc.NullSpace:
    """Three translations and three rotations about the block's centre, orthonormal."""
    functions = [fem.Function(space) for _ in range(6)]

    def turning(place: np.ndarray, axis: int) -> np.ndarray:
        first, second = (axis + 1) % 3, (axis + 2) % 3
        turned = np.zeros_like(place)
        turned[first], turned[second] = -place[second], place[first]
        return turned

    for axis in range(3):
        functions[axis].interpolate(lambda place, axis=axis: np.eye(3)[axis][:, None] * np.ones_like(place))
        functions[3 + axis].interpolate(lambda place, axis=axis: turning(place, axis))
    vectors = [function.vector.copy() for function in functions]  # A function takes its memory with it.
    for number, vector in enumerate(vectors):
        for earlier in vectors[:number]:
            vector.axpy(-vector.dot(earlier), earlier)
        vector.normalize()
    return PETSc.NullSpace().create(vectors=vectors, comm=WORLD)


def equations(case: dict, mesh: Mesh) -> tuple[fem.FunctionSpace, PETSc.Mat, PETSc.Vec]:
    """Displacements, stiffness (N/m) and released force (N) of a mesh whose outer faces are held."""
    space = fem.VectorFunctionSpace(mesh, ("Lagrange", 1))
    upper = np.array(case["cells"]) * case["cell"]

    def on_outer_face(place: np.ndarray) -> np.ndarray:
        return np.any(np.isclose(place, 0.0) | np.isclose(place, upper[:, None]), axis=0)

    held = fem.dirichletbc(np.zeros(3), fem.locate_dofs_geometrical(space, on_outer_face), space)
    young, poisson = case["youngs_modulus"], case["poisson_ratio"]
    shear, lame = young / (2.0 + 2.0 * poisson), young * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson))
    moved, virtual = ufl.TrialFunction(space), ufl.TestFunction(space)
    strain = ufl.sym(ufl.grad(moved))
    stress = 2.0 * shear * strain + lame * ufl.tr(strain) * ufl.Identity(3)
    virgin = ufl.as_matrix(np.diag(case["stress"]).tolist())
    volume = ufl.dx(metadata={"quadrature_degree": 2})  # Two Gauss points along each edge.
    stiffness = fem.form(ufl.inner(stress, ufl.grad(virtual)) * volume)
    force = fem.form(-ufl.inner(virgin, ufl.grad(virtual)) * volume)

    matrix = fem.petsc.assemble_matrix(stiffness, bcs=[held])
    matrix.assemble()
    right = fem.petsc.assemble_vector(force)
    right.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
    fem.petsc.set_bc(right, [held])
    return space, matrix, right


def solve(case: dict, mesh: Mesh) -> tuple[fem.Function, PETSc.KSP]:
    """Displacement (m), and the linear solver after its work."""
    space, matrix, right = equations(case, mesh)
    matrix.setNearNullSpace(rigid_motions(space))
    solver = PETSc.KSP().create(WORLD)
    solver.setOperators(matrix)
    solver.setType("cg")
    solver.setNormType(PETSc.KSP.NormType.UNPRECONDITIONED)
    solver.getPC().setType("gamg")
    solver.setTolerances(rtol=LINEAR_TOLERANCE_SHARE * case["tolerance"], max_it=LINEAR_ITERATIONS)
    solver.setFromOptions()  # Without it GAMG leaves out its aggressive first coarsening.
    found = fem.Function(space)
    solver.solve(right, found.vector)
    return found, solver


def closure(block: Block | None, case: dict, found: fem.Function) -> float | None:
    """Closure (m) by the first process, to which all others send their nodes' places and displacements."""
    space = found.function_space
    own = space.dofmap.index_map.size_local
    place = np.rint(space.tabulate_dof_coordinates()[:own] / case["cell"]).astype(np.int64)
    gathered = WORLD.gather((place, found.x.array[: 3 * own].reshape(-1, 3)))
    if block is None or gathered is None:
        return None
    places, displacements = (np.concatenate(parts) for parts in zip(*gathered, strict=True))
    order, expected = np.lexsort(places.T[::-1]), np.lexsort(block.nodes.T[::-1])
    displacement = np.empty_like(displacements)
    displacement[expected] = displacements[order]
    return block.closure(displacement)


def main() -> None:
    end_with_parent()
    case = read_case(sys.argv[1])
    if "cohesion" in case:
        sys.exit("FEniCSx has no Coulomb law")
    # Forms are compiled here; later ones are read from disk.
    few = Block(case | {"cells": [4, 4, 4], "stope_lower": [1, 1, 1], "stope_upper": [3, 3, 3]})
    equations(few.case, distribute(few))
    block = Block(case) if WORLD.rank == 0 else None
    mesh = distribute(Block(case) if block is None else block)
    WORLD.barrier()
    if block is not None:
        announce(begins=True)
    start, processor = time.perf_counter(), time.process_time()
    found, solver = solve(case, mesh)
    WORLD.barrier()
    seconds = time.perf_counter() - start
    processor = WORLD.allreduce(time.process_time() - processor)
    memory = WORLD.allreduce(peak_memory())
    converged = solver.getConvergedReason() > 0
    closed = closure(block, case, found)
    if block is not None:
        announce(
            converged=converged,
            reason="" if converged else f"PETSc's reason {solver.getConvergedReason()}",
            seconds=seconds,
            cpu_seconds=processor,
            memory=memory,
            iterations=solver.getIterationNumber(),
            closure=closed if converged else None,
            version=f"FEniCSx {dolfinx.__version__}, PETSc {'.'.join(map(str, PETSc.Sys.getVersion()))}",
        )


if __name__ == "__main__":
    main()
