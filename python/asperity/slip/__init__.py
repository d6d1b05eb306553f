"""Micro-slip of a joint: tangential force, loops and damping by the normal curve, and the vibration with them."""

import lazy_loader  # type: ignore[import-untyped]

_MODULES = {
    "joint_slip": ["JointSlip", "SlipSettings", "slip_of_curve"],
    "law": ["SlipLaw"],
    "tangential": ["tangential_response"],
}
__getattr__, __dir__, __all__ = lazy_loader.attach(__name__, submod_attrs=_MODULES)
