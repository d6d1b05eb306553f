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

struct Cell
{
  double logarithmic, start, c0, c1, c2, c3, g0, g1; // f as above, g = g0 + g1 u
};
constexpr std::size_t cell_numbers = 8;

/// Values of a motion that the map returns, in this order.
struct Result
{
  State end{};
  std::array<double, 4> high{}, low{};           // extreme of u, and its derivatives
  std::array<double, 8> wave{};                  // integrals of u cos s and u sin s, and their derivatives
  double damping = 0, loss = 0, lowest = 0;      // integrals of g and of g v^2 over tau, and the phase of the low
  double error = 0, steps = 0;                   // sum of the errors of steps, number of trials
};
constexpr std::size_t result_numbers = sizeof(Result) / sizeof(double);

class Motion
{
public:
  const double* edges;
  const Cell* cells;
  int count; // of edges
  double rest, of_force, zeta, limit, rtol;
  bool derivatives;
  double omega, forcing, grows; // grows: derivative of F with respect to Omega

  /// Integrate from the phase s over a length; false where the motion escapes or the steps are too many.
  bool run(double s, double length, double u, double v, Result& out)
  {
    y_ = {u, v, 1, 0, 0, 1, 0, 0};
    s_ = s;
    cell_ = cell_of(u, v);
    out.high = out.low = {u, 1, 0, 0};
    out.lowest = s;
    const double end = s + length;
    double h = std::min({length, 0.05, 0.05 * omega});
    slope(cell_, s_, y_, k_[0]);
    const double most = 2e4 + 1e3 * length / omega;
    for (out.steps = 1; out.steps < most; ++out.steps)
    {
      if (!(std::abs(y_[0]) < limit))
        return false;
      const bool last = s_ + h >= end - 1e-14 * std::max(1.0, end);
      const double step = last ? end - s_ : h;
      const double error = advance(step);
      // a step this short is taken as it is: where the stiffness is infinite, at contact loss, none meets the tolerance
      const bool shortest = step < 1e-12 * std::max(1.0, s_) && error < 1e300;
      if (!(error <= 1.0) && !shortest)
      {
        h = step * (error < 1e300 ? std::max(0.2, 0.9 * std::pow(error, -0.125)) : 0.1);
        if (h < 1e-14 * std::max(1.0, s_))
          return false;
        continue;
      }
      const double proposed = step * std::min(5.0, 0.9 * std::pow(std::max(error, 1e-12), -0.125));
      const int side = commit(step, out);
      if (!side && last)
      {
        extreme(y_, s_, out);
        out.end = y_;
        return std::isfinite(y_[0]) && std::isfinite(y_[1]);
      }
      h = std::min(1.0, side ? std::max(h, proposed) : proposed);
    }
    return false;
  }

private:
  State y_{}, next_{};
  std::array<State, stages> stage_{};
  std::array<State, stages + 1> k_{}; // slopes of the stages, and at the end of the step
  double s_ = 0, error_ = 0; // error_: of u and v in the last step
  int cell_ = 0;

