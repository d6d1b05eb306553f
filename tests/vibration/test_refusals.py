"""Input that is refused: no value of any argument crashes an analysis or makes numbers that are not finite."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from asperity.errors import AsperityError, InputError
from asperity.model.joint import Joint
from asperity.vibration import ContactOscillator, CurveLaw, DynamicsSettings, PowerLaw, law_from, run_dynamics

Z = np.linspace(0.0, 1.0, 61)[1:]
O = ContactOscillator(PowerLaw(1.5), zeta=0.05)  # noqa: E741
CURVE = {"delta": Z, "force": Z**1.5}
UNLOADED = {"delta": [*Z, 0.9], "force": [*Z**1.5, 0.5], "branch": ["load"] * 60 + ["unload"]}
QUICK: dict[str, Any] = {"model": "exact", "omega": (0.95, 1.05), "tol": 1e-3}
FEW = {"delta": Z[:4], "force": Z[:4]}
ONSET = "delta,force\n4000,.05\n4100,.05\n4200,.05\n4300,.051\n4400,.055\n4500,.061\n4600,.068\n4700,.077\n"
FALLS = "delta,force\n" + "\n".join(f"{d},{d * (3 - d)}" for d in np.linspace(0, 2.9, 30))


def sentence(error: AsperityError) -> str:
    """The text of a refusal: one short line."""
    text = str(error)
    assert text and "\n" not in text and text.isprintable() and len(text) < 1000
    return text


def run(**changes: Any) -> Any:
    return run_dynamics(PowerLaw(1.5), **QUICK | changes)


def of_file(text: str, folder: Path, law: str = "table") -> Any:
    (folder / "a.csv").write_text(text, encoding="utf-8")
    return law_from(folder / "a.csv", law)


def of_case(text: str, folder: Path) -> Any:
    (folder / "curve.csv").write_text("delta,force\n" + "\n".join(f"{z:g},{z**1.5:g}" for z in Z))
    (folder / "case.toml").write_text(f'units = "SI"\n{text}\n')
    return DynamicsSettings.of_source(folder)


#: What is wrong, as the sentence names it, and a call that has it; the folder is a new one.
ILLEGAL: list[tuple[str, Callable[[Path], Any]]] = [
    ("n = -1.5", lambda _: PowerLaw(-1.5)),
    ("n = 0.5", lambda _: PowerLaw(0.5)),
    ("K = nan", lambda _: PowerLaw(1.5, math.nan)),
    ("K = inf", lambda _: law_from({"delta": 1e-6 * Z, "force": Z**60}, "paper")),
    ("load = 1e+300", lambda _: ContactOscillator(PowerLaw(0.51), load=1e300)),
    ("zeta = -0.01", lambda _: ContactOscillator(PowerLaw(1.5), zeta=-0.01)),
    ("zeta = 1.5", lambda _: ContactOscillator(PowerLaw(1.5), zeta=1.5)),
    ("load = 0", lambda _: ContactOscillator(PowerLaw(1.5), load=0.0)),
    ("hunt-crossley", lambda _: ContactOscillator(PowerLaw(1.5), damping="coulomb")),
    ("law must be", lambda _: ContactOscillator(cast(Any, 1.5))),
    ("0 points", lambda _: CurveLaw(np.array([]), np.array([]))),
    ("at least 5", lambda _: CurveLaw(Z[:2], Z[:2])),
    ("force does not rise", lambda _: CurveLaw(Z, Z[::-1])),
    ("approach does not rise", lambda _: CurveLaw(Z[::-1], Z[::-1])),
    ("not finite", lambda _: CurveLaw(Z, np.where(Z > 0.5, np.nan, Z))),
    ("first contact", lambda _: CurveLaw(Z - 0.3, Z**1.5)),
    ("shapes", lambda _: CurveLaw(Z, Z[:5])),
    # curves
    ("unload", lambda _: law_from(CURVE, "unload-reload")),
    ("k_n_elastic", lambda _: law_from(CURVE, "elastic")),
    ("force 1", lambda _: law_from(CURVE, load=1.2)),
    ("force 1", lambda _: law_from(UNLOADED, "unload-reload", 1.2)),
    ("'force' is missing", lambda _: law_from({"delta": Z})),
    ("'force' is not finite in step 31", lambda _: law_from({"delta": Z, "force": np.where(Z > 0.5, np.nan, Z)})),
    ("9 of force", lambda _: law_from({"delta": Z, "force": Z[:9]})),
    ("branch 'loading'", lambda _: law_from(CURVE | {"branch": ["loading"] * Z.size})),
    ("4 approaches", lambda _: law_from(FEW)),
    ("falls by", lambda _: law_from({"delta": Z, "force": np.where(Z > 0.6, 0.3, 1.0) * Z})),
    ("nowhere.csv", lambda _: law_from("nowhere.csv")),
    ("hertz", lambda _: law_from(CURVE, law="hertz")),
    ("1e-100", lambda _: run_dynamics({"delta": 1e-308 * Z, "force": Z})),
    ("1e-100", lambda _: run_dynamics({"delta": Z, "force": 1e-320 * Z})),
    ("1e+100", lambda _: run_dynamics({"delta": 1e300 * Z, "force": Z})),
    # files
    ("65 % of", lambda folder: of_file(ONSET, folder)),
    ("has no unit", lambda folder: of_file("delta [um],force\n1,2\n2,3\n", folder)),
    ("the unit 'lb' of force", lambda folder: of_file("delta [um],force [lb]\n1,2\n2,3\n", folder)),
    ("columns delta and force", lambda folder: of_file("Weg,Kraft\n1,2\n2,3\n", folder)),
    ("falls by", lambda folder: of_file(FALLS, folder)),
    ("compression counts positive", lambda folder: of_file("delta,force\n1,-2\n2,-3\n3,-4\n4,-5\n5,-6\n", folder)),
    ("3 approaches", lambda folder: of_file("delta,force\n1,1\n2,2\n3,3\n", folder)),
    ("no numbers", lambda folder: of_file("", folder)),
    *(  # keys of a former version
        (f"{section}.{key}", lambda folder, s=section, k=key: of_case(f"[{s}]\n{k} = 0.1", folder))
        for section, key in (("joint", "frequency"), ("joint", "damping"), ("dynamics", "overload"))
    ),
    # motion
    ("u0 = nan", lambda _: O.free(np.nan)),
    ("u0 is empty", lambda _: O.free([])),
    ("forcing = 'much'", lambda _: O.response(cast(Any, "much"))),
    ("forcing = -0.1", lambda _: O.response(-0.1)),
    ("tol = 0", lambda _: O.response(0.1, tol=0.0)),
    ("omega", lambda _: O.response(0.1, (1.3, 0.5))),
    ("omega", lambda _: O.response(0.1, (0.5,))),
    ("zeta of forced motion", lambda _: ContactOscillator(PowerLaw(1.5), zeta=0.0).response(0.1)),
    ("outside the computed window", lambda _: O.response(0.05, (0.9, 0.91)).at(2.0)),
    ("u = nan", lambda _: O.simulate(1.0, 0.1, u=np.nan)),
    ("omega = 1e-09", lambda _: O.simulate(1e-9, 0.1)),
    ("forcing = 1e+300", lambda _: O.simulate(1.0, 1e300)),
    # whole analyses
    ("damping", lambda _: run(damping="no")),
    ("load", lambda _: run(preload=-1.0)),
    ('did you mean "model"', lambda _: run(modle="exact")),
    ("units = 'cgs'", lambda _: run(units="cgs")),
    ("give all with one unit", lambda _: run(forcing=["2 N", 0.1])),
    ("give all with one unit", lambda _: run(forcing=("1 N", "1 m"))),
    ("'2 K'", lambda _: run(forcing="2 K")),
    ('units = "other"', lambda _: run(forcing="2 N", units="other")),
    ("low < high", lambda _: run(omega=["2 kHz", "1 kHz"])),
    ("simulate", lambda _: run(forcing="1 m", simulate="step")),
    ("omega = 1e-06", lambda _: run(omega=("1e-6 Hz", "1 Hz"))),
    ("pulse = 1e-09", lambda _: run(simulate="half-sine", pulse=1e-9)),
    ("need the mass", lambda _: run(omega=("1 Hz", "2 Hz"), joint=Joint(preload=1.0))),
    ("nominal area of the patch", lambda _: run_dynamics(CURVE, joint=Joint(nominal_area=1.0))),
    ("joint.nominal_area", lambda _: run(joint=Joint(nominal_area=1.0))),
    ("the joint has its own", lambda _: run(joint=Joint(mass=1.0), gravity=9.81)),
]


@pytest.mark.parametrize(("words", "call"), ILLEGAL, ids=[f"{i} {words}" for i, (words, _) in enumerate(ILLEGAL)])
def test_an_illegal_input_is_refused_by_its_name(words: str, call: Callable[[Path], Any], tmp_path: Path) -> None:
    with pytest.raises(InputError) as error:
        call(tmp_path)
    assert words in sentence(error.value)


def test_a_refused_analysis_writes_nothing(tmp_path: Path) -> None:
    with pytest.raises(InputError):
        run(forcing="2 K", out_dir=tmp_path / "out")
    assert not (tmp_path / "out").exists()


TEN_TO = st.floats(-320, 308).map(lambda e: 10.0**e)
ANY = st.floats() | TEN_TO | st.sampled_from([0.0, -1.0, 1e-9, 0.5, 1.0])
PAIR = st.tuples(ANY, ANY)


def finite_motion(path: Any) -> bool:
    return bool(np.isfinite([*path.u, *path.v]).all())


#: Arguments of each call, and whether what it returns is finite.
CALLS: dict[str, tuple[Callable[..., bool], dict[str, st.SearchStrategy[Any]]]] = {
    "law": (lambda n, K, z: np.isfinite(PowerLaw(n, K).at(z)).all(), {"n": ANY, "K": ANY, "z": st.floats(0, 1)}),
    "free": (lambda **k: np.isfinite(O.free(**k).omega_ratio).all(), {"u0": ANY | st.lists(ANY, max_size=3)}),
    "motion": (
        lambda **k: finite_motion(O.simulate(samples=4, periods=2, **k)),
        {"omega": ANY | PAIR, "forcing": ANY, "u": ANY, "v": ANY, "shape": st.sampled_from(["step", "chirp", "sine"])},
    ),
    "analysis": (
        lambda load, n, K, **k: finite_analysis(n, K, preload=load, **k),
        {
            "n": st.floats(0.51, 100) | TEN_TO, "K": st.just(1.0) | TEN_TO, "load": st.none() | TEN_TO,
            "zeta": st.floats(0.001, 0.999) | TEN_TO, "forcing": st.floats(1e-9, 0.2) | TEN_TO,
            "damping": st.sampled_from(["always", "contact", "hunt-crossley"]),
        },
    ),
}  # fmt: skip


def finite_analysis(n: float, K: float, **options: Any) -> bool:
    result = run_dynamics(PowerLaw(n, K), omega=(0.95, 1.05), tol=1e-3, **options)
    json.dumps(result.to_dict(), allow_nan=False)
    return all(np.isfinite([*b.u_max, *b.u_min]).all() for r in result.responses["exact"] for b in r.pieces)


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize(("name", "number"), [("law", 100), ("free", 30), ("motion", 30), ("analysis", 12)])
def test_any_input_gives_finite_results_or_a_sentence(name: str, number: int) -> None:
    call, arguments = CALLS[name]

    @settings(max_examples=number, deadline=None, derandomize=True, database=None)
    @given(st.fixed_dictionaries(arguments))
    def holds(given_arguments: dict[str, Any]) -> None:
        try:
            assert call(**given_arguments)
        except AsperityError as error:
            sentence(error)
            assert error.exit_code in (2, 3)

    holds()
