/// Coefficients that follow a joint while it wears, warms or is greased anew.
///
///   y = (1/T) ∫ (τ̄ − τ_model) dt − Δp / T,     φ = (1/T) ∫ φ(t) dt,     p = J q̇,     over a block T
///   y = φ · θ + noise of standard deviation σ,     h = φ / σ,     e = (y − φ · θ) / σ
///
/// θ is what the coefficients have moved since the start, φ(t) the effects' own rows, τ̄ what drives
/// the momentum less the torque that is known from outside, τ_model the model as it was at the
/// start. The momentum's difference over a block is exact, so no acceleration is needed; the
/// integrals are trapezoids. Blocks are gathered in rounds of an eighth of the memory; at its end
///
///   W = Σ h hᵀ,     s = Σ h e                    of the round
///   W = Σ_i d_i l_i l_iᵀ,     s = Σ_i d_i z_i l_i    pivots first that say most of a coefficient
///   R ← R − (1 − λ) H (Hᵀ P H)⁻¹ Hᵀ              P = R⁻¹,     λ = e^(−t / memory)
///   R ← R + Σ_i d_i l_i l_iᵀ,     θ by the z_i     least squares
///
/// with H = (l_1 … l_r), the directions of which the round says enough. That is exponential forgetting
/// where all are excited, and what nothing excites keeps θ and P, however long: no wind-up. (Forgetting
/// along each single row instead is slower by the number of coefficients, and follows a drift with
/// a bias.) P = U D Uᵀ is kept as U and D; a change of R by ε h hᵀ is one pass of Bierman's recursion,
/// whose numbers α go from 1 to 1 + ε hᵀ P h without a change of sign, also where ε is negative:
/// D stays above zero in any precision. Directions are made orthogonal in P, so that forgetting
/// along one leaves the others to be forgotten as they were.
///
/// A block teaches where all of this holds; else it is as if it had not been:
///
///   motion    |q̇| ≥ least_speed in each sample: at rest friction is whatever it needs to be
///   clean     no sample of it, and none of the block behind it, has a contact or a flag
///   gate      |e| ≤ gate · √(1 + hᵀ P h): what is beyond is no wear, it is something that pushes
///
/// and a round says enough of a direction where d_i (half the range of its pivot's coefficient)² ≥
/// least_information: it is then known to a √(8 · least_information)th of half its range or better.
///
/// Of fewer directions than coefficients, as a joint that runs at one speed tells of level and
/// viscosity, their sum on these directions is followed and its split is that of P: a change of one
/// coefficient goes into all of them, and P does not show it, for nothing was forgotten beside. `told`
/// is the number of directions of the last round.
///
/// Each coefficient stays within [low, high]: one that would leave is held at its end, and the
/// others move as P says of them, given that one. One whose ends are equal is not adapted. D stays
/// below the square of half its range, and above what the number type can tell of that.
///
/// A sample that is not finite changes nothing, the next period is longer; one longer than the
/// interval, as a first sample, begins a block. Other coefficients in the model than at the start, as
/// a block of parameters brings them, begin anew: θ = 0, P of the configuration.
/// Source: restricted forgetting, [Kulhavy1987], here of a round's rows together, as [CaoSchwartz2000]
/// takes the information matrix apart for one ([ShinLee2020] compares such rules); U and D:
/// [Bierman1977], chapter V; the hold at an end of a range: projection in the metric of R, as
/// [GoodwinSin1984], chapter 3.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string_view>
#include <tuple>

#include "flexspline/fields.hpp"
#include "flexspline/math.hpp"
#include "flexspline/row.hpp"
#include "flexspline/status.hpp"

namespace flexspline {

/// What is done with what is learned.
enum class AdaptationUse : unsigned char {
  monitor,     ///< it is there to be read; no estimate changes
  compensate,  ///< the observer goes by it
};

/// Whose torque on the joint from outside is known while it learns.
enum class AdaptationLoad : unsigned char {
  free,    ///< there is none but in contact
  sensor,  ///< the sensor measures it
};

template <typename S, std::size_t N = 8>
struct Adaptation {
  static constexpr std::size_t most = N;
  static constexpr std::size_t packed = N * (N + 1) / 2;
  using Numbers = std::array<S, N>;
  /// Column by column above the diagonal, which holds D: d_0, u_01, d_1, u_02, u_12, d_2, …
  using Factor = std::array<S, packed>;

