// The period map of a mass on a contact, with its derivatives: a module of its own, asperity._period_map, which needs
// neither MPI nor SuiteSparse. A twin with SciPy's solve_ivp (tests/dynamics/twin.py) agrees with it.
//
//     u'' + 2 zeta g(u) u' + f(u) = F cos(s),  s = Omega tau
//
// The displacements are cut into cells. In each f is smooth, exp(cubic in ln(1 + u)) - rest or a cubic in u, and g is
// linear in u, or in the contact force. Steps of DOP853 (Hairer, Norsett & Wanner; the coefficients are SciPy's) use the
// formula of the cell in which they start, end at its edges, and the acceleration may jump there (saltation).
#include "arrays.hpp"

#include <array>
#include <cmath>
#include <limits>

namespace asperity
{
namespace
{
constexpr int stages = 12;
// row i: weights of the slopes 0 to i - 1 in the state of stage i
constexpr double A[stages][stages - 1] = {
    {0},
    {0.05260015195876773},
    {0.0197250569845379, 0.0591751709536137},
    {0.02958758547680685, 0, 0.08876275643042054},
    {0.2413651341592667, 0, -0.8845494793282861, 0.924834003261792},
    {0.037037037037037035, 0, 0, 0.17082860872947386, 0.12546768756682242},
    {0.037109375, 0, 0, 0.17025221101954405, 0.06021653898045596, -0.017578125},
    {0.03709200011850479, 0, 0, 0.17038392571223998, 0.10726203044637328, -0.015319437748624402,
     0.008273789163814023},
    {0.6241109587160757, 0, 0, -3.3608926294469414, -0.868219346841726, 27.59209969944671, 20.154067550477894,
     -43.48988418106996},
    {0.47766253643826434, 0, 0, -2.4881146199716677, -0.590290826836843, 21.230051448181193, 15.279233632882423,
     -33.28821096898486, -0.020331201708508627},
    {-0.9371424300859873, 0, 0, 5.186372428844064, 1.0914373489967295, -8.149787010746927, -18.52006565999696,
     22.739487099350505, 2.4936055526796523, -3.0467644718982196},
    {2.273310147516538, 0, 0, -10.53449546673725, -2.0008720582248625, -17.9589318631188, 27.94888452941996,
     -2.8589982771350235, -8.87285693353063, 12.360567175794303, 0.6433927460157636},
};
constexpr double B[stages] = {0.054293734116568765, 0, 0, 0, 0, 4.450312892752409, 1.8915178993145003,
                               -5.801203960010585, 0.3111643669578199, -0.1521609496625161, 0.20136540080403034,
                               0.04471061572777259};
constexpr double C[stages] = {0, 0.05260015195876773, 0.0789002279381516, 0.1183503419072274, 0.2816496580927726,
                               0.3333333333333333, 0.25, 0.3076923076923077, 0.6512820512820513, 0.6,
                               0.8571428571428571, 1.0};
constexpr double E5[stages] = {0.01312004499419488, 0, 0, 0, 0, -1.2251564463762044, -0.4957589496572502,
                               1.6643771824549864, -0.35032884874997366, 0.3341791187130175, 0.08192320648511571,
                               -0.022355307863886294};
constexpr double E3[stages] = {-0.18980075407240762, 0, 0, 0, 0, 4.450312892752409, 1.8915178993145003,
                               -5.801203960010585, -0.4226823213237919, -0.1521609496625161, 0.20136540080403034,
                               0.02265179219836082};

/// u and v; their derivatives with respect to the start, u and v, and to Omega (du, dv of each).
constexpr int size = 8;
using State = std::array<double, size>;
constexpr double infinite = std::numeric_limits<double>::infinity();

struct Cell
{
  double logarithmic, start, c0, c1, c2, c3, g0, g1; // f as above, g = g0 + g1 u
};

/// Values of a motion that the map returns, in this order.
struct Result
{
  State end{};
  std::array<double, 4> high{}, low{};      // extreme of u, and its derivatives
  std::array<double, 8> wave{};             // integrals of u cos s and u sin s, and their derivatives
  double damping = 0, loss = 0, lowest = 0; // integrals of g and of g v^2 over tau, phase of the low
  double error = 0, steps = 0;              // sum of the errors of steps, number of trials
};
constexpr std::size_t result_numbers = sizeof(Result) / sizeof(double);

struct Motion
{
  const double* edges;
  const Cell* cells;
  int count; // of edges
  double rest, of_force, zeta, limit, rtol;
  bool derivatives;
  double omega = 0, forcing = 0, grows = 0; // grows: derivative of F with respect to Omega
  Result out{};
  State y{}, next{};
  std::array<State, stages> stage{};
  std::array<State, stages + 1> k{}; // slopes of the stages, and at the end of the step
  double s = 0, local = 0;           // local: error of u and v in the last step
  int cell = 0;

