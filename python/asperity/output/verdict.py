"""The result of a run in a few sentences."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from math import isfinite, nan
from typing import Any

from asperity.output.assumption import DOUBTFUL
from asperity.output.results import Results
from asperity.units import plus_minus, quantity


def verdict(results: Results) -> list[str]:
    """Result with its error bar, and the vibration: a sentence each, only what is known.

    Examples:
        >>> rows = [{"delta": 1e-9, "force": 2e-6, "P_star": 4e-5, "error_P_star": 8e-7, "area_fraction": 0.01}]
        >>> verdict(Results("out", asp.Curve.from_rows(rows), case={"units": "SI"}))
        ['The force on the patch is 2.00 µN ± 2 % at an approach of 1 nm; 1 % of the nominal area is in contact.']
    """
    return [*_contact(results), *_stiffness(results), *_vibration(results), *_slip(results)]


def _contact(results: Results) -> Iterator[str]:
    """Force, error bar and area of the patch at the largest force."""
    curve = results.curve
    if not len(curve):
        yield "No load step was accepted."
        return
    top = int(curve.force.argmax())
    force = quantity(float(curve.force[top]), results.unit("force"), bar=curve.bar("P_star", top))
    delta = quantity(float(curve.delta[top]), results.unit("length"))
    share = 100.0 * float(curve.area_fraction[top])
    of_area = plus_minus(share, 100.0 * curve.area_error(top))
    area = f"; {of_area} % of the nominal area is in contact" if isfinite(share) else ""
    yield f"The force on the patch is {force} at an approach of {delta}{area}."
    if not isfinite(curve.bar("P_star", top)):
        yield "It has no error bar: the case requests no tolerance."


def _stiffness(results: Results) -> Iterator[str]:
    """Normal and tangential stiffness of the patch at the largest force."""
    curve = results.curve
    if not len(curve):
        return
    top, known = int(curve.force.argmax()), []
    for name, axis in (("k_n_elastic", "normal"), ("k_t", "tangential, without slip,")):
        value = float(getattr(curve, name)[top])
        if isfinite(value) and value > 0.0:
            known.append(f"{axis} {quantity(value, results.unit('stiffness'), bar=curve.bar(name, top))}")
    if known:
        yield f"Elastic stiffness of the patch there: {' and '.join(known)}."


def _vibration(results: Results) -> Iterator[str]:
    """Stiffness and frequency of small vibration."""
    found = results.thresholds
    numbers, si = found.get("numbers") or {}, found.get("units") != "other"
    if numbers.get("k_n") is None:
        return
    bar = (found.get("laws") or {}).get("error_bar_of_k_n")
    bar = nan if bar is None else float(bar)
    of, load = "joint" if results.case.get("joint") else "patch", found.get("load")
    about = "" if load is None else f" about a load of {quantity(load, (si and 'N') or '')}"
    stiffness = quantity(numbers["k_n"], (si and "N/m") or "", bar=bar)
    text = f"Small vibration of the {of}{about} has a stiffness of {stiffness}"
    if numbers.get("f") is not None:  # sqrt(k_n/m): half the bar, and none of one that the case gives
        given = (results.case.get("joint") or {}).get("frequency") is not None
        text += f" and a frequency of {quantity(numbers['f'], (si and 'Hz') or '', bar=nan if given else 0.5 * bar)}"
    yield f"{text}."
    if of == "joint" and (patches := results.summary.get("patches")):
        word = "softer" if patches["change"] < 0.0 else "stiffer"
        yield (
            f"That is of this patch; the mean of {patches['patches']} patches of its roughness is "
            f"{100 * abs(patches['change']):.0f} % ± {100 * patches['error']:.0f} % {word} by a half-space."
        )
    if doubt := (results.thresholds.get("laws") or {}).get("doubt"):
        yield f"Its law is doubtful: {doubt}."


def _slip(results: Results) -> Iterator[str]:
    """Frequency or stiffness, and damping ratio, of the slip of the joint at a few amplitudes."""
    found = results.summary.get("slip") or {}
    for line in found.get("in_words", ()):
        yield f"{line}."


def doubts(results: Results) -> list[str]:
    """How many assumptions of the model are doubtful, and which; empty where none was checked."""
    records = results.summary.get("assumptions") or []
    names = [record["name"] for record in records if record["verdict"] == DOUBTFUL]
    return [f"{count_of_doubts(records)}{': ' if names else ''}{', '.join(names)}."] if records else []


def count_of_doubts(records: Sequence[Mapping[str, Any]]) -> str:
    """How many records of the ledger in summary.json are doubtful, a clause."""
    number = sum(record["verdict"] == DOUBTFUL for record in records)
    if not number:
        return f"All {len(records)} assumptions that were checked are fine"
    return f"{number} of {len(records)} assumptions that were checked {'is' if number == 1 else 'are'} doubtful"
