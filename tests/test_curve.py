"""Curve records, files, fits and comparisons."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import curve_fit
from scipy.stats import linregress
from scipy.stats import t as student

from asperity.curve import (
    COLUMNS,
    Curve,
    compare_curves,
    fit_power_law,
    interface_deflection,
)
from asperity.errors import InputError


def make_curve(**header: object) -> Curve:
    """Return two loading steps, one unloading and one reloading step with awkward numbers."""
    rng = np.random.default_rng(5)
    rows = []
    for step, branch in enumerate(("load", "load", "unload", "reload")):
        numbers = {name: float(rng.uniform() * 10.0 ** rng.integers(-12, 12)) for name in COLUMNS}
        rows.append({**numbers, "step": step, "branch": branch, "newton": 4, "krylov": 37})
    rows[1]["error_P_star"] = math.nan
    return Curve.from_rows(rows, header)


def test_columns_are_those_of_the_file_format():
    assert ",".join(COLUMNS) == (
        "step,branch,delta,delta_star,force,P_star,area_fraction,max_pressure,plastic_fraction,"
        "max_plastic_strain,error_P_star,newton,krylov,seconds"
    )


@pytest.mark.parametrize("header", [{}, {"case": "sphere", "tolerances": {"force": 0.01}}])
def test_csv_is_lossless(tmp_path, header):
    curve = make_curve(**header)
    path = tmp_path / "curve.csv"
    curve.write(path)
    copy = Curve.read(path)
    assert copy.header == header
    for name in COLUMNS:
        a, b = getattr(curve, name), getattr(copy, name)
        assert a.dtype.kind == b.dtype.kind
        np.testing.assert_array_equal(a, b)
    assert path.read_text().startswith("#") == bool(header)
    assert list(tmp_path.iterdir()) == [path]


def test_branches_and_rows():
    curve = make_curve()
    assert len(curve) == 4
    assert [len(c) for c in (curve.loading(), curve.unloading(), curve.reloading())] == [2, 1, 1]
    assert curve.unloading().step.tolist() == [2]
    row = list(curve.rows())[2]
    assert row["branch"] == "unload" and type(row["newton"]) is int and type(row["force"]) is float


def test_curves_are_immutable():
    curve = make_curve()
    with pytest.raises(AttributeError):
        curve.force = np.zeros(4)  # type: ignore[misc]
    with pytest.raises(ValueError, match="read-only"):
        curve.force[0] = 1.0


def test_a_measured_curve_needs_only_deflection_and_force(tmp_path):
    path = tmp_path / "measured.csv"
    path.write_text("delta, force\n1e-9,2\n2e-9,5\n")
    curve = Curve.read(path)
    assert curve.force.tolist() == [2, 5]
    assert curve.step.tolist() == [0, 1] and set(curve.branch) == {"load"}
    assert np.isnan(curve.P_star).all() and not curve.newton.any()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "no column names; expected step,branch"),
        ("delta,forces\n1,2\n", r"unknown column 'forces' \(did you mean 'force'\?\)"),
        ("delta,P_star\n1,2\n", "column 'force' is missing"),
        ("delta,force,delta\n1,2,3\n", "occurs twice"),
        ("delta,force\n1\n", "line 2: 1 values for 2 columns"),
        ("delta,force\n1,2\n3,four\n", "line 3: force = 'four' is not a number"),
        ("# {}\ndelta,force,newton\n1,2,1.5\n", "line 3: newton = '1.5'"),
        ("# no json\ndelta,force\n", "line 1: the header is not JSON"),
        ("# [1]\ndelta,force\n", "line 1: the header must be a JSON object"),
        ("delta,force\n1,nan\n", "'force' is not finite in row 0"),
        ("delta,force,branch\n1,2,up\n", "Unknown branch 'up'; legal: load, unload, reload"),
    ],
)
def test_bad_files_are_refused(tmp_path, text, message):
    path = tmp_path / "curve.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=message):
        Curve.read(path)


def test_missing_and_binary_files_are_refused(tmp_path):
    with pytest.raises(InputError, match="cannot be read as a curve"):
        Curve.read(tmp_path / "none.csv")
    (tmp_path / "curve.csv").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="cannot be read as a curve"):
        Curve.read(tmp_path / "curve.csv")


@pytest.mark.parametrize("norm", ["linear", "log"])
@pytest.mark.parametrize(("k", "n"), [(2.0, 1.5), (1e6, 3.2), (1e-4, 0.8)])
def test_fit_recovers_an_exact_law(norm, k, n):
    d = np.linspace(0.001, 0.03, 12)
    fit = fit_power_law(d, k * d**n, norm)
    assert (fit.k, fit.n) == (pytest.approx(k, rel=1e-10), pytest.approx(n, rel=1e-10))
    assert fit.r2 == pytest.approx(1.0, abs=1e-14)
    assert fit.ci_n[0] <= fit.n <= fit.ci_n[1] and fit.ci_n[1] - fit.ci_n[0] < 1e-9
    assert fit.points == 12 and fit.range == (0.001, 0.03) and fit.norm == norm
    np.testing.assert_allclose(fit([-1.0, 0.0, 0.01]), [0, 0, k * 0.01**n])


def bent_law() -> tuple[np.ndarray, np.ndarray]:
    """Return a curve that no power law follows: cubic at first, then stiff and straight."""
    d = np.linspace(0.002, 0.04, 25)
    return d, d**3 / (0.01 + d) ** 2 * (1 + 0.02 * np.sin(900 * d))


def test_linear_fit_against_curve_fit():
    d, p = bent_law()
    fit = fit_power_law(d, p)
    (k, n), covariance = curve_fit(lambda d, k, n: k * d**n, d, p, p0=(1.0, 1.5), xtol=1e-14)
    assert (fit.k, fit.n) == (pytest.approx(k, rel=1e-6), pytest.approx(n, rel=1e-6))
    half = student.ppf(0.975, 23) * math.sqrt(covariance[1, 1])
    assert fit.ci_n == (pytest.approx(n - half, rel=1e-4), pytest.approx(n + half, rel=1e-4))
    relative = student.ppf(0.975, 23) * math.sqrt(covariance[0, 0]) / k  # delta method
    assert math.log(fit.ci_k[1] / fit.k) == pytest.approx(relative, rel=1e-3)
    assert fit.correlation == pytest.approx(covariance[0, 1] / math.sqrt(covariance[0, 0] * covariance[1, 1]), abs=1e-4)
    residual = p - k * d**n
    assert fit.r2 == pytest.approx(1 - residual @ residual / np.sum((p - p.mean()) ** 2))


def test_log_fit_against_linear_regression():
    d, p = bent_law()
    fit = fit_power_law(d, p, norm="log", confidence=0.9)
    line = linregress(np.log(d), np.log(p))
    half = student.ppf(0.95, 23) * line.stderr
    assert fit.n == pytest.approx(line.slope)
    assert fit.ci_n == (pytest.approx(line.slope - half), pytest.approx(line.slope + half))
    half = student.ppf(0.95, 23) * line.intercept_stderr
    assert fit.ci_k == (
        pytest.approx(math.exp(line.intercept - half)),
        pytest.approx(math.exp(line.intercept + half)),
    )
    assert fit.r2 == pytest.approx(line.rvalue**2)


def test_norms_differ_on_a_bent_curve():
    d, p = bent_law()
    assert fit_power_law(d, p, "log").n - fit_power_law(d, p, "linear").n > 0.1


def test_intervals_cover_the_truth_as_often_as_they_say():
    rng, hits = np.random.default_rng(0), 0
    d = np.linspace(0.002, 0.02, 8)
    for _ in range(400):
        fit = fit_power_law(d, 3.0 * d**1.5 + rng.normal(0, 1e-5, d.size))
        hits += fit.ci_n[0] <= 1.5 <= fit.ci_n[1]
    assert 0.92 < hits / 400 < 0.98


def test_fit_of_a_curve_takes_its_loading_branch():
    d = np.array([0.0, 1, 2, 3, 4, 3, 2]) * 1e-2
    branch = ["load"] * 5 + ["unload"] * 2
    p = np.where(np.array(branch) == "load", d**2, 0.5 * d**3)
    rows = [
        {"delta": a, "delta_star": a, "force": b, "P_star": b, "branch": c}
        for a, b, c in zip(d, p, branch, strict=True)
    ]
    fit = Curve.from_rows(rows).fit()
    assert (fit.n, fit.points) == (pytest.approx(2.0), 4)
    assert set(fit.to_dict()) == {"k", "n", "norm", "range", "points", "r2", "ci"}


def test_stiffness_has_units():
    d = np.linspace(0.01, 0.05, 5)
    fit = fit_power_law(d, 2.0 * d**1.5)
    L, E_prime, delta = 1e-6, 2e11, 2e-8
    force = float(fit(delta / L)) * L**2 * E_prime
    assert fit.stiffness(E_prime, L) * delta**1.5 == pytest.approx(force)


@pytest.mark.parametrize(
    ("d", "p", "options", "message"),
    [
        ([1, 2], [1, 2], {}, "2 different deflections: a power law needs at least 3"),
        ([1, 1, 1, 2], [1, 1, 1, 2], {}, "2 different deflections"),
        ([0, 1, 2], [0, 1, 2], {}, r"delta\* = 0 at point 0"),
        ([1, 2, 3], [1, -2, 3], {}, r"P\* = -2 at point 1"),
        ([1, 2, 3], [1, 2, math.nan], {}, r"P\* = nan at point 2"),
        ([1, 2, 3], [1, 2], {}, "two lists of one length"),
        ([1, 2, 3], [1, 2, 3], {"norm": "cubic"}, "norm must be"),
        ([1, 2, 3], [1, 2, 3], {"confidence": 1.0}, "confidence must lie between 0 and 1"),
    ],
)
def test_impossible_fits_are_refused(d, p, options, message):
    with pytest.raises(InputError, match=message):
        fit_power_law(d, p, **options)


def test_interface_deflection_of_a_flat_block_is_zero():
    strain, M, L, height = np.array([0.001, 0.01]), 3.0, 2.0, 0.5
    force = M * strain * L**2
    rest = interface_deflection(strain * height, force, height=height, area=L**2, modulus=M)
    np.testing.assert_allclose(rest, 0, atol=1e-18)


def change(curve: Curve, row: int, **values: object) -> Curve:
    """Return the curve with one row changed."""
    rows = list(curve.rows())
    rows[row] |= values
    return Curve.from_rows(rows, curve.header)


def test_equal_curves_have_no_differences():
    assert compare_curves(make_curve(), make_curve()) == []
    assert compare_curves(make_curve(), change(make_curve(), 1, seconds=9.0, krylov=1)) == []


def test_differences_name_column_row_and_size():
    reference = make_curve()
    largest = reference.force.max()
    other = change(reference, 2, force=reference.force[2] + 0.01 * largest)
    (difference,) = compare_curves(other, reference)
    assert (difference.column, difference.row) == ("force", 2)
    assert difference.error == pytest.approx(0.01)
    assert "relative difference 0.01 > 1e-06" in str(difference)
    assert compare_curves(other, reference, {"force": 0.011}) == []
    assert compare_curves(other, reference, {"P_star": 0.0}) == []


def test_tolerances_come_with_the_stored_curve():
    reference = make_curve(tolerances={"force": 0.02})
    other = change(reference, 2, force=reference.force[2] + 0.01 * reference.force.max(), delta=1.0)
    assert compare_curves(other, reference) == []


def test_a_value_that_turns_into_nan_is_a_difference():
    reference = make_curve()
    (difference,) = compare_curves(change(reference, 0, P_star=math.nan), reference)
    assert difference.column == "P_star" and difference.error == math.inf


def test_steps_must_correspond():
    curve = make_curve()
    (shorter,) = compare_curves(curve.where(np.arange(3)), curve)
    assert str(shorter) == "rows: 3 steps against 4 steps, first at row 3"
    (branch,) = compare_curves(change(curve, 1, branch="unload"), curve)
    assert (branch.column, branch.row) == ("rows", 1)


@pytest.mark.parametrize("tolerances", [{"force": -1.0}, {"forces": 1.0}, {"branch": 1.0}])
def test_bad_tolerances_are_refused(tolerances):
    with pytest.raises(InputError):
        compare_curves(make_curve(), make_curve(), tolerances)
