# SPDX-FileCopyrightText: The asperity developers
# SPDX-License-Identifier: LGPL-3.0-or-later

"""Micro-slip of a joint: tangential force, loops and damping by the normal curve, and the vibration with them."""

from __future__ import annotations

from asperity.slip.jenkins import JenkinsArray
from asperity.slip.joint_slip import JointSlip, slip_of_curve
from asperity.slip.law import SlipLaw
from asperity.slip.settings import SlipSettings
from asperity.slip.vibration import tangential_response

__all__ = ["JenkinsArray", "JointSlip", "SlipLaw", "SlipSettings", "slip_of_curve", "tangential_response"]
