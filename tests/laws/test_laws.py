"""Laws in UFL: closed forms at a point, bad laws, and laws of the user in a case."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import ufl
from element_sample import difference, sample
from scipy.optimize import brentq

import asperity as asp
from asperity.arrays import Floats
from asperity.fem.law_check import OneCell, check_law
from asperity.laws import definition
from asperity.mesh.block import BlockMesh
from asperity.output.assumptions import Evidence, assumptions_of

E, NU = 200.0, 0.3
MU, BULK = E / (2 * (1 + NU)), E / (3 * (1 - 2 * NU))


def law(function: Callable[..., Any], **parameters: float) -> definition.Law:
    return definition.law_of_function(function, parameters)


def follow(it: definition.Law, path: Any) -> tuple[Floats, Floats]:
    """Stress (m, 3, 3) along strains or deformation gradients (m, 3, 3), each a step, and the state at the end."""
    cell, state, stresses = OneCell(it), None, []
    for strain in path:
        answer = cell(np.asarray(strain, float), state)
        state = answer.state
        stresses.append(answer.stress)
    return np.array(stresses), np.array(state)


def free_sides(it: definition.Law, axial: float, near: float) -> Any:
    """Response to an axial strain, or stretch, with sides free of stress; the lateral one is found."""
    cell = OneCell(it)

    def at(lateral: float) -> Any:
        return cell(np.diag([lateral, lateral, axial]))

    return at(brentq(lambda lateral: float(at(lateral).stress[0, 0]), near - 0.05, near + 0.05, xtol=1e-15))


# --- closed forms ---------------------------------------------------------------------------------------------


def test_voce_in_shear() -> None:
    """In one large step 3 mu (g - a) = Y + Q (1 - exp(-b a)), g = gamma/sqrt(3) the equivalent strain."""
    Y, Q, b, gamma = 0.6, 0.4, 40.0, 0.05
    it = law(asp.laws.voce, E=E, nu=NU, yield_strength=Y, saturation=Q, rate=b)

    def strength(a: float) -> float:
        return Y + Q * (1.0 - math.exp(-b * a))

    (shear,), state = follow(it, [[[0, gamma / 2, 0], [gamma / 2, 0, 0], [0, 0, 0]]])
    a = brentq(lambda a: 3 * MU * (gamma / math.sqrt(3.0) - a) - strength(a), 0.0, gamma)
    assert state[6] == pytest.approx(a, rel=1e-12)  # after the plastic strain
    assert shear[0, 1] == pytest.approx(strength(a) / math.sqrt(3.0), rel=1e-12)


def test_neo_hookean_uniaxial_and_confined() -> None:
    it = law(asp.laws.neo_hookean, E=E, nu=NU)
    lam = BULK - 2 / 3 * MU
    for stretch in (0.5, 0.8, 1.3, 2.0):
        P = OneCell(it)(np.diag([1.0, 1.0, stretch])).stress
        assert P[2, 2] == pytest.approx((MU * (stretch**2 - 1) + lam * math.log(stretch)) / stretch, rel=1e-10)
        assert P[0, 0] == pytest.approx(lam * math.log(stretch), rel=1e-10)
    for stretch in (0.8, 1.2):
        answer = free_sides(it, stretch, stretch ** (-NU))
        # sides free of stress: mu (b^2 - 1) + lambda ln J = 0, so the axial stress is mu (a^2 - b^2)/a
        b = brentq(lambda b, a=stretch: MU * (b**2 - 1) + lam * math.log(a * b**2), 0.5, 1.5, xtol=1e-15)
        assert answer.stress[2, 2] == pytest.approx(MU * (stretch**2 - b**2) / stretch, rel=1e-10)


# --- cells ----------------------------------------------------------------------------------------------------

VOCE = {"E": 1.0, "nu": NU, "yield_strength": 0.005, "saturation": 0.003, "rate": 40.0}


@pytest.mark.parametrize("kinematics", ["small", pytest.param("finite", marks=pytest.mark.slow)])
def test_cells_of_voce(cube: BlockMesh, coarse: BlockMesh, kinematics: str) -> None:
    """Tension and back in closed form; the tangent of cells whose volumetric strains relax, by differences."""
    material = asp.Material.of_law("voce", kinematics=kinematics, **VOCE)
    strains, a, expected = np.array([0.002, 0.01, 0.1, 0.09]), [0.0], []

    def excess(a: float, strain: float) -> float:
        return strain - a - 0.005 - 0.003 * (1.0 - math.exp(-40.0 * a))

    for strain in strains:
        a.append(brentq(excess, a[-1], strain, args=(strain,)) if excess(a[-1], strain) > 0.0 else a[-1])
        expected.append(strain - a[-1])
    lateral = -NU * np.array(expected) - 0.5 * np.array(a[1:])
    finite = kinematics == "finite"
    ends = [np.diag([s, s, e]) for s, e in zip(lateral, strains, strict=True)]
    gradients = [np.diag(np.expm1(np.diag(e))) for e in ends] if finite else ends
    stress, accumulated = sample(cube, material, forms=True).follow(gradients)
    volume = np.exp([np.trace(e) for e in ends]) if finite else 1.0
    np.testing.assert_allclose(stress[:, 2, 2] * volume, expected, rtol=1e-9)
    np.testing.assert_allclose(accumulated, a[1:], rtol=1e-9)

    it, rng = sample(coarse, material, forms=True), np.random.default_rng(3)
    u, step = (scale * rng.normal(size=it.solid.points.shape) for scale in (1e-4, 1e-9))
    it.bring([u], 1.5 * u)
    it.kernels.commit()
    u = 2.0 * u + it.affine(np.diag([0.005, 0.005, -0.01]))
    below, above = (it.force(u + sign * step) for sign in (-1, 1))
    it.force(u)
    K = it.tangent(u)
    assert len(it.kernels._cell.flowing) > 0.5 * len(it.solid.cell_nodes)
    assert difference((above - below).ravel() / 2, K @ step.ravel()) < 1e-5
    assert difference(K.T.toarray(), K.toarray()) < 1e-12


def test_locking_is_doubted_where_a_law_hides_its_strength(coarse: BlockMesh, rough: asp.Surface) -> None:
    """The same law by another name of its parameter: points keep their volume, and the force is too large."""

    @asp.law(**FLOW, state_is_strain=True)
    def hidden(strain: Any, state: Any, E: float, nu: float, k: float) -> Any:
        return asp.laws.j2(strain, state, E, nu, k)

    forces = []
    for material in (asp.Material(1.0, NU, 0.005), asp.Material.of_law(hidden, E=1.0, nu=NU, k=0.005)):
        result = asp.solve_contact(rough, material, delta_max=0.012, steps=2, block=coarse)
        problem = asp.Problem.of(rough, material, delta_max=0.012)
        whole = assumptions_of(Evidence(result.curve, problem, h=0.05))
        yields = any("at which it yields" in line.name for line in whole)
        assert yields == (material.yield_strength is not None)
        lines = [line for line in whole if "locking" in line.name]
        forces.append((float(result.curve.force[-1]), len(lines)))
    (relaxed, none), (locked, one) = forces
    assert (none, one) == (0, 1) and lines[0].value == pytest.approx(3.5)
    assert locked > 1.02 * relaxed


FLOW: dict[str, Any] = {
    "state": {"plastic_strain": (3, 3), "accumulated": ()},
    "elastic": asp.laws.without_flow,
    "symmetric": True,
}


@pytest.mark.parametrize("wrong", ["unsigned", "too strong", "stiffens"])
def test_a_strength_that_is_not_that_of_the_flow_is_refused(wrong: str) -> None:
    """The anti-locking correction would take the wrong one: below zero, after work, or with another bulk modulus."""

    def strength(a: float, yield_strength: float) -> float:
        return yield_strength + (0.01 * a if wrong == "too strong" else 0.0)

    @asp.law(**FLOW | {"elastic": None}, strength=strength)
    def mine(strain: Any, state: Any, E: float, nu: float, yield_strength: Any) -> Any:
        strength = (yield_strength**2) ** 0.5 if wrong == "unsigned" else yield_strength
        stress, after = asp.laws.j2(strain, state, E, nu, strength)
        return stress + (wrong == "stiffens") * E * ufl.tr(strain) ** 2 * ufl.Identity(3), after

    with pytest.raises(asp.InputError, match="declares strength"):
        check_law(law(mine, E=1.0, nu=NU, yield_strength=0.005))
    check_law(law(asp.laws.j2, E=1.0, nu=NU, yield_strength=0.005, tangent_modulus=0.1, kinematic_share=0.4))


@pytest.mark.parametrize("rate", [5.0, 40.0, 300.0])
def test_the_strength_after_work_is_that_of_the_law(rate: float) -> None:
    """It says which pressures within a cell relax."""
    voce = asp.Material.of_law("voce", kinematics="small", **VOCE | {"rate": rate})
    assert voce.worked_strength == pytest.approx(0.005 + 0.003 * -math.expm1(-0.2 * rate), rel=1e-3)
    known = asp.Material(200e9, NU, 1e9, 20e9, hardening=0.3)
    assert asp.Material.of_law(known.in_ufl).worked_strength == pytest.approx(known.worked_strength, rel=1e-12)
    assert known.scaled(200e9).worked_strength == pytest.approx(known.worked_strength / 200e9, rel=1e-12)


# --- bad laws -------------------------------------------------------------------------------------------------

GOOD = """import asperity as asp


