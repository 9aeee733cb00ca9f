/// Effects chosen at run time: their columns for a block of samples, and their sum.
///
/// Effects that remember go through a run row by row: who evaluates pieces of it in another order
/// takes the memory before each piece from `remember`.
#pragma once

#include <map>
#include <span>

#include "host/columns.hpp"

namespace flexspline::batch {

/// A model put together at run time.
class Design {
 public:
  Design(std::vector<AnyEffect> effects, const Gear<double>& gear)
      : effects_(std::move(effects)), gear_(gear) {
    for (const AnyEffect& effect : effects_) {
      if (remembers(effect)) remembering_.push_back(offsets_.size());
      offsets_.push_back(columns_);
      columns_ += terms_of(effect);
      const SampleBlock::Angles angles = angles_of(effect);
      if (angles != SampleBlock::Angles::none) ++angle_readers_;
      angles_ = std::max(angles_, angles);
      load_ |= reads_any(effect, Channel::load);
    }
  }

  std::size_t columns() const noexcept { return columns_; }
  const std::vector<AnyEffect>& effects() const noexcept { return effects_; }
  const Gear<double>& gear() const noexcept { return gear_; }
  bool remembers() const noexcept { return !remembering_.empty(); }
  static bool remembers(const AnyEffect& any) {
    return std::visit([](const auto& e) { return Remembers<std::remove_cvref_t<decltype(e)>>; },
                      any);
  }

  /// The memory at the beginning of a run.
  Memory fresh() const {
    Memory memory;
    for (std::size_t k = 0; remembers() && k < effects_.size(); ++k) {
      std::visit([&memory]<typename Effect>(
                     const Effect&) { memory.emplace_back(std::in_place_index<place_of<Effect>>); },
                 effects_[k]);
    }
    return memory;
  }

  /// The columns of rows [first, first + count), count ≤ SampleBlock::capacity: term k of row
  /// first + i at out[k · stride + i]. The load is the known load plus what `coefficients` (as
  /// many as columns, or none) say of it. `memory` is that before row `first` and becomes that
  /// after the last one.
  void fill(const Channels& channels, std::size_t first, std::size_t count,
            std::span<const double> coefficients, Memory& memory, double* out,
            std::size_t stride) const {
    SampleBlock block;
    SampleBlock::Column<double> load;
    read(channels, first, count, coefficients, out, stride, angles_, block, load);
    each(block, memory, out, stride, [](const AnyEffect&) { return true; });
  }

  /// The same with a memory that has seen nothing.
  void fill(const Channels& channels, std::size_t first, std::size_t count,
            std::span<const double> coefficients, double* out, std::size_t stride) const {
    Memory memory = fresh();
    fill(channels, first, count, coefficients, memory, out, stride);
  }

  /// The memory before each of these rows, from one pass over the log up to the last of them. With
  /// it the rows between can be evaluated in any order, and in parallel, to the same bits.
  std::vector<Memory> remember(const Channels& channels, std::span<const std::size_t> rows,
                               std::span<const double> coefficients) const {
    std::map<std::size_t, Memory> known;
    for (const std::size_t row : rows) known[row];
    Memory memory = fresh();
    std::size_t at = 0;
    for (auto& [row, before] : known) {
      if (remembers()) advance(channels, at, row, coefficients, memory, remembering_);
      at = row;
      before = memory;
    }
    std::vector<Memory> found;
    for (const std::size_t row : rows) found.push_back(known.at(row));
    return found;
  }

  /// Takes the memory of effects `which`, which have one, from before row `first` to before `last`.
  void advance(const Channels& channels, std::size_t first, std::size_t last,
               std::span<const double> coefficients, Memory& memory,
               std::span<const std::size_t> which) const {
    for (; first < last; first += SampleBlock::capacity) {
      const std::size_t count = std::min(SampleBlock::capacity, last - first);
      pass(channels, first, count, coefficients, memory, which, [](std::size_t, auto) {});
    }
  }

