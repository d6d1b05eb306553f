"""What the header of a text file says of its heights: pixel, size, unit, factor, in English or German words.

A line that has a number or a unit and is not understood is a question: no length is guessed.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

from asperity.units import LENGTHS

_ALIASES = {"micron": 1e-6, "microns": 1e-6, "mikrometer": 1e-6, "micrometer": 1e-6, "micrometers": 1e-6,
            "micrometre": 1e-6, "micrometres": 1e-6, "nanometer": 1e-9, "nanometers": 1e-9, "nanometre": 1e-9,
            "millimeter": 1e-3, "millimetre": 1e-3, "meter": 1.0, "metre": 1.0, "å": 1e-10,
            "angstrom": 1e-10}  # fmt: skip
SAME = 1e-3  # relative difference of lengths that were rounded


def _words(text: str) -> frozenset[str]:
    return frozenset(text.split())


_UNIT = _words("unit units einheit einheiten")
_FACTOR = _words("factor faktor scale scaling skalierung conversion multiplier calibration kalibrierung")
_PIXEL = _words(
    "pixel pixels pixelsize cellsize xcellsize ycellsize spacing step stepsize increment sampling dx dy dxy pitch "
    "interval resolution punktabstand schrittweite pixelgroesse pixelabstand abstand rasterweite zellgroesse aufloesung"
)
_EXTENT = _words(
    "width breite length laenge height hoehe size groesse extent range scan scansize lx ly xsize ysize w h field feld "
    "bildbreite bildhoehe messfeld"
)
_COUNT = _words(
    "nx ny ncols nrows cols columns rows lines spalten zeilen pixels pixel points punkte xres yres samples anzahl "
    "count w h width height breite hoehe size groesse resolution aufloesung"
)
_MISSING = _words("nodata missing fehlwert novalue invalid bad dummy")
_PLACE = _words("offset xllcorner yllcorner xllcenter yllcenter origin position ursprung x0 y0 xoffset yoffset")
_OF_X = _words("x dx nx ncols cols columns spalten xres width breite w lx xsize xcellsize bildbreite horizontal")
_OF_Y = _words("y dy ny nrows rows lines zeilen yres height hoehe h ly ysize ycellsize bildhoehe vertical vertikal")
_OF_Z = _words("z height heights hoehe hoehen value values wert werte data daten topography topographie")
_LATERAL = _words("x y xy lateral dx dy")
_IDLE = _words(
    "date datum time zeit uhrzeit name title titel channel kanal file datei operator user bediener sample probe "
    "instrument geraet version software comment kommentar created erstellt author autor program programm exported "
    "serial id project projekt objective objektiv magnification description beschreibung format source quelle rate "
    "speed gain setpoint bias mode humidity temperature temperatur"
)
_STRONG = _UNIT | _FACTOR | _PIXEL
_NUMBER = r"[-+]?(?:\d+[.,]?\d*|[.,]\d+)(?:[eE][-+]?\d+)?"
_PAIR = re.compile(r"([^\W\d][^:=]*?)\s*[:=]\s*(\S.*?)\s*(?=$|[;,\s]\s*[^\W\d][^:=;,]{0,40}[:=])")
_PLAIN = re.compile(rf"\W*([^\W\d][\w \t]*?)[\s,;]+({_NUMBER}(?:\s*[\[(]?[^\W\d]\w*[\])]?)?)[,;\s]*")
_VALUE = re.compile(rf"[\[(]?({_NUMBER})\s*[\[(]?([^\W\d_]*)[\])]?")
_BRACKET = re.compile(r"[\[(]\s*(?:->|in)?\s*([^\W\d_]+)\s*[\])]")


def length_unit(word: str) -> float | None:
    """Length [m] of a unit, None if the word is none."""
    return LENGTHS.get(word) or LENGTHS.get(word.lower()) or _ALIASES.get(word.lower())


@dataclass
class Header:
    """Lengths of a header [m], those without a unit in `unnamed` as they stand; None where it says nothing.

    Attributes:
        dx, dy: distances between heights
        height: metres of one unit of the heights
        lateral: metres of one unit of coordinates
        nodata: values of missing heights
        other: unit of the heights that is no length
        questions: number and text of the lines that are not understood
        said: what was understood of the heights, for messages
    """

    dx: float | None = None
    dy: float | None = None
    height: float | None = None
    lateral: float | None = None
    nodata: tuple[float, ...] = ()
    other: str = ""
    questions: list[tuple[int, str]] = field(default_factory=list)
    said: list[str] = field(default_factory=list)


def read_header(lines: Iterable[tuple[int, str]], shape: tuple[int, int], unit: float) -> Header:
    """Understand the lines before the heights.

    Args:
        lines: number and text of each
        shape: heights along y and x
        unit: of lengths without one [m]
    """
    found = Header()
    factor: float | None = None
    extents: dict[str, float] = {}
    for number, line in lines:
        for key, value in _pairs(line):
            words = _normal(key)
            match = _VALUE.fullmatch(value.rstrip(",; "))
            values = [_float(v) for v, _ in _VALUE.findall(value)]
            named = _named(key, value)
            if words & _IDLE and not words & _STRONG:
                break  # the rest of the line is its text
            if words & _MISSING and match:
                found.nodata += (values[0],)
            elif words & _PLACE:
                continue
            elif words & _UNIT and not values:
                _take_unit(found, words, value)
            elif words & _FACTOR and not words & (_LATERAL | _PIXEL) and len(values) == 1:
                if named is None and values[0] != 1.0:
                    found.questions.append((number, line))
                elif named is not None:
                    factor = values[0] * named
                    found.said.append(f"height factor {values[0]:g}")
            elif not _take_length(found, words, values, named, shape, unit, extents):
                found.questions.append((number, line))
        if not any(_pairs(line)) and not _take_words(found, line):
            found.questions.append((number, line))
    for axis, n in (("dy", shape[0]), ("dx", shape[1])):
        if axis in extents and getattr(found, axis) is None:  # the extent of all pixels
            setattr(found, axis, extents[axis] / n)
    if factor is not None:
        if found.height is not None and not math.isclose(found.height, factor, rel_tol=SAME):
            found.questions.append((0, f"a factor of {factor:g} m and a unit of {found.height:g} m for the heights"))
        found.height, found.other = factor, ""
    return found


def _pairs(line: str) -> Iterator[tuple[str, str]]:
    """Keys and values of a line: h=24 w=24, Width: 5 um, cellsize 0.5."""
    pairs = [(key, value) for key, value in _PAIR.findall(line)]
    if not pairs and (match := _PLAIN.fullmatch(line)):
        pairs = [(match[1], match[2])]
    yield from pairs


def _normal(key: str) -> frozenset[str]:
    """Words of a key, lower case, without units and signs."""
    key = _BRACKET.sub(" ", key).lower()
    for a, b in (("ä", "ae"), ("ö", "oe"), ("ü", "ue"), ("ß", "ss"), ("µ", "u"), ("μ", "u")):
        key = key.replace(a, b)
    return _words(re.sub(r"[^a-z0-9]+", " ", key))


def _named(key: str, value: str) -> float | None:
    """Unit of a length [m], in brackets or at the end of its key, or after its value."""
    after = [word for _, word in _VALUE.findall(value) if word and word.lower() != "x"]
    inside = _BRACKET.findall(key)
    last = re.findall(r"[^\W\d]+", key.replace("_", " "))
    for word in (*after, *inside, *(last[-1:] if len(last) > 1 else ())):
        if (length := length_unit(word)) is not None:
            return length
    return None


def _float(text: str) -> float:
    return float(text.replace(",", "."))


def _take_unit(found: Header, words: frozenset[str], value: str) -> None:
    """Unit of heights, of coordinates, or of both."""
    word = value.strip(" []().,;\"'")
    length = length_unit(word)
    of_z = bool(words & _OF_Z)
    if (words & _LATERAL and not of_z) or not of_z:
        found.lateral = length if length is not None else found.lateral
    if of_z or not words & _LATERAL:
        found.height, found.other = length, "" if length is not None else word
        found.said.append(f"unit {word}")


def _take_length(
    found: Header,
    words: frozenset[str],
    values: list[float],
    named: float | None,
    shape: tuple[int, int],
    unit: float,
    extents: dict[str, float],
) -> bool:
    """Numbers of heights, their distance, or their extent; whether the line is understood."""
    ny, nx = shape
    x, y = bool(words & _OF_X), bool(words & _OF_Y)
    if not values:
        return not words & (_UNIT | _FACTOR | _PIXEL)
    if words & _COUNT and named is None and all(v == int(v) for v in values):
        wanted = [nx, ny] if x == y else [nx] if x else [ny]
        if values in (wanted, wanted[::-1], [nx * ny]) or (len(values) == 1 and nx == ny == values[0]):
            return True
    pixel, extent = bool(words & _PIXEL), bool(words & _EXTENT)
    if not (pixel or extent) or words & (_OF_Z - _OF_Y) or not all(v > 0 for v in values):
        return False
    if not pixel and named is None:
        return False
    length = named if named is not None else unit
    if len(values) == 2 and x == y:
        pair = values
    elif len(values) == 1 and x != y:
        pair = [values[0] if x else math.nan, values[0] if y else math.nan]
    elif len(values) == 1 and (pixel or nx == ny):
        pair = [values[0], values[0]]
    else:
        return False
    for axis, value in zip(("dx", "dy"), pair, strict=True):
        if math.isnan(value):
            continue
        if pixel:
            if getattr(found, axis) is not None and not math.isclose(
                getattr(found, axis), value * length, rel_tol=SAME
            ):
                return False
            setattr(found, axis, value * length)
        else:
            extents[axis] = value * length
    return True


def _take_words(found: Header, line: str) -> bool:
    """A line without a number to a key: the unit of the heights in brackets, or idle words."""
    words = _normal(line)
    units = [length for word in _BRACKET.findall(line) if (length := length_unit(word)) is not None]
    if units and words & _OF_Z and len(set(units)) == 1:
        found.height = units[0]
        return True
    return (not units and not re.search(r"\d", line)) or bool(words & _IDLE and not words & _STRONG)
