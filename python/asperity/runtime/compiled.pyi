from asperity import _solver as solver

__all__ = ["solver"]
