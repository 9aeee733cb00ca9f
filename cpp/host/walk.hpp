/// Effects of one kind that remember, taken through a block of samples side by side.
///
/// A step of one waits for its step before; the steps of several overlap, and what of a row needs
/// no memory is made beforehand, in a loop that vectorises. Each effect has the bits that it has
/// alone.
#pragma once

#include <array>
#include <span>

#include "flexspline/row.hpp"
#include "host/samples.hpp"
#include "host/wide_loop.hpp"

namespace flexspline::batch {

/// An effect and its memory, which moves on.
template <Remembers Effect>
struct Walker {
  const Effect* effect;
  StateOf<Effect>* state;
};

/// An effect with a part of its row that needs no memory: row(at, state) is
/// row(at, state, ahead(at)).
template <typename Effect>
concept LooksAhead = Remembers<Effect> &&
                     requires(const Effect& effect, const Sample<double>& at) { effect.ahead(at); };

/// What of the rows of an effect needs no memory.
template <LooksAhead Effect>
void look_ahead(const Effect& effect, const SampleBlock& block, double* out) {
  run_wide([&effect, &block, out, size = block.size] {
    for (std::size_t i = 0; i < size; ++i) out[i] = effect.ahead(block[i]);
  });
}

/// Takes walkers [first, first + N) through a block, see `walk`.
template <std::size_t N, Remembers Effect, typename Use>
void walk_together(std::span<const Walker<Effect>> walkers, std::size_t first,
                   const SampleBlock& block, Use& use) {
  std::array<Effect, N> effects;
  std::array<StateOf<Effect>, N> states;
  std::array<SampleBlock::Column<double>, LooksAhead<Effect> ? N : 0> ahead;
  for (std::size_t n = 0; n < N; ++n) {
    effects[n] = *walkers[first + n].effect;
    states[n] = *walkers[first + n].state;
    if constexpr (LooksAhead<Effect>) look_ahead(effects[n], block, ahead[n].data());
  }
  for (std::size_t i = 0; i < block.size; ++i) {
    if (block.column<Channel::period>()[i] == 0.0) states = {};
    bool good = true;
    for (const Channel channel : Effect::reads) good &= block.finite(channel, i);
    if (!good) continue;
    const Sample<double> at = block[i];
    for (std::size_t n = 0; n < N; ++n) {
      if constexpr (LooksAhead<Effect>) {
        use(first + n, i, effects[n].row(at, states[n], ahead[n][i]), states[n]);
      } else {
        use(first + n, i, effects[n].row(at, states[n]), states[n]);
      }
    }
  }
  for (std::size_t n = 0; n < N; ++n) *walkers[first + n].state = states[n];
}

/// Takes effects through a block: use(number, i, row, state) after each sample of each. A row whose
/// period is 0 starts anew; one that cannot be read is passed over and leaves the memory as it was.
template <Remembers Effect, typename Use>
void walk(std::span<const Walker<Effect>> walkers, const SampleBlock& block, Use use) {
  constexpr std::size_t most = 3;
  std::size_t first = 0;
  for (; walkers.size() - first >= most; first += most) {
    walk_together<most>(walkers, first, block, use);
  }
  if (walkers.size() - first == 2) walk_together<2>(walkers, first, block, use);
  if (walkers.size() - first == 1) walk_together<1>(walkers, first, block, use);
}

}  // namespace flexspline::batch
