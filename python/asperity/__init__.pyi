"""Public names: `lazy_loader` finds them here, and so do type checkers and editors."""

from . import laws as laws
from . import reference as reference
from .adaptive.guide import choose_kinematics as choose_kinematics
from .adaptive.solve_contact import solve_contact as solve_contact
from .case import Case as Case
from .curve import Curve as Curve
from .curve.power_law import PowerLawFit as PowerLawFit
from .curve.power_law import fit_power_law as fit_power_law
from .errors import AsperityError as AsperityError
from .errors import AsperityWarning as AsperityWarning
from .errors import CheckpointError as CheckpointError
from .errors import CompatError as CompatError
from .errors import ConvergenceError as ConvergenceError
from .errors import InputError as InputError
from .errors import MeshError as MeshError
from .errors import RangeError as RangeError
from .job.run_case import run as run
from .laws import law as law
from .model.joint import Joint as Joint
from .model.material import Material as Material
from .model.problem import Problem as Problem
from .model.settings import AccuracyTarget as AccuracyTarget
from .model.settings import Formulation as Formulation
from .model.settings import MeshSize as MeshSize
from .model.settings import SolverOptions as SolverOptions
from .output.export import export as export
from .surface import Surface as Surface
from .version import __version__ as __version__
from .vibration import ContactOscillator as ContactOscillator
from .vibration import CurveLaw as CurveLaw
from .vibration import PowerLaw as PowerLaw
from .vibration import TaylorLaw as TaylorLaw
from .vibration import run_dynamics as run_dynamics

__all__: list[str]
