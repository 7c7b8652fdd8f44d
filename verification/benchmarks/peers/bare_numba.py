"""A material point step as one would first write it in numba: a regular block, 8 particles per cell, elastic, float64.

What the approach gives on one thread without a multi-level grid, constraints, materials or threads to care for. Run by
kernels.py in an environment of its own; speaks the protocol of that script: for every line on standard input it takes
`--steps` steps and prints one line of JSON.
"""

import argparse
import json
import sys
import time
from importlib.metadata import version

import numpy as np
from numba import njit

YOUNGS_MODULUS, POISSON_RATIO, DENSITY, DAMPING = 57e9, 0.25, 2850.0, 0.8
LAME = YOUNGS_MODULUS * POISSON_RATIO / ((1 + POISSON_RATIO) * (1 - 2 * POISSON_RATIO))
SHEAR = YOUNGS_MODULUS / (2 * (1 + POISSON_RATIO))
VOLUME = 1.0 / 8.0  # cells of 1 m
MASS = DENSITY * VOLUME
TIME_STEP = 0.3 / np.sqrt((LAME + 2 * SHEAR) / DENSITY)


@njit(fastmath=True)
def to_nodes(position, velocity, stress, node):
    """Mass, momentum and internal force of particles (particle, ...) to node (i, j, k, 7)."""
    node[:] = 0.0
    for p in range(len(position)):
        i, j, k = int(position[p, 0]), int(position[p, 1]), int(position[p, 2])
        x, y, z = position[p, 0] - i, position[p, 1] - j, position[p, 2] - k
        for a in range(2):
            sx, gx = (x, 1.0) if a else (1.0 - x, -1.0)
            for b in range(2):
                sy, gy = (y, 1.0) if b else (1.0 - y, -1.0)
                for c in range(2):
                    sz, gz = (z, 1.0) if c else (1.0 - z, -1.0)
                    mass = sx * sy * sz * MASS
                    dx, dy, dz = gx * sy * sz * VOLUME, sx * gy * sz * VOLUME, sx * sy * gz * VOLUME
                    n = node[i + a, j + b, k + c]
                    n[0] += mass
                    n[1] += mass * velocity[p, 0]
                    n[2] += mass * velocity[p, 1]
                    n[3] += mass * velocity[p, 2]
                    n[4] -= stress[p, 0] * dx + stress[p, 5] * dy + stress[p, 4] * dz
                    n[5] -= stress[p, 5] * dx + stress[p, 1] * dy + stress[p, 3] * dz
                    n[6] -= stress[p, 4] * dx + stress[p, 3] * dy + stress[p, 2] * dz


@njit(fastmath=True)
def move_nodes(node):
    """Momentum and force become velocity and acceleration; the faces of the block are held."""
    side = node.shape[0]
    for i in range(side):
        for j in range(side):
            for k in range(side):
                n = node[i, j, k]
                held = i == 0 or j == 0 or k == 0 or i == side - 1 or j == side - 1 or k == side - 1
                for axis in range(3):
                    v = n[1 + axis] / n[0]
                    f = n[4 + axis]
                    a = (f - DAMPING * abs(f) * np.sign(v)) / n[0]
                    n[1 + axis] = 0.0 if held else v + TIME_STEP * a
                    n[4 + axis] = 0.0 if held else a


@njit(fastmath=True)
def to_particles(position, velocity, stress, node):
    """Position, velocity, strain and elastic stress from the nodes."""
    for p in range(len(position)):
        i, j, k = int(position[p, 0]), int(position[p, 1]), int(position[p, 2])
        x, y, z = position[p, 0] - i, position[p, 1] - j, position[p, 2] - k
        vx = vy = vz = ax = ay = az = exx = eyy = ezz = eyz = exz = exy = 0.0
        for a in range(2):
            sx, gx = (x, 1.0) if a else (1.0 - x, -1.0)
            for b in range(2):
                sy, gy = (y, 1.0) if b else (1.0 - y, -1.0)
                for c in range(2):
                    sz, gz = (z, 1.0) if c else (1.0 - z, -1.0)
                    s = sx * sy * sz
                    dx, dy, dz = gx * sy * sz, sx * gy * sz, sx * sy * gz
                    n = node[i + a, j + b, k + c]
                    vx += s * n[1]
                    vy += s * n[2]
                    vz += s * n[3]
                    ax += s * n[4]
                    ay += s * n[5]
                    az += s * n[6]
                    exx += dx * n[1]
                    eyy += dy * n[2]
                    ezz += dz * n[3]
                    eyz += 0.5 * (dy * n[3] + dz * n[2])
                    exz += 0.5 * (dx * n[3] + dz * n[1])
                    exy += 0.5 * (dx * n[2] + dy * n[1])
        position[p, 0] += TIME_STEP * vx
        position[p, 1] += TIME_STEP * vy
        position[p, 2] += TIME_STEP * vz
        velocity[p, 0] += TIME_STEP * ax
        velocity[p, 1] += TIME_STEP * ay
        velocity[p, 2] += TIME_STEP * az
        trace = LAME * TIME_STEP * (exx + eyy + ezz)
        double = 2.0 * SHEAR * TIME_STEP
        stress[p, 0] += trace + double * exx
        stress[p, 1] += trace + double * eyy
        stress[p, 2] += trace + double * ezz
        stress[p, 3] += double * eyz
        stress[p, 4] += double * exz
        stress[p, 5] += double * exy


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cells", type=int, default=40, help="along each edge")
    parser.add_argument("--steps", type=int, default=10)
    arguments = parser.parse_args()
    side = arguments.cells
    corner = np.stack(np.meshgrid(*[np.arange(side)] * 3, indexing="ij"), -1).reshape(-1, 1, 3)
    place = np.stack(np.meshgrid(*[[0.25, 0.75]] * 3, indexing="ij"), -1).reshape(1, -1, 3)
    position = (corner + place).reshape(-1, 3)
    velocity = 1e-3 * np.sin(position)
    stress = np.zeros((len(position), 6))
    node = np.zeros((side + 1, side + 1, side + 1, 7))

    def step() -> None:
        to_nodes(position, velocity, stress, node)
        move_nodes(node)
        to_particles(position, velocity, stress, node)

    step()
    for _ in sys.stdin:
        start = time.process_time()
        for _ in range(arguments.steps):
            step()
        rate = len(position) * arguments.steps / (time.process_time() - start)
        print(json.dumps({"rate": rate, "version": version("numba")}), flush=True)


if __name__ == "__main__":
    main()
