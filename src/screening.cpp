#include "host/screening.hpp"

#include <limits>
#include <memory>
#include <optional>

#include "bindings.hpp"

namespace flexspline::bindings {
namespace {

using Shares = std::vector<std::pair<std::size_t, double>>;
using FortranArray = py::array_t<double, py::array::f_style | py::array::forcecast>;
/// Number, channels, target, columns that it brings along and the row where they begin, segments
/// with the kernel of the low pass, and edges of folds.
using Run = std::tuple<std::size_t, py::dict, Array, std::optional<FortranArray>, std::size_t,
                       std::vector<std::tuple<std::size_t, std::size_t, std::vector<double>>>,
                       std::vector<std::size_t>>;

batch::Mixture mixture_from(const Shares& shares, std::size_t parts) {
  batch::Mixture mixture;
  for (const auto& [part, weight] : shares) {
    require(part < parts, "a column is mixed from a part that is not there");
    mixture.push_back({part, weight});
  }
  return mixture;
}

/// Runs together with the arrays that they point into.
struct BorrowedRuns {
  std::vector<batch::ScreenedRun> runs;
  std::vector<Borrowed> channels;
  std::vector<Array> targets;
  std::vector<FortranArray> given;
};

void check(const batch::ScreenedRun& run, const batch::Filter& filter) {
  require(run.edges.size() >= 2 && std::is_sorted(run.edges.begin(), run.edges.end()) &&
              run.edges.back() <= run.run.channels.size,
          "the edges of folds increase, two at least, and lie within the rows");
  for (const batch::Segment& s : run.segments) {
    require(s.kernel.empty() || s.kernel.size() % 2 == 1, "a kernel has an odd number of weights");
    require(s.reach() <= s.first && s.first < s.last && s.last + s.reach() <= run.run.channels.size,
            "a stretch, with the reach of its kernel, lies within the rows");
    require((s.last - s.first + filter.every - 1) / filter.every > filter.order(),
            "a stretch is longer than the filter");
  }
}

BorrowedRuns runs_from(const std::vector<Run>& given, const batch::Filter& filter,
                       std::size_t columns) {
  require(!filter.whitening.empty() && filter.every > 0, "a filter has a weight, and a step");
  BorrowedRuns made;
  for (const auto& [number, channels, target, extra, from, segments, edges] : given) {
    made.channels.push_back(borrow(channels, target.size()));
    made.targets.push_back(target);
    batch::ScreenedRun run;
    run.number = number;
    run.run.channels = made.channels.back().channels;
    run.run.target = target.data();
    run.run.given_from = from;
    if (extra) {
      made.given.push_back(*extra);
      const auto rows = static_cast<std::size_t>(extra->shape(0));
      for (py::ssize_t k = 0; k < extra->shape(1); ++k) {
        run.run.given.push_back(extra->data() + static_cast<std::size_t>(k) * rows);
      }
      for (const auto& [first, last, kernel] : segments) {
        require(from + kernel.size() / 2 <= first && last + kernel.size() / 2 <= from + rows,
                "the columns of a run cover its stretches");
      }
    }
    require(run.run.given.size() == columns, "each run brings the same number of columns along");
    for (const auto& [first, last, kernel] : segments) {
      run.segments.push_back({first, last, kernel});
    }
    run.edges = edges;
    check(run, filter);
    made.runs.push_back(std::move(run));
  }
  return made;
}

/// A design as parts of columns, with what its effects remember at the rows asked for so far.
class Screen {
 public:
  Screen(const batch::Design& design, Array load, std::size_t given,
         std::shared_ptr<batch::StateCache> cache)
      : design_(design), load_(std::move(load)), given_(given), cache_(std::move(cache)) {
    require(load_.size() == 0 || static_cast<std::size_t>(load_.size()) == design.columns(),
            "the load needs as many coefficients as the design has columns, or none");
  }

  std::size_t parts() const { return assembly({}).parts(); }

  Array products(const std::vector<Run>& runs, const std::vector<Shares>& columns,
                 const Shares& offset_terms, const std::vector<double>& whitening,
                 std::size_t every, int threads) const {
    const batch::Filter filter{whitening, every};
    const BorrowedRuns borrowed = runs_from(runs, filter, given_);
    const batch::ColumnAssembly made = mixed(columns);
    const batch::Mixture offset = mixture_from(offset_terms, parts());
    std::vector<batch::Gram> grams;
    {
      const py::gil_scoped_release release;
      grams = batch::screen(made, borrowed.runs, filter, offset, *cache_, threads);
    }
    const auto width = static_cast<py::ssize_t>(columns.size()) + 1;
    Array out({static_cast<py::ssize_t>(grams.size()), width, width});
    double* to = out.mutable_data();
    for (const batch::Gram& gram : grams) to = std::copy(gram.high.begin(), gram.high.end(), to);
    return out;
  }

