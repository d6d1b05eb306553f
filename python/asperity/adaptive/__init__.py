# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Runs with a tolerance: family of meshes, extrapolation, error bars, and the estimate before a run."""
