"""Tables of numbers in text files, as instruments, spreadsheets and scripts of any country write them.

The separator (semicolon, tab, comma, white space), the decimal point or comma and the encoding are found in the file.
What can be read in two ways is refused with what to give.
"""

from __future__ import annotations

import csv
import itertools
import re
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from asperity.arrays import Array
from asperity.runtime.files import read_whole

SEPARATORS = {";": "semicolons", "\t": "tabs", ",": "commas", None: "white space"}
DECIMALS = {"point": ".", "comma": ","}
BLANK = frozenset(
    {"", "nan", "na", "n/a", "null", "none", "bad", "---", "--", "-", "*", "***", "missing", "inf", "-inf"}
)
WIDE = 8  # cells from which a row of numbers is one of a table, whatever follows
_NUMBER = re.compile(r"[-+]?(\d[\d.,]*|[.,]\d+)([eEdD][-+]?\d+)?")
_MARKS = ((".", ","), (",", "."))  # of decimals, and of groups of digits
_GROUPS = {point: re.compile(rf"[-+]?\d{{1,3}}(\{mark}\d{{3}})+(\{point}\d*)?") for point, mark in _MARKS}
_COMMENT = ("#", "%", "!")


@dataclass(frozen=True, eq=False)
class TextTable:
    """The lines of a file: what stands before the rows of numbers, and these.

    Attributes:
        lines: of the file
        first: index of the first row of numbers
        separator: of cells, a key of SEPARATORS
        decimal: "." or ","
    """

    lines: list[str]
    first: int
    separator: str | None
    decimal: str

    @classmethod
    def read(cls, path: Path, least: int, decimal: str | None = None) -> TextTable:
        """Find the dialect of a file whose shortest row of numbers has so many cells; `decimal` is as found by default.

        Raises:
            ValueError: there is no row of numbers, or its decimals can be read in two ways
        """
        lines = decoded(read_whole(path)).rstrip().splitlines()
        first, separator = _start(lines, least)
        if decimal is None:
            decimal = _decimal(lines[first:], separator)
        return cls(lines, first, separator, decimal)

    @property
    def header(self) -> list[tuple[int, str]]:
        """Number and text of the lines before the rows, without marks of comments and without blank lines."""
        bare = ((i, line.strip().lstrip("#%!").strip()) for i, line in enumerate(self.lines[: self.first], 1))
        return [(i, line) for i, line in bare if line]

    def cells(self, line: str) -> list[str]:
        """Cells of a line."""
        return split(line, self.separator)

    def rows(self) -> list[tuple[int, list[str]]]:
        """Number of the line and cells of each row, all of one length, else ValueError; not of blanks and comments."""
        rows = [
            (i, self.cells(line))
            for i, line in enumerate(self.lines[self.first :], self.first + 1)
            if line.strip() and not is_comment(line)
        ]
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
        return rows

    def numbers(self, *, corner: bool = False) -> Array:
        """All rows as numbers (m, n), else ValueError; NaN for blank cells and for a word in the `corner`."""
        if self.decimal == ".":
            with suppress(ValueError):  # another line shows what is wrong, or blank
                return np.loadtxt(self.lines[self.first :], delimiter=self.separator, ndmin=2, dtype=float)
        rows = self.rows()
        if corner and not is_number(rows[0][1][0]):
            rows[0][1][0] = ""
        return np.array([[self.value(cell, i) for cell in row] for i, row in rows])

    def value(self, cell: str, number: int) -> float:
        """Number of a cell in a line, NaN if it is blank; ValueError where it is none."""
        if cell.lower() in BLANK:
            return np.nan
        with suppress(ValueError):
            return to_number(cell, self.decimal)
        raise ValueError(
            f"row {number} has {cell[:20]!r} among its cells separated by {SEPARATORS[self.separator]}: give a number, "
            "or leave the cell blank where it is missing"
        )


def decoded(raw: bytes) -> str:
    """Text of a file in UTF-8, UTF-16 or Latin-1; ValueError where it is none."""
    if raw[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return raw.decode("utf-16", errors="replace")
    start = raw[:4096]
    if b"\0" in start:
        for offset, name in ((1, "utf-16-le"), (0, "utf-16-be")):  # without a mark: every other byte is zero
            if start[offset::2].count(0) > 0.9 * len(start[offset::2]) and not start[1 - offset :: 2].count(0):
                return raw.decode(name, errors="replace")
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


def to_number(cell: str, decimal: str) -> float:
    """Number of a cell, else ValueError; the other of point and comma may separate groups of three digits."""
    other = "," if decimal == "." else "."
    if other in cell:
        if not _GROUPS[decimal].fullmatch(cell):
            raise ValueError(cell)
        cell = cell.replace(other, "")
    if not is_number(cell):
        raise ValueError(cell)
    return float(cell.replace(decimal, ".").replace("d", "e").replace("D", "e"))


def split(line: str, separator: str | None) -> list[str]:
    """Cells of a line without quotes and white space around them."""
    if separator is None:
        return [cell.strip('"') for cell in line.split()]
    if '"' in line:
        with suppress(csv.Error, StopIteration):
            return [cell.strip() for cell in next(csv.reader([line.strip(" ")], delimiter=separator))]
    return [cell.strip() for cell in line.split(separator)]


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
    cells = split(line, separator)
    if separator == "," and _decimal_commas(line, cells):
        return 0
    filled = [cell for cell in cells if cell.lower() not in BLANK]
    return len(cells) if len(cells) >= least and len(filled) > 2 * sum(not is_number(cell) for cell in filled) else 0


def _decimal_commas(line: str, cells: list[str]) -> bool:
    """Whether commas in a line separate digits, not cells: there is white space between numbers with one comma each."""
    words = line.split()
    return (
        len(words) >= 2
        and all(is_number(word) and not word.endswith(",") for word in words)
        and len(cells) <= len(words) + 1
    )


def _decimal(lines: Iterable[str], separator: str | None) -> str:
    """Decimal point or comma of the rows; ValueError for both, and for numbers as 1,234, which may be thousands."""
    votes: dict[str, str] = {}
    doubtful = ""
    rows = [line for line in lines if line.strip() and not is_comment(line) and (separator != "," or '"' in line)]
    cells = (cell for line in rows for cell in split(line, separator)) if any("," in line for line in rows) else ()
    for cell in cells:
        if not is_number(cell) or ("," not in cell and "." not in cell):
            continue
        mark, certain = _mark(cell)
        if certain:
            votes.setdefault(mark, cell)
        elif mark == ",":
            doubtful = doubtful or cell
    if len(votes) > 1:
        raise ValueError(f"{votes['.']!r} has a decimal point, {votes[',']!r} a decimal comma: write one of them")
    if votes:
        return next(iter(votes))
    if doubtful:
        raise ValueError(
            f"the comma of {doubtful!r} separates decimals or thousands, and no other number shows which: write a "
            "point, or give import-map --decimal comma or --decimal point"
        )
    return "."


def _mark(cell: str) -> tuple[str, bool]:
    """Decimal mark of a number with points or commas, and whether there is no other way to read it."""
    digits = re.split("[eEdD]", cell.lstrip("+-"))[0]
    marks = [c for c in digits if c in ".,"]
    if len(set(marks)) == 2:
        return marks[-1], True
    if len(marks) > 1:
        return "," if marks[0] == "." else ".", True
    head, tail = re.split("[.,]", digits)
    groups = len(tail) == 3 and 1 <= len(head) <= 3 and head[0] != "0" and digits == cell.lstrip("+-")
    return marks[0], not groups
