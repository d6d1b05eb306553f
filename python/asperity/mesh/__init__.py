# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Mesh of the block: element, element sizes, generation by gmsh, distribution over the ranks."""