  struct Config {
    using Estimator = Adaptation;

    S noise = S(1);                ///< σ, Nm: standard deviation of a block's y around the model
    S interval = S(0.1L);          ///< s, > 0: how long a block is
    S memory = S(600);             ///< s of blocks that teach, after which one counts 1/e
    S gate = S(4);                 ///< standard deviations
    S least_speed = 0;             ///< rad/s at the output
    S least_information = S(100);  ///< of a round, squared standard deviations
    Numbers low{};                 ///< of the coefficients, in their units
    Numbers high{};
    Factor factor{};  ///< of P at the start, in the units of the coefficients
    AdaptationUse use = AdaptationUse::monitor;
    AdaptationLoad load = AdaptationLoad::free;

    static constexpr auto fields() noexcept {
      return std::tuple{
          Field{"noise", "Nm", &Config::noise, positive<S>},
          Field{"interval", "s", &Config::interval, positive<S>},
          Field{"memory", "s", &Config::memory, positive<S>},
          Field{"gate", "standard deviations", &Config::gate, positive<S>},
          Field{"least_speed", "rad/s at the output", &Config::least_speed, not_negative<S>},
          Field{"least_information", "squared standard deviations of a round",
                &Config::least_information, positive<S>},
          Field{"low", "of the coefficients", &Config::low, finite<S>},
          Field{"high", "of the coefficients", &Config::high, finite<S>},
          Field{"factor", "U and D of their covariance", &Config::factor, finite<S>}};
    }
    static constexpr auto rules() noexcept {
      return std::tuple{Rule{"use", "AdaptationUse", &Config::use,
                             std::array<std::string_view, 2>{"monitor", "compensate"}},
                        Rule{"load", "AdaptationLoad", &Config::load,
                             std::array<std::string_view, 2>{"free", "sensor"}}};
    }
  };

  /// y and φ of one instant, of a block's integral or of its mean.
  struct Equation {
    S torque = 0;  ///< Nm
    Numbers row{};
  };

  struct State {
    Numbers start{};       ///< coefficients that `moved` counts from
    Numbers moved{};       ///< θ
    Factor factor{};       ///< of P
    Equation last;         ///< of the last sample
    Equation sum;          ///< of the open block: integrals so far
    Equation waiting;      ///< of the whole block before, which teaches when the open one is clean
    Factor seen{};         ///< W of the round, column by column
    Numbers said{};        ///< s of the round
    S begin_momentum = 0;  ///< Nm s, of the open block
    S elapsed = 0;         ///< s, of the open block
    S waiting_time = 0;    ///< s, of the whole block; 0: there is none
    S round_time = 0;      ///< s, of the round's blocks
    S wait = 0;            ///< s since the last good sample, for a caller that counts it here
    bool started = false;
    bool open = false;
    std::uint8_t told = 0;  ///< directions of which the last round said enough
    std::uint32_t round_blocks = 0;
    std::uint32_t taught = 0;   ///< blocks, up to the most that it holds
    std::uint32_t refused = 0;  ///< blocks beyond the gate
  };

  struct Input {
    S period = 0;       ///< s since the last good sample
    S torque = 0;       ///< τ̄ − τ_model, Nm at the output
    S momentum = 0;     ///< p, Nm s
    S velocity = 0;     ///< rad/s at the output
    bool clean = true;  ///< neither contact nor flag; else nothing of it is looked at
    Numbers row{};      ///< φ
  };

  /// θ; 0 where the model's coefficients are not those that it began with.
  static constexpr Numbers moved(const State& state, const Numbers& model) noexcept {
    return state.started && state.start == model ? state.moved : Numbers{};
  }

  /// The model's coefficients as they are learned.
  static constexpr Numbers coefficients(const State& state, const Numbers& model) noexcept {
    Numbers made = moved(state, model);
    for (std::size_t k = 0; k < N; ++k) made[k] += model[k];
    return made;
  }

