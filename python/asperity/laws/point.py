"""Response of a law at points of given strain, without a mesh and without a compiler, and what it shows of the law."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np

from asperity.arrays import Floats
from asperity.laws.definition import KEY, STRENGTH, SYMMETRIC, Law, raising, refuse
from asperity.runtime.display import brief, show

STRAINS = (1e-6, 1e-5, 1e-4, 1e-3, 1e-2)  # sizes of those at which a law is tried
REST = 1e-9  # stress at rest over the modulus that is rounding
SYMMETRY = 1e-7  # part of a tangent by which it may differ from its transpose
MOST = 1e100  # modulus, beyond which products overflow
MANDEL = np.sqrt([1.0, 1.0, 1.0, 2.0, 2.0, 2.0])  # weights of the components of a tensor in a matrix of stiffness
TURN = np.array([[2.0, -2.0, 1.0], [1.0, 2.0, 2.0], [-2.0, -1.0, 2.0]]) / 3.0  # a rotation
WORKED = 0.2  # plastic strain of the strength that says which pressures in a cell relax, see `fem.kernels`
ISOTROPY = 1e-6  # of the tangent at rest, and of the moduli a case gives


@dataclass(frozen=True)
class Response:
    """What a law answers to strains.

    Attributes:
        stress: Cauchy's of a strain; of an energy the first stress of Piola and Kirchhoff (n, 3, 3)
        state: new state variables (n, ...)
        tangent: derivative of the stress (n, 3, 3, 3, 3)
        raised: derivative of the stress by a higher yield strength, of a law that has one (n, 3, 3)
        driven: derivative of its accumulated plastic strain (n, 3, 3)
    """

    stress: Floats
    state: dict[str, Floats]
    tangent: Floats
    raised: Floats | None = None
    driven: Floats | None = None


def respond(law: Law, strains: Floats, state: Mapping[str, Floats] | None = None) -> Response:
    """Response to strains, or deformation gradients of an energy, (n, 3, 3) over a state; None is the virgin one.

    Raises:
        InputError: the law raises, or returns something of another shape
    """
    import basix.ufl
    import ufl

    mesh = ufl.Mesh(basix.ufl.element("Lagrange", "tetrahedron", 1, shape=(3,)))
    values: dict[Any, Floats] = {}

    class Known(ufl.Constant):
        def evaluate(self, *_: Any) -> Any:  # which UFL's own would seek without end
            raise TypeError("an expression of UFL is no number: take ufl.sqrt for math.sqrt, and the like")

    def known(value: Any, shape: tuple[int, ...]) -> Any:
        terminal = Known(mesh, shape=shape)
        values[terminal] = np.asarray(value, dtype=float)
        return terminal

    def of_shape(shape: tuple[int, ...], what: str, value: Any) -> Any:
        value = ufl.as_ufl(value)
        if value.ufl_shape != shape or value.ufl_free_indices:
            refuse(law.source, f"returns {what} of shape {value.ufl_shape}, not {shape}")
        return value

    n = len(strains)
    given = state or {name: np.zeros((n, *shape)) for name, shape in law.state.items()}
    before = {name: known(given[name], shape) for name, shape in law.state.items()}
    parameters = {name: known(np.full(n, value), ()) for name, value in law.parameters}
    if STRENGTH in parameters:
        parameters[STRENGTH] = ufl.variable(parameters[STRENGTH])
    strain, after = ufl.variable(known(strains, (3, 3))), {}
    with raising(law.source, "raises"):
        if law.hyperelastic:
            stress = ufl.diff(of_shape((), "the energy", law.energy(strain, parameters)), strain)
        else:
            stress, after = law.stress(strain, before, parameters)
            stress = of_shape((3, 3), "the stress", stress)
            if not isinstance(after, dict) or set(after) != set(before):
                refuse(law.source, f"returns the state {brief(after)}, not a dictionary of {show(sorted(before))}")
            after = {name: of_shape(law.state[name], f"the state {name}", value) for name, value in after.items()}
            if law.elastic is not None:
                of_shape((3, 3), "the elastic stress", law.stress(strain, before, parameters, held=True)[0])
        evaluate = _Evaluator(values, n)
        strengths: list[Floats] = []
        if STRENGTH in parameters and "accumulated" in after:
            strengths = [law.unit * evaluate(ufl.diff(stress, parameters[STRENGTH])),
                         evaluate(ufl.diff(after["accumulated"], strain))]  # fmt: skip
        state = {name: evaluate(value) for name, value in after.items()}
        return Response(evaluate(stress), state, evaluate(ufl.diff(stress, strain)), *strengths)


@dataclass(frozen=True)
class Traits:
    """What trials show of a law.

    Attributes:
        E, nu: moduli at rest [force/length^2]; None where it is not isotropic there
        symmetric: whether its tangent is
        worked: strength at a plastic strain of WORKED over E, where volumetric strain within a cell can relax: a lower
            yield strength, below zero too, drives the flow, which leaves the volume to Hooke's law. The plastic strain
            is then the derivative by the strength of the potential of which the stress is that by the strain
    """

    E: float | None
    nu: float | None
    symmetric: bool
    worked: float | None = None


@lru_cache(maxsize=64)
def traits(law: Law) -> Traits:
    """Try a law at rest, under strains of several sizes, and again over the state that these leave.

    Raises:
        InputError: it raises, its results have another shape, are not numbers or not symmetric, or it is stressed or
            not stiff at rest
    """
    rng = np.random.default_rng(1)
    given = dict(law.parameters)
    beyond = (2.0 * given[STRENGTH] / given["E"],) if STRENGTH in given and given.get("E") else ()
    strains = [np.zeros((1, 3, 3)), *(size * rng.uniform(-1.0, 1.0, (4, 3, 3)) for size in (*STRAINS, *beyond))]
    path = np.concatenate(strains)
    path += np.swapaxes(path, 1, 2)
    base = np.eye(3) if law.hyperelastic else np.zeros((3, 3))
    first = respond(law, base + path)
    answers = [(first, path)]
    if law.state:
        answers.append((respond(law, base + 1.5 * path, first.state), 1.5 * path))
    for answer, _ in answers:
        for what, value in {"a stress": answer.stress, "a tangent": answer.tangent, **answer.state}.items():
            bad = np.flatnonzero(~np.isfinite(value).reshape(len(value), -1).all(axis=1))
            if len(bad):
                size = float(np.abs(path[bad[0]]).max())
                where = f"at a strain of {size:.2g}" if size else "at rest"
                refuse(law.source, f"gives {what} that is not a number {where}")
            if value.shape[1:] == (3, 3) and not law.hyperelastic and not _same(value, np.swapaxes(value, 1, 2)):
                refuse(law.source, f"gives {what} that is not symmetric")
    if law.hyperelastic and not _same(respond(law, TURN @ (base + path)).stress, TURN @ first.stress):
        refuse(law.source, "changes with a rotation: an energy is a function of F.T * F")
    C = first.tangent[0] + first.tangent[0].transpose(1, 0, 2, 3)
    C = 0.25 * (C + C.transpose(0, 1, 3, 2))
    modulus, at_rest = float(np.abs(C).max()), float(np.abs(first.stress[0]).max())
    if not 0.0 < modulus < MOST:
        refuse(law.source, f"has a modulus of {modulus:.3g} at rest")
    if at_rest > REST * modulus:
        refuse(law.source, f"is stressed at rest, by {at_rest * law.unit:.3g}")
    stiffness = np.array([[C[ij + kl] for kl in SYMMETRIC] for ij in SYMMETRIC]) * np.outer(MANDEL, MANDEL)
    if np.linalg.eigvalsh(stiffness)[0] <= REST * modulus:
        refuse(law.source, "is not stable at rest: a strain has no stress along it")
    symmetric = all(_symmetric(answer.tangent, not law.hyperelastic) for answer, _ in answers)
    lam, mu = float(C[0, 0, 1, 1]), float(C[0, 1, 0, 1])
    isotropic = 2.0 * mu * np.eye(6)
    isotropic[:3, :3] += lam
    if np.abs(stiffness - isotropic).max() > ISOTROPY * modulus:
        return Traits(None, None, symmetric)
    E, nu = law.unit * mu * (3.0 * lam + 2.0 * mu) / (lam + mu), 0.5 * lam / (lam + mu)
    if not (symmetric and _relaxes(law, answers, lam + 2.0 / 3.0 * mu)):
        return Traits(E, nu, symmetric)
    return Traits(E, nu, symmetric, _worked(law, law.unit * mu) / E)


def _worked(law: Law, mu: float) -> float:
    """Stress of von Mises at a plastic strain of WORKED, from two steps of shear that end near it [force/length^2]."""
    shear = np.zeros((3, 3))
    shear[0, 1] = shear[1, 0] = 0.5 * np.sqrt(3.0)  # of equivalent strain one
    size = WORKED + dict(law.parameters)[STRENGTH] / (3.0 * mu)
    found = respond(law, np.array([size, 1.1 * size])[:, None, None] * shear)
    stress = np.sqrt(3.0) * law.unit * found.stress[:, 0, 1]
    near, far = found.state["accumulated"]
    slope = (stress[1] - stress[0]) / (far - near) if far > near else 0.0
    return max(float(stress[0] + slope * (WORKED - near)), dict(law.parameters)[STRENGTH])  # of a solid that softens


def _relaxes(law: Law, answers: list[tuple[Response, Floats]], bulk: float) -> bool:
    given, path = dict(law.parameters), answers[0][1]
    if answers[0][0].raised is None:
        return False
    # a relief may exceed the strength, then any shear flows
    below = respond(replace(law, parameters=tuple((given | {STRENGTH: -given[STRENGTH]}).items())), path)
    if not np.all(below.state["accumulated"][1:] > 0.0):
        return False
    for answer, strains in [*answers, (below, path)]:
        assert answer.raised is not None and answer.driven is not None
        pressure = np.trace(answer.stress, axis1=1, axis2=2) / 3.0
        kept = _same(pressure, bulk * np.trace(strains, axis1=1, axis2=2))
        driven = 0.5 * (answer.driven + np.swapaxes(answer.driven, 1, 2))
        if not (answer.driven.any() and kept and _same(answer.raised, driven)):
            return False
    return True


def _symmetric(tangent: Floats, of_strain: bool) -> bool:
    if of_strain:  # only symmetric ones matter
        tangent = 0.5 * (tangent + np.swapaxes(tangent, 3, 4))
    return _same(tangent, tangent.transpose(0, 3, 4, 1, 2))


def _same(a: Floats, b: Floats) -> bool:
    return bool(np.abs(a - b).max() <= SYMMETRY * max(np.abs(a).max(), 1e-300))


#: What NumPy has for nodes of UFL, by their kind or name; other names are the same.
FUNCTIONS: dict[str, Any] = {
    "Sum": np.add, "Product": np.multiply, "Division": np.divide, "Power": np.power, "MinValue": np.minimum,
    "MaxValue": np.maximum, "Atan2": np.arctan2, "Abs": np.abs, "Conj": np.conj, "Real": np.real, "ln": np.log,
    "acos": np.arccos, "asin": np.arcsin, "atan": np.arctan, "<": np.less, ">": np.greater, "<=": np.less_equal,
    ">=": np.greater_equal, "==": np.equal, "!=": np.not_equal, "&&": np.logical_and, "||": np.logical_or,
    "NotCondition": np.logical_not,
}  # fmt: skip


class _Evaluator:
    """Values of UFL expressions at points, each node of their graph once per component."""

    def __init__(self, terminals: Mapping[Any, Floats], points: int) -> None:
        self._terminals, self._points = terminals, points
        self._known: dict[Any, Any] = {}

    def __call__(self, expression: Any) -> Floats:
        """Values of an expression without free indices (points, ...)."""
        from ufl.algorithms.apply_algebra_lowering import apply_algebra_lowering
        from ufl.algorithms.apply_derivatives import apply_derivatives

        lowered = apply_derivatives(apply_algebra_lowering(expression))
        out = np.empty((self._points, *expression.ufl_shape))
        with np.errstate(all="ignore"):
            for k, at in enumerate(np.ndindex(*expression.ufl_shape)):
                out.reshape(self._points, -1)[:, k] = self._at(lowered, at, {})
        return out

    def _at(self, e: Any, at: tuple[int, ...], indices: dict[Any, int]) -> Any:
        """Value of a component of a node under values of its free indices."""
        key = e, at, tuple(indices[i] for i in e.ufl_free_indices) if hasattr(e, "ufl_free_indices") else ()
        if key not in self._known:
            self._known[key] = self._find(e, at, indices)
        return self._known[key]

    def _find(self, e: Any, at: tuple[int, ...], indices: dict[Any, int]) -> Any:
        kind, parts = type(e).__name__, e.ufl_operands
        if e in self._terminals:
            return np.moveaxis(self._terminals[e], 0, -1)[at]
        if kind in ("FloatValue", "IntValue", "ScalarValue", "RealValue"):
            return float(e)
        if kind == "Zero":
            return 0.0
        if kind == "Identity":
            return float(at[0] == at[1])
        if kind == "ListTensor":
            return self._at(parts[at[0]], at[1:], indices)
        if kind == "Variable":
            return self._at(parts[0], at, indices)
        if kind == "Indexed":
            fixed = tuple(int(i) if hasattr(i, "_value") else indices[i.count()] for i in parts[1])
            return self._at(parts[0], fixed, indices)
        if kind == "ComponentTensor":
            bound = {i.count(): a for i, a in zip(parts[1], at, strict=True)}
            return self._at(parts[0], (), indices | bound)
        if kind == "IndexSum":
            (index,) = parts[1]
            return sum(self._at(parts[0], at, indices | {index.count(): i}) for i in range(e.dimension()))
        if kind == "Conditional":
            return np.where(self._at(parts[0], (), indices), *(self._at(p, at, indices) for p in parts[1:]))
        values = [np.asarray(self._at(p, at if p.ufl_shape else (), indices)) for p in parts]
        name = getattr(e, "_name", "")
        function = FUNCTIONS.get(kind) or FUNCTIONS.get(name) or getattr(np, name, None)
        if function is None:
            raise TypeError(f"{KEY} cannot be tried: it uses {kind}")
        return function(*values)
