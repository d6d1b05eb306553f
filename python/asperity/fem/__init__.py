# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Finite elements of the solid: element kernels, history, sparsity pattern, ghost updates."""
