"""Order between tests on several ranks, and small surfaces, materials and meshes."""

from __future__ import annotations

import gc
import math
import os
import re
import shutil
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Iterator
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from asperity.curve import COLUMNS, Curve
from asperity.fem.solid import Solid
from asperity.linear.petsc import NodeMatrix
from asperity.mesh.block import BlockMesh, Top
from asperity.mesh.element import outer_faces
from asperity.mesh.generate import build_block
from asperity.mesh.size_field import SizeField
from asperity.model.load_path import Schedule
from asperity.model.material import Material
from asperity.model.problem import Problem
from asperity.model.settings import MeshSize
from asperity.quasistatic import make
from asperity.quasistatic.contact_solver import ContactSolver
from asperity.runtime.launch import started_ranks
from asperity.runtime.parallel import Ranks, on_root
from asperity.runtime.run_folder import LOCK
from asperity.surface import Flat, Sinusoid, Sphere, Surface, WeierstrassMandelbrot


def is_open_mpi() -> bool:
    """Whether mpirun is that of Open MPI."""
    path = shutil.which("mpirun")
    return path is not None and "Open MPI" in subprocess.run([path, "--version"], capture_output=True, text=True).stdout


ELASTIC = Material(1.0, 0.3)
PLASTIC = Material(1.0, 0.3, 0.005, 0.05)
#: Start of a command on several ranks, also on more of them than there are cores.
MPIRUN = ("mpirun", *(("--oversubscribe", "--bind-to", "none") if is_open_mpi() else ()), "-n")


#: The environment without what an MPI process adds to it, so that a child can start a job of its own.
CLEAN = {k: v for k, v in os.environ.items() if not re.match("PMIX_|PMI_|PRTE_(?!MCA)|OMPI_(?!MCA|A)", k)}


def world() -> Any:
    """All ranks."""
    from mpi4py import MPI

    return MPI.COMM_WORLD


def here() -> Any:
    """This rank alone."""
    from mpi4py import MPI

    return MPI.COMM_SELF


def top_of(block: BlockMesh, surface: Surface) -> Top:
    """Top of a mesh that was made for `surface`."""
    faces = outer_faces(block.tets)
    faces = faces[block.on_top(surface)[faces].all(axis=1)]
    return Top((block.points - np.array([0.0, 0.0, block.height])) / block.side, faces)


def make_block(
    comm: Any, surface: Surface, height: float, delta_max: float, size: MeshSize, sides: str = "rollers"
) -> BlockMesh | None:
    """Mesh of a block of any material."""
    problem = Problem(surface, ELASTIC, Schedule(delta_max=delta_max), height, sides, size=size)
    return make.make_block(comm, problem, delta_max)


def make_contact_solver(
    comm: Any, surface: Surface, block: BlockMesh | None, material: Material, **given: Any
) -> ContactSolver:
    """Solver of a block for any load path, of the other arguments of a `Problem`."""
    return make.make_contact_solver(comm, Problem(surface, material, Schedule(delta_max=1e-3), **given), block)


def assembled(solid: Solid) -> Any:
    """Copy of the current tangent of a solid as a PETSc matrix; collective."""
    matrix = NodeMatrix(solid.sparsity, solid.V.dofmap.index_map, solid.comm)
    matrix.assemble(solid.tangent.values())
    return matrix.A


def stored_fields(result: Any, path: Path, E: float = 1.0) -> dict[str, Any] | None:
    """What the file for ParaView holds of a result, one state after the other, on rank 0; None elsewhere."""
    import h5py

    from asperity.output.fields import write_vtkhdf

    write_vtkhdf(path, result, E)
    if result.solver.solid.comm.rank > 0:
        return None
    with h5py.File(path) as file:
        root = file["VTKHDF"]
        arrays = {**root, **root["PointData"], **root["CellData"]}
        return {name: values[:] for name, values in arrays.items() if hasattr(values, "shape")}


def call(*arguments: object) -> int:
    """Exit code of the command line."""
    from asperity.cli import main

    with pytest.raises(SystemExit) as left:
        main([str(argument) for argument in arguments])
    return int(left.value.code or 0)


def files(folder: Path) -> dict[str, bytes]:
    """Content of all files below a folder by their paths in it, without the locks of those who work there."""
    found = (path for path in folder.rglob("*") if path.is_file() and path.name != LOCK)
    return {str(path.relative_to(folder)): path.read_bytes() for path in found}


def assert_same(one: Curve, two: Curve, tolerance: float = 0.0, points: float = 100.0) -> None:
    """Columns agree to a tolerance times their largest value; those of single points to `points` times as much."""
    assert list(one.branch) == list(two.branch)
    whole = ("delta", "force", "area_fraction", "plastic_fraction")
    for name in (*whole, "max_pressure", "max_plastic_strain", "mean_gap", "mean_pressure", "spots", "largest_spot"):
        a, b = getattr(one, name), getattr(two, name)
        atol = tolerance * (1.0 if name in whole else points) * np.nanmax(np.abs(b), initial=0.0)
        np.testing.assert_allclose(a, b, rtol=0, atol=atol, err_msg=name)


