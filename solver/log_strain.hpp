// Finite strain by a law of small strain: logarithmic strain space.
//
// Miehe, Apel & Lambrecht, Comput. Methods Appl. Mech. Engrg. 191 (2002) 3383: with F = I + grad u and C = F^T F, the law
// receives the Hencky strain E = 1/2 ln C and returns the stress T and its tangent; T : dE is the work per undeformed
// volume. In the eigenvectors of C both are multiplied by divided differences of the logarithm at its eigenvalues c:
//     S_ij = ln[c_i, c_j] T_ij,    4 T : d2E/dC2 -> 4 sum ln[c_i, c_j, c_k] T_ik dG_ij dG_jk,    G = (C - 1)/2,
// with limits where eigenvalues are equal (Daleckii & Krein; Higham, Functions of Matrices (2008), section 3.2). So the
// stress of Piola and Kirchhoff S, its tangent and all gradients are kept in the eigenvectors. `asperity.fem.log_strain`
// is the readable twin.
#pragma once

#include "tet10.hpp"

#include <algorithm>
#include <cmath>

namespace asperity
{
using Matrix = std::array<std::array<double, 3>, 3>;

/// Eigenvalues of a symmetric matrix, left on its diagonal, and eigenvectors in the columns of N: Jacobi's method.
inline void diagonalise(Matrix& A, Matrix& N)
{
  N = {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
  constexpr int pairs[3][3] = {{0, 1, 2}, {0, 2, 1}, {1, 2, 0}};
  for (int sweep = 0; sweep < 12; ++sweep)
  {
    const double off = std::abs(A[0][1]) + std::abs(A[0][2]) + std::abs(A[1][2]);
    if (off <= 1e-17 * (std::abs(A[0][0]) + std::abs(A[1][1]) + std::abs(A[2][2])))
      return;
    for (const auto& [p, q, r] : pairs)
    {
      if (A[p][q] == 0.0)
        continue;
      const double half = 0.5 * (A[q][q] - A[p][p]);
      double t = 0.5 * A[p][q] / half, c = 1.0 - 0.5 * t * t; // tangent and cosine of a small angle
      if (!(std::abs(t) < 1e-5))
      {
        t = A[p][q] / (half + std::copysign(std::sqrt(half * half + A[p][q] * A[p][q]), half));
        c = 1.0 / std::sqrt(1.0 + t * t);
      }
      const double s = t * c;
      A[p][p] -= t * A[p][q];
      A[q][q] += t * A[p][q];
      A[p][q] = A[q][p] = 0.0;
      const double pr = A[p][r], qr = A[q][r];
      A[p][r] = A[r][p] = c * pr - s * qr;
      A[q][r] = A[r][q] = s * pr + c * qr;
      for (auto& row : N)
      {
        const double np = row[p], nq = row[q];
        row[p] = c * np - s * nq;
        row[q] = s * np + c * nq;
      }
    }
  }
}

/// First divided difference ln[a, b]: 2 atanh(z)/(a - b) with z = (a - b)/(a + b), by its series where that is small.
inline double log_difference(double a, double b)
{
  const double z = (a - b) / (a + b), s = z * z;
  const double ratio = std::abs(z) > 0.1
                           ? std::atanh(z) / z
                           : 1.0 + s * (1.0 / 3 + s * (1.0 / 5 + s * (1.0 / 7 + s * (1.0 / 9 + s * (1.0 / 11 + s / 13)))));
  return 2.0 * ratio / (a + b);
}

/// Relative difference of eigenvalues below which their second divided difference is a series; either way the relative
/// error is 2e-14 there (measured).
constexpr double near_eigenvalues = 0.02;

/// Second divided difference ln[a, b, c].
inline double log_difference(double a, double b, double c)
{
  const double mean = (a + b + c) / 3.0;
  if (std::max({a, b, c}) - std::min({a, b, c}) > near_eigenvalues * mean)
  {
    if (std::abs(a - b) > std::abs(a - c)) // the two that are farthest apart come first and last
      std::swap(b, c);
    if (std::abs(b - c) > std::abs(a - c))
      std::swap(a, b);
    return (log_difference(a, b) - log_difference(b, c)) / (a - c);
  }
  // sum over n of (-1)^(n+1)/(n + 2) h_n, the complete homogeneous polynomials of the relative distances from the mean
  const double x = a / mean - 1.0, y = b / mean - 1.0, z = c / mean - 1.0;
  double one = 1.0, two = 1.0, three = 1.0, sign = -1.0, sum = -0.5;
  for (int n = 1; n < 9; ++n)
  {
    one *= x;
    two = one + y * two;
    three = two + z * three;
    sign = -sign;
    sum += sign * three / (n + 2);
  }
  return sum / (mean * mean);
}

/// Number of a pair of indices in a symmetric tensor.
constexpr int voigt[3][3] = {{0, 3, 4}, {3, 1, 5}, {4, 5, 2}};

/// Stiffness from strain components, the shear ones counted twice, to stress components.
using Stiffness = std::array<std::array<double, 6>, 6>;

/// Deformation of a point. The frame is that of the eigenvectors of C.
struct LogStrain
{
  double det;           // of F; where it is not positive, only this is set
  Matrix N;             // eigenvectors in the columns
  Matrix F;             // deformation gradient from the frame, F N
  double c[3];          // eigenvalues of C
  Sym theta;            // ln[c_i, c_j]
  Sym strain;           // E, not in the frame

  LogStrain(const Gradients& g, const Gradients& u)
  {
    Matrix H{};
    for (int a = 0; a < nodes; ++a)
      for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
          H[i][j] += u[a][i] * g[a][j];
    Matrix G = H;
    for (int i = 0; i < 3; ++i)
      G[i][i] += 1.0;
    det = G[0][0] * (G[1][1] * G[2][2] - G[1][2] * G[2][1]) - G[0][1] * (G[1][0] * G[2][2] - G[1][2] * G[2][0])
          + G[0][2] * (G[1][0] * G[2][1] - G[1][1] * G[2][0]);
    if (!(det > 0.0))
      return;
    Matrix A; // C - 1: small strains keep their digits
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j)
        A[i][j] = H[i][j] + H[j][i] + H[0][i] * H[0][j] + H[1][i] * H[1][j] + H[2][i] * H[2][j];
    diagonalise(A, N);
    double e[3];
    for (int i = 0; i < 3; ++i)
    {
      c[i] = 1.0 + A[i][i];
      e[i] = 0.5 * std::log1p(A[i][i]);
    }
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j)
        F[i][j] = G[i][0] * N[0][j] + G[i][1] * N[1][j] + G[i][2] * N[2][j];
    for (int i = 0; i < 3; ++i)
      for (int j = i; j < 3; ++j)
      {
        theta[voigt[i][j]] = i == j ? 1.0 / c[i] : log_difference(c[i], c[j]);
        strain[voigt[i][j]] = N[i][0] * e[0] * N[j][0] + N[i][1] * e[1] * N[j][1] + N[i][2] * e[2] * N[j][2];
      }
  }

