// Arrays from Python, all local to the rank, and the checks of their shapes that each kernel makes first.
//
// nanobind refuses another number type and another order of storage (TypeError); `expect` refuses another shape, and
// `check_range` numbers that point outside an array (ValueError).
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <algorithm>
#include <cstddef>
#include <initializer_list>
#include <stdexcept>
#include <string>

namespace asperity
{
namespace nb = nanobind;

template <typename T>
using Array = nb::ndarray<T, nb::c_contig, nb::device::cpu>;

/// Legal length of an axis: `least` entries, or more unless `exact`.
struct Extent
{
  std::size_t least;
  bool exact = true;

  Extent(std::size_t least, bool exact = true) : least(least), exact(exact) {}
  bool allows(std::size_t n) const { return exact ? n == least : n >= least; }
};

inline Extent at_least(std::size_t n)
{
  return {n, false};
}
inline Extent any()
{
  return {0, false};
}

/// More nodes than numbers of 32 bits can address.
constexpr std::size_t most_nodes = std::size_t{1} << 31;

/// Refuse an array of another shape.
template <typename T>
void expect(const char* name, const Array<T>& array, std::initializer_list<Extent> shape)
{
  bool right = array.ndim() == shape.size();
  for (std::size_t i = 0; right && i < shape.size(); ++i)
    right = shape.begin()[i].allows(array.shape(i));
  if (right)
    return;
  std::string has, wanted;
  for (std::size_t i = 0; i < array.ndim(); ++i)
    has += (i ? ", " : "") + std::to_string(array.shape(i));
  for (const Extent& extent : shape)
    wanted += (wanted.empty() ? "" : ", ")
              + (extent.exact ? std::to_string(extent.least)
                              : (extent.least ? "at least " + std::to_string(extent.least) : "any number"));
  throw std::invalid_argument(std::string(name) + " has shape (" + has + "), expected (" + wanted + ")");
}

/// Refuse numbers outside [0, end); returns one more than the greatest. Reads each entry.
inline std::size_t check_range(const char* name, const Array<const int>& array, std::size_t end)
{
  if (array.size() == 0)
    return 0;
  const auto [least, greatest] = std::minmax_element(array.data(), array.data() + array.size());
  if (*least < 0 || static_cast<std::size_t>(*greatest) >= end)
    throw std::invalid_argument(std::string(name) + " has entries from " + std::to_string(*least) + " to "
                                + std::to_string(*greatest) + ", expected 0 to " + std::to_string(end) + " less one");
  return static_cast<std::size_t>(*greatest) + 1;
}

/// Refuse a CSR graph with inconsistent parts; reads the ends only.
inline void expect_graph(const char* indptr_name, const Array<const int>& indptr, const char* indices_name,
                         const Array<const int>& indices)
{
  expect(indptr_name, indptr, {at_least(1)});
  const int first = indptr.data()[0], last = indptr.data()[indptr.shape(0) - 1];
  if (first != 0 || last < 0)
    throw std::invalid_argument(std::string(indptr_name) + " goes from " + std::to_string(first) + " to "
                                + std::to_string(last) + ", expected from 0 to the number of entries");
  expect(indices_name, indices, {static_cast<std::size_t>(last)});
}
} // namespace asperity
