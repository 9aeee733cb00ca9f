#include <doctest/doctest.h>

#include <limits>
#include <set>
#include <string_view>

#include "random_samples.hpp"

using namespace flexspline;

namespace {

static_assert(is_unit("1") && is_unit("kg·m²") && is_unit("Nm·s²/rad²") && is_unit("rad/(Nm·K)"));
static_assert(!is_unit("") && !is_unit("Nm·√s") && !is_unit("Nm·") && !is_unit("Nm/s/s"));
static_assert(!is_unit("rad/(Nm") && !is_unit("Nm\n") && !is_unit("s^½"));

template <typename S, typename Effect>
consteval auto row_by_the_compiler() {
  Effect effect;
  Sample<S> at;
  StateOf<Effect> state;
  return row_of<S>(effect, at, state);
}

/// Whether an effect reads a channel: of several that may drive it, only the one in use.
template <typename Effect>
bool reads_now(const Effect& effect, Channel channel) {
  if constexpr (requires { effect.paths; }) {
    for (std::size_t k = 0; k < effect.paths.size(); ++k) {
      if (effect.paths[k].channel == channel) return static_cast<std::size_t>(effect.path) == k;
    }
  }
  return reads<Effect>(channel);
}

/// Calls use(effect) for each of its paths.
template <typename Effect, typename Use>
void for_each_path(Effect effect, Use use) {
  if constexpr (requires { effect.paths; }) {
    for (std::size_t k = 0; k < effect.paths.size(); ++k) {
      effect.path = static_cast<decltype(effect.path)>(k);
      use(std::as_const(effect));
    }
  } else {
    use(std::as_const(effect));
  }
}

/// Replaces what `channel` holds by something else.
template <typename S>
void disturb(Sample<S>& at, Channel channel, std::mt19937_64& random) {
  const Sample<S> other = usual_sample<S>(random);
  for (const Number<S>& number : numbers<S>) {
    if (number.channel == channel) at.*number.at = other.*number.at;
  }
  if (channel == Channel::output_position) at.output_position = other.output_position;
  if (channel == Channel::motor_position) {
    at.motor_position = other.motor_position;
    at.wave_generator_on_flexspline = other.wave_generator_on_flexspline;
    at.wave_generator_on_circular_spline = other.wave_generator_on_circular_spline;
  }
  if (channel == Channel::load) {
    at.load = other.load;
    at.known_load = other.known_load;
  }
}

constexpr std::array<Channel, 9> channels{
    Channel::output_position, Channel::output_velocity, Channel::output_acceleration,
    Channel::motor_position,  Channel::temperature,     Channel::load,
    Channel::motor_torque,    Channel::period,          Channel::time};

}  // namespace

TEST_CASE_TEMPLATE("every effect has a name of its own", S, float, double) {
  std::set<std::string_view> names;
  for_each_effect<S>(
      [&]<typename Effect>(const Effect& effect) { CHECK(names.insert(effect.name).second); });
  for_each_effect<S>([&]<typename Effect>(const Effect& effect) {
    for (const std::string_view name : combines_of<Effect>()) CHECK(names.contains(name));
    if constexpr (requires { effect.shapes(); }) {
      for (const auto& shape : effect.shapes()) {
        const bool another = !shape.owner.empty() && shape.owner != of_model;
        CHECK((!another || names.contains(shape.owner)));
      }
    }
  });
}

TEST_CASE_TEMPLATE("every row can be had without exceptions and by the compiler", S, float,
                   double) {
  for_each_effect<S>([]<typename Effect>(const Effect&) {
    static_assert(noexcept(row_of(std::declval<const Effect&>(), std::declval<const Sample<S>&>(),
                                  std::declval<StateOf<Effect>&>())));
    if constexpr (Remembers<Effect>) {
      static_assert(std::is_trivially_copyable_v<StateOf<Effect>>);
      static_assert(noexcept(std::declval<const Effect&>().settled(StateOf<Effect>{})));
    }
    static_assert(row_by_the_compiler<S, Effect>().size() == width_of<S, Effect>);
  });
}