  /// Whether each of the rows [first, first + count) no longer depends on what the memory was
  /// before the first row of its run, which nobody knows.
  void settled(const Channels& channels, std::size_t first, std::size_t count,
               std::span<const double> coefficients, Memory& memory, bool* out) const {
    std::fill_n(out, count, true);
    if (!remembers()) return;
    pass(channels, first, count, coefficients, memory, remembering_,
         [out](std::size_t i, auto settled) { out[i] = out[i] && settled(); });
  }

  /// The same without the columns of ones and of one ripple effect, and instead cosine and sine
  /// of its angle: where no other effect reads an angle, straight from the radians.
  void fill_dense(const Channels& channels, std::size_t first, std::size_t count,
                  std::span<const double> coefficients, std::size_t ripple, double* out,
                  std::size_t stride, double* cosine, double* sine) const {
    const AnyEffect* left_out = &effects_[ripple];
    const Pair pair = pair_of(*left_out);
    const bool direct = angle_readers_ == 1 && pair == Pair::output_on_housing &&
                        channels.output_position != nullptr &&
                        within_reach(channels.output_position + first, count);
    SampleBlock block;
    SampleBlock::Column<double> load;
    read(channels, first, count, coefficients, out, stride,
         direct ? SampleBlock::Angles::none : angles_, block, load);
    Memory memory = fresh();
    each(block, memory, out, stride, [&](const AnyEffect& effect) {
      return &effect != left_out && !std::holds_alternative<Offset<double>>(effect);
    });
    if (direct) {
      kernels().cosine_and_sine(channels.output_position + first, count, cosine, sine);
    } else {
      phasors(1, block.phases(pair), count, cosine, sine);
    }
  }

  /// Row · coefficients for rows [first, first + count), summed as Model::predict does.
  void predict(const Channels& channels, std::size_t first, std::size_t count,
               std::span<const double> coefficients, Memory& memory, double* torque) const {
    std::vector<double> rows(columns_ * count);
    fill(channels, first, count, coefficients, memory, rows.data(), count);
    std::fill_n(torque, count, -0.0);
    sum(coefficients, rows.data(), count, count, torque, [](const AnyEffect&) { return true; });
  }

  /// The same with a memory that has seen nothing.
  void predict(const Channels& channels, std::size_t first, std::size_t count,
               std::span<const double> coefficients, double* torque) const {
    Memory memory = fresh();
    predict(channels, first, count, coefficients, memory, torque);
  }

 private:
  static SampleBlock::Angles angles_of(const AnyEffect& any) {
    if (reads_any(any, Channel::motor_position)) return SampleBlock::Angles::both_sides;
    if (reads_any(any, Channel::output_position)) return SampleBlock::Angles::output;
    return SampleBlock::Angles::none;
  }

  /// The pair of a ripple effect's first harmonic.
  static Pair pair_of(const AnyEffect& any) {
    return std::visit(
        [](const auto& effect) {
          if constexpr (HarmonicEffect<std::remove_cvref_t<decltype(effect)>>) {
            return effect.harmonics()[0].pair;
          }
          return Pair{};
        },
        any);
  }

  /// Reads a block and makes its load, kept in `load`; `out` serves as scratch.
  void read(const Channels& channels, std::size_t first, std::size_t count,
            std::span<const double> coefficients, double* out, std::size_t stride,
            SampleBlock::Angles angles, SampleBlock& block,
            SampleBlock::Column<double>& load) const {
    block.read(channels, first, count, gear_, angles);
    if (!load_ || coefficients.empty()) return;
    Memory none;
    each(block, none, out, stride, carries_load);
    SampleBlock::Column<double> carried{};
    sum(coefficients, out, stride, count, carried.data(), carries_load);
    for (std::size_t i = 0; i < count; ++i) load[i] = block.known_load[i] + carried[i];
    block.load = load.data();
  }

