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

/// An effect and its memory, which moves on from row to row.
template <Remembers Effect>
struct StatefulColumn {
  const Effect* effect;
  StateOf<Effect>* state;
};

/// An effect with a part of its row that needs no memory: row(at, state) is
/// row(at, state, stateless_part(at)).
template <typename Effect>
concept HasStatelessPart =
    Remembers<Effect> &&
    requires(const Effect& effect, const Sample<double>& at) { effect.stateless_part(at); };

/// The stateless parts of the rows of an effect.
template <HasStatelessPart Effect>
void stateless_parts(const Effect& effect, const SampleBlock& block, double* out) {
  run_wide([&effect, &block, out, size = block.size] {
    for (std::size_t i = 0; i < size; ++i) out[i] = effect.stateless_part(block[i]);
  });
}

/// Takes columns [first, first + N) through a block by turns, see `step_through`.
template <std::size_t N, Remembers Effect, typename Use>
void step_interleaved(std::span<const StatefulColumn<Effect>> stateful, std::size_t first,
                      const SampleBlock& block, Use& use) {
  std::array<Effect, N> effects;
  std::array<StateOf<Effect>, N> states;
  std::array<SampleBlock::Column<double>, HasStatelessPart<Effect> ? N : 0> stateless;
  for (std::size_t n = 0; n < N; ++n) {
    effects[n] = *stateful[first + n].effect;
    states[n] = *stateful[first + n].state;
    if constexpr (HasStatelessPart<Effect>) stateless_parts(effects[n], block, stateless[n].data());
  }
  for (std::size_t i = 0; i < block.size; ++i) {
    if (block.column<Channel::period>()[i] == 0.0) states = {};
    bool good = true;
    for (const Channel channel : Effect::reads) good &= block.finite(channel, i);
    if (!good) continue;
    const Sample<double> at = block[i];
    for (std::size_t n = 0; n < N; ++n) {
      if constexpr (HasStatelessPart<Effect>) {
        use(first + n, i, effects[n].row(at, states[n], stateless[n][i]), states[n]);
      } else {
        use(first + n, i, effects[n].row(at, states[n]), states[n]);
      }
    }
  }
  for (std::size_t n = 0; n < N; ++n) *stateful[first + n].state = states[n];
}

/// Takes effects through a block: use(number, i, row, state) after each sample of each. A row whose
/// period is 0 starts anew; one that cannot be read is passed over and leaves the memory as it was.
template <Remembers Effect, typename Use>
void step_through(std::span<const StatefulColumn<Effect>> stateful, const SampleBlock& block,
                  Use use) {
  constexpr std::size_t most = 3;
  std::size_t first = 0;
  for (; stateful.size() - first >= most; first += most) {
    step_interleaved<most>(stateful, first, block, use);
  }
  if (stateful.size() - first == 2) step_interleaved<2>(stateful, first, block, use);
  if (stateful.size() - first == 1) step_interleaved<1>(stateful, first, block, use);
}

}  // namespace flexspline::batch
