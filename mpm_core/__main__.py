"""Command lines of the mechanics: python -m mpm_core grid | elastic | step | vtk | solids."""

import argparse
import logging
from contextlib import ExitStack
from pathlib import Path

from common.command_line import CommandLine
from common.datasets import open_dataset, read_dataset, write_dataset
from common.provenance import provenance
from common.slices import read_slice
from common.stage import run_stage, threads_on


def grid(arguments: argparse.Namespace) -> None:
    """cells and nodes from the solids"""
    from mpm_core.kernels.threads import use_threads
    from mpm_core.stages.first_kernels import compile_for_grid
    from mpm_core.stages.grid_stage import make_grid

    scene = read_slice(arguments.scene)
    threads = threads_on(arguments.threads)
    compile_for_grid(scene.get("plane"), threads)
    use_threads(threads)
    write_dataset(make_grid(scene, provenance(scene, "mpm_core grid")), arguments.output)


def elastic(arguments: argparse.Namespace) -> None:
    """elastic equilibrium of everything mined in history"""
    _solve(arguments)


def step(arguments: argparse.Namespace) -> None:
    """Equilibrium of rock that fails after this mining step"""
    _solve(arguments)


def _solve(arguments: argparse.Namespace) -> None:
    """elastic.nc, or steps/<step>.nc from the state of the step before."""
    from mpm_core.kernels.threads import use_threads
    from mpm_core.scene.scene import parse_scene
    from mpm_core.stages.checkpoint import Checkpoint, key_of
    from mpm_core.stages.equilibrium_stages import elastic_stage, mining_step
    from mpm_core.stages.first_kernels import compile_for_scene

    values = read_slice(arguments.scene)
    inputs = [arguments.grid] if arguments.stage == "elastic" else [arguments.grid, arguments.state]
    made_from = provenance(values, f"mpm_core {arguments.stage}", inputs)
    scene = parse_scene(values)
    threads = threads_on(arguments.threads)
    compile_for_scene(arguments.stage, scene, threads)
    use_threads(threads)
    failed_state = Path(arguments.output).with_suffix(".failed.npz")
    with ExitStack() as files:  # gigabytes in a large mine, read once each
        grid = files.enter_context(open_dataset(arguments.grid))
        if arguments.stage == "elastic":
            dataset, facts = elastic_stage(scene, grid, failed_state)
        else:
            before = files.enter_context(open_dataset(arguments.state))
            path = Path(arguments.output).with_suffix(".checkpoint.npz")
            checkpoint = Checkpoint(path, key_of(made_from, arguments.grid, arguments.state))
            dataset, facts = mining_step(scene, grid, before, failed_state, checkpoint)
    for name, value in facts.items():
        logging.info("%s: %s", name, value)
    dataset.attrs |= made_from
    write_dataset(dataset, arguments.output)


def vtk(arguments: argparse.Namespace) -> None:
    """a state for ParaView"""
    from mpm_core.files.state_datasets import read_edge_nodes, read_grid, read_pieces
    from mpm_core.files.state_vtk import write_vtu

    state, first = read_dataset(arguments.state), read_dataset(arguments.grid)
    write_vtu(read_grid(state)[0], read_pieces(first), read_edge_nodes(first), state, arguments.output)


def solids(arguments: argparse.Namespace) -> None:
    """the solids for ParaView"""
    from mpm_core.files.state_vtk import INDEX, write_solids
    from mpm_core.scene.scene_solids import read_solids
    from mpm_core.settings import GridSlice
    from mpm_core.stages.grid_stage import domain_of

    scene = GridSlice.of(read_slice(arguments.scene))
    domain, may_miss = domain_of(scene), {"rock_bodies": scene.far_field is not None}
    groups = {group: read_solids(getattr(scene, group), group, domain, may_miss.get(group, False)) for group in INDEX}
    write_solids(groups, scene.plane, scene.mined, arguments.output)


def main() -> None:
    """Parse the command line and run the stage."""
    parser = CommandLine(prog="python -m mpm_core", description=__doc__)
    stages = parser.add_subparsers(dest="stage", required=True)
    takes = {
        "grid": (),
        "elastic": ("grid",),
        "step": ("grid", "state"),
        "vtk": ("grid", "state"),
        "solids": (),
    }
    for name, inputs in takes.items():
        stage = stages.add_parser(name)
        for option in (*inputs, "output"):
            stage.add_argument(f"--{option}", required=True)
        if name != "vtk":
            stage.add_argument("--scene", required=True, help="file of the configuration's slice, JSON, SI units")
        stage.add_argument("--log")
        stage.add_argument("--threads", type=int, default=1, help="0: in idle time")
    arguments = parser.parse_args()
    run = {"grid": grid, "elastic": elastic, "step": step, "vtk": vtk, "solids": solids}[arguments.stage]
    run_stage(f"{arguments.stage} {arguments.output}", arguments.log, lambda: run(arguments), run.__doc__ or "")


if __name__ == "__main__":
    main()
