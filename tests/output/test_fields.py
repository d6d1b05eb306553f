"""Fields of a run: contents of the file for ParaView, read by h5py and by VTK."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from conftest import stored_fields

from asperity.adaptive.solve_contact import solve_contact
from asperity.arrays import Array
from asperity.errors import OutputError
from asperity.fem.solid import built_nodes, cell_numbers
from asperity.mesh.block import BlockMesh
from asperity.model.material import Material
from asperity.output.fields import gather_top_states, von_mises, write_vtkhdf
from asperity.quasistatic.contact_result import ContactResult
from asperity.surface import Surface

DELTA = 0.02
SOLID = Material(1.0, 0.3, 0.01, 0.05)


@pytest.fixture(scope="module")
def pressed(wave: Surface, coarse_wave: BlockMesh | None) -> ContactResult:
    """A crest pressed with the midpoint rule, whose history is extrapolated beyond the steps."""
    return solve_contact(wave, SOLID, delta_max=DELTA, steps=4, block=coarse_wave, snapshots=2)


@pytest.fixture(scope="module")
def file(pressed: ContactResult, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The file at the path where a run writes it."""
    folder = tmp_path_factory.mktemp("run")
    (folder / "fields").mkdir()
    write_vtkhdf(folder / "fields/contact.vtkhdf", pressed, 1.0)
    top = gather_top_states(pressed, 1.0, 1.0)
    assert top is not None
    np.savez(folder / "fields/top.npz", **top)
    return folder / "fields/contact.vtkhdf"


@pytest.fixture(scope="module")
def stored(pressed: ContactResult, tmp_path_factory: pytest.TempPathFactory) -> list[dict[str, Array]]:
    """Fields of each state in the file."""
    found = stored_fields(pressed, tmp_path_factory.mktemp("stored") / "contact.vtkhdf")
    assert found is not None
    names = ("displacement", "pressure", "stress", "plastic strain")
    return [{name: np.array_split(found[name], 2)[k] for name in names} for k in range(2)]


@pytest.mark.mpi
def test_all_ranks_write_one_file(wave: Surface, coarse_wave: BlockMesh | None, shared_path: Path) -> None:
    """Or none: then all of them know."""
    result = solve_contact(wave, SOLID, delta_max=DELTA, steps=2, block=coarse_wave, snapshots=2)
    whole, found = result.block, stored_fields(result, shared_path / "contact.vtkhdf", 3.0)
    with pytest.raises(OutputError, match="cannot write"):
        write_vtkhdf(shared_path / "none" / "contact.vtkhdf", result, 3.0)
    if whole is None or found is None:
        return
    np.testing.assert_allclose(found["Points"], whole.points, atol=1e-15)
    np.testing.assert_array_equal(np.diff(found["Offsets"]), 10)
    np.testing.assert_array_equal(found["Types"], np.full(len(whole.tets), 24))  # VTK_QUADRATIC_TETRA
    np.testing.assert_array_equal(np.sort(found["Connectivity"].reshape(-1, 10)), np.sort(whole.tets))
    for name, rows in (("displacement", whole.points), ("pressure", whole.points), ("stress", whole.tets)):
        assert len(found[name]) == 2 * len(rows)
    highest = [part.max() for part in np.array_split(found["pressure"], 2)]
    np.testing.assert_allclose(highest, 3.0 * result.curve.max_pressure[[s.step - 1 for s in result.snapshots]])
    last, cells = result.snapshots[-1], len(whole.tets)
    rows = cells + cell_numbers(result.solver.solid)  # of the second state, those of this rank
    np.testing.assert_allclose(found["stress"][rows], 3.0 * last.stress[:, [0, 1, 2, 3, 5, 4]], rtol=1e-14, atol=1e-15)
    numbers, at = built_nodes(result.solver.solid)
    nodes = len(whole.points) + numbers
    np.testing.assert_allclose(found["displacement"][nodes], last.displacement[at], atol=1e-15)
    touched = last.pressure[at] > 0.0  # at corners; those on edges have the mean of their ends
    np.testing.assert_allclose(found["pressure"][nodes][touched], 3.0 * last.pressure[at][touched], rtol=1e-14)
    np.testing.assert_allclose(found["plastic strain"][rows], last.plastic_strain.mean(axis=1), rtol=1e-14)
    np.testing.assert_allclose(found["von Mises stress"], von_mises(found["stress"]), rtol=1e-13)


