"""Which law a curve gives, against contacts whose law is known in closed form; preloads, overloads, and the joint."""

from __future__ import annotations

import math
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import asperity as asp
from asperity.case import Case
from asperity.errors import AsperityWarning, InputError, RangeError
from asperity.output.verdict import headline
from asperity.vibration import CurveLaw, DynamicsSettings, PowerLaw, law_from, run_dynamics
from asperity.vibration.numbers import Numbers
from asperity.vibration.source import LACK, CurveColumns, choose

QUICK: dict[str, Any] = {"model": ["exact"], "omega": (0.9, 0.91), "units": "SI", "tol": 1e-3}
# A contact that yields from the beginning: loading F = C z^1.2; from a greatest force F_0 it unloads by
# F = K (z - z_r)^1.5 with K the same, so that the elastic stiffness at F is 1.5 K^(2/3) F^(1/3) on any branch.
C, K = 0.5, 2.0


def stiffness(force: Any) -> Any:
    """Elastic stiffness at a force."""
    return 1.5 * K ** (2 / 3) * np.asarray(force) ** (1 / 3)


def contact(*, unload: bool = True, probe: bool = False, strain: bool = True, lowest: float = 0.0) -> dict[str, Any]:
    """Columns of its curve, loaded to z = 1; the unloading ends at the force `lowest`."""
    up = np.linspace(0.0, 1.0, 41)[1:]
    top = C
    depth = (top / K) ** (1 / 1.5)
    down = np.linspace(depth, (lowest / K) ** (1 / 1.5), 21)[1:]
    delta = np.concatenate([up, 1.0 - depth + down]) if unload else up
    force = np.concatenate([C * up**1.2, K * down**1.5]) if unload else C * up**1.2
    curve: dict[str, Any] = {"delta": delta, "force": force}
    curve["branch"] = np.array(["load"] * up.size + ["unload"] * (delta.size - up.size))
    if strain:
        curve["max_plastic_strain"] = np.minimum(delta, 1.0) * 0.01
    if probe:
        curve["k_n_elastic"] = stiffness(force)
    return curve


def numbers_of(curve: dict[str, Any], load: float | None = None) -> Numbers:
    """Numbers of a mass of one on the law of a curve under a preload."""
    choice = choose(CurveColumns.of(curve), load=load)
    return Numbers.of(choice.law, choice.load, 1.0, 0.01)


def test_after_yield_small_vibration_is_on_the_unloading_branch() -> None:
    """The frequency is that of the closed form, and not that of the loading, half as stiff."""
    law, load = law_from(contact())
    z = law.deflection(load)
    assert isinstance(law, CurveLaw) and law.F[-1] == pytest.approx(C)
    assert law.derivatives(z)[0] == pytest.approx(float(stiffness(load)), rel=1e-6)
    assert law.n_loc(z) == pytest.approx(1.5, rel=1e-6) and law.kappa(z) == pytest.approx(-1 / 24, rel=1e-3)
    paper = law_from(contact(), "paper")[0]
    assert paper.derivatives(paper.deflection(load))[0] < 0.5 * law.derivatives(z)[0]


def test_without_an_unloading_the_elastic_stiffness_is_the_law() -> None:
    for curve in (contact(unload=False, probe=True), contact(probe=True, lowest=0.8 * C)):
        law, load = law_from(curve, load=0.5 * C)  # the second one is unloaded, but not through the preload
        z = law.deflection(load)
        assert isinstance(law, CurveLaw) and law.name == "elastic tangent of the loading"
        assert law.derivatives(z)[0] == pytest.approx(float(stiffness(load)), rel=1e-4)
        assert law.n_loc(z) == pytest.approx(1.5, rel=1e-4) and law.kappa(z) == pytest.approx(-1 / 24, rel=1e-6)


def test_the_paper_law_by_lack_of_data_is_reported() -> None:
    with pytest.warns(AsperityWarning, match="neither an unloading through the preload nor the elastic stiffness"):
        law, _ = law_from(contact(unload=False))
    assert isinstance(law, PowerLaw)
    result = run_dynamics(contact(unload=False), **QUICK)
    assert LACK in result.notes and result.choice is not None and result.choice.name == "paper"
    # no bar of the force, and no points of the loading, hold what is so far from the elastic stiffness
    assert math.isnan(result.numbers.bars[0]) and result.numbers.stiffness < 0.6 * stiffness(0.5 * C)
    force = contact(unload=False)["force"]
    known = run_dynamics(contact(unload=False) | {"P_star": force, "error_P_star": 0.01 * force}, **QUICK)
    assert math.isnan(known.numbers.bars[0])
    few = {name: np.delete(column, slice(42, 59)) for name, column in contact(lowest=0.1 * C).items()}
    assert "frequency is too low" in choose(CurveColumns.of(few)).note