  template <typename Chosen>
  void each(const SampleBlock& block, Memory& memory, double* out, std::size_t stride,
            Chosen chosen) const {
    std::vector<std::size_t> remembering;
    for (std::size_t k = 0; k < effects_.size(); ++k) {
      if (!chosen(effects_[k])) continue;
      std::visit(
          [&]<typename Effect>(const Effect& effect) {
            if constexpr (Remembers<Effect>) {
              remembering.push_back(k);
            } else {
              flexspline::batch::columns(effect, block, out + offsets_[k] * stride, stride);
            }
          },
          effects_[k]);
    }
    by_kind(remembering, memory, [&](const auto& walkers, std::size_t first) {
      flexspline::batch::columns(walkers, block, out + offsets_[first] * stride, stride);
    });
  }

  /// Calls use(walkers, first) for effects `which`, those of one kind that follow each other at
  /// once; `first` is the number of the first of them.
  template <typename Use>
  void by_kind(std::span<const std::size_t> which, Memory& memory, Use use) const {
    for (std::size_t at = 0; at < which.size();) {
      std::visit(
          [&]<typename Effect>(const Effect&) {
            if constexpr (Remembers<Effect>) {
              std::vector<Walker<Effect>> walkers;
              const std::size_t first = which[at];
              for (; at < which.size() && which[at] == first + walkers.size(); ++at) {
                const Effect* effect = std::get_if<Effect>(&effects_[which[at]]);
                if (effect == nullptr) break;
                walkers.push_back({effect, &std::get<place_of<Effect>>(memory[which[at]])});
              }
              use(std::span<const Walker<Effect>>(walkers), first);
            }
          },
          effects_[which[at]]);
    }
  }

  /// Takes effects `which`, which have memory, over rows without writing columns: use(i, settled)
  /// for each row of each; settled() says whether the start no longer matters.
  template <typename Use>
  void pass(const Channels& channels, std::size_t first, std::size_t count,
            std::span<const double> coefficients, Memory& memory,
            std::span<const std::size_t> which, Use use) const {
    bool carried = false;
    auto angles = SampleBlock::Angles::none;
    for (const std::size_t k : which) {
      carried |= !coefficients.empty() && reads_any(effects_[k], Channel::load);
      angles = std::max(angles, angles_of(effects_[k]));
    }
    SampleBlock block;
    SampleBlock::Column<double> load;
    std::vector<double> scratch(carried ? columns_ * count : 0);
    read(channels, first, count, carried ? coefficients : std::span<const double>{}, scratch.data(),
         count, carried ? angles_ : angles, block, load);
    by_kind(which, memory, [&]<typename Effect>(std::span<const Walker<Effect>> walkers, auto) {
      walk(walkers, block, [&](std::size_t n, std::size_t i, const auto&, const auto& state) {
        use(i, [&] { return walkers[n].effect->settled(state); });
      });
    });
  }

  /// Adds the chosen effects' torques to `total`, an effect at a time.
  template <typename Chosen>
  void sum(std::span<const double> coefficients, const double* rows, std::size_t stride,
           std::size_t count, double* total, Chosen chosen) const {
    SampleBlock::Column<double> torque;
    const double* coefficient = coefficients.data();
    for (const AnyEffect& any : effects_) {
      const std::size_t terms = terms_of(any);
      if (chosen(any)) {
        weigh({coefficient, terms}, rows, stride, count, torque.data());
        for (std::size_t i = 0; i < count; ++i) total[i] += torque[i];
      }
      rows += terms * stride;
      coefficient += terms;
    }
  }

  std::vector<AnyEffect> effects_;
  Gear<double> gear_;
  std::vector<std::size_t> offsets_;      ///< the first column of each effect
  std::vector<std::size_t> remembering_;  ///< numbers of the effects with memory
  std::size_t columns_ = 0;
  SampleBlock::Angles angles_ = SampleBlock::Angles::none;
  std::size_t angle_readers_ = 0;
  bool load_ = false;
};

}  // namespace flexspline::batch
