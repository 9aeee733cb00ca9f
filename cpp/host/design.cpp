/// Columns of a design: see design.hpp. The loops of every effect, on every instruction set, are
/// compiled here and in no other unit: they take longer than all that calls them.
#include "host/design.hpp"

#include <algorithm>
#include <map>
#include <type_traits>
#include <utility>
#include <variant>

namespace flexspline::batch {

Design::Design(std::vector<AnyEffect> effects, const Gear<double>& gear)
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

bool Design::remembers(const AnyEffect& any) {
  return std::visit([](const auto& e) { return Remembers<std::remove_cvref_t<decltype(e)>>; }, any);
}

Memory Design::fresh() const {
  Memory memory;
  for (std::size_t k = 0; remembers() && k < effects_.size(); ++k) {
    std::visit([&memory]<typename Effect>(
                   const Effect&) { memory.emplace_back(std::in_place_index<place_of<Effect>>); },
               effects_[k]);
  }
  return memory;
}

void Design::fill(const Channels& channels, std::size_t first, std::size_t count,
                  std::span<const double> coefficients, Memory& memory, double* out,
                  std::size_t stride) const {
  SampleBlock block;
  SampleBlock::Column<double> load;
  read(channels, first, count, coefficients, out, stride, angles_, block, load);
  each(block, memory, out, stride, [](const AnyEffect&) { return true; });
}

std::vector<Memory> Design::remember(const Channels& channels, std::span<const std::size_t> rows,
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

void Design::advance(const Channels& channels, std::size_t first, std::size_t last,
                     std::span<const double> coefficients, Memory& memory,
                     std::span<const std::size_t> which) const {
  for (; first < last; first += SampleBlock::capacity) {
    const std::size_t count = std::min(SampleBlock::capacity, last - first);
    pass(channels, first, count, coefficients, memory, which, [](std::size_t, auto) {});
  }
}

void Design::settled(const Channels& channels, std::size_t first, std::size_t count,
                     std::span<const double> coefficients, Memory& memory, bool* out) const {
  std::fill_n(out, count, true);
  if (!remembers()) return;
  pass(channels, first, count, coefficients, memory, remembering_,
       [out](std::size_t i, auto settled) { out[i] = out[i] && settled(); });
}

void Design::fill_dense(const Channels& channels, std::size_t first, std::size_t count,
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

void Design::predict(const Channels& channels, std::size_t first, std::size_t count,
                     std::span<const double> coefficients, Memory& memory, double* torque) const {
  std::vector<double> rows(columns_ * count);
  fill(channels, first, count, coefficients, memory, rows.data(), count);
  std::fill_n(torque, count, -0.0);
  sum(coefficients, rows.data(), count, count, torque, [](const AnyEffect&) { return true; });
}

SampleBlock::Angles Design::angles_of(const AnyEffect& any) {
  if (reads_any(any, Channel::motor_position)) return SampleBlock::Angles::both_sides;
  if (reads_any(any, Channel::output_position)) return SampleBlock::Angles::output;
  return SampleBlock::Angles::none;
}

Pair Design::pair_of(const AnyEffect& any) {
  return std::visit(
      [](const auto& effect) {
        if constexpr (HarmonicEffect<std::remove_cvref_t<decltype(effect)>>) {
          return effect.harmonics()[0].pair;
        }
        return Pair{};
      },
      any);
}

void Design::read(const Channels& channels, std::size_t first, std::size_t count,
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
void Design::each(const SampleBlock& block, Memory& memory, double* out, std::size_t stride,
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
  by_kind(remembering, memory, [&](const auto& stateful, std::size_t first) {
    flexspline::batch::columns(stateful, block, out + offsets_[first] * stride, stride);
  });
}

template <typename Use>
void Design::by_kind(std::span<const std::size_t> which, Memory& memory, Use use) const {
  for (std::size_t at = 0; at < which.size();) {
    std::visit(
        [&]<typename Effect>(const Effect&) {
          if constexpr (Remembers<Effect>) {
            std::vector<StatefulColumn<Effect>> stateful;
            const std::size_t first = which[at];
            for (; at < which.size() && which[at] == first + stateful.size(); ++at) {
              const Effect* effect = std::get_if<Effect>(&effects_[which[at]]);
              if (effect == nullptr) break;
              stateful.push_back({effect, &std::get<place_of<Effect>>(memory[which[at]])});
            }
            use(std::span<const StatefulColumn<Effect>>(stateful), first);
          }
        },
        effects_[which[at]]);
  }
}

template <typename Use>
void Design::pass(const Channels& channels, std::size_t first, std::size_t count,
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
  by_kind(which, memory,
          [&]<typename Effect>(std::span<const StatefulColumn<Effect>> stateful, auto) {
            step_through(stateful, block,
                         [&](std::size_t n, std::size_t i, const auto&, const auto& state) {
                           use(i, [&] { return stateful[n].effect->settled(state); });
                         });
          });
}

template <typename Chosen>
void Design::sum(std::span<const double> coefficients, const double* rows, std::size_t stride,
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

}  // namespace flexspline::batch
