"""A law compiled for one cell, and what it must be: free of stress at rest, symmetric, and as it declares.

The strain and the state of the cell are coefficients, the parameters constants. The derivative of the stress gives the
tangent, so that nothing here knows what the law is made of.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from itertools import product
from typing import Any

import numpy as np

from asperity.arrays import Floats
from asperity.fem.weak_form import Constants, compiled, packed, unpacked, variable
from asperity.laws.definition import KEY, SHAPES, STRENGTH, SYMMETRIC, Law, raising, refuse
from asperity.runtime.display import brief, show

#: Sizes of the strains under which a law is tried; up to SMALL of them it must have numbers.
STRAINS, SMALL = (1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 0.03, 0.1, 0.3), 0.02
DURATIONS = (0.0, 1e-3, 1.0, 1e3)  # of steps in which a law with time is tried [s]
AGES = 1e200  # in which any flow has ended, of a rate that is a power of the overstress [s]
POINTS = 100  # of a step without convergence whose responses are judged
REST = 1e-9  # stress at rest over the modulus that is rounding
SAME = 1e-6  # relative difference of two stresses, moduli or states that is rounding
MODULI = 1e-4  # relative difference of E, and difference of nu, that laws have by smoothed corners
MOST = 1e100  # modulus, beyond which products overflow
MANDEL = np.sqrt([1.0, 1.0, 1.0, 2.0, 2.0, 2.0])  # weights of the components of a tensor in a matrix of stiffness
TURN = np.array([[2.0, -2.0, 1.0], [1.0, 2.0, 2.0], [-2.0, -1.0, 2.0]]) / 3.0  # a rotation


@dataclass(frozen=True)
class Response:
    """What a law answers to a strain, or to a deformation gradient of an energy.

    Attributes:
        stress: Cauchy's of a strain; of an energy the first stress of Piola and Kirchhoff (3, 3) [force/length^2]
        held: stress over the old state, of the elastic part (3, 3) [force/length^2]; the stress where there is none
        tangent: derivative of the stress by a symmetric strain, as a matrix of Mandel's (6, 6) [force/length^2]
        state: stored components of the new state (k,)
    """

    stress: Floats
    held: Floats
    tangent: Floats
    state: Floats


class OneCell:
    """A law at one point; not collective.

    Raises:
        InputError: the law raises, or returns something of another shape
    """

    def __init__(self, law: Law) -> None:
        import basix.ufl
        import ufl
        from dolfinx import fem, mesh
        from mpi4py import MPI

        corners = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
        shape = basix.ufl.element("Lagrange", "tetrahedron", 1, shape=(3,))
        self._mesh = mesh.create_mesh(MPI.COMM_SELF, np.arange(4, dtype=np.int64)[None], corners, shape)
        self._width = sum(SHAPES[shape] for shape in law.state.values())

        def at_point(*shape: int) -> Any:
            element = basix.ufl.element("DG", "tetrahedron", 0, shape=shape)
            return fem.Function(fem.functionspace(self._mesh, element))

        self._strain, self._state = at_point(3, 3), at_point(max(self._width, 1))
        self._given = law.constants
        self._constants = Constants(self._mesh, self._given)
        named = self._constants.named
        strain, before = variable(self._strain, 1), unpacked(law, self._state)
        with raising(law.source, "raises"):
            if law.hyperelastic:
                stress = ufl.diff(_of_shape(law, (), "the energy", law.energy(strain, named)), strain)
                after, held = {}, stress
            else:
                stress, after = law.stress(strain, before, named)
                stress = held = _of_shape(law, (3, 3), "the stress", stress)
                if not isinstance(after, dict) or set(after) != set(before):
                    refuse(law.source, f"returns the state {brief(after)}, not a dictionary of {show(sorted(before))}")
                if law.declared.elastic is not None:
                    held, _ = law.stress(strain, before, named, held=True)
                    held = _of_shape(law, (3, 3), "the elastic stress", held)
            for name, shape in law.state.items():
                after[name] = _of_shape(law, shape, f"the state {name}", after[name])
            parts = [tensor[i, j] for tensor in (stress, held) for i in range(3) for j in range(3)]
            rate = ufl.diff(stress, strain)
            parts += [
                0.25 * (rate[i, j, k, m] + rate[j, i, k, m] + rate[i, j, m, k] + rate[j, i, m, k])
                for (i, j), (k, m) in product(SYMMETRIC, SYMMETRIC)
            ]
            parts += packed(law, after) + packed(law, after, transposed=True)
            point = np.array([[0.25, 0.25, 0.25]])
            self._values = compiled(fem.Expression, ufl.as_vector(parts), point, MPI.COMM_SELF)

    def __call__(
        self, strain: Floats, state: Floats | None = None, others: Mapping[str, float] | None = None
    ) -> Response:
        """Response to a strain, or deformation gradient of an energy.

        Args:
            strain: (3, 3)
            state: stored components before (k,); None is the virgin one
            others: parameters in place of those of the law; "dt" is the length of the step [s], otherwise zero
        """
        self._strain.x.array[:] = np.ravel(strain)
        self._state.x.array[:] = 0.0 if state is None or not self._width else state
        for name, value in (self._given | dict(others or {})).items():
            self._constants[name] = value
        found = np.array(self._values.eval(self._mesh, np.zeros(1, dtype=np.int32)), dtype=float).ravel()
        stress, held, rate, after, transposed = np.split(found, [9, 18, 54, 54 + self._width])
        tangent = rate.reshape(6, 6) * np.outer(MANDEL, MANDEL)
        state = after if _same(after, transposed) else np.full(self._width, np.nan)
        return Response(stress.reshape(3, 3), held.reshape(3, 3), tangent, state)


def _of_shape(law: Law, shape: tuple[int, ...], what: str, value: Any) -> Any:
    import ufl

    value = ufl.as_ufl(value)
    if value.ufl_shape != shape or value.ufl_free_indices:
        refuse(law.source, f"returns {what} of shape {value.ufl_shape}, not {shape}")
    return value


@lru_cache(maxsize=64)
def one_cell(law: Law) -> OneCell:
    """A law at one point, compiled once."""
    return OneCell(law)


@lru_cache(maxsize=64)
def check_law(law: Law) -> None:
    """Try a law at rest, under strains of several sizes, and again over the state that these leave; not collective.

    Raises:
        InputError: a result has another shape, is no number or not symmetric; the law is stressed or not stable at
            rest; its state is not that of the strain alone; or something is not as declared
    """
    cell, rng = one_cell(law), np.random.default_rng(1)
    rest = np.eye(3) if law.hyperelastic else np.zeros((3, 3))
    C = _check_rest(law, cell, rest)
    strength, E = law.quantity("yield_strength"), law.quantity("E")
    sizes = sorted({*STRAINS, *([2.0 * strength / E] if strength and E else [])})
    strains = [size * each for size in sizes for each in rng.uniform(-1.0, 1.0, (3, 3, 3))]
    times: list[dict[str, float]] = [{"dt": dt} for dt in DURATIONS] if law.declared.time else [{}]
    for strain, step in product([rest + 0.5 * (each + each.T) for each in strains], times):
        first, larger = cell(strain, others=step), rest + 1.5 * (strain - rest)
        for at, found in ((strain, first), (larger, cell(larger, first.state, others=step))):
            if wrong := doubt(law, at, found, numbers=size_of(law, at) <= SMALL):
                refuse(law.source, wrong)
        if law.state and size_of(law, strain) <= SMALL:
            _check_state(law, cell, strain, first)
        if law.hyperelastic and not _same(cell(TURN @ strain).stress, TURN @ first.stress):
            refuse(law.source, "changes with a rotation: an energy is a function of F.T * F")
    _check_moduli(law, C)
    if law.declared.strength is not None:
        _check_flow(law, cell)


def _check_rest(law: Law, cell: OneCell, rest: Floats) -> Floats:
    """Check stress and tangent at rest; the tangent."""
    found = cell(rest)
    C, stress = found.tangent, found.stress
    for what, value in {"a stress": stress, "a tangent": C}.items():
        if not np.isfinite(value).all():
            refuse(law.source, f"gives {what} that is not a number at rest")
    modulus, at_rest = float(np.abs(C).max()), float(np.abs(stress).max())
    if not 0.0 < modulus < MOST:
        refuse(law.source, f"has a modulus of {modulus:.3g} at rest")
    if at_rest > REST * modulus:
        refuse(law.source, f"is stressed at rest, by {at_rest:.3g}")
    if np.linalg.eigvalsh(0.5 * (C + C.T))[0] <= REST * modulus:
        refuse(law.source, "is not stable at rest: a strain has no stress along it")
    return C


def _check_moduli(law: Law, C: Floats) -> None:
    """Check E and nu against the tangent at rest; where that is not isotropic, they are but scales."""
    lam, mu = C[0, 1], 0.5 * C[3, 3]
    isotropic = 2.0 * mu * np.eye(6)
    isotropic[:3, :3] += lam
    if not _same(C, isotropic):
        return
    E, nu = mu * (3.0 * lam + 2.0 * mu) / (lam + mu), 0.5 * lam / (lam + mu)
    for name, found, scale in (("E", E, E), ("nu", nu, 1.0)):
        told = law.quantity(name)
        if told is None or abs(told - found) > MODULI * scale:
            refuse(law.source, f"has {name} = {found:.6g} at rest and declares {told}: declare @asp.law({name}=...)")


def doubt(law: Law, strain: Floats, found: Response, numbers: bool = True) -> str:
    """What is wrong with the response to a strain, empty where nothing is; without `numbers` infinities are not."""
    where = f"at a strain of {size_of(law, strain):.2g}"
    for what, value in {"stress": found.stress, "state": found.state, "tangent": found.tangent}.items():
        if not np.isfinite(value).all():
            return f"gives a {what} that is not a number {where}" if numbers else ""
        if what == "stress" and not law.hyperelastic and not _same(value, value.T):
            return f"gives a stress that is not symmetric {where}"
    if law.symmetric and not _same(found.tangent, found.tangent.T):
        return f"has a tangent that is not symmetric {where}: leave @asp.law(symmetric=True) out"
    return ""


def doubt_of_points(law: Law, strains: Floats, states: Floats, stresses: Floats, dt: float = 0.0) -> str:
    """What is wrong with a law at some points, which may be why a step does not converge; empty where nothing is.

    Args:
        strains: as `OneCell` takes them (n, 3, 3)
        states: stored components before (n, k)
        stresses: of the points (n, k)
        dt: length of the step [s], of a law with time
    """
    others = {"dt": dt} if law.declared.time else {}
    known = np.isfinite(strains).all(axis=(1, 2))
    strains, states, stresses = strains[known], states[known], stresses[known]
    sizes = np.array([size_of(law, strain) for strain in strains])
    lost = np.flatnonzero(~np.isfinite(stresses).all(axis=1))
    for k in (*lost[np.argsort(sizes[lost])][:POINTS], *np.argsort(-sizes)[:POINTS]):
        if wrong := doubt(law, strains[k], one_cell(law)(strains[k], states[k], others)):
            name = show(law.source.rpartition("/")[2])
            return f"{KEY} = {name} {wrong}; the greatest strain of the step is {sizes.max():.2g}"
    return ""


def size_of(law: Law, strain: Floats) -> float:
    """Greatest component of a strain, or of a deformation gradient less one."""
    return float(np.abs(strain - (np.eye(3) if law.hyperelastic else 0.0)).max())


def _check_state(law: Law, cell: OneCell, strain: Floats, first: Response) -> None:
    """Check that a second application at the same strain changes nothing, and that the elastic part agrees."""
    again = cell(strain, first.state)
    if not _same(again.stress, first.stress) or not _same(again.state, first.state):
        refuse(
            law.source,
            f"changes its state when it is applied a second time at the same strain of {np.abs(strain).max():.2g}"
            f"{' with dt = 0' * law.declared.time}: the force would depend on the number of steps; let the new state "
            "follow from the strain and the old state alone, without rates or counts of calls, and declare "
            "@asp.law(time=True) where it takes time",
        )
    if law.declared.elastic is not None and not _same(again.held, again.stress):
        refuse(law.source, "declares elastic, whose stress over the new state is not that of the law")


def _check_flow(law: Law, cell: OneCell) -> None:
    """Check that flow keeps the volume, and in shear the declared strength, of a yield strength below zero too."""
    E, nu, strength = law.quantity("E") or 1.0, law.quantity("nu") or 0.0, dict(law.parameters)[STRENGTH]
    bulk, mu, names = E / (3.0 * (1.0 - 2.0 * nu)), E / (2.0 * (1.0 + nu)), list(law.state)
    at = sum(SHAPES[law.state[name]] for name in names[: names.index("accumulated")])
    rng, shear = np.random.default_rng(2), np.zeros((3, 3))
    shear[0, 1] = shear[1, 0] = 0.5 * np.sqrt(3.0)  # of equivalent strain one
    slow = {"dt": AGES} if law.declared.time else {}
    for sign, part in ((1.0, 2.0), (1.0, 20.0), (-1.0, 0.5), (-1.0, 20.0)):
        given, size = {STRENGTH: sign * strength} | slow, part * strength / (3.0 * mu)
        found = cell(size * shear, others=given)
        flow = float(found.state[at])
        wanted = law.strength(flow, **{STRENGTH: sign * strength})
        if flow <= 0.0 or wanted is None or abs(np.sqrt(3.0) * found.stress[0, 1] - wanted) > 1e-4 * strength:
            refuse(
                law.source,
                f"declares strength, which in shear at {STRENGTH} = {sign * strength:.3g} is not its stress after "
                "flow: the strength must be that of monotone loading, and below zero any shear must flow",
            )
        strain = size * rng.uniform(-1.0, 1.0, (3, 3))
        strain += strain.T
        pressure = np.trace(cell(strain, others=given).stress) / 3.0
        if abs(pressure - bulk * np.trace(strain)) > SAME * bulk * np.abs(strain).max():
            refuse(law.source, "declares strength, but its flow changes the volume: leave strength out")


def _same(a: Floats, b: Floats) -> bool:
    return a.size == 0 or bool(np.abs(a - b).max() <= SAME * max(np.abs(a).max(), np.abs(b).max()))
