"""The contact of a run for other programs: nominal pressure over the approach of the mean planes.

In a model of the joint's bodies their own compliance must not count twice: the approach is that of the mean planes of
the two faces, from first touch, without the compression of the block.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from textwrap import wrap

import numpy as np

from asperity.arrays import Array
from asperity.case import Case
from asperity.curve.power_law import interface_approach
from asperity.errors import InputError
from asperity.output.mesh_file import block_of_case, write_mesh
from asperity.output.results import Results
from asperity.runtime.display import comment
from asperity.runtime.files import replace_file
from asperity.runtime.run_folder import EXPORTS
from asperity.slip import SlipLaw
from asperity.slip.joint_slip import slip_of_case
from asperity.units import per_cent
from asperity.version import __version__
from asperity.vibration.joint import Joint
from asperity.vibration.law import CurveLaw
from asperity.vibration.source import CurveColumns, law_named, leg_rows, unload_reload

LAWS = ("table", "unload-reload")
_WIDTH = 110  # of a comment in a deck
_BETWEEN = 4  # points from one of the curve to the next
_BELOW = (0.125, 0.25, 0.5)  # of the first point of the curve, points added below it
_ROWS = 40  # of a table in CalculiX 2.20, with that of zero pressure; more overflow an array of its contact elements
_RANGE = 50.0  # greatest over smallest overclosure there
_ADVICE = (
    "contact pair of TYPE=NODE TO SURFACE: surface to surface contact of CalculiX 2.20 finds no force from a table"
)
_BEYOND = 10.0  # times the greatest pressure: so far CalculiX finds the last slope
COLUMNS = ("approach", "pressure", "slope", "k_n", "k_n_elastic", "k_t", "h")


@dataclass(frozen=True, eq=False)
class Interface:
    """The rough interface per nominal area, at rising pressure; arrays of shape (m,), NaN where unknown.

    Attributes:
        approach: of the mean planes from first touch, or from where an unloading separates [length]
        pressure: nominal [force/length^2]
        slope: dp/dz of the table [force/length^3]
        k_n, k_n_elastic, k_t: normal stiffness of the loading and of small vibration, tangential stiffness, over the
            nominal area and without the block [force/length^3], from the columns of the curve
        about: what the numbers are, one line each
        slip: of the interface of the patch, None for a case without [slip]
        patch: nominal area of the patch [length^2]
        conduction: nominal pressure, conductance per nominal area h and its error bar at the steps with contact, at
            rising pressure, (rows, 3); no rows where unknown
        preload: nominal pressure of the joint [force/length^2]
        yields: whether an unloading leaves the table, with the slope k_n_elastic
    """

    approach: Array
    pressure: Array
    slope: Array
    k_n: Array
    k_n_elastic: Array
    k_t: Array
    about: tuple[str, ...]
    slip: SlipLaw | None = None
    patch: float = np.nan
    conduction: Array = field(default_factory=lambda: np.empty((0, 3)))
    preload: float = np.nan
    yields: bool = False

    @property
    def h(self) -> Array:
        """Conductance per nominal area at `pressure` [power/(length^2 temperature)], NaN where unknown."""
        p, h, _ = self.conduction.T
        return _over(self.pressure, h, p, np.arange(p.size))


def interface(folder: str | Path, law: str = "table", load: float | None = None) -> Interface:
    """Interface of a run.

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
    joint = Joint(**case.joint.model_dump()) if case.joint else Joint()
    if load is None and (of_joint := joint.load(patch)) is not None:
        load = of_joint / joint.factor(patch)
    # approach of the mean planes at each step
    block = {"height": case.block.height, "area": patch, "modulus": case.material.solid.block_modulus(case.block.sides)}
    approach = interface_approach(curve.delta, curve.force, **block)
    measure = "approach of the flat less the elastic compression of the block"
    if len(curve) and not np.isnan(curve.mean_gap).any():
        # the first step carries hardly any force: there the block is elastic
        approach = approach[0] + curve.mean_gap[0] - curve.mean_gap
        measure = "decrease of the mean gap from first touch"
    columns = CurveColumns.of({
        "step": curve.step, "delta": approach, "force": curve.force / patch, "branch": curve.branch,
        "k_n_elastic": curve.k_n_interface / patch,  # the slope of an unloading without the block
    })  # fmt: skip
    preload = (0.5 * float(curve.force.max()) if load is None else load) / patch
    if law == "table":
        found, rows = law_named(columns, "table", preload)[0], columns.loading
    else:
        found = unload_reload(columns, preload)
        rows = np.isin(np.arange(len(curve)), leg_rows(columns, preload))
    z = found.z  # with points between and below them
    inner = (z[:-1, None] * (z[1:] / z[:-1])[:, None] ** (np.arange(_BETWEEN) / _BETWEEN)).ravel()
    z = np.concatenate([z[0] * np.array(_BELOW), inner, z[-1:]])
    pressure, slope = found.force(z), found.slope(z)
    with np.errstate(all="ignore"):
        k_n = 1.0 / (1.0 / curve.k_n - block["height"] / (patch * block["modulus"]))
    k_n, k_n_elastic, k_t = (
        _over(pressure, k / patch, curve.force / patch, columns.rising(rows & (k > 0) & (curve.force > 0)))
        for k in (k_n, curve.k_n_interface, curve.k_t_interface)
    )
    about = tuple(_about(results, case, found, law, measure))
    slip = None
    if case.slip is not None:
        of_patch = slip_of_case(case.to_dict(), curve, case.slip.preload or load)
        about += of_patch.notes
        slip = replace(of_patch.law, block=(of_patch.law.block[0], 0.0))
    yields = law == "table" and bool(np.any(curve.max_plastic_strain > 0))
    conduction = np.stack(results.gap_conductance(), axis=1)
    conduction = conduction[columns.rising(rows & (conduction[:, 1] > 0) & (curve.force > 0))]
    return Interface(z, pressure, slope, k_n, k_n_elastic, k_t, about, slip, patch, conduction, preload, yields)


