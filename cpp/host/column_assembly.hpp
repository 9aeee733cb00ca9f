/// Columns that are never all there at once: a block of rows of them is made when it is needed.
///
///   parts    rows of a design, then columns that were made elsewhere
///   column   Σ weight · part      (most are one part as it is)
///   target   y − Σ offset_term · part
///
/// A column that says how a prediction changes with a shape is the difference of two parts.
#pragma once

#include <span>

#include "host/design.hpp"

namespace flexspline::batch {

/// One part in a column.
struct Share {
  std::size_t part = 0;
  double weight = 0.0;
};
using Mixture = std::vector<Share>;

/// What the columns of all runs are.
struct ColumnAssembly {
  const Design& design;
  std::span<const double> load;  ///< coefficients that the load is made of; empty: known load
  std::size_t given = 0;         ///< how many columns each run brings along
  std::vector<Mixture> columns;

  std::size_t parts() const noexcept { return design.columns() + given; }
};

/// A run as an assembly reads it: channels, target, and the columns made elsewhere, from a row on.
struct AssemblyRun {
  Channels channels;
  const double* target = nullptr;
  std::vector<const double*> given;
  std::size_t given_from = 0;
};

/// out[i] = Σ weight · part, for `count` rows; parts side by side, `stride` apart.
inline void mix(const Mixture& mixture, const double* parts, std::size_t stride, std::size_t count,
                double* out) {
  std::fill_n(out, count, 0.0);
  for (const Share& share : mixture) {
    run_wide([out, count, part = parts + share.part * stride, w = share.weight] {
      for (std::size_t i = 0; i < count; ++i) out[i] += w * part[i];
    });
  }
}

/// Makes the columns of one run, a block after the other.
class AssembledRows {
 public:
  AssembledRows(const ColumnAssembly& assembly, const AssemblyRun& run, const Mixture& offset_terms,
                Memory memory, std::size_t capacity)
      : assembly_(assembly),
        run_(run),
        offset_terms_(offset_terms),
        memory_(std::move(memory)),
        stride_(capacity),
        parts_(assembly.parts() * capacity) {}

  /// Rows [first, first + count) of each column k to to(k), and of the offset terms behind them.
  template <typename To>
  void fill(std::size_t first, std::size_t count, To to) {
    assembly_.design.fill(run_.channels, first, count, assembly_.load, memory_, parts_.data(),
                          stride_);
    double* part = parts_.data() + assembly_.design.columns() * stride_;
    for (const double* column : run_.given) {
      std::copy_n(column + (first - run_.given_from), count, part);
      part += stride_;
    }
    const std::size_t width = assembly_.columns.size();
    for (std::size_t k = 0; k < width; ++k) {
      const Mixture& mixture = assembly_.columns[k];
      if (mixture.size() == 1 && mixture[0].weight == 1.0) {
        std::copy_n(parts_.data() + mixture[0].part * stride_, count, to(k));
      } else {
        mix(mixture, parts_.data(), stride_, count, to(k));
      }
    }
    mix(offset_terms_, parts_.data(), stride_, count, to(width));
  }

 private:
  const ColumnAssembly& assembly_;
  const AssemblyRun& run_;
  const Mixture& offset_terms_;
  Memory memory_;
  std::size_t stride_;
  std::vector<double> parts_;
};

}  // namespace flexspline::batch
