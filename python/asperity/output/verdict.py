"""The result of a run in a few sentences."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from math import isfinite, nan
from typing import Any

from asperity.output.assumptions import DOUBTFUL
from asperity.output.results import Results
from asperity.units import points, quantity


def verdict(results: Results) -> list[str]:
    """Result with its error bar, and the vibration: a sentence each, only what is known.

    Examples:
        >>> rows = [{"delta": 1e-9, "force": 2e-6, "P_star": 4e-5, "error_P_star": 8e-7, "area_fraction": 0.01}]
        >>> verdict(Results("out", asp.Curve.from_rows(rows), case={"units": "SI"}))
        ['The force on the patch is 2.00 µN ± 2 % at an approach of 1 nm; 1 % of the nominal area is in contact.']
    """
    return [*_contact(results), *_indentation(results), *_vibration(results)]


def _contact(results: Results) -> Iterator[str]:
    """Force, error bar, area and stiffness of the patch at the largest force."""
    curve = results.curve
    if not len(curve):
        yield "No load step was accepted."
        return
    top = curve.top
    force = quantity(float(curve.force[top]), results.unit("force"), bar=curve.bar("P_star", top))
    delta = quantity(float(curve.delta[top]), results.unit("length"))
    share = float(curve.area_fraction[top])
    area = f"; {points(share, curve.area_error(top))} of the nominal area is in contact" if isfinite(share) else ""
    yield f"The force on the patch is {force} at an approach of {delta}{area}."
    for leg in results.branches("hold")[-1:]:
        force = quantity(float(leg.force[-1]), results.unit("force"))
        delta = quantity(float(leg.delta[-1]), results.unit("length"))
        share = 100.0 * float(leg.area_fraction[-1])
        yield f"At the end of the hold the force is {force} at an approach of {delta}; {share:.3g} % are in contact."
    if not isfinite(curve.bar("P_star", top)):
        yield "The force has no error bar: the case requests no tolerance."
    known = []
    for name, axis in (("k_n_elastic", "normal"), ("k_t", "tangential, without slip,")):
        value = float(getattr(curve, name)[top])
        if isfinite(value) and value > 0.0:
            known.append(f"{axis} {quantity(value, results.unit('stiffness'), bar=curve.bar(name, top))}")
    if known:
        yield f"Elastic stiffness of the patch there: {' and '.join(known)}."


def _indentation(results: Results) -> Iterator[str]:
    """Hardness and modulus of a tip."""
    if found := results.summary.get("indentation"):
        hardness, modulus = (
            quantity(found[name], results.unit("stress"), bar=found[f"error_{name}"] / found[name])
            for name in ("hardness", "modulus")
        )
        yield (
            f"Hardness {hardness}, force over the projected area of contact; E' by Oliver and Pharr {modulus}, with "
            f"beta = {found['beta']:g}."
        )


def _vibration(results: Results) -> Iterator[str]:
    """Stiffness and frequency of small vibration; damping of the slip of the joint at a few amplitudes."""
    found, joint = results.thresholds, results.summary.get("joint")
    numbers, laws = found.get("numbers") or {}, found.get("laws") or {}
    units = found.get("units") or results.case.get("units")
    if joint:
        yield from headline(joint["numbers"], results.summary.get("patches"), units, joint["load"])
    elif numbers.get("k_n") is not None:
        yield from headline(numbers, None, units, found.get("load"), "Patch")
    if doubt := laws.get("doubt"):
        yield f"Its law is doubtful: {doubt}."
    for line in (results.summary.get("slip") or {}).get("in_words", ()):
        yield f"{line}."


def headline(
    numbers: Mapping[str, Any], patches: Mapping[str, Any] | None, units: str | None, load: float | None,
    of: str = "Interface of the joint",
) -> list[str]:  # fmt: skip
    """Small vibration in one line with its two bars, the larger first, and with the block of the model in a second.

    Args:
        numbers: see `Numbers.to_dict`
        patches: section of summary.json, what other patches change of the stiffness with the block; or None
        units: "other" shows numbers without units
        load: preload (force), None if unknown
        of: what vibrates
    """
    newton, metre, hertz = ("", "", "") if units == "other" else ("N", "N/m", "Hz")
    k, f, block, greatest = numbers["k_n"], *(numbers.get(name) for name in ("f", "k_n_with_block", "greatest_load"))
    bars = [(float(numbers["k_n_bar"]), "numerical error")] if numbers.get("k_n_bar") else []
    if patches:  # of the stiffness with the block in series, whose share of the compliance is the same for all patches
        bars.append((patches["bar"] * (k / block if block else 1.0), "other patches of this roughness ±"))
    bars.sort(reverse=True)
    largest = bars[0][0] if bars else nan
    digits = 2 if largest > 0.03 else 3 if largest > 0.003 else 4
    text = of if load is None else f"{of} about {quantity(load, newton)}"
    if greatest and load is not None and greatest > load * (1 + 1e-6):
        text += f" after a load of up to {quantity(greatest, newton, 3)}"
    text += f": stiffness {quantity(k, metre, digits)}"
    if f is not None:
        text += f", frequency {quantity(f, hertz, digits + 1)}"
    words = ", ".join(f"{words} {100 * bar:.2g} %" for bar, words in bars)
    lines = [f"{text} (of the stiffness: {words})." if words else f"{text}."]
    if block:
        lines.append(f"With the block of the model in series the stiffness is {quantity(block, metre, digits)}.")
    return lines


def doubts(records: Sequence[Mapping[str, Any]], named: bool = False) -> list[str]:
    """How many assumptions in summary.json are doubtful, and which if `named`; empty without any."""
    names = [record["name"] for record in records if record["verdict"] == DOUBTFUL]
    checked = f"{len(records)} assumptions that were checked"
    if not names:
        return [f"All {checked} are fine."] if records else []
    which = f": {', '.join(names)}" if named else ""
    return [f"{len(names)} of {checked} {'is' if len(names) == 1 else 'are'} doubtful{which}."]


def jump_rows(jumps: Sequence[Mapping[str, Any]], force: str, frequency: str, length: str) -> list[tuple[str, ...]]:
    """Jumps of thresholds.json as texts, in the units given: law, force, zeta, sweep, frequency, amplitudes."""
    return [
        (
            jump["model"], quantity(jump["force"], force), f"{jump['zeta']:g}", jump["sweep"],
            f"{jump['Omega']:.5g} ω_s" if jump["frequency"] is None else quantity(jump["frequency"], frequency, 5),
            quantity(jump["x_max"], length),
            (jump.get("note") or "–") if jump["x_max_after"] is None else quantity(jump["x_max_after"], length),
        )
        for jump in jumps
    ]  # fmt: skip
