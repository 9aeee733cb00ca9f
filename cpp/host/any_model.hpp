/// A model whose effects are chosen at run time, evaluated sample by sample as on the device.
#pragma once

#include <span>
#include <vector>

#include "host/design.hpp"

namespace flexspline::batch {

/// Has the interface that model.hpp asks of a model, so that a `Joint` runs with it. Without
/// effects, or default constructed, it says zero.
///
/// What effects say of channels that are known beforehand may be made so, a block of a log at a
/// time, in loops that vectorise (`look_ahead`, `turn_to`): the same bits, and a ripple of many
/// orders costs little.
class AnyModel {
 public:
  /// The memories of the effects, empty where none has any.
  using State = Memory;

  AnyModel() : AnyModel(Design({}, Gear<double>{}), {}) {}

  /// Some of the channels, by their number.
  using Known = std::array<bool, channel_names.size()>;

  /// As many coefficients as the design has columns.
  AnyModel(const Design& design, std::span<const double> coefficients)
      : gear(design.gear()), remembers(design.remembers()), start_(design.fresh()) {
    for (const AnyEffect& effect : design.effects()) {
      const auto its = coefficients.first(terms_of(effect));
      parts_.push_back({effect, {its.begin(), its.end()}, {}});
      coefficients = coefficients.subspan(its.size());
      for (std::size_t k = 0; k < reads_.size(); ++k) {
        reads_[k] |= reads_any(effect, static_cast<Channel>(k));
      }
      follows_load |= follows(effect);
    }
  }

  Gear<double> gear;
  bool remembers;
  bool follows_load = false;

  template <Channel channel>
  bool reads() const noexcept {
    return reads_[static_cast<std::size_t>(channel)];
  }

  /// The memory at a start.
  const State& start() const noexcept { return start_; }

  /// Makes the rows of these channels beforehand, at most SampleBlock::capacity, for effects
  /// without memory that read no others.
  void look_ahead(const Channels& channels, const Known& known) {
    SampleBlock block;
    bool read = false;
    for (Part& part : parts_) {
      if (!reads_only(part.effect, known)) continue;
      if (!read) block.read(channels, 0, channels.size, gear, SampleBlock::Angles::both_sides);
      read = true;
      scratch_.resize(std::max(scratch_.size(), part.coefficients.size() * channels.size));
      part.ahead.resize(SampleBlock::capacity);
      std::visit(
          [&]<typename Effect>(const Effect& effect) {
            if constexpr (!Remembers<Effect>) columns(effect, block, scratch_.data(), block.size);
          },
          part.effect);
      weigh(part.coefficients, scratch_.data(), block.size, block.size, part.ahead.data());
    }
  }

  /// The next sample is row `row` of those that were made.
  void turn_to(std::size_t row) noexcept { row_ = row; }

  /// NaN where the model cannot say.
  double torque(const Sample<double>& at, State& state) const noexcept {
    return evaluation::torque(*this, at, state);
  }

  double sum(const Sample<double>& at, State& state) const noexcept {
    double total = -0.0;  // −0 + x is x, bit by bit
    for (std::size_t k = 0; k < parts_.size(); ++k) {
      total += torque_of(parts_[k], at, remembers ? &state[k] : nullptr);
    }
    return total;
  }

  /// See `Model::first_row`.
  template <std::size_t N>
  Row<double, N> first_row(const Sample<double>& at) const noexcept {
    Row<double, N> made{};
    std::size_t first = 0;
    for (const Part& part : parts_) {
      if (first >= N) break;
      const std::size_t count = std::min(part.coefficients.size(), N - first);
      std::visit(
          [&]<typename Effect>(const Effect& effect) {
            if constexpr (!Remembers<Effect>) {
              const auto row = effect.row(at);
              std::copy_n(row.begin(), count, made.begin() + static_cast<std::ptrdiff_t>(first));
            }
          },
          part.effect);
      first += count;
    }
    return made;
  }

  /// See `Model::first_coefficients`.
  template <std::size_t N>
  std::array<double, N> first_coefficients() const noexcept {
    std::array<double, N> made{};
    std::size_t first = 0;
    for (const Part& part : parts_) {
      for (const double each : part.coefficients) {
        if (first < N) made[first++] = each;
      }
    }
    return made;
  }

  /// See `Model::take_first`.
  template <std::size_t N>
  void take_first(const std::array<double, N>& values) noexcept {
    std::size_t first = 0;
    for (Part& part : parts_) {
      for (double& each : part.coefficients) {
        if (first < N) each = values[first++];
      }
    }
  }

  double by_load(const Sample<double>& at) const noexcept {
    double total = 0.0;
    for (const Part& part : parts_) {
      if (follows(part.effect)) total += torque_of(part, at, nullptr);
    }
    return total;
  }

  double carried(const Sample<double>& at) const noexcept {
    double total = 0.0;
    for (const Part& part : parts_) {
      if (carries_load(part.effect)) total += torque_of(part, at, nullptr);
    }
    return total;
  }

 private:
  struct Part {
    AnyEffect effect;
    std::vector<double> coefficients;
    std::vector<double> ahead;  ///< Nm, of the rows of a block
  };

  static bool follows(const AnyEffect& any) {
    const auto remembered = []<typename Effect>(const Effect&) { return Remembers<Effect>; };
    return reads_any(any, Channel::load) && !std::visit(remembered, any);
  }

  static bool reads_only(const AnyEffect& any, const Known& known) {
    return std::visit(
        [&]<typename Effect>(const Effect&) {
          bool only = !Remembers<Effect>;
          for (const Channel channel : Effect::reads) only &= known[std::size_t(channel)];
          return only;
        },
        any);
  }

  double torque_of(const Part& part, const Sample<double>& at, AnyState* state) const noexcept {
    if (!part.ahead.empty()) return part.ahead[row_];
    return std::visit(
        [&]<typename Effect>(const Effect& effect) {
          const std::span<const double> coefficients = part.coefficients;
          if constexpr (HarmonicEffect<Effect>) {
            return weighted_harmonics(effect, at, coefficients);
          } else {
            StateOf<Effect> none;
            StateOf<Effect>* memory = &none;
            if constexpr (Remembers<Effect>) memory = std::get_if<place_of<Effect>>(state);
            const auto row = row_of(effect, at, *memory);
            double sum = -0.0;
            for (std::size_t k = 0; k < row.size(); ++k) sum += row[k] * coefficients[k];
            return sum;
          }
        },
        part.effect);
  }

  /// The row of a ripple effect, without the room that it has for more orders, times coefficients.
  template <typename Effect>
  static double weighted_harmonics(const Effect& effect, const Sample<double>& at,
                                   std::span<const double> coefficients) noexcept {
    std::array<double, 2 * max_harmonics> row;
    double sum = -0.0;
    for (std::size_t k = 0; k < effect.harmonics().size(); ++k) {
      auto p = effect.reach(k, at, row);
      row[2 * k] = p.cosine;
      row[2 * k + 1] = p.sine;
      if constexpr (ModulatedHarmonicEffect<Effect>) {
        p = effect.modulated(p, effect.harmonics()[k].order, at.output_velocity);
      }
      sum += p.cosine * coefficients[2 * k];
      sum += p.sine * coefficients[2 * k + 1];
    }
    return sum;
  }

  std::vector<Part> parts_;
  Known reads_{};
  State start_;
  std::vector<double> scratch_;
  std::size_t row_ = 0;
};

}  // namespace flexspline::batch
