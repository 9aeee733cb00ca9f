#include "bindings.hpp"
#include "host/filtered.hpp"
#include "host/local_fit.hpp"

namespace flexspline::bindings {
namespace {

using Strided = py::array_t<double>;
using Indices = py::array_t<py::ssize_t, py::array::c_style | py::array::forcecast>;

/// Rows 0, every, 2 every … of each column, filtered, into columns that lie side by side in memory.
void whiten(const Strided& columns, const Array& whitening, std::size_t every, Strided& out) {
  require(columns.ndim() == 2 && out.ndim() == 2 && out.shape(1) == columns.shape(1),
          "columns, and what they are filtered into, are as many");
  require(whitening.size() > 0 && every > 0, "a filter has a weight, and a step");
  const auto rows = static_cast<std::size_t>(columns.shape(0));
  const std::size_t kept = (rows + every - 1) / every;
  const auto terms = static_cast<std::size_t>(whitening.size());
  const auto count = static_cast<std::size_t>(out.shape(0));
  require(count + terms == kept + 1, "a filter leaves its order of rows out");
  require(out.strides(0) == sizeof(double) || count < 2,
          "rows of a filtered column are neighbours");
  const auto from = columns.unchecked<2>();
  auto to = out.mutable_unchecked<2>();
  const py::gil_scoped_release release;
  std::vector<double> signal(kept);
  for (py::ssize_t k = 0; k < from.shape(1) && count > 0; ++k) {
    for (std::size_t i = 0; i < kept; ++i) {
      signal[i] = from(static_cast<py::ssize_t>(i * every), k);
    }
    const std::span<const double> weights{whitening.data(), terms};
    batch::convolve(weights, signal.data(), count, to.mutable_data(0, k));
  }
}

/// Weights, their columns and where rows begin, as a sparse matrix by rows holds them.
py::tuple local_weights(const Array& time, const Indices& rows, const Indices& first,
                        const Indices& last, const Array& sigma, std::size_t degree,
                        std::size_t derivative) {
  const auto size = static_cast<std::size_t>(time.size());
  const auto count = static_cast<std::size_t>(rows.size());
  require(degree <= batch::most_degree && derivative <= degree,
          "a polynomial has a degree of four at most, and no derivative above it");
  require(first.size() == rows.size() && last.size() == rows.size() && sigma.size() == rows.size(),
          "each row has a window and a width");
  std::vector<batch::LocalWindow> windows;
  Indices ends(static_cast<py::ssize_t>(count) + 1);
  py::ssize_t* const end = ends.mutable_data();
  end[0] = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const batch::LocalWindow window{static_cast<std::size_t>(rows.data()[i]),
                                    static_cast<std::size_t>(first.data()[i]),
                                    static_cast<std::size_t>(last.data()[i]), sigma.data()[i]};
    require(window.row < size && window.first < window.last && window.last <= size,
            "a row and its window lie within the run");
    windows.push_back(window);
    end[i + 1] = end[i] + static_cast<py::ssize_t>(window.last - window.first);
  }
  Array values(end[count]);
  Indices columns(end[count]);
  double* const value = values.mutable_data();
  py::ssize_t* const column = columns.mutable_data();
  {
    const py::gil_scoped_release release;
    const std::span<const double> times{time.data(), size};
    for (std::size_t i = 0; i < count; ++i) {
      batch::local_weights(times, windows[i], degree, derivative, value + end[i]);
      for (py::ssize_t k = end[i]; k < end[i + 1]; ++k) {
        column[k] = static_cast<py::ssize_t>(windows[i].first) + k - end[i];
      }
    }
  }
  return py::make_tuple(values, columns, ends);
}

}  // namespace

void bind_filters(py::module_& module) {
  module.def(
      "whiten", &whiten, py::arg("columns"), py::arg("whitening"), py::arg("every"),
      py::arg("out").noconvert(),
      "Filter one row of `every` of columns (N, C) into `out`, columns of neighbouring rows.");
  module.def("local_weights", &local_weights, py::arg("time"), py::arg("rows"), py::arg("first"),
             py::arg("last"), py::arg("sigma"), py::arg("degree"), py::arg("derivative"),
             "Weights of polynomials around rows: (data, indices, indptr) of a sparse "
             "(rows, N) matrix.");
}

}  // namespace flexspline::bindings