def test_before_yield_the_law_is_the_loading() -> None:
    """Plastic strain that begins above the preload does not count."""
    z = np.linspace(0.0, 1.0, 41)[1:]
    curve = {"delta": z, "force": z**1.5 + 0.3 * z**3, "max_plastic_strain": np.where(z > 0.9, 1e-3, 0.0)}
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        law, load = law_from(curve)
    assert isinstance(law, CurveLaw) and law.name == "loading" and load < 1.3
    assert float(law.force(0.6)) == pytest.approx(0.6**1.5 + 0.3 * 0.6**3, rel=1e-3)
    with pytest.warns(AsperityWarning, match="yielded"):
        assert isinstance(law_from(curve, load=1.25)[0], PowerLaw)


def test_without_plastic_columns_an_unloading_is_the_law() -> None:
    names = [choose(CurveColumns.of(contact(strain=False, unload=unload))).name for unload in (True, False)]
    assert names == ["unload-reload", "table"]


@pytest.mark.parametrize(
    ("options", "error", "words"),
    [
        ({"load": 0.6}, RangeError, "ends at force 0.5"),
        ({"law": "elastic"}, InputError, "k_n_elastic in 0 rows"),
    ],
)
def test_what_the_curve_does_not_hold_is_refused(options: dict[str, Any], error: type[Exception], words: str) -> None:
    with pytest.raises(error, match=words):
        law_from(contact(), options.pop("law", "auto"), **options)


def test_each_law_can_be_named() -> None:
    """Stiffness and exponent of four laws of one curve, the power laws of the contact."""
    exact, loading = float(stiffness(0.5 * C)), 1.2 * C ** (1 / 1.2) * (0.5 * C) ** (1 - 1 / 1.2)
    for name, k, n in (
        ("unload-reload", exact, 1.5), ("elastic", exact, 1.5), ("table", loading, 1.2), ("paper", loading, 1.2),
    ):  # fmt: skip
        choice = choose(CurveColumns.of(contact(probe=True)), name)
        found = Numbers.of(choice.law, choice.load, 1.0, 0.01)
        assert (choice.name, found.stiffness, found.n) == (name, pytest.approx(k, rel=1e-3), pytest.approx(n, rel=1e-3))


def test_there_is_one_verdict_on_small_motion() -> None:
    """A kappa whose bar holds zero is not resolved in any section, also where its value is negative."""
    z = np.linspace(0.0, 1.0, 30)
    force = z**1.5 + 0.02 * np.random.default_rng(2).standard_normal(30)
    result = run_dynamics({"delta": z, "force": force}, **QUICK)
    written = result.to_dict()
    words = [written[section]["softening"] for section in ("numbers", "exact")]
    assert words == ["curvature not resolved"] * 2 == [result.first.thresholds().softening] * 2


def test_a_bar_of_the_force_makes_that_of_the_frequency() -> None:
    """A force known to 4 % at any approach: omega_s^2 = 1.5 g K^(2/3) W^(-2/3) is known to 4 (2/3) %."""
    z = np.linspace(0.0, 1.0, 41)[1:]
    curve = {"delta": z, "force": z**1.5, "P_star": z**1.5, "error_P_star": 0.04 * z**1.5}
    found = numbers_of(curve | {"step": range(40)})
    assert found.bars[0] == pytest.approx(1.0 - 0.96 ** (2 / 3), rel=2e-2)
    assert found.frequency_bar == pytest.approx(0.5 * found.bars[0] * found.frequency, rel=1e-12)
    lower, upper = (PowerLaw(1.5, 1.0 + x).derivatives(((0.5) / (1.0 + x)) ** (2 / 3))[0] for x in (-0.04, 0.04))
    half = (math.sqrt(upper) - math.sqrt(lower)) / (4 * math.pi)
    assert found.frequency_bar == pytest.approx(half, rel=0.03)


def test_a_bar_of_the_elastic_stiffness_makes_that_of_the_law() -> None:
    """A stiffness known to 6 % moves omega_s by 3 %."""
    curve = contact(unload=False, probe=True)
    curve["error_k_n_elastic"] = 0.06 * curve["k_n_elastic"]
    assert numbers_of(curve).bars[0] == pytest.approx(0.06, rel=1e-2)
    whole = contact(probe=True)
    whole["error_k_n_elastic"] = 0.06 * whole["k_n_elastic"]
    found = numbers_of(whole, 0.3 * C)
    assert found.bars[0] == pytest.approx(0.06, rel=1e-2) and found.frequency_bar / found.frequency == pytest.approx(
        0.03, rel=1e-2
    )


