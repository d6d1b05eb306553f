// Finite strain by a law of small strain: logarithmic strain space.
//
// Miehe, Apel & Lambrecht, Comput. Methods Appl. Mech. Engrg. 191 (2002) 3383: with F = I + grad u and C = F^T F, the law
// receives the Hencky strain E = 1/2 ln C and returns the stress T and its tangent; T : dE is the work per undeformed
// volume. In the eigenvectors of C both are multiplied by divided differences of the logarithm at its eigenvalues c:
//     S_ij = ln[c_i, c_j] T_ij,    4 T : d2E/dC2 -> 4 sum ln[c_i, c_j, c_k] T_ik dG_ij dG_jk,    G = (C - 1)/2,
// with limits where eigenvalues are equal (Daleckii & Krein; Higham, Functions of Matrices (2008), section 3.2). So the
// stress of Piola and Kirchhoff S, its tangent and all gradients are kept in the eigenvectors. The readable twin is in
// tests/ufl_twin.py.
#pragma once

#include "element.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

namespace asperity
{
using Matrix = std::array<std::array<double, 3>, 3>;

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

/// Gradients g F^-1 with respect to the deformed position: those of the logarithm of det F are their sum.
inline Gradients deformed(const Gradients& g, const Deformation& deformation)
{
  const auto& F = deformation.F;
  Matrix inverse;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
    {
      const int k = (i + 1) % 3, l = (i + 2) % 3, m = (j + 1) % 3, n = (j + 2) % 3;
      inverse[j][i] = (F[k][m] * F[l][n] - F[k][n] * F[l][m]) / deformation.det;
    }
  Gradients out;
  for (int a = 0; a < nodes; ++a)
    for (int i = 0; i < 3; ++i)
      out[a][i] = g[a][0] * inverse[0][i] + g[a][1] * inverse[1][i] + g[a][2] * inverse[2][i];
  return out;
}

/// Gauss' rule on [0, 1] with a number of points, and the greatest norm of C - 1 for which `Resolvents` take it: there the
/// strain and the force are exact to rounding, the geometric part of the stiffness to 5e-13.
template <int count>
struct Gauss;

template <>
struct Gauss<4>
{
  static constexpr double points[]
      = {0.06943184420297371, 0.33000947820757187, 0.66999052179242813, 0.93056815579702629};
  static constexpr double weights[]
      = {0.17392742256872693, 0.32607257743127307, 0.32607257743127307, 0.17392742256872693};
  static constexpr double reach = 0.03;
};

template <>
struct Gauss<8>
{
  static constexpr double points[]
      = {0.01985507175123188, 0.10166676129318664, 0.23723379504183550, 0.40828267875217511,
         0.59171732124782489, 0.76276620495816450, 0.89833323870681336, 0.98014492824876812};
  static constexpr double weights[]
      = {0.05061426814518813, 0.11119051722668724, 0.15685332293894364, 0.18134189168918099,
         0.18134189168918099, 0.15685332293894364, 0.11119051722668724, 0.05061426814518813};
  static constexpr double reach = 0.36;
};

/// Rows of a symmetric tensor t at a place of the arrays of its components: left[i] holds t_ik, right[i] t_il, for the
/// pairs (k, l).
struct Rows
{
  Eight left[3], right[3];

  template <typename Components>
  Rows(const Components& components, int place)
  {
    for (int i = 0; i < 3; ++i)
      for (int l = 0; l < 8; ++l)
      {
        left[i][l] = l < 6 ? components[voigt[i][pairs[l][0]]][place] : 0.0;
        right[i][l] = l < 6 ? components[voigt[i][pairs[l][1]]][place] : 0.0;
      }
  }
};

/// Strain and stress of a moderate deformation without eigenvalues, with R = (1 + s A)^-1, A = C - 1 = 2 G, and s from
/// 0 to 1 by Gauss' rule (Higham, section 11.5):
///     ln(1 + A) = int A R ds,    dE = int R dG R ds,    T : d2E = -4 int s tr(R T R dG R dG) ds.
/// By eigenvalues the internal force of a point takes three times the time, its stiffness twice.
template <int count>
struct Resolvents
{
  using Lanes = std::array<double, count>;

  Matrix F;               // deformation gradient
  std::array<Lanes, 6> R; // components (xx, yy, zz, xy, xz, yz)
  Sym strain;             // E

  explicit Resolvents(const Deformation& x) : F(x.F)
  {
    constexpr const auto &points = Gauss<count>::points, &weights = Gauss<count>::weights;
    const Sym& A = x.A;
    double xx = 0.0, yy = 0.0, zz = 0.0, xy = 0.0, xz = 0.0, yz = 0.0;
#pragma omp simd reduction(+ : xx, yy, zz, xy, xz, yz)
    for (int q = 0; q < count; ++q)
    {
      const double s = points[q], w = weights[q];
      const double a = 1.0 + s * A[0], b = 1.0 + s * A[1], c = 1.0 + s * A[2], d = s * A[3], e = s * A[4], f = s * A[5];
      const double k0 = b * c - f * f, k3 = e * f - d * c, k4 = d * f - b * e;
      const double inv = 1.0 / (a * k0 + d * k3 + e * k4);
      R[0][q] = inv * k0;
      R[1][q] = inv * (a * c - e * e);
      R[2][q] = inv * (a * b - d * d);
      R[3][q] = inv * k3;
      R[4][q] = inv * k4;
      R[5][q] = inv * (d * e - a * f);
      xx += w * R[0][q];
      yy += w * R[1][q];
      zz += w * R[2][q];
      xy += w * R[3][q];
      xz += w * R[4][q];
      yz += w * R[5][q];
    }
    const Matrix mean = {{{xx, xy, xz}, {xy, yy, yz}, {xz, yz, zz}}};
    for (int j = 0; j < 3; ++j)
    {
      const auto column = times(A, mean[j]);
      for (int i = 0; i <= j; ++i)
        strain[voigt[i][j]] = 0.5 * column[i];
    }
  }

