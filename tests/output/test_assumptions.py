"""Warnings of a run about the limits of its model: limits in closed form, each warning once in every file."""

from __future__ import annotations

import json
import logging
import warnings
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
from conftest import here, leave_figures_blank, world

from asperity.adaptive.solve_contact import solve_contact
from asperity.case import Case
from asperity.curve import Curve
from asperity.errors import AsperityWarning, AssumptionWarning, ResolutionWarning, warn
from asperity.job.run_case import run
from asperity.laws import neo_hookean
from asperity.model.material import Material
from asperity.model.problem import Problem
from asperity.model.settings import MeshSize
from asperity.output.assumptions import DOUBTFUL, FINE, SMALL_STRAIN, Evidence, assumptions_of, describe
from asperity.quasistatic.solve_problem import solve_problem
from asperity.reference import Hertz
from asperity.runtime.progress import logged
from asperity.surface import Flat, Sinusoid, Sphere, Surface
from asperity.surface.scans import HeightField
from asperity.vibration.oscillator import Numbers

pytestmark = pytest.mark.usefixtures("blank_figures")

STEEL = Material(200e9, 0.3, 1e9, 10e9)
WAVE = Sinusoid(L=1e-6, amplitude=1e-8)
ALUMINIUM = {"E": 1.0, "nu": 0.3, "yield_strength": 0.003, "tangent_modulus": 0.05}
YIELDING: dict[str, Any] = {
    "units": "other",
    "surface": {"kind": "sinusoid", "L": 1.0, "amplitude": 0.01},
    "material": ALUMINIUM,
    "mesh": {"h_contact": 0.4, "h_max": 1.0, "growth": 1.0},
    "loading": {"delta_max": 0.015, "steps": 3, "unload": True, "unload_steps": 1},
    "contact": {"gamma": 3.0},
}


def curve(**columns: float) -> Curve:
    """A light step, and one with the given values."""
    return Curve.from_rows([{"delta": 1e-9, "force": 1e-9}, {"delta": 1e-9, "force": 1e-9, **columns}])


# --- limits ---------------------------------------------------------------------------------------------------


def evidence(
    surface: Surface = WAVE,
    material: Material = STEEL,
    sides: str = "rollers",
    height: float | None = None,
    **columns: Any,
) -> Evidence:
    """Of a curve with a light step, and one with the given values; other attributes of the evidence by name."""
    others = {name: columns.pop(name) for name in tuple(columns) if name in Evidence.__dataclass_fields__}
    problem = Problem.of(surface, material, height=height, sides=sides, delta_max=1e-6 * surface.L)
    return Evidence(curve(**columns), problem, **others)


def verdict(line: Any) -> str:
    return str(line.verdict)


def line_of(run: Evidence, beginning: str | tuple[str, ...]) -> Any:
    """The line of the ledger whose name begins so, None without one."""
    return next((line for line in assumptions_of(run) if line.name.startswith(beginning)), None)


small_strain = partial(line_of, beginning="small strain")
elastic = partial(line_of, beginning="elastic")
bulk_yield = partial(line_of, beginning="block: mean pressure")
sticking = partial(line_of, beginning="adhesion: stickiness")
first_pull_off = partial(line_of, beginning="adhesion: pull-off")
size_effect = partial(line_of, beginning="size effect")
radiation = partial(line_of, beginning="inertia: damping")
added_by_block = partial(line_of, beginning="block: part")


def test_plastic_strain_beyond_small_strain() -> None:
    """At the limit the logarithmic strain is 5 % below the change of length."""
    assert 1 - np.log1p(SMALL_STRAIN) / SMALL_STRAIN == pytest.approx(0.05, abs=0.005)
    assert verdict(small_strain(evidence(max_plastic_strain=0.999 * SMALL_STRAIN))) == FINE
    line = small_strain(evidence(max_plastic_strain=0.24, strained_fraction=0.02))
    assert verdict(line) == DOUBTFUL
    assert "greatest plastic strain: 0.24, at most 0.1; material.kinematics" in describe(line.to_dict())
    assert "in 2 % of the volume" in line.detail
    assert verdict(small_strain(evidence())) == FINE  # unknown column
    elastic = small_strain(evidence(material=Material(200e9, 0.3), max_strain=0.2))
    assert "equivalent strain: 0.2, at most 0.1" in describe(elastic.to_dict())