  std::array<double, 3> to_frame(const std::array<double, 3>& v) const
  {
    std::array<double, 3> out;
    for (int i = 0; i < 3; ++i)
      out[i] = N[0][i] * v[0] + N[1][i] * v[1] + N[2][i] * v[2];
    return out;
  }

  Sym to_frame(const Sym& t) const
  {
    Sym out;
    for (int j = 0; j < 3; ++j)
    {
      const auto column = times(t, {N[0][j], N[1][j], N[2][j]});
      for (int i = 0; i <= j; ++i)
        out[voigt[i][j]] = N[0][i] * column[0] + N[1][i] * column[1] + N[2][i] * column[2];
    }
    return out;
  }

  /// S in the frame, from T in the frame.
  Sym piola_kirchhoff(const Sym& T) const
  {
    Sym S;
    for (int i = 0; i < 6; ++i)
      S[i] = theta[i] * T[i];
    return S;
  }

  /// Traction stress on undeformed areas, F S: the first stress of Piola and Kirchhoff.
  Matrix nominal(const Sym& S) const
  {
    Matrix out;
    for (int i = 0; i < 3; ++i)
    {
      const auto row = times(S, F[i]);
      for (int j = 0; j < 3; ++j)
        out[i][j] = row[0] * N[j][0] + row[1] * N[j][1] + row[2] * N[j][2];
    }
    return out;
  }

  /// Cauchy's stress F S F^T/det F.
  Sym cauchy(const Sym& S) const
  {
    Sym out;
    for (int i = 0; i < 3; ++i)
    {
      const auto row = times(S, F[i]);
      for (int j = i; j < 3; ++j)
        out[voigt[i][j]] = (row[0] * F[j][0] + row[1] * F[j][1] + row[2] * F[j][2]) / det;
    }
    return out;
  }

