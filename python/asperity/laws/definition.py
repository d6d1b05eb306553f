"""A material law as a Python function in UFL, with its parameters, where it comes from, and how it is refused."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import isfinite
from numbers import Real
from types import SimpleNamespace
from typing import Any, NoReturn, TypeVar

from asperity.errors import InputError
from asperity.runtime.display import brief, show

Function = TypeVar("Function", bound=Callable[..., Any])
Shape = tuple[int, ...]

STRENGTH = "yield_strength"  # parameter that a relaxation of volumetric strain lowers, see `point.Traits`
KEY = "material.law"
SHAPES: dict[Shape, int] = {(): 1, (3,): 3, (3, 3): 6}  # of a state variable, and its stored components
SYMMETRIC = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))  # order of the components of a symmetric tensor
#: Every law has them, zero where it makes no use of them: measures and the midpoint rule read them by name.
USUAL: dict[str, Shape] = {"plastic_strain": (3, 3), "accumulated": ()}
#: Names of `fem.history.History` that no state variable may have.
RESERVED = {"dilatation", "zeros", "arrays", "copy", "assign", "rows", "changed"}


def law(state: Mapping[str, Shape], elastic: Callable[..., Any] | None = None) -> Callable[[Function], Function]:
    """Declare the state of a law `stress(strain, state, **parameters) -> (stress, new state)`.

    Args:
        state: shape of each variable, (), (3,) or (3, 3) for a symmetric tensor; zero in the virgin material
        elastic: stress(strain, state, **parameters) for a motion that leaves the state as it is: what the stiffness
            against small vibration, and slip, need; its parameters are some of the law's

    Examples:
        >>> @asp.law(state={"accumulated": ()})
        ... def mine(strain, state, E, nu):
        ...     return asp.laws.hooke(strain, E, nu), {"accumulated": state.accumulated}
        >>> mine.state
        {'accumulated': ()}
    """

    def declare(function: Function) -> Function:
        function.state, function.elastic = dict(state), elastic  # type: ignore[attr-defined]
        return function

    return declare


@dataclass(frozen=True)
class Law:
    """A law with its parameters; see `law_of_function` and `load`.

    Attributes:
        function: `stress(strain, **parameters)`, `stress(strain, state, **parameters)` or `energy(F, **parameters)`
        parameters: name and value of each
        source: where the function comes from, in words of a case file
        digest: SHA-256 of that file; empty for a law that comes along
        unit: of the stresses it returns, in those of its parameters
    """

    function: Callable[..., Any] = field(repr=False)
    parameters: tuple[tuple[str, float], ...]
    source: str
    digest: str = ""
    unit: float = 1.0

    @property
    def hyperelastic(self) -> bool:
        """Whether it is an energy of the deformation gradient, for finite strain."""
        return next(iter(inspect.signature(self.function).parameters)) == "F"

    @cached_property
    def state(self) -> dict[str, Shape]:
        """Shape of each state variable; empty where the stress depends on the strain alone."""
        return dict(getattr(self.function, "state", {}))

    @property
    def elastic(self) -> Callable[..., Any] | None:
        """Stress of a motion that leaves the state as it is, where the law declares it."""
        return getattr(self.function, "elastic", None)

    def scaled(self, stress: float) -> Law:
        """The same law with stresses in units of `stress`, in those of now."""
        return replace(self, unit=self.unit * stress)

    def energy(self, F: Any, values: Mapping[str, Any]) -> Any:
        """Energy per volume before deformation, in UFL, of parameters given by name."""
        return self.function(F, **values) / self.unit

    def stress(self, strain: Any, state: Mapping[str, Any], values: Mapping[str, Any], held: bool = False) -> Any:
        """Stress and new state, in UFL, of parameters given by name; `held` leaves the state as it is."""
        if not self.state:
            return self.function(strain, **values) / self.unit, {}
        before = SimpleNamespace(**state)
        if held:
            assert self.elastic is not None
            wanted = inspect.signature(self.elastic).parameters
            some = {name: value for name, value in values.items() if name in wanted}
            return self.elastic(strain, before, **some) / self.unit, dict(state)
        stress, after = self.function(strain, before, **values)
        return stress / self.unit, after


def law_of_function(
    function: Callable[..., Any],
    parameters: Mapping[str, Any],
    source: str = "",
    digest: str = "",
    offered: Mapping[str, Any] | None = None,
) -> Law:
    """A law of a function and its parameters, checked as far as its signature shows.

    Args:
        offered: parameters that it need not have

    Raises:
        InputError: it is no law, or a parameter is missing, unknown or no number
    """
    source = source or getattr(function, "__name__", brief(function))
    if not callable(function):
        refuse(source, f"is {brief(function)}, not a function")
    names = list(inspect.signature(function).parameters)
    kinds = {p.kind for p in inspect.signature(function).parameters.values()}
    state = getattr(function, "state", {})
    first = names[:2] if state else names[:1]
    if first not in (["F"], ["strain"], ["strain", "state"]) or kinds - {inspect.Parameter.POSITIONAL_OR_KEYWORD}:
        refuse(
            source,
            f"has the arguments ({', '.join(names)}): a law is stress(strain, ...), stress(strain, state, ...) with "
            "@asp.law(state=...), or energy(F, ...), its parameters by name",
        )
    elastic = getattr(function, "elastic", None)
    held = list(inspect.signature(elastic).parameters) if callable(elastic) else []
    if elastic is not None and (held[:2] != ["strain", "state"] or set(held) - set(names)):
        refuse(source, "declares elastic, which is no function of strain, state and some of its parameters")
    if "state" in names and not state:
        refuse(source, "has a state that is not declared: put @asp.law(state={...}) above it, name and shape of each")
    for name, shape in state.items():
        if not str(name).isidentifier() or name in RESERVED:
            refuse(source, f"declares a state by the name {show(str(name))}, which is taken: choose another")
        if shape not in list(SHAPES) or USUAL.get(name, shape) != shape:
            legal = str(USUAL.get(name, "(), (3,) or (3, 3)"))
            refuse(source, f"declares the state {name!r} of shape {shape!r}: legal is {legal}")
    wanted = {name: p.default for name, p in inspect.signature(function).parameters.items() if name not in first}
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


@contextmanager
def raising(source: str, what: str) -> Iterator[None]:
    """Turn any error in a block of a user's code into a refusal."""
    try:
        yield
    except InputError:
        raise
    except (Exception, SystemExit) as error:
        refuse(source, f"{what}: {type(error).__name__}: {' '.join(str(error).split()) or 'no message'}")


def refuse(source: str, reason: str) -> NoReturn:
    """Refuse a law with one sentence."""
    raise InputError(f"{KEY} = {show(source.rpartition('/')[2])} {reason}")
