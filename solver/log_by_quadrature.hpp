// Logarithmic strain of moderate deformations without eigenvalues, see log_strain.hpp.
#pragma once

#include "deformation.hpp"

namespace asperity
{
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
} // namespace asperity
