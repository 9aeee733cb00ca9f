/// What the files of the bindings share. No arithmetic here.
#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <cstddef>
#include <optional>
#include <span>
#include <stdexcept>
#include <vector>

#include "host/samples.hpp"

namespace flexspline::bindings {

namespace py = pybind11;

/// A contiguous double array, borrowed for the length of a call.
using Array = py::array_t<double, py::array::c_style | py::array::forcecast>;

void bind_catalogue(py::module_& module);
void bind_design(py::module_& module);
void bind_screening(py::module_& module);
void bind_solve(py::module_& module);
void bind_filters(py::module_& module);
void bind_estimators(py::module_& module);
void bind_joint(py::module_& module);
void bind_stages(py::module_& module);
void bind_sensor(py::module_& module);
void bind_full_range(py::module_& module);
void bind_simulation(py::module_& module);
void bind_forward(py::module_& module);

/// Refuses what a caller may not give.
inline void require(bool good, const char* what) {
  if (!good) throw std::invalid_argument(what);
}

/// Channels by name, held together with the arrays that they point into.
struct Borrowed {
  batch::Channels channels;
  std::vector<Array> arrays;
};
Borrowed borrow(const py::dict& columns, py::ssize_t size);

/// Refuses coefficients that are not as many as columns.
void require_size(std::span<const double> coefficients, std::size_t columns, bool may_be_empty);

/// A column of the same length, or null for None.
const double* column_or_null(const std::optional<Array>& array, std::size_t size, const char* name);

}  // namespace flexspline::bindings
