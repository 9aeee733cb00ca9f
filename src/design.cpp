#include <stdexcept>
#include <string>

#include "bindings.hpp"
#include "host/accumulate.hpp"
#include "host/by_name.hpp"

namespace flexspline::bindings {
namespace {

batch::AnyEffect effect_from(const py::dict& spec) {
  batch::AnyEffect effect = batch::effect_by_name(spec["name"].cast<std::string>());
  for (const auto& [name, value] : spec["shapes"].cast<std::map<std::string, double>>()) {
    batch::set_shape(effect, name, value);
  }
  std::vector<Harmonic> harmonics;
  for (const auto& [order, pair] :
       spec["harmonics"].cast<std::vector<std::pair<std::uint32_t, std::string>>>()) {
    harmonics.push_back({order, batch::pair_by_name(pair)});
  }
  batch::set_harmonics(effect, harmonics);
  return effect;
}

OutputSpline spline_by_name(const std::string& name) {
  if (name == "circular") return OutputSpline::circular;
  if (name == "flex") return OutputSpline::flex;
  if (name == "unknown") return OutputSpline::unknown;
  throw std::invalid_argument("output_spline is 'circular', 'flex' or 'unknown', not '" + name +
                              "'");
}

batch::Design design_from(const std::vector<py::dict>& specs, double effective_ratio,
                          const std::string& output_spline, bool motor_encoder) {
  std::vector<batch::AnyEffect> effects;
  for (const py::dict& spec : specs) effects.push_back(effect_from(spec));
  return {std::move(effects),
          Gear<double>::from_ratio(effective_ratio, spline_by_name(output_spline), motor_encoder)};
}

std::span<const double> span_of(const Array& array) {
  return {array.data(), static_cast<std::size_t>(array.size())};
}

Array rows(const batch::Design& design, const py::dict& columns, py::ssize_t size,
           const Array& coefficients) {
  const Borrowed borrowed = borrow(columns, size);
  require_size(span_of(coefficients), design.columns(), true);
  const auto width = static_cast<py::ssize_t>(design.columns());
  py::array_t<double, py::array::f_style> out({size, width});
  double* values = out.mutable_data();
  const auto stride = static_cast<std::size_t>(size);
  {
    const py::gil_scoped_release release;
    batch::Memory memory = design.fresh();
    batch::in_chunks({0, stride}, [&](std::size_t first, std::size_t count) {
      design.fill(borrowed.channels, first, count, span_of(coefficients), memory, values + first,
                  stride);
    });
  }
  return py::reinterpret_borrow<Array>(out);
}

/// A value of each row; `fill` makes those of a chunk.
template <typename T, typename Fill>
py::array_t<T> of_each_row(const batch::Design& design, const py::dict& columns, py::ssize_t size,
                           const Array& coefficients, bool may_be_empty, const Fill& fill) {
  const Borrowed borrowed = borrow(columns, size);
  require_size(span_of(coefficients), design.columns(), may_be_empty);
  py::array_t<T> out(size);
  T* values = out.mutable_data();
  {
    const py::gil_scoped_release release;
    batch::Memory memory = design.fresh();
    batch::in_chunks(
        {0, static_cast<std::size_t>(size)}, [&](std::size_t first, std::size_t count) {
          fill(borrowed.channels, first, count, span_of(coefficients), memory, values + first);
        });
  }
  return out;
}

py::array_t<double> predict(const batch::Design& design, const py::dict& columns, py::ssize_t size,
                            const Array& coefficients) {
  return of_each_row<double>(design, columns, size, coefficients, false,
                             [&](auto&&... chunk) { design.predict(chunk...); });
}

py::array_t<bool> settled(const batch::Design& design, const py::dict& columns, py::ssize_t size,
                          const Array& coefficients) {
  return of_each_row<bool>(design, columns, size, coefficients, true,
                           [&](auto&&... chunk) { design.settled(chunk...); });
}

std::vector<batch::Rows> blocks_from(const std::vector<std::pair<std::size_t, std::size_t>>& pairs,
                                     std::size_t size) {
  std::vector<batch::Rows> blocks;
  for (const auto& [first, last] : pairs) {
    if (first > last || last > size) {
      throw std::invalid_argument("block [" + std::to_string(first) + ", " + std::to_string(last) +
                                  ") is not within " + std::to_string(size) + " rows");
    }
    blocks.push_back({first, last});
  }
  return blocks;
}

batch::Precision precision_of(bool double_double) {
  return double_double ? batch::Precision::double_double : batch::Precision::plain;
}

/// Grams of all blocks as arrays (blocks, columns + 1, columns + 1); the low part may be empty.
py::tuple arrays_of(const std::vector<batch::Gram>& grams, std::size_t columns) {
  const auto width = static_cast<py::ssize_t>(columns) + 1;
  const auto count = static_cast<py::ssize_t>(grams.size());
  const bool exact = !grams.empty() && !grams.front().low.empty();
  py::array_t<double> high({count, width, width});
  py::array_t<double> low({exact ? count : 0, width, width});
  double* to_high = high.mutable_data();
  double* to_low = low.mutable_data();
  for (const batch::Gram& gram : grams) {
    to_high = std::copy(gram.high.begin(), gram.high.end(), to_high);
    if (exact) to_low = std::copy(gram.low.begin(), gram.low.end(), to_low);
  }
  return py::make_tuple(high, low);
}

py::tuple accumulate(const batch::Design& design, const py::dict& columns, const Array& target,
                     const std::vector<std::pair<std::size_t, std::size_t>>& blocks,
                     const Array& coefficients, const Array& offset_terms,
                     const std::optional<Array>& weights, bool double_double, bool structured,
                     int threads) {
  const Borrowed borrowed = borrow(columns, target.size());
  require_size(span_of(coefficients), design.columns(), true);
  require_size(span_of(offset_terms), design.columns(), true);
  const std::size_t size = borrowed.channels.size;
  const batch::Problem problem{design,
                               borrowed.channels,
                               target.data(),
                               column_or_null(weights, size, "weights"),
                               span_of(coefficients),
                               span_of(offset_terms)};
  const auto rows_of_blocks = blocks_from(blocks, size);
  std::vector<batch::Gram> grams;
  {
    const py::gil_scoped_release release;
    grams = batch::accumulate(problem, rows_of_blocks, precision_of(double_double), structured,
                              threads);
  }
  return arrays_of(grams, design.columns());
}

using FortranArray = py::array_t<double, py::array::f_style | py::array::forcecast>;

py::tuple accumulate_rows(const FortranArray& rows, const Array& target,
                          const std::vector<std::pair<std::size_t, std::size_t>>& blocks,
                          const std::optional<Array>& weights, bool double_double, int threads) {
  const auto size = static_cast<std::size_t>(rows.shape(0));
  const auto width = static_cast<std::size_t>(rows.shape(1));
  column_or_null(target, size, "target");
  std::vector<const double*> columns;
  for (std::size_t k = 0; k < width; ++k) columns.push_back(rows.data() + k * size);
  columns.push_back(target.data());
  const double* weight = column_or_null(weights, size, "weights");
  const auto rows_of_blocks = blocks_from(blocks, size);
  std::vector<batch::Gram> grams;
  {
    const py::gil_scoped_release release;
    grams = batch::accumulate_rows(columns, weight, rows_of_blocks, precision_of(double_double),
                                   threads);
  }
  return arrays_of(grams, width);
}

}  // namespace

void require_size(std::span<const double> coefficients, std::size_t columns, bool may_be_empty) {
  if (coefficients.size() == columns || (may_be_empty && coefficients.empty())) return;
  throw std::invalid_argument("the design has " + std::to_string(columns) +
                              " columns, but there are " + std::to_string(coefficients.size()) +
                              " coefficients");
}

const double* column_or_null(const std::optional<Array>& array, std::size_t size,
                             const char* name) {
  if (!array) return nullptr;
  if (static_cast<std::size_t>(array->size()) != size) {
    throw std::invalid_argument(std::string(name) + " has " + std::to_string(array->size()) +
                                " rows, but there are " + std::to_string(size));
  }
  return array->data();
}

Borrowed borrow(const py::dict& columns, py::ssize_t size) {
  Borrowed borrowed;
  batch::Channels& c = borrowed.channels;
  c.size = static_cast<std::size_t>(size);
  const auto take = [&](std::string_view known, const double*& field) {
    const std::string name(known);
    if (!columns.contains(name)) return;
    borrowed.arrays.push_back(columns[name.c_str()].cast<Array>());
    field = column_or_null(borrowed.arrays.back(), c.size, name.c_str());
  };
  take("output_position", c.output_position);
  take("motor_position", c.motor_position);
  take("known_load", c.known_load);
  for (std::size_t k = 0; k < c.number.size(); ++k) take(numbers<double>[k].name(), c.number[k]);
  return borrowed;
}

void bind_design(py::module_& module) {
  py::class_<batch::Design>(module, "Design",
                            "Effects chosen at run time: rows, sums and predictions over arrays.")
      .def(py::init(&design_from), py::arg("effects"), py::arg("effective_ratio"),
           py::arg("output_spline"), py::arg("motor_encoder"))
      .def_property_readonly("columns", &batch::Design::columns, "How many columns the rows have.")
      .def_property_readonly(
          "structured",
          [](const batch::Design& design) { return batch::structure_of(design).has_value(); },
          "Whether the sums of this design can use the structure of dense harmonics.")
      .def("rows", &rows, py::arg("channels"), py::arg("size"), py::arg("coefficients"),
           "Design matrix, shape (size, columns).")
      .def("predict", &predict, py::arg("channels"), py::arg("size"), py::arg("coefficients"),
           "Rows times coefficients, shape (size,).")
      .def("settled", &settled, py::arg("channels"), py::arg("size"), py::arg("coefficients"),
           "Rows that no longer depend on what an effect remembered before its run, (size,).")
      .def("accumulate", &accumulate, py::arg("channels"), py::arg("target"), py::arg("blocks"),
           py::arg("coefficients"), py::arg("held"), py::arg("weights"), py::arg("double_double"),
           py::arg("structured"), py::arg("threads"),
           "Sums of products of [rows, target] of each block: (high, low).");
  module.def("accumulate_rows", &accumulate_rows, py::arg("rows"), py::arg("target"),
             py::arg("blocks"), py::arg("weights"), py::arg("double_double"), py::arg("threads"),
             "Sums of products of [rows, target] of each block, from explicit rows: (high, low).");
}

}  // namespace flexspline::bindings