TEST_CASE_TEMPLATE("a row depends on the channels that it names and on no other", S, float,
                   double) {
  for_each_effect<S>([]<typename Effect>(const Effect& each) {
    for_each_path(each, [](const Effect& effect) {
      CAPTURE(effect.name);
      std::mt19937_64 random(21);
      for (const Channel channel : channels) {
        bool changed = false;
        for (int i = 0; i < 100; ++i) {
          const auto first = usual_sample<S>(random);
          auto at = usual_sample<S>(random);
          at.output_velocity *= S(0.001);
          const auto before = second_row<S>(effect, first, at);
          disturb(at, channel, random);
          changed |= second_row<S>(effect, first, at) != before;
        }
        CHECK(changed == reads_now(effect, channel));
      }
    });
  });
}

TEST_CASE_TEMPLATE("an effect is constant where its row never changes, and there alone", S, float,
                   double) {
  for_each_effect<S>([]<typename Effect>(const Effect& effect) {
    CAPTURE(effect.name);
    std::mt19937_64 random(24);
    const auto first = usual_sample<S>(random);
    const auto row = second_row<S>(effect, first, usual_sample<S>(random));
    bool changed = false;
    for (int i = 0; i < 100; ++i) {
      changed |= second_row<S>(effect, first, usual_sample<S>(random)) != row;
    }
    CHECK(changed != Effect::traits.constant);
  });
}

TEST_CASE_TEMPLATE("an effect is inertial where its row is the acceleration, and there alone", S,
                   float, double) {
  for_each_effect<S>([]<typename Effect>(const Effect& effect) {
    CAPTURE(effect.name);
    std::mt19937_64 random(25);
    bool same = true;
    for (int i = 0; i < 100; ++i) {
      const auto at = usual_sample<S>(random);
      for (const S value : second_row<S>(effect, at, at)) same &= value == at.output_acceleration;
    }
    CHECK(same == Effect::traits.inertial);
  });
}

TEST_CASE_TEMPLATE("what dissipates brakes at each sample, or gives no energy around a loop", S,
                   float, double) {
  for_each_effect<S>([]<typename Effect>(const Effect& each) {
    if constexpr (Effect::traits.dissipative) {
      for_each_path(each, [](const Effect& effect) {
        CAPTURE(effect.name);
        std::mt19937_64 random(26);
        if constexpr (!Effect::traits.loop) {
          S work = 0;
          for (int i = 0; i < 100; ++i) {
            const auto at = usual_sample<S>(random);
            for (const S value : second_row<S>(effect, at, at)) {
              CHECK(value * at.output_velocity >= S(0));
              work += value * at.output_velocity;
            }
          }
          CHECK(work > S(0));
          return;
        }
        // there and back, far beyond every width and by steps below them, once settled
        StateOf<Effect> state{};
        S work[4]{};
        constexpr int steps = 4000;
        for (int round = 0; round < 2; ++round) {
          for (int i = 0; i < steps; ++i) {
            const double x = std::sin(2 * 3.141592653589793 * i / steps);
            const double before = std::sin(2 * 3.141592653589793 * (i - 1) / steps);
            Sample<S> at;
            at.load = S(50 * x);
            at.output_position.phase = Angle<S>::from_turns(S(0.02 * x)).phase;
            at.motor_position.phase = Angle<S>::from_turns(S(0.4 * x)).phase;
            const auto row = row_of<S>(effect, at, state);
            // a motor ahead of an output that rubs leaves a torsion behind its own angle
            const S sign = reads_now(effect, Channel::motor_position) ? S(-1) : S(1);
            for (std::size_t k = 0; k < 4; ++k) {
              if (round == 1) work[k] += sign * row[k] * S(x - before);
            }
          }
        }
        for (const S one : work) CHECK(one > S(0));
      });
    }
  });
}

