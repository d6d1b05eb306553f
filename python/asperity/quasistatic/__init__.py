# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Load path of a contact: contact solver, Newton, steps, balances, checkpoints."""