  /// Integrate from the phase `begin` over a length; false where the motion escapes or the steps are too many.
  bool run(double begin, double length, double u, double v)
  {
    y = {u, v, 1, 0, 0, 1, 0, 0};
    s = begin;
    const auto at = std::upper_bound(edges, edges + count, u) - edges;
    cell = static_cast<int>(at > 0 && u == edges[at - 1] && v < 0 ? at - 1 : at);
    out = {};
    out.high = out.low = {u, 1, 0, 0};
    out.lowest = s;
    const double end = begin + length, most = 2e4 + std::min(1e3 * length / omega, 2e7), unit = std::min(1.0, omega);
    double h = std::min({length, 0.05, 0.05 * omega});
    slope(s, y, k[0]);
    for (out.steps = 1; out.steps < most && std::abs(y[0]) < limit; ++out.steps)
    {
      const bool last = s + h >= end - 1e-14 * std::max(1.0, end);
      const double step = last ? end - s : h, error = advance(step);
      // a step this short is taken as it is: where the stiffness is infinite, at contact loss, none meets the tolerance
      const bool shortest = step < 1e-12 * std::max(unit, s) && error < 1e300;
      if (!(error <= 1.0) && !shortest)
      {
        h = step * (error < 1e300 ? std::max(0.2, 0.9 * std::pow(error, -0.125)) : 0.1);
        if (h < 1e-14 * std::max(unit, s))
          return false;
        continue;
      }
      const double proposed = step * std::min(5.0, 0.9 * std::pow(std::max(error, 1e-12), -0.125));
      const bool whole = commit(step);
      if (whole && last)
      {
        extreme(y, s);
        out.end = y;
        return std::isfinite(y[0]) && std::isfinite(y[1]);
      }
      h = std::min(1.0, whole ? proposed : std::max(h, proposed));
    }
    return false;
  }

  /// Acceleration without forcing, -f - 2 zeta g v, its derivative with respect to u, and g.
  std::array<double, 3> acceleration(int i, double u, double v) const
  {
    const Cell& c = cells[i];
    double pull = 0, dpull = 0;
    if (c.logarithmic == 0)
    {
      pull = rest + c.c0 + u * (c.c1 + u * (c.c2 + u * c.c3));
      dpull = c.c1 + u * (2 * c.c2 + 3 * u * c.c3);
    }
    else if (const double z = 1 + u; z > 0)
    {
      const double t = std::log(z) - c.start;
      pull = std::exp(c.c0 + t * (c.c1 + t * (c.c2 + t * c.c3)));
      dpull = pull * (c.c1 + t * (2 * c.c2 + 3 * t * c.c3)) / z;
    }
    const double g = c.g0 + c.g1 * u + of_force * pull, dg = c.g1 + of_force * dpull;
    return {rest - pull - 2 * zeta * g * v, -dpull - 2 * zeta * dg * v, g};
  }

  /// Derivative of the state with respect to the phase.
  void slope(double phase, const State& x, State& to) const
  {
    const double wave = std::cos(phase), per = 1 / omega;
    const auto [unforced, a_u, g] = acceleration(cell, x[0], x[1]);
    const double a = unforced + forcing * wave, a_v = -2 * zeta * g;
    to[0] = x[1] * per;
    to[1] = a * per;
    if (!derivatives)
      return;
    for (int j = 2; j < size; j += 2)
    {
      to[j] = x[j + 1] * per;
      to[j + 1] = (a_u * x[j] + a_v * x[j + 1]) * per;
    }
    to[6] -= x[1] * per * per;
    to[7] += (grows * wave - a * per) * per;
  }

