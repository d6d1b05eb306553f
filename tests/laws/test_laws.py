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
from asperity.laws import definition
from asperity.laws.point import respond
from asperity.mesh.block import BlockMesh
from asperity.output.assumption import Evidence
from asperity.output.assumptions import ledger

E, NU = 200.0, 0.3
MU, BULK = E / (2 * (1 + NU)), E / (3 * (1 - 2 * NU))


def law(function: Callable[..., Any], **parameters: float) -> definition.Law:
    return definition.law_of_function(function, parameters)


def follow(it: definition.Law, path: Any) -> tuple[Floats, dict[str, Floats]]:
    """Stress (m, 3, 3) along strains or deformation gradients (m, 3, 3), each a step, and the state at the end."""
    state, stresses = None, []
    for strain in path:
        answer = respond(it, np.asarray(strain, float)[None], state)
        state = answer.state
        stresses.append(answer.stress[0])
    return np.array(stresses), state or {}


def free_sides(it: definition.Law, axial: float, state: Mapping[str, Floats] | None, near: float) -> Any:
    """Response to an axial strain, or stretch, with sides free of stress; the lateral one is found."""

    def at(lateral: float) -> Any:
        return respond(it, np.diag([lateral, lateral, axial])[None], state)

    return at(brentq(lambda lateral: float(at(lateral).stress[0, 0, 0]), near - 0.05, near + 0.05, xtol=1e-15))


# --- closed forms ---------------------------------------------------------------------------------------------


def test_voce_in_shear() -> None:
    """In one large step 3 mu (g - a) = Y + Q (1 - exp(-b a)), g = gamma/sqrt(3) the equivalent strain."""
    Y, Q, b, gamma = 0.6, 0.4, 40.0, 0.05
    it = law(asp.laws.voce, E=E, nu=NU, yield_strength=Y, saturation=Q, rate=b)

    def strength(a: float) -> float:
        return Y + Q * (1.0 - math.exp(-b * a))

    (shear,), state = follow(it, [[[0, gamma / 2, 0], [gamma / 2, 0, 0], [0, 0, 0]]])
    a = brentq(lambda a: 3 * MU * (gamma / math.sqrt(3.0) - a) - strength(a), 0.0, gamma)
    assert state["accumulated"][0] == pytest.approx(a, rel=1e-12)
    assert shear[0, 1] == pytest.approx(strength(a) / math.sqrt(3.0), rel=1e-12)


def test_neo_hookean_uniaxial_and_confined() -> None:
    it = law(asp.laws.neo_hookean, E=E, nu=NU)
    lam = BULK - 2 / 3 * MU
    for stretch in (0.5, 0.8, 1.3, 2.0):
        P = respond(it, np.diag([1.0, 1.0, stretch])[None]).stress[0]
        assert P[2, 2] == pytest.approx((MU * (stretch**2 - 1) + lam * math.log(stretch)) / stretch, rel=1e-10)
        assert P[0, 0] == pytest.approx(lam * math.log(stretch), rel=1e-10)
    for stretch in (0.8, 1.2):
        answer = free_sides(it, stretch, None, stretch ** (-NU))
        # sides free of stress: mu (b^2 - 1) + lambda ln J = 0, so the axial stress is mu (a^2 - b^2)/a
        b = brentq(lambda b, a=stretch: MU * (b**2 - 1) + lam * math.log(a * b**2), 0.5, 1.5, xtol=1e-15)
        assert answer.stress[0, 2, 2] == pytest.approx(MU * (stretch**2 - b**2) / stretch, rel=1e-10)


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

    @asp.law(state={"plastic_strain": (3, 3), "accumulated": ()}, elastic=asp.laws.without_flow)
    def hidden(strain: Any, state: Any, E: float, nu: float, k: float) -> Any:
        return asp.laws.j2(strain, state, E, nu, k)

    forces = []
    for material in (asp.Material(1.0, NU, 0.005), asp.Material.of_law(hidden, E=1.0, nu=NU, k=0.005)):
        result = asp.solve_contact(rough, material, delta_max=0.012, steps=2, block=coarse)
        problem = asp.Problem.of(rough, material, delta_max=0.012)
        lines = [line for line in ledger(Evidence(result.curve, problem, h=0.05)) if "locking" in line.name]
        forces.append((float(result.curve.force[-1]), len(lines)))
    (relaxed, none), (locked, one) = forces
    assert (none, one) == (0, 1) and lines[0].value == pytest.approx(3.5)
    assert locked > 1.02 * relaxed