def export(
    folder: str | Path, to: str, path: str | Path | None = None, *, law: str | None = None, load: float | None = None
) -> Path:
    """Write the contact of a run for another program; return the file written.

    Args:
        folder: of the run
        to: "calculix" or "abaqus" (a contact property with tabular pressure-overclosure, to be included in a deck),
            "ansys" (a gasket material), or "csv". With `material.conductivity` the decks of the first two have the
            conductance of the gap too, with the section [slip] friction and stick slope. "mesh" is the block itself,
            see `mesh_file.write_mesh`.
        path: of the file; default in the folder
        law: see `interface`; default "table"
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
        >>> table = interface("out")
        >>> table.approach.size, f"{np.interp(0.5, table.approach, table.pressure):.3f}"
        (40, '0.707')
        >>> lines = asp.export("out", "abaqus").read_text().splitlines()
        >>> [line for line in lines if line.startswith("*S")]
        ['*SURFACE INTERACTION, NAME=ASPERITY', '*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=TABULAR']
    """
    if to not in EXPORTS:
        raise InputError(f'to = "{to}" is unknown: choose one of {", ".join(EXPORTS)}')
    target = Path(folder) / EXPORTS[to] if path is None else Path(path)
    if to == "mesh":
        if (law, load) != (None, None):
            raise InputError("law and preload are for the contact, not for the mesh: leave them out")
        results = Results.read(folder)
        if not results.case:
            raise InputError(f"{folder} holds no case.toml, which describes the block; give the folder of a run")
        levels = (results.summary.get("accuracy") or {}).get("levels") or [{}]  # the last has the finest mesh
        block, surface = block_of_case(Case.from_dict(results.case, folder=folder), levels[-1].get("h"))
        return write_mesh(block, surface, target, f"block of {Path(folder).resolve().name} by asperity {__version__}")
    table = interface(folder, law or "table", load)
    target.parent.mkdir(parents=True, exist_ok=True)
    replace_file(target, _WRITERS[to](table).encode())
    return target


def _over(pressure: Array, k: Array, at: Array, rows: Array) -> Array:
    """Stiffness, known in rows of rising pressures `at`, over others: linear in logarithms, NaN outside."""
    if rows.size < 2:
        return np.full(pressure.shape, np.nan)
    x, y, wanted = np.log(at[rows]), np.log(k[rows]), np.log(pressure)
    inside = (wanted >= x[0] - 1e-9) & (wanted <= x[-1] + 1e-9)
    return np.where(inside, np.exp(np.interp(wanted, x, y)), np.nan)


def _about(results: Results, case: Case, law: CurveLaw, name: str, measure: str) -> Iterator[str]:
    """Units and provenance."""
    si = case.units == "SI"
    yield f"contact of a rough surface by asperity {__version__}"
    yield f"case {case.hash()[:16]}, {results.summary.get('exit_reason', 'exit reason unknown')}"
    yield f"surface: {json.dumps(case.surface.model_dump(exclude_none=True), sort_keys=True)}"
    yield f"material: {json.dumps(case.material.model_dump(exclude_none=True), sort_keys=True)}"
    yield "units: lengths m, pressures Pa, stiffness over area Pa/m" if si else "units: those of the case"
    yield f"law: {'first loading' if name == 'table' else 'unloading and reloading'}, {law.z.size} computed points"
    yield f"approach: of the mean planes ({measure}), from {'first touch' if name == 'table' else 'separation'}"
    yield f"pressure: nominal, force over {case.surface.L**2:.6g}; greatest {law.F[-1]:.6g}"
    bar = results.curve.bar("P_star", int(results.curve.force.argmax()))
    known = "unknown (no accuracy.tolerance)" if bar != bar else f"{per_cent(bar)} at the greatest force"
    yield f"error bar of the force: {known}"