  FortranArray rows(const Run& run, const std::vector<Shares>& columns,
                    const Shares& offset_terms) const {
    const BorrowedRuns borrowed = runs_from({run}, {}, given_);
    const batch::ColumnAssembly made = mixed(columns);
    const batch::Mixture offset = mixture_from(offset_terms, parts());
    std::size_t count = 0;
    for (const batch::Segment& s : borrowed.runs[0].segments) count += s.last - s.first;
    FortranArray out(
        {static_cast<py::ssize_t>(count), static_cast<py::ssize_t>(columns.size()) + 1});
    double* to = out.mutable_data();
    {
      const py::gil_scoped_release release;
      batch::rows_of(made, borrowed.runs[0], offset, to, count, *cache_);
    }
    return out;
  }

  std::vector<Array> residuals(const std::vector<Run>& runs,
                               const std::vector<Shares>& offset_terms, int threads) const {
    const batch::Filter filter;
    const BorrowedRuns borrowed = runs_from(runs, filter, given_);
    std::size_t folds = 0;
    std::vector<Array> out;
    std::vector<double*> to;
    for (const batch::ScreenedRun& run : borrowed.runs) {
      folds += run.folds();
      out.emplace_back(static_cast<py::ssize_t>(run.run.channels.size));
      to.push_back(out.back().mutable_data());
      std::fill_n(to.back(), run.run.channels.size, std::numeric_limits<double>::quiet_NaN());
    }
    require(offset_terms.size() == folds, "each fold has what is held there");
    std::vector<batch::Mixture> offset;
    for (const Shares& shares : offset_terms) offset.push_back(mixture_from(shares, parts()));
    const batch::ColumnAssembly made = assembly({});
    {
      const py::gil_scoped_release release;
      batch::residuals(made, borrowed.runs, filter, offset, to, *cache_, threads);
    }
    return out;
  }

 private:
  batch::ColumnAssembly mixed(const std::vector<Shares>& columns) const {
    std::vector<batch::Mixture> mixtures;
    for (const Shares& shares : columns) mixtures.push_back(mixture_from(shares, parts()));
    return assembly(std::move(mixtures));
  }

  batch::ColumnAssembly assembly(std::vector<batch::Mixture> columns) const {
    const std::span<const double> load{load_.data(), static_cast<std::size_t>(load_.size())};
    return {design_, load, given_, std::move(columns)};
  }

  batch::Design design_;
  Array load_;
  std::size_t given_;
  std::shared_ptr<batch::StateCache> cache_;
};

}  // namespace

void bind_screening(py::module_& module) {
  py::class_<batch::StateCache, std::shared_ptr<batch::StateCache>>(
      module, "Remembered",
      "What effects remembered at rows of one problem's runs, `lead` rows back at most.")
      .def(py::init([](std::optional<std::size_t> lead) {
             return lead ? std::make_shared<batch::StateCache>(*lead)
                         : std::make_shared<batch::StateCache>();
           }),
           py::arg("lead") = std::nullopt);
  py::class_<Screen>(module, "Screen",
                     "Columns of runs, made a piece at a time and mixed from rows of a design.")
      .def(py::init<const batch::Design&, Array, std::size_t, std::shared_ptr<batch::StateCache>>(),
           py::arg("design"), py::arg("load"), py::arg("given"), py::arg("remembered"))
      .def_property_readonly("parts", &Screen::parts, "How many parts columns may be mixed from.")
      .def("products", &Screen::products, py::arg("runs"), py::arg("columns"), py::arg("held"),
           py::arg("whitening"), py::arg("every"), py::arg("threads"),
           "Sums of products of filtered [columns, target], (folds, columns + 1, columns + 1).")
      .def("rows", &Screen::rows, py::arg("run"), py::arg("columns"), py::arg("held"),
           "[columns, target] of the stretches of one run, (rows, columns + 1), not whitened.")
      .def("left_over", &Screen::residuals, py::arg("runs"), py::arg("held"), py::arg("threads"),
           "Target less what is held in each fold, (N,) for each run; NaN where no row counts.");
}

}  // namespace flexspline::bindings
