"""References to cite for a computation."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from asperity.version import __version__

_ITSELF = (
    f"The asperity developers, asperity {__version__}: contact of rough elastic-plastic surfaces with a rigid "
    "flat, and vibration on it"
)
_TOOLS = (
    "Baratta et al., DOLFINx: the next generation FEniCS problem solving environment (2023), "
    "doi:10.5281/zenodo.10447666",
    "Balay et al., PETSc/TAO Users Manual, Argonne National Laboratory, ANL-21/39",
    "Geuzaine and Remacle, Gmsh: a 3-D finite element mesh generator, Int. J. Numer. Meth. Eng. 79 (2009) 1309-1331, "
    "doi:10.1002/nme.2579",
)
_SURFACE = (
    "Yan and Komvopoulos, Contact analysis of elastic-plastic fractal surfaces, J. Appl. Phys. 84 (1998) 3617-3624, "
    "doi:10.1063/1.368536"
)
_PLASTICITY = "Simo and Hughes, Computational Inelasticity, Springer (1998), chapter 3"
_METHOD = {
    "active-set": "Hüeber and Wohlmuth, A primal-dual active set strategy for non-linear multibody "
    "contact problems, Comput. Methods Appl. Mech. Eng. 194 (2005) 3147-3166",
    "nitsche": "Chouly and Hild, A Nitsche-based method for unilateral contact problems: numerical "
    "analysis, SIAM J. Numer. Anal. 51 (2013) 1295-1307",
}
_DYNAMICS = (
    "Jana, Mitra and Sahoo, Dynamic contact interactions of fractal surfaces, Appl. Surf. Sci. 392 (2017) 872-882"
)


def publications(case: Mapping[str, Any]) -> list[str]:
    """What to cite for a completed case: this package, then the models and programs that the case uses."""
    found = [_ITSELF]
    if case.get("surface", {}).get("kind") == "weierstrass-mandelbrot":
        found.append(_SURFACE)
    if "yield_strength" in case.get("material", {}):
        found.append(_PLASTICITY)
    method = case.get("contact", {}).get("method")
    if method in _METHOD:
        found.append(_METHOD[method])
    if "dynamics" in case:
        found.append(_DYNAMICS)
    return [*found, *_TOOLS]
