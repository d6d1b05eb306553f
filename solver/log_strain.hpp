// Finite strain by a law of small strain: logarithmic strain space.
//
// Miehe, Apel & Lambrecht, Comput. Methods Appl. Mech. Engrg. 191 (2002) 3383: with F = I + grad u and C = F^T F, the law
// receives the Hencky strain E = 1/2 ln C and returns the stress T and its tangent; T : dE is the work per undeformed
// volume. In the eigenvectors of C both are multiplied by divided differences of the logarithm at its eigenvalues c:
//     S_ij = ln[c_i, c_j] T_ij,    4 T : d2E/dC2 -> 4 sum ln[c_i, c_j, c_k] T_ik dG_ij dG_jk,    G = (C - 1)/2,
// with limits where eigenvalues are equal (Daleckii & Krein; Higham, Functions of Matrices (2008), section 3.2). So the
// stress of Piola and Kirchhoff S, its tangent and all gradients are kept in the eigenvectors. The readable twin is in
// python/asperity/fem/weak_form.py.
#pragma once

#include "eigenvectors.hpp"
#include "log_by_quadrature.hpp"

namespace asperity
{
/// Call `kernel(x)` with the logarithmic strain of a deformation in the form that is cheapest there. All forms have the
/// members `strain`, `nominal` and `tangent`.
template <typename Kernel>
decltype(auto) with_log_strain(const Deformation& deformation, Kernel&& kernel)
{
  const double squared = contract(deformation.A, deformation.A);
  if (squared < Gauss<4>::reach * Gauss<4>::reach)
    return kernel(Resolvents<4>(deformation));
  if (squared < Gauss<8>::reach * Gauss<8>::reach)
    return kernel(Resolvents<8>(deformation));
  return kernel(LogStrain(deformation));
}
} // namespace asperity
