"""The result of a run in sentences."""

from __future__ import annotations

from pathlib import Path

import asperity as asp
from asperity.output.results import Results
from asperity.output.verdict import verdict

ROW = {"delta": 1e-9, "force": 2e-6, "P_star": 4e-5, "area_fraction": 0.01}


def sentences(**columns: float) -> list[str]:
    """Of a run in SI units that ends with a row of these columns, after a lighter step."""
    rows = [ROW | {"force": 1e-6}, ROW | columns]
    return verdict(Results(Path("out"), asp.Curve.from_rows(rows), case={"units": "SI"}))


def test_stiffness_of_the_largest_force_with_its_bar() -> None:
    said = sentences(k_n_elastic=2.5e3, error_k_n_elastic=25.0, k_t=2.0e3)
    assert "Elastic stiffness of the patch there: normal 2.50 kN/m ± 1 % and tangential, without slip, 2 kN/m." in said


def test_numbers_have_the_digits_of_their_bars() -> None:
    said = " ".join(sentences(force=2.86812e-6, error_P_star=3.2e-6, k_n_elastic=3.6062e3, error_k_n_elastic=288.5))
    assert "The force on the patch is 2.87 µN ± 8 %" in said and "normal 3.61 kN/m ± 8 %" in said
    said = " ".join(sentences(area_fraction=0.123456, error_area_fraction=0.0045))
    assert "; 12.35 % ± 0.45 percentage points of the nominal area is in contact" in said
    said = " ".join(sentences(area_fraction=0.85, error_area_fraction=1.8))  # what a share of the patch can be wrong
    assert "; 85 % ± 85 percentage points of the nominal area is in contact" in said


def test_each_number_names_the_patch_or_the_joint() -> None:
    """The vibration is about a load, and has the bar of its stiffness."""
    found = {"numbers": {"k_n": 2.8581e9, "f": 3804.4, "k_n_bar": 0.08}, "load": 1e4}
    curve = asp.Curve.from_rows([ROW])
    *_, last = verdict(Results(Path("out"), curve, case={"units": "SI"}, thresholds=found))
    assert last == ("Patch about 10 kN: stiffness 2.9 GN/m, frequency 3.8 kHz (of the stiffness: numerical error 8 %).")
    doubt = found | {"laws": {"doubt": "two rows show no curvature"}}
    said = verdict(Results(Path("out"), curve, case={"units": "SI"}, thresholds=doubt))
    assert said[-1] == "Its law is doubtful: two rows show no curvature."
