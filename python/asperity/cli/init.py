"""`asperity init`: a case file to start from, with every key explained."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import click

from asperity.cli import options
from asperity.errors import CompatError, InputError

#: Values of the keys that have no default, in SI units; "file" is of --from.
SURFACES: dict[str, dict[str, Any]] = {
    "weierstrass-mandelbrot": {"L": 1e-6, "D": 2.4, "G": 5e-12},
    "self-affine": {"L": 1e-6, "H": 0.8, "rms_slope": 0.1, "lambda_short": 1e-7, "lambda_roll": 5e-7},
    "sphere": {"L": 1e-6, "radius": 2e-6},
    "cone": {"L": 1e-6, "half_angle": 80.0, "radius": 1e-7},
    "pyramid": {"L": 1e-6, "angle": 80.0},
    "sinusoid": {"L": 1e-6, "amplitude": 1e-8, "dims": 2},
    "flat": {"L": 1e-6},
}
STEEL = {"E": 200e9, "nu": 0.3, "yield_strength": 1e9, "tangent_modulus": 10e9, "kinematics": "auto"}
COPPER = {"E": 120e9, "nu": 0.34, "yield_strength": 150e6, "tangent_modulus": 1.2e9, "kinematics": "auto"}
TIP: dict[str, dict[str, Any]] = {
    "surface": {"kind": "flat", "L": 10e-6},
    "tool": {"kind": "pyramid", "angle": 65.3},
    "material": COPPER,
    "mesh": {"h_contact": 0.5e-6, "h_max": 3e-6},
    "loading": {"delta_max": 0.2e-6, "steps": 4, "unload_steps": 8},
    "output": {"figures": True, "report": True},
}
JOINT = (1e-5, 250.0, 5.0), 0.4e-6, 0.1  # area [m^2], preload [N], mass [kg]; rms height [m] and slope of its faces
SI = {
    "length": "m", "force": "N", "force/length^2": "Pa", "length/time^2": "m/s^2", "length^2": "m^2", "mass": "kg",
    "1/time": "Hz",
}  # fmt: skip
HURST, ROLL, SIDE = 0.8, 4.0, 16.0  # of a surface by Sq and slope; roll-off and side over the shortest wavelength
WIDTH = 34  # of "key = value"


@click.command()
@click.argument("file", metavar="[FILE]", required=False, type=click.Path(dir_okay=False, path_type=Path))
@click.option("--surface", "kind", type=click.Choice(list(SURFACES)), metavar="KIND",
              help=f"{', '.join(SURFACES)}; the first by default.")  # fmt: skip
@click.option("--from", "scan", metavar="MAP", type=click.Path(exists=True, dir_okay=False, path_type=Path),
              help="Height map instead, as import-map makes.")  # fmt: skip
@click.option("--joint", type=(float, float, float), metavar="AREA FORCE MASS",
              help="Nominal area (m²), preload (N), mass (kg).")  # fmt: skip
@click.option("--example", type=click.Choice(("demo", "scan", "joint", "tip")), metavar="NAME",
              help="demo, scan (a map, scan.csv), joint, or tip (Berkovich's on copper).")  # fmt: skip
@click.option("--Sq", "sq", type=options.Length(), metavar="LENGTH",
              help="Rms height, as 0.4um; with --slope.")  # fmt: skip
@click.option("--slope", type=float, metavar="SLOPE", help="Rms slope; with --Sq.")
def init(
    file: Path | None, kind: str | None, scan: Path | None, joint: tuple[float, float, float] | None,
    example: str | None, sq: float | None, slope: float | None,
) -> None:  # fmt: skip
    """Write a commented case, ready to run.

    FILE (case.toml) receives every key with its unit, legal values and meaning; keys with defaults are commented out.
    FILE must not exist yet. --joint needs the roughness of its faces: --Sq and --slope, or --from.
    """
    from asperity.case import Case
    from asperity.runtime.files import parse_toml, replace_file

    file = Path("scan.csv" if example == "scan" else "case.toml") if file is None else file
    if file.exists():
        raise InputError(f"{file} exists: give another name, or remove it")
    ways = {"--surface": kind, "--from": scan, "--Sq": sq, "--example": example, "--joint": example and joint}
    given = [name for name, value in ways.items() if value is not None]
    if len(given) > 1:
        raise InputError(f"{' and '.join(given)} do not go together: give one of them")
    if example == "joint":
        joint, sq, slope = JOINT
    if joint is not None and not all(0.0 < value < math.inf for value in joint):
        raise InputError(f"--joint {joint}: area, force and mass must be positive")
    if (sq is None) != (slope is None):
        raise InputError("give --Sq and --slope together, or a map with --from")
    if joint is not None and sq is None and scan is None:
        raise InputError(
            "the stiffness of a joint follows from the roughness of its faces: give their rms height and rms slope, as "
            "--Sq 0.4um --slope 0.1, or a map of one with --from"
        )
    file.parent.mkdir(parents=True, exist_ok=True)  # from where a case finds its map
    advice = f"asperity check {file}"
    if example == "scan":
        from asperity.surface import SelfAffine

        # in metres and without lengths: that of the tutorial
        surface = SelfAffine(L=50e-6, H=0.8, rms_height=0.2e-6, lambda_short=2e-6, seed=5)
        text = "\n".join(",".join(f"{z:.6e}" for z in row) for row in surface.grid(256).tolist()) + "\n"
        advice = f"asperity import-map {file} --pixel 0.2um --cutoff 4um"
    elif example == "demo":
        package = Path(__file__).parent.parent
        demos = [folder / "cases/demo.toml" for folder in (package, package.parent.parent)]  # of a wheel, of a clone
        if not any(path.is_file() for path in demos):
            raise CompatError(f"this installation has no example: {demos[0]} is missing; install it again")
        text = next(path for path in demos if path.is_file()).read_text(encoding="utf-8")
    else:
        roughness = None if sq is None or slope is None else surface_of(sq, slope)
        text = commented(TIP if example == "tip" else starting_case(kind, scan, joint, file.parent, roughness))
        Case.from_dict(parse_toml(text), folder=file.parent, source="this case would be refused")
    replace_file(file, text.encode())
    options.say(f"written {file}; next: {advice}")


def starting_case(
    kind: str | None = None, scan: Path | None = None, joint: tuple[float, float, float] | None = None,
    folder: Path = Path(), roughness: dict[str, Any] | None = None,
) -> dict[str, dict[str, Any]]:  # fmt: skip
    """Sections and keys of a case.

    Args:
        kind: of surface, one of SURFACES; or a map `scan`, or self-affine with the keys of a `roughness`
        scan: height map
        joint: nominal area [length^2], preload [force] and mass of a joint, whose overload is the greatest load
        folder: of the case file
        roughness: keys of a self-affine surface
    """
    from asperity.model.joint import Joint

    if roughness is not None:
        surface, delta = {"kind": "self-affine", **roughness}, 0.5 * roughness["rms_height"]
    elif scan is not None:
        from asperity.surface import HeightMap

        surface = {"kind": "file", "path": os.path.relpath(scan, folder)}
        delta = HeightMap(path=scan).light_approach()  # a few per cent of the heights
    else:
        kind = kind or next(iter(SURFACES))
        surface, delta = {"kind": kind, **SURFACES[kind]}, 1e-9 if kind == "flat" else 1e-8
    chosen = {
        "surface": surface, "material": STEEL, "loading": {"delta_max": float(f"{delta:.3g}")},
        "accuracy": {"tolerance": 0.05}, "output": {"figures": True, "report": True},
    }  # fmt: skip
    if joint is not None:
        area, force, mass = joint
        chosen["loading"] = {"unload": True}
        chosen["joint"] = {"nominal_area": area, "preload": force, "mass": mass, "overload": Joint.overload}
        chosen["output"] = {**chosen["output"], "stiffness": True}
    return chosen


def commented(chosen: Mapping[str, Mapping[str, Any]]) -> str:
    """Text of a case file with every key: those of `chosen` are set, the others are comments."""
    from asperity.case import Case
    from asperity.case.case_file import KINDS
    from asperity.case.tables import SECTIONS
    from asperity.surface.base import surface_kind

    lines = [
        "# A case of asperity in SI units.",
        "# A comment gives the meaning of a key, its unit, legal values, the default if other keys determine it.",
        "# Remove the # before a key to set it. Check the case by: asperity check FILE",
        "",
        *_keys(Case, {}),
    ]
    for name, section in SECTIONS.items():
        values = chosen.get(name, {})
        if name == "tool" and not values:
            continue
        cls = surface_kind(values["kind"]) if "kind" in values else section
        optional = name in ("dynamics", "joint", "slip") and not values
        about = str(cls.__doc__).partition("\n")[0].removesuffix(".")
        lines += ["", f"# {about}", f"# [{name}]" if optional else f"[{name}]"]
        if "kind" in values:
            lines.append(_line(f'kind = "{values["kind"]}"', f"kind of surface; {', '.join(KINDS)}"))
        lines += _keys(cls, values)
    return "\n".join(lines) + "\n"


def surface_of(sq: float, slope: float) -> dict[str, Any]:
    """Keys of a self-affine surface with an rms height [length] and an rms slope, which give its shortest wave."""
    from asperity.surface import SelfAffine

    if not (0.0 < sq < math.inf and 0.0 < slope <= 1.0):
        raise InputError(f"--Sq {sq:g} --slope {slope:g}: a positive length, and a slope up to 1")
    one = SelfAffine(L=SIDE, H=HURST, rms_height=1.0, lambda_short=1.0, lambda_roll=ROLL, seed=1)
    made = one.statistics()
    height = sq / made.Sq  # which includes the waves that are left out
    short = float(f"{height * made.rms_slope / slope:.4g}")
    return {
        "L": float(f"{SIDE * short:.4g}"), "H": HURST, "rms_height": float(f"{height:.4g}"), "lambda_short": short,
        "lambda_roll": float(f"{ROLL * short:.4g}"), "seed": 1,
    }  # fmt: skip


def _keys(cls: Any, values: Mapping[str, Any]) -> Iterator[str]:
    """One line a key: set where `values` has it, commented with its default elsewhere."""
    import tomli_w

    from asperity.runtime.declaration import legal, properties
    from asperity.runtime.display import show

    for key, about in properties(cls).items():
        unit = SI.get(about["unit"], about["unit"])
        words = [about["description"] + (f" ({unit})" if unit else ""), legal(about)]
        if key in values:
            yield _line(tomli_w.dumps({key: values[key]}).rstrip(), "; ".join(words))
            continue
        default = about.get("default")
        if about["shown"] or default is None:
            words.append(f"default: {about['shown'] or 'none'}" if about["shown"] or "default" in about else "required")
        yield _line(f"# {key} = {'' if default is None else show(default)}".rstrip(), "; ".join(words))


def _line(text: str, comment: str) -> str:
    return f"{text:<{WIDTH}} # {comment}"