  /// A step of DOP853 to `next`, with the slope at its end in k[stages]; its error over the tolerance.
  double advance(double h)
  {
    const int n = derivatives ? size : 2;
    stage[0] = y;
    for (int i = 1; i < stages; ++i)
    {
      State& x = stage[i] = y;
      for (int j = 0; j < i; ++j)
        if (const double a = h * A[i][j]; a != 0)
          for (int m = 0; m < n; ++m)
            x[m] += a * k[j][m];
      slope(s + C[i] * h, x, k[i]);
    }
    next = y;
    State e3{}, e5{};
    for (int j = 0; j < stages; ++j)
      for (int m = 0; m < n; ++m)
      {
        next[m] += h * B[j] * k[j][m];
        e3[m] += h * E3[j] * k[j][m];
        e5[m] += h * E5[j] * k[j][m];
      }
    slope(s + h, next, k[stages]);
    const double fast = std::max(1.0, omega);
    double worst = 0, motion = 0;
    for (int m = 0; m < n; m += 2)
    {
      const auto norm = [&](const State& x) { return std::abs(x[m]) + std::abs(x[m + 1]) / fast; };
      const double larger = std::max({norm(y), norm(next), m == 6 ? motion / omega : 0});
      // not below the round-off of the force
      const double scale = std::max(larger * (m ? 30 * rtol : rtol), 1e-15 / (fast * fast));
      const auto square = [&](const State& x) {
        const double one = x[m] / scale, two = x[m + 1] / (scale * fast);
        return one * one + two * two;
      };
      const double five = square(e5), both = five + 0.01 * square(e3);
      if (both != both)
        return infinite;
      const double error = both > 0 ? five / std::sqrt(2 * both) : 0;
      motion = m ? motion : larger;
      local = m ? local : error * scale;
      worst = std::max(worst, error);
    }
    return worst;
  }

  /// Where a function, of opposite signs at a and b, is zero.
  template <typename Function>
  static double zero(const Function& at, double a, double b)
  {
    const bool rising = at(b) > 0;
    while (b - a > 1e-12)
      ((at(0.5 * (a + b)) > 0) == rising ? b : a) = 0.5 * (a + b);
    return 0.5 * (a + b);
  }

  /// Take the step, or its part up to the edge of the cell; whether it is the whole step.
  bool commit(double h)
  {
    constexpr double parts = 4;
    // quintic of u over [0, 1] through the ends of the step
    const double whole = next[0], u = y[0], v = h * k[0][0], w = 0.5 * h * h * k[0][1] / omega;
    const double p = whole - u - v - w, q = h * k[stages][0] - v - 2 * w,
                 r = 0.5 * h * h * k[stages][1] / omega - w;
    const double c3 = 10 * p - 4 * q + r, c4 = -15 * p + 7 * q - 2 * r, c5 = 6 * p - 3 * q + r;
    const auto value = [&](double x) { return u + x * (v + x * (w + x * (c3 + x * (c4 + x * c5)))); };
    const auto speed = [&](double x) { return v + x * (2 * w + x * (3 * c3 + x * (4 * c4 + x * 5 * c5))); };
    bool again = false; // the step, after shorter ones
    for (double a = 0, b; a < 1; a = b)
    {
      b = (std::floor(parts * a) + 1) / parts;
      const bool turn = (speed(a) > 0) != (speed(b) > 0);
      b = turn ? zero(speed, a, b) : b;
      const double to = b < 1 ? value(b) : whole, near = 1e-3 * std::abs(to);
      const int sign = speed(0.5 * (a + b)) > 0 ? 1 : -1, beyond = sign > 0 ? cell : cell - 1;
      const double edge = beyond >= 0 && beyond < count ? edges[beyond] : sign * infinite;
      const auto passed = [&](double x) { return (value(x) - edge) * sign; };
      if ((to - edge) * sign > 1e-15 * std::max(1.0, std::abs(edge))) // not by round-off, to turn at the edge
      {
        reach(h, passed(a) >= 0 ? a : zero(passed, a, b), edge, sign);
        return false;
      }
      if (turn && (to > out.high[0] - near || to < out.low[0] + near))
      {
        advance(b * h);
        next[0] -= 0.5 * next[1] * next[1] / (omega * k[stages][1]);
        extreme(next, s + b * h);
        again = true;
      }
    }
    if (again)
      advance(h);
    add(h);
    return true;
  }

