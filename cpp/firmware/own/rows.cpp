// An effect of the user's own as a library: what its header says of it, and its rows.
//
// Compiled with `-include hump.hpp -DFLEXSPLINE_OWN=Hump`; loaded by `python/flexspline/own`.
#include <cstddef>
#include <string>

#include "flexspline/effects/effect.hpp"

namespace {

template <typename S>
using Own = flexspline::FLEXSPLINE_OWN<S>;
using Effect = Own<double>;

static_assert(flexspline::PhysicalEffect<Own<float>, float> &&
                  flexspline::PhysicalEffect<Own<double>, double>,
              "it does not keep the contract of flexspline/effects/effect.hpp");
static_assert(!flexspline::Remembers<Effect> && !flexspline::HarmonicEffect<Effect>,
              "an effect of one's own has no State and no orders");
static_assert(!Effect::traits.carries_load,
              "an effect of one's own is no part of the load that others read");

/// Calls use(shape) for each shape of the effect.
template <typename Use>
void for_each_shape(Use use) {
  if constexpr (requires { Effect::shapes(); }) {
    for (const auto& shape : Effect::shapes()) use(shape);
  }
}

/// A line for each thing: what it is, its name, and its unit where it has one; tabs between.
std::string describe() {
  std::string all = "name\t" + std::string(Effect::name);
  const auto add = [&all](const char* what, std::string_view name, std::string_view unit) {
    all += "\n" + std::string(what) + "\t" + std::string(name) + "\t" + std::string(unit);
  };
  for (const flexspline::Channel channel : Effect::reads) {
    add("reads", flexspline::channel_names[std::size_t(channel)], "");
  }
  for (const flexspline::Term& term : Effect::terms) add("term", term.name, term.unit);
  for_each_shape([&](const auto& shape) { add("shape", shape.name, shape.unit); });
  return all;
}

void set(flexspline::Sample<double>& at, flexspline::Channel channel, double value) {
  const auto angle = flexspline::Angle<double>::from_radians(value);
  if (channel == flexspline::Channel::output_position) at.output_position = angle;
  if (channel == flexspline::Channel::motor_position) at.motor_position = angle;
  for (const auto& number : flexspline::numbers<double>) {
    if (number.channel == channel) at.*number.at = value;
  }
}

}  // namespace

extern "C" [[gnu::visibility("default")]] const char* flexspline_own_description() {
  static const std::string all = describe();
  return all.c_str();
}

/// Rows to out, term after term of a sample; channels and shapes in the header's order.
extern "C" [[gnu::visibility("default")]] void flexspline_own_rows(std::size_t size,
                                                                   const double* const* channels,
                                                                   const double* shapes,
                                                                   double* out) {
  Effect effect;
  for_each_shape([&](const auto& shape) { effect.*shape.field = *shapes++; });
  for (std::size_t i = 0; i < size; ++i) {
    flexspline::Sample<double> at;
    std::size_t k = 0;
    for (const flexspline::Channel channel : Effect::reads) set(at, channel, channels[k++][i]);
    for (const double value : effect.row(at)) *out++ = value;
  }
}