def test_stress_is_in_balance_with_the_force(pressed: ContactResult) -> None:
    """The integral of the vertical stress is the force times the height it acts at (virtual displacement z e_z)."""
    volumes = pressed.solver.solid.kernels.volumes.sum(axis=1)
    for state in pressed.snapshots:
        force = pressed.curve.force[state.step - 1]
        moment = float(np.sum(volumes * state.stress[:, 2]))
        assert -moment == pytest.approx(force * pressed.solver.summit, rel=DELTA)


def test_stress_of_a_midpoint_step_is_on_the_yield_surface(stored: list[dict[str, Array]]) -> None:
    """If the whole cell yields: at the hardened yield stress of its history, not of the extrapolated one."""
    for state in stored:
        strain = state["plastic strain"]
        flowing = strain > 1e-3
        assert flowing.any()
        bound = SOLID.compiled["yield_stress"] + SOLID.plastic_modulus * strain[flowing]
        ratio = von_mises(state["stress"][flowing]) / bound
        assert np.all(ratio < 1 + 1e-6) and ratio.max() > 0.95  # the norm of a mean is at most the mean of the norms


def test_vtk_reads_every_step(file: Path, pressed: ContactResult, stored: list[dict[str, Array]]) -> None:
    pytest.importorskip("vtk")
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkFiltersVerdict import vtkCellSizeFilter
    from vtkmodules.vtkIOHDF import vtkHDFReader

    block = pressed.block
    assert block is not None
    reader = vtkHDFReader()
    reader.SetFileName(str(file))
    reader.UpdateInformation()
    assert reader.GetNumberOfSteps() == len(stored)
    for k, state in enumerate(stored):
        reader.SetStep(k)
        reader.Update()
        grid = reader.GetOutput()
        assert reader.GetTimeValue() == pressed.snapshots[k].step
        np.testing.assert_array_equal(vtk_to_numpy(grid.GetPoints().GetData()), block.points)
        for data, names in (
            (grid.GetPointData(), ("displacement", "pressure")),
            (grid.GetCellData(), ("stress", "plastic strain")),
        ):
            for name in names:
                np.testing.assert_array_equal(vtk_to_numpy(data.GetArray(name)), state[name])
        sizes = vtkCellSizeFilter()
        sizes.SetInputData(grid)
        sizes.Update()
        # VTK has its own node order of second-order cells; a wrong one would turn them inside out
        volume = vtk_to_numpy(sizes.GetOutput().GetCellData().GetArray("Volume"))
        assert volume.min() > 0 and volume.sum() == pytest.approx(1.0, rel=1e-2)


def test_von_mises_of_known_states() -> None:
    assert von_mises(np.array([2.0, 0, 0, 0, 0, 0])) == pytest.approx(2.0)
    assert von_mises(np.array([0.0, 0, 0, 0, 3.0, 0])) == pytest.approx(3.0 * np.sqrt(3.0))
    assert von_mises(np.array([[5.0, 5, 5, 0, 0, 0]])) == pytest.approx([0.0])


def test_fields_of_the_top_have_the_units_of_the_case(pressed: ContactResult) -> None:
    """A side of 3 and a modulus of 7 multiply lengths and stresses of a unit block; its curve has the approaches."""
    one, other = gather_top_states(pressed, 1.0, 1.0), gather_top_states(pressed, 3.0, 7.0)
    assert one is not None and other is not None
    np.testing.assert_allclose(one["delta"], pressed.curve.delta_star[one["steps"] - 1], rtol=1e-9)
    for name, factor in (("delta", 3.0), ("points", 3.0), ("gap", 3.0), ("pressure", 7.0), ("touched", 1.0)):
        np.testing.assert_allclose(other[name], factor * one[name], rtol=1e-12)
