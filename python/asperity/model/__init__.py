# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Plain data that describe what is computed: material, load path, settings, two bodies as one."""
