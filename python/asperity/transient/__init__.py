"""Rigid mass vibrating on the full block: the dynamic solution with which the one-degree model is compared.

The flat carries a mass and has one degree of freedom; the block has inertia. Both advance by the
generalised-alpha method in the form of Arnold & Bruels (Multibody Syst. Dyn. 18 (2007) 185), which is that of Chung &
Hulbert (J. Appl. Mech. 60 (1993) 371) with the average taken of accelerations instead of forces:

    M w + F_int(x) = F_contact                        in full at the end of each step,
    (1 - alpha_m) a' + alpha_m a = (1 - alpha_f) w' + alpha_f w,
    x' = x + h v + h^2 [(1/2 - beta) a + beta a'],    v' = v + h [(1 - gamma) a + gamma a'].

So the contact conditions hold, and history is committed, exactly at the displacement, and a step is a static solve of
the contact solver with the stiffness of the inertia added. The method is of second order; during plastic flow the
first order of backward Euler prevails.

Units: lengths in L, stresses in E, any unit of time T; so forces are in E L^2, masses in E L T^2, the density in
E T^2/L^2.
"""

from asperity.transient.inertia import Scheme, consistent_mass
from asperity.transient.plate import TimeSeries, Transient

__all__ = ["Scheme", "TimeSeries", "Transient", "consistent_mass"]