  /// U and D as they are learned.
  static constexpr Factor factor(const Config& config, const State& state,
                                 const Numbers& model) noexcept {
    return state.started && state.start == model ? state.factor : held(config);
  }

  /// What has begun is dropped, what was learned stays: before a gap and behind it.
  static constexpr void interrupt(State& state) noexcept {
    state.open = false;
    state.waiting_time = S(0);
  }

  /// `model`: its coefficients of these rows.
  static constexpr Status step(const Config& config, State& state, const Numbers& model,
                               const Input& in) noexcept {
    if (!math::is_positive(in.period)) return Status::bad_period;
    return advance(config, state, model, in);
  }

  /// The same for a period that is known to be good.
  static constexpr Status advance(const Config& config, State& state, const Numbers& model,
                                  const Input& in) noexcept {
    if (!in.clean) {
      interrupt(state);
      return Status::ok;
    }
    S all = in.torque + in.momentum + in.velocity;
    for (const S each : in.row) all += each;
    if (!math::is_finite(all)) return Status::not_finite;
    if (!state.started || !(state.start == model)) begin(config, state, model);
    if (!(math::absolute(in.velocity) >= config.least_speed)) {
      interrupt(state);
      return Status::ok;
    }
    const bool follows = state.open && in.period <= config.interval;
    if (!follows) {
      interrupt(state);
      open(state, in);
      return Status::ok;
    }
    integrate(state, in);
    if (state.elapsed < config.interval - S(0.5) * in.period) return Status::ok;  // the nearest
    if (state.waiting_time > S(0)) teach(config, state);
    state.waiting = mean(state, in.momentum);
    state.waiting_time = state.elapsed;
    open(state, in);
    return Status::ok;
  }

 private:
  /// Of the square of half a range, what D is at least.
  static constexpr S least = std::numeric_limits<S>::epsilon() * std::numeric_limits<S>::epsilon();
  static constexpr S rounds = S(0.125);                   ///< of the memory, that a round takes
  static constexpr std::uint32_t most_blocks = 1U << 16;  ///< of a round, for its sums in float

  static constexpr std::size_t diagonal(std::size_t k) noexcept { return k * (k + 3) / 2; }
  static constexpr std::size_t above(std::size_t j, std::size_t k) noexcept {
    return k * (k + 1) / 2 + j;
  }

  static constexpr void begin(const Config& config, State& state, const Numbers& model) noexcept {
    state = {};
    state.start = model;
    state.factor = held(config);
    state.started = true;
  }

  /// The factor of the configuration; what is not adapted has neither variance nor covariance.
  static constexpr Factor held(const Config& config) noexcept {
    const Numbers most = widest(config);
    Factor made = config.factor;
    for (std::size_t k = 0; k < N; ++k) {
      made[diagonal(k)] = math::clamp(made[diagonal(k)], least * most[k], most[k]);
      for (std::size_t j = 0; j < k; ++j) {
        if (!(most[j] > S(0)) || !(most[k] > S(0))) made[above(j, k)] = S(0);
      }
    }
    return made;
  }

  static constexpr void open(State& state, const Input& in) noexcept {
    state.last = {in.torque, in.row};
    state.sum = {};
    state.begin_momentum = in.momentum;
    state.elapsed = S(0);
    state.open = true;
  }

  static constexpr void integrate(State& state, const Input& in) noexcept {
    const S half = S(0.5) * in.period;
    state.sum.torque += half * (state.last.torque + in.torque);
    for (std::size_t k = 0; k < N; ++k) {
      state.sum.row[k] += half * (state.last.row[k] + in.row[k]);
    }
    state.last = {in.torque, in.row};
    state.elapsed += in.period;
  }

  static constexpr Equation mean(const State& state, S momentum) noexcept {
    const S share = S(1) / state.elapsed;
    Equation made;
    made.torque = share * (state.sum.torque - (momentum - state.begin_momentum));
    for (std::size_t k = 0; k < N; ++k) made.row[k] = share * state.sum.row[k];
    return made;
  }

  /// Squares of half the ranges: 0 where a coefficient is not adapted.
  static constexpr Numbers widest(const Config& config) noexcept {
    Numbers made{};
    for (std::size_t k = 0; k < N; ++k) {
      const S half = S(0.5) * (config.high[k] - config.low[k]);
      made[k] = half > S(0) ? half * half : S(0);
    }
    return made;
  }

