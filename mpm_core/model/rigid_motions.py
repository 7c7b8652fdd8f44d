"""Rigid motions of a body: those that held components leave free, their removal, and forces that drive them.

In d dimensions there are d translations and d (d - 1) / 2 rotations. Those left free are the combinations that vanish
wherever something is held: the null space of the motions at the held components.
"""

from dataclasses import dataclass

import numpy as np

# A motion is free if its square sum at held components is at most this share of the largest eigenvalue.
MAX_HELD_SHARE = 1e-9
# Forces balance along a free motion if what is left of them is at most this share of the sum of all forces.
MAX_RESULTANT_SHARE = 1e-6


def unit_motions(offset: np.ndarray) -> np.ndarray:
    """Translations along each axis, then rotations, (motion, point, d), at offsets (point, d) from their centre."""
    points, dimension = offset.shape
    motions = [np.broadcast_to(np.eye(dimension)[k], (points, dimension)) for k in range(dimension)]
    for i in range(dimension):
        for j in range(i):
            spin = np.zeros((points, dimension))
            spin[:, i], spin[:, j] = offset[:, j], -offset[:, i]
            motions.append(spin)
    return np.stack(motions)


@dataclass(frozen=True)
class RigidMotions:
    """Some rigid motions (k): each row of shares (k, unit motion) combines those about a centre (d,) m, rotations by
    one reach (m) per radian."""

    center: np.ndarray
    reach: float
    shares: np.ndarray

    @property
    def count(self) -> int:
        """Number of motions."""
        return len(self.shares)

    def at(self, position: np.ndarray) -> np.ndarray:
        """The motions (k, point, d) at positions (point, d) m."""
        units = unit_motions((position - self.center) / self.reach)
        return np.einsum("km,mpi->kpi", self.shares, units)  # no threaded BLAS: bits must not depend on threads

    def remove_from(self, motion: np.ndarray, position: np.ndarray, mass: np.ndarray) -> None:
        """Remove the best of them, weighted by mass (point,), from a motion (point, d) at positions, in place.

        Points without mass keep theirs: they move with others, or not at all.
        """
        if not self.count:
            return
        own = self.at(position) * (mass > 0.0)[:, None]
        weighted = own * mass[:, None]
        gram = np.einsum("kpi,lpi->kl", weighted, own)
        shares = np.linalg.solve(gram, np.einsum("kpi,pi->k", weighted, motion))
        motion -= np.einsum("k,kpi->pi", shares, own)

    def driven_by(self, force: np.ndarray, position: np.ndarray) -> bool:
        """True if forces (point, d) N at positions do work on one of them: beyond MAX_RESULTANT_SHARE, they do not
        balance."""
        if not self.count:
            return False
        work = np.abs(np.einsum("kpi,pi->k", self.at(position), force))
        farthest = max(1.0, float(np.abs(position - self.center).max()) / self.reach)
        return bool((work > MAX_RESULTANT_SHARE * farthest * np.abs(force).sum()).any())

    def describe(self, axes: tuple[int, ...]) -> str:
        """Description in words: "it may shift along x, shift along z, turn about y"; axes (d,) of the mine's frame."""
        size = np.sqrt(np.sum(self.shares**2, axis=0)) > 0.5
        words = [f"shift along {'xyz'[axis]}" for axis in axes]
        for i in range(len(axes)):
            words += [f"turn about {'xyz'[3 - axes[i] - axes[j]]}" for j in range(i)]
        return "it may " + ", ".join(word for word, has in zip(words, size, strict=True) if has)


def free_motions(position: np.ndarray, held: np.ndarray) -> RigidMotions:
    """Rigid motions left free by the held components, (point, d) bool, at positions (point, d) m; all, if none is held.

    Points without a held component do not matter, except that without any the motions are about their middle.
    """
    dimension = position.shape[1]
    some = held.any(axis=1)
    chosen = position[some] if some.any() else position
    center = chosen.mean(axis=0) if len(chosen) else np.zeros(dimension)
    reach = float(np.abs(chosen - center).max(initial=0.0)) or 1.0
    gram = np.zeros((dimension * (dimension + 1) // 2,) * 2)
    if some.any():
        motions = unit_motions((chosen - center) / reach)
        for axis in range(dimension):
            here = motions[:, held[some, axis], axis]
            gram += np.einsum("kp,lp->kl", here, here)
    sizes, vectors = np.linalg.eigh(gram)
    return RigidMotions(center, reach, vectors.T[sizes <= MAX_HELD_SHARE * max(sizes[-1], MAX_HELD_SHARE)])