  /// Step to the edge, near the fraction `at` of h, and into the cell beyond.
  void reach(double h, double at, double edge, int sign)
  {
    double part = at * h;
    for (int i = 0; i < 4 && part > 1e-13 * h; ++i)
    {
      advance(part);
      const double off = edge - next[0], moved = next[1] / omega;
      if (!(std::abs(off) > 1e-7 * std::abs(moved) * h) || !(moved * sign > 0))
        break;
      part = std::min(std::max(part + off / moved, 0.0), h);
    }
    if (part > 1e-13 * h)
      add(part);
    const double u = y[0], v = y[1];
    extreme(y, s);
    const double jump = acceleration(cell + sign, edge, v)[0] - acceleration(cell, edge, v)[0];
    if (jump != 0 && std::abs(u - edge) < 0.1 * std::abs(v) * h)
    {
      for (int m = 2; m < size; m += 2)
        y[m + 1] += jump / v * y[m];
      y[1] += jump / v * (u - edge);
    }
    cell += sign;
    slope(s, y, k[0]);
  }

  /// Accept the step, and add to the integrals over the motion.
  void add(double h)
  {
    for (int j = 0; j < stages; ++j)
    {
      const State& x = stage[j];
      const double phase = s + C[j] * h, c = h * B[j] * std::cos(phase), d = h * B[j] * std::sin(phase);
      for (int m = 0; m < 4; ++m)
      {
        out.wave[m] += c * x[2 * m];
        out.wave[4 + m] += d * x[2 * m];
      }
      const double g = h * B[j] * acceleration(cell, x[0], x[1])[2] / omega;
      out.damping += g;
      out.loss += g * x[1] * x[1];
    }
    out.error += local;
    y = next;
    s += h;
    k[0] = k[stages];
  }

  /// Compare the largest and the smallest displacement with those of a state near a turning point.
  void extreme(const State& x, double phase)
  {
    if (x[0] > out.high[0])
      out.high = {x[0], x[2], x[4], x[6]};
    if (x[0] < out.low[0])
    {
      out.low = {x[0], x[2], x[4], x[6]};
      out.lowest = phase;
    }
  }
};

/// Map `lanes` (n, 7): u, v, Omega, F, dF/dOmega, phase at the start, length in s; NaN, except the number
/// of steps, for a motion that escapes or takes too many.
void period_map(const Array<const double>& edges, const Array<const double>& cells, double rest, double of_force,
                double zeta, double limit, double rtol, bool derivatives, const Array<const double>& lanes,
                const Array<double>& out)
{
  constexpr std::size_t cell_numbers = sizeof(Cell) / sizeof(double);
  expect("edges", edges, {any()});
  expect("cells", cells, {edges.shape(0) + 1, cell_numbers});
  expect("lanes", lanes, {any(), 7});
  expect("out", out, {lanes.shape(0), result_numbers});
  Motion motion{edges.data(), reinterpret_cast<const Cell*>(cells.data()), static_cast<int>(edges.shape(0)),
                rest, of_force, zeta, limit, rtol, derivatives};
  for (std::size_t i = 0; i < lanes.shape(0); ++i)
  {
    const double* lane = lanes.data() + 7 * i;
    double* to = out.data() + i * result_numbers;
    motion.omega = lane[2];
    motion.forcing = lane[3];
    motion.grows = lane[4];
    if (motion.run(lane[5], lane[6], lane[0], lane[1]))
      std::copy_n(reinterpret_cast<const double*>(&motion.out), result_numbers, to);
    else
      std::fill_n(to, result_numbers, std::numeric_limits<double>::quiet_NaN());
    to[result_numbers - 1] = motion.out.steps;
  }
}
} // namespace
} // namespace asperity

using namespace asperity;
using namespace nb::literals;

NB_MODULE(_period_map, m)
{
  nb::set_leak_warnings(false); // as in module.cpp
  m.doc() = "The period map of a mass on a contact.";
  m.def("period_map", &period_map, "edges"_a, "cells"_a, "rest"_a, "of_force"_a, "zeta"_a, "limit"_a, "rtol"_a,
        "derivatives"_a, "lanes"_a, nb::arg("out").noconvert(), nb::call_guard<nb::gil_scoped_release>());
}