def make_curve(**header: object) -> Curve:
    """Return two loading steps, one unloading and one reloading step with awkward numbers."""
    rng = np.random.default_rng(5)
    rows: list[dict[str, Any]] = []
    for step, branch in enumerate(("load", "load", "unload", "reload")):
        numbers = {name: float(rng.uniform() * 10.0 ** rng.integers(-12, 12)) for name in COLUMNS}
        rows.append({**numbers, "step": step, "branch": branch, "newton": 4, "krylov": 37, "spots": 3})
    rows[1]["error_P_star"] = math.nan
    return Curve.from_rows(rows, header)


def leave_figures_blank(patch: pytest.MonkeyPatch) -> None:
    """Write figures without a picture: drawing would take most of the time of a small run."""

    def save(figure: object, path: Path) -> Path:
        path.write_bytes(b"\x89PNG" + bytes(24))
        return path

    patch.setattr("asperity.plot.style.save", save)


@pytest.fixture
def blank_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    """See `leave_figures_blank`."""
    leave_figures_blank(monkeypatch)


RANKS, FAILURE = pytest.StashKey[Ranks](), pytest.StashKey[str]()


def pytest_configure(config: pytest.Config) -> None:
    if (ranks := started_ranks()) is not None and ranks > 1:
        config.stash[RANKS] = Ranks()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Iterator[None]:
    report: Any = yield
    if report.failed:
        item.stash[FAILURE] = f"{item.nodeid}\n{report.longreprtext}"
    return report


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_teardown(item: pytest.Item) -> Iterator[None]:
    """End a test on all ranks at once.

    A test that fails on some ranks only leaves the others waiting for them: its failure is printed, and all are ended.
    """
    if ranks := item.config.stash.get(RANKS, None):
        failure = item.stash.get(FAILURE, "")
        capture = item.config.pluginmanager.getplugin("capturemanager")
        with capture.global_and_fixture_disabled() if failure and capture else nullcontext():
            ranks.leave(int(bool(failure)), failure)
    yield
    if "mpi4py.MPI" in sys.modules:
        from mpi4py import MPI

        # Destructors of PETSc and dolfinx are collective. Objects just freed are young; a full collection after each
        # test would take longer than the tests.
        gc.collect(0)
        MPI.COMM_WORLD.Barrier()


@pytest.fixture
def several_ranks() -> None:
    """Skip what compares all ranks with one where there is one only."""
    if world().size == 1:
        pytest.skip("compares several ranks with one")


@pytest.fixture
def shared_path() -> Iterator[Path]:
    """An empty directory that all ranks see; it is removed after the test."""
    comm = world()
    path = comm.bcast(Path(tempfile.mkdtemp(prefix="asperity-")) if comm.rank == 0 else None)
    yield path
    comm.Barrier()
    if comm.rank == 0:
        shutil.rmtree(path)


@pytest.fixture(scope="session")
def rough() -> Surface:
    """The surface of cases/single.toml, side 1."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return WeierstrassMandelbrot(L=1.0, D=2.4, G=1.36e-5, M=10, gamma=1.5, f_max=5, seed=0)


@pytest.fixture(scope="session")
def wave() -> Surface:
    """A crest in the middle of the patch and valleys in its corners, side 1."""
    return Sinusoid(L=1.0, amplitude=0.05, dims=2)


@pytest.fixture(scope="session")
def cap() -> Surface:
    """A quarter of a large sphere with the summit in a corner, side 1."""
    return Sphere(L=1.0, radius=10.0, centre=(0.0, 0.0), shape="paraboloid")


@pytest.fixture(scope="session")
def cube() -> BlockMesh:
    """A flat block of side and height 1 with four facets on each side."""
    return build_block(Flat(L=1.0), 1.0, lambda x, y, depth: 1.0)


@pytest.fixture(scope="session")
def coarse(rough: Surface) -> BlockMesh | None:
    """The rough block in few cells, on rank 0."""
    size = SizeField.of(rough, 0.03, 0.2, growth=0.5, h_max=0.5)
    return on_root(world(), lambda: build_block(rough, 1.0, size.at))


@pytest.fixture(scope="session")
def coarse_wave(wave: Surface) -> BlockMesh | None:
    """The block with the crest in few cells, on rank 0."""
    size = SizeField.of(wave, 0.02, 0.15, growth=0.6, h_max=0.6)
    return on_root(world(), lambda: build_block(wave, 1.0, size.at))
