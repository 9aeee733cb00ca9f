/// Parameters as a block of bytes, which replaces those of a running program.
///
///   offset  bytes
///   0       4      "FLXJ"
///   4       1      version of this layout: 2; 1, which has no limits of readings, is read too
///   5       1      bytes of a number: 4 (float) or 8 (double)
///   6       2      0
///   8       4      structure: CRC-32 of what a program has to be compiled with (parameters.hpp)
///   12      4      n
///   16      n      numbers and integers in the order of `parameters::visit`
///   16 + n  4      CRC-32 of all bytes before
///
/// Little-endian whatever the machine. An integer has 4 bytes; a gear is whole ratio, fraction
/// (low word, high word), spline, motor encoder; a harmonic is order, pair. The CRC is that of zlib
/// (ISO 3309, reflected 0xEDB88320). What lies behind the block is not looked at. `load` changes
/// either everything or nothing; with a block of version 1, the limits become those of a joint that
/// nothing is known of (reading_limits.hpp), for the program's own belong to other parameters.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>

#include "flexspline/parameters.hpp"

namespace flexspline {

enum class [[nodiscard]] BlockStatus : std::uint8_t {
  ok = 0,
  truncated = 1,        ///< fewer bytes than it says or needs
  not_a_block = 2,      ///< does not begin with "FLXJ"
  older = 3,            ///< of a version that this core no longer reads
  newer = 4,            ///< of a version that this core does not know
  corrupt = 5,          ///< the CRC does not fit
  other_scalar = 6,     ///< float for a double program, or the reverse
  other_structure = 7,  ///< made for other effects, orders, stages or rules
  out_of_range = 8,     ///< a number that the core refuses
  no_room = 9,          ///< the bytes to write into are too few
  busy = 10,            ///< the parameters before are still to be taken (swap.hpp)
};

using Bytes = std::span<const std::uint8_t>;

/// The CRC-32 of zlib, from half a byte at a time: 64 bytes of table.
class Crc32 {
 public:
  constexpr void add(std::uint8_t byte) noexcept {
    rest_ ^= byte;
    rest_ = (rest_ >> 4) ^ table[rest_ & 15];
    rest_ = (rest_ >> 4) ^ table[rest_ & 15];
  }
  constexpr void add(Bytes bytes) noexcept {
    for (const std::uint8_t byte : bytes) add(byte);
  }
  constexpr std::uint32_t value() const noexcept { return ~rest_; }

 private:
  static constexpr std::array<std::uint32_t, 16> table = [] {
    std::array<std::uint32_t, 16> made{};
    for (std::uint32_t k = 0; k < 16; ++k) {
      std::uint32_t rest = k;
      for (int bit = 0; bit < 4; ++bit) rest = (rest >> 1) ^ ((rest & 1) ? 0xEDB88320u : 0u);
      made[k] = rest;
    }
    return made;
  }();
  std::uint32_t rest_ = 0xFFFFFFFFu;
};

namespace block {

inline constexpr std::array<std::uint8_t, 4> mark{'F', 'L', 'X', 'J'};
inline constexpr std::uint8_t oldest = 1;
inline constexpr std::uint8_t version = 2;
inline constexpr std::uint8_t first_with_limits = 2;
inline constexpr std::size_t head = 16;
inline constexpr std::size_t tail = 4;

template <typename Word>
constexpr Word read(Bytes bytes, std::size_t at) noexcept {
  Word value = 0;
  for (std::size_t k = 0; k < sizeof(Word); ++k) value |= Word(bytes[at + k]) << (8 * k);
  return value;
}

template <typename Word>
constexpr void write(std::span<std::uint8_t> bytes, std::size_t at, Word value) noexcept {
  for (std::size_t k = 0; k < sizeof(Word); ++k) {
    bytes[at + k] = static_cast<std::uint8_t>(value >> (8 * k));
  }
}

/// The structure's CRC and the bytes of its numbers.
template <typename S>
struct Outline {
  Crc32 crc;
  std::size_t size = 0;

  constexpr void add(std::string_view name, std::size_t count) noexcept {
    for (const char letter : name) crc.add(static_cast<std::uint8_t>(letter));
    crc.add(std::uint8_t(0));
    crc.add(static_cast<std::uint8_t>(count));
    crc.add(static_cast<std::uint8_t>(count >> 8));
  }
  constexpr void structure(std::string_view name) noexcept { add(name, 0); }
  constexpr void numbers(std::string_view name, const S*, std::size_t count, Range<S>) noexcept {
    add(name, count);
    size += count * sizeof(S);
  }
  constexpr void harmonic(const Harmonic&) noexcept {
    add("harmonic", 1);
    size += 2 * 4;
  }
  constexpr void gear(const Gear<S>&) noexcept {
    add("gear", 1);
    size += 5 * 4;
  }
};

/// Whether every number of a block may be taken; or, `taking`, the numbers taken.
template <typename S, bool taking>
struct Reader {
  template <typename T>
  using Given = std::conditional_t<taking, T, const T>;

  Bytes bytes;
  std::size_t at = head;
  bool good = true;

