// Linear isotropic elasticity.
#pragma once

#include "law.hpp"

namespace asperity
{
struct Elastic
{
  double lambda, mu; // Lame moduli [force/length^2]

  struct Response
  {
    Sym stress;
    static constexpr State state{};
    static constexpr Sym direction{};
    static constexpr bool plastic = false;
  };

  using Trial = Sym; // the strain

  Trial trial(const Sym& strain, const State&) const { return strain; }

  Response respond(const Trial& strain, double dilatation, const State&, double) const
  {
    Response r;
    for (int i = 0; i < 6; ++i)
      r.stress[i] = 2.0 * mu * strain[i] + (i < 3 ? lambda * dilatation : 0.0);
    return r;
  }

  Moduli elastic() const { return {lambda, mu, 0.0}; }
  Moduli tangent(const Response&) const { return elastic(); }
  Moduli softening(const Response&) const { return {}; }
};
} // namespace asperity