def _head(table: Interface, mark: str, *advice: str) -> list[str]:
    """Comments of a deck behind a mark: what the numbers are, and stiffness at the greatest pressure."""
    lines = [line for text in (*table.about, *advice) for line in wrap(comment(text), _WIDTH)]
    for name, words in (("k_n", "loading"), ("k_n_elastic", "small vibration"), ("k_t", "tangential, without slip")):
        known = np.flatnonzero(np.isfinite(getattr(table, name)))
        if known.size:
            i = known[-1]
            lines.append(f"{name} at {table.pressure[i]:.6g}: {getattr(table, name)[i]:.6g} ({words})")
    return [f"{mark} {line}" for line in lines]


def _few(table: Interface) -> tuple[Array, Array]:
    """Approach and pressure in as few rows as CalculiX reads."""
    z, p = table.approach, table.pressure
    points = np.geomspace(max(z[-1] / _RANGE, z[0]), z[-1], _ROWS - 2)
    return points, np.exp(np.interp(np.log(points), np.log(z), np.log(p)))


def _deck(rows: Array, table: Interface, *advice: str) -> str:
    """Contact property with the tabular pressure-overclosure of CalculiX and Abaqus, to be included in a deck.

    Both read lines of pressure and overclosure that rise from zero. Beyond the last line Abaqus keeps the slope.
    """
    lines = _head(table, "**", *advice)
    lines += ["*SURFACE INTERACTION, NAME=ASPERITY", "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=TABULAR", "0., 0."]
    lines += [f"{float(p):.8e}, {float(z):.8e}" for p, z in rows]
    return "\n".join(lines) + "\n"


def _friction(table: Interface) -> tuple[float, float, float, str]:
    """Friction, nominal pressure, stick slope there, and a comment on it; for a case with [slip]."""
    assert table.slip is not None
    pressure, stick = table.slip.preload / table.patch, float(table.slip.k_tangent(0.0)) / table.patch
    head = f"** stick slope of the interface at the nominal pressure {pressure:.6g}: {stick:.6g}\n*FRICTION"
    return table.slip.friction, pressure, stick, head


def _abaqus(table: Interface) -> str:
    """Deck, with a table of conductances and with the slip at which friction has its limit."""
    text = _deck(np.stack([table.pressure, table.approach], axis=1), table)
    if len(table.conduction):
        rows = [f"{row[1]:.8e}, {row[0]:.8e}" for row in table.conduction]
        text += "\n".join(["*GAP CONDUCTANCE, PRESSURE", "0., 0.", *rows]) + "\n"
    if table.slip is not None:
        mu, pressure, stick, head = _friction(table)
        text += f"{head}, ELASTIC SLIP={mu * pressure / stick:.8e}\n{mu:g},\n"
    return text


def _calculix(table: Interface) -> str:
    """Deck, with the stick slope and the conductance at the preload.

    Its lines end in a row at constant pressure, so a further row continues the last slope. Where the overclosure is a
    table its springs between node and surface have no pressure for a table of conductances, and take the first row.
    """
    z, p = _few(table)
    far = z[-1] + (_BEYOND - 1) * p[-1] / table.slope[-1]
    text = _deck(np.stack([np.append(p, _BEYOND * p[-1]), np.append(z, far)], axis=1), table, _ADVICE)
    if len(table.conduction):
        h = float(np.interp(table.preload, table.conduction[:, 0], table.conduction[:, 1]))
        text += f"** conductance at the pressure {table.preload:.6g}, and so at any: CalculiX 2.20 takes the first row "
        text += f"of a table\n*GAP CONDUCTANCE\n{h:.8e}, 0.\n"
    if table.slip is not None:
        mu, _, stick, head = _friction(table)
        text += f"{head}\n{mu:g}, {stick:.8e}\n"
    return text


def _ansys(table: Interface) -> str:
    """Gasket material of Mechanical APDL for INTER192 to 195: pressure over closure from zero, slopes of unloading.

    A gasket without these slopes unloads along its compression curve. They are linear: right at the load they begin at.
    """
    z, p = _few(table)
    curves = {"COMP": np.stack([z, p], axis=1)}
    slopes = np.interp(z, table.approach, table.k_n_elastic)
    if table.yields and (known := np.isfinite(slopes)).any():
        curves["LUNL"] = np.stack([z, slopes], axis=1)[known]
    lines = [*_head(table, "!"), "asperity = 1 ! number of the material"]
    for kind, rows in curves.items():
        lines += [f"TB,GASKET,asperity,1,{len(rows)},{kind}", *(f"TBPT,,{x:.8e},{y:.8e}" for x, y in rows)]
    return "\n".join(lines) + "\n"


def _csv(table: Interface) -> str:
    lines = [f"# {comment(text)}" for text in table.about] + [",".join(COLUMNS)]
    for values in zip(*(getattr(table, name).tolist() for name in COLUMNS), strict=True):
        lines.append(",".join("" if value != value else repr(value) for value in values))
    return "\n".join(lines) + "\n"


_WRITERS: dict[str, Callable[[Interface], str]] = {
    "calculix": _calculix, "abaqus": _abaqus, "ansys": _ansys, "csv": _csv,
}  # fmt: skip