def test_a_comparison_replaces_the_limit_of_strain() -> None:
    """What small strain changes in the force says more than the strain of a point."""
    strained: dict[str, Any] = {"max_plastic_strain": 0.24}
    assert verdict(small_strain(evidence(**strained, small_strain=(0.4, 1.0)))) == FINE
    line = small_strain(evidence(**strained, small_strain=(2.6, 1.0)))
    assert verdict(line) == DOUBTFUL
    assert describe(line.to_dict()).startswith("small strain: 2.6 % of the force, at most 1 %")
    finite = replace(STEEL, kinematics="finite")
    assert small_strain(evidence(material=finite, **strained)) is None
    assert small_strain(evidence(material=finite, **strained, small_strain=(2.6, 1.0))) is None


def test_pressure_of_an_elastic_contact_beyond_that_of_metals() -> None:
    """2.8 times a yield strength of 0.02 E; the pressure of one node, singular at an edge, decides nothing."""
    solid = Material(200e9, 0.3)
    line = elastic(evidence(material=solid, force=2e-9, mean_pressure=7e9, max_pressure=200e9))
    assert verdict(line) == FINE and line.value == pytest.approx(1.5 * 7 / 200)
    line = elastic(evidence(material=solid, force=2e-9, mean_pressure=8e9, max_pressure=12e9))
    assert verdict(line) == DOUBTFUL and "material.yield_strength" in line.advice
    assert "below 7.5e+09" in line.detail  # 12 GPa over 1.6, Hertz and Mises
    assert elastic(evidence(material=STEEL, force=2e-9, mean_pressure=8e9)) is None
    rubbers = Material(2e6, 0.49), Material.of_law(neo_hookean, E=2e6, nu=0.4)
    assert [elastic(evidence(material=solid, force=2e-9, mean_pressure=1e6)) for solid in rubbers] == [None, None]


def test_pressure_of_an_elastic_contact_does_not_grow_with_the_mesh() -> None:
    """Of a wave on two meshes; of a Hertzian contact it is the pressure in the middle."""
    ridge, found = Sinusoid(L=1.0, amplitude=0.02), []
    for h in (0.14, 0.07):
        problem = Problem.of(ridge, Material(1.0, 0.3), delta_max=0.02, steps=2, size=MeshSize(h))
        curve = solve_problem(problem, comm=here()).curve
        line = elastic(Evidence(curve, problem))
        found.append(line.value)
    assert found[1] == pytest.approx(found[0], rel=0.03)
    sphere = Problem.of(Sphere(L=1.0, radius=4.0), Material(1.0, 0.3), delta_max=4e-3, steps=2, size=MeshSize(0.03))
    curve = solve_problem(sphere, comm=here()).curve
    line = elastic(Evidence(curve, sphere))
    assert line.value == pytest.approx(curve.max_pressure[-1], rel=0.03)


@pytest.mark.parametrize(("sides", "nu"), [("rollers", 0.1), ("rollers", 0.3), ("free", 0.0)])
def test_a_plane_block_yields_at_that_pressure(sides: str, nu: float) -> None:
    """Computed by the solver, which does not use the limit: it is elastic just below, and yields just above.

    With free sides the clamped base leaves the stress uniform without lateral strain only.
    """
    material = Material(1.0, nu, 1e-3, 0.1)
    lame = material.E * nu / ((1 + nu) * (1 - 2 * nu))
    modulus = lame + material.E / (1 + nu) if sides == "rollers" else material.E
    for part in (0.99, 1.01):
        problem = Problem.of(
            Flat(L=1.0), material, sides=sides, delta_max=part * material.yield_pressure(sides) / modulus, steps=1,
            integrator="backward-euler", size=MeshSize(0.5, 1.0, 1.0),
        )  # fmt: skip
        result = solve_problem(problem, comm=here())
        yielded = float(result.curve.plastic_fraction[-1])
        assert yielded == pytest.approx(1.0 if part > 1 else 0.0, abs=1e-12)
        assert verdict(bulk_yield(Evidence(result.curve, problem))) == (DOUBTFUL if part > 1 else FINE)


