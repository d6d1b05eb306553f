"""The case file: completion, round trips, and one sentence for every mistake."""

from __future__ import annotations

import tomllib
import warnings
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from asperity.case.case_file import Case
from asperity.case.keys import input_reference
from asperity.errors import InputError
from asperity.model.material import Material
from asperity.model.problem import Problem
from asperity.surface import Flat

ROOT = Path(__file__).parents[2]
DEMO = ROOT / "cases/single.toml"  # one spot, quick
CASES = sorted((ROOT / "cases").glob("*.toml"))

MINIMAL: dict[str, dict[str, object]] = {
    "surface": {"kind": "flat", "L": 2.0},
    "material": {"E": 1.0, "nu": 0.25},
    "loading": {"delta_max": 0.01},
}


def doubts_of(case: Case) -> list[str]:
    """Of the load."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return case.problem().doubts()


def refusal(*overrides: str, path: Path = DEMO) -> str:
    with pytest.raises(InputError) as caught:
        Case.load(path, overrides)
    message = str(caught.value)
    assert "\n" not in message and caught.value.exit_code == 2
    return message


def test_defaults_follow_from_the_side_of_the_patch() -> None:
    case = Case.from_dict(MINIMAL)
    assert case.block.height == 2.0
    assert case.mesh.h_contact == pytest.approx(0.08)
    assert case.mesh.h_max is None  # as small as slopes need
    assert case.loading.unload_steps == case.loading.steps // 2 == 5
    assert case.dynamics is None and case.accuracy.tolerance is None
    one = Case.from_dict({**MINIMAL, "loading": {"delta_max": 0.01, "steps": 1}})
    assert one.loading.unload_steps == 1


@pytest.mark.parametrize("path", CASES, ids=lambda path: path.stem)
def test_shipped_cases_load_without_a_doubt_and_the_completed_input_reads_back_equal(
    path: Path, tmp_path: Path
) -> None:
    case = Case.load(path)
    assert case.warnings() == doubts_of(case) == []
    copy = tmp_path / "case.toml"
    copy.write_text(case.to_toml(), encoding="utf-8")
    again = Case.load(copy)
    assert again == case and again.hash() == case.hash() and again.to_toml() == case.to_toml()


@pytest.mark.parametrize(("value", "share"), [("isotropic", 0.0), ("kinematic", 1.0), ("0.4", 0.4), ("", 0.0)])
def test_hardening_is_a_name_or_a_share(value: str, share: float) -> None:
    case = Case.load(DEMO, [f"material.hardening={value}"])
    assert case.problem().material.kinematic_share == share
    assert Case.from_dict(tomllib.loads(case.to_toml())) == case


def test_hash_tells_physics_apart_but_not_output() -> None:
    base = Case.load(DEMO)
    assert Case.load(DEMO, ["material.nu=0.31"]).hash() != base.hash()
    assert Case.load(DEMO, ["output.report=false"]).hash() == base.hash()
    assert Case.load(DEMO, ["dynamics.zeta=0.02"]).hash() != base.hash()


def test_files_are_taken_from_the_case_folder_and_hashed_by_content(tmp_path: Path) -> None:
    heights = np.random.default_rng(0).normal(scale=1e-9, size=(16, 16))
    np.savez(tmp_path / "map.npz", z=heights, L=2e-6)
    text = '[surface]\nkind = "file"\npath = "map.npz"\n[material]\nE = 1e9\nnu = 0.3\n[loading]\ndelta_max = 1e-9\n'
    path = tmp_path / "case.toml"
    path.write_text(text)
    case = Case.load(path)
    assert case.surface.L == 2e-6 and case.block.height == 2e-6
    assert Path(case.surface.given()["path"]) == tmp_path / "map.npz"
    before = case.hash()
    np.savez(tmp_path / "map.npz", z=2 * heights, L=2e-6)
    assert Case.load(path).hash() != before
    np.save(tmp_path / "map.npy", heights)
    assert "surface.L" in refusal("surface.path=map.npy", path=path)


def test_numbers_of_numpy_and_paths_are_as_those_of_a_file(tmp_path: Path) -> None:
    np.savez(tmp_path / "map.npz", z=np.random.default_rng(0).normal(size=(16, 16)), L=1.0)
    plain = {"surface": {"kind": "file", "path": "map.npz", "L": 1.0}, "loading": {"delta_max": 0.5, "steps": 4}}
    made = {
        "surface": {"kind": "file", "path": Path("map.npz"), "L": np.int64(1)},
        "loading": {"delta_max": np.float32(0.5), "steps": np.int64(4), "unload": np.bool_(False)},
    }
    a, b = (Case.from_dict(MINIMAL | {"units": "other"} | tables, folder=tmp_path) for tables in (plain, made))
    assert a.hash() == b.hash() and a.to_toml() == b.to_toml()


def test_an_override_replaces_adds_and_removes() -> None:
    case = Case.load(
        DEMO,
        ["block.height=2e-6", "material.yield_strength=", "material.tangent_modulus=",
         "contact.method=penalty", "dynamics.forcing=[0.01, 0.05]"],
    )  # fmt: skip
    assert case.block.height == 2e-6 and case.material.yield_strength is None
    assert case.contact.method == "penalty"
    assert case.dynamics is not None and case.dynamics.forcing == (0.01, 0.05)


MISTAKES = {
    "loading.unload_to=1": ("loading.unload_to = 1", "[0, 1)"),
    "loading.unload=false & loading.unload_to=0.5": ("loading.unload_to = 0.5", "loading.unload = true"),
    "slip.friction=0": ("slip.friction", "(0, 10]"),
    "slip.steps=3": ("slip.friction",),
    "slip.friction=0.3 & slip.method=solid": ("slip.method", "not a key of [slip]"),
    "slip.friction=0.3 & slip.direction=20": ("slip.direction",),
    "surface.gama=1.5": ("surface.gama", '"gamma"'),
    "surface.kind=sphre": ("surface.kind", '"sphere"'),
    "surface.kind=": ("surface.kind", "missing"),
    "surface.D=3": ("surface.D = 3", "(2, 3)"),
    "surface.D=": ("surface.D", "missing"),
    "surface.G=13.6": ("surface.G", "surface.L", "same unit"),
    "surface=3": ("surface", "section"),
    "materials.E=1": ("materials", '"material"'),
    "material.delta_max=1": ("material.delta_max", "[loading]"),
    "material.E=-1": ("material.E = -1", "[1e-20, 1e+40]"),
    "material.E=200": ("yield_strength", "E = 200", "same unit"),
    'material.E="200e9"': ('"200e9"', "must be a number"),
    "material.E=true": ("material.E = true", "must be a number"),
    "material.E=nan": ("material.E = nan", "finite"),
    "material.nu=0.5": ("material.nu = 0.5", "[-0.9, 0.495]"),
    "material.yield_strength=1": ("yield_strength = 1", "same unit"),
    "material.yield_strength=": ("tangent_modulus", "yield_strength"),
    "material.tangent_modulus=200e9": ("tangent_modulus = 2e+11", "below material.E"),
    "material.hardening=kinetic": ('material.hardening = "kinetic"', '"isotropic", "kinematic" or [0, 1]'),
    "material.hardening=1.5": ("material.hardening = 1.5", "[0, 1]"),
    "material.kinematics=large": ('material.kinematics = "large"', '"small", "finite"'),
    "material=": ("material", "missing"),
    "block.height=1": ("block.height", "same unit"),
    "contact.method=glue": ("contact.method", '"penalty"'),
    "contact.penalty=0": ("contact.penalty = 0",),
    "mesh.file=nothing.npz": ("mesh.file", "nothing.npz", "no such file"),
    "mesh.h_contact=0.5e-6": ("mesh.h_contact", "mesh.h_max"),
    "loading.delta_max=": ("loading.delta_max", "missing"),
    "loading.force_max=1e-4": ("loading.force_max", "exactly one"),
    "loading.pressure_max=1e8": ("loading.delta_max and loading.pressure_max are both given", "exactly one"),
    "loading.delta_max=30": ("loading.delta_max", "same unit"),
    "loading.delta_max=2e-6": ("loading.delta_max", "exceeds the block"),
    "loading.steps=0": ("loading.steps = 0", "[1, 100000]"),
    "loading.steps=2.5": ("loading.steps = 2.5", "whole number"),
    "loading.unload=1": ("loading.unload = 1", "true or false"),
    "accuracy.tolerance=0": ("accuracy.tolerance = 0", "[1e-06, 1)"),
    "dynamics.forcing=[0]": ("dynamics.forcing", "[1e-09, 1e+06]"),
    "dynamics.forcing=0.1": ("dynamics.forcing", "list"),
    "dynamics.omega=[1.3, 0.5]": ("dynamics.omega", "low < high"),
    "dynamics.omega=[1]": ("dynamics.omega", "short"),
    'dynamics.model=["exact", "exact"]': ("dynamics.model", "twice"),
    "dynamics.zeta=-0.1": ("dynamics.zeta = -0.1",),
    "units=mm": ("units", '"other"'),
    "height=1": ("height", "case file"),
    "block.height": ("block.height", "section.key=value"),
    "a.b.c=1": ("section.key=value",),
    ".L=1": ("section.key=value",),
    "units.a=1": ("units", '"SI"'),
    "dynamics.law=unload-reload & loading.unload=false": ("loading.unload",),
    "contact.method=nitsche & contact.gamma=0.7": ("contact.gamma = 0.7 is below",),
    "loading.delta_max= & loading.force_max=1": ("check the units",),
    "loading.delta_max= & loading.pressure_max=0.1": ("of E/(1 - nu^2), legal",),
    "slip.friction=0.3 & slip.amplitudes=[0.3, 0.1]": ("0.3, 0.1", "must rise"),
    "slip.friction=0.3 & slip.amplitudes=[0.5, 1.0]": ("slip.amplitudes", "0.99"),
    "slip.friction=0.3 & slip.preload=1.0": ("slip.preload", "must lie between"),
    "loading.delta_max= & loading.force_max=1e-6 & joint.preload=2e-6": ("joint.preload", "and 1e-06, the greatest"),
    **{
        f"loading.delta_max= & loading.force_max=1e-4 & dynamics.preload={preload}": (
            "dynamics.preload = ",
            "must lie between",
            "and 0.0001, the greatest force",
        )
        for preload in (1e-300, 1e-3, 1e300)
    },
    "joint.preload=1.0 & joint.pressure=1e8": ("joint.preload and joint.pressure are both given",),
    "joint.pressure=1e8 & dynamics.preload=1e-4": ("dynamics.preload cannot go with",),
    "joint.mass=1.0 & dynamics.gravity=9.81": ("dynamics.gravity takes the mass",),
    "joint.pressure=1e18": ("joint.pressure = 1e+18 makes a force of 1e+06 on the patch, which must lie between",),
    "joint.nominal_area=1e-4 & joint.preload=1e12": ("joint.preload = 1e+12 makes a force of 10000 on the patch",),
    "joint.area=1.0": ("joint.area",),
    "slip.friction=0.3 & block.sides=free & contact.friction=0.3": ("contact.friction", "remove [slip]"),
    "contact.friction=-1": ("contact.friction",),
    "contact.friction=stick": ("contact.friction",),
    "dynamics.zeta=0": ("dynamics.zeta = 0", "[0.0001, 0.9999]"),
    "dynamics.zeta=[0.1, 2.0]": ("dynamics.zeta", "[0.0001, 0.9999]"),
    'dynamics.forcing=["5 N", "2 um"]': ("dynamics.forcing", "give all with one unit"),
    'dynamics.forcing=["5 K"]': ("dynamics.forcing", "'5 K' is no number with the unit N"),
    'dynamics.omega=["9 kHz", "5 kHz"]': ("dynamics.omega", "low < high"),
    'dynamics.forcing=["5 N"] & units=other': ("dynamics.forcing in N cannot go with units",),
}


@pytest.mark.parametrize("override", MISTAKES)
def test_each_mistake_gives_one_sentence_with_key_value_and_range(override: str) -> None:
    message = refusal(*override.split(" & "))
    for part in MISTAKES[override]:
        assert part in message


@pytest.mark.parametrize(
    "overrides",
    [
        "loading.unload_to=0.5 & loading.cycles=3",
        'dynamics.forcing=["5 N", "3kN"] & dynamics.omega=["5 kHz", "9kHz"] & dynamics.zeta=[0.01, 0.02]',
    ],
)
def test_what_goes_together_is_accepted(overrides: str) -> None:
    case = Case.load(DEMO, overrides.split(" & "))
    assert Case.from_dict(case.to_dict()) == case


def test_a_nominal_pressure_is_a_force_by_another_name() -> None:
    """The same problem, and the same range of the preload."""
    by_pressure = Case.load(DEMO, ["loading.delta_max=", "loading.pressure_max=1e8"])
    by_force = Case.load(DEMO, ["loading.delta_max=", "loading.force_max=1e-4"])
    forces = [case.problem().load_path.force_max for case in (by_pressure, by_force)]
    assert forces == pytest.approx([1e-4, 1e-4], rel=1e-14)
    assert by_pressure.loading.driver == "pressure_max" and by_pressure.greatest_force == forces[0]
    for force in (1.0, None):
        pressure = force
        with pytest.raises(InputError, match="exactly one of delta_max, force_max and pressure_max"):
            Problem.of(Flat(L=1.0), Material(1.0, 0.3), force_max=force, pressure_max=pressure)
    with pytest.raises(InputError, match=r"loading.pressure_max = -1 is"):
        Problem.of(Flat(L=1.0), Material(1.0, 0.3), pressure_max=-1.0)


@pytest.mark.parametrize(
    ("content", "parts"),
    [
        (b"[surface\n", ("TOML", "line 1")), (b"[a]\nx = 1\nx = 2\n", ("TOML", "line 3")),
        (b'[a]\nx = "\xe4"\n', ("UTF-8", "line 2")), (b"x = " + b"[" * 3000, ("TOML",)),
        (b"", ("surface", "missing")), (b"\x00", ("TOML",)),
    ],
)  # fmt: skip
def test_files_that_are_no_case(tmp_path: Path, content: bytes, parts: tuple[str, ...]) -> None:
    path = tmp_path / "case.toml"
    path.write_bytes(content)
    message = refusal(path=path)
    assert all(part in message for part in parts)


def test_the_source_of_a_mistake_is_named() -> None:
    assert refusal("material.nu=0.7").startswith("--set: ")
    assert refusal("material.E=200").startswith(str(DEMO))


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ("accuracy.tolerance=0.01 mesh.h_contact=5e-8", "accuracy.tolerance chooses the mesh"),
        ("accuracy.max_dofs=100_000", "there is no accuracy.tolerance"),
        ("contact.gamma=3", "contact.method is active-set"),
        ("contact.method=nitsche contact.penalty=20", "contact.method is nitsche"),
        ("loading.integrator=backward-euler material.yield_strength= material.tangent_modulus=", "is elastic"),
    ],
)
def test_a_key_that_has_no_effect_is_named(change: str, why: str) -> None:
    changes = change.split()
    key = changes[1 if len(changes) == 2 else 0].partition("=")[0]
    (warning,) = Case.load(DEMO, changes).warnings()
    assert warning.startswith(f"{key} = ") and warning.endswith(why)


def test_no_key_of_a_completed_input_is_without_effect() -> None:
    for changes in ([], ["accuracy.tolerance=0.01"], ["loading.unload=false", "contact.method=penalty"]):
        assert Case.from_dict(Case.load(DEMO, changes).to_dict()).warnings() == []


def test_a_modulus_in_gigapascal_with_lengths_in_metre_is_refused() -> None:
    elastic = ("material.yield_strength=", "material.tangent_modulus=", "material.E=200")
    assert "Pa" in refusal(*elastic)
    assert Case.load(DEMO, [*elastic, "units=other"]).material.E == 200


def test_a_load_that_passes_the_lowest_valley_is_told() -> None:
    assert "peak to valley" in doubts_of(Case.load(DEMO, ["loading.delta_max=0.05e-6"]))[0]


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ([], ""),
        (["surface.seed=1"], "on the edge x = L of the patch, where it slopes by 0.18: mirrored by the rollers"),
        (["surface.seed=1", "block.sides=free"], "at the free side x = L and y = L of the patch"),
        (["surface.seed=2", "block.sides=free"], ""),
    ],
)
def test_a_first_touch_on_an_edge_of_the_patch_is_told(keys: list[str], said: str) -> None:
    for driven in ([], ["loading.delta_max=", "loading.force_max=1e-4"]):
        case = Case.load(DEMO, [*keys, *driven])
        texts = doubts_of(case)
        assert len(texts) == bool(said) and all(said in text for text in texts)


@pytest.mark.parametrize(("sides", "count"), [("rollers", 0), ("free", 1)])
def test_a_quarter_of_a_sphere_in_a_corner_is_no_first_touch_on_an_edge(sides: str, count: int) -> None:
    """Rollers are its planes of symmetry; at free sides there is none."""
    quarter = {"kind": "sphere", "L": 1.0, "radius": 1.0, "centre": [0.0, 0.0]}
    case = Case.from_dict(MINIMAL | {"surface": quarter, "block": {"sides": sides}})
    assert len(doubts_of(case)) == count


VALUES = st.one_of(
    st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=8),
    st.sampled_from(["sphere", "flat", "file", "exact", "free", 10**400, -1e308, 1e-320, 1e-9]),
    st.lists(st.floats(), max_size=3), st.dictionaries(st.text(max_size=3), st.integers()),
)  # fmt: skip
KEYS = [(section.split()[0], key) for section, key, *_ in input_reference()]


@settings(max_examples=150, deadline=None)
@given(st.lists(st.tuples(st.sampled_from(KEYS), VALUES), min_size=1, max_size=4))
def test_any_values_give_a_case_or_a_sentence(changes: list[tuple[tuple[str, str], object]]) -> None:
    data: dict[str, dict[str, object]] = Case.load(DEMO).to_dict()
    for (section, key), value in changes:
        data.setdefault(section, {})[key] = value
    try:
        case = Case.from_dict(data)
    except InputError as error:
        assert str(error) and "\n" not in str(error) and len(str(error)) < 600
    else:
        assert Case.from_dict(case.to_dict()) == case
