// Element size around the contact, which gmsh asks for point by point; see asperity/mesh/size_field.py. A twin in Python
// (tests/mesh/test_size_field.py) gives the same bits.
#pragma once

#include "arrays.hpp"

#include <array>

namespace asperity
{
class SizeField
{
public:
  /// sizes (K,), distances (n, n, K), window x0, y0 and side: as in Python, all in units of L.
  SizeField(const Array<const double>& sizes, const Array<const double>& distances, std::array<double, 3> window,
            double growth, double layer, double h_max, bool periodic);

  /// Size at a point `depth` below the mean plane of the top.
  double at(double x, double y, double depth) const;

private:
  Array<const double> sizes_, distances_;
  std::array<double, 3> window_;
  double growth_, layer_, h_max_;
  bool periodic_;
};
} // namespace asperity