@pytest.mark.parametrize(
    ("sides", "height", "centre", "delta"),
    [
        ("rollers", 2.5, (0.5, 0.5), 0.005), ("rollers", 0.3, (0.5, 0.5), 0.005), ("free", 2.0, (0.5, 0.5), 0.005),
        ("rollers", 2.0, (0.0, 0.0), 0.005), ("rollers", 0.7, (0.5, 0.5), 0.02),
    ],
)  # fmt: skip
def test_what_a_block_adds_to_the_approach_of_a_sphere(
    sides: str, height: float, centre: tuple[float, float], delta: float
) -> None:
    """Finite elements less Hertz at the same force, within 2 % of the approach: softer, and stiffer where it is low."""
    sphere = Sphere(L=1.0, radius=2.0, shape="paraboloid", centre=centre)
    problem = Problem.of(sphere, Material(1.0, 0.3), delta_max=delta, steps=2, height=height, sides=sides)
    run = Evidence(solve_contact(problem, tolerance=0.03, comm=here()).curve, problem)
    whole = 4.0 if centre == (0.0, 0.0) else 1.0
    hertz = float(Hertz(2.0, 1 / 0.91).approach(whole * run.curve.force[-1]))
    added = float(run.curve.delta[-1]) - hertz
    line = added_by_block(run)
    assert line.value == pytest.approx(100.0 * abs(added) / run.curve.delta[-1], abs=2.0)
    assert line.verdict == (DOUBTFUL if abs(added) > 0.05 * run.curve.delta[-1] else FINE)
    assert ("longer" if added > 0.0 else "shorter") in line.detail


def test_what_a_block_adds_to_the_approach_of_a_rough_surface() -> None:
    """Its compression: a higher one has as much more approach at the same force."""
    wave, found = Sinusoid(L=1.0, amplitude=0.01, wavelength=0.5, dims=2), []
    for height in (1.0, 2.0):
        problem = Problem.of(
            wave, Material(1.0, 0.3), force_max=3e-3, steps=2, height=height, size=MeshSize(0.1, h_max=0.5)
        )
        run = Evidence(solve_problem(problem, comm=here()).curve, problem)
        found.append((float(run.curve.delta[-1]), added_by_block(run).value))
    (low, part), (high, more) = found
    assert more * high - part * low == pytest.approx(100.0 * (high - low), rel=0.02)
    assert part * low == pytest.approx(more * high / 2.0, rel=1e-3)


def test_a_small_patch_of_a_large_joint_lacks_long_waves(tmp_path: Path) -> None:
    """The predicted rms height is that of the large surface from which the patch, or a map, is cut."""
    ratios, lines = [], []
    for seed in range(6):
        whole = Surface.from_spec("self-affine", L=8e-3, H=0.7, rms_height=1e-5, lambda_short=4e-5, seed=seed)
        z = whole.grid(2049)
        part = HeightField(z[512 : 512 + 257, 1024 : 1024 + 257], 1.0, 1.0).levelled("plane").z
        np.savez(tmp_path / f"{seed}.npz", z=part, L=1e-3)
        ratios.append(np.std(z) / np.std(part))
        surface = Surface.from_spec("file", path=tmp_path / f"{seed}.npz")
        lines.append(line_of(evidence(surface, si=True, side=8e-3), "joint: rms height"))
    assert all(line.limit == 1.2 and line.verdict == DOUBTFUL for line in lines)
    predicted, true = (np.exp(np.mean(np.log(values))) for values in ([line.value for line in lines], ratios))
    assert predicted == pytest.approx(true, rel=0.25)
    assert "8 patches along each side" in lines[0].detail and "from 1 mm to 8 mm" in lines[0].detail
    line = line_of(evidence(fractal(), si=True, side=3162e-6), "joint: rms height")
    assert line.value == pytest.approx(3162**0.6, rel=1e-9)
    for surface, side in ((fractal(), 1e-6), (WAVE, 1e-3), (SMALL_WITH_PLATEAU, 1e-3)):
        assert line_of(evidence(surface, side=side), "joint: rms height") is None


def test_a_map_with_a_roll_off_stands_for_a_large_joint(tmp_path: Path) -> None:
    np.savez(tmp_path / "map.npz", z=SMALL_WITH_PLATEAU.grid(513), L=1e-4)
    surface = Surface.from_spec("file", path=tmp_path / "map.npz")
    assert line_of(evidence(surface, si=True, side=1e-2), "joint: rms height") is None


SMALL_WITH_PLATEAU = Surface.from_spec(
    "self-affine", L=1e-4, H=0.8, rms_height=1e-7, lambda_roll=1e-5, lambda_short=1e-6, seed=4
)


def fractal() -> Surface:
    return Surface.from_spec("weierstrass-mandelbrot", L=1e-6, D=2.4, G=1e-13)


# --- adhesion and size ----------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def sphere() -> Evidence:
    """An elastic sphere pressed to a contact radius of a fifth of the patch, SI units."""
    surface = Sphere(L=1e-6, radius=4e-6, shape="paraboloid")
    problem = Problem.of(surface, Material(200e9, 0.3), height=2e-6, delta_max=4e-9, steps=4, size=MeshSize(0.02e-6))
    return Evidence(solve_problem(problem, comm=here()).curve, problem, si=True, h=0.02e-6)


