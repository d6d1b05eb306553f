// The material laws that the kernels know: the one place where a law is chosen.
#pragma once

#include "elastic.hpp"
#include "j2.hpp"

#include <utility>
#include <variant>

namespace asperity
{
using Law = std::variant<Elastic, J2>;

/// Call `kernel(law)` with the law in use; each law has its own compiled kernel.
template <typename Kernel>
decltype(auto) with_law(const Law& law, Kernel&& kernel)
{
  return std::visit(
      [&]<MaterialLaw L>(const L& chosen) -> decltype(auto) { return std::forward<Kernel>(kernel)(chosen); }, law);
}
} // namespace asperity
