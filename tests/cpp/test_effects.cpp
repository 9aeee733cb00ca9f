#include <doctest/doctest.h>

#include <limits>
#include <set>
#include <string_view>

#include "random_samples.hpp"

using namespace flexspline;

namespace {

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
  switch (channel) {
    case Channel::output_position:
      at.output_position = other.output_position;
      break;
    case Channel::output_velocity:
      at.output_velocity = other.output_velocity;
      break;
    case Channel::output_acceleration:
      at.output_acceleration = other.output_acceleration;
      break;
    case Channel::motor_position:
      at.motor_position = other.motor_position;
      at.wave_generator_on_flexspline = other.wave_generator_on_flexspline;
      at.wave_generator_on_circular_spline = other.wave_generator_on_circular_spline;
      break;
    case Channel::temperature:
      at.temperature = other.temperature;
      break;
    case Channel::load:
      at.load = other.load;
      at.known_load = other.known_load;
      break;
    case Channel::motor_torque:
      at.motor_torque = other.motor_torque;
      break;
    case Channel::period:
      at.period = other.period;
      break;
    case Channel::time:
      at.time = other.time;
      break;
  }
}

constexpr std::array<Channel, 9> channels{
    Channel::output_position, Channel::output_velocity, Channel::output_acceleration,
    Channel::motor_position,  Channel::temperature,     Channel::load,
    Channel::motor_torque,    Channel::period,          Channel::time};

}  // namespace

TEST_CASE_TEMPLATE("every effect has a name of its own, targets, a source, terms", S, float,
                   double) {
  std::set<std::string_view> names;
  for_each_effect<S>([&]<typename Effect>(const Effect& effect) {
    CHECK(names.insert(effect.name).second);
    CHECK_FALSE(effect.targets.empty());
    CHECK_FALSE(effect.source.empty());
    CHECK_FALSE(effect.signature.empty());
    CHECK_FALSE(effect.terms.empty());
    CHECK(effect.targets.find_first_not_of("SMD") == std::string_view::npos);
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

TEST_CASE_TEMPLATE("what carries load does not read it", S, float, double) {
  for_each_effect<S>([]<typename Effect>(const Effect&) {
    if (CarriesLoad<Effect>) CHECK_FALSE(reads<Effect>(Channel::load));
  });
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
