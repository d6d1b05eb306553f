# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""`python -m asperity` is the command `asperity`."""

from asperity.cli import main

main()
