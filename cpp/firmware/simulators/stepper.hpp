/// The model of an exported header under a simulator's clock, as its FMU and its S-function have it.
///
/// Inputs hold until they are set anew. `at` says what the model makes of them at a time and changes
/// nothing. `accept` says that they were those of that time: what effects remember moves on.
#pragma once

#include <array>
#include <cstddef>
#include <tuple>
#include <utility>

#include "flexspline/model.hpp"

namespace simulators {

/// What a model says at a time: the whole, then each of its effects in their order. While the
/// status is not `ok` these are the last good values, as on a device.
template <std::size_t parts>
struct Said {
  std::array<double, parts + 1> values{};
  flexspline::Status status = flexspline::Status::ok;
};

/// `Model` is that of an exported header, in double.
template <typename Model>
class Stepper {
  using Channel = flexspline::Channel;
  using State = typename Model::State;
  using Parts = decltype(Model::parts);

 public:
  static constexpr std::size_t parts = std::tuple_size_v<Parts>;
  static constexpr std::size_t channels = flexspline::channel_names.size();

  constexpr explicit Stepper(const Model& model) noexcept : model_(&model) {
    inputs_[std::size_t(Channel::temperature)] = flexspline::Sample<double>{}.temperature;
  }

  /// Whether a channel is an input: `load` is the known load; time and period are the simulator's.
  constexpr bool takes(Channel channel) const noexcept {
    if (channel == Channel::period || channel == Channel::time) return false;
    const bool turns = Model::uses(Channel::motor_position);
    if (channel == Channel::motor_position) return turns && model_->gear.motor_encoder;
    return Model::uses(channel) || (turns && channel == Channel::output_position);
  }

  /// An input, in SI units: the log format's, angles in radians.
  constexpr double& input(Channel channel) noexcept { return inputs_[std::size_t(channel)]; }

  /// Time counts from here; nothing is remembered. Inputs stay.
  constexpr void start(double time) noexcept {
    start_ = last_ = time;
    fresh_ = true;
    state_ = {};
    good_ = {};
  }

  constexpr Said<parts> at(double time) const noexcept {
    State next = state_;
    return said(time, next);
  }

  constexpr flexspline::Status accept(double time) noexcept {
    const Said<parts> found = said(time, state_);
    if (found.status != flexspline::Status::ok) return found.status;
    good_ = found.values;
    last_ = time;
    fresh_ = false;
    return found.status;
  }

 private:
  /// What the model says, and the state behind that.
  constexpr Said<parts> said(double time, State& state) const noexcept {
    Said<parts> found{good_, flexspline::Status::ok};
    flexspline::Sample<double> sample;
    found.status = fill(sample, time);
    if (found.status != flexspline::Status::ok) return found;
    State before = state;
    found.status = model_->predict(sample, state, found.values[0]);
    if (found.status != flexspline::Status::ok) return found;
    model_->prepare(sample);
    each(sample, before, found, std::make_index_sequence<parts>{});
    return found;
  }

  constexpr flexspline::Status fill(flexspline::Sample<double>& sample,
                                    double time) const noexcept {
    for (const auto& number : flexspline::numbers<double>) {
      sample.*number.at = inputs_[std::size_t(number.channel)];
    }
    sample.known_load = inputs_[std::size_t(Channel::load)];
    sample.time = time - start_;
    sample.period = fresh_ ? 1.0 : time - last_;  // any at the first
    flexspline::Status status = flexspline::Status::ok;
    const auto read = [&](Channel channel, flexspline::Angle<double>& angle) {
      if (status != flexspline::Status::ok || !takes(channel)) return;
      status = flexspline::read_radians(inputs_[std::size_t(channel)], angle);
    };
    read(Channel::output_position, sample.output_position);
    read(Channel::motor_position, sample.motor_position);
    return status;
  }

  template <std::size_t... k>
  constexpr void each([[maybe_unused]] const flexspline::Sample<double>& sample,
                      [[maybe_unused]] State& state, [[maybe_unused]] Said<parts>& found,
                      std::index_sequence<k...>) const noexcept {
    ((found.values[k + 1] = part<k>(sample, state)), ...);
  }

  template <std::size_t k>
  constexpr double part(const flexspline::Sample<double>& sample,
                        [[maybe_unused]] State& state) const noexcept {
    const auto& one = std::get<k>(model_->parts);
    if constexpr (flexspline::Remembers<decltype(one.effect)>) {
      return one.torque(sample, flexspline::state_of<k>(state));
    } else {
      return one.torque(sample);
    }
  }

  const Model* model_;
  std::array<double, channels> inputs_{};
  std::array<double, parts + 1> good_{};
  double start_ = 0, last_ = 0;
  bool fresh_ = true;
  State state_{};
};

}  // namespace simulators
