# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Options of PETSc that several solvers share, and defaults for options that the user did not set."""

from __future__ import annotations

from typing import Any

GAMG = {
    "pc_gamg_coarse_eq_limit": 1000,
    "pc_gamg_esteig_ksp_type": "cg",
    "pc_gamg_esteig_ksp_max_it": 10,
    "mg_levels_ksp_type": "chebyshev",
    "mg_levels_pc_type": "jacobi",
}


def set_defaults(prefix: str, options: dict[str, Any]) -> None:
    """Put options in PETSc's database where the user has not set them.

    They stay there: PETSc reads those of multigrid levels only when the levels are built.
    """
    from petsc4py import PETSc

    database = PETSc.Options(prefix)
    for key, value in options.items():
        if not database.hasName(key):
            database[key] = value
