"""The law that a curve gives, against contacts whose law is known in closed form: computed and measured rows."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import asperity as asp
from asperity.case import Case
from asperity.errors import AsperityWarning, RangeError
from asperity.vibration import CurveLaw, PowerLaw, law_from, run_dynamics
from asperity.vibration.law import bar_of
from asperity.vibration.oscillator import Numbers
from asperity.vibration.source import LACK, CurveColumns, choose

QUICK: dict[str, Any] = {"model": ["exact"], "omega": (0.9, 0.91), "units": "SI", "tol": 1e-3}
Columns = dict[str, Any]
# A contact that yields from the beginning: loading F = C z^1.2; from a greatest force F_0 it unloads by
# F = K (z - z_r)^1.5 with K the same, so that the elastic stiffness at F is 1.5 K^(2/3) F^(1/3) on any branch.
C, K = 0.5, 2.0


def stiffness(force: Any) -> Any:
    """Elastic stiffness at a force."""
    return 1.5 * K ** (2 / 3) * np.asarray(force) ** (1 / 3)


def contact(*, unload: bool = True, probe: bool = False, strain: bool = True, lowest: float = 0.0) -> Columns:
    """Columns of its curve, loaded to z = 1; the unloading ends at the force `lowest`."""
    up = np.linspace(0.0, 1.0, 41)[1:]
    depth = (C / K) ** (1 / 1.5)
    down = np.linspace(depth, (lowest / K) ** (1 / 1.5), 21)[1:] if unload else np.empty(0)
    delta, force = np.append(up, 1.0 - depth + down), np.append(C * up**1.2, K * down**1.5)
    curve: Columns = {"delta": delta, "force": force, "branch": ["load"] * up.size + ["unload"] * down.size}
    if strain:
        curve["max_plastic_strain"] = np.minimum(delta, 1.0) * 0.01
    if probe:
        curve["k_n_elastic"] = stiffness(force)
    return curve


def cycles() -> Columns:
    """Cycles to 1 with exponents of the unloading 1.5, 1.6 and 1.7, the last one to a force of 0.4 only."""
    rows = [(d, d**1.2, "load") for d in np.linspace(0, 1, 11)[1:]]
    for n, left, top in ((1.5, 0.40, 1.0), (1.6, 0.42, 1.0), (1.7, 0.44, 0.4)):
        start = left + (1 - left) * top ** (1 / n)
        for branch, path in (("reload", np.linspace(0.4, start, 9)[1:]), ("unload", np.linspace(start, left, 9)[1:])):
            rows += [(d, (max(d - left, 0.0) / (1 - left)) ** n, branch) for d in path]
    return dict(zip(("delta", "force", "branch"), map(np.array, zip(*rows, strict=True)), strict=True))


def few(rows: int, known: bool = True) -> Columns:
    """As `contact` with K = 2, an unloading of few rows, the top among them, and one where it separates."""
    up = np.linspace(0.0, 1.0, 41)[1:]
    down = np.arange(rows - 1, -1, -1) / rows
    force = np.append(up**1.2, down)
    curve: Columns = {"delta": np.append(up, 1.0 - 0.5 ** (1 / 1.5) + (0.5 * down) ** (1 / 1.5)), "force": force}
    curve |= {"branch": ["load"] * 40 + ["unload"] * rows, "max_plastic_strain": np.full(force.size, 0.01)}
    k = np.where(force > 0, stiffness(force) * np.append(force[:40], np.ones(rows)) ** 0.2, 0.0)
    return curve | ({"k_n_elastic": k} if known else {})


def late() -> Columns:
    """F = z^1.5 + 0.3 z^3, that yields above z = 0.9."""
    z = np.linspace(0.0, 1.0, 41)[1:]
    return {"delta": z, "force": z**1.5 + 0.3 * z**3, "max_plastic_strain": np.where(z > 0.9, 1e-3, 0.0)}


def repeated() -> Columns:
    """A measured curve of micrometres whose turning point is there twice."""
    d, up = np.linspace(1.0, 0.3, 12), np.linspace(0.0, 1.0, 24)
    return {
        "delta": 1e-6 * np.append(up, d), "force": 3e6 * np.append(up**1.5, ((d - 0.3) / 0.7) ** 1.5),
        "branch": ["load"] * 24 + ["unload"] * 12,
    }  # fmt: skip


Z = np.linspace(0.0, 1.0, 61)[1:]
HERTZ = {"step": range(60), "delta": Z, "force": Z**1.5}
SOFT = 1.2 * C ** (1 / 1.2) * (0.5 * C) ** (1 - 1 / 1.2)  # stiffness of the loading at half of its force


@pytest.mark.parametrize(
    ("curve", "asked", "load", "name", "k", "n", "near"),  # None: not compared
    [
        # after yield the elastic stiffness, of the unloading or of the tangent; the loading is half as stiff
        (contact(), "auto", None, "unload-reload", stiffness(0.5 * C), 1.5, 1e-6),
        (contact(unload=False, probe=True), "auto", 0.5 * C, "elastic", stiffness(0.5 * C), 1.5, 1e-4),
        (contact(probe=True, lowest=0.8 * C), "auto", 0.5 * C, "elastic", stiffness(0.5 * C), 1.5, 1e-4),
        (contact(unload=False), "auto", None, "paper", SOFT, 1.2, 1e-8),
        (contact(strain=False), "auto", None, "unload-reload", stiffness(0.5 * C), 1.5, 1e-6),
        (contact(strain=False, unload=False), "auto", None, "table", SOFT, 1.2, 1e-3),
        *((contact(probe=True), law, None, law, stiffness(0.5 * C), 1.5, 1e-3) for law in ("unload-reload", "elastic")),
        *((contact(probe=True), law, None, law, SOFT, 1.2, 1e-3) for law in ("table", "paper")),
        # plastic strain counts from where it begins
        (late(), "auto", 0.6**1.5 + 0.3 * 0.6**3, "table", 1.5 * 0.6**0.5 + 0.9 * 0.6**2, None, 1e-3),
        (late(), "auto", 1.25, "paper", None, None, 1e-3),
        # the last unloading that reaches the preload; reloadings do not count
        (cycles(), "unload-reload", 0.5, "unload-reload", 1.6 / 0.58 * 0.5 ** (1 - 1 / 1.6), 1.6, 1e-3),
        (cycles(), "unload-reload", 0.3, "unload-reload", 1.7 / 0.56 * 0.3 ** (1 - 1 / 1.7), 1.7, 1e-3),
        (repeated(), "auto", None, "unload-reload", 1.5 * 1.5e6 / (0.7e-6 * 0.5 ** (1 / 1.5)), 1.5, 1e-6),
        *((few(rows), "auto", 0.3, "unload-reload", stiffness(0.3), None, 1e-9) for rows in (1, 2, 3)),
        # below the first point a power law
        *((HERTZ, "table", load, "table", 1.5 * load ** (1 / 3), 1.5, 1e-6) for load in (1e-60, 1e-6, 0.3)),
    ],
)  # fmt: skip
def test_law_of_a_curve(curve: Columns, asked: str, load: float, name: str, k: float, n: float, near: float) -> None:
    """Name, stiffness, exponent and curvature; kappa of a power law is -(n - 1)(2n + 1)/48."""
    choice = choose(CurveColumns.of(curve), asked, load)
    assert choice.name == name
    law, z = choice.law, choice.law.deflection(choice.load)
    if k is not None:
        assert law.derivatives(z)[0] == pytest.approx(float(k), rel=near)
    if n is not None:
        assert law.n_loc(z) == pytest.approx(n, rel=near)
        assert law.kappa(z) == pytest.approx(-(n - 1) * (2 * n + 1) / 48, rel=max(3e-3, near))
    doubted = (name == "paper" and asked == "auto") or choice.load < 1e-5 or curve["delta"].size in (41, 42, 43)
    assert bool(choice.note) == doubted and (LACK in choice.note) == (name == "paper" and asked == "auto")


def test_a_lack_of_data_is_warned_of_and_has_no_bar() -> None:
    """No bar of the force, and no points of the loading, hold what is so far from the elastic stiffness."""
    for curve, load in ((contact(unload=False), None), (late(), 1.25), (HERTZ, 1e-6), (few(2, known=False), 0.3)):
        with pytest.warns(AsperityWarning):
            law_from(curve, load=load)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        law_from(contact())
    force = contact(unload=False)["force"]
    for more in ({}, {"P_star": force, "error_P_star": 0.01 * force}):
        result = run_dynamics(contact(unload=False) | more, **QUICK)
        assert LACK in result.notes and np.isnan(result.numbers.bars[0])
    case = {
        "surface": {"kind": "sphere", "L": 1e-6, "radius": 1e-5}, "dynamics": {},
        "material": {"E": 200e9, "nu": 0.3, "yield_strength": 1e9, "tangent_modulus": 1e10},
        "loading": {"delta_max": 1e-8, "unload": True, "unload_steps": 2},
    }  # fmt: skip
    for more in ({}, {"output": {"stiffness": True}}):
        with pytest.warns(UserWarning, match=r"loading\.unload_steps = 2"):
            Case.from_dict(case | more).problem()


def test_a_paper_law_depends_on_the_planned_rows_of_the_loading_alone(tmp_path: Path) -> None:
    """Not on substeps, rows before contact, units, or whether it is read from a file."""
    planned = np.linspace(0.0, 1.0, 9)[1:]

    def law(rows: np.ndarray, length: float = 1.0, force: float = 1.0) -> PowerLaw:
        z = np.maximum(rows, 0.0)
        found = law_from({"delta": length * rows, "force": force * (z**1.5 + 0.3 * z**4)}, "paper")[0]
        assert isinstance(found, PowerLaw)
        return found

    whole = law(planned)
    assert law(np.sort(np.append(planned, [0.01, 0.02, 0.04, 0.06, 0.6, 0.7]))) == whole
    assert law(planned, length=1.3e-8, force=7e-4).n == pytest.approx(whole.n, rel=1e-13)
    assert law(np.append([-0.1, 0.0], planned)).n == whole.n
    curve, path = contact(), tmp_path / "curve.csv"
    table = np.transpose([curve[name] for name in ("delta", "force", "branch")])
    np.savetxt(path, table, fmt="%s", delimiter=",", header="delta,force,branch", comments="")
    law_of_file = law_from(path, "paper")[0]
    assert law_of_file == law_from(tmp_path, "paper")[0] == law_from(curve, "paper")[0]


@pytest.mark.parametrize("digits", [16, 4])
def test_every_row_of_a_measured_curve_counts_for_the_paper_law(digits: int) -> None:
    z = np.round(np.linspace(0.25, 1.0, 32), digits)  # not only the rows at the multiples of the first approach
    rng = np.random.default_rng(0)
    found = [law_from({"delta": z, "force": z**1.8 * (1 + 0.01 * rng.standard_normal(32))}, "paper") for _ in range(20)]
    assert np.std([law.n for law, _ in found if isinstance(law, PowerLaw)]) < 0.014  # 0.026 with four rows


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
    found, true = (x.omega_s * x.free([1e-3, 0.15, 0.4]).omega_ratio for x in (o, exact))
    np.testing.assert_allclose(found, true, rtol=5e-3)


# --- error bars and limits ------------------------------------------------------------------------------------


def test_a_bar_of_the_curve_makes_that_of_the_frequency() -> None:
    """A force known to 4 % at any approach gives the stiffness to 4 (2/3) %; a frequency has half of it."""
    z = np.linspace(0.0, 1.0, 41)[1:]
    force = {"step": range(40), "delta": z, "force": z**1.5, "P_star": z**1.5, "error_P_star": 0.04 * z**1.5}
    tangent, both = contact(unload=False, probe=True), contact(probe=True)
    for curve in (tangent, both):
        curve["error_k_n_elastic"] = 0.06 * curve["k_n_elastic"]
    for curve, load, bar in ((force, 0.5, 1.0 - 0.96 ** (2 / 3)), (tangent, None, 0.06), (both, 0.3 * C, 0.06)):
        choice = choose(CurveColumns.of(curve), load=load)
        found = Numbers.of(choice.law, choice.load, 1.0, 0.01)
        assert found.bars[0] == pytest.approx(bar, rel=2e-2)
        assert found.frequency_bar == pytest.approx(0.5 * found.bars[0] * found.frequency, rel=1e-12)


def test_there_is_one_frequency_and_one_verdict_on_small_motion() -> None:
    """Printed, by the law, and as the limit of free vibration; a kappa whose bar holds zero is nowhere resolved."""
    z = np.linspace(0.0, 1.0, 21)[1:]
    second = np.maximum(z - 0.26, 0.0)  # the next summit is touched
    force = z**1.3 + 40 * second**1.5 / (1 + 6 * second)
    result = run_dynamics({"delta": z, "force": force}, preload=0.2 * float(force[-1]), **QUICK)
    o = result.first
    assert result.numbers.stiffness == pytest.approx(float(o.law.slope(o.z_s)), rel=1e-12)
    assert float(o.free(1e-5).omega_ratio[0]) == pytest.approx(1.0, abs=1e-4)
    assert result.numbers.frequency_bar > 0.0
    scattered = np.linspace(0.0, 1.0, 30) ** 1.5 + 0.02 * np.random.default_rng(2).standard_normal(30)
    result = run_dynamics({"delta": np.linspace(0.0, 1.0, 30), "force": scattered}, **QUICK)
    words = {result.numbers.to_dict()["softening"], result.thresholds["exact"].softening}
    assert words == {"curvature not resolved"}


def test_motion_about_the_greatest_force_met_yields_in_its_first_cycle() -> None:
    for curve, load, told in (
        (contact(unload=False, probe=True), 0.5 * C, True),
        (contact(probe=True), C, True),
        (contact(probe=True), 0.5 * C, False),
    ):
        notes = run_dynamics(curve, preload=load, **QUICK).notes
        assert any("motion yields in its first cycle" in note for note in notes) == told


def test_a_preload_just_above_a_curve_is_lowered_within_the_bar_of_its_force() -> None:
    curve = late() | {"step": range(40), "P_star": np.ones(40), "error_P_star": np.full(40, 0.02)}
    choice = choose(CurveColumns.of(curve), "table", 1.01 * 1.3)
    assert choice.load == 1.3 and "exceeds the greatest force of the curve by 1 %" in choice.note
    with pytest.raises(RangeError):
        choose(CurveColumns.of(curve), "table", 1.03 * 1.3)


# --- measured rows --------------------------------------------------------------------------------------------

START, LOAD = 3.2e-6, 20.0  # approach of first contact [m], preload [N]


def hertz(d: np.ndarray) -> np.ndarray:
    return 2e10 * np.maximum(d - START, 0.0) ** 1.5


def rows_of(count: int = 70, noise: float = 0.0) -> np.ndarray:
    """Rows of a measured contact of Hertz, whose scatter is a share of the preload."""
    d = np.linspace(2.9e-6, START + 1.5e-6, count)
    return np.column_stack([d, hertz(d) + noise * LOAD * np.random.default_rng(1).standard_normal(count)])


def write(path: Path, table: np.ndarray, head: str = "delta,force", scale: tuple[float, float] = (1.0, 1.0)) -> Path:
    np.savetxt(path, table * scale, delimiter=";" if ";" in head else ",", header=head, comments="")
    if ";" in head:
        path.write_text(path.read_text().replace(".", ","))  # of a German programme
    return path


def assert_found(path: Path, rel: float) -> CurveColumns:
    """That the law about the load is Hertz's, in its bars and by a relative bar of the stiffness; its columns."""
    columns = CurveColumns.of(path)
    choice = choose(columns, load=LOAD)
    z, n = (LOAD / 2e10) ** (1 / 1.5), 1.5
    values, bars = choice.law.at_load(choice.load), bar_of(choice.law, lambda side: side.at_load(choice.load))
    true = np.array([z, n * LOAD / z, n, -(n - 1) * (2 * n + 1) / 48])
    assert np.all(np.abs(values - true) <= bars + 1e-6 * np.abs(true)), (values, true, bars)
    assert bars[1] < rel * values[1]
    assert float(choice.done.partition("contact at ")[2].split()[0]) == pytest.approx(START, rel=0.01)
    return columns


