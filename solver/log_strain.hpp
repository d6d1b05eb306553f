// Finite strain by a law of small strain: logarithmic strain space.
//
// Miehe, Apel & Lambrecht, Comput. Methods Appl. Mech. Engrg. 191 (2002) 3383: with F = I + grad u and C = F^T F, the law
// receives the Hencky strain E = 1/2 ln C and returns the stress T and its tangent; T : dE is the work per undeformed
// volume. The logarithm and its derivatives are integrals of the resolvent by Gauss' rule (Higham, Functions of Matrices
// (2008), section 11.5). The readable twin is in python/asperity/fem/weak_form.py.
#pragma once

#include "deformation.hpp"

#include <cmath>
#include <numbers>
#include <type_traits>
#include <utility>
#include <variant>

namespace asperity
{
/// Gauss' rule on [0, 1]: the roots of Legendre's polynomial, by Newton's method.
template <int count>
struct Gauss
{
  std::array<double, count> points, weights;

  Gauss()
  {
    for (int i = 0; i < count; ++i)
    {
      double x = -std::cos(std::numbers::pi * (i + 0.75) / (count + 0.5)), slope = 1.0;
      for (int step = 0; step < 6; ++step)
      {
        double value = x, before = 1.0;
        for (int n = 2; n <= count; ++n)
          before = std::exchange(value, ((2 * n - 1) * x * value - (n - 1) * before) / n);
        slope = count * (x * value - before) / (x * x - 1.0);
        x -= value / slope;
      }
      points[i] = 0.5 * (1.0 + x);
      weights[i] = 1.0 / ((1.0 - x * x) * slope * slope);
    }
  }
};
template <int count>
inline const Gauss<count> gauss;

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

/// Strain and stress without eigenvalues, with R = (1 + s A)^-1, A = C - 1 = 2 G, and s from
/// 0 to 1 by Gauss' rule (Higham, section 11.5):
///     ln(1 + A) = int A R ds,    dE = int R dG R ds,    T : d2E = -4 int s tr(R T R dG R dG) ds.
template <int count>
struct Resolvents
{
  using Lanes = std::array<double, count>;

  Matrix F;               // deformation gradient
  std::array<Lanes, 6> R; // components (xx, yy, zz, xy, xz, yz)
  Sym strain;             // E

  explicit Resolvents(const Deformation& x) : F(x.F)
  {
    const Lanes &points = gauss<count>.points, &weights = gauss<count>.weights; // OpenMP of clang takes no binding
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
        S[k] += gauss<count>.weights[q] * X[k][q];
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
      const double w = gauss<count>.weights[q], first = 0.5 * w, second = -w * gauss<count>.points[q];
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
/// Strain of a point in small strain.
struct SmallStrain
{
  Sym strain;

  SmallStrain(const Gradients& g, const Gradients& u) : strain(asperity::strain(g, u)) {}

  bool valid() const { return true; }
  const Sym& nominal(const Sym& stress) const { return stress; }
  const Sym& cauchy(const Sym& stress) const { return stress; }
  Tangent tangent(const Sym&, const Moduli& C, const Sym& n) const { return nominal_tangent(C, n); }
};

/// Logarithmic strain of a point; nothing where it is inside out. By the norm of C - 1 the rule has 4, 8 or 32 points: strain
/// and force are exact to rounding for stretches from 0.27 to 3.7, the geometric part of the stiffness to 5e-13; beyond,
/// all is of a slightly other logarithm.
class FiniteStrain
{
  template <typename Kernel>
  auto with(Kernel&& kernel) const
  {
    switch (form.index())
    {
    case 1:
      return kernel(*std::get_if<1>(&form));
    case 2:
      return kernel(*std::get_if<2>(&form));
    default:
      return kernel(*std::get_if<3>(&form));
    }
  }

public:
  Sym strain{};

  FiniteStrain(const Gradients& g, const Gradients& u) : FiniteStrain(Deformation(g, u)) {}

  bool valid() const { return form.index() > 0; }

  /// First stress of Piola and Kirchhoff, on undeformed areas, from the stress T of the law.
  Matrix nominal(const Sym& T) const
  {
    return with([&](const auto& x) { return x.nominal(T); });
  }

  /// Cauchy's stress.
  Sym cauchy(const Sym& T) const
  {
    const Matrix P = nominal(T);
    Sym out;
    for (int i = 0; i < 3; ++i)
      for (int j = i; j < 3; ++j)
        out[voigt[i][j]] = (P[i][0] * F[j][0] + P[i][1] * F[j][1] + P[i][2] * F[j][2]) / det;
    return out;
  }

  /// Derivative of the nominal stress with respect to F, from T, the moduli of the law and their direction.
  Tangent tangent(const Sym& T, const Moduli& C, const Sym& n) const
  {
    return with([&](const auto& x) { return x.tangent(T, C, n); });
  }

private:
  Matrix F;
  double det;
  std::variant<std::monostate, Resolvents<4>, Resolvents<8>, Resolvents<32>> form;

  explicit FiniteStrain(const Deformation& x) : F(x.F), det(x.det)
  {
    if (!x.valid())
      return;
    const double squared = contract(x.A, x.A);
    if (squared < 0.03 * 0.03)
      strain = form.emplace<1>(x).strain;
    else if (squared < 0.36 * 0.36)
      strain = form.emplace<2>(x).strain;
    else
      strain = form.emplace<3>(x).strain;
  }
};

template <bool finite>
using Strain = std::conditional_t<finite, FiniteStrain, SmallStrain>;
} // namespace asperity