TEST_CASE_TEMPLATE("a loop depends on the way and not on how fast it was gone", S, float, double) {
  for_each_effect<S>([]<typename Effect>(const Effect& each) {
    for_each_path(each, [](const Effect& effect) {
      if constexpr (Remembers<Effect>) {
        CAPTURE(effect.name);
        std::mt19937_64 random(27);
        bool same = true;
        for (int i = 0; i < 100; ++i) {
          const auto first = usual_sample<S>(random);
          auto at = usual_sample<S>(random);
          const auto row = second_row<S>(effect, first, at);
          at.period *= S(3);
          at.output_velocity *= S(1.0 / 3.0);
          same &= second_row<S>(effect, first, at) == row;
        }
        CHECK(same == Effect::traits.loop);
      }
    });
  });
}

TEST_CASE("columns that combine others' lie in their span") {
  // (1 ± d)/2 of the column d(v) of Coulomb friction, and 1 of the offset
  std::mt19937_64 random(28);
  const CoulombFrictionPerDirection<double> both;
  const CoulombFriction<double> level;
  const Offset<double> offset;
  for (int i = 0; i < 100; ++i) {
    const auto at = usual_sample<double>(random);
    const auto row = both.row(at);
    CHECK(row[0] + row[1] == doctest::Approx(offset.row(at)[0]));
    CHECK(row[0] - row[1] == doctest::Approx(level.row(at)[0]));
  }
}

TEST_CASE_TEMPLATE("a torque is linear in the coefficients", S, float, double) {
  for_each_effect<S>([]<typename Effect>(const Effect& effect) {
    CAPTURE(effect.name);
    std::mt19937_64 random(22);
    std::normal_distribution<double> normal;
    for (int i = 0; i < 100; ++i) {
      const auto at = usual_sample<S>(random);
      const auto first = usual_sample<S>(random);
      Part<S, Effect> one{effect}, other{effect}, both{effect}, twice{effect};
      S size = 0;
      const auto row = second_row<S>(effect, first, at);
      const auto torque = [&](const Part<S, Effect>& part) {
        return weighted<S>(second_row<S>(part.effect, first, at), part.coefficients);
      };
      for (std::size_t k = 0; k < row.size(); ++k) {
        one.coefficients[k] = S(normal(random));
        other.coefficients[k] = S(normal(random));
        both.coefficients[k] = one.coefficients[k] + other.coefficients[k];
        twice.coefficients[k] = 2 * one.coefficients[k];
        size += math::absolute(row[k]) *
                (math::absolute(one.coefficients[k]) + math::absolute(other.coefficients[k]));
      }
      CHECK(torque(twice) == 2 * torque(one));
      // each of 2n products and sums, twice, rounds once
      const S bound = size * std::numeric_limits<S>::epsilon() * S(2 * row.size() + 2);
      CHECK(math::absolute(torque(both) - torque(one) - torque(other)) <= bound);
    }
  });
}

TEST_CASE_TEMPLATE("rows are finite for any finite sample whose powers are", S, float, double) {
  const S cube_root = sizeof(S) == 4 ? S(1e12) : S(1e102);
  for_each_effect<S>([&]<typename Effect>(const Effect& effect) {
    CAPTURE(effect.name);
    std::mt19937_64 random(23);
    StateOf<Effect> state;
    for (int i = 0; i < 20000; ++i) {
      auto at = any_sample<S>(random);
      at.output_velocity = math::clamp(at.output_velocity, -cube_root, cube_root);
      at.temperature = math::clamp(at.temperature, -cube_root, cube_root);
      at.load = math::clamp(at.load, -cube_root, cube_root);
      for (const S value : row_of<S>(effect, at, state)) CHECK(math::is_finite(value));
    }
  });
}

TEST_CASE_TEMPLATE("shapes lie within their bounds", S, float, double) {
  for_each_effect<S>([]<typename Effect>(const Effect& effect) {
    if constexpr (requires { effect.shapes(); }) {
      for (const auto& shape : effect.shapes()) {
        CHECK(effect.*shape.field >= shape.lower);
        CHECK(effect.*shape.field <= shape.upper);
        CHECK_FALSE(shape.unit.empty());
      }
    }
  });
}