  /// dS/dG in the frame, from T, the moduli of the law and their direction, both in the frame.
  Stiffness stiffness(const Sym& T, const Moduli& C, const Sym& n) const
  {
    const auto [lambda, mu, chi] = C;
    Stiffness D;
    for (int i = 0; i < 6; ++i)
      for (int j = 0; j < 6; ++j)
        D[i][j] = theta[i] * theta[j]
                  * ((i < 3 && j < 3 ? lambda : 0.0) + (i != j ? 0.0 : (i < 3 ? 2.0 * mu : mu)) + chi * n[i] * n[j]);
    const double all = log_difference(c[0], c[1], c[2]);
    double twice[3][3]; // ln[c_i, c_i, c_j]
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j)
        twice[i][j] = i == j ? -0.5 / (c[i] * c[i]) : log_difference(c[i], c[i], c[j]);
    for (int i = 0; i < 3; ++i)
      for (int k = i; k < 3; ++k)
        for (int j = 0; j < 3; ++j)
        {
          const double eta = i == j ? twice[i][k] : j == k ? twice[k][i] : i == k ? twice[i][j] : all;
          const int left = voigt[i][j], right = voigt[j][k];
          const double term = 4.0 * eta * T[voigt[i][k]] * (left < 3 ? 1.0 : 0.5) * (right < 3 ? 1.0 : 0.5);
          D[left][right] += term;
          if (i != k)
            D[right][left] += term;
        }
    return D;
  }

  /// Derivative of G with respect to the displacement i of a node with the gradient g in the frame, shear counted twice.
  Sym variation(int i, const std::array<double, 3>& g) const
  {
    const auto& f = F[i];
    return {f[0] * g[0],
            f[1] * g[1],
            f[2] * g[2],
            f[0] * g[1] + f[1] * g[0],
            f[0] * g[2] + f[2] * g[0],
            f[1] * g[2] + f[2] * g[1]};
  }
};

/// Add weight * P g of each node to the element residual, P the nominal stress.
inline void add_residual(const Gradients& g, const Matrix& P, double weight, Gradients& b)
{
  for (int a = 0; a < nodes; ++a)
    for (int i = 0; i < 3; ++i)
      b[a][i] += weight * (P[i][0] * g[a][0] + P[i][1] * g[a][1] + P[i][2] * g[a][2]);
}

/// Add weight * (B^T D B + geometric part) to the row-major 30 x 32 element matrix. Only the node pairs a <= b are filled.
inline void add_stiffness(const Gradients& g, const LogStrain& x, const Sym& S, const Stiffness& D, double weight,
                          double* A)
{
  double B[6][row_length] = {}, DB[6][row_length] = {};
  Gradients h, Sh;
  for (int a = 0; a < nodes; ++a)
  {
    h[a] = x.to_frame(g[a]);
    Sh[a] = times(S, h[a]);
    for (int i = 0; i < 3; ++i)
    {
      const Sym v = x.variation(i, h[a]);
      for (int k = 0; k < 6; ++k)
        B[k][3 * a + i] = v[k];
    }
  }
  for (int k = 0; k < 6; ++k)
  {
    for (int j = 0; j < row_length; ++j)
      DB[k][j] = weight
                 * (D[k][0] * B[0][j] + D[k][1] * B[1][j] + D[k][2] * B[2][j] + D[k][3] * B[3][j] + D[k][4] * B[4][j]
                    + D[k][5] * B[5][j]);
  }
  for (int a = 0; a < nodes; ++a)
  {
    constexpr int width = 8; // columns in one go, from the last multiple on
    for (int i = 3 * a; i < 3 * a + 3; ++i)
      for (int first = 3 * a / width * width; first < row_length; first += width)
      {
        double* row = A + i * row_length + first;
        for (int j = 0; j < width; ++j)
          row[j] += B[0][i] * DB[0][first + j] + B[1][i] * DB[1][first + j] + B[2][i] * DB[2][first + j]
                    + B[3][i] * DB[3][first + j] + B[4][i] * DB[4][first + j] + B[5][i] * DB[5][first + j];
      }
    for (int b = a; b < nodes; ++b)
    {
      const double geometric = weight * (h[a][0] * Sh[b][0] + h[a][1] * Sh[b][1] + h[a][2] * Sh[b][2]);
      for (int i = 0; i < 3; ++i)
        A[(3 * a + i) * row_length + 3 * b + i] += geometric;
    }
  }
}
} // namespace asperity
