"""Linear systems of a Newton step: matrix-free tangent, multigrid, factorisation."""