@asp.law(
    state={"plastic_strain": (3, 3), "accumulated": ()}, elastic=asp.laws.without_flow, symmetric=True,
    state_is_strain=True, strength=lambda a, yield_strength: yield_strength,
)
def mine(strain, state, E, nu, yield_strength):
    return asp.laws.j2(strain, state, E, nu, yield_strength)


@asp.law(state={"accumulated": ()})
def silent(strain, state, E, nu):
    return asp.laws.hooke(strain, E, nu), {"accumulated": state.accumulated}


@asp.law
def bare(strain, E, nu):
    return asp.laws.hooke(strain, E, nu)


"""
STATE = "@asp.law(state={'a': ()})\ndef mine(strain, state, E, nu): return "
SKEW = "ufl.as_matrix([[0, 1, 0], [0, 0, 0], [0, 0, 0]])"
#: Text of a file, and what its refusal says.
BAD = {
    "def mine(strain, E, nu, **more): return strain": "has the arguments",
    "def mine(stress, E): return stress": "has the arguments",
    "def mine(strain, state, E): return strain, {}": "has a state that is not declared",
    "def mine(strain, E, nu, G): return strain": "needs the parameter G",
    "LAW ufl.tr(strain)": r"returns the stress of shape \(\), not \(3, 3\)",
    "def mine(F, E, nu): return F": r"returns the energy of shape \(3, 3\)",
    "LAW None": "raises",
    "LAW E * strain + ufl.sqrt(strain[0, 0]) * strain": "not a number",
    "LAW asp.laws.hooke(strain, E, nu) * ufl.sqrt(1.0 + 1e3 * strain[0, 0])": r"stress that .* at a strain of 0\.0",
    "LAW E * ufl.sqrt(ufl.inner(strain, strain)) * strain": "tangent that is not a number at rest",
    "LAW E * ufl.Identity(3)": "has a modulus of 0 at rest",
    "LAW asp.laws.hooke(strain, E, nu) + E * ufl.Identity(3)": "is stressed at rest",
    f"LAW E * strain + E * strain[0, 0] * {SKEW}": "stress that is not symmetric",
    f"LAW asp.laws.hooke(strain, E, nu) + E * ufl.max_value(-strain[2, 2] - 0.03, 0.0) * {SKEW}":
        r"stress that is not symmetric at a strain of 0\.0[3-9]",
    "@asp.law(symmetric=True)\nLAW asp.laws.hooke(strain, E, nu) + E * ufl.max_value(-strain[2, 2] - 0.03, 0.0) * "
    "strain[0, 0] * ufl.Identity(3)": r"tangent that is not symmetric at a strain of 0\.",
    "LAW asp.laws.hooke(strain, -E, nu)": "is not stable at rest",
    "LAW 1e300 * asp.laws.hooke(strain, E, nu)": r"has a modulus of 2.69e\+302 at rest",
    "LAW E * strain[0, 0] * ufl.outer(ufl.unit_vector(0, 3), ufl.unit_vector(0, 3))": "is not stable at rest",
    "import math\nLAW math.sqrt(strain[0, 0]) * strain": "raises: ",
    "LAW (asp.laws.hooke(strain, E, nu), {})": "raises: ",
    "def mine(F, E, nu): return 0.5 * E * ufl.inner(ufl.sym(F) - ufl.Identity(3), ufl.sym(F) - "
    "ufl.Identity(3))": "with a rotation",
    "LAW asp.laws.hooke(strain, 2.0 * E, nu)": "has E = 400 at rest and declares 200",
    "LAW asp.laws.hooke(strain, E, 0.5 * nu)": "has nu = 0.15 at rest and declares 0.3",
    "@asp.law(E=lambda E: 2.0 * E)\nLAW asp.laws.hooke(strain, 2.0 * E, nu)": "material.E = 200 is not that of",
    "@asp.law(E=lambda G: 2.0 * G)\nLAW strain": "declares E, which is no function of some of its parameters",
    "@asp.law(E='steel')\nLAW strain": "declares E, which is no function",
    "@asp.law(moduli=3.0)\nLAW strain": 'declares "moduli": a law declares state',
    "def mine(strain, K): return K * strain": "does not say E and nu at rest",
    "mine = 3": "is 3, not a function",
    "def other(strain, E, nu): return strain": 'it has no "mine"',
    "raise ValueError('no  good')": "raises when it is run: ValueError: no good",
    "def mine(strain E": "raises when it is run: SyntaxError",
    "import sys\nsys.exit(0)": "raises when it is run: SystemExit",
    "@asp.law(state=3)\nLAW strain": "declares the state 3",
    "@asp.law(state={'a': (2, 2)})\ndef mine(strain, state, E, nu): return strain, {}": "declares the state",
    "@asp.law(state={'copy': ()})\ndef mine(strain, state, E, nu): return strain, {}": "which is taken",
    "@asp.law(state={'a': ()}, elastic=3)\ndef mine(strain, state, E, nu): return strain, {}": "declares elastic",
    "@asp.law(strength=lambda a, E: E)\nLAW strain": "needs the parameter yield_strength",
    STATE + "asp.laws.hooke(strain, E, nu), {}": "returns the state",
    STATE + "asp.laws.hooke(strain, E, nu)": "raises",
    STATE + "asp.laws.hooke(strain, E, nu), {'a': strain}": r"returns the state a of shape \(3, 3\), not \(\)",
    STATE + "asp.laws.hooke(strain, E, nu), {'a': state.a + 1.0}": "changes its state when it is applied a second time",
    STATE + "asp.laws.hooke(strain, E, nu), {'a': state.a + 0.1 * (ufl.tr(strain) - state.a)}": "changes its state",
    "@asp.law(state={'a': ()}, elastic=lambda strain, state, E, nu: asp.laws.hooke(strain, 2 * E, nu))\n"
    "def mine(strain, state, E, nu): return asp.laws.hooke(strain, E, nu), {'a': state.a}": "declares elastic",
}  # fmt: skip


def case(law: str = "laws.py:mine", **material: Any) -> dict[str, Any]:
    return {
        "units": "other",
        "surface": {"kind": "sphere", "L": 1.0, "radius": 2.0},
        "material": {"law": law, "E": E, "nu": NU, **material},
        "mesh": {"h_contact": 0.3, "h_max": 0.6},
        "loading": {"delta_max": 0.01, "steps": 2},
    }


def refusal(folder: Path, data: Mapping[str, Any]) -> str:
    """Sentence with which a run refuses a case, before it makes a mesh of the surface."""
    with pytest.raises(asp.InputError) as caught:
        law = asp.Case.from_dict(data, folder=folder).problem(allow_code=True).material.law
        assert law is not None
        check_law(law)
    text = str(caught.value)
    assert "\n" not in text
    return text


@pytest.mark.parametrize("text", BAD)
def test_bad_laws_are_refused_with_a_sentence(text: str, tmp_path: Path) -> None:
    (tmp_path / "laws.py").write_text(
        "import asperity as asp\nimport ufl\n\n" + text.replace("LAW", "def mine(strain, E, nu): return"),
        encoding="utf-8",
    )
    parameters: dict[str, Any] = {"parameters": {"K": 1.0}} if "K" in text else {}
    said = refusal(tmp_path, case(**parameters))
    assert re.search(BAD[text], said), said


def test_laws_and_settings_that_do_not_fit_are_refused(tmp_path: Path) -> None:
    (tmp_path / "laws.py").write_text(GOOD, encoding="utf-8")
    plastic: dict[str, Any] = {"parameters": {"yield_strength": 1.0}}
    assert asp.Case.from_dict(case(**plastic), folder=tmp_path).problem(allow_code=True).material.yield_strength == 1.0

    def said(law: str = "laws.py:mine", settings: Mapping[str, Any] | None = None, **material: Any) -> str:
        return refusal(tmp_path, {**case(law, **material), **(settings or {})})

    assert "needs the parameter yield_strength" in said()
    assert 'has no parameter "colour"' in said(parameters={"yield_strength": 1.0, "colour": 3.0})
    assert 'material.parameters = "hard" must be a table' in said(parameters="hard")
    assert "must be a number" in said(parameters={"yield_strength": "hard"})
    assert "there is no such file" in said("other.py:mine")
    assert "is not one of hooke, j2" in said("mine")
    assert 'material.law = "laws.py:mine"' in said()
    assert "cannot go with material.law, which has none" in said(**plastic, tangent_modulus=3.0)
    assert "cannot go with material.law, which has none" in said(**plastic, hardening="kinematic")
    assert "is of another content" in said(**plastic, law_sha256="abc")
    assert "tangent_modulus = -0.2 is out of range" in said(
        "j2", parameters={"yield_strength": 1.0, "tangent_modulus": -0.2}
    )
    assert 'kinematics = "auto" cannot go with' in said("neo_hookean", kinematics="auto")
    assert "on forms" in said(settings={"solver": {"kernels": "compiled"}}, **plastic)
    assert "of the compiled laws" in said(settings={"contact": {"method": "nitsche"}}, **plastic)
    assert "needs a symmetric tangent" in said("laws.py:bare", settings={"solver": {"linear": "cg"}})
    assert "needs the elastic part" in said("laws.py:silent", settings={"output": {"stiffness": True}})
    integrated = case()["loading"] | {"integrator": "midpoint"}
    assert "would extrapolate" in said("laws.py:silent", settings={"loading": integrated})
    assert "need material.law" in refusal(tmp_path, {**case(), "material": {"E": E, "nu": NU, **plastic}})


def test_a_law_that_loses_its_stress_is_named_with_the_strain() -> None:
    """The curve before is kept; the strain is that of the limit in the law."""

    @asp.law
    def lost(strain: Any, E: float, nu: float) -> Any:
        square = ufl.inner(strain, strain)
        return asp.laws.hooke(strain, E, nu) * ufl.conditional(ufl.gt(square, 0.04**2), ufl.sqrt(-square), 1.0)

    sphere, material = asp.Surface.from_spec("sphere", L=1.0, radius=2.0), asp.Material.of_law(lost, E=1.0, nu=NU)
    with pytest.raises(asp.ConvergenceError) as caught:
        asp.solve_contact(sphere, material, delta_max=0.03, steps=4, size=asp.MeshSize(h_contact=0.4, h_max=0.5))
    found = re.search(
        'delta/L = .* is kept: material.law = "lost" gives a stress that is not a number at a strain of ([0-9.]+); the '
        "greatest strain of the step is ([0-9.]+)", str(caught.value),
    )  # fmt: skip
    assert found is not None and 0.02 < float(found[1]) <= 0.041 and float(found[2]) >= float(found[1])
    assert len(caught.value.result.curve) >= 1


# --- runs -----------------------------------------------------------------------------------------------------


def test_a_law_of_the_user_in_a_case(tmp_path: Path) -> None:
    """It presses like the compiled one; a resumed run refuses another content of its file."""
    file, out = tmp_path / "laws.py", tmp_path / "out"
    file.write_text(GOOD, encoding="utf-8")
    data = case(parameters={"yield_strength": 1.0})
    first = asp.run(asp.Case.from_dict(data, folder=tmp_path), out, allow_code=True)
    compiled = {**data, "material": {"E": E, "nu": NU, "yield_strength": 1.0}}
    theirs = asp.run(asp.Case.from_dict(compiled)).curve
    np.testing.assert_allclose(first.curve.force, theirs.force, rtol=1e-8)
    np.testing.assert_allclose(first.curve.max_strain, theirs.max_strain, rtol=1e-6)
    np.testing.assert_allclose(first.curve.plastic_fraction, theirs.plastic_fraction, rtol=1e-6)
    assert first.summary["law"]["source"].endswith("laws.py:mine")
    digest = first.summary["law"]["sha256"]
    assert f'law_sha256 = "{digest}"' in (out / "case.toml").read_text(encoding="utf-8")
    assert asp.Case.load(out / "case.toml").hash() == first.summary["case_hash"]
    file.write_text(GOOD + "# another\n", encoding="utf-8")
    with pytest.raises(asp.CheckpointError, match="law_sha256"):
        asp.run(asp.Case.from_dict(data, folder=tmp_path), out, resume=True, allow_code=True)
    with pytest.raises(asp.InputError, match="another content of its file"):
        asp.run(out / "case.toml", tmp_path / "again", allow_code=True)


def damaged(strain: Any, before: Any, E: float, nu: float) -> tuple[Any, Any]:
    """Stress and damage, which grows with the equivalent strain and saturates."""
    equivalent = ufl.sqrt(2.0 / 3.0 * ufl.inner(ufl.dev(strain), ufl.dev(strain)) + 1e-20)
    d = ufl.max_value(before, ufl.min_value(0.4, ufl.max_value(equivalent - 1e-3, 0.0) / 0.03))
    return (1.0 - d) * asp.laws.hooke(strain, E, nu), d


@asp.law(state={"damage": ()})
def damage(strain: Any, state: Any, E: float, nu: float) -> Any:
    stress, d = damaged(strain, state.damage, E, nu)
    return stress, {"damage": d}


@asp.law
def without_memory(strain: Any, E: float, nu: float) -> Any:
    return damaged(strain, 0.0, E, nu)[0]


def test_a_state_that_saturates_has_the_force_of_a_solid_without_memory() -> None:
    """While all strains grow, in any number of steps; the midpoint rule would carry the damage beyond its limit."""
    sphere = asp.Surface.from_spec("sphere", L=1.0, radius=2.0)

    def force(law: Any, steps: int) -> float:
        solid, size = asp.Material.of_law(law, E=1.0, nu=NU), asp.MeshSize(h_contact=0.4, h_max=0.5)
        assert solid.integrator == "backward-euler"
        return float(asp.solve_contact(sphere, solid, delta_max=0.02, steps=steps, size=size).curve.force[-1])

    expected = force(without_memory, 1)
    for steps in (2, 6):
        assert force(damage, steps) == pytest.approx(expected, rel=1e-7)


@pytest.mark.slow
def test_the_bar_of_a_law_of_the_user_holds_many_steps_on_a_finer_mesh() -> None:
    sphere, solid = asp.Surface.from_spec("sphere", L=1.0, radius=2.0), asp.Material.of_law(damage, E=1.0, nu=NU)
    found = asp.solve_contact(sphere, solid, delta_max=0.006, steps=4, tolerance=0.05)
    assert found.met and {level.substeps for level in found.levels} >= {1, 2, 4}  # three measure the order
    finer = asp.solve_contact(sphere, solid, delta_max=0.006, steps=16, size=asp.MeshSize(h_contact=0.05)).curve
    errors = found.curve.P_star / np.interp(found.curve.delta, finer.delta, finer.P_star) - 1.0
    assert (np.abs(errors) < found.curve.error_P_star / found.curve.P_star).all()


def test_a_law_whose_tangent_is_not_symmetric(cube: BlockMesh, rough: asp.Surface, coarse: BlockMesh) -> None:
    """A flat block in closed form; rough contact converges as fast as an elastic one, by the right factorisation."""

    @asp.law
    def skew(strain: Any, E: float, nu: float, c: float) -> Any:
        axial = ufl.unit_vector(2, 3)
        return asp.laws.hooke(strain, E, nu) + c * (strain[0, 0] + strain[2, 2]) * ufl.outer(axial, axial)

    material = asp.Material.of_law(skew, E=1.0, nu=NU, c=0.2)
    assert not material.symmetric
    flat = asp.solve_contact(asp.Surface.from_spec("flat", L=1.0), material, delta_max=0.01, steps=1, block=cube)
    modulus = asp.Material(1.0, NU).confined_modulus + 0.2
    assert flat.curve.force[-1] == pytest.approx(0.01 * modulus, rel=1e-8)
    found = [
        asp.solve_contact(rough, m, delta_max=0.012, steps=2, block=coarse) for m in (material, asp.Material(1.0, NU))
    ]
    assert found[0].checks.violated == {} and found[0].counts.newton <= found[1].counts.newton + 2
    assert 1.02 < found[0].curve.force[-1] / found[1].curve.force[-1] < 1.3


@pytest.mark.slow
def test_voce_flattens_a_sphere_between_two_bilinear_solids() -> None:
    """Its strength lies between its first one and its last one."""
    sphere = asp.Surface.from_spec("sphere", L=1.0, radius=2.0)
    size = asp.MeshSize(h_contact=0.12, h_max=0.4)

    def force(material: asp.Material) -> float:
        return float(asp.solve_contact(sphere, material, delta_max=0.02, steps=6, size=size).curve.force[-1])

    voce = asp.Material.of_law(asp.laws.voce, E=E, nu=NU, yield_strength=0.6, saturation=0.6, rate=50.0)
    soft, hard = (force(asp.Material(E, NU, strength)) for strength in (0.6, 1.2))
    assert soft * 1.05 < force(voce) < hard * 0.98


@pytest.mark.slow
def test_a_rubber_wave_is_pressed_flat() -> None:
    """In full contact, at the small strains of a flat wave, like Hencky's solid; no pull, no gap."""
    wave = asp.Surface.from_spec("sinusoid", L=1.0, amplitude=0.004, dims=1)
    settings: dict[str, Any] = {
        "delta_max": 0.0089,
        "steps": 3,
        "sides": "periodic",
        "size": asp.MeshSize(h_contact=0.2, h_max=0.2),
    }
    found = []
    for solid in (asp.Material.of_law("neo_hookean", E=1.0, nu=0.45), asp.Material(1.0, 0.45, kinematics="finite")):
        with pytest.warns(asp.AsperityWarning):
            found.append(asp.solve_contact(wave, solid, **settings))
    assert found[0].checks.violated == {} and found[0].checks.energy_excess == 0.0
    np.testing.assert_allclose(found[0].checks.peak, found[1].checks.peak, rtol=5e-3)
    rubber, hencky = (each.curve for each in found)
    assert rubber.area_fraction[-1] == pytest.approx(1.0) and abs(rubber.mean_gap[-1]) < 1e-12
    np.testing.assert_allclose(rubber.force, hencky.force, rtol=5e-3)


@pytest.mark.slow
def test_the_bar_of_a_rough_surface_with_voce_holds_a_finer_mesh() -> None:
    surface = asp.Surface.from_spec(
        "self-affine", L=1.0, H=0.8, rms_slope=0.08, lambda_short=0.25, lambda_roll=0.5, seed=2
    )
    voce = asp.Material.of_law("voce", E=E, nu=NU, yield_strength=0.6, saturation=0.4, rate=40.0)
    curve = asp.solve_contact(surface, voce, delta_max=0.012, steps=4, tolerance=0.05).curve
    bar = float(curve.error_P_star[-1] / curve.P_star[-1])
    finer = asp.solve_contact(surface, voce, delta_max=0.012, steps=12, size=asp.MeshSize(h_contact=0.05)).curve
    print(f"{curve.force[-1]:.5f} with a bar of {bar:.2%}, on a finer mesh {finer.force[-1]:.5f}")
    assert bar < 0.05 and abs(curve.force[-1] / finer.force[-1] - 1.0) < bar
