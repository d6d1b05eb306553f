"""The contact of a run for other programs: nominal pressure over the approach of the mean planes.

In a model of the joint's bodies their own compliance must not count twice: the approach is that of the mean planes of
the two faces, from first touch, without the compression of the block. The programs read their tables linearly: the
points are chosen by the error of linear reading.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from textwrap import wrap

import numpy as np

from asperity.arrays import Array, Flags
from asperity.case import Case
from asperity.curve import Curve
from asperity.curve.power_law import interface_approach
from asperity.errors import InputError
from asperity.model.joint import Joint
from asperity.output.results import Results
from asperity.runtime.display import comment
from asperity.runtime.files import replace_file
from asperity.runtime.run_folder import EXPORTS
from asperity.slip import SlipLaw
from asperity.slip.joint_slip import slip_of_case
from asperity.units import per_cent
from asperity.version import __version__
from asperity.vibration.curve_law import CurveLaw
from asperity.vibration.source import CurveColumns, choose

LAWS = ("table", "unload-reload")
LINEAR = 0.01  # error of the pressure that linear reading may add
_WIDTH = 110  # of a comment in a deck
_BELOW = 0.125  # of the first computed point, down to which its power law is read
_DENSE = 64  # points of the law from one computed point to the next


@dataclass(frozen=True, eq=False)
class Interface:
    """The rough interface per nominal area.

    Attributes:
        approach: of the mean planes from first touch, or from where an unloading separates, rising (m,) [length]
        pressure: nominal, rising (m,) [force/length^2]
        k_n: slope of the pressure (m,) [force/length^3]
        about: units and origin of the numbers, one line each
        slip: of the interface of the patch, None for a case without [slip]
        patch: nominal area of the patch [length^2]
    """

    approach: Array
    pressure: Array
    k_n: Array
    about: tuple[str, ...]
    slip: SlipLaw | None
    patch: float

    def points(self, most: int, widest: float) -> tuple[Interface, float]:
        """Few points between which linear reading is off by LINEAR at most, and by how much it is off.

        A chord of the length h is off by h^2 p''/(8 p): steps of equal h sqrt(p''/p) are off by the same share.

        Args:
            most: number of points; where LINEAR takes more, the error is greater
            widest: ratio of the greatest to the least approach
        """
        first = int(np.searchsorted(self.approach, self.approach[-1] / widest))
        z, p, k = (column[first:] for column in (self.approach, self.pressure, self.k_n))
        bend = np.sqrt(np.abs(np.gradient(k, z)) / p) + 1e-6 / z[-1]  # steps rise where the law is straight, too
        steps = np.append(0.0, np.cumsum(0.5 * (bend[1:] + bend[:-1]) * np.diff(z)))
        error, count = math.inf, min(max(math.ceil(steps[-1] / math.sqrt(8.0 * LINEAR)), 1), most - 1)
        while error > LINEAR and count < most:
            count += 1
            rows = np.unique(np.searchsorted(steps, np.linspace(0.0, steps[-1], count)))
            error = float(np.abs(np.interp(z, z[rows], p[rows]) / p - 1.0).max())
        return replace(self, approach=z[rows], pressure=p[rows], k_n=k[rows]), error


#: File of a program: its comments, its text with comments {head}, points {rows} and {friction}, and a row of a point
#: with approach {z}, pressure {p} and slope {k}.
DECK = ("**", "{head}\n*SURFACE INTERACTION, NAME=ASPERITY\n*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=TABULAR\n0., 0.\n"
        "{rows}\n{friction}", "{p:.8e}, {z:.8e}")  # fmt: skip
TABLE = ("#", "{head}\napproach,pressure,k_n\n{rows}\n", "{z!r},{p!r},{k!r}")
#: Friction of a deck, with {mu}, the stick slope {stick}, and the slip {slip} at which friction has its limit.
FRICTION = {
    "calculix": "*FRICTION\n{mu:g}, {stick:.8e}\n",
    "abaqus": "*FRICTION, ELASTIC SLIP={slip:.8e}\n{mu:g},\n",
}
#: CalculiX 2.20 overflows an array of its contact elements beyond 40 rows, and its table ends at constant pressure: a
#: last row continues the slope up to BEYOND times the greatest pressure.
MOST, WIDEST, BEYOND = 38, 50.0, 10.0


def interface(folder: str | Path, law: str = "table", load: float | None = None) -> Interface:
    """Interface of a run, at so many approaches that reading between them is exact.

    Args:
        folder: of the run, with curve.csv and case.toml
        law: "table" (first loading) or "unload-reload" (branch through the preload)
        load: preload on the patch [force], for the branch; default that of the joint, or half of the greatest force

    Raises:
        InputError: the folder has no curve or no case, or the curve does not contain the branch
        RangeError: the branch does not reach the preload
    """
    if law not in LAWS:
        raise InputError(f'law = "{law}" is not for an export: choose one of {", ".join(LAWS)}')
    results = Results.read(folder)
    if not results.case:
        raise InputError(f"{folder} holds no case.toml, which has the nominal area; give the folder of a run")
    case, curve = Case.from_dict(results.case, folder=folder), results.curve
    patch = case.surface.L**2
    joint = case.joint or Joint()
    if load is None and (of_joint := joint.load(patch)) is not None:
        load = of_joint / joint.factor(patch)
    approach, measure = approach_of_planes(curve, case)
    columns = CurveColumns.of({
        "step": curve.step, "delta": approach, "force": curve.force / patch, "branch": curve.branch,
        "k_n_elastic": curve.k_n_interface / patch,  # the slope of an unloading without the block
    })  # fmt: skip
    preload = (0.5 * float(curve.force.max()) if load is None else load) / patch
    if law == "table":
        rows = np.flatnonzero(resolved(curve, approach))
        found = CurveLaw(approach[rows], curve.force[rows] / patch)
    else:
        choice = choose(columns, law, preload)
        assert isinstance(choice.law, CurveLaw)
        found = choice.law
    ends, steps = np.append(_BELOW * found.z[0], found.z), np.linspace(0.0, 1.0, _DENSE, endpoint=False)
    z = np.append((ends[:-1, None] * (ends[1:] / ends[:-1])[:, None] ** steps).ravel(), ends[-1])
    pressure, k_n = found.force(z), found.slope(z)
    slip = None
    about = list(_about(results, case, found, law, measure))
    if case.slip is not None:
        of_patch = slip_of_case(case.to_dict(), curve, load)
        about += of_patch.notes
        slip = replace(of_patch.law, block=0.0)
    return Interface(z, pressure, k_n, tuple(about), slip, patch)


def approach_of_planes(curve: Curve, case: Case) -> tuple[Array, str]:
    """Approach of the mean planes of the two faces at each step (n,) [length], and how it was found."""
    area, solid = case.surface.L**2, case.material
    block = {"height": case.block.height, "area": area, "modulus": solid.block_modulus(case.block.sides)}
    approach = interface_approach(curve.delta, curve.force, **block)
    if not len(curve) or np.isnan(curve.mean_gap).any():
        return approach, "approach of the flat less the elastic compression of the block"
    # the first step carries hardly any force: there the block is elastic
    return approach[0] + curve.mean_gap[0] - curve.mean_gap, "decrease of the mean gap from first touch"


def resolved(curve: Curve, approach: Array) -> Flags:
    """Rows of the first loading at which the interface is known (n,): it still closes, and by more than its error.

    Near full contact the mean gap is a small difference of the approach and the compression of the block. Where the
    gap is within its error bar, the interface is rigid as far as the run can tell, and its law ends.
    """
    loading = (curve.branch == "load") & (curve.force > 0.0) & (approach > 0.0)
    known = loading & ~(curve.mean_gap <= np.nan_to_num(curve.error_mean_gap))
    before = np.maximum.accumulate(np.where(known, approach, -np.inf))
    return np.asarray(known & (approach > np.append(-np.inf, before[:-1])))


def export(folder: str | Path, to: str, path: str | Path | None = None, *, law: str = "table",
           load: float | None = None) -> Path:  # fmt: skip
    """Write the contact of a run for another program; return the file written.

    Args:
        folder: of the run
        to: "calculix" or "abaqus" (a contact property with tabular pressure-overclosure, to be included in a deck; with
            the section [slip] of the case also friction and stick slope), or "csv"
        path: of the file; default in the folder
        law: see `interface`
        load: see `interface`

    Raises:
        InputError: `to` is unknown, or as for `interface`
        RangeError: as for `interface`

    Examples:
        >>> Path("out").mkdir()
        >>> z = np.linspace(0.1, 1.0, 10)
        >>> asp.Curve.from_rows([{"delta": d, "force": 2 * d**1.5} for d in z]).write("out/curve.csv")
        >>> case = {"units": "other", "surface": {"kind": "flat", "L": 1.0}, "material": {"E": 1e6, "nu": 0.3}}
        >>> case |= {"loading": {"delta_max": 0.9}}
        >>> _ = Path("out/case.toml").write_text(asp.Case.from_dict(case).to_toml())
        >>> lines = asp.export("out", "abaqus").read_text().splitlines()
        >>> [line for line in lines if line.startswith("*S")]
        ['*SURFACE INTERACTION, NAME=ASPERITY', '*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=TABULAR']
        >>> [line.partition(",")[0] for line in lines if "linearly" in line]
        ['** read linearly between 14 points']
    """
    if to not in EXPORTS:
        raise InputError(f'to = "{to}" is unknown: choose one of {", ".join(EXPORTS)}')
    target = Path(folder) / EXPORTS[to] if path is None else Path(path)
    text = _text(interface(folder, law, load), to)
    target.parent.mkdir(parents=True, exist_ok=True)
    replace_file(target, text.encode())
    return target


def _text(whole: Interface, to: str) -> str:
    """A file of an interface, in ASCII as decks are."""
    deck = to in FRICTION
    mark, text, row = DECK if deck else TABLE
    table, error = whole.points(*((MOST, WIDEST) if deck else (1000, math.inf)))
    z, p, k = table.approach, table.pressure, table.k_n
    secant = np.diff(p) / np.diff(z)
    off = max(float(np.abs(secant / slopes - 1.0).max()) for slopes in (k[:-1], k[1:]))
    about, friction = [*whole.about], ""
    about.append(
        f"read linearly between {z.size} points, the pressure is off the law by up to {per_cent(error)}, the stiffness "
        f"by up to {per_cent(off)}"
    )
    if deck:
        about.append("CalculiX: contact pair of TYPE=NODE TO SURFACE, surface to surface contact finds no force in it")
        z = np.append(z, z[-1] + (BEYOND - 1.0) * p[-1] / k[-1])
        p, k = np.append(p, BEYOND * p[-1]), np.append(k, k[-1])
    if deck and whole.slip is not None:
        mu, pressure = whole.slip.friction, whole.slip.preload / whole.patch
        stick = float(whole.slip.k_tangent(0.0)) / whole.patch
        friction = FRICTION[to].format(mu=mu, stick=stick, slip=mu * pressure / stick)
        about.append(f"stick slope of the interface at the nominal pressure {pressure:.6g}: {stick:.6g}")
    head = "\n".join(f"{mark} {line}" for words in about for line in wrap(comment(words), _WIDTH))
    points = zip(z.tolist(), p.tolist(), k.tolist(), strict=True)
    rows = "\n".join(row.format(z=at, p=value, k=slope) for at, value, slope in points)
    return text.format(head=head, rows=rows, friction=friction)


def _about(results: Results, case: Case, law: CurveLaw, name: str, measure: str) -> Iterator[str]:
    """Units and provenance."""
    si, top = case.units == "SI", float(results.curve.force.max()) / case.surface.L**2
    yield f"contact of a rough surface by asperity {__version__}"
    yield f"case {case.hash()[:16]}, {results.summary.get('exit_reason', 'exit reason unknown')}"
    data = case.to_dict()
    yield f"surface: {json.dumps(data['surface'], sort_keys=True)}"
    yield f"material: {json.dumps(data['material'], sort_keys=True)}"
    yield "units: lengths m, pressures Pa, stiffness over area Pa/m" if si else "units: those of the case"
    yield f"law: {'first loading' if name == 'table' else 'unloading and reloading'}, {law.z.size} computed points"
    yield f"approach: of the mean planes ({measure}), from {'first touch' if name == 'table' else 'separation'}"
    yield f"pressure: nominal, force over {case.surface.L**2:.6g}; greatest {law.F[-1]:.6g}"
    if name == "table" and law.F[-1] < (1.0 - 1e-6) * top:
        yield (
            f"beyond it, up to {top:.6g} of the run, the mean gap is within its error bar: the table ends, because the "
            "interface is rigid there as far as the run can tell"
        )
    bar = results.curve.bar("P_star", int(results.curve.force.argmax()))
    known = "unknown (no accuracy.tolerance)" if bar != bar else f"{per_cent(bar)} at the greatest force"
    yield f"error bar of the force: {known}"
