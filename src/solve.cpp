#include "host/solve.hpp"

#include "bindings.hpp"

namespace flexspline::bindings {
namespace {

batch::Gram gram_from(const Array& high, const Array& low) {
  const auto width = static_cast<int>(high.shape(0));
  batch::Gram gram(width,
                   low.size() > 0 ? batch::Precision::double_double : batch::Precision::plain);
  if (high.ndim() != 2 || high.shape(1) != width || (low.size() > 0 && low.size() != high.size())) {
    throw std::invalid_argument("a Gram matrix is square, and its low part of the same shape");
  }
  gram.high.assign(high.data(), high.data() + high.size());
  gram.low.assign(low.data(), low.data() + low.size());
  return gram;
}

Array matrix(const std::vector<double>& values, int rows, int columns) {
  Array out({rows, columns});
  std::copy(values.begin(), values.end(), out.mutable_data());
  return out;
}

Array vector(const std::vector<double>& values) {
  return Array(static_cast<py::ssize_t>(values.size()), values.data());
}

}  // namespace

void bind_solve(py::module_& module) {
  using batch::Solution;
  py::class_<Solution>(module, "Solution", "Least squares from a Gram matrix.")
      .def_readonly("rank", &Solution::rank, "How many columns are independent.")
      .def_readonly("order", &Solution::order,
                    "Columns, pivots first: order[:rank] are the basic ones.")
      .def_readonly("residual_squares", &Solution::residual_squares, "|X b - y|², at least 0.")
      .def_readonly("condition", &Solution::condition,
                    "Of the basic columns scaled to length one (estimate).")
      .def_property_readonly(
          "coefficients", [](const Solution& s) { return vector(s.coefficients); },
          "Shape (columns,); 0 at dependent ones.")
      .def_property_readonly(
          "rotated_target", [](const Solution& s) { return vector(s.rotated_target); },
          "Qᵀ y of the basic columns, shape (rank,).")
      .def_property_readonly(
          "factor", [](const Solution& s) { return matrix(s.factor, s.rank, s.columns); },
          "Shape (rank, columns): XᵀX = factorᵀ factor.")
      .def_property_readonly(
          "dependence",
          [](const Solution& s) { return matrix(s.dependence, s.columns - s.rank, s.rank); },
          "Shape (columns - rank, rank): of which basic columns each dependent one is made.")
      .def_property_readonly(
          "double_is_enough", [](const Solution& s) { return batch::double_is_enough(s); },
          "Whether plain sums were good to 1e-9 here, without double-double.");
  module.def(
      "solve",
      [](const Array& high, const Array& low) { return batch::solve(gram_from(high, low)); },
      py::arg("high"), py::arg("low"),
      "Least squares from the sums of products of [X, y]; low is empty for plain sums.");
  module.def(
      "merge",
      [](const Array& high, const Array& low, const std::vector<std::size_t>& chosen) {
        const auto width = static_cast<int>(high.shape(1));
        const bool exact = low.shape(0) > 0;
        const auto precision = exact ? batch::Precision::double_double : batch::Precision::plain;
        const std::size_t entries =
            static_cast<std::size_t>(width) * static_cast<std::size_t>(width);
        batch::Gram sum(width, precision);
        for (const std::size_t block : chosen) {
          if (block >= static_cast<std::size_t>(high.shape(0))) {
            throw std::invalid_argument("there is no block " + std::to_string(block));
          }
          batch::Gram gram(width, precision);
          std::copy_n(high.data() + block * entries, entries, gram.high.begin());
          if (exact) std::copy_n(low.data() + block * entries, entries, gram.low.begin());
          sum += gram;
        }
        return py::make_tuple(matrix(sum.high, width, width),
                              matrix(sum.low, exact ? width : 0, exact ? width : 0));
      },
      py::arg("high"), py::arg("low"), py::arg("chosen"),
      "Sum of the chosen blocks' sums of products, exact where they are: (high, low).");
}

}  // namespace flexspline::bindings
