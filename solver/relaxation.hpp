// Volumetric strain within a cell that flows: the points of a second-order tetrahedron cannot all keep their volume in
// plastic flow, it locks. So flow relaxes what they differ by, where the pressures differ by more than a threshold.
//
// Let d be the volumetric strain of a point less the mean over its cell and less the permanent part e of earlier steps, D
// its root mean square, x that of an increment de, G the mean increment of the plastic strain of the cell, K the bulk
// modulus, S and T two stresses. The cell stores K/2 |d - de|^2 and spends T x + S x^2/(2 G): without flow there is no
// increment, and with it x = R/K (1 - m) along d, R = <K D - T>, m = 1/(1 + K G/S). What is left falls with G and so adds
// the relief (R m)^2/(2 S) to the stress that drives the flow. Stored and spent are jointly convex: the step has the
// potential, the symmetric tangent and the bounds of energy of associative plasticity, and nothing switches. K D is of the
// order of h where the mesh resolves the pressure: there the element is the usual one.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

namespace asperity
{
constexpr std::size_t most_points = 16; // of the quadrature of a cell

/// S and T [force/length^2]; where T is infinite nothing relaxes.
struct Relaxation
{
  double spent, threshold;
};

/// Flow of a cell in a step: the points are added, then `solve` finds what all of them have in common.
struct CellFlow
{
  double flow = 0.0;   // G
  double kept = 1.0;   // part of d that is left
  double relief = 0.0; // [force/length^2]
  // of the tangent: derivatives of `kept` with respect to G and D^2/2, of the relief to G, and the plastic strain of the
  // cell by a relief at all points that flow
  double kept_slope = 0.0, kept_curvature = 0.0, relief_slope = 0.0, softness = 0.0;
  double volume = 0.0;

  /// Add a point: its volumetric strain, the permanent part, and the excess of its stress over the yield stress.
  void add(double dilatation, double permanent, double excess, double weight)
  {
    own[count] = dilatation - permanent;
    before[count] = permanent;
    over[count] = excess;
    weights[count++] = weight;
    volume += weight;
  }

  /// Find the flow.
  ///
  /// Args: stress by which the excess falls with the plastic strain, K, S and T
  void solve(double resistance, double bulk, const Relaxation& relaxation)
  {
    double mean = 0.0, permanent = 0.0, squares = 0.0, greatest = over[0];
    for (std::size_t q = 0; q < count; ++q)
    {
      mean += weights[q] * own[q];
      permanent += weights[q] * before[q];
      greatest = std::max(greatest, over[q]);
    }
    mean /= volume;
    permanent /= volume; // a history that was extrapolated point by point has one
    for (std::size_t q = 0; q < count; ++q)
    {
      own[q] -= mean;
      before[q] -= permanent;
      squares += weights[q] * own[q] * own[q];
    }
    squares /= volume;
    const double rate = bulk / relaxation.spent;
    const double size = std::sqrt(squares), beyond = std::max(bulk * size - relaxation.threshold, 0.0); // D, R
    const double first = 0.5 * beyond * beyond / relaxation.spent;
    double m = 1.0;
    relief = first;
    relief_slope = -2.0 * rate * first;
    const int most = greatest + first > 0.0 ? 100 : 0; // else nothing flows
    for (int i = 0; i < most; ++i) // Newton's method from below on a concave function: monotone
    {
      double driven = 0.0, flowing = 0.0;
      for (std::size_t q = 0; q < count; ++q)
        if (over[q] + relief > 0.0)
        {
          driven += weights[q] * (over[q] + relief);
          flowing += weights[q];
        }
      softness = flowing / (resistance * volume);
      relief_slope = -2.0 * rate * m * relief;
      const double step = (driven / (resistance * volume) - flow) / (1.0 - softness * relief_slope);
      if (!(step > 1e-16 * flow))
        break;
      flow += step;
      m = 1.0 / (1.0 + rate * flow);
      relief = first * m * m;
    }
    if (!(beyond > 0.0))
      return;
    const double part = beyond / (bulk * size), lost = rate * flow * m; // 1 - m
    kept = 1.0 - part * lost;
    kept_slope = -part * rate * m * m;
    kept_curvature = -lost * relaxation.threshold / (bulk * size * squares);
  }

  /// Whether flow changes the volumetric strains of the cell.
  bool relaxes() const { return flow > 0.0 && kept_slope != 0.0; }
  /// Volumetric strain of a point less its permanent part, less the mean of both.
  double deviation(std::size_t q) const { return own[q]; }
  /// The permanent part after the step.
  double permanent(std::size_t q) const { return before[q] + (1.0 - kept) * own[q]; }

private:
  std::size_t count = 0;
  std::array<double, most_points> own, before, over, weights;
};
} // namespace asperity
