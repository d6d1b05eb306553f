// Linear isotropic elasticity.
#pragma once

#include "law.hpp"

namespace asperity
{
struct Elastic
{
  double lambda, mu; // Lame moduli [force/length^2]

  struct State // none
  {
  };

  struct Response
  {
    Sym stress;
    State state;
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

  Moduli tangent() const { return {lambda, mu, 0.0}; }
};
} // namespace asperity