def test_motion_about_the_greatest_force_met_yields_in_its_first_cycle() -> None:
    for curve, load, told in (
        (contact(unload=False, probe=True), 0.5 * C, True),
        (contact(probe=True), C, True),
        (contact(probe=True), 0.5 * C, False),
    ):
        notes = run_dynamics(curve, preload=load, **QUICK).notes
        assert any("motion yields in its first cycle" in note for note in notes) == told


# -- the joint ---------------------------------------------------------------------------------------------------


def test_a_joint_is_that_of_its_interface() -> None:
    """A spring in series with the contact: the joint has the stiffness, law and frequency without it."""
    plain, c = contact(probe=True), 0.4
    both = plain | {"delta": plain["delta"] + c * plain["force"], "k_n_elastic": 1 / (1 / plain["k_n_elastic"] + c)}
    joint, area = asp.Joint(preload=5.0, nominal_area=20.0, mass=2.0), 1.0
    found = run_dynamics(both, joint=joint, patch_area=area, block=c, **QUICK).numbers
    alone = run_dynamics(plain, joint=joint, patch_area=area, **QUICK).numbers
    k = 20.0 * float(stiffness(0.25))
    assert found.stiffness == pytest.approx(k, rel=1e-6) == alone.stiffness
    assert found.frequency == pytest.approx(math.sqrt(k / 2.0) / (2 * math.pi), rel=1e-6)
    assert (found.n, found.kappa) == pytest.approx((1.5, -1 / 24), rel=1e-3)
    assert found.with_block == pytest.approx(1 / (1 / k + c / 20.0), rel=1e-6) and alone.with_block == alone.stiffness
    assert found.greatest == pytest.approx(20.0 * C)
    # a patch without a joint keeps its block
    assert run_dynamics(both, preload=0.25, **QUICK).numbers.stiffness == pytest.approx(
        found.with_block / 20.0, rel=1e-3
    )


def test_the_headline_has_the_larger_bar_first_and_the_block_in_a_second_line() -> None:
    numbers = {"k_n": 6.1e9, "k_n_bar": 0.05, "f": 5.56e3, "k_n_with_block": 4.9e9, "greatest_load": 360.0}
    first, second = headline(numbers, {"bar": 0.24}, "SI", 300.0)
    assert first == (
        "Interface of the joint about 300 N after a load of up to 360 N: stiffness 6.1 GN/m, frequency 5.56 kHz "
        "(of the stiffness: other patches of this roughness ± 30 %, numerical error 5 %)."
    )
    assert second == "With the block of the model in series the stiffness is 4.9 GN/m."
    assert "numerical error 5 %, other patches" in headline(numbers, {"bar": 0.01}, "SI", 300.0)[0]
    assert "after" not in headline({"k_n": 6.1e9}, None, "SI", 300.0)[0]


def test_the_overload_of_a_joint_is_the_greatest_load() -> None:
    case = {"surface": {"kind": "sphere", "L": 1e-6, "radius": 1e-5}, "material": {"E": 200e9, "nu": 0.3}}
    joint = {"nominal_area": 1e-4, "preload": 300.0}
    assert Case.from_dict(case | {"joint": joint, "loading": {"steps": 3}}).loading.pressure_max == pytest.approx(3.6e6)
    assert Case.from_dict(
        case | {"joint": joint | {"overload": 2.0}, "loading": {}}
    ).loading.pressure_max == pytest.approx(6e6)
    assert Case.from_dict(case | {"joint": joint, "loading": {"pressure_max": 5e6}}).loading.pressure_max == 5e6
    with pytest.raises(InputError, match="are all missing"):
        Case.from_dict(case | {"joint": {"mass": 1.0}, "loading": {}})


def test_a_joint_scales_the_law_to_its_area_and_has_its_own_mass() -> None:
    small, large = 1e-12, 4e-6
    joint = asp.Joint(nominal_area=large, preload=0.25 * C * large / small, mass=0.7)
    result = run_dynamics(contact(), joint=joint, patch_area=small, zeta=0.03, **QUICK)
    k = float(stiffness(0.25 * C)) * large / small
    numbers = result.numbers
    assert numbers.stiffness == pytest.approx(k, rel=1e-6)
    assert numbers.mass == pytest.approx(0.7) and numbers.damping == 0.03
    assert numbers.frequency == pytest.approx(math.sqrt(k / 0.7) / (2 * math.pi), rel=1e-6)
    assert numbers.approach == pytest.approx((0.25 * C / K) ** (1 / 1.5), rel=1e-6)
    # dimensionless results do not depend on area and mass
    patch = run_dynamics(contact(), preload=0.25 * C, zeta=0.03, **QUICK)
    assert result.responses["exact"][0].peak[1] == pytest.approx(patch.responses["exact"][0].peak[1], rel=1e-6)


