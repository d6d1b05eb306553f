"""A mass on the solid block in time: a bar in closed form, order, energy, the static limit."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from conftest import world
from scipy.optimize import brentq

from asperity import reference as ref
from asperity.errors import ConvergenceError, InputError
from asperity.fem.tangent import Inertia
from asperity.mesh.generate import build_block
from asperity.model.load_path import Schedule
from asperity.model.material import Material
from asperity.quasistatic.contact_solver import ContactSolver
from asperity.quasistatic.make import make_contact_solver
from asperity.quasistatic.stepping import Record, follow
from asperity.runtime.parallel import on_root
from asperity.surface import Flat, Sinusoid, Surface
from asperity.transient import GeneralisedAlpha, Motion, TimeSeries, Transient
from asperity.vibration import ContactOscillator, CurveLaw

Array = npt.NDArray[np.float64]

NU = 0.3


def crossings(history: TimeSeries) -> Array:
    """Times at which a plate passes first touch, down and up."""
    x, time = history.approach, history.time
    i = np.flatnonzero(x[:-1] * x[1:] < 0.0)
    return time[i] - x[i] * (time[i + 1] - time[i]) / (x[i + 1] - x[i])


def press_on(surface: Surface, size: float, material: Material | None = None) -> ContactSolver:
    comm = world()
    block = on_root(comm, lambda: build_block(surface, 1.0, lambda x, y, depth: size))
    return make_contact_solver(comm, surface, block, material or Material(1.0, NU))


# --- the scheme on a single mass ---------------------------------------------------------------------------------


def amplification(scheme: GeneralisedAlpha, omega_h: float) -> Array:
    """Matrix of a step h = 1 of x'' = -omega^2 x on (x, v, w, a)."""
    columns = []
    for start in np.eye(4):
        motion = Motion(*start)
        anchor, c = motion.anchor(scheme, 1.0)
        after = motion.at(c * anchor / (c + omega_h**2), scheme, 1.0)
        columns.append([after.x, after.v, after.w, after.a])
    return np.array(columns).T


@pytest.mark.parametrize("rho", [0.0, 0.8, 1.0])
def test_scheme_has_the_requested_spectral_radius(rho: float) -> None:
    scheme = GeneralisedAlpha(rho)
    for omega_h in np.logspace(-2, 3, 26):
        assert np.abs(np.linalg.eigvals(amplification(scheme, omega_h))).max() < 1.0 + 1e-6
    # the largest eigenvalue at infinite frequency is repeated, so it is approached slowly
    assert np.abs(np.linalg.eigvals(amplification(scheme, 1e6))).max() == pytest.approx(rho, abs=1e-3)


def test_scheme_hardly_damps_what_it_resolves() -> None:
    """The damping ratio of resolved motion is of third order in omega h, its frequency right to second order."""
    found = []
    for h in (0.1, 0.05):
        values = np.linalg.eigvals(amplification(GeneralisedAlpha(0.8), h))
        z = np.log(values[np.argmax(np.abs(values) * (values.imag > 0))])
        found.append((-z.real / h, 1.0 - z.imag / h))
    (damping, shift), (half_damping, half_shift) = found
    assert damping / half_damping == pytest.approx(8.0, rel=0.05) and damping < 1e-5
    assert shift / half_shift == pytest.approx(4.0, rel=0.02)


def test_bad_input_is_refused() -> None:
    with pytest.raises(InputError, match="rho_inf"):
        GeneralisedAlpha(1.2)
    solver = press_on(Flat(L=1.0), 0.6)
    for name, value in (("density", 0.0), ("mass", -1.0), ("load", np.nan), ("load", -1.0), ("dashpot", -0.1)):
        values: dict[str, Any] = {"density": 1.0, "mass": 1.0, "load": 1.0, name: value}
        with pytest.raises(InputError, match=name):
            Transient(solver, **values)
    with pytest.raises(InputError, match="h = 0"):
        Transient(solver, density=1.0, mass=1.0, load=1.0).run(1.0, 0.0)


# --- a bar with a mass on top, in closed form --------------------------------------------------------------------


def test_consistent_mass_is_that_of_the_block() -> None:
    """Total, first and second moment of the mass of a cube: its quadrature is exact there."""
    solid = press_on(Flat(L=1.0), 0.6).solid
    mass = Inertia(solid.V, solid.sparsity, 1.0).mass
    one, z = np.ones(solid.nodes), solid.points[:, 2]
    moments = [float(solid.comm.allreduce(a @ (mass @ b))) for a, b in ((one, one), (one, z), (z, z))]
    assert moments == pytest.approx([1.0, 1.0 / 2.0, 1.0 / 3.0], rel=1e-12)


@cache
def bar(steps: int, ratio: float = 0.5, periods: float = 2.0, kinematics: str = "small") -> tuple[float, float]:
    """Error of a flat block with a mass on top in its first mode, and its gain of energy, both relative.

    The mode is sin(b z) with b tan(b) = mass of the block/mass, and omega = b sqrt(M/rho) for a unit cube.
    """
    solver = press_on(Flat(L=1.0), 0.6, Material(1.0, NU, kinematics=kinematics))
    assert solver.step(0.01).converged
    load, modulus = solver.force, ref.block_modulus(1.0, NU)
    if kinematics == "finite":  # slope of -ln(1 - e)/(1 - e)
        modulus *= (1.0 - np.log(0.99)) / 0.99**2
    b = brentq(lambda x: x * np.tan(x) - ratio, 1e-6, 1.5)
    omega = b * np.sqrt(modulus / ratio)
    z = solver.solid.points[: solver.solid.owned, 2]
    shape = np.zeros((solver.solid.owned, 3))
    shape[:, 2] = -np.sin(b * z) / np.sin(b)
    a = 1e-3
    at = solver.state()
    solver.restore(replace(at, delta=at.delta + a, displacement=at.displacement + a * shape, before=None))
    transient = Transient(solver, density=ratio, mass=1.0, load=load)
    transient.start(shape=shape)
    period = 2.0 * np.pi / omega
    history = transient.run(periods * period, period / steps)
    exact = 0.01 + a * np.cos(omega * history.time)
    gain = (history.energy - history.supplied) / (0.5 * (1.0 + transient.added_mass) * (a * omega) ** 2)
    return float(np.abs(history.approach - exact).max()) / a, float(gain[-1] - gain[0])


def test_bar_with_a_mass_on_top_moves_in_its_first_mode() -> None:
    errors = [bar(steps)[0] for steps in (20, 40, 80)]
    assert errors[2] < 8e-3
    assert np.log2(np.array(errors[:-1]) / errors[1:]) == pytest.approx(2.0, abs=0.15)


def test_bar_keeps_its_energy() -> None:
    """The corners of a uniform pressure carry no force, so they leave and meet the plate; each time little is lost."""
    assert -1e-3 < bar(40)[1] < 1e-4


def test_bar_of_finite_strain_has_the_stiffness_of_its_state() -> None:
    error, gain = bar(80, kinematics="finite")
    assert error < 1.2e-2
    assert -1e-3 < gain < 1e-4


# --- impacts without a preload -----------------------------------------------------------------------------------


def thrown(
    solver: ContactSolver,
    load: float,
    mass: float,
    speed: float,
    gap: float,
    density: float = 1e-4,
    shape: Array | None = None,
) -> Transient:
    """Plate on its way to a light block at rest, or one that moves with the plate's speed times a shape."""
    assert solver.step(-gap).converged and solver.force == 0.0
    transient = Transient(solver, density=density, mass=mass, load=load)
    transient.start(velocity=speed, shape=np.zeros((solver.solid.owned, 3)) if shape is None else shape)
    return transient


