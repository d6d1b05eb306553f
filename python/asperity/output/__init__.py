# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Results of a run: fields, results read from a folder, comparison of curves, assumptions of the model."""