def test_a_law_that_takes_no_strength_below_zero_does_not_relax() -> None:
    """It would not flow where a relief exceeds its strength."""

    @asp.law(state={"plastic_strain": (3, 3), "accumulated": ()}, elastic=asp.laws.without_flow)
    def unsigned(strain: Any, state: Any, E: float, nu: float, yield_strength: Any) -> Any:
        return asp.laws.j2(strain, state, E, nu, (yield_strength**2) ** 0.5)

    laws = [asp.Material.of_law(law, E=1.0, nu=NU, yield_strength=0.005) for law in (asp.laws.j2, unsigned)]
    assert [law.relaxes for law in laws] == [True, False]


@pytest.mark.parametrize("rate", [5.0, 40.0, 300.0])
def test_the_strength_after_work_is_that_of_the_law(rate: float) -> None:
    """It says which pressures within a cell relax."""
    voce = asp.Material.of_law("voce", kinematics="small", **VOCE | {"rate": rate})
    assert voce.worked_strength == pytest.approx(0.005 + 0.003 * -math.expm1(-0.2 * rate), rel=1e-3)
    known = asp.Material(200e9, NU, 1e9, 20e9, hardening=0.3)
    assert asp.Material.of_law(known.in_ufl).worked_strength == pytest.approx(known.worked_strength, rel=1e-12)
    assert known.scaled(200e9).worked_strength == pytest.approx(known.worked_strength / 200e9, rel=1e-12)


# --- bad laws -------------------------------------------------------------------------------------------------

GOOD = """import ufl
import asperity as asp


@asp.law(state={"plastic_strain": (3, 3), "accumulated": ()}, elastic=asp.laws.without_flow)
def mine(strain, state, E, nu, yield_strength):
    return asp.laws.j2(strain, state, E, nu, yield_strength)


@asp.law(state={"accumulated": ()})
def silent(strain, state, E, nu):
    return asp.laws.hooke(strain, E, nu), {"accumulated": state.accumulated}


def skew(strain, E, nu):
    return asp.laws.hooke(strain, E, nu) + E * strain[0, 0] * strain[1, 1] * ufl.Identity(3)


"""
STATE = "@asp.law(state={'a': ()})\ndef mine(strain, state, E, nu): return "
BAD = {
    "def mine(strain, E, nu, **more): return strain": "has the arguments",
    "def mine(stress, E): return stress": "has the arguments",
    "def mine(strain, state, E): return strain, {}": "has a state that is not declared",
    "def mine(strain, E, nu, G): return strain": "needs the parameter G",
    "def mine(strain, E, nu, *, alpha): return strain": "has the arguments",
    "LAW ufl.tr(strain)": r"returns the stress of shape \(\), not \(3, 3\)",
    "def mine(F, E, nu): return F": r"returns the energy of shape \(3, 3\)",
    "LAW None": "raises",
    "LAW strain / 0": "raises: ValueError: Division by zero",
    "LAW E * strain + ufl.sqrt(strain[0, 0]) * strain": "not a number at",
    "LAW E * ufl.sqrt(ufl.inner(strain, strain)) * strain": "tangent that is not a number at rest",
    "LAW E * ufl.Identity(3)": "has a modulus of 0 at rest",
    "LAW asp.laws.hooke(strain, E, nu) + E * ufl.Identity(3)": "is stressed at rest",
    "LAW E * strain + ufl.as_matrix([[0, strain[0, 0], 0]] + 2 * [[0] * 3])": "stress that is not symmetric",
    "LAW asp.laws.hooke(strain, -E, nu)": "is not stable at rest",
    "LAW 1e300 * asp.laws.hooke(strain, E, nu)": r"has a modulus of 2.69e\+302 at rest",
    "LAW E * strain[0, 0] * ufl.outer(ufl.unit_vector(0, 3), ufl.unit_vector(0, 3))": "is not stable at rest",
    "import math\nLAW math.sqrt(E) * strain": "raises: TypeError",
    "LAW 1.0": r"returns the stress of shape \(\)",
    "LAW (asp.laws.hooke(strain, E, nu), {})": "raises: TypeError",
    "def mine(F, E, nu): return 0.5 * E * ufl.inner(ufl.sym(F) - ufl.Identity(3), ufl.sym(F))": "with a rotation",
    "LAW asp.laws.hooke(strain, 2.0 * E, nu)": "material.E = 200 is not that of material.law",
    "mine = 3": "is 3, not a function",
    "def other(strain, E, nu): return strain": 'it has no "mine"',
    "raise ValueError('no  good')": "raises when it is run: ValueError: no good",
    "def mine(strain E": "raises when it is run: SyntaxError",
    "import sys\nsys.exit(0)": "raises when it is run: SystemExit",
    "@asp.law(state={'a': (2, 2)})\ndef mine(strain, state, E, nu): return strain, {}": "declares the state",
    "@asp.law(state={'copy': ()})\ndef mine(strain, state, E, nu): return strain, {}": "which is taken",
    "@asp.law(state={'a': ()}, elastic=3)\ndef mine(strain, state, E, nu): return strain, {}": "declares elastic",
    STATE + "asp.laws.hooke(strain, E, nu), {}": "returns the state",
    STATE + "asp.laws.hooke(strain, E, nu)": "raises",
    STATE + "asp.laws.hooke(strain, E, nu), {'a': strain}": r"returns the state a of shape \(3, 3\), not \(\)",
}


