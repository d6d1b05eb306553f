"""All code that depends on the dolfinx version, detected by probing; docs/install.md lists the tested versions."""

from __future__ import annotations

import importlib
import importlib.util
import os
import sys
import warnings
from typing import Any

import numpy as np
import numpy.typing as npt

from asperity.errors import CompatError


def require(module: str, package: str) -> None:
    """Check that a module can be imported, else CompatError, which names its Debian package."""
    if importlib.util.find_spec(module) is None:
        raise CompatError(f"the Python module {module} is missing: install {package} or asperity[solve]")
    try:
        importlib.import_module(module)
    except OSError as error:  # gmsh of PyPI is linked with libraries of a screen
        raise CompatError(f"the Python module {module} finds no library of the system: {error}") from None


def load_libraries() -> None:
    """Load MPI from PyPI's wheel of dolfinx, where it is installed, before all that is linked with it.

    Its PETSc would handle signals itself, and end the process where asperity ends a run in order.
    """
    options = os.environ.get("PETSC_OPTIONS", "")
    if "-no_signal_handler" not in options:
        os.environ["PETSC_OPTIONS"] = f"-no_signal_handler {options}".strip()
    if importlib.util.find_spec("dolfinx_solver") is not None:
        importlib.import_module("dolfinx_solver")


def start() -> None:
    """Import dolfinx, which starts PETSc; collective.

    The form compiler of dolfinx redirects all warnings to a logger without output: their display is restored.
    Scotch, which partitions the mesh, has one thread: with several each run has another partition, which changes the
    last digits of its results, and takes longer. The environment variable SCOTCH_PTHREAD_NUMBER, if set, wins.

    PETSc does not read the file .petscrc of the working folder: the file of somebody else can make it write files.
    """
    os.environ.setdefault("SCOTCH_PTHREAD_NUMBER", "1")
    load_libraries()
    # each call adds a collective call at exit, and a rank that runs alone would make more of them than the others
    if "petsc4py.PETSc" not in sys.modules and importlib.util.find_spec("petsc4py") is not None:
        importlib.import_module("petsc4py").init(["asperity", "-skip_petscrc"])
    with warnings.catch_warnings():  # warnings of its modules are not about the run
        warnings.simplefilter("ignore")
        import dolfinx  # noqa: F401


def gmsh_to_dolfinx(nodes_per_tet: int) -> npt.NDArray[np.integer[Any]]:
    """Permutation p (nodes_per_tet,) such that gmsh_cells[:, p] has the node order of dolfinx."""
    from dolfinx.mesh import CellType

    try:
        from dolfinx.io import gmsh as gmshio  # 0.10 and later
    except ImportError:
        from dolfinx.io import gmshio
    return np.asarray(gmshio.cell_perm_array(CellType.tetrahedron, nodes_per_tet))


def geometry_dofmap(mesh: Any) -> npt.NDArray[np.int32]:
    """Node numbers of each local cell, (cells, nodes per cell)."""
    geometry = mesh.geometry
    dofmaps = getattr(geometry, "dofmaps", None)
    return np.ascontiguousarray(geometry.dofmap if dofmaps is None else dofmaps[0])


def with_geometry(
    mesh: Any,
    numbers: npt.NDArray[np.int64],
    x_nodes: npt.NDArray[np.int32],
    x: npt.NDArray[np.float64],
) -> Any:
    """A mesh of the same topology with another geometry, whose nodes no rank shares with another; collective.

    Args:
        mesh: dolfinx mesh
        numbers: global number of each node of this rank (n,)
        x_nodes: nodes of each local cell (cells, nodes per cell)
        x: coordinates (n, 3) [length]
    """
    from dolfinx import cpp
    from dolfinx import mesh as dmesh

    old = mesh.geometry._cpp_object
    coordinates = old.cmap if hasattr(old, "cmap") else old.cmaps[0]  # since 0.11
    nodes = cpp.common.IndexMap(mesh.comm, len(x))
    geometry = cpp.mesh.Geometry_float64(nodes, x_nodes, coordinates, x, numbers)
    made = cpp.mesh.Mesh_float64(mesh.comm, mesh.topology._cpp_object, geometry)
    return dmesh.Mesh(made, mesh.ufl_domain())


def ghost_holders(index_map: Any) -> Any:
    """Other ranks that hold each local index, an adjacency list of dolfinx; of a ghost, ranks apart from its own."""
    try:
        return index_map.index_to_dest_ranks()
    except TypeError:  # since 0.11 with a tag of its messages
        return index_map.index_to_dest_ranks(0)