  /// A row, and what comes of it: f = Uᵀ h, v = D f, ζ = f · v = hᵀ P h.
  struct Direction {
    Numbers f{}, v{};
    S zeta = 0;
  };

  static constexpr Direction direction(const Factor& factor, const Numbers& row) noexcept {
    Direction made;
    for (std::size_t k = 0; k < N; ++k) {
      S f = row[k];
      for (std::size_t j = 0; j < k; ++j) f += factor[above(j, k)] * row[j];
      made.f[k] = f;
      made.v[k] = factor[diagonal(k)] * f;
      made.zeta += f * made.v[k];
    }
    return made;
  }

  /// R ← R + ε h hᵀ; P h of before over α = 1 + ε ζ.
  static constexpr Numbers turn(Factor& factor, const Direction& way, S epsilon,
                                const Numbers& most) noexcept {
    Numbers gain{};
    S alpha = S(1);
    for (std::size_t k = 0; k < N; ++k) {
      const S before = alpha;
      alpha += epsilon * (way.f[k] * way.v[k]);
      const S along = -(epsilon * way.f[k]) / before;
      for (std::size_t j = 0; j < k; ++j) {
        S& u = factor[above(j, k)];
        const S was = u;
        u += along * gain[j];
        gain[j] += was * way.v[k];
      }
      gain[k] = way.v[k];
      S& d = factor[diagonal(k)];
      d = math::clamp(d * (before / alpha), least * most[k], most[k]);
    }
    for (std::size_t k = 0; k < N; ++k) gain[k] = most[k] > S(0) ? gain[k] / alpha : S(0);
    return gain;
  }

  static constexpr void count(std::uint32_t& number) noexcept {
    if (number != 0xFFFFFFFFU) ++number;
  }

  /// The block that waits goes into the round.
  static constexpr void teach(const Config& config, State& state) noexcept {
    const Numbers most = widest(config);
    const S share = S(1) / config.noise;
    const S error = share * (state.waiting.torque - weighted<S>(state.waiting.row, state.moved));
    Numbers h{};
    for (std::size_t k = 0; k < N; ++k) {
      if (most[k] > S(0)) h[k] = share * state.waiting.row[k];
    }
    const S spread = S(1) + direction(state.factor, h).zeta;
    if (!(error * error <= config.gate * config.gate * spread)) {
      count(state.refused);
      return;
    }
    for (std::size_t k = 0; k < N; ++k) {
      for (std::size_t j = 0; j <= k; ++j) state.seen[above(j, k)] += h[j] * h[k];
      state.said[k] += h[k] * error;
    }
    state.round_time += state.waiting_time;
    ++state.round_blocks;
    count(state.taught);
    if (state.round_time >= rounds * config.memory - S(0.5) * state.waiting_time ||
        state.round_blocks >= most_blocks) {
      finish(config, state, most);
    }
  }

  /// The directions of a round that say enough, most first.
  struct Round {
    std::array<Numbers, N> row{};  ///< l_i
    Numbers weight{}, seen{};      ///< d_i, z_i
    std::size_t count = 0;
  };

  /// The coefficient, over half its range, of which W says most.
  static constexpr std::size_t strongest(const Factor& seen, const Numbers& most) noexcept {
    std::size_t pivot = 0;
    for (std::size_t k = 1; k < N; ++k) {
      if (seen[diagonal(k)] * most[k] > seen[diagonal(pivot)] * most[pivot]) pivot = k;
    }
    return pivot;
  }

  static constexpr Round directions(const Config& config, const State& state,
                                    const Numbers& most) noexcept {
    Factor left = state.seen;
    Numbers said = state.said;
    Round made;
    while (made.count < N) {
      const std::size_t pivot = strongest(left, most);
      const S weight = left[diagonal(pivot)];
      const bool enough = weight * most[pivot] >= config.least_information && weight > S(0);
      if (!enough) break;
      Numbers& row = made.row[made.count];
      for (std::size_t k = 0; k < N; ++k) {
        row[k] = left[k < pivot ? above(k, pivot) : above(pivot, k)] / weight;
      }
      const S seen = said[pivot] / weight;
      for (std::size_t k = 0; k < N; ++k) {
        for (std::size_t j = 0; j <= k; ++j) left[above(j, k)] -= weight * (row[j] * row[k]);
        said[k] -= weight * (seen * row[k]);
      }
      left[diagonal(pivot)] = S(0);
      made.weight[made.count] = weight;
      made.seen[made.count++] = seen;
    }
    return made;
  }

