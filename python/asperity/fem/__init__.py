"""Finite elements of the solid: element kernels, history, sparsity pattern, ghost updates."""