def test_free_impact_on_a_bar() -> None:
    """A light bar is a spring of stiffness M: struck for half a period, and the mass flies off as fast as it came."""
    load, mass, speed, gap, h = 1e-7, 2.0, 0.01, 0.005, 0.05
    omega = float(np.sqrt(ref.block_modulus(1.0, NU) / mass))
    history = thrown(press_on(Flat(L=1.0), 0.6), load, mass, speed, gap).run(5.0, h)
    before = history.time < gap / speed - h
    assert np.all(history.force[before] == 0.0) and before.sum() > 5
    np.testing.assert_allclose(history.velocity[before], speed + load / mass * history.time[before], rtol=1e-9)
    down, up = crossings(history)
    assert down == pytest.approx(gap / speed, rel=1e-3) and up - down == pytest.approx(np.pi / omega, rel=4e-3)
    assert history.approach.max() == pytest.approx(speed / omega, rel=3e-3)
    assert history.force.max() == pytest.approx(speed * mass * omega, rel=3e-3)
    assert history.force[-1] == 0.0 and history.velocity[-1] == pytest.approx(-speed, rel=2e-3)
    impulse = float(np.sum(0.5 * (history.force[1:] + history.force[:-1]) * np.diff(history.time)))
    gained = mass * (history.velocity[-1] - history.velocity[0])
    assert gained == pytest.approx(load * history.time[-1] - impulse, abs=1e-6 * mass * speed)
    books = history.energy - history.supplied
    assert np.abs(books - books[0]).max() < 5e-3 * 0.5 * mass * speed**2