  static constexpr void finish(const Config& config, State& state, const Numbers& most) noexcept {
    const Round round = directions(config, state, most);
    const S forgotten = -math::expm1_negative(state.round_time / config.memory);
    state.seen = {};
    state.said = {};
    state.round_time = S(0);
    state.round_blocks = 0;
    State next = state;
    forget(next.factor, round, forgotten, most);
    Numbers moved{};
    for (std::size_t i = 0; i < round.count; ++i) {
      const S weight = round.weight[i];
      const Direction way = direction(next.factor, round.row[i]);
      const S error = round.seen[i] - weighted<S>(round.row[i], moved);
      const Numbers gain = turn(next.factor, way, weight, most);
      for (std::size_t k = 0; k < N; ++k) moved[k] += weight * error * gain[k];
    }
    for (std::size_t k = 0; k < N; ++k) next.moved[k] += moved[k];
    hold(config, next, most);
    if (is_finite(next)) state = next;
    state.told = static_cast<std::uint8_t>(round.count);
  }

  /// R ← R − (1 − λ) H (Hᵀ P H)⁻¹ Hᵀ, a direction at a time, each orthogonal in P to those before.
  static constexpr void forget(Factor& factor, const Round& round, S forgotten,
                               const Numbers& most) noexcept {
    std::array<Numbers, N> rows{}, across{};
    for (std::size_t i = 0; i < round.count; ++i) {
      Numbers row = round.row[i];
      for (std::size_t j = 0; j < i; ++j) {
        const S shared = weighted<S>(row, across[j]);
        for (std::size_t k = 0; k < N; ++k) row[k] -= shared * rows[j][k];
      }
      const Direction way = direction(factor, row);
      if (!(way.zeta > S(0))) continue;
      const Numbers gain = turn(factor, way, -(forgotten / way.zeta), most);
      for (std::size_t k = 0; k < N; ++k) across[i][k] = gain[k] * (S(1) - forgotten) / way.zeta;
      rows[i] = row;
    }
  }

  /// Coefficients that left their ranges go to the ends, the others with them.
  static constexpr void hold(const Config& config, State& state, const Numbers& most) noexcept {
    for (std::size_t k = 0; k < N; ++k) {
      const S end = within(config, state, k) - state.moved[k];
      if (!(most[k] > S(0)) || end == S(0)) continue;
      Numbers column{};
      for (std::size_t j = 0; j < N; ++j) column[j] = covariance(state.factor, j, k);
      const S share = end / column[k];
      for (std::size_t j = 0; j < N; ++j) state.moved[j] += share * column[j];
    }
    for (std::size_t k = 0; k < N; ++k) {
      if (most[k] > S(0)) state.moved[k] = within(config, state, k);
    }
  }

  /// θ_k held within the range of its coefficient.
  static constexpr S within(const Config& config, const State& state, std::size_t k) noexcept {
    return math::clamp(state.moved[k], config.low[k] - state.start[k],
                       config.high[k] - state.start[k]);
  }

  /// P_jk.
  static constexpr S covariance(const Factor& factor, std::size_t j, std::size_t k) noexcept {
    S sum = S(0);
    for (std::size_t m = j < k ? k : j; m < N; ++m) {
      const S left = m == j ? S(1) : factor[above(j, m)];
      const S right = m == k ? S(1) : factor[above(k, m)];
      sum += left * factor[diagonal(m)] * right;
    }
    return sum;
  }

  static constexpr bool is_finite(const State& state) noexcept {
    bool finite = true;
    for (std::size_t k = 0; k < N; ++k) {
      finite &= math::is_finite(state.moved[k]);
    }
    for (const S each : state.factor) finite &= math::is_finite(each);
    return finite;
  }
};

}  // namespace flexspline