def test_the_contact_radius_of_a_sphere_is_that_of_hertz(sphere: Evidence) -> None:
    """sqrt(R delta), by 3 %: rollers and base stiffen the patch."""
    delta, force, E = float(sphere.curve.delta[-1]), float(sphere.curve.force[-1]), 200e9 / 0.91
    assert sphere.contact_radius == pytest.approx((0.75 * force * 4e-6 / E) ** (1 / 3), rel=0.02)
    assert sphere.contact_radius == pytest.approx(np.sqrt(4e-6 * delta), rel=0.05)
    assert sphere.summit_radius == pytest.approx(4e-6)


def test_pull_off_of_a_sphere(sphere: Evidence) -> None:
    """Between 3/2 (JKR) and 2 pi w R (DMT), as Tabor's parameter says; the stickiness is one of rough surfaces."""
    line = first_pull_off(sphere)
    assert sticking(sphere) is None
    R, w, E = 4e-6, 0.2, 200e9 / 0.91
    mu = (R * w**2 / (E**2 * 0.3e-9**3)) ** (1 / 3)
    F = line.value * float(sphere.curve.force.max())
    assert 1.5 < F / (np.pi * w * R) < 2.0
    assert f"Tabor's parameter {mu:.2g}" in line.detail
    heavy = evidence(sphere.problem.surface, Material(200e9, 0.3), si=True, force=1.0)
    light = evidence(sphere.problem.surface, Material(200e9, 0.3), si=True, force=1e-6)
    assert (verdict(first_pull_off(heavy)), verdict(first_pull_off(light))) == (FINE, DOUBTFUL)
    assert first_pull_off(replace(sphere, si=False)) is None


def test_stickiness_of_waves() -> None:
    """A soft rough surface sticks, a hard one does not; the formula as in the paper, with the diameter of spots."""
    soft, hard = Material(1e6, 0.49), Material(200e9, 0.3)
    lines = [sticking(evidence(fractal(), material, si=True)) for material in (soft, hard)]
    assert [verdict(line) for line in lines] == [DOUBTFUL, FINE]
    surface = fractal()
    slope, curvature, z0 = surface.rms_slope(), surface.statistics(257).rms_curvature, 0.3e-9
    d = 4 * slope / curvature
    expected = slope * z0 / (2 * 0.2 / hard.reduced_modulus) * (slope * d / (4 * z0)) ** (2 / 3)
    assert lines[1].value == pytest.approx(expected, rel=1e-9)


def test_small_metal_contacts_are_doubtful_once_they_yield() -> None:
    """A mean spot of radius a = sqrt(A/(pi N))."""
    columns: dict[str, Any] = {"area_fraction": 0.01, "spots": 4, "force": 1e-5}
    assert size_effect(evidence(**columns, si=True)) is None
    line = size_effect(evidence(**columns, si=True, max_plastic_strain=0.01))
    assert verdict(line) == DOUBTFUL and line.value == pytest.approx(np.sqrt(0.01 * 1e-12 / 4 / np.pi))
    assert line is not None and ": 28.2 nm, at least 1 µm; " in describe(line.to_dict())
    large = Sphere(L=1.0, radius=2.0)
    assert verdict(size_effect(evidence(large, **columns, si=True, max_plastic_strain=0.01))) == FINE


# --- inertia --------------------------------------------------------------------------------------------------


def moving(**values: float) -> dict[str, Any]:
    """Evidence of a vibration of a steel block."""
    numbers: dict[str, Any] = {
        "stiffness": 1e5,
        "mass": 1.0,
        "frequency": 1e3,
        "approach": 1e-9,
        "damping": 0.01,
    } | values
    return {"density": 7800.0, "vibration": Numbers(**numbers)}


def test_radiation_next_to_the_damping_of_the_model() -> None:
    """As Lysmer's disc of equal stiffness, however many spots; a model without damping needs it most."""
    line = radiation(evidence(**moving()))
    mu, a = 200e9 / 2.6, 1e5 * 0.7 * 2.6 / (4 * 200e9)
    by_hand = 3.4 * a**2 * np.sqrt(7800.0 * mu) / 0.7 * 2 * np.pi * 1e3 / (2 * 1e5)
    assert line.verdict == FINE and by_hand / line.value == pytest.approx(1.0, rel=1e-9)
    assert radiation(evidence(**moving(), spots=9)) == line
    assert verdict(radiation(evidence(**moving(stiffness=1e10, frequency=2e5)))) == DOUBTFUL
    assert verdict(radiation(evidence(**moving(damping=0.0)))) == DOUBTFUL