  int cell_of(double u, double v) const
  {
    const auto at = std::upper_bound(edges, edges + count, u) - edges;
    return static_cast<int>(at > 0 && u == edges[at - 1] && v < 0 ? at - 1 : at);
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

  /// Derivative of the state with respect to s.
  void slope(int i, double s, const State& y, State& out) const
  {
    const double wave = std::cos(s), per = 1 / omega;
    const auto [unforced, a_u, g] = acceleration(i, y[0], y[1]);
    const double a = unforced + forcing * wave, a_v = -2 * zeta * g;
    out[0] = y[1] * per;
    out[1] = a * per;
    if (!derivatives)
      return;
    for (int j = 2; j < size; j += 2)
    {
      out[j] = y[j + 1] * per;
      out[j + 1] = (a_u * y[j] + a_v * y[j + 1]) * per;
    }
    out[6] -= y[1] * per * per;
    out[7] += (grows * wave - a * per) * per;
  }

  /// A step of DOP853 to `next_`, with the slope at its end in k_[stages]; its error over the tolerance.
  double advance(double h)
  {
    const int n = derivatives ? size : 2;
    stage_[0] = y_;
    for (int i = 1; i < stages; ++i)
    {
      State& y = stage_[i] = y_;
      for (int j = 0; j < i; ++j)
        if (const double a = h * A[i][j]; a != 0)
          for (int m = 0; m < n; ++m)
            y[m] += a * k_[j][m];
      slope(cell_, s_ + C[i] * h, y, k_[i]);
    }
    next_ = y_;
    State e3{}, e5{};
    for (int j = 0; j < stages; ++j)
      for (int m = 0; m < n; ++m)
      {
        next_[m] += h * B[j] * k_[j][m];
        e3[m] += h * E3[j] * k_[j][m];
        e5[m] += h * E5[j] * k_[j][m];
      }
    slope(cell_, s_ + h, next_, k_[stages]);
    const double fast = std::max(1.0, omega);
    double worst = 0, motion = 0;
    for (int m = 0; m < n; m += 2)
    {
      const double before = std::abs(y_[m]) + std::abs(y_[m + 1]) / fast;
      const double after = std::abs(next_[m]) + std::abs(next_[m + 1]) / fast;
      const double larger = std::max({before, after, m == 6 ? motion / omega : 0});
      // not below the round-off of the force
      const double scale = std::max(larger * (m ? 30 * rtol : rtol), 1e-15 / (fast * fast));
      motion = m ? motion : larger;
      double three = 0, five = 0;
      for (int i = 0; i < 2; ++i)
      {
        const double unit = scale * (i ? fast : 1);
        three += e3[m + i] * e3[m + i] / (unit * unit);
        five += e5[m + i] * e5[m + i] / (unit * unit);
      }
      const double both = five + 0.01 * three;
      if (both != both)
        return std::numeric_limits<double>::infinity();
      const double error = both > 0 ? five / std::sqrt(2 * both) : 0;
      error_ = m ? error_ : error * scale;
      worst = std::max(worst, error);
    }
    return worst;
  }

  /// Coefficients of the quintic of u over [0, 1] through the ends of the step.
  std::array<double, 6> quintic(double h) const
  {
    const double u = y_[0], v = h * k_[0][0], a = 0.5 * h * h * k_[0][1] / omega;
    const double p = next_[0] - u - v - a, q = h * k_[stages][0] - v - 2 * a,
                 r = 0.5 * (h * h * k_[stages][1] / omega - 2 * a);
    return {u, v, a, 10 * p - 4 * q + r, -15 * p + 7 * q - 2 * r, 6 * p - 3 * q + r};
  }

  static double value(const std::array<double, 6>& c, double x)
  {
    return c[0] + x * (c[1] + x * (c[2] + x * (c[3] + x * (c[4] + x * c[5]))));
  }

  static double speed(const std::array<double, 6>& c, double x)
  {
    return c[1] + x * (2 * c[2] + x * (3 * c[3] + x * (4 * c[4] + x * 5 * c[5])));
  }

  /// Zero between a and b, where the function has opposite signs.
  template <typename Function>
  static double zero(const Function& at, double a, double b)
  {
    const bool rising = at(b) > 0;
    for (int i = 0; i < 50 && b - a > 1e-12; ++i)
    {
      const double middle = 0.5 * (a + b);
      ((at(middle) > 0) == rising ? b : a) = middle;
    }
    return 0.5 * (a + b);
  }

  /// Take the step, or its part up to the edge of the cell: -1 or 1 for the edge that it reached, else 0.
  int commit(double h, Result& out)
  {
    const auto path = quintic(h);
    const double low = cell_ > 0 ? edges[cell_ - 1] : -std::numeric_limits<double>::infinity();
    const double high = cell_ < count ? edges[cell_] : std::numeric_limits<double>::infinity();
    std::array<double, 6> turns{};
    int found = 0;
    constexpr int parts = 4;
    for (int i = 0; i < parts; ++i)
    {
      const double a = static_cast<double>(i) / parts, b = static_cast<double>(i + 1) / parts;
      if ((speed(path, a) > 0) != (speed(path, b) > 0))
        turns[++found] = zero([&](double x) { return speed(path, x); }, a, b);
    }
    turns[++found] = 1;
    const double whole = next_[0];
    bool again = false; // the step, after shorter ones
    for (int i = 0; i < found; ++i)
    {
      const double a = turns[i], b = turns[i + 1], to = b < 1 ? value(path, b) : whole;
      const int sign = speed(path, 0.5 * (a + b)) > 0 ? 1 : -1;
      const double edge = sign > 0 ? high : low;
      if ((to - edge) * sign > 0)
      {
        const double at = (value(path, a) - edge) * sign >= 0
                              ? a
                              : zero([&](double x) { return (value(path, x) - edge) * sign; }, a, b);
        reach(h, at, edge, sign, out);
        return sign;
      }
      if (b < 1 && (to > out.high[0] - 1e-3 * std::abs(to) || to < out.low[0] + 1e-3 * std::abs(to)))
      {
        advance(b * h);
        next_[0] -= 0.5 * next_[1] * next_[1] / (omega * k_[stages][1]);
        extreme(next_, s_ + b * h, out);
        again = true;
      }
    }
    if (again)
      advance(h);
    add(h, out);
    return 0;
  }

  /// Step to the edge, near the fraction `at` of h, and into the cell beyond.
  void reach(double h, double at, double edge, int sign, Result& out)
  {
    double part = at * h;
    for (int i = 0; i < 4 && part > 1e-13 * h; ++i)
    {
      advance(part);
      const double off = edge - next_[0], moved = next_[1] / omega;
      if (!(std::abs(off) > 1e-7 * std::abs(moved) * h) || !(moved * sign > 0))
        break;
      part = std::min(std::max(part + off / moved, 0.0), h);
    }
    if (part > 1e-13 * h)
      add(part, out);
    const double u = y_[0], v = y_[1];
    extreme(y_, s_, out);
    const double jump = acceleration(cell_ + sign, edge, v)[0] - acceleration(cell_, edge, v)[0];
    if (jump != 0 && std::abs(u - edge) < 0.1 * std::abs(v) * h)
    {
      for (int m = 2; m < size; m += 2)
        y_[m + 1] += jump / v * y_[m];
      y_[1] += jump / v * (u - edge);
    }
    cell_ += sign;
    slope(cell_, s_, y_, k_[0]);
  }

  /// Accept the step, and add to the integrals over the motion.
  void add(double h, Result& out)
  {
    for (int j = 0; j < stages; ++j)
    {
      if (B[j] == 0)
        continue;
      const State& y = stage_[j];
      const double s = s_ + C[j] * h, c = h * B[j] * std::cos(s), d = h * B[j] * std::sin(s);
      for (int m = 0; m < 4; ++m)
      {
        out.wave[m] += c * y[m ? 2 * m : 0];
        out.wave[4 + m] += d * y[m ? 2 * m : 0];
      }
      const double g = h * B[j] * acceleration(cell_, y[0], y[1])[2] / omega;
      out.damping += g;
      out.loss += g * y[1] * y[1];
    }
    out.error += error_;
    y_ = next_;
    s_ += h;
    k_[0] = k_[stages];
  }

  /// Compare the largest and the smallest displacement with those of a state near a turning point.
  void extreme(const State& y, double s, Result& out) const
  {
    if (y[0] > out.high[0])
      out.high = {y[0], y[2], y[4], y[6]};
    if (y[0] < out.low[0])
    {
      out.low = {y[0], y[2], y[4], y[6]};
      out.lowest = s;
    }
  }
};

/// Map `lanes` (n, 7): u, v, Omega, F, dF/dOmega, phase at the start, length in s; NaN, but for the number
/// of steps, for a motion that escapes or takes too many.
void period_map(const Array<const double>& edges, const Array<const double>& cells, double rest, double of_force,
                double zeta, double limit, double rtol, bool derivatives,
                const Array<const double>& lanes, const Array<double>& out)
{
  expect("edges", edges, {any()});
  expect("cells", cells, {edges.shape(0) + 1, cell_numbers});
  expect("lanes", lanes, {any(), 7});
  expect("out", out, {lanes.shape(0), result_numbers});
  static_assert(sizeof(Cell) == cell_numbers * sizeof(double));
  Motion motion;
  motion.edges = edges.data();
  motion.cells = reinterpret_cast<const Cell*>(cells.data());
  motion.count = static_cast<int>(edges.shape(0));
  motion.rest = rest;
  motion.of_force = of_force;
  motion.zeta = zeta;
  motion.limit = limit;
  motion.rtol = rtol;
  motion.derivatives = derivatives;
  for (std::size_t i = 0; i < lanes.shape(0); ++i)
  {
    const double* lane = lanes.data() + 7 * i;
    motion.omega = lane[2];
    motion.forcing = lane[3];
    motion.grows = lane[4];
    Result result;
    double* to = out.data() + i * result_numbers;
    if (motion.run(lane[5], lane[6], lane[0], lane[1], result))
      std::copy_n(reinterpret_cast<const double*>(&result), result_numbers, to);
    else
      std::fill_n(to, result_numbers, std::numeric_limits<double>::quiet_NaN());
    to[result_numbers - 1] = result.steps;
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
