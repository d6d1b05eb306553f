# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Contact spots: connected patches of the contact surface that the flat touches."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from asperity.arrays import Flags, Floats, Indices
from asperity.contact.contact_surface import ContactSurface


@dataclass(frozen=True)
class Spots:
    """Number of contact spots and area of the largest one [length^2]."""

    count: int
    largest: float


def spots_of(surface: ContactSurface, touched: Flags, weights: Floats) -> Spots:
    """Contact spots of all ranks; collective.

    A facet belongs to a spot if one of its points is touched. Facets with a common edge belong to the same spot, so two
    spots count as one where less than a facet separates them.

    Args:
        surface: contact surface
        touched: whether the flat touches a point (F, Q)
        weights: area of each point (F, Q) [length^2]
    """
    comm, index_map = surface.solid.comm, surface.solid.V.dofmap.index_map
    facets = np.flatnonzero(touched.any(axis=1))
    corners = np.sort(index_map.local_to_global(surface.nodes[facets, :3].ravel()).reshape(-1, 3), axis=1)
    edges = corners[:, [0, 0, 1]] * index_map.size_global + corners[:, [1, 2, 2]]  # a name for each pair of corners
    areas = np.sum(weights * touched, axis=1)[facets]
    parts = comm.gather((edges, areas), root=0)
    found = None
    if parts is not None:
        found = _components(np.concatenate([e for e, _ in parts]), np.concatenate([a for _, a in parts]))
    return Spots(*comm.bcast(found, root=0))


def _components(edges: Indices, areas: Floats) -> tuple[int, float]:
    """Number of patches of facets and the greatest area of one, from their edges (n, 3) and areas (n,)."""
    from scipy import sparse

    n = len(edges)
    if n == 0:
        return 0, 0.0
    names, column = np.unique(edges, return_inverse=True)
    incidence = sparse.csr_array((np.ones(3 * n), column.ravel(), np.arange(n + 1) * 3), shape=(n, len(names)))
    count, of_facet = sparse.csgraph.connected_components(incidence @ incidence.T, directed=False)
    return int(count), float(np.bincount(of_facet, areas).max())
