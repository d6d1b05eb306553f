"""Public names: `asperity.__getattr__` finds them here, and so do type checkers and editors."""

from asperity import laws as laws
from asperity import reference as reference
from asperity.adaptive.small_strain import choose_kinematics as choose_kinematics
from asperity.adaptive.solve_contact import solve_contact as solve_contact
from asperity.case import Case as Case
from asperity.curve import Curve as Curve
from asperity.curve.power_law import PowerLawFit as PowerLawFit
from asperity.curve.power_law import fit_power_law as fit_power_law
from asperity.errors import AsperityError as AsperityError
from asperity.errors import AsperityWarning as AsperityWarning
from asperity.errors import CheckpointError as CheckpointError
from asperity.errors import CompatError as CompatError
from asperity.errors import ConvergenceError as ConvergenceError
from asperity.errors import InputError as InputError
from asperity.errors import MeshError as MeshError
from asperity.errors import RangeError as RangeError
from asperity.job.run_case import run as run
from asperity.laws import law as law
from asperity.model.joint import Joint as Joint
from asperity.model.material import Material as Material
from asperity.model.problem import Problem as Problem
from asperity.model.settings import AccuracyTarget as AccuracyTarget
from asperity.model.settings import Formulation as Formulation
from asperity.model.settings import MeshSize as MeshSize
from asperity.model.settings import SolverOptions as SolverOptions
from asperity.output.export import export as export
from asperity.surface import Surface as Surface
from asperity.version import __version__ as __version__
from asperity.vibration import ContactOscillator as ContactOscillator
from asperity.vibration import CurveLaw as CurveLaw
from asperity.vibration import PowerLaw as PowerLaw
from asperity.vibration import TaylorLaw as TaylorLaw
from asperity.vibration import run_dynamics as run_dynamics
from asperity.vibration import unload_reload as unload_reload

__all__: list[str]
