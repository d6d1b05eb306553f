# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

from typing import Any

def __getattr__(name: str) -> Any: ...