def test_a_joint_counts_in_whatever_way_it_is_given() -> None:
    joint, law = asp.Joint(preload=250.0, mass=5.0), PowerLaw(1.5, 3e11)
    z = (250.0 / 3e11) ** (1 / 1.5)
    for settings, changes in (
        (None, {"joint": joint}),
        (DynamicsSettings(joint=joint), {}),
        (DynamicsSettings(), {"joint": joint}),
    ):
        found = run_dynamics(law, settings, **QUICK, **changes).numbers
        assert found.approach == pytest.approx(z, rel=1e-12)
        assert found.frequency == pytest.approx(math.sqrt(1.5 * 250.0 / z / 5.0) / (2 * math.pi), rel=1e-12)
    assert asp.Joint(pressure=2.0, mass=3.0).load(1e-12) == pytest.approx(2e-12)
    assert asp.Joint(mass=3.0).load(None) is None


def test_files_hold_hertz_newton_and_metres(tmp_path: Path) -> None:
    import csv

    joint = asp.Joint(preload=0.25 * C, mass=0.7)
    result = run_dynamics(contact(), joint=joint, out_dir=tmp_path, **QUICK)
    f, z_s = result.numbers.frequency, result.numbers.approach
    with (tmp_path / "response.csv").open() as file:
        for row in csv.DictReader(file):
            assert float(row["frequency"]) == pytest.approx(f * float(row["Omega"]), rel=1e-6)
            assert float(row["x_max"]) == pytest.approx(z_s * float(row["u_max"]), rel=1e-6)
            assert float(row["force"]) == pytest.approx(0.01 * result.first.scale, rel=1e-6)
    with (tmp_path / "free.csv").open() as file:
        row = next(csv.DictReader(file))
    assert float(row["frequency"]) == pytest.approx(f * float(row["omega_ratio"]), rel=1e-6)
    unknown = run_dynamics(contact(), joint=asp.Joint(preload=0.25 * C), out_dir=tmp_path, **QUICK)
    assert math.isnan(unknown.numbers.mass) and any("joint.mass" in note for note in unknown.notes)
    with (tmp_path / "response.csv").open() as file:
        assert next(csv.DictReader(file))["frequency"] == ""


def test_an_area_without_a_patch_is_refused() -> None:
    with pytest.raises(InputError, match="needs the nominal area of the patch"):
        run_dynamics(contact(), joint=asp.Joint(nominal_area=1.0), **QUICK)
    with pytest.raises(InputError, match=r"joint\.nominal_area is for a curve"):
        run_dynamics(PowerLaw(1.5), joint=asp.Joint(nominal_area=1.0), **QUICK)
    with pytest.raises(InputError, match="the joint has its own"):
        run_dynamics(contact(), joint=asp.Joint(mass=1.0), gravity=9.81, **QUICK)


def exponential() -> dict[str, np.ndarray]:
    """Force of 20 N (exp(z/0.5 um) - 1)."""
    z = np.linspace(0.0, 2.5e-6, 26)
    return {"delta": z, "force": 20.0 * np.expm1(z / 0.5e-6)}


def test_rows_that_are_no_law_are_refused() -> None:
    """And not replaced by a power law that ignores them."""
    few = {name: column[[0, 6, 12, 18]] for name, column in exponential().items()}
    falling = exponential()
    falling["force"][14:] *= 0.5
    for curve, why in ((few, "4 approaches"), (falling, "falls by")):
        with pytest.raises(InputError, match=why):
            choose(CurveColumns.of(curve), load=100.0)


def test_sizes_beyond_all_units_are_refused() -> None:
    z = np.linspace(0.0, 1.0, 21)
    for length, force in ((1e-308, 1.0), (1e300, 1.0), (1.0, 1e-320)):
        with pytest.raises(InputError, match="must lie between 1e-100 and 1e"):
            run_dynamics({"delta": length * z, "force": force * z**1.5})


def test_a_preload_just_above_a_curve_with_an_error_bar_is_lowered_with_a_note() -> None:
    curve = exponential() | {"step": range(26), "P_star": np.ones(26), "error_P_star": np.full(26, 0.02)}
    top = float(np.asarray(curve["force"])[-1])
    choice = choose(CurveColumns.of(curve), load=1.01 * top)
    assert choice.load == top and "exceeds the greatest force of the curve by 1 %" in choice.note
    with pytest.raises(RangeError, match=r"load = 3036\.\d+ lies outside the curve, which ends at force 2948"):
        choose(CurveColumns.of(curve), load=1.03 * top)
    assert RangeError.exit_code == 3
