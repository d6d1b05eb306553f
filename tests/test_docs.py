"""The documentation: its Python runs, its commands are legal, its numbers are those of tables; also of docstrings."""

from __future__ import annotations

import csv
import doctest
import importlib
import inspect
import os
import re
import shlex
import shutil
import warnings
from collections.abc import Iterator, Sequence
from pathlib import Path

import click
import numpy as np
import pytest
from conftest import call
from made_up_run import write_run
from scipy.interpolate import PchipInterpolator

import asperity
from asperity.case import Case
from asperity.cli import group

ROOT = Path(__file__).parent.parent
ALL_PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
TYPED = ("tutorials", "how-to", "stiffness.md")  # what tests/test_walkthroughs.py alone runs, as typed
PAGES = [page for page in ALL_PAGES if page.parent.name not in TYPED and page.name not in TYPED]
FENCE = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
MUST_RUN = {"check", "init", "compare"}  # commands that take no time


def blocks(page: Path, language: str) -> list[str]:
    """Fenced blocks of a language."""
    return [code for name, code in FENCE.findall(page.read_text(encoding="utf-8")) if name == language]


def commands(pages: Sequence[Path]) -> list[str]:
    """Lines of pages that call something, without what is only an option of `./run`."""
    found = []
    for page in pages:
        text = page.read_text(encoding="utf-8")
        fenced = "\n".join(code for name, code in FENCE.findall(text) if name in ("sh", "bash"))
        indented = re.findall(r"^    (\S.*)$", FENCE.sub("", text), re.MULTILINE)
        for line in [*fenced.splitlines(), *indented]:
            words = shlex.split(line.partition(" || ")[0].partition(" && ")[0], comments=True)
            while words and (words[0] in ("./run", "mpirun", "-n") or words[0].isdigit() or "$" in words[0]):
                words = words[1:]
            if words and words[0] in ("asperity", "python3"):
                found.append(shlex.join(words))
    return sorted({c for c in found if "$" not in c})


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder with the cases and with finished runs and maps of the names the pages use."""
    for name in ("cases", "examples", "benchmarks"):
        (tmp_path / name).symlink_to(ROOT / name)
    for name in ("demo", "new", "good", "press", "joint", "pressed"):
        write_run(tmp_path / "out" / name)
    (tmp_path / "tests/curves").mkdir(parents=True)
    shutil.copy(tmp_path / "out/demo/curve.csv", tmp_path / "quick.csv")
    (tmp_path / "out/paper").mkdir()
    monkeypatch.chdir(tmp_path)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield tmp_path


@pytest.mark.parametrize("page", [p for p in PAGES if blocks(p, "python")], ids=lambda p: str(p.relative_to(ROOT)))
def test_python_runs(page: Path, place: Path) -> None:
    """The blocks of a page one after the other, as a reader types them."""
    names: dict[str, object] = {"__name__": "__main__"}  # where dataclasses look for their module
    for code in blocks(page, "python"):
        exec(compile(code, f"{page.name}: {code[:40]}", "exec"), names)


@pytest.mark.parametrize("line", commands(ALL_PAGES))
def test_command_is_legal(line: str, place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    program, *arguments = shlex.split(line)
    arguments = ["0.1" if word == "..." else word for word in arguments]
    if program == "python3":
        assert os.path.exists(arguments[0]) or arguments[0] in ("driver.py", "-m")
        return
    assert arguments
    context = click.Context(group, info_name="asperity")
    command = group.get_command(context, arguments[0])
    if arguments[0].startswith("-") or arguments == ["..."]:
        return
    assert command is not None, line
    files = [word for word in arguments if word.startswith("cases/")]
    assert all(os.path.exists(name) for name in files)
    try:
        command.make_context(arguments[0], arguments[1:], parent=context)
    except click.BadParameter as error:  # what the page makes before
        assert "does not exist" in str(error)
    else:
        runs = arguments[0] in MUST_RUN and "--store" not in arguments and line in commands(PAGES)
        assert not runs or call(*arguments) == 0, capsys.readouterr().err


def test_the_files_of_the_architecture_exist_and_are_counted() -> None:
    page = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    names = set(re.findall(r"`([\w/]+\.(?:py|cpp|hpp))`", page))
    assert len(names) > 30
    assert not [name for name in names if not ((ROOT / name).exists() or (ROOT / "python/asperity" / name).exists())]
    packages = [path.parent.name for path in (ROOT / "python/asperity").glob("*/__init__.py")]
    assert not [name for name in packages if f"\n| `{name}` |" not in page]
    rows = re.findall(r"^\| .* \| (\d+) \| (.*) \|$", page, re.MULTILINE)
    assert len(rows) >= 10
    for count, files in rows:
        assert len(files.partition(";")[0].split(", ")) == int(count), files


@pytest.mark.parametrize("path", sorted((ROOT / "docs/tables").glob("*.csv")), ids=lambda p: p.stem)
def test_tables_name_their_command_and_are_read(path: Path) -> None:
    command, made, *lines = path.read_text(encoding="utf-8").splitlines()
    header, *rows = csv.reader(lines)
    assert rows and {len(row) for row in rows} == {len(header)}
    assert re.match(r"# \d{4}-\d\d-\d\d, asperity \d", made)
    words = shlex.split(command)
    assert words[:2] == ["#", "./run"]
    assert any((ROOT / word).is_file() or word == "asperity" for word in words[2:])
    links = [page for page in ALL_PAGES if f"tables/{path.name})" in page.read_text(encoding="utf-8")]
    assert links, "no page leads to this table"


def text_of(page: str) -> str:
    """Text of a page without its line breaks."""
    return " ".join((ROOT / page).read_text(encoding="utf-8").split())


def table(name: str) -> list[dict[str, str]]:
    with (ROOT / f"docs/tables/{name}.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(line for line in file if not line.startswith("#")))


def test_the_first_page_gives_the_numbers_of_the_demo() -> None:
    """Those of its stored curve; stiffness of the interface by an interpolant of the unloading, frequency by mass."""
    case, rows = Case.load(ROOT / "cases/demo.toml"), table("demo")
    joint = case.to_dict()["joint"]
    top = next(i for i, row in enumerate(rows) if row["branch"] == "unload") - 1
    text = text_of("README.md")
    bar = float(rows[top]["error_P_star"]) / float(rows[top]["P_star"])
    assert rows[top]["spots"] == "5" and "five spots" in text
    assert f"{float(rows[top]['force']):.3f} N ± {100 * bar:.1f} %" in text
    assert f"{100 * float(rows[top]['area_fraction']):.1f} % in contact" in text

    side = case.surface.L
    share = side**2 / joint["nominal_area"]
    assert float(rows[top]["force"]) / share == pytest.approx(joint["overload"] * joint["preload"], rel=1e-6)
    force, delta = (np.array([float(row[name]) for row in rows[: top - 1 : -1]]) for name in ("force", "delta"))
    delta = delta - force * case.block.height / (side**2 * case.material.block_modulus(case.block.sides))
    load = joint["preload"] * share
    spline = PchipInterpolator(delta, force)(float(PchipInterpolator(force, delta)(load)), 1)
    shown, numerical = re.findall(r"([\d.]+) GN/m; .* numerical error (\d+) %", text)[0]
    assert spline / share == pytest.approx(float(shown) * 1e9, rel=float(numerical) / 100)
    kilohertz = re.findall(r"([\d.]+) kHz", text)[0]
    hertz = np.sqrt(float(shown) * 1e9 / joint["mass"]) / (2 * np.pi)
    assert float(kilohertz) == pytest.approx(hertz / 1000, abs=0.03)  # both are rounded


def test_what_the_paper_cites_is_in_its_list_and_the_other_way_round() -> None:
    bib, paper = ((ROOT / "paper" / name).read_text(encoding="utf-8") for name in ("paper.bib", "paper.md"))
    defined = re.findall(r"^@\w+\{(\w+),", bib, re.MULTILINE)
    assert len(set(defined)) == len(defined) == len(re.findall(r"^  doi +=", bib, re.MULTILINE)) > 5
    assert set(re.findall(r"@(\w+)", paper)) == set(defined)


def test_every_picture_has_its_command_and_is_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(ROOT / "benchmarks"))
    made = importlib.import_module("evidence").NAMES
    files = sorted((ROOT / "docs/pictures").iterdir())
    assert sorted(path.stem for path in files) == sorted(made)
    text = "".join(page.read_text(encoding="utf-8") for page in ALL_PAGES)
    assert [path.name for path in files if f"pictures/{path.name})" not in text] == []
    assert set(re.findall(r"pictures/([\w.]+)\)", text)) == {path.name for path in files}


# --- pages of the Python API ----------------------------------------------------------------------------------

DIRECTIVE = re.compile(r"^::: ([\w.]+)\n(?:    options:\n      members: \[(.*)\]\n)?", re.MULTILINE)


def public_names() -> list[tuple[str, str]]:
    """Module and name of each class and function on the page: those it lists, or all that the module defines."""
    found = []
    for name, listed in DIRECTIVE.findall((ROOT / "docs/api.md").read_text(encoding="utf-8") + "\n"):
        module = importlib.import_module(name)
        own = [n for n, o in vars(module).items() if n[0] != "_" and getattr(o, "__module__", "") == name]
        found += [(name, member) for member in (listed.split(", ") if listed else own)]
    return found


def member(module: str, name: str) -> object:
    """What a name of a module means, None if it is missing."""
    return getattr(importlib.import_module(module), name, None)


def test_each_name_of_the_api_page_exists_and_each_public_name_is_on_it() -> None:
    names = public_names()
    shown = [member(*pair) for pair in names]
    assert names and [pair for pair, found in zip(names, shown, strict=True) if found is None] == []
    modules = {importlib.import_module(name.rpartition(".")[0]) for name, _ in names}
    public = {name: getattr(asperity, name) for name in asperity.__all__}
    assert [name for name, o in public.items() if not any(o is s for s in (*shown, *modules))] == []


def test_links_lead_to_no_archive_of_packages() -> None:
    """Packages come from where the host takes its own: no file names a host of them."""
    folders = ("benchmarks", "cases", "docs", "examples", "python", "solver", ".ci")
    files = [path for path in ROOT.iterdir() if path.is_file()]
    files += [path for name in folders for path in (ROOT / name).rglob("*") if path.is_file()]
    hosts = set()
    for path in files:
        if path.suffix not in {".png", ".npz", ".pyc", ".so"}:
            text = path.read_text(encoding="utf-8", errors="replace")
            hosts |= set(re.findall(r"(?:https?|ftp)://([\w.-]+)", text))
    assert hosts <= {"doi.org", "fsf.org", "json-schema.org", "keepachangelog.com", "www.gnu.org", "www.w3.org"}


def numbers(rows: list[dict[str, str]], column: str) -> np.ndarray:
    return np.array([[float(x) for x in row[column].split(",")] for row in rows])


def inside(name: str, column: str = "inside") -> str:
    """Steps inside the bars of a table, or of several, and all."""
    rows = [row for one in name.split() for row in table(one)]
    return "{} of {}".format(*(sum(int(row[column].split("/")[k]) for row in rows) for k in (0, 1)))


def claims() -> Iterator[tuple[str, str]]:
    """Page, and words on it that follow from a table."""
    accuracy = "docs/accuracy.md"
    for page in (accuracy, "paper/paper.md"):
        yield from ((page, inside(names)) for names in ("bars_elastic bars_half", "bars_yielding"))
    yield accuracy, f"| area | {inside('bars_elastic bars_half', 'area inside')} |"
    ratio, price = (numbers(table("bars_elastic"), name)[:, 0] for name in ("bar/error", "over last mesh"))
    yield accuracy, f"is {np.median(ratio):.1f} times its error in the median"
    yield accuracy, f"is {np.median(price):.1f} times the time of its last mesh in the median"
    yield accuracy, f"The greatest ratio is {price.max():.1f}."
    # other kinds and seeds
    kinds = "| elastic, 12 other kinds, to [5 and 2 %](tables/bars_kinds.csv) |"
    yield accuracy, f"{kinds} {inside('bars_kinds')} |"
    same = "to 5 and 2 %, at the same force | steps inside the bar | |---|---| | area |"
    yield accuracy, f"{same} {inside('area_inside', 'area inside')} |"
    yield accuracy, f"| gap | {inside('area_inside', 'gap inside')} |"
    # slip: of the law against a half-space, of few rows, of the solid
    u, energy = "u at 0.1, 0.3, 0.6, 0.9 mu P, %", "energy, %"
    for nu in ("0.3", "0.45"):
        rows = [row for row in table("slip_law") if row["nu"] == nu]
        most = [f"{np.abs(values).max():.1f}" for values in (numbers(rows, u), numbers(rows, energy)[:, 1:])]
        yield accuracy, f"ν = {nu} | up to {most[0]} % off | up to {most[1]} % off |"
    few = max(numbers([row], energy)[:, 1:].max() for row in table("slip_rows") if row["rows"] != "3")
    yield accuracy, f"| within {np.ceil(few):.0f} % |"
    steep = [row for row in table("slip_solid") if row["slope"] == "0.1"]
    for method, words in (("solid", ("{} to {} % softer", "{} to {} % more")), ("its curve", ("| {} to {} % |",) * 2)):
        rows = [row for row in steep if row["method"] == method]
        for values, text in zip((numbers(rows, u), numbers(rows, energy)[:, 1:]), words, strict=True):
            yield accuracy, text.format(f"{values.min():.1f}", f"{values.max():.1f}")
    yield accuracy, f"up to {-numbers(table('slip_yielded'), energy)[:, 1:].min():.0f} % too low"
    for hardening, loop, digits in (("isotropic", 0, 1), ("isotropic", 2, 2), ("kinematic", 2, 1)):
        rows = [row for row in table("slip_yielded") if (row["hardening"], row["preload"]) == (hardening, "1")]
        ratio = numbers(rows, "loops that flow")[:, loop]
        yield accuracy, f"{ratio.min():.{digits}f} to {ratio.max():.{digits}f} times"
    # the mass on the full solid: within 0.5 % on a light block; added mass to a tenth of its effect
    moved = [(row["case"].split(",")[0], float(row["difference, %"])) for row in table("inertia")]
    limits = {"light block": 0.5, "heavy block": 10.0, "impact": 0.1}
    if all(value < limits.get(name, np.inf) for name, value in moved) and limits.keys() <= dict(moved).keys():
        yield from ((page, "within 0.5 % with a transient simulation") for page in ("README.md", "docs/theory.md"))
    else:
        yield "docs/tables/inertia.csv", f"within {limits}"


def test_the_pages_say_what_the_tables_give() -> None:
    assert [(page, words) for page, words in claims() if words not in text_of(page)] == []


def test_the_costs_at_equal_error_are_those_of_the_tables(monkeypatch: pytest.MonkeyPatch) -> None:
    """CPU seconds on the lines through the runs of each program; the tables have three digits."""
    monkeypatch.syspath_prepend(str(ROOT / "benchmarks/peers"))
    compare = importlib.import_module("compare")

    def cpu(material: str, program: str, target: float) -> float:
        rows = [row for row in table(f"peers_{material}") if row["program"] == program and row["rms error %"]]
        runs = [compare.Run(program, row["mesh"], 0, float(row["CPU s"]), 1, [], "done") for row in rows]
        errors = [float(row["rms error %"]) / 100 for row in rows]
        return float(compare.cost([compare.Point(*pair) for pair in zip(runs, errors, strict=True)], target).cpu)

    page = text_of("docs/accuracy.md")
    rows = re.findall(r"\| ([^|]+) \| [≤≈]?([\d.]+) s, [^|]+ \| [^|]+ \| (?:[≤≈]?([\d.]+) s,|not)", page)
    assert len(rows) == 5
    for program, *shown in rows:
        for target, seconds in zip((0.02, 0.01), shown, strict=True):
            assert not seconds or cpu("elastic", program, target) == pytest.approx(float(seconds), rel=0.02)
    one = cpu("elastic", "CalculiX", 0.01)
    own = cpu("elastic", "asperity", 0.01)
    ratios = dict(re.findall(r"\| (CalculiX[^|]*) \|[^|]+\|[^|]+\|[^|]+\| ([\d.]+) \|", page))
    assert {name: float(ratio) for name, ratio in ratios.items()} == pytest.approx(
        {name: cpu("elastic", name, 0.01) / own for name in ("CalculiX", "CalculiX, mesh of asperity")}, rel=0.02
    )
    seconds = re.findall(r"\| CPU \| ([\d.]+) s \| ≈([\d.]+) s \|", page)[0]
    plastic = [cpu("plastic", name, 0.02) for name in ("asperity", "CalculiX")]
    assert [float(x) for x in seconds] == pytest.approx(plastic, rel=0.02)
    pattern = r"to 1 %: ([\d.]+) CPU seconds with its error bar, CalculiX (\d+) times"
    bar, times = re.findall(pattern, text_of("README.md"))[0]
    assert float(bar) == pytest.approx(cpu("elastic", "asperity, by tolerance", 0.01), rel=0.02)
    assert float(times) == pytest.approx(one / float(bar), rel=0.02)


def test_the_tuned_constants_on_the_page_exist() -> None:
    page = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `([\w/]+)\.py` \| ([A-Z_, ]+) \|$", page, re.MULTILINE)
    found = [(f"asperity.{file.replace('/', '.')}", name) for file, names in rows for name in names.split(", ")]
    assert len(found) > 40 and [pair for pair in found if member(*pair) is None] == []


# --- docstrings -------------------------------------------------------------------------------------------------

OPTIONS = doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS


def modules() -> Iterator[str]:
    """Names of the modules of the package with an example."""
    root = Path(str(asperity.__file__)).parent
    for path in sorted(root.rglob("*.py")):
        if ">>>" in path.read_text(encoding="utf-8"):
            yield ".".join(path.relative_to(root.parent).with_suffix("").parts).removesuffix(".__init__")


@pytest.mark.parametrize("name", modules())
def test_the_examples_print_what_they_show(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    module = importlib.import_module(name)
    found = doctest.DocTestFinder(exclude_empty=True).find(module, extraglobs={"asp": asperity, "np": np})
    report: list[str] = []
    for example in (test for test in found if test.examples):
        place = tmp_path / example.name
        place.mkdir()
        monkeypatch.chdir(place)
        doctest.DocTestRunner(optionflags=OPTIONS, verbose=False).run(example, out=report.append)
    assert report == []
    text = inspect.getsource(module)
    assert sum(len(test.examples) for test in found) == sum(
        line.lstrip().startswith(">>>") for line in text.splitlines()
    )


def test_what_a_user_calls_first_has_an_example() -> None:
    public = {name: getattr(asperity, name) for name in asperity.__all__}
    called = {n: o for n, o in public.items() if callable(o) and not (inspect.isclass(o) and issubclass(o, Exception))}
    assert len(called) > 20
    assert [name for name, thing in called.items() if ">>> " not in (thing.__doc__ or "")] == []
