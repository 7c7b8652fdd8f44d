"""The block with a stope in Kratos Multiphysics (Python wheels): implicit, hexahedra with 2 x 2 x 2 Gauss points.

Elastic: StructuralMechanicsApplication, small displacements, one linear solution. Coulomb: GeoMechanicsApplication,
whose GeoMohrCoulombLaw3D is Coulomb's pyramid with its corners; the law hands out elastic stiffness only, so
equilibrium is sought by the application's quasi-Newton strategy (L-BFGS), which is faster than its Newton strategy, and
the matrix, which does not change, is built once. The forces that held the walls up are removed in equal increments. Its
elements carry a water pressure, held at zero here. The plasticity of ConstitutiveLawsApplication did not converge on
this block, and MPMApplication's material points step in time. Linear solver: elastic, conjugate gradients with AMGCL;
Coulomb, sparse LU, which the quasi-Newton strategy takes whatever it is told.

Run by benchmarks/measuring.py in an environment with kratos.txt; takes the file of a case, prints JSON. Seconds and
processor time are those of initialisation and solution, once nodes and elements are in memory.
"""

import json
import os
import sys
import tempfile
import time
from importlib.metadata import version

import KratosMultiphysics as Kratos
import numpy as np
from KratosMultiphysics import StructuralMechanicsApplication as Structural
from stope import LINEAR_TOLERANCE_SHARE, Block, announce, peak_memory, read_case, sizes

CASE = read_case(sys.argv[1])
WITH_STRENGTH = "cohesion" in CASE
if WITH_STRENGTH:
    import KratosMultiphysics.LinearSolversApplication  # makes the strategy's sparse LU known
    from KratosMultiphysics import GeoMechanicsApplication as Geo
    from KratosMultiphysics.GeoMechanicsApplication.geomechanics_analysis import GeoMechanicsAnalysis as Analysis
else:
    from KratosMultiphysics.StructuralMechanicsApplication.structural_mechanics_analysis import (
        StructuralMechanicsAnalysis as Analysis,
    )

ITERATIONS, LINEAR_ITERATIONS = 500, 1000
INCREMENTS = CASE.get("increments", 1)
MATERIALS = "materials.json"
COMPUTED = "porous_computational_model_part"  # The geomechanics solver gives it this name.
YIELD_TOLERANCE = 1.0  # Tolerance of the return to the strength surface, Pa.


def linear_solver() -> dict:
    """AMGCL. Its smoothers and coarsenings differ little in time here."""
    return {
        "solver_type": "amgcl",
        "krylov_type": "cg",
        "smoother_type": "ilu0",
        "coarsening_type": "aggregation",
        "tolerance": LINEAR_TOLERANCE_SHARE * CASE["tolerance"],
        "max_iteration": LINEAR_ITERATIONS,
        "scaling": False,
        "verbosity": 0,
    }


def elastic_settings() -> tuple[dict, dict]:
    """Solver and processes of the elastic block."""
    solver = {
        "solver_type": "static",
        "model_part_name": "Block",
        "domain_size": 3,
        "analysis_type": "linear",
        "model_import_settings": {"input_type": "use_input_model_part"},
        "time_stepping": {"time_step": 1.0},
        "compute_reactions": False,
        "move_mesh_flag": False,
        "linear_solver_settings": linear_solver(),
    }
    virgin_stress = {
        "python_module": "set_initial_state_process",
        "kratos_module": "KratosMultiphysics",
        "Parameters": {
            "model_part_name": "Block",
            "imposed_stress": [*CASE["stress"], 0.0, 0.0, 0.0],
            "imposed_strain": [0.0] * 6,
        },
    }
    return solver, {"initial_state": [virgin_stress]}


