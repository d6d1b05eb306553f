"""A material law as a Python function in UFL, what it declares, its parameters, and how it is refused."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, fields, replace
from math import isfinite
from numbers import Real
from types import SimpleNamespace
from typing import Any, NoReturn

from asperity.errors import InputError
from asperity.runtime.display import brief, show

Shape = tuple[int, ...]
Quantity = float | Callable[..., float]  # a number, or a function of parameters by their names

STRENGTH = "yield_strength"  # parameter that a relaxation of volumetric strain lowers, see solver/relaxation.hpp
KEY = "material.law"
SHAPES: dict[Shape, int] = {(): 1, (3,): 3, (3, 3): 6}  # of a state variable, and its stored components
SYMMETRIC = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))  # order of the components of a symmetric tensor
#: Every law has them, zero where it makes no use of them: measures and the midpoint rule read them by name.
USUAL: dict[str, Shape] = {"plastic_strain": (3, 3), "accumulated": ()}
#: Names of `fem.history.History` that no state variable may have.
RESERVED = {"dilatation", "zeros", "arrays", "copy", "assign", "rows", "changed"}


@dataclass(frozen=True)
class Declaration:
    """What a law says of itself, see `law`."""

    state: Mapping[str, Shape] = field(default_factory=dict)
    elastic: Callable[..., Any] | None = None
    symmetric: bool = False
    state_is_strain: bool = False
    time: bool = False
    E: Quantity | None = None
    nu: Quantity | None = None
    yield_strength: Quantity | None = None
    strength: Callable[..., float] | None = None


def law(function: Callable[..., Any] | None = None, /, **declared: Any) -> Any:
    """Declare what the program needs to know of a law; without arguments the parentheses may be left out.

    `E`, `nu` and `yield_strength` are numbers or functions of some parameters; left out, they are the parameters of
    these names.

    Args:
        function: `stress(strain, **parameters)`, `stress(strain, state, **parameters)`, which also returns the new
            state, or `energy(F, **parameters)`; with `time` `stress(strain, state, dt, **parameters)`
        state: shape of each variable, (), (3,) or (3, 3) for a symmetric tensor; zero in the virgin material
        elastic: stress(strain, state, **parameters) for a motion that leaves the state as it is: what the stiffness
            against small vibration, and slip, need; its parameters are some of the law's
        symmetric: whether the tangent is, as that of an energy always: Cholesky and CG, otherwise LU and GMRES
        state_is_strain: whether the state is a sum of increments of strain, as the plastic strain is: the midpoint rule
            then extrapolates it within a step, otherwise backward Euler integrates
        time: whether the new state depends on the length dt of the step [s], zero for an instant; the law integrates
            over the step itself
        E, nu: Young's modulus [force/length^2] and Poisson's ratio at rest
        yield_strength: uniaxial yield stress of the virgin material [force/length^2]; none where there is no parameter
        strength: strength(a, **parameters), the yield stress at the accumulated plastic strain a, of a law by von Mises
            whose flow keeps the volume and whose parameter yield_strength may be below zero: cells then do not lock

    Examples:
        >>> @asp.law(state={"accumulated": ()})
        ... def mine(strain, state, E, nu):
        ...     return asp.laws.hooke(strain, E, nu), {"accumulated": state.accumulated}
        >>> mine.declared.state
        {'accumulated': ()}
    """
    if function is None:
        return lambda function: law(function, **declared)
    known = [each.name for each in fields(Declaration)]
    if unknown := [name for name in declared if name not in known]:
        refuse(name_of(function), f"declares {show(unknown[0])}: a law declares {', '.join(known)}")
    if callable(function):
        function.declared = Declaration(**declared)  # type: ignore[attr-defined]
    return function


@dataclass(frozen=True)
class Law:
    """A law with its parameters; see `law_of_function`.

    Attributes:
        function: of the law; None of a law in a file that has not been run, see `asperity.laws.from_file`
        parameters: name and value of each
        source: where the function comes from, in words of a case file
        digest: SHA-256 of that file; empty for other laws
        unit: of the stresses it returns, in those of its parameters
    """

    function: Callable[..., Any] | None = field(repr=False)
    parameters: tuple[tuple[str, float], ...]
    source: str
    digest: str = ""
    unit: float = 1.0

    @property
    def declared(self) -> Declaration:
        """What the law declares."""
        found: Declaration = getattr(self.function, "declared", Declaration())
        return found

    @property
    def hyperelastic(self) -> bool:
        """Whether it is an energy of the deformation gradient, for finite strain."""
        return self.function is not None and next(iter(inspect.signature(self.function).parameters)) == "F"

    @property
    def symmetric(self) -> bool:
        """Whether the tangent is; so is taken of a law that has not been run."""
        return self.function is None or self.hyperelastic or self.declared.symmetric

    @property
    def state(self) -> Mapping[str, Shape]:
        """Shape of each state variable; empty where the stress depends on the strain alone."""
        return self.declared.state

    @property
    def constants(self) -> dict[str, float]:
        """Numbers by name that the function takes: the parameters, and where it takes one the length of a step [s]."""
        return ({"dt": 0.0} if self.declared.time else {}) | dict(self.parameters)

    def quantity(self, name: str) -> float | None:
        """E, nu or yield_strength as declared [force/length^2]; None where the law has none (InputError: no number)."""
        given, values = getattr(self.declared, name), dict(self.parameters)
        if not callable(given):
            return values.get(name) if given is None else float(given)
        with raising(self.source, f"declares {name}, which raises"):
            return float(given(**_some(given, values)))

    def strength(self, accumulated: float, **others: float) -> float | None:
        """Yield stress at an accumulated plastic strain [force/length^2], None where it is not declared.

        Args:
            others: parameters in place of those of the law
        """
        function = self.declared.strength
        if function is None:
            return None
        with raising(self.source, "declares strength, which raises"):
            return float(function(accumulated, **_some(function, dict(self.parameters) | others)))

    def scaled(self, stress: float) -> Law:
        """The same law with stresses in units of `stress`, in those of now."""
        return replace(self, unit=self.unit * stress)

    def energy(self, F: Any, values: Mapping[str, Any]) -> Any:
        """Energy per volume before deformation, in UFL, of parameters given by name."""
        assert self.function is not None
        return self.function(F, **values) / self.unit

    def stress(self, strain: Any, state: Mapping[str, Any], values: Mapping[str, Any], held: bool = False) -> Any:
        """Stress and new state, in UFL, of parameters given by name; `held` leaves the state as it is."""
        assert self.function is not None
        if not self.state:
            return self.function(strain, **values) / self.unit, {}
        before, elastic = SimpleNamespace(**state), self.declared.elastic
        if held:
            assert elastic is not None
            return elastic(strain, before, **_some(elastic, values)) / self.unit, dict(state)
        stress, after = self.function(strain, before, **values)
        return stress / self.unit, after


def _some(function: Callable[..., Any], values: Mapping[str, Any]) -> dict[str, Any]:
    """The values that a function takes by name."""
    return {name: values[name] for name in inspect.signature(function).parameters if name in values}


def law_of_function(
    function: Callable[..., Any],
    parameters: Mapping[str, Any],
    source: str = "",
    digest: str = "",
    offered: Mapping[str, Any] | None = None,
) -> Law:
    """A law of a function and its parameters, checked as far as its signature and its declaration show.

    Args:
        offered: parameters that it need not have

    Raises:
        InputError: it is no law, or a parameter is missing, unknown or no number
    """
    source = source or name_of(function)
    if not callable(function):
        refuse(source, f"is {brief(function)}, not a function")
    names = list(inspect.signature(function).parameters)
    kinds = {p.kind for p in inspect.signature(function).parameters.values()}
    declared: Declaration = getattr(function, "declared", Declaration())
    if not isinstance(declared.state, Mapping):
        refuse(source, f"declares the state {brief(declared.state)}: legal is a dictionary, name and shape of each")
    first = ["strain", "state", "dt"] if declared.time else ["strain", "state"] if declared.state else names[:1]
    if (
        names[: len(first)] != first
        or first[:1] not in (["F"], ["strain"])
        or kinds - {inspect.Parameter.POSITIONAL_OR_KEYWORD}
    ):
        refuse(
            source,
            f"has the arguments ({', '.join(names)}): a law is stress(strain, ...), stress(strain, state, ...) with "
            "@asp.law(state=...), stress(strain, state, dt, ...) with @asp.law(state=..., time=True), or "
            "energy(F, ...), its parameters by name",
        )
    if "state" in names and not declared.state:
        refuse(source, "has a state that is not declared: put @asp.law(state={...}) above it, name and shape of each")
    for name, shape in declared.state.items():
        if not str(name).isidentifier() or name in RESERVED:
            refuse(source, f"declares a state by the name {show(str(name))}, which is taken: choose another")
        if shape not in list(SHAPES) or USUAL.get(name, shape) != shape:
            legal = str(USUAL.get(name, "(), (3,) or (3, 3)"))
            refuse(source, f"declares the state {name!r} of shape {shape!r}: legal is {legal}")
    wanted = {name: p.default for name, p in inspect.signature(function).parameters.items() if name not in first}
    _check_functions(declared, list(wanted), source)
    full = {name: default for name, default in wanted.items() if default is not inspect.Parameter.empty}
    full |= {name: value for name, value in (offered or {}).items() if name in wanted} | dict(parameters)
    if missing := [name for name in wanted if name not in full]:
        refuse(source, f"needs the parameter {missing[0]}: give it in [material.parameters]")
    for name, value in full.items():
        if name not in wanted:
            refuse(source, f"has no parameter {show(name)}: it has {', '.join(wanted) or 'none'}")
        if not isinstance(value, Real) or isinstance(value, bool) or not isfinite(value):
            refuse(source, f"needs a number for the parameter {name}, not {brief(value)}")
    return Law(function, tuple((name, float(full[name])) for name in wanted), source, digest)


def _check_functions(declared: Declaration, names: list[str], source: str) -> None:
    """Refuse what a law declares, where it is no function of what it must be one of."""
    first = {"elastic": ["strain", "state"], "strength": ["a"], "E": [], "nu": [], "yield_strength": []}
    for name, start in first.items():
        given = getattr(declared, name)
        if given is None or (not start and isinstance(given, Real)):
            continue
        found = list(inspect.signature(given).parameters) if callable(given) else None
        if found is None or found[: len(start)] != start or set(found[len(start) :]) - set(names):
            refuse(source, f"declares {name}, which is no function of {', '.join([*start, 'some of its parameters'])}")
    has = STRENGTH in names and "accumulated" in declared.state and declared.symmetric
    if declared.strength is not None and not has:
        refuse(source, f"declares strength, which needs the parameter {STRENGTH}, the state accumulated and symmetric")


@contextmanager
def raising(source: str, what: str) -> Iterator[None]:
    """Turn any error in a block of a user's code into a refusal."""
    try:
        yield
    except InputError:
        raise
    except (Exception, SystemExit) as error:
        refuse(source, f"{what}: {type(error).__name__}: {' '.join(str(error).split()) or 'no message'}")


def name_of(function: Any) -> str:
    """Name of a function in messages."""
    return str(getattr(function, "__name__", brief(function)))


def refuse(source: str, reason: str) -> NoReturn:
    """Refuse a law with one sentence."""
    raise InputError(f"{KEY} = {show(source.rpartition('/')[2])} {reason}")
