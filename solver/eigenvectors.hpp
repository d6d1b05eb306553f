// Logarithmic strain of any deformation by the eigenvectors of C, see log_strain.hpp.
#pragma once

#include "deformation.hpp"

#include <algorithm>
#include <cmath>

namespace asperity
{
/// Eigenvalues of a symmetric matrix, left on its diagonal, and eigenvectors in the columns of N: Jacobi's method.
inline void diagonalise(Matrix& A, Matrix& N)
{
  N = {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
  constexpr int rotations[3][3] = {{0, 1, 2}, {0, 2, 1}, {1, 2, 0}};
  for (int sweep = 0; sweep < 12; ++sweep)
  {
    const double off = std::abs(A[0][1]) + std::abs(A[0][2]) + std::abs(A[1][2]);
    if (off <= 1e-17 * (std::abs(A[0][0]) + std::abs(A[1][1]) + std::abs(A[2][2])))
      return;
    for (const auto& [p, q, r] : rotations)
    {
      if (A[p][q] == 0.0)
        continue;
      const double half = 0.5 * (A[q][q] - A[p][p]);
      double t = 0.5 * A[p][q] / half, c = 1.0 - 0.5 * t * t; // tangent and cosine of a small angle
      if (!(std::abs(t) < 1e-6))
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
  double ratio = 1.0 / 13;
  for (int n = 11; n > 0; n -= 2)
    ratio = 1.0 / n + s * ratio;
  return 2.0 * (std::abs(z) > 0.1 ? std::atanh(z) / z : ratio) / (a + b);
}

/// Relative difference of eigenvalues below which second divided differences are series: with these terms the relative
/// error is 4e-14 at most on either side, measured against 60 digits.
constexpr double near_eigenvalues = 0.02;
constexpr int near_terms = 9;

/// Second divided difference ln[a, a, b], from ln[a, b].
inline double log_difference_twice(double a, double b, double ab)
{
  const double t = b / a - 1.0;
  if (std::abs(t) > near_eigenvalues)
    return (1.0 / a - ab) / (a - b);
  double sum = 0.0; // -1/2 + t/3 - t^2/4 ...
  for (int n = near_terms - 1; n >= 0; --n)
    sum = -1.0 / (n + 2) - t * sum;
  return sum / (a * a);
}

/// Second divided difference ln[a, b, c], from ln[a, b], ln[b, c] and ln[a, c].
inline double log_difference(double a, double b, double c, double ab, double bc, double ac)
{
  const double mean = (a + b + c) / 3.0, far = near_eigenvalues * mean;
  const double d_ab = std::abs(a - b), d_bc = std::abs(b - c), d_ac = std::abs(a - c);
  if (std::max({d_ab, d_bc, d_ac}) > far) // by the two that are farthest apart
  {
    if (d_ac >= d_ab && d_ac >= d_bc)
      return (ab - bc) / (a - c);
    return d_ab >= d_bc ? (ac - bc) / (a - b) : (ab - ac) / (b - c);
  }
  // sum over n of (-1)^(n+1)/(n + 2) h_n, the complete homogeneous polynomials of the relative distances from the mean
  const double x = a / mean - 1.0, y = b / mean - 1.0, z = c / mean - 1.0;
  double one = 1.0, two = 1.0, three = 1.0, sign = -1.0, sum = -0.5;
  for (int n = 1; n < near_terms; ++n)
  {
    one *= x;
    two = one + y * two;
    three = two + z * three;
    sign = -sign;
    sum += sign * three / (n + 2);
  }
  return sum / (mean * mean);
}

/// Logarithmic strain of a point by the eigenvectors of C, the frame.
struct LogStrain
{
  double det;  // of the deformation gradient
  Matrix N;    // eigenvectors in the columns
  Matrix F;    // deformation gradient from the frame, F N
  double c[3]; // eigenvalues of C
  Sym theta;   // ln[c_i, c_j]
  Sym strain;  // E, not in the frame

  explicit LogStrain(const Deformation& x) : det(x.det)
  {
    const Sym& s = x.A;
    Matrix A = {{{s[0], s[3], s[4]}, {s[3], s[1], s[5]}, {s[4], s[5], s[2]}}};
    diagonalise(A, N);
    double e[3];
    for (int i = 0; i < 3; ++i)
    {
      c[i] = 1.0 + A[i][i];
      e[i] = 0.5 * std::log1p(A[i][i]);
    }
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j)
        F[i][j] = x.F[i][0] * N[0][j] + x.F[i][1] * N[1][j] + x.F[i][2] * N[2][j];
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

  /// First stress of Piola and Kirchhoff F S, on undeformed areas, from T.
  Matrix nominal(const Sym& T) const
  {
    const Sym S = piola_kirchhoff(to_frame(T));
    Matrix out;
    for (int i = 0; i < 3; ++i)
    {
      const auto row = times(S, F[i]);
      for (int j = 0; j < 3; ++j)
        out[i][j] = row[0] * N[j][0] + row[1] * N[j][1] + row[2] * N[j][2];
    }
    return out;
  }

  /// Cauchy's stress F S F^T/det F, from T.
  Sym cauchy(const Sym& T) const
  {
    const Sym S = piola_kirchhoff(to_frame(T));
    Sym out;
    for (int i = 0; i < 3; ++i)
    {
      const auto row = times(S, F[i]);
      for (int j = i; j < 3; ++j)
        out[voigt[i][j]] = (row[0] * F[j][0] + row[1] * F[j][1] + row[2] * F[j][2]) / det;
    }
    return out;
  }

  /// Derivative of the nominal stress with respect to F, from T, the moduli of the law and their direction.
  Tangent tangent(const Sym& T, const Moduli& C, const Sym& n) const
  {
    const Sym t = to_frame(T);
    const Tangent framed = nominal_tangent(F, piola_kirchhoff(t), stiffness(t, C, to_frame(n)));
    Tangent half, out; // the columns, then the rows out of the frame
    for (int r = 0; r < 9; ++r)
      for (int k = 0; k < 3; ++k)
        for (int l = 0; l < 3; ++l)
          half[r][3 * k + l]
              = framed[r][3 * k] * N[l][0] + framed[r][3 * k + 1] * N[l][1] + framed[r][3 * k + 2] * N[l][2];
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j)
        for (int c = 0; c < 9; ++c)
          out[3 * i + j][c] = N[j][0] * half[3 * i][c] + N[j][1] * half[3 * i + 1][c] + N[j][2] * half[3 * i + 2][c];
    return out;
  }

private:
  /// dS/dG in the frame, from T, the moduli of the law and their direction, both in the frame.
  Stiffness stiffness(const Sym& T, const Moduli& C, const Sym& n) const
  {
    const auto [lambda, mu, chi] = C;
    Stiffness D{};
    for (int i = 0; i < 6; ++i)
      for (int j = 0; j < 6; ++j)
        D[i][j] = theta[i] * theta[j]
                  * ((i < 3 && j < 3 ? lambda : 0.0) + (i != j ? 0.0 : (i < 3 ? 2.0 * mu : mu)) + chi * n[i] * n[j]);
    const double all = log_difference(c[0], c[1], c[2], theta[3], theta[5], theta[4]);
    double twice[3][3]; // ln[c_i, c_i, c_j]
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j)
        twice[i][j] = i == j ? -0.5 / (c[i] * c[i]) : log_difference_twice(c[i], c[j], theta[voigt[i][j]]);
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
};
} // namespace asperity