def case(law: str = "laws.py:mine", **material: Any) -> dict[str, Any]:
    return {
        "units": "other",
        "surface": {"kind": "sphere", "L": 1.0, "radius": 2.0},
        "material": {"law": law, "E": E, "nu": NU, **material},
        "mesh": {"h_contact": 0.3, "h_max": 0.6},
        "loading": {"delta_max": 0.01, "steps": 2},
    }


def refusal(folder: Path, data: Mapping[str, Any]) -> str:
    with pytest.raises(asp.InputError) as caught:
        asp.Case.from_dict(data, folder=folder).problem()
    text = str(caught.value)
    assert "\n" not in text
    return text


@pytest.mark.parametrize("text", BAD)
def test_bad_laws_are_refused_with_a_sentence(text: str, tmp_path: Path) -> None:
    (tmp_path / "laws.py").write_text(
        "import asperity as asp\nimport ufl\n\n" + text.replace("LAW", "def mine(strain, E, nu): return"),
        encoding="utf-8",
    )
    said = refusal(tmp_path, case())
    assert re.search(BAD[text], said), said


def test_laws_and_settings_that_do_not_fit_are_refused(tmp_path: Path) -> None:
    (tmp_path / "laws.py").write_text(GOOD, encoding="utf-8")
    plastic: dict[str, Any] = {"parameters": {"yield_strength": 1.0}}
    assert asp.Case.from_dict(case(**plastic), folder=tmp_path).problem().material.yield_strength == 1.0

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
    assert 'kinematics = "auto" cannot go with' in said("neo_hookean", kinematics="auto")
    assert "on forms" in said(settings={"solver": {"kernels": "compiled"}}, **plastic)
    assert "of the compiled laws" in said(settings={"contact": {"method": "nitsche"}}, **plastic)
    assert "needs a symmetric tangent" in said("laws.py:skew", settings={"solver": {"linear": "cg"}})
    assert "needs the elastic part" in said("laws.py:silent", settings={"output": {"stiffness": True}})
    assert "need material.law" in refusal(tmp_path, {**case(), "material": {"E": E, "nu": NU, **plastic}})


# --- runs -----------------------------------------------------------------------------------------------------


def test_a_law_of_the_user_in_a_case(tmp_path: Path) -> None:
    """It presses like the compiled one; a resumed run refuses another content of its file."""
    file, out = tmp_path / "laws.py", tmp_path / "out"
    file.write_text(GOOD, encoding="utf-8")
    data = case(parameters={"yield_strength": 1.0})
    first = asp.run(asp.Case.from_dict(data, folder=tmp_path), out)
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
        asp.run(asp.Case.from_dict(data, folder=tmp_path), out, resume=True)
    with pytest.raises(asp.InputError, match="another content of the file"):
        asp.Case.load(out / "case.toml")


def test_a_law_whose_tangent_is_not_symmetric(cube: BlockMesh, rough: asp.Surface, coarse: BlockMesh) -> None:
    """A flat block in closed form; rough contact converges as fast as an elastic one, by the right factorisation."""

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
