// Deformation of a point in finite strain, and the nominal stress P = F S.
#pragma once

#include "element.hpp"

namespace asperity
{
using Matrix = std::array<std::array<double, 3>, 3>;

/// Number of a pair of indices in a symmetric tensor.
constexpr int voigt[3][3] = {{0, 3, 4}, {3, 1, 5}, {4, 5, 2}};
/// The pairs by their numbers.
constexpr int pairs[6][2] = {{0, 0}, {1, 1}, {2, 2}, {0, 1}, {0, 2}, {1, 2}};

/// Components of a symmetric tensor and two to spare, which fill vectors of any width.
using Eight = std::array<double, 8>;

/// Fourth-order tensor with the symmetries of a stiffness, by pairs: stress components from strain components, the
/// shear ones counted twice.
using Stiffness = std::array<Eight, 6>;

/// dP/dF of the nominal stress P = F S, from D = dS/dG.
inline Tangent nominal_tangent(const Matrix& F, const Sym& S, const Stiffness& D)
{
  Tangent out;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
    {
      const Eight &x = D[voigt[0][j]], &y = D[voigt[1][j]], &z = D[voigt[2][j]];
      Eight q; // dP_ij/dG
      for (int l = 0; l < 8; ++l)
        q[l] = F[i][0] * x[l] + F[i][1] * y[l] + F[i][2] * z[l];
      auto& row = out[3 * i + j];
      for (int k = 0; k < 3; ++k)
        for (int l = 0; l < 3; ++l)
          row[3 * k + l] = F[k][0] * q[voigt[0][l]] + F[k][1] * q[voigt[1][l]] + F[k][2] * q[voigt[2][l]];
      for (int l = 0; l < 3; ++l)
        row[3 * i + l] += S[voigt[j][l]];
    }
  return out;
}

/// Deformation gradient of a point, its determinant, and C - 1, in which small strains keep their digits.
struct Deformation
{
  Matrix F;
  double det;
  Sym A;

  Deformation(const Gradients& g, const Gradients& u) : F{}
  {
    for (int a = 0; a < nodes; ++a)
      for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
          F[i][j] += u[a][i] * g[a][j];
    for (int i = 0; i < 3; ++i)
      for (int j = i; j < 3; ++j)
        A[voigt[i][j]] = F[i][j] + F[j][i] + F[0][i] * F[0][j] + F[1][i] * F[1][j] + F[2][i] * F[2][j];
    for (int i = 0; i < 3; ++i)
      F[i][i] += 1.0;
    det = F[0][0] * (F[1][1] * F[2][2] - F[1][2] * F[2][1]) - F[0][1] * (F[1][0] * F[2][2] - F[1][2] * F[2][0])
          + F[0][2] * (F[1][0] * F[2][1] - F[1][1] * F[2][0]);
  }

  bool valid() const { return det > 0.0; }
};

/// Add weight * P g of each node to the element residual, P the nominal stress.
inline void add_residual(const Gradients& g, const Matrix& P, double weight, Gradients& b)
{
  for (int a = 0; a < nodes; ++a)
    for (int i = 0; i < 3; ++i)
      b[a][i] += weight * (P[i][0] * g[a][0] + P[i][1] * g[a][1] + P[i][2] * g[a][2]);
}
} // namespace asperity
