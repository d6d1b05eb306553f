"""Contact spots: connected parts of the contact surface that the flat touches."""

from __future__ import annotations

import numpy as np

from asperity.arrays import Flags, Floats, Indices
from asperity.contact.contact_surface import ContactSurface
from asperity.mesh.element import BEARING


def spots_of(surface: ContactSurface, edges: Flags, areas: Floats) -> tuple[int, float]:
    """Number of contact spots of all ranks and area of the largest one [length^2]; collective.

    A spot consists of touched thirds of facets, each between an edge and the middle of its facet. Those of one facet
    belong to one spot, and so do those that meet at a corner. A map of these thirds shows as many patches.

    Args:
        edges: see `Contact.touched_edges` (nodes,)
        areas: touched area of each facet (F,) [length^2]
    """
    comm, index_map = surface.solid.comm, surface.solid.V.dofmap.index_map
    touched = edges[surface.nodes[:, BEARING]]
    facets = touched.any(axis=1)
    at_corners = np.roll(touched, -1, axis=1) | np.roll(touched, -2, axis=1)  # an edge has the number opposite to it
    corners = index_map.local_to_global(surface.nodes[facets, :3].ravel()).reshape(-1, 3)
    parts = comm.gather((corners, at_corners[facets], areas[facets]), root=0)
    found = None
    if parts is not None:
        found = _components(*(np.concatenate(of_ranks) for of_ranks in zip(*parts, strict=True)))
    count, largest = comm.bcast(found, root=0)
    return count, largest


def _components(corners: Indices, touched: Flags, areas: Floats) -> tuple[int, float]:
    """Number of patches of facets and the greatest area of one.

    Args:
        corners: of the facets (n, 3)
        touched: whether a third that ends at the corner is (n, 3)
        areas: touched, of each facet (n,)
    """
    from scipy import sparse

    n = len(corners)
    if n == 0:
        return 0, 0.0
    known, column = np.unique(corners[touched], return_inverse=True)
    row = np.nonzero(touched)[0]
    incidence = sparse.csr_array((np.ones(len(row)), (row, column.ravel())), shape=(n, len(known)))
    count, of_facet = sparse.csgraph.connected_components(incidence @ incidence.T, directed=False)
    return int(count), float(np.bincount(of_facet, areas).max())
