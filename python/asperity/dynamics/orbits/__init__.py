# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Periodic orbits: free vibration, harmonic balance, continuation, stability, thresholds."""
