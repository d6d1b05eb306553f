"""Vibration of a mass on a contact, from the static law of its force over the approach; NumPy and SciPy suffice.

`run_dynamics` does the whole analysis for a curve and writes the result files.
"""

import lazy_loader  # type: ignore[import-untyped]

_MODULES = {
    "law": ["Law", "PowerLaw", "TaylorLaw", "bar_of"],
    "curve_law": ["CurveLaw"],
    "source": ["law_from"],
    "equation": ["Equation"],
    "motion": ["Trajectory"],
    "free": ["FreeVibration", "Thresholds"],
    "response": ["FrequencyResponse"],
    "oscillator": ["ContactOscillator", "Numbers"],
    "run": ["Dynamics", "DynamicsSettings", "run_dynamics"],
}
__getattr__, __dir__, __all__ = lazy_loader.attach(__name__, submod_attrs=_MODULES)
