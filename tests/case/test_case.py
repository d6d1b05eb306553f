"""The case file: completion, round trips, and one sentence for every mistake."""

from __future__ import annotations

import tomllib
import warnings
from pathlib import Path

import numpy as np
import pytest
import tomli_w

from asperity.case.case_file import Case
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
    assert case.loading.unload_steps == 0 and not case.loading.unload
    assert case.dynamics is None and case.accuracy.tolerance is None
    for steps, unload_steps in ((10, 5), (1, 1)):
        tables = {**MINIMAL, "loading": {"delta_max": 0.01, "steps": steps, "unload": True}}
        assert Case.from_dict(tables).loading.unload_steps == unload_steps


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
    assert Path(case.to_dict()["surface"]["path"]) == tmp_path / "map.npz"
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


@pytest.mark.parametrize("path", CASES, ids=lambda path: path.stem)
def test_an_override_with_the_value_of_a_key_changes_nothing(path: Path) -> None:
    """With quotes around a text, and without."""
    case = Case.load(path)
    tables = {name: table for name, table in case.to_dict().items() if isinstance(table, dict)}
    for name, value in ((f"{section}.{key}", v) for section, table in tables.items() for key, v in table.items()):
        text = tomli_w.dumps({"v": value}).partition("=")[2].strip()
        for written in (text, text.strip('"')):
            assert Case.load(path, [f"{name}= {written} "]) == case, name


def test_an_override_replaces_adds_and_removes() -> None:
    case = Case.load(DEMO, ["block.height=2e-6", "material.yield_strength=", "material.tangent_modulus=",
                            "dynamics.forcing=[0.01, 0.05]"])  # fmt: skip
    assert case.block.height == 2e-6 and case.material.yield_strength is None
    assert case.dynamics is not None and case.dynamics.forcing == (0.01, 0.05)


#: Legal one by one, but not together, or not with the rest of the case.
CONTRADICTIONS = (
    "loading.unload=false & loading.unload_to=0.5", "loading.unload_steps=0 & loading.unload=true",
    "dynamics.law=unload-reload & loading.unload=false", "surface.G=13.6", "material.E=200",
    "material.yield_strength=1", "material.yield_strength=", "material.tangent_modulus=200e9", "block.height=1",
    "mesh.file=nothing.npz", "mesh.h_contact=0.5e-6", "loading.delta_max=", "loading.force_max=1e-4",
    "loading.pressure_max=1e8", "loading.delta_max=30", "loading.delta_max=2e-6", "dynamics.omega=[1.3, 0.5]",
    'dynamics.model=["exact", "exact"]', "contact.method=nitsche & contact.gamma=0.7",
    "loading.delta_max= & loading.force_max=1", "loading.delta_max= & loading.pressure_max=0.1",
    "slip.friction=0.3 & slip.preload=1.0", "loading.delta_max= & loading.force_max=1e-6 & joint.preload=2e-6",
    *(f"loading.delta_max= & loading.force_max=1e-4 & dynamics.preload={load}" for load in (1e-300, 1e-3, 1e300)),
    "joint.preload=1.0 & joint.pressure=1e8", "joint.pressure=1e8 & dynamics.preload=1e-4",
    "joint.mass=1.0 & dynamics.gravity=9.81", "joint.pressure=1e18", "joint.nominal_area=1e-4 & joint.preload=1e12",
    "slip.friction=0.3 & block.sides=free & contact.friction=0.3", 'dynamics.forcing=["5 N", "2 um"]',
    'dynamics.forcing=["5 K"]', 'dynamics.omega=["9 kHz", "5 kHz"]', 'dynamics.forcing=["5 N"] & units=other',
    "height=1", "surface=3", "block.height", "a.b.c=1", ".L=1",
)  # fmt: skip


@pytest.mark.parametrize("override", CONTRADICTIONS)
def test_a_contradiction_is_refused_with_a_key_that_was_changed(override: str) -> None:
    message = refusal(*override.split(" & "))
    assert any(change.partition("=")[0] in message for change in override.split(" & "))


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
        with pytest.raises(InputError, match="give exactly one"):
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
