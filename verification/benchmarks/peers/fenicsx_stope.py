"""The block with a stope in FEniCSx (Debian's python3-dolfinx): hexahedra with 2 x 2 x 2 Gauss points, elastic only.

The block stands without its stope under the in-situ stress and reaches equilibrium in one linear solution: PETSc's
conjugate gradients with its algebraic multigrid (GAMG), which is given the motions of a rigid body. FEniCSx uses
processes of MPI in place of threads: this script starts one of fenicsx_process.py for each thread of the case. FEniCSx
has no law of Coulomb rock.

Run by benchmarks/measuring.py with the system's Python; takes the file of a case, prints JSON. Seconds are those from
the distributed mesh to the displacements. Forms are compiled before that, on a mesh of few cells. Processor time and
memory are the sums of all processes.
"""

import os
import shutil
import sys
from pathlib import Path

from stope import read_case

PROCESS = Path(__file__).with_name("fenicsx_process.py")


def main() -> None:
    path = sys.argv[1]
    mpirun = shutil.which("mpirun")
    if not mpirun:
        sys.exit("mpirun: not found")
    os.environ |= {"OMP_NUM_THREADS": "1", "OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}
    options = ["--oversubscribe", "-n", str(read_case(path)["threads"])]
    os.execv(mpirun, [mpirun, *options, sys.executable, str(PROCESS), path])


if __name__ == "__main__":
    main()
