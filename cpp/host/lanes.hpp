/// A few doubles side by side, as wide as the instruction set of this translation unit.
///
/// Internal to the kernels: everything has internal linkage, so code made for a wide instruction
/// set can never be linked into the portable path (an inline function or a standard template
/// compiled with AVX could). For the same reason the kernels use nothing of namespace std.
/// A kernel is a template on V = Lanes (the bulk) or double (the samples left over).
#pragma once

#include <cstddef>

#if defined(__FMA__)
#include <immintrin.h>
#endif

namespace {

#if defined(__GNUC__)

#if defined(__AVX512F__)
constexpr std::size_t width = 8;
#elif defined(__AVX__)
constexpr std::size_t width = 4;
#else
constexpr std::size_t width = 2;
#endif
typedef double Lanes __attribute__((vector_size(8 * width)));
typedef double LooseLanes __attribute__((vector_size(8 * width), aligned(8), may_alias));

template <typename V>
inline V select_less(V a, V b, V then, V otherwise) noexcept {
  return a < b ? then : otherwise;
}

#else  // compilers without vector types: a small array, left to the optimiser

constexpr std::size_t width = 2;
struct Lanes {
  double lane[width];
  double operator[](std::size_t i) const noexcept { return lane[i]; }
  double& operator[](std::size_t i) noexcept { return lane[i]; }
};
using LooseLanes = Lanes;

inline Lanes operator+(Lanes a, Lanes b) noexcept { return {{a[0] + b[0], a[1] + b[1]}}; }
inline Lanes operator-(Lanes a, Lanes b) noexcept { return {{a[0] - b[0], a[1] - b[1]}}; }
inline Lanes operator*(Lanes a, Lanes b) noexcept { return {{a[0] * b[0], a[1] * b[1]}}; }
inline Lanes operator-(Lanes a) noexcept { return {{-a[0], -a[1]}}; }
inline double select_less(double a, double b, double then, double otherwise) noexcept {
  return a < b ? then : otherwise;
}
inline Lanes select_less(Lanes a, Lanes b, Lanes then, Lanes otherwise) noexcept {
  return {{a[0] < b[0] ? then[0] : otherwise[0], a[1] < b[1] ? then[1] : otherwise[1]}};
}

#endif

template <typename V>
constexpr std::size_t step = sizeof(V) / sizeof(double);

template <typename V>
inline V load(const double* from) noexcept {
  if constexpr (step<V> == 1) {
    return *from;
  } else {
    return *reinterpret_cast<const LooseLanes*>(from);
  }
}

template <typename V>
inline void store(double* to, V value) noexcept {
  if constexpr (step<V> == 1) {
    *to = value;
  } else {
    *reinterpret_cast<LooseLanes*>(to) = value;
  }
}

/// The same number in every lane.
template <typename V>
inline V all(double value) noexcept {
  V result{};
  if constexpr (step<V> == 1) {
    result = value;
  } else {
    for (std::size_t i = 0; i < width; ++i) result[i] = value;
  }
  return result;
}

/// Keeps a loaded value in a register: compilers like to read it from memory at every use, and two
/// loads per multiplication is more than a processor can feed.
template <typename V>
inline V in_register(V value) noexcept {
#if defined(__GNUC__) && defined(__x86_64__)
  __asm__("" : "+v"(value));
#endif
  return value;
}

template <typename V>
inline double sum_of(V value) noexcept {
  if constexpr (step<V> == 1) {
    return value;
  } else {
    double half[width];
    for (std::size_t i = 0; i < width; ++i) half[i] = value[i];
    for (std::size_t n = width / 2; n > 0; n /= 2) {
      for (std::size_t i = 0; i < n; ++i) half[i] += half[i + n];
    }
    return half[0];
  }
}

/// a b + c: rounded once where the instruction exists, else twice.
#if defined(__FMA__)
constexpr bool has_fma = true;
inline double fused(double a, double b, double c) noexcept { return __builtin_fma(a, b, c); }
#if defined(__AVX512F__)
inline Lanes fused(Lanes a, Lanes b, Lanes c) noexcept { return _mm512_fmadd_pd(a, b, c); }
#else
inline Lanes fused(Lanes a, Lanes b, Lanes c) noexcept { return _mm256_fmadd_pd(a, b, c); }
#endif
#elif defined(__aarch64__) && defined(__GNUC__)
constexpr bool has_fma = true;
inline double fused(double a, double b, double c) noexcept { return __builtin_fma(a, b, c); }
inline Lanes fused(Lanes a, Lanes b, Lanes c) noexcept {
  return Lanes{__builtin_fma(a[0], b[0], c[0]), __builtin_fma(a[1], b[1], c[1])};
}
#else
constexpr bool has_fma = false;
template <typename V>
inline V fused(V a, V b, V c) noexcept {
  return a * b + c;
}
#endif

}  // namespace
