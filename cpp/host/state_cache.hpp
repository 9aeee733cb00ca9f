/// States of effects at rows of a run, computed once and kept.
#pragma once

#include <iterator>
#include <limits>
#include <map>
#include <mutex>
#include <set>
#include <string>
#include <tuple>

#include "host/by_name.hpp"
#include "host/column_assembly.hpp"
#include "host/parallel.hpp"

namespace flexspline::batch {

/// States of effects at rows of runs: to step through a long run once is enough.
///
/// With a `lead`, memory goes back no further than so many rows: what comes in between two chunks
/// far apart is skipped, and the first rows after the skip are a guess that fades.
class StateCache {
 public:
  explicit StateCache(std::size_t lead = std::numeric_limits<std::size_t>::max()) : lead_(lead) {}

  std::size_t lead() const noexcept { return lead_; }

  /// Run, effect with its shapes, and what its load is made of.
  using Key = std::tuple<std::size_t, std::string, std::vector<double>>;

  std::map<std::size_t, AnyState>& at(const Key& key) { return known_[key]; }

  /// Held while somebody reads or adds to what is known.
  std::mutex& guard() noexcept { return guard_; }

 private:
  std::mutex guard_;
  std::size_t lead_;
  std::map<Key, std::map<std::size_t, AnyState>> known_;
};

/// Whom an effect's memory belongs to; the load counts where the effect reads it.
inline StateCache::Key key_of(const ColumnAssembly& assembly, std::size_t run,
                              const AnyEffect& effect) {
  StateCache::Key key{run, std::string(name_of(effect)), {}};
  for_each_shape(effect, [&](const auto&, double value) { std::get<2>(key).push_back(value); });
  const bool loaded = std::visit(
      [](const auto& e) { return reads<std::remove_cvref_t<decltype(e)>>(Channel::load); }, effect);
  std::size_t column = 0;
  for (const AnyEffect& other : assembly.design.effects()) {
    for (std::size_t k = 0; k < terms_of(other); ++k, ++column) {
      if (!loaded || assembly.load.empty() || assembly.load[column] == 0.0) continue;
      std::get<1>(key).append(" ").append(name_of(other));
      std::get<2>(key).push_back(assembly.load[column]);
    }
  }
  return key;
}

/// An effect whose memory is asked for, what is known of it, and the steps [first, second) that
/// lead from there, or from a fresh one `lead` rows before, to the rows that are not known yet.
struct StateRequest {
  std::size_t effect = 0;
  std::map<std::size_t, AnyState>* known = nullptr;
  std::vector<std::pair<std::size_t, std::size_t>> steps;
};

/// The steps to rows, in order. What one step finds is where the next may begin.
inline std::vector<std::pair<std::size_t, std::size_t>> steps_to(
    std::span<const std::size_t> rows, std::size_t lead,
    const std::map<std::size_t, AnyState>& known) {
  std::set<std::size_t> there;
  for (const auto& [row, state] : known) there.insert(row);
  std::vector<std::pair<std::size_t, std::size_t>> steps;
  for (const std::size_t row : std::set(rows.begin(), rows.end())) {
    if (row == 0 || there.contains(row)) continue;
    std::size_t from = row - std::min(row, lead);
    const auto behind = there.lower_bound(row);
    if (behind != there.begin()) from = std::max(from, *std::prev(behind));
    steps.emplace_back(from, row);
    there.insert(row);
  }
  return steps;
}

/// Adds the states behind each of the steps, which are the same for these effects.
inline void compute_states(const ColumnAssembly& assembly, const Channels& channels,
                           std::span<const StateRequest> together) {
  Memory memory;
  std::vector<std::size_t> which;
  for (const StateRequest& one : together) which.push_back(one.effect);
  for (const auto& [from, row] : together.front().steps) {
    memory = assembly.design.fresh();
    for (const StateRequest& one : together) {
      const auto before = one.known->find(from);
      if (before != one.known->end()) memory[one.effect] = before->second;
    }
    assembly.design.advance(channels, from, row, assembly.load, memory, which);
    for (const StateRequest& one : together) one.known->insert_or_assign(row, memory[one.effect]);
  }
}

/// The same of any effects, those with the same steps together: their rows are read once. Of many,
/// each thread takes some.
inline void compute_states(const ColumnAssembly& assembly, const Channels& channels,
                           std::vector<StateRequest> wanted, int threads) {
  std::stable_sort(wanted.begin(), wanted.end(),
                   [](const StateRequest& a, const StateRequest& b) { return a.steps < b.steps; });
  const std::size_t most = wanted.size() / static_cast<std::size_t>(std::max(threads, 1)) + 1;
  std::vector<std::span<const StateRequest>> parts;
  for (std::size_t first = 0, next = 0; first < wanted.size(); first = next) {
    while (next < wanted.size() && next - first < most &&
           wanted[next].steps == wanted[first].steps) {
      ++next;
    }
    parts.push_back(std::span(wanted).subspan(first, next - first));
  }
  parallel_blocks(parts.size(), threads,
                  [&](std::size_t p) { compute_states(assembly, channels, parts[p]); });
}

/// The memory before each chunk of a run; what is known is not stepped through again.
inline std::vector<Memory> memories_of(const ColumnAssembly& assembly, const Channels& channels,
                                       std::size_t run, std::span<const std::size_t> rows,
                                       StateCache& cache, int threads) {
  std::vector<Memory> found(rows.size(), assembly.design.fresh());
  if (!assembly.design.remembers()) return found;
  const std::lock_guard held(cache.guard());
  const auto& effects = assembly.design.effects();
  std::map<std::size_t, const std::map<std::size_t, AnyState>*> known;
  std::set<const std::map<std::size_t, AnyState>*> asked;
  std::vector<StateRequest> wanted;
  for (std::size_t k = 0; k < effects.size(); ++k) {
    if (!Design::remembers(effects[k])) continue;
    auto& states = cache.at(key_of(assembly, run, effects[k]));
    known[k] = &states;
    if (!asked.insert(&states).second) continue;
    wanted.push_back({k, &states, steps_to(rows, cache.lead(), states)});
  }
  compute_states(assembly, channels, std::move(wanted), threads);
  for (std::size_t p = 0; p < rows.size(); ++p) {
    for (const auto& [k, states] : known) {
      if (rows[p] > 0) found[p][k] = states->at(rows[p]);
    }
  }
  return found;
}

}  // namespace flexspline::batch
