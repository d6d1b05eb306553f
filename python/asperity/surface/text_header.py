"""What the header of a text file says of its heights: pixel, size, unit, factor, in English or German words.

A line that has a number or a unit and is not understood is a question: no length is guessed.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
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
    """Lengths that the lines before the heights give [m]; None where they say nothing.

    Attributes:
        shape: heights along y and x
        unit: of lengths without one
        dx, dy: distances between heights
        height: metres of one unit of the heights
        lateral: metres of one unit of coordinates
        nodata: values of missing heights
        other: unit of the heights that is no length
        questions: number and text of the lines that are not understood
        said: what was understood of the heights, for messages
    """

    shape: tuple[int, int]
    unit: float
    dx: float | None = None
    dy: float | None = None
    height: float | None = None
    lateral: float | None = None
    nodata: tuple[float, ...] = ()
    other: str = ""
    questions: list[tuple[int, str]] = field(default_factory=list)
    said: list[str] = field(default_factory=list)

    @staticmethod
    def read(lines: Iterable[tuple[int, str]], shape: tuple[int, int], unit: float) -> Header:
        """Understand lines, each with its number; see the attributes."""
        header = Header(shape, unit)
        factor: float | None = None
        extents: dict[str, float] = {}
        for number, line in lines:
            pairs = _PAIR.findall(line)
            if not pairs and (match := _PLAIN.fullmatch(line)):
                pairs = [(match[1], match[2])]
            understood = bool(pairs) or header._take_words(line)
            for key, value in pairs:
                words = _normal(key)
                values = [float(text.replace(",", ".")) for text, _ in _VALUE.findall(value)]
                named = _named(key, value)
                if words & _IDLE and not words & _STRONG:
                    break  # the rest of the line is its text
                if words & _MISSING and _VALUE.fullmatch(value.rstrip(",; ")):
                    header.nodata += (values[0],)
                elif words & _PLACE:
                    continue
                elif words & _UNIT and not values:
                    header._take_unit(words, value.strip(" []().,;\"'"))
                elif words & _FACTOR and not words & (_LATERAL | _PIXEL) and len(values) == 1:
                    if named is not None:
                        factor = values[0] * named
                        header.said.append(f"height factor {values[0]:g}")
                    understood &= named is not None or values[0] == 1.0
                else:
                    understood &= header._take_length(words, values, named, extents)
            if not understood:
                header.questions.append((number, line))
        for axis, n in (("dy", shape[0]), ("dx", shape[1])):
            if axis in extents and getattr(header, axis) is None:  # the extent of all pixels
                setattr(header, axis, extents[axis] / n)
        if factor is not None:
            if header.height is not None and not math.isclose(header.height, factor, rel_tol=SAME):
                text = f"a factor of {factor:g} m and a unit of {header.height:g} m for the heights"
                header.questions.append((0, text))
            header.height, header.other = factor, ""
        return header

    def _take_words(self, line: str) -> bool:
        """Understand a line without a number to a key: the unit of the heights in brackets, or idle words."""
        words = _normal(line)
        units = [length for word in _BRACKET.findall(line) if (length := length_unit(word)) is not None]
        if units and words & _OF_Z and len(set(units)) == 1:
            self.height = units[0]
            return True
        return (not units and not re.search(r"\d", line)) or bool(words & _IDLE and not words & _STRONG)

    def _take_unit(self, words: frozenset[str], word: str) -> None:
        """Take a unit of heights, of coordinates, or of both."""
        length, of_z = length_unit(word), bool(words & _OF_Z)
        if not of_z and length is not None:
            self.lateral = length
        if of_z or not words & _LATERAL:
            self.height, self.other = length, "" if length is not None else word
            self.said.append(f"unit {word}")

    def _take_length(
        self, words: frozenset[str], values: list[float], named: float | None, extents: dict[str, float]
    ) -> bool:
        """Understand numbers of heights, their distance, or their extent; `named` is the unit of the length."""
        ny, nx = self.shape
        x, y = bool(words & _OF_X), bool(words & _OF_Y)
        if not values:
            return not words & _STRONG
        if words & _COUNT and named is None and all(v == int(v) for v in values):
            wanted = [nx, ny] if x == y else [nx] if x else [ny]
            if values in (wanted, wanted[::-1], [nx * ny]) or (len(values) == 1 and nx == ny == values[0]):
                return True
        pixel = bool(words & _PIXEL)
        if not (pixel or (words & _EXTENT and named is not None)) or words & (_OF_Z - _OF_Y) or min(values) <= 0:
            return False
        if len(values) == 2 and x == y:
            lengths = dict(zip(("dx", "dy"), values, strict=True))
        elif len(values) == 1 and x != y:
            lengths = {"dx" if x else "dy": values[0]}
        elif len(values) == 1 and (pixel or nx == ny):
            lengths = {"dx": values[0], "dy": values[0]}
        else:
            return False
        for axis, value in lengths.items():
            length, known = value * (self.unit if named is None else named), getattr(self, axis)
            if not pixel:
                extents[axis] = length
            elif known is not None and not math.isclose(known, length, rel_tol=SAME):
                return False
            else:
                setattr(self, axis, length)
        return True


def _normal(key: str) -> frozenset[str]:
    """Words of a key, lower case, without units and signs."""
    key = _BRACKET.sub(" ", key).lower()
    for a, b in (("ä", "ae"), ("ö", "oe"), ("ü", "ue"), ("ß", "ss"), ("µ", "u"), ("μ", "u")):
        key = key.replace(a, b)
    return _words(re.sub(r"[^a-z0-9]+", " ", key))


def _named(key: str, value: str) -> float | None:
    """Unit of a length [m], in brackets or at the end of its key, or after its value."""
    after = [word for _, word in _VALUE.findall(value) if word and word.lower() != "x"]
    last = re.findall(r"[^\W\d]+", key.replace("_", " "))
    for word in (*after, *_BRACKET.findall(key), *(last[-1:] if len(last) > 1 else ())):
        if (length := length_unit(word)) is not None:
            return length
    return None
