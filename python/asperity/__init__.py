"""From a rough surface to its contact force and to the vibration of a mass on it.

Importing the package is light: the names of `__init__.pyi` are loaded at their first use.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