def test_units_noise_holds_and_order_do_not_change_the_law(tmp_path: Path) -> None:
    for i, (head, *scale) in enumerate(
        (("delta,force", 1.0, 1.0), ("delta [um];force [mN]", 1e6, 1e3), ("delta (nm),force (kN)", 1e9, 1e-3))
    ):
        assert_found(write(tmp_path / f"unit{i}.csv", rows_of(), head, tuple(scale)), 1e-3)  # type: ignore[arg-type]
    table = rows_of(noise=0.01)
    held = np.column_stack([np.full(30, table[42, 0]), table[42, 1] * 0.999 ** np.arange(30)])
    shuffled = np.random.default_rng(3).permutation(table)
    for i, one in enumerate(
        (table, np.vstack([table[:43], held, table[43:]]), shuffled, table[::-1], np.vstack([table, table]))
    ):
        assert_found(write(tmp_path / f"{i}.csv", one), 0.05)
    # loading along F = C z, a hold that relaxes, and an unloading after Hertz, without a column of branches
    up = np.linspace([0.0, 0.0], [START + 1.5e-6, float(hertz(np.array(START + 1.5e-6)))], 60)
    hold = np.column_stack([np.full(5, up[-1, 0]), up[-1, 1] * (1 - 1e-3 * np.arange(1, 6))])
    columns = assert_found(write(tmp_path / "a.csv", np.vstack([up, hold, rows_of(80)[::-1]])), 0.02)
    assert choose(columns, load=LOAD).name == "unload-reload"


def test_a_kink_is_not_smoothed_away() -> None:
    """Rows without scatter are the law, however it bends; first contact is known to its bar."""
    z = np.linspace(0.0, 2.0, 201)
    choice = choose(CurveColumns.of({"delta": z, "force": z + 50.0 * np.maximum(z - 1.7, 0.0)}), load=1.0)
    found = choice.law.slope(choice.law.deflection(1.0) + np.array([0.0, 0.68, 0.72]))
    np.testing.assert_allclose(found, [1.0, 1.0, 51.0], rtol=0.01)
    assert bar_of(choice.law, lambda side: side.at_load(1.0))[0] > abs(choice.law.deflection(1.0) - 1.0)
