"""Tables of numbers in text files: lines of a header, then rows of cells.

The separator (semicolon, tab, comma, white space) is the one that makes numbers of a row, the decimal mark is a point,
or a comma in files without points. A table that can be read in two ways is refused.
"""

from __future__ import annotations

import csv
import itertools
import re
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from asperity.arrays import Array
from asperity.runtime.files import read_whole

SEPARATORS = {";": "semicolons", "\t": "tabs", ",": "commas", None: "white space"}
BLANK = frozenset({"", "nan"})
WIDE = 8  # cells from which a row of numbers is one of a table, whatever follows
_NUMBER = re.compile(r"[-+]?(inf|(\d+[.,]?\d*|[.,]\d+)([eE][-+]?\d+)?)")
_THOUSANDS = re.compile(r"[-+]?[1-9]\d{0,2},\d{3}")  # what may be 1.234 or 1234
_ZEROS = re.compile(r"(?:^|,)\s*[-+]?0\d")  # 1,05 in two cells
_COMMENT = ("#", "%", "!")
_UTF_16 = (b"\xff\xfe", b"\xfe\xff")  # marks


@dataclass(frozen=True, eq=False)
class TextTable:
    """The lines of a file: a header, then rows of numbers.

    Attributes:
        lines: of the file
        first: index of the first row of numbers
        separator: of cells, a key of SEPARATORS
    """

    lines: list[str]
    first: int
    separator: str | None

    @classmethod
    def of(cls, lines: list[str], least: int) -> TextTable:
        """Find the rows, each with at least so many cells; ValueError where there is no row."""
        return cls(lines, *_start(lines, least))

    @property
    def header(self) -> list[tuple[int, str]]:
        """Number and text of the lines before the rows, without marks of comments and without blank lines."""
        bare = ((i, line.strip().lstrip("#%!").strip()) for i, line in enumerate(self.lines[: self.first], 1))
        return [(i, line) for i, line in bare if line]

    @property
    def names(self) -> list[tuple[str, str]]:
        """Name and unit of each column in the line above the rows, as delta [um] or delta (um); "" without a unit."""
        lines = [re.sub(r"\s+(?=[\[(\])])|(?<=[\[(])\s+", "", line) for _, line in self.header[-1:]]
        cells = (cell.strip(' ",;') for line in lines for cell in self.cells(line))
        return [(name[1], name[2] or "") for cell in cells if (name := re.fullmatch(r"(.*?)(?:[\[(](.*)[\])])?", cell))]

    def columns(self, units: Mapping[str, Mapping[str, float]]) -> dict[str, tuple[int, float | None]]:
        """Place of each named column, and the factor of its unit, None where no column has a unit.

        Args:
            units: legal units of each column that is looked for, with their factors; a column with a unit is left out
                where there are none

        Raises:
            ValueError: a name occurs twice, a unit is unknown, or a column has none beside others with units
        """
        legal, found = {name.lower(): name for name in units}, dict[str, tuple[int, str]]()
        for place, (written, unit) in enumerate(self.names):
            name = legal.get(written.lower(), "")
            if name in found:
                raise ValueError(f"a column occurs twice: {name}")
            if name and (units[name] or not unit):
                found[name] = place, unit
        for name, (_, unit) in found.items():
            if units[name] and unit not in units[name] and any(one for _, one in found.values()):
                state = f"the unit {unit!r} of {name} is unknown" if unit else f"{name} has no unit beside others"
                raise ValueError(f"{state}: write it as {name} [UNIT], with one of {', '.join(units[name])}")
        return {name: (place, units[name].get(unit)) for name, (place, unit) in found.items()}

    def cells(self, line: str) -> list[str]:
        """Cells of a line."""
        return split(line, self.separator)

    def rows(self) -> list[tuple[int, list[str]]]:
        """Number of the line and cells of each row, all of one length, else ValueError; not of blanks and comments.

        Numbers have decimal points, ValueError where their commas are not clearly those of decimals.
        """
        numbered = enumerate(self.lines[self.first :], self.first + 1)
        rows = [(i, self.cells(line)) for i, line in numbered if line.strip() and not is_comment(line)]
        rows = [row for row in rows if any(row[1])]
        named = [cells for _, line in self.header if any(cells := self.cells(line))][-1:]
        ends = self.separator is not None and not any(row[-1] for _, row in rows)  # one ends each row
        if ends and not (named and len(named[0]) == len(rows[0][1]) and named[0][-1]):
            rows = [(i, row[:-1]) for i, row in rows]
        width = int(np.bincount([len(row) for _, row in rows]).argmax())
        for i, row in rows:
            if len(row) != width:
                raise ValueError(
                    f"row {i} has {len(row)} cells separated by {SEPARATORS[self.separator]}, others have {width}: "
                    "write one row of the table in each line"
                )
        return _with_points(rows)

    def numbers(self) -> Array:
        """All rows as numbers (m, n), else ValueError; NaN for blank cells."""
        if self.separator == "," and any(_ZEROS.search(line) for line in self.lines[self.first :] if '"' not in line):
            raise ValueError("numbers begin with zeros, as if commas were those of decimals too: write points")
        with suppress(ValueError):  # another line shows what is wrong, or blank, or has decimal commas
            return np.loadtxt(self.lines[self.first :], delimiter=self.separator, ndmin=2, dtype=float)
        return np.array([[self.value(cell, i) for cell in row] for i, row in self.rows()])

    def value(self, cell: str, number: int) -> float:
        """Number of a cell in a line, NaN if it is blank; ValueError where it is none."""
        if cell.lower() in BLANK:
            return np.nan
        if is_number(cell):
            return float(cell)
        raise ValueError(
            f"row {number} has {cell[:20]!r} among its cells separated by {SEPARATORS[self.separator]}: give a number, "
            "or leave the cell blank where it is missing"
        )