@pytest.mark.mpi
def test_free_flight_over_a_block_that_rings() -> None:
    """No force to measure the balance by but that of inertia: the plate keeps its speed, the block its energy.

    The steps are short, so the inertia of a node is far stiffer than the solid.
    """
    solver = press_on(Flat(L=1.0), 0.6)
    mode = np.zeros((solver.solid.owned, 3))
    mode[:, 2] = 0.1 * np.sin(0.5 * np.pi * solver.solid.points[: solver.solid.owned, 2])  # of a bar with a free top
    transient = thrown(solver, 0.0, 1.0, -0.01, 0.01, density=1.0, shape=mode)
    history = transient.run(0.03, 0.001)
    assert not history.force.any() and solver.counts.cutbacks == 0
    np.testing.assert_allclose(history.velocity, -0.01, rtol=1e-12)
    np.testing.assert_allclose(history.energy, history.energy[0], rtol=1e-5)


# --- a bump under a mass -----------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def bump() -> tuple[Surface, CurveLaw]:
    """A cosine bump and the law of its contact on the mesh of the tests, in units of L and E L^2."""
    surface = Sinusoid(L=1.0, amplitude=0.05, wavelength=1.0)
    solver = press_on(surface, 0.35)
    record = Record(1.0, 1.0, solver.solid.material.reduced_modulus)
    follow(solver, Schedule(delta_max=0.06, steps=60), record)
    return surface, CurveLaw.from_curve(record.curve())


def released(bump: tuple[Surface, CurveLaw], u: float, density: float, rho_inf: float = 0.8) -> tuple[Transient, Any]:
    """Plate on the bump, let go at u; time in units of 1/omega_s."""
    surface, law = bump
    oscillator = ContactOscillator(law, load=float(law.force(0.035)), zeta=0.02)
    r = oscillator.restoring
    solver = press_on(surface, 0.35)
    for delta in np.linspace(0.0, r.z_s * (1.0 + u), 9)[1:]:
        assert solver.step(float(delta)).converged
    mass = r.scale / r.z_s
    transient = Transient(
        solver, density=density, mass=mass, load=r.load, dashpot=2.0 * 0.02 * mass, scheme=GeneralisedAlpha(rho_inf)
    )
    return transient, oscillator


