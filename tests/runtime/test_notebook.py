"""Data frames, and what a notebook shows."""

from __future__ import annotations

import sys
from xml.etree import ElementTree

import numpy as np
import pytest
from conftest import make_curve

from asperity.curve import COLUMNS, Curve
from asperity.errors import CompatError, InputError
from asperity.job.run_case import RunResult
from asperity.surface import Flat, Sinusoid


def test_a_data_frame_has_the_columns_of_the_file() -> None:
    pandas = pytest.importorskip("pandas")
    curve = make_curve(case="sphere")
    frame = curve.to_pandas()
    assert isinstance(frame, pandas.DataFrame) and tuple(frame.columns) == COLUMNS and frame.attrs["case"] == "sphere"
    np.testing.assert_array_equal(frame["force"], curve.force)


def test_an_array_with_coordinates() -> None:
    pytest.importorskip("xarray")
    wave = Sinusoid(L=2.0, amplitude=0.1)
    found = wave.to_xarray(9)
    assert found.dims == ("y", "x") and float(found.x[-1]) == 2.0
    assert float(found.sel(x=1.0, y=0.0)) == pytest.approx(float(wave.height(1.0, 0.0)))


def test_what_is_not_installed_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(CompatError, match="the package pandas is not installed: pip install pandas"):
        make_curve().to_pandas()


def test_pictures_are_well_formed_and_escaped() -> None:
    curve = make_curve()
    for shown in (curve, Curve.from_rows([]), Sinusoid(L=1.0, amplitude=0.1), Flat(L=1.0)):
        ElementTree.fromstring(shown._repr_html_())
    result = RunResult(curve, None, {"slip": {"in_words": ["<b>"]}}, None)
    assert "&lt;b&gt;" in result._repr_html_() and "<img" in result._repr_html_()


def test_a_result_draws_itself() -> None:
    result = RunResult(make_curve(), None, {}, None)
    assert len(result.plot().axes) >= 3
    with pytest.raises(InputError, match="there is no figure 'slip' of this result: choose"):
        result.plot("slip")