def lines_of(path: Path) -> list[str]:
    """Lines of a file, see `decoded`, without blank ones at its end."""
    return decoded(read_whole(path)).rstrip("\r\n ").splitlines()  # a tab may end a row


def is_text(start: bytes) -> bool:
    """Whether the first bytes of a file are those of a text."""
    return start[:2] in _UTF_16 or b"\0" not in start


def decoded(raw: bytes) -> str:
    """Text of a file in UTF-8, UTF-16 with its mark, or Latin-1; ValueError where it is none."""
    if raw[:2] in _UTF_16:
        return raw.decode("utf-16", errors="replace")
    if not is_text(raw[:4096]):
        raise ValueError("it is no text")
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        return raw.decode("latin-1")


def is_comment(line: str) -> bool:
    """Whether a line is a comment."""
    return line.lstrip()[:1] in _COMMENT


def is_number(cell: str) -> bool:
    """Whether a cell is a number with a decimal point or comma."""
    return _NUMBER.fullmatch(cell) is not None


def split(line: str, separator: str | None) -> list[str]:
    """Cells of a line without quotes and white space around them."""
    if separator is None:
        return line.split()
    with suppress(csv.Error, StopIteration):
        return [cell.strip() for cell in next(csv.reader([line.strip(" ")], delimiter=separator))]
    return [cell.strip() for cell in line.split(separator)]


def _with_points(rows: list[tuple[int, list[str]]]) -> list[tuple[int, list[str]]]:
    """Rows in which numbers with decimal commas have points."""
    numbers = [cell for _, row in rows for cell in row if ("," in cell or "." in cell) and is_number(cell)]
    commas, points = ([cell for cell in numbers if mark in cell] for mark in ",.")
    if not commas:
        return rows
    if points:
        raise ValueError(f"{points[0]!r} has a decimal point, {commas[0]!r} a decimal comma: write one of them")
    if all(map(_THOUSANDS.fullmatch, commas)):
        raise ValueError(
            f"the comma of {commas[0]!r} separates decimals or thousands, and no other number shows which: write points"
        )
    return [(i, [cell.replace(",", ".") if is_number(cell) else cell for cell in row]) for i, row in rows]


def _start(lines: list[str], least: int) -> tuple[int, str | None]:
    """Index of the first row of numbers, and the separator.

    A row of a few numbers is the first one only if the next line has as many: others belong to a header.
    """
    filled = [i for i, line in enumerate(lines) if line.strip(" ,;\t") and not is_comment(line)]
    for i, following in itertools.pairwise([*filled, -1]):
        for separator in SEPARATORS:
            width = _numeric(lines[i], separator, least)
            if not width:
                continue
            rest = lines[following] if following >= 0 else ""
            cells = split(rest, separator)
            if width >= WIDE or not rest or (len(cells) == width and any(map(is_number, cells))):
                return i, separator
    text = next((line for line in lines if line.strip()), "")
    if not text:
        raise ValueError("there are no numbers in it")
    raise ValueError(
        f"no row of at least {least} numbers separated by commas, semicolons, tabs or white space; it begins with "
        f"{text[:40]!r}"
    )


def _numeric(line: str, separator: str | None, least: int) -> int:
    """Number of cells of a line, most of them numbers; 0 if it has too few or other ones."""
    if separator is not None and separator not in line:
        return 0
    words = line.split()
    if separator == "," and len(words) > 1 and all(is_number(word) and word == word.strip(",") for word in words):
        return 0  # white space separates numbers with decimal commas
    cells = split(line, separator)
    filled = [cell for cell in cells if cell.lower() not in BLANK]
    return len(cells) if len(cells) >= least and len(filled) > 2 * sum(not is_number(cell) for cell in filled) else 0
