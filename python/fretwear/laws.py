"""Contact laws made of the pairs that there are.

    pairs = fw.laws.iwan_pairs([[1, 0, 0]], tangential_stiffness=2.0, chi=-0.5, beta=0.5,
                               mu=0.4, normal_load=2.5, n=51)

The laws 'iwan' and 'bouc_wen' have one tangential direction and a constant normal load. Iwan's
joint is Jenkins elements in parallel, so that `iwan_pairs` makes it of elastic pairs where there
are two directions, or a normal dof that opens.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._arguments import array, whole
from .errors import InputError
from .model import ContactPairs

__all__ = ["iwan_pairs", "iwan_sliders"]


def iwan_sliders(chi: float, beta: float = 0.0, n: int = 50,
                 ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Jenkins elements of Iwan's joint: shares of its stiffness, and of its limit.

    The sliding limits up to the largest, with the density phi**chi, are parted into cells that are
    finer towards 0; an element has the stiffness and the limit of its cell, so that those of the
    joint are exact. With beta > 0 the last of the n elements is that of the largest limit. The
    error of the force falls with n**-2.
    """
    chi, beta = (float(array(name, [value], (1,))[0])
                 for name, value in (("chi", chi), ("beta", beta)))
    n = whole("n", n, 2)
    if not chi > -1.0:
        raise InputError(f"chi: is {chi:g}, must be above -1")
    if beta < 0.0:
        raise InputError(f"beta: is {beta:g}, must be at least 0")
    edges = np.linspace(0.0, 1.0, (n if beta == 0.0 else n - 1) + 1)**2
    stiffness = np.diff(edges**(chi + 1.0)) / (1.0 + beta)
    # The largest limit over that of the joint, in units of the stiffness of all.
    largest = (1.0 + beta) / (beta + (chi + 1.0) / (chi + 2.0))
    limit = largest * np.diff(edges**(chi + 2.0)) * (chi + 1.0) / (chi + 2.0) / (1.0 + beta)
    if beta > 0.0:
        stiffness = np.append(stiffness, beta / (1.0 + beta))
        limit = np.append(limit, largest * beta / (1.0 + beta))
    return stiffness, limit


def iwan_pairs(side_1: ArrayLike, side_2: ArrayLike | None = None, *,
               tangential_stiffness: ArrayLike, chi: float, beta: float = 0.0,
               mu: ArrayLike = 1.0, normal_load: ArrayLike | None = None,
               normal_stiffness: ArrayLike | None = None, gap: ArrayLike = 0.0,
               n: int = 50) -> ContactPairs:
    """Iwan's joint with four parameters as n parallel 'penalty' pairs for each pair.

    Parameters
    ----------
    side_1, side_2 : (n_pairs, 3)
        Dofs of (t1, t2, n) of both sides, as of `ContactPairs`; all tangential and normal
        directions may be there.
    tangential_stiffness : float or (n_pairs,)
        Stiffness for the smallest motion [force/length].
    chi, beta : float
        Exponent of the sliding limits, above -1; the stiffness that is lost at once where the last
        elements slip over that lost before.
    mu : float or (n_pairs,)
        Friction coefficient: the limit is mu times the normal force, at every instant.
    normal_load : float or (n_pairs,), optional
        Constant compressive force of pairs without a normal dof [force].
    normal_stiffness : float or (n_pairs,), optional
        Contact stiffness of pairs with a normal dof [force/length].
    gap : float or (n_pairs,)
        Initial gap [length].
    n : int
        Elements of each pair.

    Returns
    -------
    ContactPairs
        n_pairs times n pairs, those of one pair behind each other.
    """
    first = np.asarray(side_1)
    if first.ndim != 2 or first.shape[1] != 3:
        raise InputError(f"side_1: has the shape {first.shape}, must be (n_pairs, 3)")
    n_pairs = len(first)
    second = np.zeros_like(first) if side_2 is None else np.asarray(side_2)
    if second.shape != first.shape:
        raise InputError(f"side_2: has the shape {second.shape}, must be {first.shape}")
    stiffness, limit = iwan_sliders(chi, beta, n)

    def each(name: str, values: ArrayLike) -> NDArray[np.float64]:
        return np.asarray(array(name, values, (n_pairs,)), dtype=float)

    # Pairs share what presses alike, and differ in what they bear of it.
    return ContactPairs(
        np.repeat(first, n, axis=0), np.repeat(second, n, axis=0),
        mu=np.outer(each("mu", mu), n * limit).ravel(),
        gap=np.repeat(each("gap", gap), n),
        normal_load=None if normal_load is None else
        np.repeat(each("normal_load", normal_load) / n, n),
        tangential_stiffness=np.outer(
            each("tangential_stiffness", tangential_stiffness), stiffness).ravel(),
        normal_stiffness=None if normal_stiffness is None else
        np.repeat(each("normal_stiffness", normal_stiffness) / n, n),
        law="penalty")