def test_light_block_moves_as_the_one_degree_model(bump: tuple[Surface, CurveLaw]) -> None:
    transient, oscillator = released(bump, 0.4, density=1e-6)
    history = transient.run(9.0, 2.0 * np.pi / 100)
    path = oscillator.simulate(1.0, 0.0, u=0.4, periods=1.5, samples=400)
    u = history.approach / oscillator.restoring.z_s - 1.0
    assert np.abs(u - np.interp(history.time, path.tau, path.u)).max() < 5e-3
    force = oscillator.law.force(np.maximum(history.approach, 0.0))
    assert np.abs(history.force[1:] - force[1:]).max() < 5e-3 * force.max()


def test_free_impact_on_a_bump(bump: tuple[Surface, CurveLaw]) -> None:
    """Deepest where the law has taken the energy of the mass; the impact lasts the time along the static law."""
    surface, law = bump
    deepest, mass = 0.03, 1.0
    speed = float(np.sqrt(2.0 * law.potential(deepest) / mass))
    x, weight = np.polynomial.legendre.leggauss(64)
    s = 0.5 * (1.0 + x)  # z = deepest (1 - s^2): the integrand is smooth where the mass turns
    z = deepest * (1.0 - s**2)
    lasts = 2.0 * float(weight @ (deepest * s / np.sqrt(2.0 / mass * (law.potential(deepest) - law.potential(z)))))
    history = thrown(press_on(surface, 0.35), 0.0, mass, speed, 0.002).run(1.4 * lasts, lasts / 100)
    down, up = crossings(history)
    assert up - down == pytest.approx(lasts, rel=0.01)
    assert history.approach.max() == pytest.approx(deepest, rel=5e-3)
    assert history.force[-1] == 0.0 and history.velocity[-1] == pytest.approx(-speed, rel=5e-3)


def test_heavy_block_slows_the_mass_by_its_added_mass(bump: tuple[Surface, CurveLaw]) -> None:
    """Rayleigh: the block follows quasi-statically, so omega falls by sqrt(1 + added mass/mass)."""
    times = []
    for density in (1e-6, 0.1):
        transient, _ = released(bump, 0.1, density)
        history = transient.run(8.0, 2.0 * np.pi / 100)
        turn = np.flatnonzero((history.velocity[:-1] > 0) & (history.velocity[1:] <= 0))[0]
        v = history.velocity[turn : turn + 2]
        times.append(history.time[turn] + (history.time[1] - history.time[0]) * v[0] / (v[0] - v[1]))
    added = transient.added_mass / transient.mass
    assert added > 0.01
    assert times[1] / times[0] == pytest.approx(np.sqrt(1.0 + added), abs=0.1 * added)


def test_plastic_block_dissipates_and_balances(bump: tuple[Surface, CurveLaw]) -> None:
    """Dropped on virgin asperities the plate loses energy to plastic flow, and its balance of energy holds."""
    surface = bump[0]
    solver = press_on(surface, 0.35, Material(1.0, NU, 0.02, 0.05))
    assert solver.step(0.01).converged
    transient = Transient(solver, density=1e-4, mass=1.0, load=3.0 * solver.force)
    history = transient.run(6.0, 0.05)
    drift = history.energy - history.supplied
    supplied = np.ptp(history.supplied)
    assert history.approach.max() > 0.015
    assert abs(drift[-1] - drift[0]) < 0.02 * supplied
    assert history.approach[-20:].min() > solver.delta  # it does not come back to where it was let go


def test_a_step_that_fails_keeps_the_record_so_far(
    bump: tuple[Surface, CurveLaw], monkeypatch: pytest.MonkeyPatch
) -> None:
    transient, _ = released(bump, 0.1, density=1e-3)
    step = transient.step

    def fussy(h: float, push: float) -> None:
        if transient.time > 0.15:
            raise ConvergenceError("too long")
        step(h, push)

    monkeypatch.setattr(transient, "step", fussy)
    with pytest.raises(ConvergenceError, match="too long") as failure:
        transient.run(0.4, 0.1)
    history = failure.value.result
    assert history.time == pytest.approx([0.0, 0.1, 0.2], abs=1e-12)
    assert np.all(np.diff(history.approach) < 0.0) and history.newton > 0
