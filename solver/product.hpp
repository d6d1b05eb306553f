// Matrix times vector in single precision.
#pragma once

#include "cells.hpp"

namespace asperity
{
/// Add the product to the Python module.
void bind_product(nb::module_& m);
} // namespace asperity