  constexpr std::uint32_t word() noexcept {
    at += 4;
    return read<std::uint32_t>(bytes, at - 4);
  }
  constexpr void structure(std::string_view) noexcept {}
  constexpr void numbers(std::string_view, Given<S>* first, std::size_t count,
                         Range<S> range) noexcept {
    for (std::size_t k = 0; k < count; ++k, at += sizeof(S)) {
      const S value = std::bit_cast<S>(read<math::Bits<S>>(bytes, at));
      good = good && range.has(value);
      if constexpr (taking) first[k] = value;
    }
  }
  constexpr void harmonic(Given<Harmonic>& h) noexcept {
    const std::uint32_t order = word();
    const std::uint32_t pair = word();
    good = good && order > 0 &&
           pair <= static_cast<std::uint32_t>(Pair::wave_generator_on_circular_spline);
    if constexpr (taking) h = {order, static_cast<Pair>(pair)};
  }
  constexpr void gear(Given<Gear<S>>& g) noexcept {
    const std::uint32_t whole = word();
    const std::uint64_t low = word();
    const std::uint64_t high = word();
    const std::uint32_t spline = word();
    const std::uint32_t encoder = word();
    good = good && whole <= (1u << 30) &&
           spline <= static_cast<std::uint32_t>(OutputSpline::flex) && encoder <= 1;
    if constexpr (taking) {
      g = {whole, {low | high << 32}, static_cast<OutputSpline>(spline), encoder == 1};
    }
  }
};

template <typename S>
struct Writer {
  std::span<std::uint8_t> bytes;
  std::size_t at = head;

  constexpr void word(std::uint32_t value) noexcept {
    write(bytes, at, value);
    at += 4;
  }
  constexpr void structure(std::string_view) noexcept {}
  constexpr void numbers(std::string_view, const S* first, std::size_t count, Range<S>) noexcept {
    for (std::size_t k = 0; k < count; ++k, at += sizeof(S)) {
      write(bytes, at, std::bit_cast<math::Bits<S>>(first[k]));
    }
  }
  constexpr void harmonic(const Harmonic& h) noexcept {
    word(h.order);
    word(static_cast<std::uint32_t>(h.pair));
  }
  constexpr void gear(const Gear<S>& g) noexcept {
    word(g.whole_ratio);
    word(static_cast<std::uint32_t>(g.ratio_fraction.fraction));
    word(static_cast<std::uint32_t>(g.ratio_fraction.fraction >> 32));
    word(static_cast<std::uint32_t>(g.output));
    word(g.motor_encoder ? 1 : 0);
  }
};

/// The parameters that a block of a version has.
template <typename V, typename T>
constexpr void visit(V& visitor, T& joint, std::uint8_t layout) noexcept {
  parameters::visit_unlimited(visitor, joint);
  if (layout >= first_with_limits) parameters::visit_limits(visitor, joint);
}

/// Everything that does not depend on the joint.
constexpr BlockStatus whole(Bytes bytes) noexcept {
  if (bytes.size() < head + tail) return BlockStatus::truncated;
  for (std::size_t k = 0; k < mark.size(); ++k) {
    if (bytes[k] != mark[k]) return BlockStatus::not_a_block;
  }
  if (bytes[4] < oldest) return BlockStatus::older;
  if (bytes[4] > version) return BlockStatus::newer;
  const std::uint32_t size = read<std::uint32_t>(bytes, 12);
  if (size > bytes.size() - (head + tail)) return BlockStatus::truncated;
  Crc32 crc;
  crc.add(bytes.first(head + size));
  return crc.value() == read<std::uint32_t>(bytes, head + size) ? BlockStatus::ok
                                                                : BlockStatus::corrupt;
}

}  // namespace block

/// Bytes of the block of a model or a joint.
template <typename T>
constexpr std::size_t block_size(const T& joint) noexcept {
  block::Outline<typename parameters::ScalarOf<T>::type> outline;
  parameters::visit(outline, joint);
  return block::head + outline.size + block::tail;
}

/// Replaces all parameters of a model or a joint; anything but `ok` leaves them as they are.
template <typename T>
constexpr BlockStatus load(Bytes bytes, T& joint) noexcept {
  using S = typename parameters::ScalarOf<T>::type;
  const BlockStatus status = block::whole(bytes);
  if (status != BlockStatus::ok) return status;
  if (bytes[5] != sizeof(S)) return BlockStatus::other_scalar;
  const std::uint8_t layout = bytes[4];
  block::Outline<S> outline;
  block::visit(outline, joint, layout);
  if (block::read<std::uint32_t>(bytes, 8) != outline.crc.value() ||
      block::read<std::uint32_t>(bytes, 12) != outline.size) {
    return BlockStatus::other_structure;
  }
  block::Reader<S, false> check{bytes};
  block::visit(check, static_cast<const T&>(joint), layout);
  if (!check.good) return BlockStatus::out_of_range;
  block::Reader<S, true> take{bytes};
  block::visit(take, joint, layout);
  if (layout < block::first_with_limits) joint.limits = {};
  return BlockStatus::ok;
}

/// Writes the block of a model or a joint; `size`: bytes written.
template <typename T>
constexpr BlockStatus save(const T& joint, std::span<std::uint8_t> bytes,
                           std::size_t& size) noexcept {
  using S = typename parameters::ScalarOf<T>::type;
  block::Outline<S> outline;
  parameters::visit(outline, joint);
  const std::size_t needed = block::head + outline.size + block::tail;
  if (bytes.size() < needed) return BlockStatus::no_room;
  for (std::size_t k = 0; k < block::mark.size(); ++k) bytes[k] = block::mark[k];
  bytes[4] = block::version;
  bytes[5] = sizeof(S);
  block::write(bytes, 6, std::uint16_t(0));
  block::write(bytes, 8, outline.crc.value());
  block::write(bytes, 12, static_cast<std::uint32_t>(outline.size));
  block::Writer<S> writer{bytes};
  parameters::visit(writer, joint);
  Crc32 crc;
  crc.add(Bytes(bytes.first(needed - block::tail)));
  block::write(bytes, needed - block::tail, crc.value());
  size = needed;
  return BlockStatus::ok;
}

}  // namespace flexspline
