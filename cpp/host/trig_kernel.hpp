/// Sums of harmonics (see trig_gram.hpp for the formulas and trig_layout.hpp for the layout).
///
/// 256 samples at a time, harmonic by harmonic: (cos mθ, sin mθ) are multiplied with up to six
/// dense columns while the sums stay in registers, then rotated on to m + 1. Orders above n come
/// from neighbouring harmonics:
///   Σ cos 2mθ = 2 Σ cos² mθ - Σ 1                     Σ sin 2mθ = 2 Σ sin mθ cos mθ
///   Σ cos (2m+1)θ = 2 Σ cos mθ cos (m+1)θ - Σ cos θ
///   Σ sin (2m+1)θ = 2 Σ sin mθ cos (m+1)θ + Σ sin θ
#pragma once

#include "host/gram_kernel.hpp"
#include "host/trig_layout.hpp"

namespace {

constexpr int first_pass_columns = 5;
constexpr int later_pass_columns = 6;

/// One harmonic over the samples in hand, and where its rotation goes (may be the same place).
/// Passed by value: stores of vectors may alias anything but locals, and references would be read
/// again for every vector.
struct Harmonic {
  const double* cosine;
  const double* sine;
  const double* base_cosine;
  const double* base_sine;
  double* next_cosine;
  double* next_sine;
  const double* weights;
  std::size_t first;  ///< of the dense columns; the pointers above are already there
  std::size_t samples;
};

template <typename V>
inline void add_to(double* sums, V value) noexcept {
  store<V>(sums, load<V>(sums) + value);
}

/// own (first pass only): Σ cos, Σ sin; cross: Σ d cos, Σ d sin per column; `width` lanes each.
template <typename V, int R, bool first_pass, bool weighted>
inline void cross_sums(Harmonic at, const double* const* columns, double* own,
                       double* cross) noexcept {
  const double* dense[R > 0 ? R : 1];
  for (int r = 0; r < R; ++r) dense[r] = columns[r] + at.first;
  V own_c{}, own_s{};
  V cross_c[R > 0 ? R : 1] = {};
  V cross_s[R > 0 ? R : 1] = {};
  for (std::size_t k = 0; k < at.samples; k += step<V>) {
    V c = load<V>(at.cosine + k);
    V s = load<V>(at.sine + k);
    if constexpr (weighted) {
      const V w = load<V>(at.weights + k);
      c = c * w;
      s = s * w;
    }
    if constexpr (first_pass) {
      own_c = own_c + c;
      own_s = own_s + s;
    }
    for (int r = 0; r < R; ++r) {
      const V d = in_register(load<V>(dense[r] + k));
      cross_c[r] = fused(d, c, cross_c[r]);
      cross_s[r] = fused(d, s, cross_s[r]);
    }
  }
  if constexpr (first_pass) {
    add_to(own, own_c);
    add_to(own + width, own_s);
  }
  for (int r = 0; r < R; ++r) {
    add_to(cross + 2 * width * static_cast<std::size_t>(r), cross_c[r]);
    add_to(cross + 2 * width * static_cast<std::size_t>(r) + width, cross_s[r]);
  }
}

/// The next harmonic; and Σ c², Σ s c, Σ c c', Σ s c' of this one and the next, `width` lanes each.
template <typename V, bool square, bool weighted>
inline void rotate(Harmonic at, double* squares) noexcept {
  V cc{}, sc{}, cn{}, sn{};
  for (std::size_t k = 0; k < at.samples; k += step<V>) {
    const V c = load<V>(at.cosine + k);
    const V s = load<V>(at.sine + k);
    const V c1 = load<V>(at.base_cosine + k);
    const V s1 = load<V>(at.base_sine + k);
    const V next = fused(c, c1, -(s * s1));
    store<V>(at.next_cosine + k, next);
    store<V>(at.next_sine + k, fused(s, c1, c * s1));
    if constexpr (square) {
      V wc = c, ws = s;
      if constexpr (weighted) {
        const V w = load<V>(at.weights + k);
        wc = c * w;
        ws = s * w;
      }
      cc = fused(wc, c, cc);
      sc = fused(ws, c, sc);
      cn = fused(wc, next, cn);
      sn = fused(ws, next, sn);
    }
  }
  if constexpr (square) {
    add_to(squares, cc);
    add_to(squares + width, sc);
    add_to(squares + 2 * width, cn);
    add_to(squares + 3 * width, sn);
  }
}

template <typename V, bool first_pass, bool weighted>
inline void cross_pass(int columns_in_pass, Harmonic at, const double* const* columns, double* own,
                       double* cross) noexcept {
  switch (columns_in_pass) {
    case 0:
      return cross_sums<V, 0, first_pass, weighted>(at, columns, own, cross);
    case 1:
      return cross_sums<V, 1, first_pass, weighted>(at, columns, own, cross);
    case 2:
      return cross_sums<V, 2, first_pass, weighted>(at, columns, own, cross);
    case 3:
      return cross_sums<V, 3, first_pass, weighted>(at, columns, own, cross);
    case 4:
      return cross_sums<V, 4, first_pass, weighted>(at, columns, own, cross);
    case 5:
      return cross_sums<V, 5, first_pass, weighted>(at, columns, own, cross);
    default:
      return cross_sums<V, 6, first_pass, weighted>(at, columns, own, cross);
  }
}

/// All sums of one harmonic m over the samples in hand, into lanes.
template <typename V, bool weighted>
void add_harmonic(Harmonic at, const double* const* columns, int count, bool squares,
                  double* lanes) noexcept {
  double* const cross = lanes + 6 * width;
  int done = at_most(first_pass_columns, count);
  cross_pass<V, true, weighted>(done, at, columns, lanes, cross);
  while (done < count) {
    const int now = at_most(later_pass_columns, count - done);
    cross_pass<V, false, weighted>(now, at, columns + done, nullptr,
                                   cross + 2 * width * static_cast<std::size_t>(done));
    done += now;
  }
  if (squares) {
    rotate<V, true, weighted>(at, lanes + 2 * width);
  } else {
    rotate<V, false, weighted>(at, nullptr);
  }
}

/// The harmonics 1..n of up to 256 samples; from the second on they are rotated in place in `work`.
template <typename V, bool weighted>
void add_harmonics(const double* const* columns, int count, int harmonics, Harmonic at,
                   double* work, double* lanes) noexcept {
  const std::size_t stride = width * TrigLayout{static_cast<std::size_t>(count), 0}.lanes();
  at.cosine = at.base_cosine;
  at.sine = at.base_sine;
  at.next_cosine = work;
  at.next_sine = work + trig_block;
  for (int m = 1; m <= harmonics; ++m) {
    add_harmonic<V, weighted>(at, columns, count, 2 * m >= harmonics, lanes);
    at.cosine = at.next_cosine;
    at.sine = at.next_sine;
    lanes += stride;
  }
}

/// Σ w (returned and added) and Σ w d.
double add_linear_sums(const double* const* columns, int count, const double* weights,
                       std::size_t samples, double* sums) noexcept {
  const std::size_t bulk = samples / width * width;
  double weight = static_cast<double>(samples);
  for (int column = weights != nullptr ? -1 : 0; column < count; ++column) {
    const double* const d = column < 0 ? weights : columns[column];
    const bool weighted = weights != nullptr && column >= 0;
    Lanes wide{};
    double rest = 0;
    for (std::size_t k = 0; k < bulk; k += width) {
      const Lanes x = load<Lanes>(d + k);
      wide = wide + (weighted ? x * load<Lanes>(weights + k) : x);
    }
    for (std::size_t k = bulk; k < samples; ++k) rest += weighted ? d[k] * weights[k] : d[k];
    if (column < 0) weight = sum_of(wide) + rest;
    if (column >= 0)
      sums[TrigLayout::linear + static_cast<std::size_t>(column)] += sum_of(wide) + rest;
  }
  sums[TrigLayout::weight] += weight;
  return weight;
}

/// Adds what the lanes of one call hold to C_m, S_m (m <= 2n) and the cross sums.
void add_lanes(const double* lanes, TrigLayout layout, double weight, double* sums) noexcept {
  const auto total = [&](std::size_t m, std::size_t which) {
    return sum_of(load<Lanes>(lanes + ((m - 1) * layout.lanes() + which) * width));
  };
  const std::size_t n = layout.harmonics;
  const double cosine = total(1, 0);
  const double sine = total(1, 1);
  for (std::size_t m = 1; m <= n; ++m) {
    sums[layout.order(m)] += total(m, 0);
    sums[layout.order(m) + 1] += total(m, 1);
    for (std::size_t column = 0; column < layout.dense; ++column) {
      sums[layout.cross(column, m)] += total(m, 6 + 2 * column);
      sums[layout.cross(column, m) + 1] += total(m, 7 + 2 * column);
    }
    if (2 * m > n) {
      sums[layout.order(2 * m)] += 2 * total(m, 2) - weight;
      sums[layout.order(2 * m) + 1] += 2 * total(m, 3);
    }
    if (2 * m + 1 > n && m < n) {
      sums[layout.order(2 * m + 1)] += 2 * total(m, 4) - cosine;
      sums[layout.order(2 * m + 1) + 1] += 2 * total(m, 5) + sine;
    }
  }
}

template <bool weighted>
void add_all_harmonics(const double* const* columns, int count, const double* cosine,
                       const double* sine, std::size_t samples, const double* weights,
                       int harmonics, double* work) noexcept {
  double* const lanes = work + 2 * trig_block;
  for (std::size_t first = 0; first < samples; first += trig_block) {
    const std::size_t now = samples - first < trig_block ? samples - first : trig_block;
    const std::size_t bulk = now / width * width;
    const auto part = [&](std::size_t from, std::size_t length) {
      return Harmonic{nullptr,
                      nullptr,
                      cosine + from,
                      sine + from,
                      nullptr,
                      nullptr,
                      weighted ? weights + from : nullptr,
                      from,
                      length};
    };
    add_harmonics<Lanes, weighted>(columns, count, harmonics, part(first, bulk), work, lanes);
    if (bulk == now) continue;
    add_harmonics<double, weighted>(columns, count, harmonics, part(first + bulk, now - bulk), work,
                                    lanes);
  }
}

void trig_sums(const double* const* columns, int count, const double* cosine, const double* sine,
               std::size_t samples, const double* weights, int harmonics, double* sums,
               double* work) noexcept {
  const TrigLayout layout{static_cast<std::size_t>(count), static_cast<std::size_t>(harmonics)};
  double* const lanes = work + 2 * trig_block;
  for (std::size_t i = 0; i < width * layout.lanes() * layout.harmonics; ++i) lanes[i] = 0;
  const double weight = add_linear_sums(columns, count, weights, samples, sums);
  gram(columns, count, samples, weights, sums + layout.products());
  if (weights != nullptr) {
    add_all_harmonics<true>(columns, count, cosine, sine, samples, weights, harmonics, work);
  } else {
    add_all_harmonics<false>(columns, count, cosine, sine, samples, weights, harmonics, work);
  }
  if (harmonics > 0) add_lanes(lanes, layout, weight, sums);
}

}  // namespace
