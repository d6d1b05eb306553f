#include "size_field.hpp"

#include <cmath>

namespace asperity
{
SizeField::SizeField(const Array<const double>& sizes, const Array<const double>& distances,
                     std::array<double, 3> window, double growth, double layer, double h_max, bool periodic)
    : sizes_(sizes), distances_(distances), window_(window), growth_(growth), layer_(layer), h_max_(h_max),
      periodic_(periodic)
{
  expect("sizes", sizes, {at_least(1)});
  expect("distances", distances, {at_least(2), at_least(2), sizes.shape(0)});
  expect("distances", distances, {distances.shape(0), distances.shape(0), sizes.shape(0)});
}

double SizeField::at(double x, double y, double depth) const
{
  const auto [x0, y0, side] = window_;
  const std::size_t n = distances_.shape(0), levels = sizes_.shape(0);
  // nearbyint rounds halves to even, as Python does
  if (periodic_) // the image next to the window
  {
    x -= std::nearbyint(x - x0 - 0.5 * side);
    y -= std::nearbyint(y - y0 - 0.5 * side);
  }
  const double inside_x = std::min(std::max(x, x0), x0 + side);
  const double inside_y = std::min(std::max(y, y0), y0 + side);
  const double scale = static_cast<double>(n - 1) / side;
  const auto row = static_cast<std::size_t>(std::nearbyint((inside_y - y0) * scale));
  const auto column = static_cast<std::size_t>(std::nearbyint((inside_x - x0) * scale));
  const double* nearest = distances_.data() + (row * n + column) * levels;
  // in extended precision, for Python's hypot is rounded correctly
  const auto beyond = static_cast<double>(std::hypot(static_cast<long double>(x - inside_x), y - inside_y));
  double size = h_max_;
  for (std::size_t k = 0; k < levels; ++k)
  {
    const double own = sizes_.data()[k], d = nearest[k] + beyond;
    const double farther = std::max(std::sqrt(d * d + depth * depth) - layer_ * own, 0.0);
    size = std::min(size, own + growth_ * farther);
  }
  return size;
}
} // namespace asperity
