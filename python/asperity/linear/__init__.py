# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Linear systems of a Newton step: matrix-free tangent, multigrid, factorisation."""