def coulomb_settings(block: Block) -> tuple[dict, dict]:
    """Solver and processes of the block of Coulomb rock."""
    solver = {
        "solver_type": "U_Pw",
        "model_part_name": "Block",
        "domain_size": 3,
        "model_import_settings": {"input_type": "use_input_model_part"},
        "material_import_settings": {"materials_filename": MATERIALS},
        "time_stepping": {"time_step": 1.0 / INCREMENTS, "max_delta_time_factor": 1.0},
        "scheme_type": "Backward_Euler",
        "strategy_type": "quasi_newton",
        "rebuild_level": 0,
        "convergence_criterion": "residual_criterion",
        "residual_relative_tolerance": 1e-30,
        # Kratos divides the 2-norm by the number of unknowns
        "residual_absolute_tolerance": CASE["tolerance"] * block.released / sizes(CASE)["unknowns"],
        "max_iterations": ITERATIONS,
        "min_iterations": 1,
        "number_cycles": 1,
        "problem_domain_sub_model_part_list": ["Rock"],
        "processes_sub_model_part_list": ["Rock"],
        "body_domain_sub_model_part_list": ["Rock"],
    }
    virgin_stress = {
        "python_module": "apply_initial_uniform_stress_field",
        "kratos_module": "KratosMultiphysics.GeoMechanicsApplication",
        "Parameters": {"model_part_name": f"Block.{COMPUTED}", "value": [*CASE["stress"], 0.0, 0.0, 0.0]},
    }
    return solver, {"loads_process_list": [virgin_stress]}


def write_materials() -> None:
    """Write the material of Coulomb rock. Properties of water have no effect while its pressure is held."""
    rock = {
        "YOUNG_MODULUS": CASE["youngs_modulus"],
        "POISSON_RATIO": CASE["poisson_ratio"],
        "GEO_COHESION": CASE["cohesion"],
        "GEO_FRICTION_ANGLE": CASE["friction_angle"],
        "GEO_DILATANCY_ANGLE": CASE["dilation_angle"],
        "GEO_ENABLE_TENSION_CUT_OFF": False,
        "GEO_COULOMB_HARDENING_TYPE": "None",
        "GEO_ABS_YIELD_FUNCTION_TOLERANCE": YIELD_TOLERANCE,
    }
    water = {
        "IGNORE_UNDRAINED": True,
        "DENSITY_SOLID": 2850.0,
        "DENSITY_WATER": 1000.0,
        "POROSITY": 0.01,
        "BULK_MODULUS_SOLID": 1e12,
        "BULK_MODULUS_FLUID": 2e9,
        "DYNAMIC_VISCOSITY": 1e-3,
        "BIOT_COEFFICIENT": 1.0,
        "RETENTION_LAW": "SaturatedLaw",
        "SATURATED_SATURATION": 1.0,
        "RESIDUAL_SATURATION": 1e-9,
        **{f"PERMEABILITY_{axes}": 1e-12 for axes in ("XX", "YY", "ZZ", "XY", "YZ", "ZX")},
    }
    material = {"constitutive_law": {"name": "GeoMohrCoulombLaw3D"}, "Variables": rock | water, "Tables": {}}
    entry = {"model_part_name": "Block.Rock", "properties_id": 1, "Material": material}
    with open(MATERIALS, "w") as file:
        json.dump({"properties": [entry]}, file)


class Mining(Analysis):
    """Removes the forces that held the walls up, in proportion to time, and counts iterations."""

    supported: list  # nodes and their forces, N, that the stope's rock bore
    iterations = 0
    converged = True

    def ApplyBoundaryConditions(self):
        super().ApplyBoundaryConditions()
        left = 1.0 - self._GetSolver().GetComputingModelPart().ProcessInfo[Kratos.TIME]
        for node, force in self.supported:
            node.SetSolutionStepValue(Structural.POINT_LOAD, 0, [left * part for part in force])

    def FinalizeSolutionStep(self):
        super().FinalizeSolutionStep()
        # a linear strategy leaves the number at zero
        self.iterations += max(1, self._GetSolver().GetComputingModelPart().ProcessInfo[Kratos.NL_ITERATION_NUMBER])