@pytest.mark.parametrize("missing", ["density", "vibration"])
def test_inertia_needs_density_and_mass(missing: str) -> None:
    known = moving() | {missing: None}
    assert radiation(evidence(**known)) is None


# --- in the files of a run ------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def warned(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[str]]:
    """A run beyond a limit, with an unused key; and its warnings."""
    folder = tmp_path_factory.mktemp("warned") / "out"
    with warnings.catch_warnings(record=True) as caught, pytest.MonkeyPatch.context() as patch:
        leave_figures_blank(patch)
        warnings.simplefilter("always")
        run(Case.from_dict({**YIELDING, "output": {"report": True}}), folder)
    return folder, [str(w.message) for w in caught if issubclass(w.category, AsperityWarning)]


def test_warnings_are_in_summary_log_and_report(warned: tuple[Path, list[str]]) -> None:
    folder, shown = warned
    assert len(shown) == len(set(shown)) == 2
    for text, part in zip(shown, ("contact.gamma = 3", "block: mean pressure"), strict=True):
        assert part in text
    assert json.loads((folder / "summary.json").read_text())["warnings"] == shown
    log = (folder / "run.log").read_text()
    assert all(log.count(f"warning: {text}") == 1 for text in shown)
    html = (folder / "report.html").read_text(encoding="utf-8")
    box = html[html.index('class="warnings"') : html.index("</section>")]
    assert all(text in box for text in shown)
    assert all(html.count(text) == 1 for text in shown)
    assert json.loads((folder / "summary.json").read_text())["finished"] is True


@pytest.mark.parametrize("depth", [1e-3, 1e-6])
def test_an_unresolved_contact_warns_once(tmp_path: Path, depth: float) -> None:
    """Of a few facets, and of a single node, which has no area."""
    case = {
        **YIELDING,
        "surface": {"kind": "sphere", "L": 1.0, "radius": 3.0},
        "material": {"E": 1.0, "nu": 0.3},
        "loading": {"delta_max": depth, "steps": 1},
    }
    with pytest.warns(ResolutionWarning, match="touches a few facets only") as caught:
        result = run(Case.from_dict(case), tmp_path)
    assert len([w for w in caught if issubclass(w.category, ResolutionWarning)]) == 1
    (text,) = (text for text in result.summary["warnings"] if "facets" in text)
    assert text == f"{result.summary['unresolved']}; make mesh.h_contact smaller"
    assert depth > 1e-4 or result.curve.area_fraction[-1] == 0.0


# --- collecting -----------------------------------------------------------------------------------------------


@pytest.mark.mpi
def test_a_warning_of_any_rank_is_known_to_all_and_shown_by_the_first() -> None:
    comm = world()
    with warnings.catch_warnings(record=True) as caught, logged(comm) as log:
        warnings.simplefilter("once")
        for _ in range(2):
            warn("of all", AssumptionWarning)
            warn(f"of rank {comm.rank}", ResolutionWarning)
        log.share()
        log.share()
        if comm.rank == comm.size - 1:
            warn("of one, later", AssumptionWarning)
        log.share()
    assert log.texts == ["of all", *(f"of rank {k}" for k in range(comm.size)), "of one, later"]
    assert [str(w.message) for w in caught] == (log.texts if comm.rank == 0 else [])


def test_the_filters_of_the_caller_decide_what_is_shown_and_not_what_is_recorded(tmp_path: Path) -> None:
    """A message is in the log once, whoever else listens; what is logged before the file exists is in it as well."""

    def attempt(name: str) -> str:
        with logged(here(), tmp_path / name) as log:
            try:
                for _ in range(2):
                    warn("ours", AssumptionWarning)
                log.begin(append=False)
            finally:
                assert log.texts == ["ours"]
        return (tmp_path / name).read_text()

    logging.getLogger("asperity").info("before")
    cases: list[tuple[Literal["default", "ignore"], int]] = [("default", 1), ("ignore", 0)]
    for action, shown in cases:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter(action)
            before = list(warnings.filters), warnings.showwarning
            assert attempt(action).count("warning: ours\n") == 1
            assert (list(warnings.filters), warnings.showwarning) == before
        assert len(caught) == shown
    with warnings.catch_warnings(), pytest.raises(AssumptionWarning, match="ours"):
        warnings.simplefilter("error", AssumptionWarning)
        attempt("error")
    assert not (tmp_path / "error").exists() and logging.getLogger("asperity").level == logging.NOTSET
