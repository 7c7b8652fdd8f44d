"""The same material point step on NVIDIA Warp's CPU backend: a regular block, 8 particles per cell, float64.

Elastic, or Coulomb (no tension cut-off, return along the flow direction to the main plane) while a tenth of the
particles yields: these carry so much axial stress that every step takes them over strength again. Run by kernels.py in
an environment of its own; for every line on standard input it takes `--steps` steps and prints one line of JSON.
"""

import argparse
import json
import math
import sys
import time

import numpy as np
import warp as wp

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--cells", type=int, default=40, help="along each edge")
parser.add_argument("--steps", type=int, default=10)
parser.add_argument("--coulomb", action="store_true")
arguments = parser.parse_args()

wp.config.quiet = True
wp.config.enable_backward = False
wp.init()
wp.set_device("cpu")

YOUNGS_MODULUS, POISSON_RATIO, MASS_DENSITY = 57e9, 0.25, 2850.0
lame = YOUNGS_MODULUS * POISSON_RATIO / ((1 + POISSON_RATIO) * (1 - 2 * POISSON_RATIO))
shear = YOUNGS_MODULUS / (2 * (1 + POISSON_RATIO))
friction = (1 + math.sin(math.radians(20))) / (1 - math.sin(math.radians(20)))
dilation = (1 + math.sin(math.radians(10))) / (1 - math.sin(math.radians(10)))
strength = 2e6 * math.sqrt(friction)  # cohesion 1 MPa
# Coulomb: rock so heavy that it keeps the velocity of a uniform compression, as in kernels.py
heaviness = 1e12 if arguments.coulomb else 1.0

LAME, SHEAR = wp.constant(wp.float64(lame)), wp.constant(wp.float64(shear))
FRICTION, DILATION = wp.constant(wp.float64(friction)), wp.constant(wp.float64(dilation))
STRENGTH = wp.constant(wp.float64(strength))
VOLUME, MASS = wp.constant(wp.float64(0.125)), wp.constant(wp.float64(0.125 * MASS_DENSITY * heaviness))
TIME_STEP = wp.constant(wp.float64(0.3 / math.sqrt((lame + 2 * shear) / MASS_DENSITY)))
DAMPING = wp.constant(wp.float64(0.0 if arguments.coulomb else 0.8))
ZERO, ONE, HALF, TWO = (wp.constant(wp.float64(value)) for value in (0.0, 1.0, 0.5, 2.0))
COULOMB = wp.constant(arguments.coulomb)
HELD = wp.constant(not arguments.coulomb)
SIDE = wp.constant(arguments.cells + 1)


@wp.func
def node_at(i: int, j: int, k: int) -> int:
    return (i * SIDE + j) * SIDE + k


@wp.func
def weight(side: int, x: wp.float64) -> wp.float64:
    return wp.where(side == 1, x, ONE - x)


@wp.func
def slope(side: int) -> wp.float64:
    return wp.where(side == 1, ONE, -ONE)


@wp.kernel
def to_nodes(
    position: wp.array(dtype=wp.vec3d),
    velocity: wp.array(dtype=wp.vec3d),
    stress: wp.array(dtype=wp.mat33d),
    mass: wp.array(dtype=wp.float64),
    momentum: wp.array(dtype=wp.vec3d),
    force: wp.array(dtype=wp.vec3d),
):
    p = wp.tid()
    place = position[p]
    i, j, k = int(place[0]), int(place[1]), int(place[2])
    x, y, z = place[0] - wp.float64(i), place[1] - wp.float64(j), place[2] - wp.float64(k)
    for a in range(2):
        for b in range(2):
            for c in range(2):
                sx, sy, sz = weight(a, x), weight(b, y), weight(c, z)
                share = sx * sy * sz * MASS
                gradient = wp.vec3d(slope(a) * sy * sz, slope(b) * sx * sz, slope(c) * sx * sy)
                n = node_at(i + a, j + b, k + c)
                wp.atomic_add(mass, n, share)
                wp.atomic_add(momentum, n, share * velocity[p])
                wp.atomic_add(force, n, -VOLUME * (stress[p] * gradient))


@wp.func
def damped(force: wp.float64, velocity: wp.float64) -> wp.float64:
    return force - DAMPING * wp.abs(force) * wp.sign(velocity)


@wp.kernel
def move_nodes(mass: wp.array(dtype=wp.float64), momentum: wp.array(dtype=wp.vec3d), force: wp.array(dtype=wp.vec3d)):
    n = wp.tid()
    i, j, k = n / (SIDE * SIDE), (n / SIDE) % SIDE, n % SIDE
    held = i == 0 or j == 0 or k == 0 or i == SIDE - 1 or j == SIDE - 1 or k == SIDE - 1
    if HELD and held:
        momentum[n] = wp.vec3d(ZERO, ZERO, ZERO)
        force[n] = wp.vec3d(ZERO, ZERO, ZERO)
    else:
        v = momentum[n] / mass[n]
        f = force[n]
        acceleration = wp.vec3d(damped(f[0], v[0]), damped(f[1], v[1]), damped(f[2], v[2])) / mass[n]
        momentum[n] = v + TIME_STEP * acceleration
        force[n] = acceleration