  /// R T R at the points.
  std::array<Lanes, 6> sandwich(const Sym& T) const
  {
    std::array<Lanes, 6> X;
#pragma omp simd
    for (int q = 0; q < count; ++q)
    {
      const double a = R[0][q], b = R[1][q], c = R[2][q], d = R[3][q], e = R[4][q], f = R[5][q];
      const double x0 = T[0] * a + T[3] * d + T[4] * e, x1 = T[3] * a + T[1] * d + T[5] * e;
      const double x2 = T[4] * a + T[5] * d + T[2] * e; // T times the columns of R
      const double y0 = T[0] * d + T[3] * b + T[4] * f, y1 = T[3] * d + T[1] * b + T[5] * f;
      const double y2 = T[4] * d + T[5] * b + T[2] * f;
      const double z0 = T[0] * e + T[3] * f + T[4] * c, z1 = T[3] * e + T[1] * f + T[5] * c;
      const double z2 = T[4] * e + T[5] * f + T[2] * c;
      X[0][q] = a * x0 + d * x1 + e * x2;
      X[1][q] = d * y0 + b * y1 + f * y2;
      X[2][q] = e * z0 + f * z1 + c * z2;
      X[3][q] = a * y0 + d * y1 + e * y2;
      X[4][q] = a * z0 + d * z1 + e * z2;
      X[5][q] = d * z0 + b * z1 + f * z2;
    }
    return X;
  }

  /// S from X = R T R.
  static Sym piola_kirchhoff(const std::array<Lanes, 6>& X)
  {
    Sym S{};
    for (int k = 0; k < 6; ++k)
      for (int q = 0; q < count; ++q)
        S[k] += Gauss<count>::weights[q] * X[k][q];
    return S;
  }

  /// First stress of Piola and Kirchhoff F S from T.
  Matrix nominal(const Sym& T) const
  {
    const Sym S = piola_kirchhoff(sandwich(T));
    return {times(S, F[0]), times(S, F[1]), times(S, F[2])};
  }

  /// Its derivative with respect to F, from T, the moduli of the law and their direction.
  Tangent tangent(const Sym& T, const Moduli& C, const Sym& n) const
  {
    const auto X = sandwich(T);
    Stiffness P{}, D{}; // dE/dG and dS/dG
    for (int q = 0; q < count; ++q)
    {
      const double w = Gauss<count>::weights[q], first = 0.5 * w, second = -w * Gauss<count>::points[q];
      const Rows r(R, q), x(X, q);
#pragma GCC unroll 6
      for (int k = 0; k < 6; ++k)
      {
        const int i = pairs[k][0], j = pairs[k][1];
#pragma omp simd
        for (int l = 0; l < 8; ++l)
        {
          P[k][l] += first * (r.left[i][l] * r.right[j][l] + r.right[i][l] * r.left[j][l]);
          D[k][l] += second * (x.left[i][l] * r.right[j][l] + x.right[j][l] * r.left[i][l]
                               + x.right[i][l] * r.left[j][l] + x.left[j][l] * r.right[i][l]);
        }
      }
    }
    const auto [lambda, mu, chi] = C;
    Eight volume, flow; // P : 1 and P : n
    for (int l = 0; l < 8; ++l)
    {
      volume[l] = P[0][l] + P[1][l] + P[2][l];
      flow[l] = n[0] * P[0][l] + n[1] * P[1][l] + n[2] * P[2][l]
                + 2.0 * (n[3] * P[3][l] + n[4] * P[4][l] + n[5] * P[5][l]);
    }
    for (int k = 0; k < 6; ++k)
      for (int l = 0; l < 8; ++l)
        D[k][l] += 2.0 * mu * (P[0][k] * P[0][l] + P[1][k] * P[1][l] + P[2][k] * P[2][l])
                   + 4.0 * mu * (P[3][k] * P[3][l] + P[4][k] * P[4][l] + P[5][k] * P[5][l])
                   + lambda * volume[k] * volume[l] + chi * flow[k] * flow[l];
    return nominal_tangent(F, piola_kirchhoff(X), D);
  }
};

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

/// Add weight * P g of each node to the element residual, P the nominal stress.
inline void add_residual(const Gradients& g, const Matrix& P, double weight, Gradients& b)
{
  for (int a = 0; a < nodes; ++a)
    for (int i = 0; i < 3; ++i)
      b[a][i] += weight * (P[i][0] * g[a][0] + P[i][1] * g[a][1] + P[i][2] * g[a][2]);
}
} // namespace asperity
