"""The same curve on one rank and on all of them: formulations, materials, solvers, and ranks without contact.

Each case is solved by every rank alone (COMM_SELF) and by all together (COMM_WORLD).
"""

from __future__ import annotations

import gc
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import ELASTIC, PLASTIC, assert_same, here, make_contact_solver, stored_fields, world

from asperity.adaptive.solve_contact import solve_contact
from asperity.case import Case
from asperity.curve import Curve
from asperity.job.run_case import run
from asperity.linear.coarse import DENSE
from asperity.mesh.block import BlockMesh
from asperity.mesh.generate import build_block
from asperity.model.material import Material
from asperity.model.settings import Formulation, SolverOptions
from asperity.output.results import Results
from asperity.plot import figures_of
from asperity.quasistatic import measures
from asperity.quasistatic.contact_result import ContactResult
from asperity.runtime.parallel import on_root
from asperity.runtime.run_folder import FIGURES
from asperity.surface import Sinusoid, Surface

pytestmark = [pytest.mark.mpi, pytest.mark.usefixtures("several_ranks")]

DELTA = 0.03
SMALL: dict[str, Any] = {
    "surface": {"kind": "sinusoid", "L": 1e-6, "amplitude": 0.03e-6, "dims": 2},
    "material": {"E": 200e9, "nu": 0.3, "yield_strength": 1e9},
    "mesh": {"h_contact": 0.2e-6, "growth": 0.6, "h_max": 0.6e-6},
    "loading": {"delta_max": 0.01e-6, "steps": 2},
}


def solve_both(surface: Surface, block: BlockMesh | None, material: Material, **settings: Any) -> list[ContactResult]:
    driven = {"delta_max": DELTA} | settings
    return [
        solve_contact(surface, material, block=given, comm=comm, **driven)
        for comm, given in ((here(), world().bcast(block)), (world(), block))
    ]


@pytest.mark.parametrize(
    ("material", "method", "linear", "path"),
    [
        (ELASTIC, "active-set", "lu", {"steps": 4, "unload_steps": 2}),
        (PLASTIC, "active-set", "cg", {"steps": 4, "unload_steps": 2}),
        (PLASTIC, "active-set", "auto", {"force_max": 0.0044, "delta_max": None, "steps": 3, "unload_steps": 2}),
        (ELASTIC, "nitsche", "auto", {"steps": 3}),
        (PLASTIC, "nitsche", "auto", {"steps": 3}),
    ],
)
def test_curve_does_not_depend_on_the_ranks(
    rough: Surface, coarse: BlockMesh | None, material: Material, method: str, linear: str, path: dict[str, Any]
) -> None:
    how = {"options": SolverOptions(linear), "formulation": Formulation(method)}
    one, all_ = solve_both(rough, coarse, material, **path, **how)
    assert_same(all_.curve, one.curve, 1e-8)
    assert (all_.dofs, all_.cells) == (one.dofs, one.cells)
    assert all_.curve.force.max() > 0
    assert not all_.checks.violated


def test_leakage_does_not_depend_on_the_ranks(rough: Surface, coarse: BlockMesh | None) -> None:
    one, all_ = (result.curve for result in solve_both(rough, coarse, ELASTIC, steps=2, flow=True))
    for name in ("transmissivity_x", "transmissivity_y", "hydraulic_aperture"):
        assert np.all(getattr(one, name) > 0.0)
        np.testing.assert_allclose(getattr(all_, name), getattr(one, name), rtol=1e-7)


