"""Tools of any height: closed forms, exchange of tool and surface, ranks, tolerance, refusals."""

from __future__ import annotations

import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from conftest import ELASTIC, PLASTIC, here, world

from asperity import Case
from asperity import reference as ref
from asperity.adaptive.guide import Guide
from asperity.adaptive.mesh_plan import MeshFamily
from asperity.adaptive.solve_contact import solve_contact
from asperity.curve import Curve
from asperity.errors import InputError, MeshError, ResolutionWarning
from asperity.model.problem import Problem
from asperity.model.settings import Formulation, MeshSize
from asperity.quasistatic.solve_problem import solve_problem
from asperity.reference.halfspace import added_to_spot
from asperity.surface import Composite, Cone, Flat, Pyramid, SelfAffine, Sinusoid, Sphere, Surface, composite

CORNER = (0.0, 0.0)  # a quarter of a contact
PLANE = Flat(L=1.0)


def pressed(
    surface: Surface, tool: Surface, delta: float, h: float, method: str = "active-set", **more: object
) -> Curve:
    """Curve of an elastic block, three high."""
    return solve_contact(
        surface, ELASTIC, tool=tool, delta_max=delta, height=3.0, size=MeshSize(h, growth=0.4, h_max=0.5),
        formulation=Formulation(method), comm=here(), **{"steps": 1, **more},
    ).curve  # fmt: skip


def on_half_space(curve: Curve, radius: float) -> float:
    """Approach of the last step on a half-space: less what base and sides add [L]."""
    unit = added_to_spot(radius, CORNER, 3.0, ELASTIC.nu, "rollers")
    return float(curve.delta[-1] - curve.force[-1] / ELASTIC.reduced_modulus * unit)


@pytest.mark.parametrize("method", ["active-set", "penalty", "nitsche"])
def test_a_sphere_on_a_plane_is_that_of_hertz(method: str) -> None:
    ball, a = Sphere(L=1.0, radius=10.0, centre=CORNER, shape="paraboloid"), 0.05
    curve = pressed(PLANE, ball, a**2 / 10.0, a / 6, method)
    delta = on_half_space(curve, a)
    hertz = ref.Hertz(10.0, ELASTIC.reduced_modulus)
    assert 4.0 * curve.force[-1] == pytest.approx(float(hertz.force(delta)), rel=0.01)
    assert 4.0 * curve.area_fraction[-1] == pytest.approx(np.pi * float(hertz.radius(delta)) ** 2, rel=0.03)
    assert curve.force[-1] == pytest.approx(pressed(ball, PLANE, a**2 / 10.0, a / 6, method).force[-1], rel=2e-3)


def test_a_cone_is_that_of_sneddon() -> None:
    """F = (2/pi) E' d^2/slope, Sneddon, Int. J. Engng Sci. 3 (1965) 47."""
    slope, a = 0.05, 0.1
    curve = pressed(PLANE, Cone(L=1.0, half_angle=float(np.degrees(np.arctan(1 / slope))), centre=CORNER),
                    0.5 * np.pi * a * slope, a / 8)  # fmt: skip
    delta = on_half_space(curve, a)
    assert 4.0 * curve.force[-1] == pytest.approx(2 / np.pi * ELASTIC.reduced_modulus * delta**2 / slope, rel=0.02)