def fill(part, block: Block) -> None:
    """Nodes and elements of the block."""
    for number, place in enumerate(block.position.tolist(), 1):
        part.CreateNewNode(number, *place)
    properties = part.CreateNewProperties(1)
    element = "UPwSmallStrainElement3D8N" if WITH_STRENGTH else "SmallDisplacementElement3D8N"
    if not WITH_STRENGTH:
        properties.SetValue(Kratos.YOUNG_MODULUS, CASE["youngs_modulus"])
        properties.SetValue(Kratos.POISSON_RATIO, CASE["poisson_ratio"])
        law = Kratos.KratosGlobals.Kernel.GetConstitutiveLaw("LinearElastic3DLaw")
        properties.SetValue(Kratos.CONSTITUTIVE_LAW, law.Clone())
    for number, nodes in enumerate((block.hexahedra + 1).tolist(), 1):
        part.CreateNewElement(element, number, nodes, properties)
    rock = part.CreateSubModelPart("Rock")
    rock.AddNodes(list(range(1, len(block.nodes) + 1)))
    rock.AddElements(list(range(1, len(block.cells) + 1)))


def support_walls(part, block: Block) -> list:
    """Loads on the walls' nodes as pairs of node and force (N), where they are removed in increments."""
    if not WITH_STRENGTH:
        return []
    force = block.support()
    loaded = np.flatnonzero(force.any(axis=1)).tolist()
    for number, node in enumerate(loaded, 1):
        part.CreateNewCondition("UPwForceCondition3D1N", number, [node + 1], part.Properties[1])
    return [(part.Nodes[node + 1], force[node].tolist()) for node in loaded]


def hold(part, block: Block) -> None:
    """No motion of the outer faces, no water pressure."""
    for node in (block.outer + 1).tolist():
        for component in (Kratos.DISPLACEMENT_X, Kratos.DISPLACEMENT_Y, Kratos.DISPLACEMENT_Z):
            part.Nodes[node].Fix(component)
    if WITH_STRENGTH:
        Kratos.VariableUtils().ApplyFixity(Kratos.WATER_PRESSURE, True, part.Nodes)


def solve(block: Block) -> dict:
    """Solve the case. Returns what is announced to the supervising process."""
    solver, processes = coulomb_settings(block) if WITH_STRENGTH else elastic_settings()
    about = {"problem_name": "stope", "parallel_type": "OpenMP", "echo_level": 0, "start_time": 0.0, "end_time": 1.0}
    parameters = {
        "problem_data": about | {"number_of_threads": CASE["threads"]},
        "solver_settings": solver,
        "processes": processes,
        "output_processes": {},
    }
    model = Kratos.Model()
    part = model.CreateModelPart("Block")
    part.ProcessInfo[Kratos.DOMAIN_SIZE] = 3
    mining = Mining(model, Kratos.Parameters(json.dumps(parameters)))  # adds the variables that nodes shall have
    fill(part, block)
    mining.supported = support_walls(part, block)
    announce(begins=True)
    start, processor = time.perf_counter(), time.process_time()
    mining.Initialize()
    if WITH_STRENGTH:  # the solver has left them out of what it computes
        part.GetSubModelPart(COMPUTED).AddConditions([condition.Id for condition in part.Conditions])
    hold(part, block)
    reason = ""
    try:
        mining.RunSolutionLoop()
    except RuntimeError as error:
        reason = str(error).splitlines()[0]
    seconds, processor = time.perf_counter() - start, time.process_time() - processor
    total = Geo.TOTAL_DISPLACEMENT if WITH_STRENGTH else Kratos.DISPLACEMENT
    moved = np.array(Kratos.VariableUtils().GetSolutionStepValuesVector(part.Nodes, total, 0, 3)).reshape(-1, 3)
    return {
        "converged": not reason,
        "reason": reason,
        "seconds": seconds,
        "cpu_seconds": processor,
        "memory": peak_memory(),
        "iterations": mining.iterations,
        "closure": None if reason else block.closure(moved),
        "version": f"Kratos {version('KratosMultiphysics')}",
    }


def main() -> None:
    Kratos.Logger.GetDefaultOutput().SetSeverity(Kratos.Logger.Severity.WARNING)
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        if WITH_STRENGTH:
            write_materials()
        announce(**solve(Block(CASE)))
        os.chdir("/")


if __name__ == "__main__":
    main()
