# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Static contact laws (force over approach), restoring force about a preload, damping models."""
