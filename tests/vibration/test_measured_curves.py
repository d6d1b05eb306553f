"""Measured curves: the law found again in rows that scatter, hold, repeat and begin before contact; refusals."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from asperity.errors import InputError
from asperity.vibration.law import bar_of
from asperity.vibration.source import CurveColumns, choose

START = 3.2e-6  # approach of first contact [m]
LOAD = 20.0  # [N]


def hertz(d: np.ndarray) -> np.ndarray:
    return 2e10 * np.maximum(d - START, 0.0) ** 1.5


def rows(count: int = 200, noise: float = 0.0, begin: float = 2.9e-6, seed: int = 1) -> np.ndarray:
    d = np.linspace(begin, START + 1.5e-6, count)
    return np.column_stack([d, hertz(d) + noise * LOAD * np.random.default_rng(seed).standard_normal(count)])


def write(path: Path, table: np.ndarray, head: str = "delta,force", scale: tuple[float, float] = (1.0, 1.0)) -> Path:
    np.savetxt(path, table * scale, delimiter=";" if ";" in head else ",", header=head, comments="")
    return path


def assert_found(path: Path, rel: float, n: float = 1.5, load: float = LOAD, start: float = START) -> str:
    """That the law about the load is Hertz's, in its bars and by a relative bar of the stiffness; what was done."""
    choice = choose(CurveColumns.of(path), load=load)
    z = (load / 2e10) ** (1 / 1.5)
    values, bars = choice.law.at_load(choice.load), bar_of(choice.law, lambda side: side.at_load(choice.load))
    true = np.array([z, n * load / z, n, -(n - 1) * (2 * n + 1) / 48])
    assert np.all(np.abs(values - true) <= bars + 1e-6 * np.abs(true)), (values, true, bars)
    assert bars[1] < rel * values[1]
    assert f"contact at {start:.2g}"[:12] in choice.done
    return choice.done


@pytest.mark.parametrize(
    ("head", "scale"),
    [("delta,force", (1.0, 1.0)), ("delta [um];force [mN]", (1e6, 1e3)), ("delta (nm),force (kN)", (1e9, 1e-3))],
)
def test_units_are_those_of_the_heading(tmp_path: Path, head: str, scale: tuple[float, float]) -> None:
    file = write(tmp_path / "a.csv", rows(), head, scale)
    if ";" in head:
        file.write_text(file.read_text().replace(".", ","))  # of a German programme
    assert_found(file, 1e-3)


def test_noise_holds_and_order_do_not_change_the_law(tmp_path: Path) -> None:
    table = rows(noise=0.01)
    held = np.vstack(
        [table[:120], np.column_stack([np.full(30, table[119, 0]), table[119, 1] * 0.999 ** np.arange(30)])]
    )
    shuffled = np.random.default_rng(3).permutation(table)
    for i, one in enumerate((table, np.vstack([held, table[120:]]), shuffled, table[::-1], np.vstack([table, table]))):
        done = assert_found(write(tmp_path / f"{i}.csv", one), 0.05)
    assert "rows before contact dropped" in done and "200 of equal approach averaged" in done and "noise" in done


def test_an_unloading_is_split_off(tmp_path: Path) -> None:
    """Loading along F = C z, a hold that relaxes, and an unloading after Hertz, without a column of branches."""
    up = np.column_stack(
        [np.linspace(0.0, START + 1.5e-6, 60), np.linspace(0.0, 1.0, 60) * hertz(np.array(START + 1.5e-6))]
    )
    hold = np.column_stack([np.full(5, up[-1, 0]), up[-1, 1] * (1 - 1e-3 * np.arange(1, 6))])
    down = rows(80, begin=2.9e-6)[::-1]
    choice = choose(CurveColumns.of(write(tmp_path / "a.csv", np.vstack([up, hold, down]))), load=LOAD)
    assert choice.name == "unload-reload" and "unloading in the 85 rows" in CurveColumns.of(tmp_path / "a.csv").notes[0]
    assert_found(tmp_path / "a.csv", 0.02)


def test_a_repeated_turning_point_keeps_the_law_of_the_unloading() -> None:
    """F = 3e6 ((z - 0.3)/0.7)^1.5 after a loading with the exponent 1.5: stiffness and frequency in closed form."""
    d, up = np.linspace(1.0, 0.3, 12), np.linspace(0.0, 1.0, 24)
    curve = {
        "delta": 1e-6 * np.append(up, d), "force": 3e6 * np.append(up**1.5, ((d - 0.3) / 0.7) ** 1.5),
        "branch": ["load"] * 24 + ["unload"] * 12,
    }  # fmt: skip
    choice = choose(CurveColumns.of(curve))
    k = 1.5 * 1.5e6 / (0.7e-6 * 0.5 ** (1 / 1.5))
    assert choice.name == "unload-reload" and not choice.note
    assert choice.law.at_load(choice.load)[1] == pytest.approx(k, rel=1e-6)


def test_a_kink_is_not_smoothed_away() -> None:
    """Rows without scatter are the law, however it bends; first contact is known to its bar."""
    z = np.linspace(0.0, 2.0, 201)
    choice = choose(CurveColumns.of({"delta": z, "force": z + 50.0 * np.maximum(z - 1.7, 0.0)}), load=1.0)
    stiffness = choice.law.slope(choice.law.deflection(1.0) + np.array([0.0, 0.68, 0.72]))
    np.testing.assert_allclose(stiffness, [1.0, 1.0, 51.0], rtol=0.01)
    assert bar_of(choice.law, lambda side: side.at_load(1.0))[0] > abs(choice.law.deflection(1.0) - 1.0)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (
            "delta,force\n4000,.05\n4100,.05\n4200,.05\n4300,.051\n4400,.055\n4500,.061\n4600,.068\n4700,.077\n",
            "65 % of",
        ),
        ("delta [um],force\n1,2\n2,3\n", "approach or force has no unit"),
        ("delta [um],force [lb]\n1,2\n2,3\n", "the unit 'lb' of force is unknown"),
        ("Weg,Kraft\n1,2\n2,3\n", "must name columns delta and force"),
        ("delta,force\n" + "\n".join(f"{d},{d * (3 - d)}" for d in np.linspace(0, 2.9, 30)), "falls by"),
        ("delta,force\n1,-2\n2,-3\n3,-4\n4,-5\n5,-6\n", "compression counts positive"),
        ("delta,force\n1,1\n2,2\n3,3\n", "3 approaches, at least 5"),
        ("", "there are no numbers in it"),
    ],
)
def test_what_is_no_law_of_a_contact_is_refused(tmp_path: Path, content: str, words: str) -> None:
    (tmp_path / "a.csv").write_text(content, encoding="utf-8")
    with pytest.raises(InputError) as caught:
        choose(CurveColumns.of(tmp_path / "a.csv"), "table")
    assert words in str(caught.value)