@wp.func
def returned(trial: wp.mat33d) -> wp.mat33d:
    directions, values = wp.eig3(trial)
    first, last = int(0), int(0)  # noqa: RUF046, UP018 (Warp: variables, not constants)
    for axis in range(1, 3):
        if values[axis] > values[first]:
            first = axis
        if values[axis] < values[last]:
            last = axis
    excess = FRICTION * values[first] - values[last] - STRENGTH
    if excess <= ZERO or first == last:
        return trial
    volumetric = LAME * (DILATION - ONE)
    multiplier = excess / (volumetric * (FRICTION - ONE) + TWO * SHEAR * (FRICTION * DILATION + ONE))
    middle = 3 - first - last
    values[first] = values[first] - multiplier * (volumetric + TWO * SHEAR * DILATION)
    values[middle] = values[middle] - multiplier * volumetric
    values[last] = values[last] - multiplier * (volumetric - TWO * SHEAR)
    return directions * wp.diag(values) * wp.transpose(directions)


@wp.kernel
def to_particles(
    position: wp.array(dtype=wp.vec3d),
    velocity: wp.array(dtype=wp.vec3d),
    stress: wp.array(dtype=wp.mat33d),
    node_velocity: wp.array(dtype=wp.vec3d),
    node_acceleration: wp.array(dtype=wp.vec3d),
):
    p = wp.tid()
    place = position[p]
    i, j, k = int(place[0]), int(place[1]), int(place[2])
    x, y, z = place[0] - wp.float64(i), place[1] - wp.float64(j), place[2] - wp.float64(k)
    v = wp.vec3d(ZERO, ZERO, ZERO)
    acceleration = wp.vec3d(ZERO, ZERO, ZERO)
    rate = wp.mat33d(ZERO, ZERO, ZERO, ZERO, ZERO, ZERO, ZERO, ZERO, ZERO)
    for a in range(2):
        for b in range(2):
            for c in range(2):
                sx, sy, sz = weight(a, x), weight(b, y), weight(c, z)
                gradient = wp.vec3d(slope(a) * sy * sz, slope(b) * sx * sz, slope(c) * sx * sy)
                n = node_at(i + a, j + b, k + c)
                v += sx * sy * sz * node_velocity[n]
                acceleration += sx * sy * sz * node_acceleration[n]
                rate += wp.outer(node_velocity[n], gradient)
    position[p] = place + TIME_STEP * v
    velocity[p] = velocity[p] + TIME_STEP * acceleration
    strain = HALF * TIME_STEP * (rate + wp.transpose(rate))
    trial = stress[p] + TWO * SHEAR * strain + LAME * wp.trace(strain) * wp.identity(n=3, dtype=wp.float64)
    if COULOMB:
        trial = returned(trial)
    stress[p] = trial


def main() -> None:
    side = arguments.cells
    corner = np.stack(np.meshgrid(*[np.arange(side)] * 3, indexing="ij"), -1).reshape(-1, 1, 3)
    place = np.stack(np.meshgrid(*[[0.25, 0.75]] * 3, indexing="ij"), -1).reshape(1, -1, 3)
    where = (corner + place).reshape(-1, 3)
    speed = 1e-3 * np.sin(where)
    initial = np.zeros((len(where), 3, 3))
    yields = np.zeros(len(where), bool)
    if arguments.coulomb:
        speed = np.zeros_like(where)
        speed[:, 1] = -1e-3 * where[:, 1] / side
        initial[:] = np.diag([-29e6, -42e6, -23e6])
        yields = np.random.default_rng(1).random(len(where)) < 0.1
        initial[yields, 1, 1] = -60e6
    position, velocity = wp.array(where, dtype=wp.vec3d), wp.array(speed, dtype=wp.vec3d)
    stress = wp.array(initial, dtype=wp.mat33d)
    nodes = (side + 1) ** 3
    mass = wp.zeros(nodes, dtype=wp.float64)
    momentum, force = wp.zeros(nodes, dtype=wp.vec3d), wp.zeros(nodes, dtype=wp.vec3d)

    def step() -> None:
        for values in (mass, momentum, force):
            values.zero_()
        wp.launch(to_nodes, dim=len(where), inputs=[position, velocity, stress, mass, momentum, force])
        wp.launch(move_nodes, dim=nodes, inputs=[mass, momentum, force])
        wp.launch(to_particles, dim=len(where), inputs=[position, velocity, stress, momentum, force])

    step()
    for _ in sys.stdin:
        start = time.process_time()
        for _ in range(arguments.steps):
            step()
        rate = len(where) * arguments.steps / (time.process_time() - start)
        after = stress.numpy()
        assert np.isfinite(after).all()
        principal = np.linalg.eigvalsh(after)
        on_surface = np.abs(friction * principal[:, 2] - principal[:, 0] - strength) < 1e-6 * strength
        yielding = float(on_surface.mean()) if arguments.coulomb else 0.0
        print(json.dumps({"rate": rate, "version": wp.__version__, "yielding": yielding}), flush=True)


if __name__ == "__main__":
    main()
