// Writes small inputs for both fuzzers into two folders: make_seeds STEP BLOCK.
//
// For each of some chains: a calm run; each field of a reading in turn with values at the edges of
// its precision; a good block as it stands, cut short, and with other numbers and readings behind.
#include <cstdio>
#include <limits>
#include <string>
#include <vector>

#include "flexspline/block.hpp"
#include "step_invariants.hpp"
#include "whole_joint.hpp"

namespace {

using namespace flexspline;
using namespace flexspline::fuzz;

using Seed = std::vector<std::uint8_t>;

template <typename T>
void add(Seed& seed, const T& value) {
  const auto* bytes = reinterpret_cast<const std::uint8_t*>(&value);
  seed.insert(seed.end(), bytes, bytes + sizeof value);
}

void write(const std::string& folder, const Seed& seed) {
  static int number = 0;
  const std::string path = folder + "/seed" + std::to_string(number++);
  std::FILE* file = std::fopen(path.c_str(), "wb");
  require(file != nullptr, "a seed is written");
  require(std::fwrite(seed.data(), 1, seed.size(), file) == seed.size(), "a seed is whole");
  require(std::fclose(file) == 0, "a seed is closed");
}

Seed begun(std::uint16_t choice, std::uint8_t how) {
  Seed seed;
  add(seed, choice);
  add(seed, how);
  return seed;
}

/// Nine readings, each with one field that is not calm, and two calm ones.
template <typename S>
void add_readings(Seed& seed, S value) {
  for (int field = 0; field < 9; ++field) {
    add(seed, static_cast<std::uint16_t>(1U << field));
    add(seed, value);
  }
  add(seed, std::uint32_t(0));
}

/// The block as the first version wrote it, without the limits of readings.
template <typename S>
void add_old_block(Seed& seed, const WholeJoint<S>& joint, Seed bytes) {
  block::Outline<S> outline;
  parameters::visit_unlimited(outline, joint);
  const std::size_t last = block::head + outline.size;
  bytes.resize(last + block::tail);
  bytes[4] = 1;
  block::write(std::span(bytes), 8, outline.crc.value());
  block::write(std::span(bytes), 12, static_cast<std::uint32_t>(outline.size));
  Crc32 crc;
  crc.add(Bytes(bytes).first(last));
  block::write(std::span(bytes), last, crc.value());
  seed.insert(seed.end(), bytes.begin(), bytes.end());
}

template <typename S>
void write_seeds(const std::string& steps, const std::string& blocks, std::uint16_t choice) {
  using Limits = std::numeric_limits<S>;
  const std::uint8_t precision = sizeof(S) == 8 ? 1 : 0;
  for (const S value : {Limits::quiet_NaN(), Limits::infinity(), Limits::max(), Limits::lowest(),
                        Limits::denorm_min(), S(0), S(1e6)}) {
    Seed seed = begun(choice, precision);
    add_readings(seed, value);
    write(steps, seed);
  }
  const WholeJoint<S> joint = whole_joint<S>(choice);
  Seed block(block_size(joint));
  std::size_t size = 0;
  require(save(joint, block, size) == BlockStatus::ok, "a joint is saved");
  Seed whole = begun(choice, static_cast<std::uint8_t>(precision | 2));
  whole.insert(whole.end(), block.begin(), block.end());
  write(blocks, whole);
  whole.resize(whole.size() / 2);
  write(blocks, whole);
  Seed old = begun(choice, static_cast<std::uint8_t>(precision | 2));
  add_old_block(old, joint, block);
  write(blocks, old);
  Seed other = begun(choice, precision);
  add(other, std::uint16_t(2));
  add(other, std::uint16_t(0x0101));
  add_readings(other, S(1));
  write(blocks, other);
}

}  // namespace

int main(int count, char** arguments) {
  if (count != 3) return 2;
  constexpr std::uint16_t all = sensor_by_voltage | kalman | lagging | checked | derived;
  for (const std::uint16_t choice :
       {std::uint16_t(0), all, std::uint16_t(no_sensor | by_euler | checked),
        std::uint16_t(by_motor | at_rest_by_link | watched_high | adapting | compensating)}) {
    write_seeds<float>(arguments[1], arguments[2], choice);
    write_seeds<double>(arguments[1], arguments[2], choice);
  }
}
