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

  Response respond(const Sym& strain, const State&) const
  {
    Response r;
    const double trace = strain[0] + strain[1] + strain[2];
    for (int i = 0; i < 6; ++i)
      r.stress[i] = 2.0 * mu * strain[i] + (i < 3 ? lambda * trace : 0.0);
    return r;
  }

  Moduli elastic() const { return {lambda, mu, 0.0}; }
  Moduli tangent(const Response&) const { return elastic(); }
  Moduli softening(const Response&) const { return {}; }
};
} // namespace asperity
