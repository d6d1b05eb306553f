# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Files, ranks, progress, timing, signals and versions of dolfinx, for all other packages."""
