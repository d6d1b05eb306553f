"""Laws of a curve against closed forms: few rows, kinks, light preloads; one frequency; its bar in the figure."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import asperity as asp
from asperity.case import Case
from asperity.errors import AsperityWarning, InputError
from asperity.output.results import Results
from asperity.plot.vibration import response
from asperity.vibration import CurveLaw, DynamicsSettings, PowerLaw, law_from, run_dynamics
from asperity.vibration.law import bar_of
from asperity.vibration.numbers import Numbers
from asperity.vibration.source import CurveColumns, choose

QUICK: dict[str, Any] = {"model": "exact", "omega": (0.9, 0.91), "units": "SI", "tol": 1e-3}


def joint(rows: int, *, stiffness: bool = True, unload: bool = True) -> dict[str, Any]:
    """Curve of a contact that yields from the beginning, F = z^1.2, and unloads from a force M by F = K z^1.5.

    K = 2 M^0.3 depends on the overload, so the elastic stiffness does: k = 1.5 K^(2/3) F^(1/3). The greatest force
    is 1. The unloading has `rows` in contact, the top among them; the last row is the separation.
    """
    up = np.linspace(0.0, 1.0, 41)[1:]
    force = up**1.2
    down = np.arange(rows - 1, -1, -1) / rows if unload else np.empty(0)
    delta = np.append(up, 1.0 - 0.5 ** (1 / 1.5) + (0.5 * down) ** (1 / 1.5))
    met = np.append(force, np.ones(down.size))
    curve = {"delta": delta, "force": np.append(force, down), "max_plastic_strain": np.full(delta.size, 0.01)}
    curve["branch"] = np.array(["load"] * up.size + ["unload"] * down.size)
    if stiffness:
        curve["k_n_elastic"] = np.where(curve["force"] > 0, elastic(curve["force"], met), 0.0)
    return curve


def elastic(force: Any, met: Any) -> Any:
    """Elastic stiffness at a force after a greatest force."""
    return 1.5 * (2.0 * np.asarray(met) ** 0.3) ** (2 / 3) * np.asarray(force) ** (1 / 3)


def rough(z: Any) -> tuple[Any, Any]:
    """Force and stiffness of a contact whose exponent rises from 1.3 to 2.6 with the approach."""
    z = np.asarray(z, float)
    return z**1.3 + 3.0 * z**3, 1.3 * z**0.3 + 9.0 * z**2


@pytest.mark.parametrize("rows", [5, 10])
def test_the_law_after_yield_does_not_depend_on_the_rows(rows: int) -> None:
    """Exponent, curvature, approach and frequencies lie within their bars of the closed form, with few rows too."""
    z = np.linspace(1.0, 0.0, rows + 1)
    force, k = rough(z)
    up = np.linspace(0.0, 1.4, 30)[1:]
    curve = {
        "delta": np.append(up, 0.4 + z[1:]), "force": np.append(4.0 * up / 1.4, force[1:]),
        "k_n_elastic": np.append(np.append(np.full(28, 9.0), k[0]), k[1:]),
        "branch": ["load"] * 29 + ["unload"] * rows,
    }  # fmt: skip
    law = law_from(curve, "unload-reload", 1.5)[0]
    o, fine = asp.ContactOscillator(law, load=1.5), np.linspace(0.0, 1.2, 801)[1:]
    exact = asp.ContactOscillator(CurveLaw(fine, rough(fine)[0], k=rough(fine)[1]), load=1.5)
    values, bars = law.at_load(1.5), bar_of(law, lambda side: side.at_load(1.5))
    assert np.all(np.abs(values - exact.law.at_load(1.5)) <= bars + 1e-9) and np.all(bars[1:3] < 0.1 * values[1:3])
    assert o.omega_s == pytest.approx(exact.omega_s, rel=5e-3)
    found, true = (x.omega_s * x.free([0.15, 0.4]).omega_ratio for x in (o, exact))
    np.testing.assert_allclose(found, true, rtol=5e-3)


@pytest.mark.parametrize("rows", [1, 2, 3])
def test_an_unloading_of_few_rows_is_a_law_by_its_slopes(rows: int) -> None:
    """And not a joint that was never overloaded; one row cannot show the curvature."""
    choice = choose(CurveColumns.of(joint(rows)), load=0.3)
    found = Numbers.of(choice.law, choice.load, 1.0, 0.01)
    assert choice.name == "unload-reload" and found.stiffness == pytest.approx(float(elastic(0.3, 1.0)), rel=1e-9)
    assert ("below the first point" in choice.note) == (rows < 4) and (found.softening == "softening") == (rows > 1)


def test_few_rows_without_stiffness_are_doubted() -> None:
    for rows in (1, 2):
        with pytest.warns(AsperityWarning, match=r"gives no law: .* loading\.unload_steps = 5 or more"):
            law_from(joint(rows, stiffness=False), load=0.3)


def test_check_warns_of_an_unloading_of_few_rows() -> None:
    case = {
        "surface": {"kind": "sphere", "L": 1e-6, "radius": 1e-5},
        "material": {"E": 200e9, "nu": 0.3, "yield_strength": 1e9, "tangent_modulus": 1e10},
        "loading": {"delta_max": 1e-8, "unload": True, "unload_steps": 2},
        "dynamics": {},
    }
    with pytest.warns(UserWarning, match=r"loading\.unload_steps = 2 .* at least 5 .* output\.stiffness = true"):
        Case.from_dict(case).problem()
    with pytest.warns(UserWarning, match="at least 3"):
        Case.from_dict({**case, "output": {"stiffness": True}}).problem()


def test_a_kink_above_the_preload_does_not_change_small_motion() -> None:
    """F = z, three times as steep beyond 1.025: small motion about F = 1 is linear."""
    z = np.linspace(0.0, 2.0, 601)[1:]
    law = CurveLaw(z, np.where(z < 1.025, z, 1.025 + 3.0 * (z - 1.025)))
    r = asp.ContactOscillator(law, load=1.0)
    assert r.scale / r.z_s == pytest.approx(1.0, rel=1e-12) and abs(r.kappa) < 1e-4
    assert CurveLaw(z[::30], z[::30]).kappa(1.0) == pytest.approx(0.0, abs=1e-6)
    exact = CurveLaw(z, np.exp(z) - 1.0)  # smooth: as from its derivatives, z^2/48 (3 - 5)
    assert exact.kappa(1.0) == pytest.approx(-2 / 48, abs=2e-3)


def test_the_stiffness_falls_with_a_light_preload() -> None:
    z = np.linspace(0.1, 1.0, 19)
    law = CurveLaw(z, z**1.5 + 0.1 * z**3)
    stiffness = [law.derivatives(law.deflection(load))[0] for load in np.geomspace(1e-9, float(law.F[0]), 9)]
    assert np.all(np.diff(stiffness) > 0)


def test_there_is_one_frequency() -> None:
    """Printed frequency, slope of the law, and the limit of free vibration at small amplitude are the same."""
    z = np.linspace(0.0, 1.0, 21)[1:]
    second = np.maximum(z - 0.26, 0.0)  # the next summit is touched
    force = z**1.3 + 40 * second**1.5 / (1 + 6 * second)
    result = run_dynamics({"delta": z, "force": force}, preload=0.2 * float(force[-1]), **QUICK)
    o = result.first
    assert result.numbers.stiffness == pytest.approx(float(o.law.slope(o.z_s)), rel=1e-12)
    assert float(o.free(1e-5).omega_ratio[0]) == pytest.approx(1.0, abs=1e-4)
    assert result.numbers.frequency_bar > 0.0 and result.numbers.sentence("SI").count("±") >= 2


def test_the_figure_shades_what_the_bar_of_the_stiffness_makes_of_the_stable_response() -> None:
    """Laws of any stiffness in the bar, each solved on its own, lie in it; no unstable orbit between branches does."""
    o = asp.ContactOscillator(PowerLaw(1.5), load=1.0, zeta=0.01)
    r = o.response(0.02, (0.7, 1.35))
    thresholds = {"numbers": {"k_n_bar": 0.03}}
    rows = list(r.rows())
    columns = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    results = Results(Path(), asp.Curve.from_rows([]), response=columns, thresholds=thresholds)
    shaded = [patch.get_path() for patch in response(results).axes[0].patches]
    for stiffer in (0.975, 1.0, 1.025):
        one = asp.ContactOscillator(PowerLaw(1.5, stiffer**1.5), load=1.0, zeta=0.01)
        ratio, size = one.omega_s / o.omega_s, one.z_s / o.z_s
        assert ratio**2 == pytest.approx(stiffer) == pytest.approx(1.0 / size)
        found = one.response(0.02, (0.7, 1.35))
        for omega in np.linspace(0.8, 1.2, 31):
            for s in found.at(float(omega / ratio)):
                inside = any(path.contains_point((omega, size * s.u_max)) for path in shaded)
                if s.stable or (stiffer == 1.0 and 0.55 < s.u_max < 0.8):
                    assert inside == s.stable


def test_the_case_and_the_settings_have_the_same_defaults() -> None:
    sphere = {"surface": {"kind": "sphere", "L": 1e-6, "radius": 1e-5}, "material": {"E": 200e9, "nu": 0.3}}
    case = Case.from_dict({**sphere, "loading": {"delta_max": 1e-8}, "dynamics": {}})
    assert DynamicsSettings.of_case(case.to_dict()) == DynamicsSettings(units="SI", patch_area=1e-12)
    with pytest.raises(InputError, match='did you mean "model"'):
        run_dynamics(PowerLaw(1.5), modle="exact")