@pytest.mark.parametrize("method", ["active-set", "nitsche"])
def test_ranks_without_top_facets(method: str) -> None:
    """A tower: the partitioner cuts it across, so only one of two ranks has a top."""
    surface = Sinusoid(L=1.0, amplitude=0.05, dims=2)
    alone, together = here(), world()
    block = on_root(together, lambda: build_block(surface, 6.0, lambda x, y, depth: 0.5))
    one, all_ = (
        make_contact_solver(comm, surface, given, PLASTIC, formulation=Formulation(method))
        for comm, given in ((alone, together.bcast(block)), (together, block))
    )
    facets = together.allgather(len(all_.contact_surface.nodes))
    assert sum(facets) == len(one.contact_surface.nodes)
    assert min(facets) == 0
    for delta in (0.01, 0.03):
        for solver in (one, all_):
            assert solver.step(delta).converged
        assert all_.force == pytest.approx(one.force, rel=1e-8)
    assert measures.row(all_) == pytest.approx(measures.row(one), rel=1e-6)


def test_fields_are_numbered_like_the_mesh_on_any_ranks(
    rough: Surface, coarse: BlockMesh | None, shared_path: Path
) -> None:
    """Snapshots gathered from all ranks against those of one."""
    one, all_ = solve_both(rough, coarse, PLASTIC, steps=2, snapshots=2)
    for a, b in zip(all_.snapshots, one.snapshots, strict=True):
        assert (a.step, a.branch, a.delta) == (b.step, b.branch, pytest.approx(b.delta))
    together = stored_fields(all_, shared_path / "together.vtkhdf")
    alone = stored_fields(one, shared_path / f"alone{world().rank}.vtkhdf")
    assert alone is not None
    if together is not None:
        tolerances = {"Points": 1e-15, "displacement": 1e-8 * DELTA}
        for name in ("Points", "displacement", "pressure", "stress", "plastic strain"):
            atol = tolerances.get(name, 1e-6 * np.abs(alone[name]).max())
            np.testing.assert_allclose(together[name], alone[name], rtol=0, atol=atol, err_msg=name)


@pytest.mark.usefixtures("blank_figures")
def test_a_run_writes_one_set_of_files(shared_path: Path) -> None:
    output = {"fields": True, "figures": True, "report": True, "snapshots": 2}
    case = Case.from_dict(SMALL | {"dynamics": {"model": ["exact"]}, "output": output})
    alone, together = here(), world()
    folder = shared_path / "together"
    result = run(case, folder, comm=together)
    expected = run(case, comm=alone)
    assert_same(result.curve, expected.curve, 1e-8)
    together.Barrier()
    np.testing.assert_array_equal(Curve.read(folder / "curve.csv").force, result.curve.force)
    assert result.summary["ranks"] == together.size
    assert {path.name for path in folder.iterdir()} >= {"case.toml", "curve.csv", "summary.json", "fields"}
    drawn = {path.stem for path in (folder / FIGURES).glob("*.*")}
    assert drawn == {*figures_of(Results.read(folder))} >= {"frequency", "response", "curve", "pressure"}


def test_no_rank_but_the_first_holds_an_array_of_the_mesh(rough: Surface, coarse: BlockMesh | None) -> None:
    """Nodes, dofs, cells, or facets of the top; the dense matrix of the interface is bounded by the share of a rank."""
    result = solve_contact(rough, PLASTIC, block=coarse, delta_max=DELTA, steps=1, snapshots=1, comm=world())
    solid, top, comm = result.solver.solid, result.solver.contact_surface, world()
    facets = comm.allreduce(len(top.nodes))
    whole = {result.dofs, result.dofs // 3, result.cells, facets} - {3 * solid.nodes, solid.nodes, len(top.nodes)}
    referred = (found for each in gc.get_objects() for found in gc.get_referents(each))
    # the class of a dead proxy cannot be asked for
    shapes = [array.shape for array in referred if issubclass(type(array), np.ndarray) and array.ndim]
    assert len(shapes) > 100
    assert comm.rank == 0 or not [shape for shape in shapes if shape[0] in whole]
    multigrid: Any = result.solver.newton.linear.multigrid
    dense = multigrid._coarse._schur
    assert len(dense) > 0 and dense.nbytes <= 4 * DENSE * result.dofs / comm.size
